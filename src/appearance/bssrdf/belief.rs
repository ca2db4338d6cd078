//! Can these be measurements? What [`super::reciprocity`] does not tell: values in other units, a lit texel that was
//! cut off, light everywhere that is not the sample's, a material that is not round.

use std::collections::BTreeMap;

use super::{
    Dataset,
    misses::{Dark, Gate, Misses},
    rings::Rings,
    survey::Survey,
};

/// Windows that hold less than this share of the albedo…
const LITTLE: f64 = 0.05;
/// …or, where no albedo is known, of the light sent in, hold suspiciously little: a choice.
const LITTLE_LIGHT: f64 = 0.03;
/// Light per pixel sums up to a share of the albedo, within this.
const PER_PIXEL: std::ops::RangeInclusive<f64> = 0.1..=1.1;
/// The largest value is a ceiling if this share of the lit texels has it, and so many at least.
const CLIPPED_SHARE: f64 = 0.005;
const CLIPPED_TEXELS: usize = 4;
/// Values that agree to this share are the same, energies that differ by more are not.
const SAME: f64 = 1e-6;
const DIFFERENT: f64 = 1e-3;
/// Windows at a ceiling are of one material if so many see the same beside the lit texel, and this share of them.
const ALIKE_TEXELS: usize = 3;
const ALIKE_SHARE: f64 = 0.02;
/// …to one in so many of the ceiling.
const STEPS: f32 = 1e5;
/// Values that are 0 by chance have so many of the data's smallest steps about them.
const QUANTA: f64 = 14.0;
/// Lit texels without light are no dead pixels from this share on.
const DARK_CENTRES: f64 = 0.1;
/// A negative value stands for something if it occurs so often.
const SENTINELS: u64 = 10;
/// A gate leaves out this share of the values at least, and has as many just above it.
const GATED: f64 = 0.005;
/// …of which fewer than this share have a 0 beside them, and more than this share of the zeros with light there one.
const APART: f64 = 0.15;
const BESIDE: f64 = 0.3;
/// r R of dark texels falls by less than this share of what it fell by before only where something is added: among
/// simulated sets a mixture of materials, the worst, keeps 0.65; 1e-3 per mm² on half and half 0.58.
const LEVELS_OFF: f64 = 0.6;
/// …and by more than this many times only where something is taken away: light that is diffuse falls ever slower.
const FALLS_OFF: f64 = 1.2;
/// Dark texels whose response keeps this share from 0.70 to 0.94 of a window see an offset more than light: 1/r keeps
/// 0.74, and r R of 14 slabs by photons rises by 3% at most there (n = 1.5, thick), else it falls.
const FLAT: f64 = 0.8;
/// Mean responses that keep this share from beside the lit texel to the end of a window, so many pixels away, are none:
/// 1/r keeps a quarter.
const NO_FALL: f64 = 0.5;
const NO_FALL_PIXELS: f64 = 4.0;
/// Windows that hold less than this of the light sent in are darker than any material.
const NO_LIGHT: f64 = 1e-3;
/// A material is not round from this difference of its axes on.
const NOT_ROUND: f64 = 0.05;

/// Whether values are light per pixel, where per mm² is expected: the factor they are off by, and whether the albedo
/// says so.
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
    // Texels of one material within it are alike in all they see, and only what is at its ceiling in the lit texel:
    // where the ceiling cut off what lies beside it too, that is alike without being one material.
    let whole =
        |texel: &&usize| !survey.beside[**texel].iter().any(|value| f64::from((value / top - 1.0).abs()) < SAME);
    let mut seen: BTreeMap<[i32; 4], usize> = BTreeMap::new();
    for texel in at_top.iter().filter(whole) {
        *seen.entry(survey.beside[*texel].map(|value| (value / top * STEPS) as i32)).or_default() += 1;
    }
    let alike = seen.values().copied().max().unwrap_or(0);
    let one_material = alike >= ALIKE_TEXELS && alike as f64 > ALIKE_SHARE * at_top.len() as f64;
    (high > (1.0 + DIFFERENT) * low && !one_material).then_some((at_top.len(), f64::from(top)))
}

/// Lit texels that are exactly 0, with light beside them: how many, and the first.
pub(super) fn dark_centres(survey: &Survey) -> Option<(usize, usize)> {
    let beside = |texel: usize| survey.beside[texel].iter().map(|value| f64::from(*value)).sum::<f64>();
    let is_dark = |texel: &usize| survey.centres[*texel] == 0.0 && beside(*texel) > QUANTA * survey.least;
    let dark: Vec<usize> = (0..survey.centres.len()).filter(is_dark).collect();
    (dark.len() as f64 > DARK_CENTRES * survey.centres.len() as f64).then(|| (dark.len(), dark[0]))
}

/// A negative value that stands for something: how often it occurs, and which.
pub(super) fn sentinel(survey: &Survey) -> Option<(u64, f64)> {
    let lowest = survey.lowest;
    let stands_out = lowest.value < 4.0 * lowest.next && -lowest.value > QUANTA * survey.least;
    (lowest.count >= SENTINELS && stands_out).then_some((lowest.count, lowest.value))
}

/// How many values a gate has made 0. What is counted is 0 by chance, beside light as well: a gate's zeros lie
/// together, and what lies beside them is faint.
pub(super) fn gated(misses: &Misses) -> Option<u64> {
    let all: f64 = misses.rings.iter().map(|sums| sums.count).sum();
    let Gate { zeros, above, above_then_zero, zero_then_above, zero_then_light } = misses.gate;
    let many = |count: u64| count as f64 > GATED * all;
    let share = |part: u64, of: u64| part as f64 / (of as f64).max(1.0);
    let together = share(above_then_zero, above) < APART && share(zero_then_above, zero_then_light) > BESIDE;
    (many(zeros) && many(above) && together).then_some(zeros)
}

/// The level that the response of dark texels ends on, per mm², and where; below 0 where the response ends before its
/// light does.
pub(super) fn level(rings: &Rings, misses: &Misses) -> Option<(f64, f64)> {
    let mean = |distance: usize| {
        let Dark { count, sum, squares } = *misses.dark.get(distance)?;
        let mean = sum / count.max(1.0);
        let variance = (squares / count.max(1.0) - mean * mean).max(0.0) / count.max(1.0);
        (count > 1.0 && mean > 8.0 * variance.sqrt() && mean > 0.0).then_some(mean)
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
    // Light that is diffuse falls like e^(−κr)/r, and its r R like an exponential.
    let [before_r, after_r] = [before - libm::log(0.70 / 0.46) / step, after - libm::log(0.94 / 0.70) / step];
    // An offset that drowns the light: r R rises already half-way out, and no slope is that of light alone.
    if c - b > libm::log(FLAT) {
        return Some((libm::exp(c), 0.94 * end));
    }
    let levels_off = before_r > 0.0 && after_r < LEVELS_OFF * before_r;
    let off = levels_off || (before > 0.0 && after > FALLS_OFF * before);
    off.then(|| (libm::exp(c) - libm::exp(b - before * step), 0.94 * end))
}

/// The share of the mean response beside the lit texel that is left at the end of a window, if it hardly falls.
pub(super) fn no_fall(survey: &Survey, rings: &Rings, pitch_mm: f64) -> Option<f64> {
    let mean = |distance: usize| Some(survey.sums.get(distance)? / (*survey.counts.get(distance)? as f64));
    let last = rings.distances_mm.len().checked_sub(1)?;
    let share = mean(last)? / mean(1)?;
    (rings.distances_mm[last] > NO_FALL_PIXELS * pitch_mm && share > NO_FALL).then_some(share)
}

/// Whether windows hold so little of the light sent in that no material is that dark; `mean` is what they hold.
pub(super) fn no_light(dataset: &Dataset, mean: f64) -> bool {
    dataset.albedo.is_none() && mean < NO_LIGHT
}

/// By how much light goes farther along an axis of the windows than across it, beyond what equation 7 makes of the
/// profiles, and which.
pub(super) fn out_of_round(misses: &Misses) -> Option<(f64, &'static str)> {
    let ratio = |axis: usize| misses.axes[axis][0] / misses.axes[axis][1];
    let [upright, slanted] = [libm::log(ratio(0) / ratio(1)), libm::log(ratio(2) / ratio(3))];
    let (off, names) = if slanted.abs() > upright.abs() {
        (slanted, ["the diagonal that falls to the right", "the diagonal that rises to the right"])
    } else {
        (upright, ["rows", "columns"])
    };
    let known = off.is_finite() && off.abs() > NOT_ROUND;
    known.then(|| (libm::expm1(off.abs()), names[usize::from(off < 0.0)]))
}
