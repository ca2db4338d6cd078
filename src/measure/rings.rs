//! Means over rings: every pixel counts in a ring by the share of its area inside.
//!
//! Pixel (i, j) is the square of side 1 about (i, j). Near the centre its share is counted on a fine grid; farther out,
//! where a ring's edge is straight across a pixel, it is the exact share of a square cut by a line.

use std::f64::consts::PI;

use super::bracket::Radiance;
use crate::parallel;

/// Inside this radius in pixels areas are counted on a grid…
const COUNTED_PX: f64 = 12.0;
/// …of this many points a side: shares to 0.5%.
const COUNTED_SIDE: usize = 16;
/// Scatter about the model counts from this radius on, pixels; nearer, the profile bends within a pixel and scatter is
/// no noise.
const SCATTER_PX: f64 = 6.0;
/// Rows summed in one go; fixed, so that sums do not depend on threads.
const BLOCK_ROWS: usize = 32;
/// The model's table has this many steps a ring.
const MODEL_STEPS: f64 = 8.0;

/// Rings about a centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Grid {
    /// Column and row, from the centre of the first pixel.
    pub centre: [f64; 2],
    pub mm_per_pixel: f64,
    pub bin_mm: f64,
    pub bins: usize,
}

impl Grid {
    /// As many rings as lie in the picture as a whole.
    pub fn whole(centre: [f64; 2], width: usize, height: usize, mm_per_pixel: f64, bin_mm: f64) -> Self {
        let margin = |at: f64, length: usize| (at + 0.5).min(length as f64 - 0.5 - at);
        let radius_mm = margin(centre[0], width).min(margin(centre[1], height)) * mm_per_pixel;
        Self { centre, mm_per_pixel, bin_mm, bins: (radius_mm / bin_mm).max(0.0) as usize }
    }

    /// Mean radius of a ring by area, mm.
    pub fn radius(&self, bin: usize) -> f64 {
        let (a, b) = (bin as f64 * self.bin_mm, (bin + 1) as f64 * self.bin_mm);
        2.0 / 3.0 * (a * a + a * b + b * b) / (a + b)
    }

    /// Area of a ring, mm².
    pub fn area(&self, bin: usize) -> f64 {
        PI * self.bin_mm * self.bin_mm * (2 * bin + 1) as f64
    }

    /// Calls `add(bin, share)` for every ring a pixel lies in; (dx, dy) leads from the centre to the pixel, in pixels.
    pub fn shares(&self, dx: f64, dy: f64, mut add: impl FnMut(usize, f64)) {
        let per_bin = self.mm_per_pixel / self.bin_mm;
        let r = libm::hypot(dx, dy);
        if r < COUNTED_PX {
            let first = ((r - 0.75).max(0.0) * per_bin) as usize;
            let mut counts = [0_u32; 64];
            let step = 1.0 / COUNTED_SIDE as f64;
            for i in 0..COUNTED_SIDE {
                for j in 0..COUNTED_SIDE {
                    let (x, y) = (dx - 0.5 + (i as f64 + 0.5) * step, dy - 0.5 + (j as f64 + 0.5) * step);
                    let bin = (libm::hypot(x, y) * per_bin) as usize;
                    counts[(bin - first.min(bin)).min(counts.len() - 1)] += 1;
                }
            }
            let all = f64::from(COUNTED_SIDE as u32).powi(2);
            counts.iter().enumerate().filter(|(_, count)| **count > 0).for_each(|(bin, count)| {
                add(first + bin, f64::from(*count) / all);
            });
            return;
        }
        let (long, short) = (dx.abs().max(dy.abs()) / r, dx.abs().min(dy.abs()) / r);
        let reach = 0.5 * (long + short);
        let mut bin = ((r - reach).max(0.0) * per_bin) as usize;
        let mut below = 0.0;
        loop {
            let edge = (bin + 1) as f64 / per_bin - r;
            let inside = if edge >= reach { 1.0 } else { square_below(edge, long, short) };
            if inside > below {
                add(bin, inside - below);
            }
            if inside >= 1.0 {
                return;
            }
            below = inside;
            bin += 1;
        }
    }
}

/// Share of the unit square below the line at `t` from its centre, whose normal has the components `long` ≥ `short` ≥
/// 0.
fn square_below(t: f64, long: f64, short: f64) -> f64 {
    if t > 0.0 {
        return 1.0 - square_below(-t, long, short);
    }
    let (outer, inner) = (0.5 * (long + short), 0.5 * (long - short));
    if t <= -outer {
        0.0
    } else if t <= -inner {
        (t + outer).powi(2) / (2.0 * long * short)
    } else {
        0.5 + t / long
    }
}

/// The profile as a function of the radius, for a pixel to be compared with its ring.
pub(super) struct Model {
    step_mm: f64,
    values: Vec<f64>,
}

impl Model {
    /// Between the rings' mean radii: straight in the logarithm, or in the value where noise made one negative.
    pub fn through(grid: &Grid, means: &[f64]) -> Self {
        let step_mm = grid.bin_mm / MODEL_STEPS;
        let last = means.len().saturating_sub(1);
        let mut bin = 0;
        let value = |i: usize| {
            let r = i as f64 * step_mm;
            while bin + 1 < last && grid.radius(bin + 1) < r {
                bin += 1;
            }
            let (a, b) = (means[bin], means[(bin + 1).min(last)]);
            let span = grid.radius(bin + 1) - grid.radius(bin);
            // Inside the first mean radius the profile is not continued upwards: nothing is compared there.
            let at = ((r - grid.radius(bin)) / span).clamp(0.0, 1.0);
            if a > 0.0 && b > 0.0 { a * libm::pow(b / a, at) } else { a + (b - a) * at }
        };
        let count = (means.len() as f64 * MODEL_STEPS) as usize + 1;
        Self { step_mm, values: (0..count).map(value).collect() }
    }

    /// The value at a radius in mm; the last one beyond the end.
    pub fn at(&self, r_mm: f64) -> f64 {
        let x = r_mm / self.step_mm;
        let i = (x as usize).min(self.values.len() - 2);
        let at = (x - i as f64).min(1.0);
        self.values[i] + at * (self.values[i + 1] - self.values[i])
    }
}

/// Sums over one ring.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    weight: f64,
    value: f64,
    variance: f64,
    square: f64,
    harmonics: [f64; 4],
    /// Weight and difference to the model, by direction.
    sectors: [[f64; 2]; SECTORS],
}

/// Directions that are told apart: octants, the first from the right towards down.
pub(super) const SECTORS: usize = 8;

fn sector(dx: f64, dy: f64) -> usize {
    let half = if dy < 0.0 || (dy == 0.0 && dx < 0.0) { 4 } else { 0 };
    let (x, y) = if half == 4 { (-dx, -dy) } else { (dx, dy) };
    half + match (x >= 0.0, x.abs() > y) {
        (true, true) => 0,
        (true, false) => 1,
        (false, false) => 2,
        (false, true) => 3,
    }
}

/// What the rings hold.
#[derive(Debug, Clone)]
pub(super) struct Rings {
    pub grid: Grid,
    /// Mean of each ring; NaN if it has no pixel.
    pub mean: Vec<f64>,
    /// Standard error of each mean: the pixels' noise, or their scatter about the model where that is larger.
    pub error: Vec<f64>,
    /// Amplitudes about the model: cos θ, sin θ, cos 2θ, sin 2θ. x and θ = 0 point right, y down.
    pub harmonics: Vec<[f64; 4]>,
    /// Mean difference to the model in each octant, NaN where it has less than half of its pixels.
    pub sectors: Vec<[f64; SECTORS]>,
}

impl Rings {
    /// Sums up a picture; `model` is the profile so far, from which scatter and harmonics are told.
    pub fn of(picture: &Radiance, grid: Grid, model: Option<&Model>) -> Self {
        let reach = (grid.bins as f64 * grid.bin_mm / grid.mm_per_pixel).ceil() as usize + 1;
        let near = |at: f64, length: usize| {
            let middle = at.max(0.0) as usize;
            (middle.saturating_sub(reach), (middle + reach + 1).min(length))
        };
        let (columns, rows) = (near(grid.centre[0], picture.width), near(grid.centre[1], picture.height));
        let blocks: Vec<usize> = (rows.0..rows.1).step_by(BLOCK_ROWS).collect();
        let sum = |first: &usize| {
            let mut sums = vec![Sums::default(); grid.bins];
            for y in *first..(first + BLOCK_ROWS).min(rows.1) {
                for x in columns.0..columns.1 {
                    add_pixel(&mut sums, picture, &grid, model, x, y);
                }
            }
            sums
        };
        let parts: Vec<Vec<Sums>> = parallel::map_all(&blocks, sum);
        let mut total = vec![Sums::default(); grid.bins];
        for part in &parts {
            total.iter_mut().zip(part).for_each(|(total, part)| total.add(part));
        }
        let pixels = |sums: &Sums| (sums.weight > 0.0).then_some(sums.weight);
        let mean = total.iter().map(|s| pixels(s).map_or(f64::NAN, |n| s.value / n)).collect();
        let error = total.iter().map(|s| pixels(s).map_or(f64::NAN, |n| s.variance.max(s.square).sqrt() / n));
        let harmonics = total.iter().map(|s| s.harmonics.map(|h| pixels(s).map_or(0.0, |n| 2.0 * h / n)));
        let sector = |s: &Sums| {
            let least = 0.5 * s.weight / SECTORS as f64;
            s.sectors.map(|[weight, difference]| if weight > least { difference / weight } else { f64::NAN })
        };
        let sectors = total.iter().map(sector).collect();
        Self { grid, mean, error: error.collect(), harmonics: harmonics.collect(), sectors }
    }
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.weight += other.weight;
        self.value += other.value;
        self.variance += other.variance;
        self.square += other.square;
        self.harmonics.iter_mut().zip(other.harmonics).for_each(|(sum, other)| *sum += other);
        for (sum, other) in self.sectors.iter_mut().flatten().zip(other.sectors.iter().flatten()) {
            *sum += other;
        }
    }
}

fn add_pixel(sums: &mut [Sums], picture: &Radiance, grid: &Grid, model: Option<&Model>, x: usize, y: usize) {
    let i = y * picture.width + x;
    let value = f64::from(picture.value[i]);
    if value.is_nan() {
        return;
    }
    let variance = f64::from(picture.variance[i]);
    let (dx, dy) = (x as f64 - grid.centre[0], y as f64 - grid.centre[1]);
    let r = libm::hypot(dx, dy);
    let (difference, harmonics) = match model {
        Some(model) if r > 0.0 => {
            let difference = value - model.at(r * grid.mm_per_pixel);
            let (cos, sin) = (dx / r, dy / r);
            (difference, [cos, sin, cos * cos - sin * sin, 2.0 * cos * sin].map(|basis| difference * basis))
        }
        _ => (0.0, [0.0; 4]),
    };
    let sector = sector(dx, dy);
    let scatter = if r < SCATTER_PX { 0.0 } else { difference * difference };
    grid.shares(dx, dy, |bin, share| {
        let Some(sums) = sums.get_mut(bin) else { return };
        sums.weight += share;
        sums.value += share * value;
        sums.variance += share * share * variance;
        sums.square += share * share * scatter;
        sums.harmonics.iter_mut().zip(harmonics).for_each(|(sum, harmonic)| *sum += share * harmonic);
        let [weight, sum] = &mut sums.sectors[sector];
        *weight += share;
        *sum += share * difference;
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shares of a pixel sum to 1, and those of all pixels to the ring's area, with either rule.
    #[test]
    fn shares_add_up_to_areas() {
        let grid = Grid { centre: [40.3, 39.8], mm_per_pixel: 0.1, bin_mm: 0.07, bins: 55 };
        let mut areas = vec![0.0; 100];
        for y in 0..80 {
            for x in 0..80 {
                let mut all = 0.0;
                grid.shares(f64::from(x) - grid.centre[0], f64::from(y) - grid.centre[1], |bin, share| {
                    all += share;
                    if bin < areas.len() {
                        areas[bin] += share * 0.01;
                    }
                });
                assert!((all - 1.0).abs() < 1e-12, "({x}, {y}): {all}");
            }
        }
        for (bin, area) in areas.iter().enumerate().take(grid.bins) {
            let exact = grid.area(bin);
            assert!((area / exact - 1.0).abs() < if bin == 0 { 0.1 } else { 0.03 }, "ring {bin}: {area} for {exact}");
        }
    }

    #[test]
    fn a_square_is_cut_by_lines() {
        let (long, short) = (0.8, 0.6);
        assert_eq!(square_below(0.0, long, short), 0.5);
        assert_eq!(square_below(0.75, long, short), 1.0);
        // Brute force.
        let t = -0.3;
        let inside = (0..1000)
            .flat_map(|i| (0..1000).map(move |j| (f64::from(i) / 999.0 - 0.5, f64::from(j) / 999.0 - 0.5)))
            .filter(|(x, y)| x * long + y * short < t)
            .count();
        assert!((square_below(t, long, short) - inside as f64 / 1e6).abs() < 1e-3);
    }
}
