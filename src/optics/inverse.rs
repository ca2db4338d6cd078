//! From spectra back to the surface: energy within a radius, half-energy radius, profiles.
//!
//! f(r) = (1/2π) ∫ f̂(k) J₀(kr) k dk, and integrated over a disc, E(r) = 2π∫₀^r f s ds = r ∫ f̂(k) J₁(kr) dk. Discs
//! and rings are finite where f is not (R ~ 1/r at the centre), so profiles come back as ring means.
//!
//! Near the centre a reflection profile is (C/2πr) e^(−br), whose pair is closed: f̂ = C/√(k² + b²), E = C (1 −
//! e^(−br))/b. C and b are read off the upper part of the grid, the pair is subtracted, and only the rest is integrated
//! numerically, between interpolated coefficients; beyond the grid the rest is 0. *Fails* beyond r ≈ π/Δk (20 mm on the
//! default grid), where the spacing of the coefficients aliases.

use super::FrequencyGrid;
use super::quadrature::bisect;
#[cfg(test)]
use super::{ProfileError, RadialProfile};
use crate::numeric::quadrature::GAUSS_3;

/// Coefficients averaged at each of the two places the asymptote is read from.
const WINDOW: usize = 8;
/// The inner place, as a share of the grid; the outer is its end.
const INNER: f64 = 0.6;
/// Largest phase kr per Gauss step: three points then err under 1e-6 of the interval.
const MAX_PHASE: f64 = 0.8;
/// Above this ratio of neighbours 1/f̂² is no parabola (transmission falls like e^(−hk)) and f̂ itself is interpolated.
const STEEP: f64 = 2.0;

/// A spectrum seen as a function of k, ready to be turned back.
#[derive(Debug, Clone)]
pub struct InverseHankel<'a> {
    k: &'a [f64],
    total: f64,
    centre: Centre,
    values: &'a [f64],
}

/// (C/2πr) e^(−br).
#[derive(Debug, Clone, Copy)]
struct Centre {
    strength: f64,
    decay: f64,
}

impl Centre {
    /// From f̂² (k² + b²) = C² at two places; C/k (b = 0) where the coefficients do not fall as such a pair's would.
    fn of(k: &[f64], values: &[f64]) -> Self {
        let mean = |end: usize| {
            let window = end.saturating_sub(WINDOW)..end;
            let n = window.len().max(1) as f64;
            (k[window.clone()].iter().sum::<f64>() / n, values[window].iter().sum::<f64>() / n)
        };
        let inner = ((INNER * k.len() as f64) as usize).max(1).min(k.len());
        let ((k0, f0), (k1, f1)) = (mean(inner), mean(k.len()));
        if f1 <= 0.0 {
            return Self { strength: 0.0, decay: 0.0 };
        }
        let squared = (f0 * f0 * k0 * k0 - f1 * f1 * k1 * k1) / (f1 * f1 - f0 * f0);
        let decay = if f0 > f1 && squared > 0.0 { squared.sqrt().min(k1) } else { 0.0 };
        Self { strength: f1 * libm::hypot(k1, decay), decay }
    }

    fn transform(&self, k: f64) -> f64 {
        self.strength / libm::hypot(k, self.decay)
    }

    fn energy_within(&self, r: f64) -> f64 {
        let decayed = self.decay * r;
        let share = if decayed > 1e-8 { -libm::expm1(-decayed) / decayed } else { 1.0 };
        self.strength * r * share
    }
}

impl<'a> InverseHankel<'a> {
    /// Of one value per frequency of the grid; extra values on either side are ignored.
    pub fn new(values: &'a [f64], grid: &'a FrequencyGrid) -> Self {
        let len = values.len().min(grid.len());
        let k = &grid.as_slice()[..len];
        let total = values.first().copied().unwrap_or(0.0);
        if len < 2 {
            return Self { k, total, centre: Centre { strength: 0.0, decay: 0.0 }, values: &values[..len] };
        }
        // A pair without decay has no value at k = 0; the grid's own spacing then rounds off its pole.
        let mut centre = Centre::of(k, &values[..len]);
        centre.decay = centre.decay.max(k[1]);
        centre.strength = if centre.strength > 0.0 { centre.strength } else { 0.0 };
        Self { k, total, centre, values: &values[..len] }
    }

    /// f̂ at any k ≥ 0 in rad/mm: between the coefficients as the transform back has it, beyond them the pair of the
    /// centre.
    pub fn value(&self, k: f64) -> f64 {
        let after = self.k.partition_point(|&grid| grid <= k);
        if after == 0 || after >= self.k.len() {
            let at_end = after == self.k.len() && self.k.last() == Some(&k);
            return if at_end { self.values[after - 1] } else { self.centre.transform(k) };
        }
        self.rest(after - 1, k) + self.centre.transform(k)
    }

    /// E(r), the energy leaving within r mm of the source.
    pub fn energy_within(&self, r: f64) -> f64 {
        if r <= 0.0 {
            return 0.0;
        }
        let mut sum = 0.0;
        for (i, pair) in self.k.windows(2).enumerate() {
            let parts = ((pair[1] - pair[0]) * r / MAX_PHASE).ceil().max(1.0);
            let half = 0.5 * (pair[1] - pair[0]) / parts;
            for part in 0..parts as usize {
                let middle = pair[0] + (2 * part + 1) as f64 * half;
                let value = |k: f64| self.rest(i, k) * libm::j1(k * r);
                sum += GAUSS_3.iter().map(|(x, weight)| half * weight * value(middle + half * x)).sum::<f64>();
            }
        }
        r * sum + self.centre.energy_within(r)
    }

    /// Radius in mm within which the given share of f̂(0) leaves, to about 1% up to π/Δk. `None` if f̂(0) ≤ 0, or the
    /// radius would be beyond that.
    pub fn radius_of_energy(&self, share: f64) -> Option<f64> {
        let limit = std::f64::consts::PI / (self.k.get(1)? - self.k[0]);
        let wanted = share * self.total;
        // E(r) may ripple by noise: the first bracket of a coarse scan is refined.
        const STEPS: usize = 200;
        let radius = |step: usize| limit * (step as f64 / STEPS as f64).powi(3);
        let step = (1..=STEPS).find(|step| self.energy_within(radius(*step)) >= wanted)?;
        (self.total > 0.0).then(|| bisect(radius(step - 1), radius(step), |r| self.energy_within(r) < wanted))
    }

    /// The profile as means over rings between edges in mm, the first 0. Ripples below 0 are kept if they pass as
    /// noise.
    ///
    /// # Errors
    /// As [`RadialProfile::from_rings`].
    #[cfg(test)]
    pub fn rings(&self, edges_mm: &[f64]) -> Result<RadialProfile, ProfileError> {
        let energies: Vec<f64> = edges_mm.iter().map(|r| self.energy_within(*r)).collect();
        let areas = super::profile::ring_areas(edges_mm);
        let means = areas.zip(energies.windows(2)).map(|(area, pair)| (pair[1] - pair[0]) / area).collect();
        RadialProfile::from_rings(edges_mm.to_vec(), means, None)
    }

    /// f̂ less the centre's at k in the i-th interval. 1/f̂² is interpolated: for the pairs light makes, C/√(k² + b²),
    /// it is a parabola, while f̂ itself bends within one step of the grid if the profile is as wide as the support's.
    fn rest(&self, i: usize, k: f64) -> f64 {
        let value = |j: usize| self.values.get(j).copied();
        let (f0, f1) = (self.values[i], self.values[i + 1]);
        let before = if i == 0 { f1 } else { self.values[i - 1] }; // f̂ is even in k
        let after = value(i + 2).unwrap_or(if f0 == 0.0 { f1 } else { f1 * f1 / f0 });
        let t = (k - self.k[i]) / (self.k[i + 1] - self.k[i]);
        let four = [before, f0, f1, after];
        let whole = if four.iter().all(|f| *f > 0.0) && f0 < STEEP * f1 {
            let squared = catmull_rom(four.map(|f| 1.0 / (f * f)), t);
            if squared > 0.0 { 1.0 / squared.sqrt() } else { f0 + t * (f1 - f0) }
        } else {
            catmull_rom(four, t)
        };
        whole - self.centre.transform(k)
    }
}

/// Cubic through the middle two of four evenly spaced values, t in [0, 1] between them.
fn catmull_rom([before, f0, f1, after]: [f64; 4], t: f64) -> f64 {
    let (m0, m1) = (0.5 * (f1 - before), 0.5 * (after - f0));
    f0 + t * (m0 + t * (3.0 * (f1 - f0) - 2.0 * m0 - m1 + t * (2.0 * (f0 - f1) + m0 + m1)))
}
