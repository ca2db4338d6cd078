//! Volume coefficients from measured profiles: what makes the transport model give a slab's R̂(k) and T̂(k).
//!
//! Levenberg and Marquardt's method in ln σs′, ln σa and g, σs′ = σs (1 − g), with slopes from differences, over one
//! slab or several of different thickness at once. One slab settles σs′ and σa; g shows in light that has turned few
//! times only, near the source and through thin slabs, so that a thick slab alone hardly knows it. The uncertainty says
//! so: it is the largest that errors of the found size can make, however they hang together from frequency to
//! frequency, √n s √(JᵀJ)⁻¹_ii with s the residual of the n coefficients, and what errors common to a profile's values
//! move it by, as an albedo's: they leave no residual. *Assumed:* the refractive index, which is not
//! fitted, and the phase function of Henyey and Greenstein.

use super::{
    FrequencyGrid, Light, MAX_COEFFICIENT_PER_MM, RadialProfile, Stack, Transport, TransportOptions,
    VolumeCoefficients, repair_transmission,
};
use crate::numeric::{
    least_squares::{Budget, Descent, curvature, dot, gradient},
    positive_definite::inverse,
};

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
pub enum FitRefusal {
    /// Nothing fits.
    #[error(
        "no coefficients fit the profiles: found a residual of {residual:.1e} rms, expected at most \
         {MAX_FIT_RESIDUAL:.0e}"
    )]
    Residual {
        /// Residual of the best coefficients.
        residual: f64,
    },
    /// Everything fits: the profiles leave a coefficient open.
    #[error(
        "the profiles do not tell the coefficients: found {what} {value:.3} ± {uncertainty:.3}, expected an \
         uncertainty below the value's own size; a slab of another thickness tells more"
    )]
    KnowsNothing {
        /// Which one, with its unit.
        what: &'static str,
        /// Its value.
        value: f64,
        /// And its uncertainty.
        uncertainty: f64,
    },
}

/// What the shapes of a slab's profiles say by themselves.
#[cfg(feature = "measure")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeFit {
    /// Root mean square of what R̂ and T̂ are off by, each with a factor of its own.
    pub residual: f64,
    /// R and T in total by the coefficients that fit, each with its uncertainty.
    pub totals: [(f64, f64); 2],
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
/// Factors that the reflection may be wrong by.
#[cfg(feature = "measure")]
const WRONG_BY: [f64; 4] = [0.03, 0.1, 0.3, 3.0];
/// Absorption counts from this share of a thickness on.
const LEAST_ABSORBED: f64 = 0.02;
/// Least σa and σs′ per mm a fit tells from none.
const LEAST_PER_MM: f64 = 1e-6;

/// Fits the coefficients of a resin of the given refractive index to one slab or more.
///
/// # Errors
/// [`FitRefusal`] if the best coefficients leave a residual above [`MAX_FIT_RESIDUAL`].
pub fn fit_coefficients(slabs: &[MeasuredSlab<'_>], refractive_index: f64) -> Result<CoefficientFit, FitRefusal> {
    let data = Data::new(slabs, refractive_index, false);
    let nothing = Err(FitRefusal::Residual { residual: f64::INFINITY });
    let Some(found) = data.best(&STARTS.map(|g| data.guess(g))) else { return nothing };
    let count = found.residuals.len() as f64;
    let residual = (found.objective() / count).sqrt();
    if !(residual <= MAX_FIT_RESIDUAL) {
        return Err(FitRefusal::Residual { residual });
    }
    let slopes = data.slopes(&found, FINE);
    let inverse = inverse(curvature(&slopes));
    let size = count.sqrt() * libm::hypot(residual, MODEL_ERROR);
    let uncertainty = |i: usize| inverse.as_ref().map_or(f64::INFINITY, |inverse| size * inverse[i][i].max(0.0).sqrt());
    let coefficients = data.volume(found.at);
    let [reduced_scattering_share, absorption_share, g_uncertainty] = [uncertainty(0), uncertainty(1), uncertainty(2)];
    let reduced = coefficients.sigma_s * (1.0 - coefficients.g);
    let thickest = slabs.iter().map(|slab| slab.thickness_mm).fold(0.0, f64::max);
    // Of next to no absorption nothing need be known but that.
    let absorbs = coefficients.sigma_a * thickest > LEAST_ABSORBED;
    for (what, value, uncertainty, limit, counts) in [
        ("scattering (1 - g) per mm", reduced, reduced * reduced_scattering_share, reduced, true),
        (
            "absorption per mm",
            coefficients.sigma_a,
            coefficients.sigma_a * absorption_share,
            coefficients.sigma_a,
            absorbs,
        ),
        ("g", coefficients.g, g_uncertainty, 1.0, true),
    ] {
        if counts && !(uncertainty < limit) {
            return Err(FitRefusal::KnowsNothing { what, value, uncertainty });
        }
    }
    let by_albedos = inverse.as_ref().map_or([0.0; 3], |inverse| data.moved_by_albedos(&slopes, inverse));
    Ok(CoefficientFit {
        coefficients,
        residual,
        slabs: slabs.len(),
        reduced_scattering_share: libm::hypot(reduced_scattering_share, by_albedos[0]),
        absorption_share: libm::hypot(absorption_share, by_albedos[1]),
        g_uncertainty: libm::hypot(g_uncertainty, by_albedos[2]),
    })
}

/// Fits the coefficients of a slab to the shapes of its profiles, whatever they integrate to: what an albedo is held
/// against. `None` where the shapes leave it open.
#[cfg(feature = "measure")]
pub fn fit_shapes(slab: &MeasuredSlab<'_>, refractive_index: f64) -> Option<ShapeFit> {
    let data = Data::new(&[*slab], refractive_index, true);
    // The totals may be wrong, and guesses rest on them: a card for a sample is off by a factor of ten.
    let near = STARTS.map(|g| data.guess(g));
    let far = WRONG_BY.map(|factor| data.guess_with(factor, STARTS[1]));
    let found = data.best(&[near.as_slice(), &far].concat())?;
    let count = found.residuals.len() as f64;
    let residual = (found.objective() / count).sqrt();
    let inverse = inverse(curvature(&data.slopes(&found, FINE)))?;
    let size = count.sqrt() * libm::hypot(residual, MODEL_ERROR);
    let totals = |at: Parameters| {
        let spectra = data.spectra(data.slabs.first()?, data.volume(at), FINE);
        Some([*spectra.reflection.first()?, *spectra.transmission.first()?])
    };
    let here = totals(found.at)?;
    let mut slopes = [[0.0; 3]; 2];
    for i in 0..3 {
        let mut at = found.at;
        let step = data.step(i, &at);
        at[i] += step;
        let there = totals(at)?;
        (0..2).for_each(|which| slopes[which][i] = (there[which] - here[which]) / step);
    }
    let error = |which: usize| {
        let slope = &slopes[which];
        let variance: f64 = (0..3).map(|i| (0..3).map(|j| slope[i] * inverse[i][j] * slope[j]).sum::<f64>()).sum();
        size * variance.max(0.0).sqrt()
    };
    Some(ShapeFit { residual, totals: [0, 1].map(|which| (here[which], error(which))) })
}

/// ln σs′, ln σa, g.
type Parameters = [f64; 3];

/// What was measured, at the fit's frequencies.
struct Data {
    grid: FrequencyGrid,
    refractive_index: f64,
    slabs: Vec<Slab>,
    /// Whether R̂ and T̂ of each slab may be off by a factor.
    shapes_only: bool,
}

struct Slab {
    thickness_mm: f64,
    reflection: Vec<f64>,
    transmission: Vec<f64>,
    /// What R and T may be off by in all values together.
    common_shares: [f64; 2],
}

/// What a profile's values may be off by together, as by their albedo: no value is known better than that.
fn common_share(profile: &RadialProfile) -> f64 {
    let values = profile.value_per_mm2();
    let shares = profile.standard_error().into_iter().flat_map(|errors| errors.iter().zip(values));
    let known = shares.filter(|(_, value)| **value > 0.0).map(|(error, value)| error / value);
    known.min_by(f64::total_cmp).unwrap_or(0.0)
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
    fn new(slabs: &[MeasuredSlab<'_>], refractive_index: f64, shapes_only: bool) -> Self {
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
                common_shares: [slab.reflection, slab.transmission].map(common_share),
            }
        };
        Self {
            grid: FrequencyGrid::of(pick(default.as_slice())),
            refractive_index,
            slabs: slabs.iter().map(slab).collect(),
            shapes_only,
        }
    }

    /// The best of several starts.
    fn best(&self, starts: &[Parameters]) -> Option<Point> {
        let ends = starts.iter().map(|start| self.descend(*start, COARSE, COARSE_STEPS));
        let best = ends.min_by(|a, b| a.objective().total_cmp(&b.objective()))?;
        Some(self.descend(best.at, FINE, FINE_STEPS))
    }

    /// From the first slab's totals by Kubelka and Munk's theory, with K = 2σa and S = ¾σs′ (Klier 1972).
    fn guess(&self, g: f64) -> Parameters {
        self.guess_with(1.0, g)
    }

    /// The same if its reflection were another by a factor.
    fn guess_with(&self, factor: f64, g: f64) -> Parameters {
        let Some(slab) = self.slabs.first() else { return [0.0, 0.0, g] };
        let total = |values: &[f64]| values.first().copied().unwrap_or(0.0).clamp(1e-4, 0.98);
        let (r, t) = (total(&slab.reflection) * factor, total(&slab.transmission));
        let r = r.min(0.98 - 0.5 * t);
        let alpha = ((1.0 + r * r - t * t) / (2.0 * r)).max(1.0 + 1e-6);
        let beta = (alpha * alpha - 1.0).sqrt();
        let scattering = libm::asinh(beta * r / t) / beta / slab.thickness_mm;
        [
            libm::log((scattering / 0.75).max(LEAST_PER_MM)),
            libm::log(((alpha - 1.0) * scattering / 2.0).max(LEAST_PER_MM)),
            g,
        ]
    }

    fn volume(&self, [reduced, absorption, g]: Parameters) -> VolumeCoefficients {
        let per_mm = |value: f64| libm::exp(value).clamp(LEAST_PER_MM, MAX_COEFFICIENT_PER_MM);
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
            let found = self.spectra(slab, volume, options);
            let off = |found: Vec<f64>, measured: &[f64]| {
                let factor = if self.shapes_only { dot(&found, measured) / dot(&found, &found) } else { 1.0 };
                found.into_iter().zip(measured).map(|(found, measured)| found * factor - measured).collect::<Vec<_>>()
            };
            residuals.extend(off(found.reflection, &slab.reflection));
            residuals.extend(off(found.transmission, &slab.transmission));
        }
        Point { at, residuals }
    }

    fn spectra(
        &self,
        slab: &Slab,
        volume: VolumeCoefficients,
        options: TransportOptions,
    ) -> super::transport::TransportSpectra {
        let stack = Stack::new([(volume, slab.thickness_mm)]);
        Transport { stack: &stack, light: Light::Diffuse, options }.spectra(&self.grid)
    }

    /// Step of a difference in a parameter: away from the end of g's range.
    fn step(&self, i: usize, at: &Parameters) -> f64 {
        if i == 2 && at[i] > 0.5 * (G.start() + G.end()) { -DIFFERENCE } else { DIFFERENCE }
    }

    /// ∂ residual / ∂ parameter, parameter after parameter.
    fn slopes(&self, here: &Point, options: TransportOptions) -> [Vec<f64>; 3] {
        [0, 1, 2].map(|i| {
            let mut at = here.at;
            let step = self.step(i, &at);
            at[i] += step;
            let there = self.point(at, options).residuals;
            there.iter().zip(&here.residuals).map(|(there, here)| (there - here) / step).collect()
        })
    }

    /// What one standard deviation of every profile's common error moves the parameters by, root mean square: (JᵀJ)⁻¹
    /// Jᵀ m, with m the profile's values times that share.
    fn moved_by_albedos(&self, slopes: &[Vec<f64>; 3], inverse: &[Vec<f64>]) -> Parameters {
        let mut squares = [0.0; 3];
        let mut first = 0;
        for slab in &self.slabs {
            for (values, share) in [&slab.reflection, &slab.transmission].into_iter().zip(slab.common_shares) {
                let pulls = slopes.each_ref().map(|slope| share * dot(&slope[first..first + values.len()], values));
                squares.iter_mut().zip(inverse).for_each(|(square, row)| *square += dot(row, &pulls).powi(2));
                first += values.len();
            }
        }
        squares.map(f64::sqrt)
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
                let inverse = inverse(damped)?;
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

#[cfg(test)]
mod tests;
