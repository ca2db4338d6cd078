//! What a round sees, and by how much the print misses over some mm² of surface.

use super::{
    super::look::Fit,
    RoundRecord,
    shape::{ByShape, Sample, Shape},
};
use crate::{
    appearance::SurfacePoints,
    job::plan::{CHANNELS, ObjectPlan},
    optics::Estimate,
    parallel,
};

/// Printed albedos below this share of what is asked for are black.
const BLACK: f64 = 1e-3;
/// Width of bells over shapes. Tried on what a rabbit misses before any correction, 125 walks a point, a seventh of the
/// points held back: what is left in hollows and where half the thickness is below 0.4 mm has standard deviations of
/// 2.6 and 4.2%; without likeness 3.3 and 4.4%; a narrow bell of 0.5 mm takes noise for a miss on flat parts (1.5 to
/// 2.9%), as one of 2.2 spacings does (a cube of albedo 0.2 is off by 2.0% with it, by 1.5% without).
const LIKENESS: f64 = 0.15;
const WIDE: Bell = Bell { reach_mm: 2.4, spacings: 5.0, likeness: None };
const ALIKE: Bell = Bell { likeness: Some(LIKENESS), ..WIDE };
const NARROW: Bell = Bell { reach_mm: 1.0, spacings: 2.0, likeness: Some(LIKENESS) };
/// Misses are averaged over bells, one after the other, each of which adds what differs from those before as far as it
/// is more than noise: a wide one, one over places of like shape, which lie along edges, and a narrow one of these.
const BELLS: [Bell; 3] = [WIDE, ALIKE, NARROW];
/// Where points are those of texels, what is left at each is its own: within two spacings of
/// [`SurfacePoints::apart`] there is no other. With it a chess board's texels are off by 1.7% after four rounds where
/// the bells alone leave 2.1% of spots as wide as two texels and 3.4% of texels.
const OWN: Bell = Bell { reach_mm: 0.0, spacings: 2.0, likeness: None };

/// What misses are averaged over.
struct Bell {
    /// Radius, mm, half of whose weight lies within 0.45 of it; where points lie far apart so many of their spacings.
    reach_mm: f64,
    spacings: f64,
    /// Width of the bell over shapes ([`Shape::likeness`]), if they count.
    likeness: Option<f64>,
}

/// A point that was looked at.
pub(super) struct Seen {
    /// Albedo that is asked for there, and what is printed, by channel.
    pub asked: Vec<f64>,
    pub printed: Vec<Estimate>,
    pub shape: Shape,
    /// [`Meant::beside`](super::grain::Meant::beside).
    pub grain: Vec<f64>,
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
    pub fn sums(&self, object: usize, plan: &ObjectPlan) -> Vec<Option<Sums<'_>>> {
        self.objects[object].iter().map(|seen| Some(sums_of(seen.as_ref()?, plan.factors()))).collect()
    }

    /// How far printed is from asked at single points, which count as far as they are lit.
    pub fn record(&self) -> RoundRecord {
        let seen: Vec<_> = self.objects.iter().flatten().flatten().collect();
        let n = seen.iter().map(|seen| seen.shape.lit()).sum::<f64>().max(f64::MIN_POSITIVE);
        let fit = |channel: usize| {
            let (mut bias, mut squared, mut noise, mut level) = (0.0, 0.0, 0.0, 0.0);
            for Seen { asked, printed, shape, .. } in &seen {
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
pub(super) fn residuals(plan: &ObjectPlan, sums: &[Option<Sums<'_>>]) -> (Vec<[f64; CHANNELS]>, f64) {
    let by_shape: Vec<ByShape> = (0..plan.factors())
        .map(|channel| ByShape::fit(&sums.iter().flatten().map(|sums| sums[channel]).collect::<Vec<_>>()))
        .collect();
    let expected: Vec<Option<Sums<'_>>> = sums
        .iter()
        .map(|sums| {
            let sums = sums.as_ref()?.iter().zip(&by_shape);
            Some(sums.map(|(sample, fit)| Sample { asked: sample.asked * fit.ratio(sample), ..*sample }).collect())
        })
        .collect();
    let points = plan.points.points();
    let mut off = vec![[0.0; CHANNELS]; points.len()];
    for bell in BELLS.iter().chain(plan.point_a_texel_mm.map(|_| &OWN)) {
        let differences = parallel::map(points.len(), |n| {
            let Missed { off: missed, variance } = miss(plan, &expected, n, bell);
            Missed { off: std::array::from_fn(|channel| missed[channel] - off[n][channel]), variance }
        });
        let shares = parallel::map(points.len(), |n| signal_shares(&plan.points, &expected, n, &differences));
        for (off, (difference, shares)) in off.iter_mut().zip(differences.iter().zip(shares)) {
            off.iter_mut().zip(difference.off).zip(shares).for_each(|((off, one), share)| *off += share * one);
        }
    }
    let at = |n: usize| {
        let lit = sums[n].as_ref().map_or(1.0, lit);
        let mut off = off[n];
        if let (Some(asked), Some(expected)) = (&sums[n], &expected[n]) {
            for (off, (asked, expected)) in off.iter_mut().zip(asked.iter().zip(expected)) {
                *off += if asked.asked > 0.0 { libm::log(asked.asked / expected.asked) } else { 0.0 };
            }
        }
        (off.map(|off| lit * off), miss(plan, sums, n, &WIDE).off.map(|off| lit * off))
    };
    let found = parallel::map(points.len(), at);
    let (off, wide): (Vec<_>, Vec<[f64; CHANNELS]>) = found.into_iter().unzip();
    let worst = wide.iter().flatten().fold(0.0, |worst: f64, off| worst.max(off.abs()));
    (off, worst)
}

/// What is asked and printed at a point, by factor.
pub(super) type Sums<'a> = Vec<Sample<'a>>;

/// Where all channels have the same factor, their means count.
fn sums_of(seen: &Seen, factors: usize) -> Sums<'_> {
    let each = (seen.asked.len() / factors.max(1)).max(1);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let of = |(asked, printed): (&[f64], &[Estimate])| Sample {
        shape: seen.shape,
        grain: &seen.grain,
        asked: mean(asked),
        printed: printed.iter().map(|printed| printed.mean).sum::<f64>() / printed.len().max(1) as f64,
        variance: printed.iter().map(|one| (one.standard_error / printed.len() as f64).powi(2)).sum(),
    };
    seen.asked.chunks(each).zip(seen.printed.chunks(each)).map(of).collect()
}

/// How much a place counts, of whose samples there is at least one.
fn lit(samples: &Sums<'_>) -> f64 {
    samples.first().map_or(0.0, |sample| sample.shape.lit())
}

/// ln (asked / printed) of means around a point, or what is left of it, by channel; and its variance.
struct Missed {
    off: [f64; CHANNELS],
    variance: [f64; CHANNELS],
}

/// Goes over the points in a bell around one, with their weights.
fn around(
    points: &SurfacePoints,
    seen: &[Option<Sums<'_>>],
    at: usize,
    bell: &Bell,
    mut visit: impl FnMut(usize, &Sums<'_>, f64),
) {
    let reach = bell.reach_mm.max(bell.spacings * points.spacing_mm());
    let point = &points.points()[at];
    let shape = |seen: &Option<Sums<'_>>| seen.as_ref().and_then(|samples| Some(samples.first()?.shape));
    let here = bell.likeness.zip(shape(&seen[at]));
    points.around(point.point, point.normal, reach, |other, weight| {
        let Some(samples) = &seen[other] else { return };
        let likeness = match (here, shape(&seen[other])) {
            (Some((width, here)), Some(there)) => here.likeness(&there, width),
            _ => 1.0,
        };
        visit(other, samples, weight * likeness * lit(samples));
    });
}

/// What is missed in a bell around a point.
fn miss(plan: &ObjectPlan, seen: &[Option<Sums<'_>>], at: usize, bell: &Bell) -> Missed {
    let (mut asked, mut printed, mut variance) = ([0.0; CHANNELS], [0.0; CHANNELS], [0.0; CHANNELS]);
    around(&plan.points, seen, at, bell, |_, samples, weight| {
        for (channel, sample) in samples.iter().enumerate() {
            asked[channel] += weight * sample.asked;
            printed[channel] += weight * sample.printed;
            variance[channel] += weight * weight * sample.variance;
        }
    });
    let mut missed = Missed { off: [0.0; CHANNELS], variance: [0.0; CHANNELS] };
    for channel in (0..plan.factors()).filter(|&channel| asked[channel] > 0.0) {
        let printed = printed[channel].max(BLACK * asked[channel]);
        missed.off[channel] = libm::log(asked[channel] / printed);
        missed.variance[channel] = variance[channel] / (printed * printed);
    }
    missed
}

/// How much of the difference at a point is no noise, by channel, 0 to 1: Wiener's filter, by the squares of the
/// differences around it at places of like shape. Of these, noise is taken to be all that is in the bell's means; what
/// is left of it after the bells before, which saw the same walks, is less: a little too much counts as noise.
fn signal_shares(
    points: &SurfacePoints,
    seen: &[Option<Sums<'_>>],
    at: usize,
    differences: &[Missed],
) -> [f64; CHANNELS] {
    let (mut signal, mut weights) = ([0.0; CHANNELS], 0.0);
    around(points, seen, at, &ALIKE, |other, _, weight| {
        weights += weight;
        let Missed { off, variance } = &differences[other];
        for (signal, (off, variance)) in signal.iter_mut().zip(off.iter().zip(variance)) {
            *signal += weight * (off * off - variance);
        }
    });
    let noise = differences[at].variance;
    std::array::from_fn(|channel| signal_share(signal[channel] / weights.max(f64::MIN_POSITIVE), noise[channel]))
}

/// The share of signal in a difference, of the mean squares of signal and noise.
fn signal_share(signal: f64, noise: f64) -> f64 {
    if signal > 0.0 { signal / (signal + noise) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share at a point amid a plate that sees so much of the `sky`, where points differ by (miss, variance).
    fn share_amid(sky: f64, difference: impl Fn(usize) -> [f64; 2]) -> f64 {
        let corner = |x: f64, y: f64| glam::DVec3::new(x, y, 0.0);
        let [a, b, c, d] = [corner(0.0, 0.0), corner(10.0, 0.0), corner(10.0, 10.0), corner(0.0, 10.0)];
        let points = SurfacePoints::spread(&[[a, b, c], [a, c, d]], 0.5, 1000);
        let shape = Shape::with([0.0, 0.0, 1.0 - sky]);
        let sample = Sample { shape, grain: &[], asked: 0.3, printed: 0.3, variance: 0.0 };
        let seen: Vec<_> = points.points().iter().map(|_| Some(vec![sample])).collect();
        let missed = |n: usize| difference(n).map(|number| [number; CHANNELS]);
        let differences: Vec<Missed> =
            (0..seen.len()).map(missed).map(|[off, variance]| Missed { off, variance }).collect();
        signal_shares(&points, &seen, seen.len() / 2, &differences)[0]
    }

    #[test]
    fn what_varies_no_more_than_its_noise_counts_nothing() {
        let noise = |n: usize| if (n as f64 * 0.618).fract() < 0.5 { 0.1 } else { -0.1 };
        assert_eq!(share_amid(1.0, |n| [noise(n), 0.011]), 0.0);
        let mostly = share_amid(1.0, |n| [noise(n) + 0.3, 0.01]);
        assert!((mostly - 0.9).abs() < 0.03, "{mostly}: 0.09 of signal");
        assert!((share_amid(1.0, |_| [0.2, 0.0]) - 1.0).abs() < 1e-12);
        // Where nothing is lit nothing tells.
        assert_eq!(share_amid(0.0, |_| [0.2, 0.01]), 0.0);
    }

    #[test]
    fn shares_of_signal() {
        assert_eq!(
            [(0.0, 0.0), (-0.1, 0.1), (0.2, 0.0)].map(|(signal, noise)| signal_share(signal, noise)),
            [0.0, 0.0, 1.0]
        );
        assert!((signal_share(0.01, 0.03) - 0.25).abs() < 1e-15);
    }
}
