//! Can these be measurements? What [`super::reciprocity`] does not tell: values in other units, a lit texel that was cut
//! off, light everywhere that is not the sample's, a material that is not round.

use super::{
    Dataset,
    passes::{Misses, Survey},
    rings::Rings,
};

/// Windows that hold less than this share of the albedo…
const LITTLE: f64 = 0.05;
/// …or, where no albedo is known, of the light sent in, hold suspiciously little.
const LITTLE_LIGHT: f64 = 0.005;
/// Light per pixel sums up to a share of the albedo, within this.
const PER_PIXEL: std::ops::RangeInclusive<f64> = 0.1..=1.1;
/// The largest value is a ceiling if this share of the lit texels has it, and so many at least.
const CLIPPED_SHARE: f64 = 0.005;
const CLIPPED_TEXELS: usize = 4;
/// Values that agree to this share are the same, energies that differ by more are not.
const SAME: f64 = 1e-6;
const DIFFERENT: f64 = 1e-3;
/// Mean profiles fall by less than this share of what they fell by before only where something is added to them: light
/// that is diffuse keeps 0.7 at least.
const LEVELS_OFF: f64 = 0.35;
/// A material is not round from this difference of its axes on.
const NOT_ROUND: f64 = 0.05;

/// Whether values are light per pixel, where per mm² is expected: the factor they are off by, and whether the albedo says
/// so.
pub(super) fn per_pixel(dataset: &Dataset, survey: &Survey, channel: usize) -> Option<(f64, bool)> {
    let area = dataset.pitch_mm * dataset.pitch_mm;
    let present: Vec<usize> = (0..dataset.texels()).filter(|texel| dataset.is_present(*texel)).collect();
    let mean = |value: &dyn Fn(usize) -> f64| {
        let known: Vec<f64> = present.iter().map(|texel| value(*texel)).filter(|value| value.is_finite()).collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    };
    let energy = mean(&|texel| survey.energy[texel])?;
    let channels = dataset.channels.len();
    let albedo = dataset.albedo.as_ref();
    let albedo = albedo.and_then(|albedo| mean(&|texel| f64::from(albedo[texel * channels + channel])));
    let summed = energy / area;
    match albedo {
        Some(albedo) if energy < LITTLE * albedo && PER_PIXEL.contains(&(summed / albedo)) => Some((area, true)),
        None if energy < LITTLE_LIGHT && PER_PIXEL.contains(&summed) => Some((area, false)),
        _ => None,
    }
}

/// Windows whose lit texel is at a ceiling: their number, and the ceiling.
pub(super) fn clipped(survey: &Survey) -> Option<(usize, f64)> {
    let top = survey.centres.iter().copied().filter(|value| value.is_finite()).fold(0.0_f32, f32::max);
    let at_top: Vec<usize> = (0..survey.centres.len())
        .filter(|&texel| f64::from((survey.centres[texel] / top - 1.0).abs()) < SAME)
        .collect();
    if at_top.len() < CLIPPED_TEXELS.max((CLIPPED_SHARE * survey.centres.len() as f64) as usize) || !(top > 0.0) {
        return None;
    }
    let energies = at_top.iter().map(|texel| survey.energy[*texel]);
    let (low, high) = energies.fold((f64::INFINITY, 0.0), |(low, high), e: f64| (e.min(low), e.max(high)));
    (high > (1.0 + DIFFERENT) * low).then_some((at_top.len(), f64::from(top)))
}

/// The level that the mean profile ends on, per mm², and where.
pub(super) fn level(rings: &Rings, survey: &Survey) -> Option<(f64, f64)> {
    let mean = |distance: usize| {
        let count = survey.counts[distance] as f64;
        let mean = survey.sums[distance] / count.max(1.0);
        let variance = (survey.squares[distance] / count.max(1.0) - mean * mean).max(0.0) / count.max(1.0);
        (mean > 8.0 * variance.sqrt() && mean > 0.0).then_some(mean)
    };
    let end = *rings.distances_mm.last()?;
    // ln of the mean over distances about a radius.
    let about = |share: f64| {
        let near = (0..rings.distances_mm.len()).filter(|&d| {
            let r = rings.distances_mm[d] / end;
            (share - 0.06..=share + 0.06).contains(&r)
        });
        let known: Vec<f64> = near.filter_map(mean).collect();
        (known.len() >= 3)
            .then(|| (known.iter().map(|mean| libm::log(*mean)).sum::<f64>() / known.len() as f64, known.len()))
    };
    let ([a, b, c], step) = ([about(0.46)?.0, about(0.70)?.0, about(0.94)?.0], 0.24 * end);
    let (before, after) = ((a - b) / step, (b - c) / step);
    let levels_off = before > 0.0 && after < LEVELS_OFF * before;
    levels_off.then(|| (libm::exp(c) - libm::exp(b - before * step), 0.94 * end))
}

/// By how much light goes farther along rows than along columns, beyond what equation 7 makes of the profiles; below 0
/// for columns.
pub(super) fn out_of_round(misses: &Misses) -> Option<f64> {
    let [along, across] = misses.axes;
    let ratio = (along[0] / along[1]) / (across[0] / across[1]);
    let off = libm::log(ratio);
    (off.is_finite() && off.abs() > NOT_ROUND).then_some(libm::expm1(off))
}
