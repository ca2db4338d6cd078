//! What a round sees, and by how much the print misses over some mm² of surface.

use super::{
    super::look::Fit,
    RoundRecord,
    shape::{ByShape, Sample, Shape},
};
use crate::{
    appearance::PointOfSurface,
    job::plan::{CHANNELS, ObjectPlan},
    optics::Estimate,
    parallel,
};

/// Misses are averaged over bells, one after the other, each of which adds what differs from those before by more than
/// noise: a wide one, one over places of like shape, which lie along edges, and a narrow one of these. Tried on what a
/// rabbit misses before any correction, 125 walks a point, a seventh of the points held back: what is left in hollows
/// and where half the thickness is below 0.4 mm has standard deviations of 2.6 and 4.2%; without likeness 3.3 and 4.4%;
/// a narrow bell of 0.5 mm takes noise for a miss on flat parts (1.5 to 2.9%).
const BELLS: [Bell; 3] = [
    WIDE,
    Bell { reach_mm: 2.4, spacings: 5.0, likeness: Some(0.15), beyond_noise: 3.0 },
    Bell { reach_mm: 1.0, spacings: 2.0, likeness: Some(0.15), beyond_noise: 3.0 },
];
/// Where points are those of texels, what is left at each is its own: within two spacings of
/// [`SurfacePoints::apart`](crate::appearance::SurfacePoints::apart) there is no other. Noise as in narrow bells; with
/// it a chess board's texels are off by 1.7% after four rounds where the bells alone leave 2.1% of spots as wide as two
/// texels and 3.4% of texels.
const OWN: Bell = Bell { reach_mm: 0.0, spacings: 2.0, likeness: None, beyond_noise: 3.0 };
/// Printed albedos below this share of what is asked for are black.
const BLACK: f64 = 1e-3;

const WIDE: Bell = Bell { reach_mm: 2.4, spacings: 5.0, likeness: None, beyond_noise: 1.0 };

/// What misses are averaged over.
struct Bell {
    /// Radius, mm, half of whose weight lies within 0.45 of it; where points lie far apart so many of their spacings.
    reach_mm: f64,
    spacings: f64,
    /// Width of the bell over shapes ([`Shape::likeness`]), if they count.
    likeness: Option<f64>,
    /// Squares of standard errors that a difference must be above to count half.
    beyond_noise: f64,
}

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

    /// What is asked and printed at the points of an object, by factor.
    pub fn sums(&self, object: usize, plan: &ObjectPlan) -> Vec<Option<Sums>> {
        let of = |seen: &Option<Seen>| seen.as_ref().map(|seen| sums_of(seen, plan.factors()));
        self.objects[object].iter().map(of).collect()
    }

    /// How far printed is from asked at single points, which count as far as they are lit.
    pub fn record(&self) -> RoundRecord {
        let seen: Vec<_> = self.objects.iter().flatten().flatten().collect();
        let n = seen.iter().map(|seen| seen.shape.lit()).sum::<f64>().max(f64::MIN_POSITIVE);
        let fit = |channel: usize| {
            let (mut bias, mut squared, mut noise, mut level) = (0.0, 0.0, 0.0, 0.0);
            for Seen { asked, printed, shape } in &seen {
                let weight = shape.lit() / n;
                let apart = printed[channel].mean - asked[channel];
                bias += weight * apart;
                squared += weight * apart * apart;
                noise += weight * printed[channel].standard_error.powi(2);
                level += weight * asked[channel].powi(2);
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
/// Places that are hardly lit are to change by as much less.
pub(super) fn residuals(plan: &ObjectPlan, sums: &[Option<Sums>]) -> (Vec<[f64; CHANNELS]>, f64) {
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
        let shape = sums[n].as_ref().and_then(|sums| Some(&sums.first()?.shape));
        let mut off = [0.0; CHANNELS];
        for bell in BELLS.iter().chain(plan.point_a_texel_mm.map(|_| &OWN)) {
            let (missed, noise) = miss(plan, &expected, point, bell, shape);
            for (off, (missed, noise)) in off.iter_mut().zip(missed.into_iter().zip(noise)) {
                *off += shrunk(missed - *off, bell.beyond_noise * noise);
            }
        }
        let (whole, _) = miss(plan, sums, point, &WIDE, None);
        if let (Some(asked), Some(expected)) = (&sums[n], &expected[n]) {
            for (off, (asked, expected)) in off.iter_mut().zip(asked.iter().zip(expected)) {
                *off += if asked.asked > 0.0 { libm::log(asked.asked / expected.asked) } else { 0.0 };
            }
        }
        let factors = plan.factors();
        let lit = shape.map_or(1.0, Shape::lit);
        let off = std::array::from_fn(|channel| if channel < factors { lit * off[channel] } else { 0.0 });
        (off, whole.map(|off| lit * off))
    };
    let points = plan.points.points();
    let found = parallel::map(points.len(), |n| at((n, &points[n])));
    let (off, wide): (Vec<_>, Vec<[f64; CHANNELS]>) = found.into_iter().unzip();
    let worst = wide.iter().flatten().fold(0.0, |worst: f64, off| worst.max(off.abs()));
    (off, worst)
}

/// What is asked and printed at a point, by factor.
pub(super) type Sums = Vec<Sample>;

/// Where all channels have the same factor, their means count.
fn sums_of(seen: &Seen, factors: usize) -> Sums {
    let each = (seen.asked.len() / factors.max(1)).max(1);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let of = |(asked, printed): (&[f64], &[Estimate])| Sample {
        shape: seen.shape,
        asked: mean(asked),
        printed: printed.iter().map(|printed| printed.mean).sum::<f64>() / printed.len().max(1) as f64,
        variance: printed.iter().map(|one| (one.standard_error / printed.len() as f64).powi(2)).sum(),
    };
    seen.asked.chunks(each).zip(seen.printed.chunks(each)).map(of).collect()
}

/// A difference no larger than its noise counts half, much smaller ones nothing.
fn shrunk(difference: f64, variance: f64) -> f64 {
    let square = difference * difference;
    if square > 0.0 { difference * square / (square + variance) } else { 0.0 }
}

/// ln (asked / printed) of means over a bell around a point of some shape, by channel, and its variance.
fn miss(
    plan: &ObjectPlan,
    seen: &[Option<Sums>],
    point: &PointOfSurface,
    bell: &Bell,
    shape: Option<&Shape>,
) -> ([f64; CHANNELS], [f64; CHANNELS]) {
    let reach = bell.reach_mm.max(bell.spacings * plan.points.spacing_mm());
    let (mut asked, mut printed, mut variance) = ([0.0; CHANNELS], [0.0; CHANNELS], [0.0; CHANNELS]);
    plan.points.around(point.point, point.normal, reach, |other, weight| {
        let Some(samples) = &seen[other] else { return };
        let likeness = match (bell.likeness, shape, samples.first()) {
            (Some(width), Some(shape), Some(there)) => shape.likeness(&there.shape, width),
            _ => 1.0,
        };
        let lit = samples.first().map_or(0.0, |sample| sample.shape.lit());
        let weight = weight * likeness * lit;
        for (channel, sample) in samples.iter().enumerate() {
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
