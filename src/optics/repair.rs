//! Transmission spectra below the noise.
//!
//! T̂(k) of a slab of thickness h falls like e^(−hk), while the noise of a measured or simulated profile is level:
//! beyond some k the transform is noise of either sign. The paper (§5.3) truncates negative coefficients to 0; but T =
//! 0 breaks the closed form of Kubelka and Munk and its halving limit alike (γh = asinh(βR/T)). Here ln T̂ is continued
//! instead.

use super::FrequencyGrid;

/// A coefficient this many standard deviations above 0 is taken as signal.
const SIGNIFICANT: f64 = 4.0;
/// The continuation is fitted to at most this many coefficients before the noise.
const FIT_COEFFICIENTS: usize = 8;

/// The continuation stops falling here: the models divide by T̂.
const LEAST: f64 = 1e-290;

/// Where and how a transmission spectrum was continued.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransmissionRepair {
    /// First frequency whose coefficient is extrapolated, rad/mm.
    pub from_k: f64,
    /// Its index in the grid.
    pub from_index: usize,
    /// −d ln T̂/dk of the continuation, mm: near the slab's thickness.
    pub slope_mm: f64,
}

/// A transmission spectrum that says nothing: fewer than 3 coefficients above the noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("transmission: found {significant} coefficients above the noise, expected at least 3; use a thinner slab")]
pub struct LostInNoise {
    /// Coefficients above the noise.
    pub significant: usize,
}

impl crate::blame::Blamed for LostInNoise {}

/// Continues ln T̂(k) as a line in k from where T̂ drops into noise; leaves a clean spectrum alone and returns `None`.
///
/// `noise` is the standard deviation of each coefficient. Without it the noise is judged by the spectrum itself: T̂
/// must fall with k, so the first coefficient that is not positive or rises gives it away, and the level is the root
/// mean square from there on. *Fails* where T̂ truly rises with k, which no slab under a diffuse source does.
///
/// # Errors
/// [`LostInNoise`] if there is nothing to continue from.
pub fn repair_transmission(
    values: &mut [f64],
    noise: Option<&[f64]>,
    grid: &FrequencyGrid,
) -> Result<Option<TransmissionRepair>, LostInNoise> {
    let Some(from) = first_lost(values, noise) else { return Ok(None) };
    if from < 3 {
        return Err(LostInNoise { significant: from });
    }
    let k = grid.as_slice();
    let first = from - from.min(FIT_COEFFICIENTS);
    let window = first..from;
    let n = window.len() as f64;
    let mean_k = k[window.clone()].iter().sum::<f64>() / n;
    // Weighted by T̂², since the noise of ln T̂ is noise/T̂: the last coefficients before the noise count least.
    let weight: f64 = values[window.clone()].iter().map(|t| t * t).sum();
    let centre = window.clone().map(|i| values[i].powi(2) * (k[i] - mean_k)).sum::<f64>() / weight + mean_k;
    let log_mean = window.clone().map(|i| values[i].powi(2) * libm::log(values[i])).sum::<f64>() / weight;
    let covariance: f64 =
        window.clone().map(|i| values[i].powi(2) * (k[i] - centre) * (libm::log(values[i]) - log_mean)).sum();
    let variance: f64 = window.map(|i| values[i].powi(2) * (k[i] - centre).powi(2)).sum();
    let slope = (covariance / variance).min(0.0);
    for i in from..values.len() {
        values[i] = libm::exp(log_mean + slope * (k[i] - centre)).max(LEAST);
    }
    Ok(Some(TransmissionRepair { from_k: k[from], from_index: from, slope_mm: -slope }))
}

/// Index of the first coefficient lost in the noise.
fn first_lost(values: &[f64], noise: Option<&[f64]>) -> Option<usize> {
    if let Some(noise) = noise {
        return values.iter().zip(noise).position(|(value, noise)| *value <= SIGNIFICANT * noise);
    }
    let betrayed = (0..values.len()).find(|&i| values[i] <= 0.0 || (i > 0 && values[i] > values[i - 1]))?;
    let rest = &values[betrayed..];
    let level = (rest.iter().map(|value| value * value).sum::<f64>() / rest.len() as f64).sqrt();
    // A rise while still well above the level leaves nothing quiet before it: the betrayed coefficient is then the
    // first lost.
    let quiet = values[..betrayed].iter().position(|value| *value <= SIGNIFICANT * level);
    Some(quiet.unwrap_or(betrayed))
}
