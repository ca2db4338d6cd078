//! Is the light of a ring the same in all directions? What a tilt, a gradient or a centre a little off leave is a first
//! harmonic and known elsewhere ([`super::centre`]); what else there is, a hair, a reflection, an uneven spot, shows as
//! scatter of the octants.

use super::rings::{Rings, SECTORS};

/// Rings from this radius on are judged, pixels: nearer, a pixel bends the profile.
const FROM_PX: f64 = 3.0;
/// Bands of rings end at so many times the radius they start at.
const BAND: f64 = 1.6;
/// A ring is judged down to this share of the largest, and from so many standard errors on.
const LEAST_LIGHT: f64 = 1e-4;
const CLEAR: f64 = 10.0;

/// Scatter of the octants over a band of rings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Band {
    pub from_mm: f64,
    pub to_mm: f64,
    /// Root mean square of the octants about their mean, without a first harmonic, as a share of the light.
    pub share: f64,
    /// What noise makes of it.
    pub noise: f64,
}

/// The bands of a picture's rings.
pub(super) fn bands(rings: &Rings) -> Vec<Band> {
    let grid = &rings.grid;
    let largest = rings.mean.iter().copied().filter(|mean| mean.is_finite()).fold(0.0, f64::max);
    let mut bands = Vec::new();
    let mut from = FROM_PX * grid.mm_per_pixel;
    while from < grid.bins as f64 * grid.bin_mm {
        let to = (from * BAND).max(from + 2.0 * grid.bin_mm);
        let (mut sums, mut weight) = ([0.0; SECTORS], 0.0);
        let first = (from / grid.bin_mm).ceil() as usize;
        let last = ((to / grid.bin_mm) as usize).min(grid.bins);
        for bin in first..last {
            let (mean, error) = (rings.mean[bin], rings.error[bin]);
            let clear = mean > LEAST_LIGHT * largest && mean > CLEAR * error && error > 0.0;
            if !clear || rings.sectors[bin].iter().any(|sector| sector.is_nan()) {
                continue;
            }
            let own = (mean / error).powi(2);
            weight += own;
            sums.iter_mut().zip(rings.sectors[bin]).for_each(|(sum, sector)| *sum += own * sector / mean);
        }
        if weight > 0.0 {
            let share = scatter(sums.map(|sum| sum / weight));
            bands.push(Band { from_mm: from, to_mm: to, share, noise: (SECTORS as f64 / weight).sqrt() });
        }
        from = to;
    }
    bands
}

/// Root mean square about the mean and the first harmonic: 3 of 8 degrees of freedom.
fn scatter(sectors: [f64; SECTORS]) -> f64 {
    let n = SECTORS as f64;
    let angle = |i: usize| (i as f64 + 0.5) * std::f64::consts::TAU / n;
    let mean = sectors.iter().sum::<f64>() / n;
    let part = |wave: fn(f64) -> f64| (0..SECTORS).map(|i| sectors[i] * wave(angle(i))).sum::<f64>() * 2.0 / n;
    let (cos, sin) = (part(libm::cos), part(libm::sin));
    let left = |i: usize| sectors[i] - mean - cos * libm::cos(angle(i)) - sin * libm::sin(angle(i));
    ((0..SECTORS).map(|i| left(i).powi(2)).sum::<f64>() / (n - 3.0)).sqrt()
}
