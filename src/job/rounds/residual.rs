//! What a round sees, and by how much the print misses over some mm² of surface.

use super::{
    super::look::Fit,
    RoundRecord,
    contrast::Contrast,
    minus,
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
/// After what places of like shape miss all over an object, misses are averaged over bells, one after the other, each
/// of which adds what differs from those before as far as it is more than noise: a wide one, one over places of like
/// shape, which lie along edges, and a narrow one of these.
const BELLS: [Bell; 3] = [WIDE, ALIKE, NARROW];
/// Places all over an object around which what is missed is told first, for whatever is of like shape: the cubic of
/// [`ByShape`] leaves half a percent on the faces of a cube for its edges' sake, which noise hides from single bells.
/// Around so many, some twenty and more points each, are all points of an object.
pub(super) const PLACES: usize = 1000;
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
    /// By channel.
    pub contrast: Vec<Contrast>,
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

/// By how much the albedo must rise at each point, as logarithms by channel, as far as noise allows.
pub(super) struct Residuals {
    /// All of it.
    pub off: Vec<[f64; CHANNELS]>,
    /// What of it is for grain and contrast alone, which differ from point to point; nothing where grain was not
    /// counted.
    pub of_points: Vec<[f64; CHANNELS]>,
    /// The greatest miss of means over some mm².
    pub worst: f64,
}

impl Residuals {
    /// What places of like shape miss alike comes first, and then what is left around each. Places that are hardly lit
    /// are to change by as much less.
    pub fn of(plan: &ObjectPlan, sums: &[Option<Sums<'_>>]) -> Self {
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
        add_signal(&plan.points, &expected, &mut off, &everywhere(&plan.points, &expected));
        for bell in BELLS.iter().chain(plan.point_a_texel_mm.map(|_| &OWN)) {
            let differences = parallel::map(points.len(), |n| {
                let Missed { off: missed, variance } = miss(&plan.points, &expected, n, bell);
                Missed { off: std::array::from_fn(|channel| missed[channel] - off[n][channel]), variance }
            });
            add_signal(&plan.points, &expected, &mut off, &differences);
        }
        let at = |n: usize| {
            let lit = sums[n].as_ref().map_or(1.0, lit);
            let (mut off, mut of_points) = (off[n], [0.0; CHANNELS]);
            let samples = sums[n].iter().flatten().zip(&by_shape);
            for ((off, of_points), (sample, fit)) in off.iter_mut().zip(&mut of_points).zip(samples) {
                if sample.asked > 0.0 {
                    let ratio = fit.ratio(sample);
                    *off -= libm::log(ratio);
                    if !sample.grain.is_empty() {
                        *of_points = libm::log(fit.ratio(&sample.like_any()) / ratio);
                    }
                }
            }
            let wide = miss(&plan.points, sums, n, &WIDE).off;
            [off, of_points, wide].map(|of| of.map(|off| lit * off))
        };
        let found = parallel::map(points.len(), at);
        let worst = found.iter().flat_map(|[.., wide]| wide).fold(0.0, |worst: f64, off| worst.max(off.abs()));
        let (off, mut of_points): (_, Vec<_>) = found.into_iter().map(|[off, of_points, _]| (off, of_points)).unzip();
        // What it has in common around a point is no single point's: counts of grain are of voxels, whose middles lie
        // below the surface.
        if counts_grain(sums) {
            let common = parallel::map(points.len(), |n| mean_alike(&plan.points, sums, n, &of_points));
            of_points = of_points.iter().zip(&common).map(|(all, common)| minus(all, common)).collect();
        }
        Self { off, of_points, worst }
    }
}

/// Adds of the `differences` to what is `off` what is no noise.
fn add_signal(points: &SurfacePoints, seen: &[Option<Sums<'_>>], off: &mut [[f64; CHANNELS]], differences: &[Missed]) {
    let shares = parallel::map(off.len(), |n| signal_shares(points, seen, n, differences));
    for (off, (difference, shares)) in off.iter_mut().zip(differences.iter().zip(shares)) {
        off.iter_mut().zip(difference.off).zip(shares).for_each(|((off, one), share)| *off += share * one);
    }
}

/// What is asked and printed at a point, by factor.
pub(super) type Sums<'a> = Vec<Sample<'a>>;

/// Whether what lies below the points was counted.
pub(super) fn counts_grain(sums: &[Option<Sums<'_>>]) -> bool {
    sums.iter().flatten().flatten().any(|sample| !sample.grain.is_empty())
}

/// Where all channels have the same factor, their means count.
fn sums_of(seen: &Seen, factors: usize) -> Sums<'_> {
    let each = (seen.asked.len() / factors.max(1)).max(1);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let of = |((asked, printed), contrast): ((&[f64], &[Estimate]), &[Contrast])| Sample {
        shape: seen.shape,
        grain: &seen.grain,
        contrast: std::array::from_fn(|n| {
            contrast.iter().map(|of_channel| of_channel[n]).sum::<f64>() / contrast.len() as f64
        }),
        asked: mean(asked),
        printed: printed.iter().map(|printed| printed.mean).sum::<f64>() / printed.len().max(1) as f64,
        variance: printed.iter().map(|one| (one.standard_error / printed.len() as f64).powi(2)).sum(),
    };
    seen.asked.chunks(each).zip(seen.printed.chunks(each)).zip(seen.contrast.chunks(each)).map(of).collect()
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

/// The mean of `values` at places of like shape around a point.
fn mean_alike(
    points: &SurfacePoints,
    seen: &[Option<Sums<'_>>],
    at: usize,
    values: &[[f64; CHANNELS]],
) -> [f64; CHANNELS] {
    let (mut weights, mut mean) = (0.0, [0.0; CHANNELS]);
    around_alike(points, seen, at, |other, _, weight| {
        weights += weight;
        mean.iter_mut().zip(values[other]).for_each(|(mean, value)| *mean += weight * value);
    });
    mean.map(|mean| mean / f64::max(weights, f64::MIN_POSITIVE))
}

/// What is missed in a bell around a point.
fn miss(points: &SurfacePoints, seen: &[Option<Sums<'_>>], at: usize, bell: &Bell) -> Missed {
    let (mut asked, mut printed, mut variance) = ([0.0; CHANNELS], [0.0; CHANNELS], [0.0; CHANNELS]);
    around(points, seen, at, bell, |_, samples, weight| {
        for (channel, sample) in samples.iter().enumerate() {
            asked[channel] += weight * sample.asked;
            printed[channel] += weight * sample.printed;
            variance[channel] += weight * weight * sample.variance;
        }
    });
    let mut missed = Missed { off: [0.0; CHANNELS], variance: [0.0; CHANNELS] };
    for channel in (0..CHANNELS).filter(|&channel| asked[channel] > 0.0) {
        let printed = printed[channel].max(BLACK * asked[channel]);
        missed.off[channel] = libm::log(asked[channel] / printed);
        missed.variance[channel] = variance[channel] / (printed * printed);
    }
    missed
}

/// What is missed at places of like shape wherever they lie, for every point: means of what is missed around
/// [`PLACES`].
fn everywhere(points: &SurfacePoints, seen: &[Option<Sums<'_>>]) -> Vec<Missed> {
    let shape = |n: usize| seen[n].as_ref().and_then(|samples| Some(samples.first()?.shape));
    let apart = seen.len().div_ceil(PLACES).max(1);
    let places: Vec<(usize, Shape)> = (0..seen.len()).step_by(apart).filter_map(|n| Some((n, shape(n)?))).collect();
    let missed = parallel::map_all(&places, |&(n, _)| {
        let (mut weights, mut squares) = (0.0, 0.0);
        around_alike(points, seen, n, |_, _, weight| {
            weights += weight;
            squares += weight * weight;
        });
        // So many places see each point, whose noise they share.
        let shared = (weights * weights / f64::max(squares, f64::MIN_POSITIVE) / apart as f64).max(1.0);
        let Missed { off, variance } = miss(points, seen, n, &ALIKE);
        Missed { off, variance: variance.map(|variance| shared * variance) }
    });
    let asks = |n: usize, channel: usize| {
        seen[n].as_ref().and_then(|samples| samples.get(channel)).is_some_and(|sample| sample.asked > 0.0)
    };
    parallel::map(seen.len(), |n| {
        let (mut sums, mut mean) = ([0.0; CHANNELS], Missed { off: [0.0; CHANNELS], variance: [0.0; CHANNELS] });
        let Some(here) = shape(n) else { return mean };
        for ((place, there), missed) in places.iter().zip(&missed) {
            let weight = here.likeness(there, LIKENESS) * there.lit();
            for channel in (0..CHANNELS).filter(|&channel| asks(*place, channel)) {
                sums[channel] += weight;
                mean.off[channel] += weight * missed.off[channel];
                mean.variance[channel] += weight * weight * missed.variance[channel];
            }
        }
        for (channel, sum) in sums.into_iter().enumerate().filter(|(_, sum)| *sum > 0.0) {
            mean.off[channel] /= sum;
            mean.variance[channel] = mean.variance[channel] / sum / sum;
        }
        mean
    })
}

/// [`around`] over places of like shape.
pub(super) fn around_alike(
    points: &SurfacePoints,
    seen: &[Option<Sums<'_>>],
    at: usize,
    visit: impl FnMut(usize, &Sums<'_>, f64),
) {
    around(points, seen, at, &ALIKE, visit);
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
    around_alike(points, seen, at, |other, _, weight| {
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
    use super::{super::contrast::EVEN, *};

    /// The share at a point amid a plate that sees so much of the `sky`, where points differ by (miss, variance).
    fn share_amid(sky: f64, difference: impl Fn(usize) -> [f64; 2]) -> f64 {
        let corner = |x: f64, y: f64| glam::DVec3::new(x, y, 0.0);
        let [a, b, c, d] = [corner(0.0, 0.0), corner(10.0, 0.0), corner(10.0, 10.0), corner(0.0, 10.0)];
        let points = SurfacePoints::spread(&[[a, b, c], [a, c, d]], 0.5, 1000);
        let shape = Shape::with([0.0, 0.0, 1.0 - sky]);
        let sample = Sample { shape, grain: &[], contrast: EVEN, asked: 0.3, printed: 0.3, variance: 0.0 };
        let seen: Vec<_> = points.points().iter().map(|_| Some(vec![sample])).collect();
        let missed = |n: usize| difference(n).map(|number| [number; CHANNELS]);
        let differences: Vec<Missed> =
            (0..seen.len()).map(missed).map(|[off, variance]| Missed { off, variance }).collect();
        signal_shares(&points, &seen, seen.len() / 2, &differences)[0]
    }

    /// What places of one shape miss alike is found under noise of ten times as much at each point, and is none of
    /// what other places miss.
    #[test]
    fn what_is_alike_everywhere_is_found_under_noise() {
        let corner = |x: f64, y: f64| glam::DVec3::new(x, y, 0.0);
        let [a, b, c, d] = [corner(0.0, 0.0), corner(20.0, 0.0), corner(20.0, 20.0), corner(0.0, 20.0)];
        let points = SurfacePoints::spread(&[[a, b, c], [a, c, d]], 0.2, 10_000);
        let sample = |n: usize| {
            let (near, missed) = if n.is_multiple_of(3) { (0.6, 0.05) } else { (0.0, -0.005) };
            let noise = if (n as f64 * 0.618).fract() < 0.5 { 0.05 } else { -0.05 };
            let (shape, printed) = (Shape::with([near, 0.0, 0.0]), 0.3 * (1.0 + missed + noise));
            Sample { shape, grain: &[], contrast: EVEN, asked: 0.3, printed, variance: (0.3_f64 * 0.05).powi(2) }
        };
        let seen: Vec<_> = (0..points.points().len()).map(|n| Some(vec![sample(n)])).collect();
        let found = everywhere(&points, &seen);
        // A third of the points are of the one shape.
        let least = 0.05 / (points.points().len() as f64).sqrt();
        for (n, found) in found.iter().enumerate().skip(3000).take(3) {
            let wanted = if n.is_multiple_of(3) { -0.05 } else { 0.005 };
            let error = found.variance[0].sqrt();
            assert!((found.off[0] - wanted).abs() < 0.002, "{n}: {} ± {error}", found.off[0]);
            assert!(error > least && error < 4.0 * least, "{n}: {error} for {least}");
        }
        // In the dark, or where nothing is asked for, nothing is missed.
        let dark = |n: usize| Sample { shape: Shape::with([0.0, 0.0, 1.0]), ..sample(n) };
        let black = |n: usize| Sample { asked: 0.0, ..sample(n) };
        for other in [&dark as &dyn Fn(usize) -> Sample<'static>, &black] {
            let seen: Vec<_> = (0..points.points().len()).map(|n| Some(vec![other(n)])).collect();
            assert!(everywhere(&points, &seen).iter().all(|none| none.off[0] == 0.0 && none.variance[0] == 0.0));
        }
    }

    #[test]
    fn means_are_of_places_of_like_shape() {
        let corner = |x: f64, y: f64| glam::DVec3::new(x, y, 0.0);
        let [a, b, c, d] = [corner(0.0, 0.0), corner(9.0, 0.0), corner(9.0, 9.0), corner(0.0, 9.0)];
        let points = SurfacePoints::spread(&[[a, b, c], [a, c, d]], 0.3, 1000);
        let of = |n: usize| if n.is_multiple_of(3) { 0.9 } else { 0.0 };
        let shape = |n: usize| Shape::with([of(n), 0.0, 0.0]);
        let sample =
            |n: usize| Sample { shape: shape(n), grain: &[], contrast: EVEN, asked: 0.3, printed: 0.3, variance: 0.0 };
        let seen: Vec<_> = (0..points.points().len()).map(|n| Some(vec![sample(n)])).collect();
        let values: Vec<_> = (0..seen.len()).map(|n| [1.0 + of(n); CHANNELS]).collect();
        for n in [300, 301] {
            assert!((mean_alike(&points, &seen, n, &values)[0] - 1.0 - of(n)).abs() < 1e-6);
        }
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
