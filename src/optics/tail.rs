//! The light beyond the last sample.
//!
//! Far from the source light is diffuse and its profile falls like e^(−κr) (times a slow power of r, which a fit over a
//! limited range absorbs into κ). Cutting a profile at 5 mm loses 22% of the synthetic support's reflection.

use super::RadialProfile;
use super::profile::ring_areas;

/// The fit uses samples beyond this share of the reach…
const FIT_FROM: f64 = 0.6;
/// …and needs this many of them.
const FIT_MIN_SAMPLES: usize = 6;
/// Largest root mean square residual of ln f: 30% scatter about the line is noise, more is no exponential.
const FIT_MAX_RESIDUAL: f64 = 0.3;
/// A tail holding more than this share of all energy is a guess, not an extrapolation.
const MAX_SHARE: f64 = 0.5;
/// The outer samples are halved here to see how fast their energy falls.
const OUTERMOST: f64 = 0.8;
/// Share of the energy that may be missing without a word.
const NEGLIGIBLE: f64 = 1e-5;

/// What was done about the light beyond the last sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tail {
    /// The samples reach far enough: less than 1e-5 of the energy is beyond them, or even in their outer fifth.
    Negligible,
    /// Continued as an exponential.
    Exponential {
        /// Where the samples end, mm.
        from_mm: f64,
        /// Value there, per mm².
        value_per_mm2: f64,
        /// κ of e^(−κr), per mm.
        decay_per_mm: f64,
        /// Its share of the energy, sampled range and tail together.
        share: f64,
    },
    /// The outer samples are no falling exponential, or too few or too faint to tell: the profile is cut where they
    /// end.
    Cut {
        /// Where the samples end, mm.
        from_mm: f64,
    },
}

impl Tail {
    /// Decides from the outer samples.
    pub(super) fn of(profile: &RadialProfile) -> Self {
        let reach = profile.reach_mm();
        let energy = profile.energy();
        let cut = Self::Cut { from_mm: reach };
        let beyond = |share: f64| profile.r_mm().partition_point(|r| *r < share * reach);
        let first = beyond(FIT_FROM);
        let values = &profile.value_per_mm2()[first..];
        let radii = &profile.r_mm()[first..];
        if energy <= 0.0 || beyond_reach(profile, first, beyond(OUTERMOST)) < NEGLIGIBLE * energy {
            return Self::Negligible;
        }
        if values.len() < FIT_MIN_SAMPLES || values.iter().any(|value| *value <= 0.0) {
            return cut;
        }
        let Some((slope, at_reach)) = log_line(radii, values, reach) else { return cut };
        let decay = -slope;
        if decay <= 0.0 {
            return cut;
        }
        let value = libm::exp(at_reach);
        let beyond = std::f64::consts::TAU * value * (reach / decay + 1.0 / (decay * decay));
        let share = beyond / (energy + beyond);
        if share > MAX_SHARE {
            return cut;
        }
        Self::Exponential { from_mm: reach, value_per_mm2: value, decay_per_mm: decay, share }
    }
}

/// Energy to be expected beyond the reach, if it goes on falling as from the samples [first, last) to those from `last`
/// on; no more than the latter hold if that is next to nothing.
fn beyond_reach(profile: &RadialProfile, first: usize, last: usize) -> f64 {
    let outermost = outer_energy(profile, last);
    let before = outer_energy(profile, first) - outermost;
    let falling = if before > outermost { outermost * outermost / (before - outermost) } else { f64::INFINITY };
    falling.min(outermost.abs())
}

/// Energy of the samples from `first` on.
fn outer_energy(profile: &RadialProfile, first: usize) -> f64 {
    let values = profile.value_per_mm2();
    match profile.ring_edges() {
        Some(edges) => ring_areas(edges).zip(values).skip(first).map(|(area, value)| area * value).sum(),
        None => {
            let r = profile.r_mm();
            let trapezoid = |i: usize| 0.5 * (r[i] * values[i] + r[i - 1] * values[i - 1]) * (r[i] - r[i - 1]);
            std::f64::consts::TAU * (first.max(1)..r.len()).map(trapezoid).sum::<f64>()
        }
    }
}

/// Least-squares line through (x, ln y): its slope and its value at `x_at`, or `None` if the residual is too large.
fn log_line(x: &[f64], y: &[f64], x_at: f64) -> Option<(f64, f64)> {
    let n = x.len() as f64;
    let mean_x = x.iter().sum::<f64>() / n;
    let mean_y = y.iter().map(|y| libm::log(*y)).sum::<f64>() / n;
    let covariance: f64 = x.iter().zip(y).map(|(x, y)| (x - mean_x) * (libm::log(*y) - mean_y)).sum();
    let variance: f64 = x.iter().map(|x| (x - mean_x) * (x - mean_x)).sum();
    let slope = covariance / variance;
    let line = |x: f64| mean_y + slope * (x - mean_x);
    let residual = x.iter().zip(y).map(|(x, y)| (libm::log(*y) - line(*x)).powi(2)).sum::<f64>() / n;
    (residual.sqrt() <= FIT_MAX_RESIDUAL).then(|| (slope, line(x_at)))
}
