//! What a round sees, and by how much the print misses over some mm² of surface.

use rayon::prelude::*;

use super::{
    super::look::Fit,
    RoundRecord,
    shape::{ByShape, Sample, Shape},
};
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

/// A point that was looked at.
pub(super) struct Seen {
    /// Albedo that is asked for there, and what is printed, by channel.
    pub asked: Vec<f64>,
    pub printed: Vec<Estimate>,
    pub shape: Shape,
}

/// The print at the points of all objects.
pub(super) struct Looked {
    /// By object and point; `None` where the print cannot be seen.
    pub objects: Vec<Vec<Option<Seen>>>,
    walks: u64,
    channels: usize,
}

impl Looked {
    pub fn new(plans: &[ObjectPlan], walks: u64, channels: usize) -> Self {
        let none = |plan: &ObjectPlan| plan.points.points().iter().map(|_| None).collect();
        let objects = plans.iter().map(none).collect();
        Self { objects, walks, channels }
    }

    /// How far printed is from asked at single points.
    pub fn record(&self) -> RoundRecord {
        let seen: Vec<_> = self.objects.iter().flatten().flatten().collect();
        let n = seen.len().max(1) as f64;
        let fit = |channel: usize| {
            let (mut bias, mut squared, mut noise, mut level) = (0.0, 0.0, 0.0, 0.0);
            for Seen { asked, printed, .. } in &seen {
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
        RoundRecord { points: seen.len(), walks: self.walks, fit, worst: 0.0, out_of_reach: 0.0, ended: None }
    }
}

/// By how much the albedo must rise at each point, as logarithms by channel, as far as noise allows; and the greatest
/// miss of means over some mm². What places of like shape miss alike comes first, and then what is left around each.
pub(super) fn residuals(plan: &ObjectPlan, seen: &[Option<Seen>]) -> (Vec<[f64; CHANNELS]>, f64) {
    let spacing = plan.points.spacing_mm();
    let [wide, narrow] = [REACH_MM.max(5.0 * spacing), NARROW_MM.max(2.0 * spacing)];
    let sums: Vec<Option<Sums>> = seen.iter().map(|seen| seen.as_ref().map(|seen| sums(plan, seen))).collect();
    let by_shape: Vec<ByShape> = (0..plan.factors())
        .map(|channel| ByShape::fit(&sums.iter().flatten().map(|sums| sums[channel]).collect::<Vec<_>>()))
        .collect();
    let expected: Vec<Option<Sums>> = sums
        .iter()
        .map(|sums| {
            let expect = |(sample, fit): (Sample, &ByShape)| Sample {
                asked: sample.asked * fit.ratio(&sample.shape, sample.asked),
                ..sample
            };
            sums.as_ref().map(|sums| sums.iter().copied().zip(&by_shape).map(expect).collect())
        })
        .collect();
    let at = |(n, point): (usize, &PointOfSurface)| {
        let [(left, left_noise), (near, noise)] = [wide, narrow].map(|reach| miss(plan, &expected, point, reach));
        let (whole, _) = miss(plan, &sums, point, wide);
        let off = |channel: usize| {
            let shape = match (&sums[n], &expected[n]) {
                (Some(asked), Some(expected)) if asked[channel].asked > 0.0 => {
                    libm::log(asked[channel].asked / expected[channel].asked)
                }
                _ => 0.0,
            };
            let left = shrunk(left[channel], left_noise[channel]);
            shape + left + shrunk(near[channel] - left, BEYOND_NOISE * noise[channel])
        };
        let factors = plan.factors();
        (std::array::from_fn(|channel| if channel < factors { off(channel) } else { 0.0 }), whole)
    };
    let (off, wide): (Vec<_>, Vec<[f64; CHANNELS]>) = plan.points.points().par_iter().enumerate().map(at).unzip();
    let worst = wide.iter().flatten().fold(0.0, |worst: f64, off| worst.max(off.abs()));
    (off, worst)
}

/// What is asked and printed at a point, by factor.
type Sums = Vec<Sample>;

/// Where all channels have the same factor, their means count.
fn sums(plan: &ObjectPlan, seen: &Seen) -> Sums {
    let each = seen.asked.len() / plan.factors();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let of = |(asked, printed): (&[f64], &[Estimate])| Sample {
        shape: seen.shape,
        asked: mean(asked),
        printed: printed.iter().map(|printed| printed.mean).sum::<f64>() / printed.len().max(1) as f64,
        variance: printed.iter().map(|one| (one.standard_error / printed.len() as f64).powi(2)).sum(),
    };
    seen.asked.chunks(each.max(1)).zip(seen.printed.chunks(each.max(1))).map(of).collect()
}

/// A difference no larger than its noise counts half, much smaller ones nothing.
fn shrunk(difference: f64, variance: f64) -> f64 {
    let square = difference * difference;
    if square > 0.0 { difference * square / (square + variance) } else { 0.0 }
}

/// ln (asked / printed) of means within `reach` mm, by channel, and its variance.
fn miss(
    plan: &ObjectPlan,
    seen: &[Option<Sums>],
    point: &PointOfSurface,
    reach: f64,
) -> ([f64; CHANNELS], [f64; CHANNELS]) {
    let (mut asked, mut printed, mut variance) = ([0.0; CHANNELS], [0.0; CHANNELS], [0.0; CHANNELS]);
    plan.points.around(point.point, point.normal, reach, |other, weight| {
        for (channel, sample) in seen[other].iter().flatten().enumerate() {
            asked[channel] += weight * sample.asked;
            printed[channel] += weight * sample.printed;
            variance[channel] += weight * weight * sample.variance;
        }
    });
    let (mut off, mut noise) = ([0.0; CHANNELS], [0.0; CHANNELS]);
    for channel in (0..plan.factors()).filter(|&channel| asked[channel] > 0.0) {
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
