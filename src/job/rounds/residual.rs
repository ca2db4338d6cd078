//! What a round sees, and by how much the print misses over some mm² of surface.

use rayon::prelude::*;

use super::{super::look::Fit, RoundRecord};
use crate::{
    appearance::PointOfSurface,
    job::plan::{CHANNELS, ObjectPlan},
    optics::Estimate,
};

/// Radius of the bell that misses are averaged over, mm, half of whose weight lies within 0.45 of it; and that of a
/// narrow one, which adds what differs from the wide one by more than noise: beside edges, where parts end.
const REACH_MM: f64 = 2.4;
const NARROW_MM: f64 = 1.0;
/// Squares of standard errors that such a difference must be above.
const BEYOND_NOISE: f64 = 3.0;
/// Printed albedos below this share of what is asked for are black.
const BLACK: f64 = 1e-3;

/// What is asked for at a point, and what is printed there, by channel.
type AtPoint = Option<(Vec<f64>, Vec<Estimate>)>;

/// The print at the points of all objects.
pub(super) struct Looked {
    /// By object and point; `None` where the print cannot be seen.
    pub objects: Vec<Vec<AtPoint>>,
    walks: u64,
    channels: usize,
}

impl Looked {
    pub fn new(plans: &[ObjectPlan], walks: u64, channels: usize) -> Self {
        let objects = plans.iter().map(|plan| vec![None; plan.points.points().len()]).collect();
        Self { objects, walks, channels }
    }

    /// How far printed is from asked at single points.
    pub fn record(&self) -> RoundRecord {
        let seen: Vec<_> = self.objects.iter().flatten().flatten().collect();
        let n = seen.len().max(1) as f64;
        let fit = |channel: usize| {
            let (mut bias, mut squared, mut noise, mut level) = (0.0, 0.0, 0.0, 0.0);
            for (asked, printed) in &seen {
                let apart = printed[channel].mean - asked[channel];
                bias += apart / n;
                squared += apart * apart / n;
                noise += printed[channel].standard_error.powi(2) / n;
                level += asked[channel].powi(2) / n;
            }
            let rms = (squared - noise).max(0.0).sqrt();
            Fit { bias, rms, relative_rms: if level > 0.0 { rms / level.sqrt() } else { 0.0 } }
        };
        let fit = (0..self.channels).map(fit).collect();
        RoundRecord { points: seen.len(), walks: self.walks, fit, worst: 0.0, out_of_reach: 0.0 }
    }
}

/// By how much the albedo must rise at each point, as logarithms by channel, as far as noise allows; and the greatest
/// miss of means over some mm².
pub(super) fn residuals(plan: &ObjectPlan, seen: &[AtPoint]) -> (Vec<[f64; CHANNELS]>, f64) {
    let spacing = plan.points.spacing_mm();
    let [wide, narrow] = [REACH_MM.max(5.0 * spacing), NARROW_MM.max(2.0 * spacing)];
    let at = |point: &PointOfSurface| {
        let [(wide, wide_noise), (narrow, noise)] = [wide, narrow].map(|reach| miss(plan, seen, point, reach));
        let wide = std::array::from_fn(|channel| shrunk(wide[channel], wide_noise[channel]));
        let more = |channel: usize| shrunk(narrow[channel] - wide[channel], BEYOND_NOISE * noise[channel]);
        (std::array::from_fn(|channel| wide[channel] + more(channel)), wide)
    };
    let (off, wide): (Vec<_>, Vec<[f64; CHANNELS]>) = plan.points.points().par_iter().map(at).unzip();
    let worst = wide.iter().flatten().fold(0.0, |worst: f64, off| worst.max(off.abs()));
    (off, worst)
}

/// A difference no larger than its noise counts half, much smaller ones nothing.
fn shrunk(difference: f64, variance: f64) -> f64 {
    let square = difference * difference;
    if square > 0.0 { difference * square / (square + variance) } else { 0.0 }
}

/// ln (asked / printed) of means within `reach` mm, by channel, and its variance.
fn miss(plan: &ObjectPlan, seen: &[AtPoint], point: &PointOfSurface, reach: f64) -> ([f64; CHANNELS], [f64; CHANNELS]) {
    let factors = plan.factors();
    let (mut asked, mut printed, mut variance) = ([0.0; CHANNELS], [0.0; CHANNELS], [0.0; CHANNELS]);
    plan.points.around(point.point, point.normal, reach, |other, weight| {
        let Some((wanted, found)) = &seen[other] else { return };
        for channel in 0..wanted.len() {
            // Where all have the same factor, their sums count.
            let factor = if factors == wanted.len() { channel } else { 0 };
            asked[factor] += weight * wanted[channel];
            printed[factor] += weight * found[channel].mean;
            variance[factor] += (weight * found[channel].standard_error).powi(2);
        }
    });
    let (mut off, mut noise) = ([0.0; CHANNELS], [0.0; CHANNELS]);
    for channel in (0..factors).filter(|&channel| asked[channel] > 0.0) {
        let printed = printed[channel].max(BLACK * asked[channel]);
        off[channel] = libm::log(asked[channel] / printed);
        noise[channel] = variance[channel] / (printed * printed);
    }
    (off, noise)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_noise_counts_little() {
        assert_eq!(shrunk(0.0, 0.0), 0.0);
        assert_eq!(shrunk(0.2, 0.0), 0.2);
        assert!((shrunk(-0.1, 0.01) + 0.05).abs() < 1e-15);
        assert!(shrunk(0.01, 0.01) < 1e-4);
    }
}
