//! The centre of highest radial symmetry, and what asymmetry is left about it.
//!
//! About a point δ off the true centre a profile R(r) shows the first harmonic −R′(r) δ·e(θ) in every ring. So the
//! centre of highest symmetry is where least squares over all rings leave no δ: a Newton step from the harmonics,
//! repeated. Two more causes of a first harmonic have radii of their own and are told apart by them: a sample tilted by
//! t under a camera at distance D is seen in perspective, −R′(r) r² sin t/D; and a gradient of stray light, r · slope.

use super::MeasureError;
use super::bracket::Radiance;
use super::rings::{Grid, Model, Rings};

/// Steps are this small at last, pixels.
const SETTLED_PX: f64 = 2e-3;
const MAX_STEPS: usize = 12;
/// Rings from this radius on are used, pixels: nearer, pixels are larger than what they are to show.
const FROM_PX: f64 = 1.5;
/// The steps use rings to this radius, pixels; the light beyond has no say.
const WINDOW_PX: f64 = 250.0;
/// A ring counts from this many standard errors on.
const SIGNIFICANT: f64 = 10.0;

/// The centroid of what is brighter than half of the brightest: good to a pixel.
pub(super) fn coarse(picture: &Radiance, brightest: [usize; 2]) -> [f64; 2] {
    const SPOT: usize = 4;
    let near = |at: usize, length: usize, reach: usize| at.saturating_sub(reach)..(at + reach).min(length);
    let mut spot: Vec<f32> = near(brightest[1], picture.height, SPOT)
        .flat_map(|y| near(brightest[0], picture.width, SPOT).map(move |x| picture.at(x, y)))
        .filter(|value| !value.is_nan())
        .collect();
    spot.sort_by(f32::total_cmp);
    // The third largest: a hot pixel or two do not count.
    let half = 0.5 * spot.iter().rev().nth(2).copied().unwrap_or(0.0);
    let reach = WINDOW_PX as usize;
    let (mut sum, mut x_sum, mut y_sum) = (0.0, 0.0, 0.0);
    for y in near(brightest[1], picture.height, reach) {
        for x in near(brightest[0], picture.width, reach) {
            if picture.at(x, y) > half {
                sum += 1.0;
                x_sum += x as f64;
                y_sum += y as f64;
            }
        }
    }
    if sum > 0.0 { [x_sum / sum, y_sum / sum] } else { brightest.map(|at| at as f64) }
}

/// Moves the centre of a grid to the highest radial symmetry; returns it with its standard error in pixels.
///
/// # Errors
/// [`MeasureError::Scene`] if it leaves the picture or does not settle.
pub(super) fn refine(picture: &Radiance, mut grid: Grid, what: &str) -> Result<(Grid, f64), MeasureError> {
    let lost = |found: String| {
        Err(MeasureError::scene(format!("{what}: centre"), found, "one spot of light with falling light around it"))
    };
    let mut error = f64::INFINITY;
    let started = grid.centre;
    for _ in 0..MAX_STEPS {
        let whole = Grid::whole(grid.centre, picture.width, picture.height, grid.mm_per_pixel, grid.bin_mm);
        let window = (WINDOW_PX * grid.mm_per_pixel / grid.bin_mm).ceil() as usize;
        grid.bins = whole.bins.min(window);
        if grid.bins < super::scan::MIN_RINGS {
            return lost(format!("{} whole rings about ({:.1}, {:.1})", grid.bins, grid.centre[0], grid.centre[1]));
        }
        let means = Rings::of(picture, grid, None).mean;
        let rings = Rings::of(picture, grid, Some(&Model::through(&grid, &filled(&means))));
        let mut step = [0.0; 2];
        for (axis, step) in step.iter_mut().enumerate() {
            let (mut normal, mut right) = (0.0, 0.0);
            for ring in usable(&rings) {
                let slope = ring.slope * grid.mm_per_pixel;
                normal += slope * slope / ring.variance;
                right += slope * rings.harmonics[ring.bin][axis] / ring.variance;
            }
            *step = right / normal;
            error = (1.0 / normal).sqrt();
        }
        if !(libm::hypot(step[0], step[1]) < 50.0) {
            return lost("none that is symmetric".into());
        }
        // Far off, the profile about the wrong centre is flat and the step too long.
        let shorten = (3.0 / libm::hypot(step[0], step[1])).min(1.0);
        grid.centre = [grid.centre[0] + shorten * step[0], grid.centre[1] + shorten * step[1]];
        if libm::hypot(step[0], step[1]) < SETTLED_PX {
            let whole = Grid::whole(grid.centre, picture.width, picture.height, grid.mm_per_pixel, grid.bin_mm);
            return Ok((whole, error));
        }
    }
    let moved = libm::hypot(grid.centre[0] - started[0], grid.centre[1] - started[1]);
    if error < 0.05 && moved < 5.0 {
        let whole = Grid::whole(grid.centre, picture.width, picture.height, grid.mm_per_pixel, grid.bin_mm);
        return Ok((whole, error));
    }
    lost(format!("none after {MAX_STEPS} steps"))
}

/// Means with rings that have no pixel taken from their neighbour inside.
pub(super) fn filled(means: &[f64]) -> Vec<f64> {
    let mut last = means.iter().copied().find(|mean| mean.is_finite()).unwrap_or(0.0);
    let fill = |mean: &f64| {
        last = if mean.is_finite() { *mean } else { last };
        last
    };
    means.iter().map(fill).collect()
}

struct Usable {
    bin: usize,
    /// −R′, per mm.
    slope: f64,
    /// Of a harmonic's amplitude.
    variance: f64,
}

fn usable(rings: &Rings) -> impl Iterator<Item = Usable> + '_ {
    let (grid, mean) = (&rings.grid, &rings.mean);
    let from = ((FROM_PX * grid.mm_per_pixel / grid.bin_mm).ceil() as usize).max(1);
    (from..grid.bins.saturating_sub(1)).filter_map(move |bin| {
        let (before, after) = (mean[bin - 1], mean[bin + 1]);
        if !(before > 0.0 && after > 0.0 && mean[bin] > SIGNIFICANT * rings.error[bin]) {
            return None;
        }
        let slope = mean[bin] * libm::log(before / after) / (grid.radius(bin + 1) - grid.radius(bin - 1));
        Some(Usable { bin, slope, variance: 2.0 * rings.error[bin].powi(2) })
    })
}

/// An estimate and its standard error.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Vector {
    pub x: f64,
    pub y: f64,
    pub error: f64,
}

impl Vector {
    pub fn length(&self) -> f64 {
        libm::hypot(self.x, self.y)
    }

    pub fn significance(&self) -> f64 {
        if self.error > 0.0 { self.length() / self.error } else { 0.0 }
    }
}

/// What is left about the centre.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Asymmetry {
    /// sin t/D, per mm.
    pub perspective: Vector,
    /// Slope of stray light, units of the profile per mm.
    pub gradient: Vector,
    /// Difference of a ring's axes over their mean, along and across 45 degrees.
    pub ellipticity: Vector,
}

impl Asymmetry {
    /// Fits the harmonics of the rings.
    pub fn of(rings: &Rings) -> Self {
        let ring: Vec<Usable> = usable(rings).collect();
        let inside = |bin: usize| rings.grid.radius(bin);
        let mut asymmetry = Self::default();
        for axis in 0..2 {
            let rows = ring.iter().map(|ring| {
                let r = inside(ring.bin);
                ([ring.slope, ring.slope * r * r, r], rings.harmonics[ring.bin][axis], ring.variance)
            });
            // Beyond the signal only a gradient is left to be seen.
            let last = ring.last().map_or(0, |ring| ring.bin + 1);
            let beyond = (last..rings.grid.bins)
                .filter(|bin| rings.error[*bin] > 0.0)
                .map(|bin| ([0.0, 0.0, inside(bin)], rings.harmonics[bin][axis], 2.0 * rings.error[bin].powi(2)));
            let rows: Vec<_> = rows.chain(beyond).collect();
            let Some(fit) = least_squares(&rows) else { continue };
            let targets = [&mut asymmetry.perspective, &mut asymmetry.gradient];
            for (vector, (value, error)) in targets.into_iter().zip([fit[1], fit[2]]) {
                *(if axis == 0 { &mut vector.x } else { &mut vector.y }) = value;
                vector.error = vector.error.max(error);
            }
        }
        for axis in 0..2 {
            // A ring stretched to the axes r(1 ± ε/2) shows −R′ r ε/2 cos 2θ.
            let rows: Vec<_> = ring
                .iter()
                .map(|ring| {
                    let slope = 0.5 * ring.slope * inside(ring.bin);
                    ([slope, 0.0, 0.0], rings.harmonics[ring.bin][2 + axis], ring.variance)
                })
                .collect();
            let Some(fit) = least_squares(&rows) else { continue };
            let vector = &mut asymmetry.ellipticity;
            *(if axis == 0 { &mut vector.x } else { &mut vector.y }) = fit[0].0;
            vector.error = vector.error.max(fit[0].1);
        }
        asymmetry
    }
}

/// Weighted least squares with three columns: each coefficient with its standard error, which grows with a poor fit.
/// Columns of zeros are left out. `None` without enough rows.
fn least_squares(rows: &[([f64; 3], f64, f64)]) -> Option<[(f64, f64); 3]> {
    let mut scale = [0.0_f64; 3];
    for (columns, _, variance) in rows {
        scale.iter_mut().zip(columns).for_each(|(scale, column)| *scale += column * column / variance);
    }
    let active: Vec<usize> = (0..3).filter(|&i| scale[i] > 0.0).collect();
    if active.is_empty() || rows.len() < active.len() + 3 {
        return None;
    }
    let n = active.len();
    let mut normal = faer::Mat::<f64>::zeros(n, n);
    let mut right = faer::Mat::<f64>::zeros(n, 1);
    let column = |columns: &[f64; 3], i: usize| columns[active[i]] / scale[active[i]].sqrt();
    for (columns, value, variance) in rows {
        for i in 0..n {
            right[(i, 0)] += column(columns, i) * value / variance;
            (0..n).for_each(|j| normal[(i, j)] += column(columns, i) * column(columns, j) / variance);
        }
    }
    let inverse = super::aperture::inverse(&normal)?;
    let solved: Vec<f64> = (0..n).map(|i| (0..n).map(|j| inverse[(i, j)] * right[(j, 0)]).sum()).collect();
    let misfit = |(columns, value, variance): &([f64; 3], f64, f64)| {
        let fitted: f64 = (0..n).map(|i| solved[i] * column(columns, i)).sum();
        (value - fitted).powi(2) / variance
    };
    let chi = (rows.iter().map(misfit).sum::<f64>() / (rows.len() - n) as f64).max(1.0);
    let mut fit = [(0.0, 0.0); 3];
    for (i, &place) in active.iter().enumerate() {
        let scale = scale[place].sqrt();
        fit[place] = (solved[i] / scale, (inverse[(i, i)] * chi).sqrt() / scale);
    }
    Some(fit)
}
