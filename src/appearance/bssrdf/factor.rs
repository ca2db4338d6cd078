//! A local profile per texel: Hašan et al. 2010, equation 7, after Song et al., *SubEdit* (SIGGRAPH 2009).
//!
//! ```text
//!   R(xᵢ, xₒ) ≈ √(P(xᵢ, r) P(xₒ, r))          ln R = ln g(r) + ½ (q(xᵢ, r) + q(xₒ, r)),   q = ln(P/g)
//! ```
//!
//! g is what all texels have in common at each distance that occurs in a window ([`super::shape`]), so the 1/r at the
//! centre and the fall with distance are in it and q is smooth: one number per texel and ring, and straight lines in r
//! between the rings. The paper takes logarithms and solves a sparse
//! least-squares problem. The logarithm of a noisy value near zero is wrong on average, and dropping such values is
//! wrong too: what stays is too bright. So this is the same problem as a generalised linear model with a logarithmic
//! link (McCullagh and Nelder 1989, chapter 2.5): in every round the residual is (D − R̂)/R̂, whose mean is right
//! whatever the noise, with weight R̂²/V(R̂); the first round uses a bounded stand-in for ln(D/R̂). At its rest Σ
//! weight·residual is 0 for every texel and ring; where light is strong that is the paper's answer.
//!
//! V = floor² + gain·R̂ + (relative·R̂)². Floor and gain come from the dataset if it knows them. The relative part is
//! what equation 7 itself misses, which no measurement gives: it is estimated from the residuals of every round, and so
//! is the floor if not known.

use super::{
    BssrdfError, Dataset, belief,
    kernel::{Residual, Variance},
    misses::Misses,
    operator::{Operator, Prior},
    passes::{Model, Source},
    planes::Planes,
    reciprocity::{Breach, Reciprocity, reciprocity},
    responses::Channel,
    rings::Rings,
    shape::{correction, global_profile, nodes},
    survey::Survey,
};
use crate::parallel;
use crate::watch::Watch;

/// What is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Freedom {
    /// A profile per texel: equation 7.
    Profiles,
    /// One profile, scaled by a number per texel.
    Scaled,
    /// One profile.
    Global,
}

/// How to fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FactorOptions {
    /// What is fitted.
    pub freedom: Freedom,
    /// Expected size of second differences of ln P from ring to ring, above 0.
    pub roughness: f64,
    /// Most rounds.
    pub rounds: usize,
}

impl Default for FactorOptions {
    fn default() -> Self {
        Self { freedom: Freedom::Profiles, roughness: ROUGHNESS, rounds: MAX_ROUNDS }
    }
}

/// One round of the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Round {
    /// Steps of conjugate gradients.
    pub steps: usize,
    /// Root mean square change of ln P.
    pub change: f64,
    /// √(Σ(D − R̂)² / ΣD²) before the round.
    pub relative_error: f64,
    /// Floor of the noise, per mm².
    pub floor_per_mm2: f64,
    /// What equation 7 misses, as a share of R.
    pub relative: f64,
}

/// Profiles of one channel.
#[derive(Debug, Clone)]
pub struct Factors {
    /// g at each distance, per mm².
    pub global: Vec<f32>,
    /// √(P/g) per ring and texel; 0 where nothing was measured.
    pub root: Planes,
    /// Mean of g over each ring, per mm².
    pub ring_means: Vec<f64>,
    /// Rounds taken.
    pub rounds: Vec<Round>,
    /// Whether the last round changed next to nothing.
    pub converged: bool,
    /// V at the end.
    pub variance: Variance,
    /// What equation 7 misses by at the end.
    pub misses: Misses,
    /// Measurements missing in windows that should be there.
    pub missing: u64,
    /// Σ D · pixel area over the rings of each window, as measured.
    pub energy: Vec<f64>,
    /// Share of each texel's window that was measured, by ring.
    pub availability: Planes,
    /// How far light goes both ways.
    pub reciprocity: Reciprocity,
    /// What makes the data hard to believe, in words.
    pub doubts: Vec<String>,
}

/// First differences along r are expected below this: a ring is allowed to be e times its neighbour.
const FIRST_DIFFERENCE: f32 = 1.0;
/// Precision of ln(P/g) itself, next to nothing: for texels that were not measured.
const RIDGE: f32 = 1e-3;
/// Evidence: `scripts/factor-check`. At 0.1 the grains of the stone set were smoothed away, 10.4% error where SciPy's
/// least squares, with no smoothness, reaches 6.3%; at 0.3 it is 6.5%, at 1 6.5%. The others change by 0.02% or less,
/// and exact data with 1% noise come back as well.
const ROUGHNESS: f64 = 0.3;
/// Where ln P moves no more after fewer rounds than this, they end: 9 on the largest patch with 1% noise, 4 on those
/// from Monte Carlo.
const MAX_ROUNDS: usize = 32;
/// A round that changes ln P by less than this, root mean square, is the last.
const REST: f64 = 1e-3;
/// …nor is a round that expects to gain more than this share of a measurement's variance, on the mean.
const LEAST_GAIN: f64 = 1e-4;
/// What all texels share is corrected once profiles have taken their first steps.
const SHAPED_FROM: usize = 3;
/// Conjugate gradients go this far in a round: the next one has other weights. At 0.01 the far rings, whose part of the
/// residual is small, took rounds of their own.
const CG_TOLERANCE: f64 = 1e-3;
const CG_STEPS: usize = 100;
/// Largest change of ln P in a round.
const LONGEST_STEP: f32 = 1.0;
/// Relative variance before anything is known of it.
const FIRST_RELATIVE: f64 = 0.1;
/// No model is known better than to this share.
const LEAST_RELATIVE: f64 = 1e-3;
/// Negative values beyond this share of the positive ones are no noise about zero.
const MAX_NEGATIVE: f64 = 0.25;
/// Energy of windows that no surface gives back, on the mean of all texels.
const MAX_ENERGY: f64 = 1.05;

/// Texels are larger than this, mm.
const WAVELENGTH_MM: f64 = 1e-3;

/// Factors one channel of a dataset. `watch` hears a stage for every pass over the data: "reading", a round of the fit,
/// "checking".
///
/// # Errors
/// Files that cannot be read, data that are no BSSRDF, an option out of range, [`BssrdfError::Stopped`].
pub fn factor(
    dataset: &Dataset,
    channel: Channel,
    options: &FactorOptions,
    watch: &dyn Watch,
) -> Result<Factors, BssrdfError> {
    if !(options.roughness > 0.0 && options.roughness.is_finite()) {
        let (found, expected) = (options.roughness.to_string(), "a number above 0".to_owned());
        return Err(BssrdfError::Option { name: "roughness", found, expected });
    }
    let rings = dataset.rings();
    let source = Source { dataset, rings: &rings, channel, watch };
    let survey = source.survey()?;
    let mut doubts = check(dataset, channel, &rings, &survey)?;
    // What every texel shares can be corrected only where every ring of a texel has a number of its own.
    let shaped = options.freedom == Freedom::Profiles;
    let mean = global_profile(&rings, &survey, false);
    let mut global = if shaped { global_profile(&rings, &survey, true) } else { mean.clone() };
    let reciprocity = reciprocity(dataset, channel, &rings, &mean, survey.least, watch)?;
    if let Some(breach) = reciprocity.breaches.iter().find(|breach| breach.is_no_data()) {
        let expected = match breach {
            Breach::Zeros { .. } => "light both ways, and NaN where a value is missing",
            _ => "windows as pictures are, row 0 on top, with the lit texel in the middle",
        };
        return Err(BssrdfError::Entry {
            file: dataset.responses.path().to_path_buf(),
            place: place(dataset, channel),
            found: breach.to_string(),
            expected: expected.into(),
        });
    }
    doubts.extend(reciprocity.breaches.iter().map(Breach::to_string));
    let nodes = nodes(&rings);
    let means = |global: &[f32]| rings.means(&global.iter().map(|g| f64::from(*g)).collect::<Vec<_>>());
    let present: Vec<f32> = (0..dataset.texels()).map(|texel| f32::from(u8::from(dataset.is_present(texel)))).collect();
    let mut log = Planes::new(rings.len(), dataset.width, dataset.height, 0.0);
    // √(P/g) of every texel at every distance.
    let roots_of = |log: &Planes, roots: &mut Planes| {
        let Planes { width, height, .. } = *log;
        parallel::rows(&mut roots.data, width, |index, roots| {
            let (distance, y) = (index / height, index % height);
            nodes[distance].blend(|ring| log.row(ring, y), roots);
            let present = &present[y * width..(y + 1) * width];
            roots.iter_mut().zip(present).for_each(|(root, present)| *root = present * libm::expf(0.5 * *root));
        });
    };
    let mut roots = Planes::new(global.len(), dataset.width, dataset.height, 0.0);
    roots_of(&log, &mut roots);
    let prior = Prior { second: (options.roughness.powi(-2)) as f32, first: FIRST_DIFFERENCE, value: RIDGE };
    let mut noise = NoiseModel::first(dataset, &means(&global));
    let mut rounds: Vec<Round> = Vec::new();
    let mut converged = options.freedom == Freedom::Global;
    while !converged && rounds.len() < options.rounds {
        let model = Model { global: &global, roots: &roots, nodes: &nodes };
        let kind = if rounds.is_empty() { Residual::Logarithm } else { Residual::Linear };
        let stage = match rounds.last() {
            None => "round 1".to_owned(),
            Some(last) => format!("round {}, ln P moved by {:.4}", rounds.len() + 1, last.change),
        };
        let gradient = source.gradient(&stage, &model, noise.variance(), kind)?;
        let operator = Operator {
            rings: &rings,
            model: &model,
            variance: noise.variance(),
            availability: &survey.availability,
            outside: &gradient.outside,
            prior,
            tied: options.freedom == Freedom::Scaled,
        };
        let mut b = gradient.values;
        if operator.tied {
            b.tie();
            b.add(-prior.value, &log);
        } else {
            b.add(-1.0, &operator.prior_of(&log));
        }
        let (step, steps) = operator.solve(&b, CG_TOLERANCE, CG_STEPS);
        let step = step.map(|change| change.clamp(-LONGEST_STEP, LONGEST_STEP));
        let change = (step.dot(&step) / step.data.len() as f64).sqrt();
        // Twice what the sum of squares, one for a measurement as it should be, is expected to fall by.
        let gain = b.dot(&step) / gradient.misses.rings.iter().map(|sums| sums.count).sum::<f64>().max(1.0);
        rounds.push(Round {
            steps,
            change,
            relative_error: gradient.misses.relative(),
            floor_per_mm2: noise.floor,
            relative: noise.relative,
        });
        // What the first model misses is no noise.
        if rounds.len() > 1 {
            noise.estimate(&gradient.misses);
        }
        let mut shape = 0.0;
        if shaped && rounds.len() >= SHAPED_FROM {
            let (corrections, size) = correction(&nodes, rings.len(), &gradient.shape);
            global.iter_mut().zip(corrections).for_each(|(g, by)| *g *= libm::exp(by) as f32);
            shape = size;
        }
        log.add(1.0, &step);
        roots_of(&log, &mut roots);
        let corrected = !shaped || rounds.len() >= SHAPED_FROM;
        converged = corrected && change < REST && shape < REST && gain < LEAST_GAIN;
    }
    let model = Model { global: &global, roots: &roots, nodes: &nodes };
    let misses = source.residual(&model, &survey)?;
    doubts.extend(afterthoughts(&rings, &survey, &misses));
    Ok(Factors {
        reciprocity,
        doubts,
        root: ring_roots(&rings, &global, &roots),
        ring_means: means(&global),
        rounds,
        converged,
        variance: noise.variance(),
        misses,
        missing: survey.missing,
        energy: survey.energy,
        availability: survey.availability,
        global,
    })
}

/// √(P/g) of every texel's rings, whose P and g are means over the ring's pixels.
fn ring_roots(rings: &Rings, global: &[f32], roots: &Planes) -> Planes {
    let Planes { width, height, .. } = *roots;
    let mut out = Planes::new(rings.len(), width, height, 0.0);
    parallel::rows(&mut out.data, width, |index, out| {
        let (ring, y) = (index / height, index % height);
        let mut sums = vec![0.0_f64; width];
        let mut whole = 0.0;
        for distance in rings.distances(ring) {
            let weight = rings.at(distance).len() as f64 * f64::from(global[distance]);
            whole += weight;
            let row = roots.row(distance, y);
            sums.iter_mut().zip(row).for_each(|(sum, root)| *sum += weight * f64::from(*root).powi(2));
        }
        out.iter_mut().zip(sums).for_each(|(out, sum)| *out = (sum / whole).sqrt() as f32);
    });
    out
}

impl Factors {
    /// P per mm² of a texel, ring by ring.
    pub fn profile(&self, texel: usize) -> impl Iterator<Item = f64> + '_ {
        self.ring_means.iter().enumerate().map(move |(ring, mean)| {
            let root = f64::from(self.root.at(ring, texel));
            mean * root * root
        })
    }
}

/// Where a channel's values are.
fn place(dataset: &Dataset, channel: Channel) -> String {
    match (channel, dataset.channels.as_slice()) {
        (Channel::Stored(index), names @ [_, _, ..]) => {
            format!("responses, channel {}", names[index].trim_start_matches("channel "))
        }
        _ => "responses".to_owned(),
    }
}

/// Refuses data that no surface gives; the answer is what can be doubted.
fn check(dataset: &Dataset, channel: Channel, rings: &Rings, survey: &Survey) -> Result<Vec<String>, BssrdfError> {
    let place = place(dataset, channel);
    let fault = |found: String, expected: &str| BssrdfError::Entry {
        file: dataset.responses.path().to_path_buf(),
        place: place.clone(),
        found,
        expected: expected.into(),
    };
    if survey.counts.iter().sum::<u64>() == 0 {
        return Err(fault("no value that is a number".into(), "windows with light"));
    }
    if !(survey.positive > 0.0) {
        return Err(fault("no value above 0".into(), "windows with light"));
    }
    if survey.negative > MAX_NEGATIVE * survey.positive {
        let share = 100.0 * survey.negative / survey.positive;
        let expected = "noise about zero: at most 25%";
        return Err(fault(format!("negative values that take away {share:.0}% of the light"), expected));
    }
    let texels: Vec<usize> = (0..dataset.texels()).filter(|texel| dataset.is_present(*texel)).collect();
    let mean = texels.iter().map(|texel| survey.energy[*texel]).sum::<f64>() / texels.len().max(1) as f64;
    if mean > MAX_ENERGY {
        let found = format!("windows that hold {mean:.3} times the light sent in, on the mean");
        return Err(fault(found, "at most 1: values per mm² and unit flux, and a pitch in mm"));
    }
    if let Some((count, value)) = belief::sentinel(survey) {
        let found = format!("{value}, {count} times");
        return Err(fault(found, "NaN where a value is missing"));
    }
    if let Some((count, texel)) = belief::dark_centres(survey) {
        let (row, column) = (texel / dataset.width, texel % dataset.width);
        let found = format!("0 at the lit texel of {count} windows, row {row}, column {column} one of them");
        return Err(fault(found, "light where it is sent in, or NaN where it was not measured"));
    }
    let mut doubts = Vec::new();
    if dataset.pitch_mm < WAVELENGTH_MM {
        doubts.push(format!("a pitch of {} mm is about a wavelength of light: is it in mm?", dataset.pitch_mm));
    }
    let index = if let Channel::Stored(index) = channel { index } else { 0 };
    match belief::per_pixel(dataset, survey, index) {
        Some((area, true)) => {
            let found = format!(
                "windows that hold {mean:.2e} of the light, and {:.3} if values are light per pixel",
                mean / area
            );
            return Err(fault(found, "values per mm²: light per pixel over a pixel's area; or is the pitch in mm?"));
        }
        Some((area, false)) => doubts.push(format!(
            "windows hold {mean:.1e} of the light sent in, and {:.2} if values were light per pixel: is the sample \
             that dark, or are values not per mm²?",
            mean / area
        )),
        None if belief::no_light(dataset, mean) => doubts.push(format!(
            "windows hold {mean:.1e} of the light sent in, less than any material reflects: are values per mm² for \
             unit flux, and is the pitch in mm?"
        )),
        None => {}
    }
    if let Some(share) = belief::no_fall(survey, rings, dataset.pitch_mm) {
        doubts.push(format!(
            "from beside the lit texel to the end of its window the mean response falls to {:.0}% only, where light \
             falls to a quarter or less: are the windows responses to one lit texel, and is a black level in them?",
            100.0 * share
        ));
    }
    if let Some((texels, ceiling)) = belief::clipped(survey) {
        doubts.push(format!(
            "{texels} windows have {ceiling:.4} at the lit texel, the largest value there is: was it cut off? P(x, \
             0) is too small there"
        ));
    }
    Ok(doubts)
}

/// What can be doubted once all is fitted.
fn afterthoughts(rings: &Rings, survey: &Survey, misses: &Misses) -> Vec<String> {
    let mut doubts = Vec::new();
    if let Some(zeros) = belief::gated(misses) {
        let least = survey.least;
        doubts.push(format!(
            "{zeros} values are 0 and none lies between 0 and {least:.1e} per mm²: what is faint was cut to 0, and \
             the light of dark and far places is lost"
        ));
    }
    if let Some((level, at)) = belief::level(rings, misses) {
        doubts.push(if level > 0.0 {
            format!(
                "the response of dark texels levels off at {level:.1e} per mm², {at:.2} mm from the lit texel: an \
                 offset (black level, stray light) that is not the sample's"
            )
        } else {
            format!(
                "the response of dark texels ends before its light does, as if {:.1e} per mm² were taken away, seen \
                 {at:.2} mm from the lit texel: a black level that is too high?",
                -level
            )
        });
    }
    if let Some((off, along)) = belief::out_of_round(misses) {
        doubts.push(format!(
            "light goes farther along {along} than the other way: {:.1}% more beyond the lit texel than a round \
             response has; are pixels square, and is the material the same in all directions?",
            100.0 * off
        ));
    }
    doubts
}

/// Floor, gain and relative error, known or estimated.
struct NoiseModel {
    floor: f64,
    gain: f64,
    relative: f64,
    /// Floor and gain are the dataset's.
    known: bool,
}

impl NoiseModel {
    fn first(dataset: &Dataset, means: &[f64]) -> Self {
        match dataset.noise {
            Some(noise) => {
                Self { floor: noise.floor_per_mm2, gain: noise.gain_per_mm2, relative: FIRST_RELATIVE, known: true }
            }
            None => {
                let least = means.iter().copied().fold(f64::INFINITY, f64::min);
                Self { floor: least, gain: 0.0, relative: FIRST_RELATIVE, known: false }
            }
        }
    }

    fn variance(&self) -> Variance {
        // A variance of 0 would be a weight without end.
        let constant = (self.floor * self.floor) as f32;
        Variance {
            constant: constant.max(f32::MIN_POSITIVE * 1e6),
            linear: self.gain as f32,
            square: (self.relative * self.relative) as f32,
        }
    }

    /// Fits V to the mean squared differences of the rings, each counting by how well it is known itself.
    fn estimate(&mut self, misses: &Misses) {
        let (mut aa, mut ab, mut bb, mut ya, mut yb) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let v = |r: f64, r2: f64| self.floor * self.floor + self.gain * r + self.relative * self.relative * r2;
        for sums in misses.rings.iter().filter(|sums| sums.count > 0.0) {
            let (error, model, square) =
                (sums.error / sums.count, sums.model / sums.count, sums.model_square / sums.count);
            let weight = v(model, square).max(error).max(f64::MIN_POSITIVE).powi(-2);
            let y = error - self.gain * model - if self.known { self.floor * self.floor } else { 0.0 };
            aa += weight;
            ab += weight * square;
            bb += weight * square * square;
            ya += weight * y;
            yb += weight * y * square;
        }
        if bb == 0.0 {
            return;
        }
        let determinant = aa * bb - ab * ab;
        let (mut floor, mut relative) = (0.0, yb / bb);
        if !self.known && determinant > 1e-12 * aa * bb {
            (floor, relative) = ((ya * bb - yb * ab) / determinant, (yb * aa - ya * ab) / determinant);
            if floor < 0.0 {
                (floor, relative) = (0.0, yb / bb);
            } else if relative < 0.0 {
                (floor, relative) = (ya / aa, 0.0);
            }
        }
        if !self.known {
            self.floor = floor.max(0.0).sqrt();
        }
        self.relative = relative.max(0.0).sqrt().max(LEAST_RELATIVE);
    }
}
