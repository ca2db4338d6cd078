//! Which stacking answers a cluster where the object is thin, and where its print must be lighter or darker than a flat
//! slab would have to be.
//!
//! What was found for a cluster as an endless flat slab over the core is bent: its layers stay in their order and change
//! their thicknesses until the transport model promises the albedo that is wanted. Under even light from all sides a
//! part that is 2H thick looks like the layers cut off at H over a perfect mirror, its own mirror image; the light that
//! comes back is what the whole, symmetric plate reflects and lets through. Where the layers are thicker than H they are
//! squeezed into it first, so that each still counts.
//!
//! Where a job allows mixtures, the top layer takes in more or less of the other resins too. All of these numbers move by
//! the least change that makes up for what is missing, in each channel, by Newton's rule with differences for slopes:
//! thicknesses relative to what they are, shares in units of [`SHARE`].

use rayon::prelude::*;

use super::context::TargetContext;
use crate::{
    job::RunError,
    optics::{FrequencyGrid, Light, Mixture, ResinId, Stack, Transport, TransportOptions, VolumeCoefficients},
    search::{Found, ResinLimit, SearchTarget},
    watch::{Stopped, Watch},
};

/// What is asked of a cluster somewhere.
#[derive(Debug, Clone, PartialEq, PartialOrd)]
pub(in crate::job) struct Question {
    pub cluster: usize,
    /// Half the thickness of the object, mm; `None` where the stackings end before.
    pub half_mm: Option<f64>,
    /// Logarithm of the factor by which the albedo is to differ from the cluster's, by channel.
    pub ln_factor: Vec<f64>,
}

/// What is laid there.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::job) struct Answer {
    pub stacking: Stack<Mixture>,
    /// Albedo per channel that is promised.
    pub albedo: Vec<f64>,
    /// Logarithm of the part of the factor that is out of reach, by channel.
    pub short: Vec<f64>,
}

/// The stackings of an object's clusters, and what they can become.
#[derive(Debug)]
pub(in crate::job) struct Answers {
    clusters: Vec<Base>,
    /// By channel, then resin.
    volumes: Vec<Vec<VolumeCoefficients>>,
    limits: Vec<ResinLimit>,
    core: ResinId,
    min_layer_mm: f64,
    /// Resins that the top layer may take in.
    inks: Vec<ResinId>,
    /// Only the albedo matters.
    grid: FrequencyGrid,
}

/// What was found for a cluster.
#[derive(Debug)]
struct Base {
    layers: Vec<(Mixture, f64)>,
    /// What the top layer mostly is, and what else it may be, where it may be mixed.
    top: Option<(ResinId, Vec<ResinId>)>,
    /// Albedo per channel that is asked for, and that the model promises of a flat slab.
    asked: Vec<f64>,
    promised: Vec<f64>,
}

/// One azimuthal order is enough for totals.
const TOTALS: TransportOptions = TransportOptions { polar: 6, orders: 1 };
/// Newton's steps, and the error of ln albedo that ends them.
const STEPS: usize = 12;
const CLOSE: f64 = 0.004;
/// Change of ln thickness, or of shares in their unit, that slopes are taken over, and most that a step may change one.
const DIFFERENCE: f64 = 0.04;
const LONGEST: f64 = 0.7;
const MOST_SHARES: f64 = 3.0;
/// A share of the top layer that matters as much as its thickness once over.
const SHARE: f64 = 0.05;
/// Most of the top layer that may be other than what it mostly is.
const MIXED: f64 = 0.8;
/// Against slopes so flat that a step would be without end.
const DAMPING: f64 = 1e-4;
/// Part of a thin place that squeezed layers take.
const SQUEEZED: f64 = 0.85;
/// Albedos below are black: no factor changes them.
const BLACK: f64 = 1e-4;

impl Answers {
    /// What `found` for `targets` can become.
    pub(super) fn new(
        context: &TargetContext<'_>,
        found: &[Found],
        targets: &[SearchTarget],
    ) -> Result<Self, RunError> {
        let materials = context.materials;
        let lacking = |resin: &str| context.lacks_coefficients(resin);
        let mut volumes = vec![Vec::new(); materials.channels.len()];
        for resin in &materials.resins {
            let of = resin.volumes().ok_or_else(|| lacking(&resin.name))?;
            volumes.iter_mut().zip(of).for_each(|(channel, volume)| channel.push(volume));
        }
        let mut answers = Self {
            clusters: Vec::new(),
            volumes,
            limits: context.limits(),
            core: context.core()?,
            min_layer_mm: context.job.layer_options(context.object).min_layer_mm,
            inks: if context.may_mix() { context.printed_resins() } else { Vec::new() },
            grid: FrequencyGrid::of(vec![0.0]),
        };
        for (found, target) in found.iter().zip(targets) {
            let stacking = found.stacking();
            let layers: Vec<_> = stacking.pairs().map(|(mixture, mm)| (mixture.clone(), mm)).collect();
            let asked = target.channels.iter().map(|channel| channel[0]).collect();
            let mut base = Base { top: answers.top(&layers), layers, asked, promised: Vec::new() };
            base.promised = answers.albedo(&base, &base.numbers(), None);
            answers.clusters.push(base);
        }
        Ok(answers)
    }

    /// Clusters.
    pub fn len(&self) -> usize {
        self.clusters.len()
    }

    /// What was found for a cluster.
    pub fn stacking(&self, cluster: usize) -> Stack<Mixture> {
        Stack::new(self.clusters[cluster].layers.iter().cloned()).over(Mixture::from(self.core))
    }

    /// Depth at which a cluster's stacking as a flat slab ends, mm.
    pub fn thickness_mm(&self, cluster: usize) -> f64 {
        self.clusters[cluster].layers.iter().map(|layer| layer.1).sum()
    }

    /// Answers to all `questions`, which are sorted: neighbours are answered one from the other.
    pub fn answer(&self, questions: &[Question], watch: &dyn Watch) -> Result<Vec<Answer>, Stopped> {
        let alike = |a: &Question, b: &Question| a.cluster == b.cluster && a.half_mm == b.half_mm;
        let runs: Vec<&[Question]> = questions.chunk_by(alike).collect();
        let answered: Vec<Vec<Answer>> = runs
            .into_par_iter()
            .map(|run| if watch.stop_requested() { Vec::new() } else { self.answer_run(run) })
            .collect();
        watch.go_on()?;
        Ok(answered.into_iter().flatten().collect())
    }

    /// What the top layer mostly is, and what it may take in.
    fn top(&self, layers: &[(Mixture, f64)]) -> Option<(ResinId, Vec<ResinId>)> {
        let (mixture, _) = layers.first()?;
        let carrier = mixture.parts().iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?.0;
        let known = |resin: &ResinId| mixture.share(*resin) > 0.0 || self.inks.contains(resin);
        let others: Vec<ResinId> = (0..self.volumes.first()?.len()).map(ResinId).filter(known).collect();
        let mixable = self.inks.contains(&carrier);
        mixable.then(|| (carrier, others.into_iter().filter(|resin| *resin != carrier).collect()))
    }

    /// Answers to questions of one cluster and thickness.
    fn answer_run(&self, run: &[Question]) -> Vec<Answer> {
        let base = &self.clusters[run[0].cluster];
        let half = run[0].half_mm;
        let size = |question: &Question| question.ln_factor.iter().map(|ln| ln.abs()).sum::<f64>();
        let middle = (0..run.len()).fold(0, |best, n| if size(&run[n]) < size(&run[best]) { n } else { best });
        let mut answers: Vec<Option<Answer>> = vec![None; run.len()];
        let mut first = self.squeezed(base, half);
        for order in [(middle..run.len()).collect::<Vec<_>>(), (0..middle).rev().collect()] {
            let mut from = first.clone();
            for n in order {
                let (numbers, answer) = self.solve(base, half, &from, &run[n].ln_factor);
                answers[n] = Some(answer);
                if n == middle {
                    first = numbers.clone();
                }
                from = numbers;
            }
        }
        answers.into_iter().flatten().collect()
    }

    /// The numbers of a cluster's stacking in a part of half thickness `half`.
    fn squeezed(&self, base: &Base, half: Option<f64>) -> Vec<f64> {
        let mut numbers = base.numbers();
        let total: f64 = numbers[..base.layers.len()].iter().sum();
        if let Some(half) = half.filter(|half| SQUEEZED * half < total) {
            numbers[..base.layers.len()].iter_mut().for_each(|mm| *mm *= SQUEEZED * half / total);
            self.keep_limits(base, &mut numbers);
        }
        numbers
    }

    /// No layer thinner than may be, no resin above its depth, no shares below 0 or of more than the top layer.
    fn keep_limits(&self, base: &Base, numbers: &mut [f64]) {
        let (thickness, shares) = numbers.split_at_mut(base.layers.len());
        let mut above = 0.0;
        for n in 0..thickness.len() {
            let limit = |resin: ResinId| self.limits.get(resin.0).copied().unwrap_or(ResinLimit::NONE);
            let parts = || base.layers[n].0.parts().iter().map(|(resin, _)| limit(*resin));
            // A layer that was found to be none may stay so.
            let thinnest = if base.layers[n].1 == 0.0 { 0.0 } else { self.min_layer_mm.min(base.layers[n].1) };
            let least = parts().map(|limit| limit.min_mm).fold(thinnest, f64::max);
            let most = parts().map(|limit| limit.max_mm).fold(f64::INFINITY, f64::min);
            thickness[n] = thickness[n].max(least).min(most.max(least));
            let depth = parts().map(|limit| limit.min_depth_mm).fold(0.0, f64::max);
            if above < depth && above > 0.0 && thickness[n] > 0.0 {
                thickness[..n].iter_mut().for_each(|mm| *mm *= depth / above);
                above = depth;
            }
            above += thickness[n];
        }
        shares.iter_mut().for_each(|share| *share = share.max(0.0));
        let sum: f64 = shares.iter().sum();
        if sum > MIXED {
            shares.iter_mut().for_each(|share| *share *= MIXED / sum);
        }
    }

    /// The numbers that make the albedo what a factor asks for, from `start` on.
    fn solve(&self, base: &Base, half: Option<f64>, start: &[f64], ln_factor: &[f64]) -> (Vec<f64>, Answer) {
        // A flat slab without a factor is what was found; a thin part is asked for what the target is.
        let from = if half.is_some() { &base.asked } else { &base.promised };
        let goal: Vec<f64> =
            from.iter().zip(ln_factor).map(|(albedo, ln)| albedo.max(BLACK) * libm::exp(*ln)).collect();
        let missing = |albedo: &[f64]| -> Vec<f64> {
            goal.iter().zip(albedo).map(|(goal, albedo)| libm::log(goal / albedo.max(BLACK))).collect()
        };
        let size = |missing: &[f64]| missing.iter().map(|ln| ln * ln).sum::<f64>();
        let mut numbers = start.to_vec();
        let mut albedo = self.albedo(base, &numbers, half);
        let mut off = missing(&albedo);
        for _ in 0..STEPS {
            if off.iter().all(|ln| ln.abs() < CLOSE) {
                break;
            }
            let slopes: Vec<Vec<f64>> = (0..numbers.len())
                .map(|n| {
                    let mut moved = numbers.clone();
                    base.shift(&mut moved, n, DIFFERENCE);
                    let moved = self.albedo(base, &moved, half);
                    let slope =
                        |(moved, here): (&f64, &f64)| libm::log(moved.max(BLACK) / here.max(BLACK)) / DIFFERENCE;
                    moved.iter().zip(&albedo).map(slope).collect()
                })
                .collect();
            let Some(better) = self.stepped(base, half, (&numbers, &off, &slopes), &missing, &size) else { break };
            (numbers, albedo, off) = better;
        }
        let layers = numbers.iter().zip(base.mixtures(&numbers)).map(|(mm, mixture)| (mixture, *mm));
        let stacking = Stack::new(layers).over(Mixture::from(self.core));
        (numbers, Answer { stacking, albedo, short: off })
    }

    /// A step of Newton's rule that misses less than `here`: numbers, by how much they miss, and slopes; `None` where
    /// none was found.
    fn stepped(
        &self,
        base: &Base,
        half: Option<f64>,
        (numbers, off, slopes): (&[f64], &[f64], &[Vec<f64>]),
        missing: &dyn Fn(&[f64]) -> Vec<f64>,
        size: &dyn Fn(&[f64]) -> f64,
    ) -> Option<(Vec<f64>, Vec<f64>, Vec<f64>)> {
        // What cannot move the way it should is left out, and the others make up for it.
        let mut slopes = slopes.to_vec();
        let mut step = least_step(&slopes, off);
        for _ in 0..numbers.len() {
            let mut probe = numbers.to_vec();
            (0..probe.len()).for_each(|n| base.shift(&mut probe, n, 1e-3 * step[n]));
            let wanted = probe.clone();
            self.keep_limits(base, &mut probe);
            let mut left_out = false;
            for n in 0..numbers.len() {
                if step[n] != 0.0 && (probe[n] - wanted[n]).abs() > 1e-6 * wanted[n].abs().max(1e-6) {
                    slopes[n].fill(0.0);
                    left_out = true;
                }
            }
            if !left_out {
                break;
            }
            step = least_step(&slopes, off);
        }
        for shorter in [1.0, 0.5, 0.2] {
            let mut next = numbers.to_vec();
            (0..next.len()).for_each(|n| base.shift(&mut next, n, shorter * step[n]));
            self.keep_limits(base, &mut next);
            let there = self.albedo(base, &next, half);
            let left = missing(&there);
            if size(&left) < 0.98 * size(off) {
                return Some((next, there, left));
            }
        }
        None
    }

    /// Albedo per channel of layers over the core, or cut off at half the thickness of a part over its mirror image.
    fn albedo(&self, base: &Base, numbers: &[f64], half: Option<f64>) -> Vec<f64> {
        let mixtures: Vec<Mixture> = base.mixtures(numbers).collect();
        let in_channel = |volumes: &Vec<VolumeCoefficients>| {
            let mixed = |mixture: &Mixture| {
                VolumeCoefficients::mixed(mixture.parts().iter().map(|(resin, share)| (volumes[resin.0], *share)))
            };
            let pairs = mixtures.iter().zip(numbers).map(|(mixture, mm)| (mixed(mixture), *mm));
            let stack = match half {
                None => Stack::new(pairs).over(volumes[self.core.0]),
                Some(half) => {
                    let mut left = half;
                    let mut cut = Vec::new();
                    for (volume, mm) in pairs.chain([(volumes[self.core.0], half)]) {
                        cut.push((volume, mm.min(left)));
                        left -= mm.min(left);
                    }
                    Stack::new(cut.clone().into_iter().chain(cut.into_iter().rev()))
                }
            };
            let light = Transport { stack: &stack, light: Light::Diffuse, options: TOTALS }.spectra(&self.grid);
            light.reflection[0] + light.transmission[0]
        };
        self.volumes.iter().map(in_channel).collect()
    }
}

impl Base {
    /// Thicknesses of the layers in mm, then shares of the top layer.
    fn numbers(&self) -> Vec<f64> {
        let thickness = self.layers.iter().map(|layer| layer.1);
        let others = self.top.iter().flat_map(|(_, others)| others);
        thickness.chain(others.map(|resin| self.layers[0].0.share(*resin))).collect()
    }

    /// The mixtures of all layers.
    fn mixtures<'a>(&'a self, numbers: &'a [f64]) -> impl Iterator<Item = Mixture> + 'a {
        let shares = &numbers[self.layers.len()..];
        let top = self.top.as_ref().and_then(|(carrier, others)| {
            let rest = 1.0 - shares.iter().sum::<f64>();
            Mixture::new(others.iter().copied().zip(shares.iter().copied()).chain([(*carrier, rest)]))
        });
        let first = top
            .into_iter()
            .chain(self.top.is_none().then(|| self.layers.first().map(|layer| layer.0.clone())).flatten());
        first.chain(self.layers.iter().skip(1).map(|layer| layer.0.clone()))
    }

    /// Moves a number by `step`: a thickness by a factor, a share by so many of its unit.
    fn shift(&self, numbers: &mut [f64], n: usize, step: f64) {
        if n < self.layers.len() {
            numbers[n] *= libm::exp(step.clamp(-LONGEST, LONGEST));
        } else {
            numbers[n] += SHARE * step.clamp(-MOST_SHARES, MOST_SHARES);
        }
    }
}

/// The least change x of ln thicknesses with slopesᵀ x = off: slopes (slopesᵀ slopes + damping)⁻¹ off.
fn least_step(slopes: &[Vec<f64>], off: &[f64]) -> Vec<f64> {
    let n = off.len();
    let mut rows: Vec<Vec<f64>> = (0..n)
        .map(|a| {
            let product = |b: usize| slopes.iter().map(|slope| slope[a] * slope[b]).sum::<f64>();
            let mut row: Vec<f64> = (0..n).map(product).collect();
            row[a] += DAMPING;
            row.push(off[a]);
            row
        })
        .collect();
    // Elimination; the matrix is symmetric and positive definite.
    for pivot in 0..n {
        let of = rows[pivot].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(n, _)| *n != pivot) {
            let factor = row[pivot] / of[pivot];
            row.iter_mut().zip(&of).for_each(|(value, of)| *value -= factor * of);
        }
    }
    let solved: Vec<f64> = rows.iter().enumerate().map(|(n, row)| row[row.len() - 1] / row[n]).collect();
    slopes.iter().map(|slope| slope.iter().zip(&solved).map(|(slope, x)| slope * x).sum()).collect()
}
