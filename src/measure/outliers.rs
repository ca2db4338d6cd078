//! Pixels that do not belong: hot ones, dust, scratches. Each is judged against the median of its ring.

use std::collections::BTreeSet;

use super::Finding;
use super::bracket::Radiance;
use super::rings::{Grid, Model};

/// A pixel this many standard deviations off its ring is masked…
const SIGMAS: f64 = 6.0;
/// …if it also is by this share of the ring's median: tilt and slope across a pixel are less.
const SHARE: f64 = 0.35;
/// In the dark a hot pixel is brighter than all its neighbours by this factor (and [`SIGMAS`]).
const HOT_FACTOR: f64 = 1.5;
/// Inside this radius in pixels a ring has too few pixels for a median.
const SPARED_PX: f64 = 4.0;
/// At most so many values of a ring go into its median; it is then good to 2% of the scatter.
const MEDIAN_VALUES: usize = 4096;
/// Patches from this size on are blemishes, not hot pixels.
const BLEMISH_PIXELS: usize = 4;
/// Hot pixels listed by place.
const LISTED: usize = 20;

/// Pixels to be masked.
#[derive(Debug, Default)]
pub(super) struct Outliers {
    pixels: BTreeSet<usize>,
}

impl Outliers {
    /// Adds the pixels that stand out of the dark.
    pub fn add_hot(&mut self, dark: &Radiance) {
        let (width, height) = (dark.width, dark.height);
        for y in 1..height.saturating_sub(1) {
            for x in 1..width - 1 {
                let i = y * width + x;
                let value = f64::from(dark.value[i]);
                let around = [i - 1, i + 1, i - width, i + width].map(|i| f64::from(dark.value[i]));
                let brightest = around.into_iter().fold(f64::MIN, f64::max).max(0.0);
                let sigma = f64::from(dark.variance[i]).sqrt();
                if !(value <= HOT_FACTOR * brightest + SIGMAS * sigma) {
                    self.pixels.insert(i);
                }
            }
        }
    }

    /// Adds the pixels that stand out of their rings; corners beyond the last whole ring are not judged, and not used.
    pub fn add_odd(&mut self, picture: &Radiance, grid: &Grid) {
        let (medians, scatter) = medians(picture, grid);
        let model = Model::through(grid, &medians);
        let scatter = Model::through(grid, &scatter);
        let reach_mm = grid.bins as f64 * grid.bin_mm;
        for y in 0..picture.height {
            for x in 0..picture.width {
                let i = y * picture.width + x;
                let r_px = libm::hypot(x as f64 - grid.centre[0], y as f64 - grid.centre[1]);
                let r_mm = r_px * grid.mm_per_pixel;
                if r_px < SPARED_PX || r_mm > reach_mm || picture.value[i].is_nan() {
                    continue;
                }
                let (expected, value) = (model.at(r_mm), f64::from(picture.value[i]));
                let sigma = f64::from(picture.variance[i]).sqrt().max(scatter.at(r_mm));
                if (value - expected).abs() > SIGMAS * sigma + SHARE * expected.abs() {
                    self.pixels.insert(i);
                }
            }
        }
    }

    /// Takes them out of a picture.
    pub fn mask(&self, picture: &mut Radiance) {
        self.pixels.iter().for_each(|&i| picture.value[i] = f32::NAN);
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// In words: single pixels are hot, patches are blemishes.
    pub fn findings(&self, width: usize) -> Vec<Finding> {
        let (mut hot, mut blemishes, mut blemished) = (Vec::new(), 0, 0);
        let mut left = self.pixels.clone();
        while let Some(first) = left.pop_first() {
            let mut patch = vec![first];
            let mut next = 0;
            while let Some(&i) = patch.get(next) {
                next += 1;
                for row in [i.wrapping_sub(width), i, i + width] {
                    for near in [row.wrapping_sub(1), row, row.wrapping_add(1)] {
                        if left.remove(&near) {
                            patch.push(near);
                        }
                    }
                }
            }
            if patch.len() < BLEMISH_PIXELS {
                hot.extend(patch.iter().map(|i| [(i % width) as u32, (i / width) as u32]));
            } else {
                blemishes += 1;
                blemished += patch.len();
            }
        }
        let mut findings = Vec::new();
        if !hot.is_empty() {
            findings.push(Finding::HotPixels { count: hot.len(), first: hot.into_iter().take(LISTED).collect() });
        }
        if blemishes > 0 {
            findings.push(Finding::Blemishes { count: blemishes, pixels: blemished });
        }
        findings
    }
}

/// Median and 1.48 times the median deviation of every ring; pixels beyond the last ring count in it no more.
fn medians(picture: &Radiance, grid: &Grid) -> (Vec<f64>, Vec<f64>) {
    let per_bin = grid.mm_per_pixel / grid.bin_mm;
    let stride = |bin: usize| {
        let pixels = grid.area(bin) / (grid.mm_per_pixel * grid.mm_per_pixel);
        (pixels / MEDIAN_VALUES as f64).ceil().max(1.0) as usize
    };
    let strides: Vec<usize> = (0..grid.bins).map(stride).collect();
    let mut seen = vec![0_usize; grid.bins];
    let mut values: Vec<Vec<f32>> = vec![Vec::new(); grid.bins];
    for y in 0..picture.height {
        for x in 0..picture.width {
            let bin = (libm::hypot(x as f64 - grid.centre[0], y as f64 - grid.centre[1]) * per_bin) as usize;
            let value = picture.at(x, y);
            if bin >= grid.bins || value.is_nan() {
                continue;
            }
            if seen[bin].is_multiple_of(strides[bin]) {
                values[bin].push(value);
            }
            seen[bin] += 1;
        }
    }
    let both = |values: &mut Vec<f32>| {
        let Some(median) = median(values) else { return (0.0, f64::INFINITY) };
        values.iter_mut().for_each(|value| *value = (*value - median).abs());
        (f64::from(median), 1.4826 * f64::from(median_of_some(values)))
    };
    // Rings narrower than a pixel may have none: the nearest one inside speaks for them.
    let mut all: Vec<(f64, f64)> = values.iter_mut().map(both).collect();
    for bin in 1..all.len() {
        if all[bin].1.is_infinite() {
            all[bin] = all[bin - 1];
        }
    }
    all.into_iter().unzip()
}

fn median(values: &mut [f32]) -> Option<f32> {
    (!values.is_empty()).then(|| median_of_some(values))
}

fn median_of_some(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
