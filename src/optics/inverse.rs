//! From spectra back to the surface: energy within a radius, half-energy radius, profiles.
//!
//! f(r) = (1/2π) ∫ f̂(k) J₀(kr) k dk, and integrated over a disc, E(r) = 2π∫₀^r f s ds = r ∫ f̂(k) J₁(kr) dk. Discs
//! and rings are finite where f is not (R ~ 1/r at the centre), so profiles come back as ring means.
//!
//! Within the grid f̂ is a cubic through the coefficients. Beyond its end f̂ is continued as C/k, the transform of the
//! central C/(2πr), with C from the last coefficients; the integral of that part is closed up to ∫J₀. *Fails* beyond r ≈ π/Δk (20 mm on
//! the default grid), where the spacing of the coefficients aliases.

use super::quadrature::bisect;
use super::{FrequencyGrid, ProfileError, RadialProfile};

/// Coefficients at the end of the grid from which C of C/k is taken.
const ASYMPTOTE: usize = 8;
/// Largest phase kr per Gauss step.
const MAX_PHASE: f64 = 0.8;

/// A spectrum seen as a function of k, ready to be turned back.
#[derive(Debug, Clone)]
pub struct InverseHankel<'a> {
    k: &'a [f64],
    values: &'a [f64],
    /// C of f̂ ≈ C/k beyond the grid.
    asymptote: f64,
}

impl<'a> InverseHankel<'a> {
    /// Of one value per frequency of the grid; extra values on either side are ignored.
    pub fn new(values: &'a [f64], grid: &'a FrequencyGrid) -> Self {
        let len = values.len().min(grid.len());
        let (k, values) = (&grid.as_slice()[..len], &values[..len]);
        let last = ASYMPTOTE.min(len.saturating_sub(1)).max(1);
        let asymptote = k.iter().zip(values).rev().take(last).map(|(k, f)| k * f).sum::<f64>() / last as f64;
        Self { k, values, asymptote }
    }

    /// E(r), the energy leaving within r mm of the source.
    pub fn energy_within(&self, r: f64) -> f64 {
        let Some(&k_max) = self.k.last() else { return 0.0 };
        if r <= 0.0 {
            return 0.0;
        }
        let mut sum = 0.0;
        for i in 0..self.k.len() - 1 {
            let (from, to) = (self.k[i], self.k[i + 1]);
            let parts = ((to - from) * r / MAX_PHASE).ceil().max(1.0);
            let half = 0.5 * (to - from) / parts;
            for part in 0..parts as usize {
                let middle = from + (2 * part + 1) as f64 * half;
                // Three-point Gauss–Legendre, exact to degree 5.
                for (x, weight) in
                    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)]
                {
                    let k = middle + half * x;
                    sum += half * weight * self.interpolate(i, k) * libm::j1(k * r);
                }
            }
        }
        // ∫_x^∞ J₁(t)/t dt = 1 − ∫₀^x J₀ dt + J₁(x), from J₁/t = J₀ − J₁′.
        let x = k_max * r;
        r * (sum + self.asymptote * (1.0 - integral_of_j0(x) + libm::j1(x)))
    }

    /// Radius in mm within which the given share of f̂(0) leaves, to about 1% between 1/k_max (0.05 mm on the default grid) and
    /// π/Δk, and to 10% below, where only the asymptote speaks. `None` if f̂(0) ≤ 0 or the radius would exceed π/Δk.
    pub fn radius_of_energy(&self, share: f64) -> Option<f64> {
        let (total, spacing) = (*self.values.first()?, self.k.get(1)? - self.k[0]);
        let limit = std::f64::consts::PI / spacing;
        let wanted = share * total;
        // E(r) may ripple by noise: the first bracket on a coarse scan is refined.
        const STEPS: usize = 400;
        let radius = |step: usize| limit * (step as f64 / STEPS as f64).powi(3);
        let step = (1..=STEPS).find(|step| self.energy_within(radius(*step)) >= wanted)?;
        (total > 0.0).then(|| bisect(radius(step - 1), radius(step), |r| self.energy_within(r) < wanted))
    }

    /// The profile as means over rings between edges in mm, the first 0. Ripples below 0 are kept if they pass as noise.
    ///
    /// # Errors
    /// As [`RadialProfile::from_rings`].
    pub fn rings(&self, edges_mm: &[f64]) -> Result<RadialProfile, ProfileError> {
        let energies: Vec<f64> = edges_mm.iter().map(|r| self.energy_within(*r)).collect();
        let areas = super::profile::ring_areas(edges_mm);
        let means = areas.zip(energies.windows(2)).map(|(area, pair)| (pair[1] - pair[0]) / area).collect();
        RadialProfile::from_rings(edges_mm.to_vec(), means, None)
    }

    /// Catmull–Rom in the i-th interval; f̂ is even in k, which gives the neighbour left of 0.
    fn interpolate(&self, i: usize, k: f64) -> f64 {
        let f = |j: usize| self.values[j.min(self.values.len() - 1)];
        let width = self.k[i + 1] - self.k[i];
        let (f0, f1) = (f(i), f(i + 1));
        let before = if i == 0 { f(1) } else { f(i - 1) };
        let after = if i + 2 < self.values.len() { f(i + 2) } else { 2.0 * f1 - f0 };
        let t = (k - self.k[i]) / width;
        let (m0, m1) = (0.5 * (f1 - before), 0.5 * (after - f0));
        f0 + t * (m0 + t * (3.0 * (f1 - f0) - 2.0 * m0 - m1 + t * (2.0 * (f0 - f1) + m0 + m1)))
    }
}

/// ∫₀^x J₀(t) dt by Gauss–Legendre steps of at most 1, error under 1e-9.
fn integral_of_j0(x: f64) -> f64 {
    const NODES: [(f64, f64); 4] = [
        (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
        (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
        (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
        (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    ];
    let parts = x.ceil().max(1.0);
    let half = 0.5 * x / parts;
    let step = |part: usize| {
        let middle = (2 * part + 1) as f64 * half;
        NODES.iter().map(|(t, weight)| half * weight * libm::j0(middle + half * t)).sum::<f64>()
    };
    (0..parts as usize).map(step).sum()
}
