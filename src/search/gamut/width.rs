//! Half-energy radii of many spectra at little cost.
//!
//! E(r) = r ∫ f̂(k) J₁(kr) dk (see `optics::InverseHankel`) is linear in f̂: with cubic interpolation between the
//! coefficients, and f̂ ~ 1/k beyond the grid as R ~ 1/r at the centre makes it, it is one dot product for each of a
//! few radii. Good to about 1% of the radius, 3% below 0.1 mm where the default grid ends too early (a test compares),
//! which is ample to tell cells of a gamut apart; what is shown is computed again.

use crate::numeric::quadrature::GAUSS_3;
use crate::optics::FrequencyGrid;

/// Radii of the table, mm: from finer than a printer's voxel to where the default grid aliases.
pub(super) const RADII_MM: [f64; 2] = [0.01, 20.0];
const RADII: usize = 72;
/// Largest phase kr per step of the three-point rule.
const MAX_PHASE: f64 = 0.8;

/// Weights that turn a spectrum into the energy within a radius.
pub(super) struct RadiusTable {
    ln_radius: Vec<f64>,
    /// One row of weights per radius.
    weights: Vec<Vec<f64>>,
}

impl RadiusTable {
    /// For spectra on `grid`, evenly spaced.
    pub fn new(grid: &FrequencyGrid) -> Self {
        let [low, high] = RADII_MM.map(libm::log);
        let ln_radius: Vec<f64> = (0..RADII).map(|j| low + (high - low) * j as f64 / (RADII - 1) as f64).collect();
        let weights = ln_radius.iter().map(|ln_r| energy_weights(grid.as_slice(), libm::exp(*ln_r))).collect();
        Self { ln_radius, weights }
    }

    /// The radius in mm within which half of f̂(0) leaves; `None` if nothing is reflected or it is out of the table.
    pub fn half_energy(&self, spectrum: &[f64]) -> Option<f64> {
        let wanted = 0.5 * spectrum[0];
        let energy = |j: usize| -> f64 { self.weights[j].iter().zip(spectrum).map(|(weight, f)| weight * f).sum() };
        let (mut low, mut high) = (0, RADII - 1);
        let (mut at_low, mut at_high) = (energy(low), energy(high));
        if !(wanted > 0.0 && at_low < wanted && at_high >= wanted) {
            return None;
        }
        while high - low > 1 {
            let middle = (low + high) / 2;
            let found = energy(middle);
            if found < wanted { (low, at_low) = (middle, found) } else { (high, at_high) = (middle, found) }
        }
        let part = (wanted - at_low) / (at_high - at_low);
        Some(libm::exp(self.ln_radius[low] + part * (self.ln_radius[high] - self.ln_radius[low])))
    }
}

fn energy_weights(k: &[f64], r: f64) -> Vec<f64> {
    let last = k.len() - 1;
    let mut weights = vec![0.0; k.len()];
    for i in 0..last {
        let parts = ((k[i + 1] - k[i]) * r / MAX_PHASE).ceil().max(1.0);
        let half = 0.5 * (k[i + 1] - k[i]) / parts;
        for part in 0..parts as usize {
            let middle = k[i] + (2 * part + 1) as f64 * half;
            for (x, weight) in GAUSS_3 {
                let at = middle + half * x;
                let t = (at - k[i]) / (k[i + 1] - k[i]);
                let kernel = r * half * weight * libm::j1(at * r);
                let cubic = catmull_rom(t);
                // f̂ is even in k; beyond its end it goes on as a line.
                weights[i.abs_diff(1)] += kernel * cubic[0];
                weights[i] += kernel * cubic[1];
                weights[i + 1] += kernel * cubic[2];
                if i + 2 <= last {
                    weights[i + 2] += kernel * cubic[3];
                } else {
                    weights[last] += 2.0 * kernel * cubic[3];
                    weights[last - 1] -= kernel * cubic[3];
                }
            }
        }
    }
    weights[last] += k[last] * r * (1.0 - j1_over_x(k[last] * r));
    weights
}

/// Weights of the four values around an interval at t in [0, 1] of it.
fn catmull_rom(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (2.0 * t2 - t - t3), 0.5 * (2.0 - 5.0 * t2 + 3.0 * t3), 0.5 * (t + 4.0 * t2 - 3.0 * t3), 0.5 * (t3 - t2)]
}

/// ∫ J₁(u)/u du from 0 to x; 1 at infinity.
fn j1_over_x(x: f64) -> f64 {
    let parts = (x / MAX_PHASE).ceil().max(1.0);
    let half = 0.5 * x / parts;
    let value = |u: f64| if u > 0.0 { libm::j1(u) / u } else { 0.5 };
    let part = |n: usize| {
        let middle = (2 * n + 1) as f64 * half;
        GAUSS_3.iter().map(|(x, weight)| half * weight * value(middle + half * x)).sum::<f64>()
    };
    (0..parts as usize).map(part).sum()
}
