//! What a round sees, and by how much the print misses over some mm² of surface.

use rayon::prelude::*;

use super::{super::look::Fit, RoundRecord};
use crate::{
    job::plan::{CHANNELS, ObjectPlan},
    optics::Estimate,
};

/// Radius of the bell that misses are averaged over, mm; half of its weight lies within 0.45 of it.
const REACH_MM: f64 = 2.0;
/// Printed albedos below this are black.
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

/// By how much the albedo must rise at each point, as logarithms by channel, and the greatest of them. As far as noise
/// allows: a miss that is no larger than its standard error counts half.
pub(super) fn residuals(plan: &ObjectPlan, seen: &[AtPoint]) -> (Vec<[f64; CHANNELS]>, f64) {
    let factors = plan.factors();
    let reach = REACH_MM.max(4.0 * plan.points.spacing_mm());
    let at = |point: &crate::appearance::PointOfSurface| {
        let (mut asked, mut printed, mut variance) = ([0.0; CHANNELS], [0.0; CHANNELS], [0.0; CHANNELS]);
        plan.points.around(point.point, point.normal, reach, |other, weight| {
            let Some((wanted, found)) = &seen[other] else { return };
            let channels = wanted.len();
            for channel in 0..channels {
                // Where all have the same factor, their sums count.
                let factor = if factors == channels { channel } else { 0 };
                asked[factor] += weight * wanted[channel];
                printed[factor] += weight * found[channel].mean;
                variance[factor] += (weight * found[channel].standard_error).powi(2);
            }
        });
        std::array::from_fn(|channel| {
            if channel >= factors || asked[channel] <= 0.0 {
                return 0.0;
            }
            let least = BLACK * asked[channel];
            let off = libm::log(asked[channel] / printed[channel].max(least));
            let noise = variance[channel] / printed[channel].max(least).powi(2);
            if off == 0.0 { 0.0 } else { off * (off * off / (off * off + noise)) }
        })
    };
    let off: Vec<[f64; CHANNELS]> = plan.points.points().par_iter().map(at).collect();
    let worst = off.iter().flatten().fold(0.0, |worst: f64, off| worst.max(off.abs()));
    (off, worst)
}
