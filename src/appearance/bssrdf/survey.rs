//! The first look at all data.

use std::ops::Range;

use super::{
    BssrdfError, Dataset,
    passes::{BAND_ROWS, Source},
    planes::Planes,
};

/// What the data look like.
pub struct Survey {
    /// Σ D per distance.
    pub sums: Vec<f64>,
    /// Σ D² per distance.
    pub squares: Vec<f64>,
    /// Measurements per distance.
    pub counts: Vec<u64>,
    /// Share of each texel's window that is there, by ring.
    pub availability: Planes,
    /// Σ D · area over the rings of each texel's window.
    pub energy: Vec<f64>,
    /// D at the lit texel itself.
    pub centres: Vec<f32>,
    /// D at the pixels left, right, above and below it; NaN where a window has none.
    pub beside: Vec<[f32; 4]>,
    /// The smallest value above 0.
    pub least: f64,
    /// Values missing in windows that should be there.
    pub missing: u64,
    /// −Σ of what is negative.
    pub negative: f64,
    /// Σ of what is positive.
    pub positive: f64,
    /// The lowest values.
    pub lowest: Lowest,
}

/// The most negative value, how often it occurs, and the one above it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lowest {
    /// Below 0, or 0 where nothing is.
    pub value: f64,
    /// Times it occurs.
    pub count: u64,
    /// The next one above it, or 0.
    pub next: f64,
}

impl Lowest {
    const NONE: Self = Self { value: 0.0, count: 0, next: 0.0 };

    fn add(&mut self, value: f64, count: u64) {
        if value < self.value {
            *self = Self { value, count, next: self.value };
        } else if value == self.value {
            self.count += count;
        } else {
            self.next = self.next.min(value);
        }
    }
}

impl Source<'_> {
    /// Looks at all data once.
    pub fn survey(&self) -> Result<Survey, BssrdfError> {
        let Dataset { width, height, .. } = *self.dataset;
        let rings = self.rings;
        let (distances, pixels) = (rings.distances_mm.len(), rings.width * rings.height);
        let of_rows = |rows: usize| Survey {
            sums: vec![0.0; distances],
            squares: vec![0.0; distances],
            counts: vec![0; distances],
            availability: Planes::new(rings.len(), width, rows, 0.0),
            energy: vec![0.0; width * rows],
            centres: vec![f32::NAN; width * rows],
            beside: vec![[f32::NAN; 4]; width * rows],
            least: f64::INFINITY,
            missing: 0,
            negative: 0.0,
            positive: 0.0,
            lowest: Lowest::NONE,
        };
        let (mut survey, empty) = (of_rows(height), |band: Range<usize>| of_rows(band.len()));
        let area = self.dataset.pitch_mm * self.dataset.pitch_mm;
        let (wide, tall, middle) = (rings.width > 1, rings.height > 1, pixels / 2);
        let beside = [
            wide.then(|| middle - 1),
            wide.then(|| middle + 1),
            tall.then(|| middle - rings.width),
            tall.then(|| middle + rings.width),
        ];
        let row = |survey: &mut Survey, y: usize, windows: &[f32]| {
            let local = y % BAND_ROWS;
            for pixel in 0..pixels {
                let data = &windows[pixel * width..(pixel + 1) * width];
                for (&value, x) in data.iter().zip(0..) {
                    let value = f64::from(value);
                    if value.is_finite() {
                        survey.negative -= value.min(0.0);
                        survey.positive += value.max(0.0);
                        if value > 0.0 {
                            survey.least = survey.least.min(value);
                        } else if value < 0.0 {
                            survey.lowest.add(value, 1);
                        }
                    } else if self.dataset.is_present(y * width + x) {
                        survey.missing += 1;
                    }
                }
            }
            survey.centres[local * width..(local + 1) * width]
                .copy_from_slice(&windows[middle * width..(middle + 1) * width]);
            for (side, pixel) in beside.iter().enumerate().filter_map(|(side, pixel)| Some((side, (*pixel)?))) {
                let values = &windows[pixel * width..(pixel + 1) * width];
                let beside = &mut survey.beside[local * width..(local + 1) * width];
                beside.iter_mut().zip(values).for_each(|(beside, value)| beside[side] = *value);
            }
            for ring in 0..rings.len() {
                let share = 1.0 / rings.ring(ring).len() as f32;
                let availability = survey.availability.row_mut(ring, local);
                for offset in rings.ring(ring) {
                    let data = &windows[offset.pixel * width..(offset.pixel + 1) * width];
                    let energy = &mut survey.energy[local * width..(local + 1) * width];
                    for ((&value, availability), energy) in data.iter().zip(availability.iter_mut()).zip(energy) {
                        if value.is_finite() {
                            *energy += f64::from(value) * area;
                            survey.sums[offset.distance] += f64::from(value);
                            survey.squares[offset.distance] += f64::from(value) * f64::from(value);
                            survey.counts[offset.distance] += 1;
                            *availability += share;
                        }
                    }
                }
            }
        };
        self.pass("reading", empty, row, |band, part| {
            survey.energy[band.start * width..band.end * width].copy_from_slice(&part.energy);
            survey.centres[band.start * width..band.end * width].copy_from_slice(&part.centres);
            survey.beside[band.start * width..band.end * width].copy_from_slice(&part.beside);
            survey.least = survey.least.min(part.least);
            for ring in 0..rings.len() {
                for (local, y) in band.clone().enumerate() {
                    survey.availability.row_mut(ring, y).copy_from_slice(part.availability.row(ring, local));
                }
            }
            for distance in 0..distances {
                survey.sums[distance] += part.sums[distance];
                survey.squares[distance] += part.squares[distance];
                survey.counts[distance] += part.counts[distance];
            }
            survey.missing += part.missing;
            survey.negative += part.negative;
            survey.positive += part.positive;
            if part.lowest.count > 0 {
                survey.lowest.add(part.lowest.value, part.lowest.count);
                survey.lowest.add(part.lowest.next, 0);
            }
        })?;
        Ok(survey)
    }
}

/// Texels with the least light, this share of all, tell best what is added to every value.
const DARKEST: f64 = 0.25;

impl Survey {
    /// The quarter of the texels whose windows hold the least light.
    pub fn darkest(&self, dataset: &Dataset) -> Vec<bool> {
        let mut known: Vec<f64> =
            (0..self.energy.len()).filter(|texel| dataset.is_present(*texel)).map(|texel| self.energy[texel]).collect();
        known.sort_by(f64::total_cmp);
        let bound = known.get((DARKEST * known.len() as f64) as usize).copied().unwrap_or(f64::NEG_INFINITY);
        (0..self.energy.len()).map(|texel| dataset.is_present(texel) && self.energy[texel] <= bound).collect()
    }
}
