//! Volume coefficients from measured profiles: what makes the transport model give a slab's R̂(k) and T̂(k).
//!
//! Levenberg and Marquardt's method in ln σs′, ln σa and g, σs′ = σs (1 − g), with slopes from differences, over one
//! slab or several of different thickness at once. One slab settles σs′ and σa; g shows in light that has turned few
//! times only, near the source and through thin slabs, so that a thick slab alone hardly knows it. The uncertainty says
//! so: it is the largest that errors of the found size can make, however they hang together from frequency to
//! frequency, √n s √(JᵀJ)⁻¹_ii with s the residual of the n coefficients. *Assumed:* the refractive index, which is not
//! fitted, and the phase function of Henyey and Greenstein.

use super::{
    FrequencyGrid, Light, MAX_COEFFICIENT_PER_MM, RadialProfile, Stack, Transport, TransportOptions,
    VolumeCoefficients, repair_transmission,
};
use crate::numeric::least_squares::{Budget, Descent, curvature, dot, gradient};

/// A slab whose profiles were measured.
#[derive(Debug, Clone, Copy)]
pub struct MeasuredSlab<'a> {
    /// Thickness in mm, above 0.
    pub thickness_mm: f64,
    /// R(r).
    pub reflection: &'a RadialProfile,
    /// T(r).
    pub transmission: &'a RadialProfile,
}

/// Coefficients that were fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoefficientFit {
    /// What was found.
    pub coefficients: VolumeCoefficients,
    /// Root mean square of what R̂ and T̂ are off by, over the fitted frequencies and slabs.
    pub residual: f64,
    /// Slabs it rests on.
    pub slabs: usize,
    /// Uncertainty of σs′ = σs (1 − g), as a share of it.
    pub reduced_scattering_share: f64,
    /// Uncertainty of σa, as a share of it.
    pub absorption_share: f64,
    /// Uncertainty of g.
    pub g_uncertainty: f64,
}

/// A fit that is not worth using.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "no coefficients fit the profiles: found a residual of {residual:.1e} rms, expected at most {MAX_FIT_RESIDUAL:.0e}"
)]
pub struct FitRefusal {
    /// Residual of the best coefficients.
    pub residual: f64,
}

/// A fit with a larger residual is refused: Kubelka–Munk, read off the same slab, errs by 6e-3 where it is at its worst
/// (docs/accuracy.md).
pub const MAX_FIT_RESIDUAL: f64 = 5e-3;

/// Frequencies of the fit, as indices of the default grid: close together where profiles differ most.
const NODES: [usize; 18] = [0, 1, 2, 3, 4, 5, 7, 9, 12, 16, 21, 28, 37, 48, 62, 80, 102, 127];
/// Directions that find the neighbourhood, and those that count.
const COARSE: TransportOptions = TransportOptions { polar: 4, orders: 4 };
const FINE: TransportOptions = TransportOptions { polar: 6, orders: 5 };
/// Values of g to start from.
const STARTS: [f64; 3] = [0.2, 0.6, 0.85];
/// Where g may go.
const G: std::ops::RangeInclusive<f64> = -0.5..=0.97;
/// Steps from each start, and from the best of them.
const COARSE_STEPS: usize = 12;
const FINE_STEPS: usize = 8;
/// Step of the differences in every parameter.
const DIFFERENCE: f64 = 1e-3;
/// Damping is a share of JᵀJ's diagonal.
const DESCENT: Descent = Descent { first_damping: 1e-2, most_damping: 1e6, least_gain: 1e-4 };
/// Errors below this are the model's own (docs/accuracy.md).
const MODEL_ERROR: f64 = 1e-4;
/// Least σa and σs′ per mm a fit tells from none.
const LEAST_PER_MM: f64 = 1e-6;

/// Fits the coefficients of a resin of the given refractive index to one slab or more.
///
/// # Errors
/// [`FitRefusal`] if the best coefficients leave a residual above [`MAX_FIT_RESIDUAL`].
pub fn fit_coefficients(slabs: &[MeasuredSlab<'_>], refractive_index: f64) -> Result<CoefficientFit, FitRefusal> {
    let data = Data::new(slabs, refractive_index);
    let starts = STARTS.map(|g| data.descend(data.guess(g), COARSE, COARSE_STEPS));
    let best = starts.into_iter().min_by(|a, b| a.objective().total_cmp(&b.objective()));
    let Some(best) = best else { return Err(FitRefusal { residual: f64::INFINITY }) };
    let found = data.descend(best.at, FINE, FINE_STEPS);
    let count = found.residuals.len() as f64;
    let residual = (found.objective() / count).sqrt();
    if !(residual <= MAX_FIT_RESIDUAL) {
        return Err(FitRefusal { residual });
    }
    let inverse = inverse(&curvature(&data.slopes(&found, FINE)));
    let size = count.sqrt() * residual.hypot(MODEL_ERROR);
    let uncertainty = |i: usize| inverse.map_or(f64::INFINITY, |inverse| size * inverse[i][i].max(0.0).sqrt());
    Ok(CoefficientFit {
        coefficients: data.volume(found.at),
        residual,
        slabs: slabs.len(),
        reduced_scattering_share: uncertainty(0),
        absorption_share: uncertainty(1),
        g_uncertainty: uncertainty(2),
    })
}

/// ln σs′, ln σa, g.
type Parameters = [f64; 3];

/// What was measured, at the fit's frequencies.
struct Data {
    grid: FrequencyGrid,
    refractive_index: f64,
    slabs: Vec<Slab>,
}

struct Slab {
    thickness_mm: f64,
    reflection: Vec<f64>,
    transmission: Vec<f64>,
}

/// Parameters and what they leave.
struct Point {
    at: Parameters,
    residuals: Vec<f64>,
}

impl Point {
    fn objective(&self) -> f64 {
        self.residuals.iter().map(|r| r * r).sum()
    }
}

impl Data {
    fn new(slabs: &[MeasuredSlab<'_>], refractive_index: f64) -> Self {
        let default = FrequencyGrid::default();
        let pick = |values: &[f64]| NODES.iter().map(|&i| values[i]).collect::<Vec<f64>>();
        let slab = |slab: &MeasuredSlab<'_>| {
            let transmission = slab.transmission.hankel(&default);
            let mut repaired = transmission.values.clone();
            // Where T̂ is all noise it stays as it is: near 0.
            if repair_transmission(&mut repaired, transmission.standard_error.as_deref(), &default).is_err() {
                repaired = transmission.values;
            }
            Slab {
                thickness_mm: slab.thickness_mm,
                reflection: pick(&slab.reflection.hankel(&default).values),
                transmission: pick(&repaired),
            }
        };
        Self {
            grid: FrequencyGrid::of(pick(default.as_slice())),
            refractive_index,
            slabs: slabs.iter().map(slab).collect(),
        }
    }

    /// From the first slab's totals by Kubelka and Munk's theory, with K = 2σa and S = ¾σs′ (Klier 1972).
    fn guess(&self, g: f64) -> Parameters {
        let Some(slab) = self.slabs.first() else { return [0.0, 0.0, g] };
        let total = |values: &[f64]| values.first().copied().unwrap_or(0.0).clamp(1e-4, 0.98);
        let (r, t) = (total(&slab.reflection), total(&slab.transmission));
        let alpha = ((1.0 + r * r - t * t) / (2.0 * r)).max(1.0 + 1e-6);
        let beta = (alpha * alpha - 1.0).sqrt();
        let scattering = (beta * r / t).asinh() / beta / slab.thickness_mm;
        [(scattering / 0.75).max(LEAST_PER_MM).ln(), ((alpha - 1.0) * scattering / 2.0).max(LEAST_PER_MM).ln(), g]
    }

    fn volume(&self, [reduced, absorption, g]: Parameters) -> VolumeCoefficients {
        let per_mm = |value: f64| value.exp().clamp(LEAST_PER_MM, MAX_COEFFICIENT_PER_MM);
        VolumeCoefficients {
            sigma_s: (per_mm(reduced) / (1.0 - g)).min(MAX_COEFFICIENT_PER_MM),
            sigma_a: per_mm(absorption),
            g,
            refractive_index: self.refractive_index,
        }
    }

    fn point(&self, at: Parameters, options: TransportOptions) -> Point {
        let volume = self.volume(at);
        let mut residuals = Vec::with_capacity(2 * self.grid.len() * self.slabs.len());
        for slab in &self.slabs {
            let stack = Stack::new([(volume, slab.thickness_mm)]);
            let found = Transport { stack: &stack, light: Light::Diffuse, options }.spectra(&self.grid);
            let off = |found: Vec<f64>, measured: &[f64]| {
                found.into_iter().zip(measured).map(|(found, measured)| found - measured).collect::<Vec<_>>()
            };
            residuals.extend(off(found.reflection, &slab.reflection));
            residuals.extend(off(found.transmission, &slab.transmission));
        }
        Point { at, residuals }
    }

    /// ∂ residual / ∂ parameter, parameter after parameter.
    fn slopes(&self, here: &Point, options: TransportOptions) -> [Vec<f64>; 3] {
        [0, 1, 2].map(|i| {
            let mut at = here.at;
            // Away from the end of g's range.
            let step = if i == 2 && at[i] > 0.5 * (G.start() + G.end()) { -DIFFERENCE } else { DIFFERENCE };
            at[i] += step;
            let there = self.point(at, options).residuals;
            there.iter().zip(&here.residuals).map(|(there, here)| (there - here) / step).collect()
        })
    }

    fn descend(&self, from: Parameters, options: TransportOptions, steps: usize) -> Point {
        DESCENT.run(
            Budget::Steps(steps),
            self.point(from, options),
            Point::objective,
            |here| {
                let slopes = self.slopes(here, options);
                (curvature(&slopes), gradient(&slopes, &here.residuals))
            },
            |here, (curvature, gradient), damping| {
                let mut damped = curvature.clone();
                (0..3).for_each(|i| damped[i][i] *= 1.0 + damping);
                let inverse = inverse(&damped)?;
                let mut at = here.at;
                for (at, row) in at.iter_mut().zip(&inverse) {
                    // No step leaves the region the slopes speak for.
                    *at -= dot(row, gradient).clamp(-1.0, 1.0);
                }
                at[2] = at[2].clamp(*G.start(), *G.end());
                Some(self.point(at, options))
            },
        )
    }
}

/// Of a matrix of 3 × 3, by cofactors; `None` if there is none.
fn inverse(m: &[Vec<f64>]) -> Option<[[f64; 3]; 3]> {
    let cofactor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    (determinant.is_finite() && determinant != 0.0)
        .then(|| [0, 1, 2].map(|i| [0, 1, 2].map(|j| cofactor(j, i) / determinant)))
}

#[cfg(test)]
mod tests;
