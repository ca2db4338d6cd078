//! Which stacking answers a cluster where the object is thin, and where its print must be lighter or darker than a flat
//! slab would have to be.
//!
//! What was found for a cluster as an endless flat slab over the core is bent: its layers stay in their order and
//! change their thicknesses until the transport model promises the albedo that is wanted. Under even light from all
//! sides a part that is 2H thick looks like the layers cut off at H over a perfect mirror, its own mirror image; the
//! light that comes back is what the whole, symmetric plate reflects and lets through. Where the layers are thicker
//! than H they are squeezed into it first, so that each still counts.
//!
//! Where a job allows mixtures, the top layer takes in more or less of the other resins too. Thin parts then have no
//! core, if they can be dark enough without: the last layer goes on to the middle, and farther, for a part is thicker
//! here and there than it counts. A core would show there in specks and take light from around, in resins that absorb
//! next to nothing from millimetres away; no change of the layers above makes up for that.
//!
//! All of these numbers move by the least change that makes up for what is missing, in each channel, by Newton's rule:
//! shares in units of [`SHARE`](base::SHARE), thicknesses relative to what they are. Where there are
//! shares, thicknesses move little ([`STIFF`]); freely where what is wanted is missed so.

mod base;
mod newton;
#[cfg(test)]
pub(super) mod tests;

use base::{Base, Below};

use super::context::TargetContext;
use crate::{
    job::RunError,
    numeric::rounding::rounded,
    optics::{
        Base as Bottom, Grains, LayeredReflection, Mixture, ResinId, Stack, TransportOptions, VolumeCoefficients,
    },
    parallel,
    search::{LEAST_MIXED_MM, ResinLimit},
    watch::{Stopped, Watch},
};

/// What is asked of a cluster somewhere.
#[derive(Debug, Clone, PartialEq, PartialOrd)]
pub(in crate::job) struct Question {
    pub cluster: usize,
    /// Half the thickness of the object, mm; `None` where the stackings end before.
    pub half_mm: Option<f64>,
    /// Logarithm of the albedo that is wanted, by channel.
    pub ln_albedo: Vec<f64>,
}

/// What is laid there.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::job) struct Answer {
    pub stacking: Stack<Mixture>,
    /// Albedo per channel that is promised.
    pub albedo: Vec<f64>,
    /// Logarithm of the factor that is missing to the albedo wanted, by channel.
    pub short: Vec<f64>,
}

/// The stackings of an object's clusters, and what they can become.
pub(in crate::job) struct Answers {
    clusters: Vec<Base>,
    /// Of every order of layers that clusters have.
    models: Vec<Model>,
    /// By channel, then resin.
    volumes: Vec<Vec<VolumeCoefficients>>,
    grains: Grains,
    limits: Vec<ResinLimit>,
    /// Depth above which layers must not begin, mm, by their places in all stackings: clusters that have as many layers
    /// share slots, and a slot keeps the limits of all resins that it has anywhere.
    slot_depths: Vec<f64>,
    core: ResinId,
    min_layer_mm: f64,
    /// Most that all layers come to, mm.
    most_mm: f64,
    /// Whether layers below a mixture may be thinner.
    thin_below_mixtures: bool,
    /// Resins that the top layer may take in, but for those that have limits.
    inks: Vec<ResinId>,
}

/// How an answer is sought.
#[derive(Debug, Clone, Copy)]
struct Way {
    below: Below,
    /// How easily thicknesses move beside shares: [`STIFF`], or 1.
    ease: f64,
}

/// Transport in stacks of one order of layers, by channel.
struct Model {
    order: Vec<Option<Mixture>>,
    /// Over the core.
    thick: Vec<LayeredReflection>,
    /// With a layer of the core below, over a mirror.
    thin: Vec<LayeredReflection>,
}

/// One azimuthal order is enough for totals.
const TOTALS: TransportOptions = TransportOptions { polar: 6, orders: 1 };
/// Frequency of what stands for the total, rad/mm: light that leaves 5 mm aside counts 0.998. At 0 resins that absorb
/// nothing have no modes.
const NEARLY_ALL: f64 = 0.02;
/// Thicknesses make a glow wide, so that shares move first. With both free an edge on a ball in white with 13% black,
/// 0.25 mm over support, that must print darker, was 0.7 mm wide in place of 1.3, under a top layer twice as thick; of
/// 23% black at the same thickness it is as dark, at 1.35 mm.
const STIFF: f64 = 0.1;
/// A resin that dims light by less makes up for no albedo: it lets light go so far that a plate, which answers are for,
/// is like no part that bends. A dark red ring, asked for more than its inks have, took in 50% of it under layers of 2
/// mm: promised 20% darker, it printed 30% lighter.
const CLEAR_PER_MM: f64 = 0.1;
/// Thin places that even so are too light, by this as a logarithm in every channel, are of the top layer throughout.
/// There, as along a sharp edge, light comes in by another face below it, and what else lies there lets it through.
const TOO_LIGHT: f64 = 0.02;
/// Albedos below are black: no factor changes them.
const BLACK: f64 = 1e-4;

impl Answers {
    /// What the stackings `found` can become.
    pub(super) fn new(context: &TargetContext<'_>, found: &[Stack<Mixture>]) -> Result<Self, RunError> {
        let materials = context.materials;
        let lacking = |resin: &str| context.lacks_coefficients(resin);
        let mut volumes = vec![Vec::new(); materials.channels.len()];
        for resin in &materials.resins {
            let of = resin.volumes().ok_or_else(|| lacking(&resin.name))?;
            volumes.iter_mut().zip(of).for_each(|(channel, volume)| channel.push(volume));
        }
        let layers = context.job.layer_options(context.object);
        let mut answers = Self {
            clusters: Vec::new(),
            models: Vec::new(),
            volumes,
            grains: materials.grains,
            limits: context.limits(),
            slot_depths: Vec::new(),
            core: context.core()?,
            min_layer_mm: layers.min_layer_mm,
            most_mm: context.job.stacking.max_thickness_mm,
            thin_below_mixtures: context.may_mix() && layers.thin_below_mixtures,
            inks: if context.may_mix() { context.printed_resins() } else { Vec::new() },
        };
        for stacking in found {
            let layers: Vec<_> = stacking.pairs().map(|(mixture, mm)| (mixture.clone(), mm)).collect();
            let top = answers.top(&layers);
            let model = answers.model(&layers, top.is_some());
            let mut base = Base { top, layers, model, promised: Vec::new() };
            base.promised = answers.albedo(&base, &base.numbers(), Below::Core);
            answers.clusters.push(base);
        }
        answers.slot_depths = answers.depths_of_slots();
        Ok(answers)
    }

    fn depths_of_slots(&self) -> Vec<f64> {
        let slots = self.clusters.first().map_or(0, |base| base.layers.len());
        if self.clusters.iter().any(|base| base.layers.len() != slots) {
            return Vec::new();
        }
        let of = |slot: usize| {
            let anywhere = self.clusters.iter().map(|base| self.limit_of(&base.layers[slot].0));
            ResinLimit::all(anywhere).min_depth_mm
        };
        (0..slots).map(of).collect()
    }

    fn limit_of(&self, mixture: &Mixture) -> ResinLimit {
        ResinLimit::all(mixture.parts().iter().map(|(resin, _)| self.limit(*resin)))
    }

    fn limit(&self, resin: ResinId) -> ResinLimit {
        self.limits.get(resin.0).copied().unwrap_or(ResinLimit::NONE)
    }

    /// Channels.
    pub fn channels(&self) -> usize {
        self.volumes.len()
    }

    /// Clusters.
    pub fn len(&self) -> usize {
        self.clusters.len()
    }

    /// What was found for a cluster.
    pub fn stacking(&self, cluster: usize) -> Stack<Mixture> {
        Stack::new(self.clusters[cluster].layers.iter().cloned()).over(Mixture::from(self.core))
    }

    /// Albedo per channel that is promised of a cluster's stacking as a flat slab.
    pub fn promised(&self, cluster: usize) -> &[f64] {
        &self.clusters[cluster].promised
    }

    /// Depth at which a cluster's stacking as a flat slab ends, mm.
    pub fn thickness_mm(&self, cluster: usize) -> f64 {
        self.clusters[cluster].layers.iter().map(|layer| layer.1).sum()
    }

    /// Answers to all `questions`, which are sorted: those of one cluster and thickness are answered one from the
    /// other.
    pub fn answer(&self, questions: &[Question], watch: &dyn Watch) -> Result<Vec<Answer>, Stopped> {
        let alike = |a: &Question, b: &Question| a.cluster == b.cluster && a.half_mm == b.half_mm;
        let runs: Vec<&[Question]> = questions.chunk_by(alike).collect();
        let answer = |run: &&[Question]| self.answer_run(run, watch);
        let answered: Vec<Vec<Answer>> = parallel::map_all(&runs, answer);
        watch.go_on()?;
        Ok(answered.into_iter().flatten().collect())
    }

    /// The model of these layers, the first of them a mixture if `mixed`.
    fn model(&mut self, layers: &[(Mixture, f64)], mixed: bool) -> usize {
        let order: Vec<Option<Mixture>> =
            (0..).zip(layers).map(|(n, layer)| if n == 0 && mixed { None } else { Some(layer.0.clone()) }).collect();
        if let Some(known) = self.models.iter().position(|known| known.order == order) {
            return known;
        }
        let in_channel = |volumes: &Vec<VolumeCoefficients>, thin: bool| {
            let core = volumes[self.core.0];
            let of =
                |mixture: &Option<Mixture>| mixture.as_ref().map(|mixture| mixed_volume(self.grains, mixture, volumes));
            let layers: Vec<_> = order.iter().map(of).chain(thin.then_some(Some(core))).collect();
            let indices: Vec<f64> = self.inks.first().map(|ink| volumes[ink.0].refractive_index).into_iter().collect();
            let bottom = if thin { Bottom::Mirror } else { Bottom::HalfSpace(core) };
            // A stacking of no layers is its core.
            let layers = if layers.is_empty() { vec![Some(core)] } else { layers };
            LayeredReflection::new(&layers, &indices, bottom, &[NEARLY_ALL], TOTALS)
        };
        let of = |thin: bool| self.volumes.iter().map(|volumes| in_channel(volumes, thin)).collect();
        let model = Model { thick: of(false), thin: of(true), order };
        self.models.push(model);
        self.models.len() - 1
    }

    /// What the top layer mostly is, and what it may take in.
    fn top(&self, layers: &[(Mixture, f64)]) -> Option<(ResinId, Vec<ResinId>)> {
        let (mixture, _) = layers.first()?;
        let carrier = mixture.parts().iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?.0;
        // A resin that is to stay below some depth is none for the surface.
        let anywhere = |resin: &ResinId| self.limit(*resin) == ResinLimit::NONE;
        let free = |resin: &ResinId| self.inks.contains(resin) && anywhere(resin) && !self.is_clear(*resin);
        let known = |resin: &ResinId| mixture.share(*resin) > 0.0 || free(resin);
        let others: Vec<ResinId> = (0..self.volumes.first()?.len()).map(ResinId).filter(known).collect();
        // Mixtures of unlike indices are more than these models know.
        let alike = |of: &Vec<VolumeCoefficients>| {
            self.inks.iter().all(|ink| of[ink.0].refractive_index == of[carrier.0].refractive_index)
        };
        let mixable = self.inks.contains(&carrier) && self.volumes.iter().all(alike);
        mixable.then(|| (carrier, others.into_iter().filter(|resin| *resin != carrier).collect()))
    }

    /// Whether light goes a centimetre through it.
    fn is_clear(&self, resin: ResinId) -> bool {
        self.volumes.iter().all(|of| of[resin.0].sigma_a + of[resin.0].sigma_s * (1.0 - of[resin.0].g) < CLEAR_PER_MM)
    }

    /// Answers to questions of one cluster and thickness; where a stop is requested, to those reached by then.
    fn answer_run(&self, run: &[Question], watch: &dyn Watch) -> Vec<Answer> {
        let base = &self.clusters[run[0].cluster];
        let asked: Vec<&[f64]> = run.iter().map(|question| question.ln_albedo.as_slice()).collect();
        let mut ways = self.ways(base, run[0].half_mm).into_iter();
        let mut answers = ways.next().map_or_else(Vec::new, |way| self.answer_over(base, &asked, way, watch));
        for way in ways {
            if !answers.iter().any(Answer::misses) {
                break;
            }
            // Of all questions: those that are answered already lead to those that are not.
            for (answer, other) in answers.iter_mut().zip(self.answer_over(base, &asked, way, watch)) {
                if answer.misses() && other.miss() < answer.miss() {
                    *answer = other;
                }
            }
        }
        if run[0].half_mm.is_some() && base.top.is_some() {
            answers.iter_mut().filter(|answer| answer.is_too_light()).for_each(Answer::fill_with_top);
        }
        answers
    }

    /// The ways to seek answers, the best for the print first; the next where that misses.
    fn ways(&self, base: &Base, half_mm: Option<f64>) -> Vec<Way> {
        let below = match half_mm {
            None => vec![Below::Core],
            Some(half) if self.fills(base) => vec![Below::Middle(half), Below::CoreToMiddle(half)],
            Some(half) => vec![Below::CoreToMiddle(half)],
        };
        let stiff =
            base.top.as_ref().filter(|(_, others)| !others.is_empty()).map(|_| Way { below: below[0], ease: STIFF });
        stiff.into_iter().chain(below.into_iter().map(|below| Way { below, ease: 1.0 })).collect()
    }

    /// Whether a stacking does without a core in thin parts.
    fn fills(&self, base: &Base) -> bool {
        let endless = |resin: &ResinId| self.limit(*resin).max_mm == f64::INFINITY;
        let parts = base.last().map(|last| base.layers[last].0.parts());
        base.top.is_some() && parts.is_some_and(|parts| parts.iter().all(|(resin, _)| endless(resin)))
    }

    /// Answers to questions of one cluster, sought one way: from what was found for the cluster outwards, each from the
    /// nearest of those before.
    fn answer_over(&self, base: &Base, run: &[&[f64]], way: Way, watch: &dyn Watch) -> Vec<Answer> {
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let ln = |albedo: &[f64]| -> Vec<f64> { albedo.iter().map(|albedo| libm::log(albedo.max(BLACK))).collect() };
        let start = self.squeezed(base, way.below);
        let here = ln(&self.albedo(base, &start, way.below));
        let mut order: Vec<(f64, usize)> =
            run.iter().enumerate().map(|(n, ln_albedo)| (apart(ln_albedo, &here), n)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut solved = vec![(here, start, None)];
        let mut answers: Vec<Option<Answer>> = vec![None; run.len()];
        for (_, n) in order {
            // There may be thousands, of milliseconds each.
            if watch.stop_requested() {
                break;
            }
            let goal = run[n];
            let nearest = (0..solved.len()).map(|at| (apart(&solved[at].0, goal), at));
            let (_, nearest) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
            let (_, from, slopes) = &solved[nearest];
            let mut slopes = slopes.clone();
            let (numbers, answer) = self.solve(base, way, from, goal, &mut slopes);
            // What it came to, not what it was asked for: one that is stuck is near to no other.
            solved.push((ln(&answer.albedo), numbers, slopes));
            answers[n] = Some(answer);
        }
        answers.into_iter().flatten().collect()
    }

    /// The numbers of a cluster's stacking, squeezed into a thin part.
    fn squeezed(&self, base: &Base, below: Below) -> Vec<f64> {
        let mut numbers = base.numbers();
        let room = base.room(below);
        if room < 1.0 {
            numbers[..base.layers.len()].iter_mut().for_each(|mm| *mm *= room);
            self.keep_limits(base, below, &mut numbers);
        }
        numbers
    }

    /// No layer thinner than may be or than voxels hold mixed, no resin above its depth, no more of all layers than may
    /// be, for which the lowest give way as far as the rest allows, no shares below 0 or of more than the top layer.
    fn keep_limits(&self, base: &Base, below: Below, numbers: &mut [f64]) {
        let (thickness, shares) = numbers.split_at_mut(base.layers.len());
        let mut above = 0.0;
        let mut kept_of = Vec::with_capacity(thickness.len());
        for n in 0..thickness.len() {
            let limit = self.limit_of(&base.layers[n].0);
            // A layer that was found to be none may stay so.
            let kept = if self.thin_below_mixtures { 0.0 } else { self.min_layer_mm.min(base.layers[n].1) };
            let thinnest = match n {
                0 if base.top.is_some() => kept.max(base.room(below) * LEAST_MIXED_MM.min(base.layers[0].1)),
                _ => kept,
            };
            let least = limit.min_mm.max(thinnest);
            thickness[n] = thickness[n].max(least).min(limit.max_mm.max(least));
            let of_slot = self.slot_depths.get(n).copied().unwrap_or_default();
            let depth = limit.min_depth_mm.max(of_slot);
            if above < depth && above > 0.0 && thickness[n] > 0.0 {
                thickness[..n].iter_mut().for_each(|mm| *mm *= depth / above);
                above = depth;
            }
            kept_of.push((least, if thickness[n] > 0.0 { depth } else { 0.0 }));
            above += thickness[n];
        }
        let mut below_depth = 0.0_f64;
        for (n, (least, depth)) in kept_of.into_iter().enumerate().rev() {
            // What lies below stays below its depth.
            let spare = (thickness[n] - least).min(thickness[..=n].iter().sum::<f64>() - below_depth);
            let cut = (above - self.most_mm).min(spare).max(0.0);
            thickness[n] -= cut;
            above -= cut;
            below_depth = below_depth.max(depth);
        }
        shares.iter_mut().for_each(|share| *share = share.max(0.0));
        let sum: f64 = shares.iter().sum();
        if sum > below.most_mixed() {
            shares.iter_mut().for_each(|share| *share *= below.most_mixed() / sum);
        }
    }

    /// Albedo per channel of layers over the core, or cut off at half the thickness of a part over its mirror image.
    fn albedo(&self, base: &Base, numbers: &[f64], below: Below) -> Vec<f64> {
        let mm = base.thicknesses(numbers, below);
        let top = base.mixed_top(numbers);
        let in_channel = |(model, volumes): (&LayeredReflection, &Vec<VolumeCoefficients>)| {
            let mixed: Vec<_> = top.iter().map(|mixture| mixed_volume(self.grains, mixture, volumes)).collect();
            model.reflection(&mm, &mixed)[0]
        };
        self.models[base.model].over(below).iter().zip(&self.volumes).map(in_channel).collect()
    }
}

impl Model {
    /// By channel.
    fn over(&self, below: Below) -> &[LayeredReflection] {
        if below == Below::Core { &self.thick } else { &self.thin }
    }
}

fn mixed_volume(grains: Grains, mixture: &Mixture, volumes: &[VolumeCoefficients]) -> VolumeCoefficients {
    let parts: Vec<_> = mixture.parts().iter().map(|(resin, share)| (volumes[resin.0], *share)).collect();
    grains.mixed(&parts)
}

impl std::fmt::Debug for Answers {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Answers").field("clusters", &self.clusters).finish_non_exhaustive()
    }
}

impl Answer {
    /// Sum of the squares of what is missing.
    fn miss(&self) -> f64 {
        self.short.iter().map(|ln| ln * ln).sum()
    }

    fn misses(&self) -> bool {
        self.short.iter().any(|ln| ln.abs() >= newton::CLOSE)
    }

    fn is_too_light(&self) -> bool {
        self.short.iter().all(|ln| *ln < -TOO_LIGHT)
    }

    /// Gives the top layer the place of all others.
    fn fill_with_top(&mut self) {
        let whole: f64 = self.stacking.layers.iter().map(|layer| layer.thickness_mm).sum();
        for (n, layer) in self.stacking.layers.iter_mut().enumerate() {
            layer.thickness_mm = if n == 0 { rounded(whole) } else { 0.0 };
        }
    }
}
