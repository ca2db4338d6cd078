//! Which stacking answers a cluster where the object is thin, and where its print must be lighter or darker than a flat
//! slab would have to be.
//!
//! What was found for a cluster as an endless flat slab over the core is bent: its layers stay in their order and change
//! their thicknesses until the transport model promises the albedo that is wanted. Under even light from all sides a
//! part that is 2H thick looks like the layers cut off at H over a perfect mirror, its own mirror image; the light that
//! comes back is what the whole, symmetric plate reflects and lets through. Where the layers are thicker than H they are
//! squeezed into it first, so that each still counts.
//!
//! Thicknesses move by the least relative change that makes up for what is missing, in each channel, by Newton's rule
//! with differences for slopes.

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
    /// Only the albedo matters.
    grid: FrequencyGrid,
}

/// What was found for a cluster.
#[derive(Debug)]
struct Base {
    layers: Vec<(Mixture, f64)>,
    /// Albedo per channel that is asked for, and that the model promises of a flat slab.
    asked: Vec<f64>,
    promised: Vec<f64>,
}

/// One azimuthal order is enough for totals.
const TOTALS: TransportOptions = TransportOptions { polar: 6, orders: 1 };
/// Newton's steps, and the error of ln albedo that ends them.
const STEPS: usize = 12;
const CLOSE: f64 = 0.004;
/// Change of ln thickness that slopes are taken over, and most that a step may change one.
const DIFFERENCE: f64 = 0.04;
const LONGEST: f64 = 0.7;
/// Against slopes so flat that a step would be without end.
const DAMPING: f64 = 1e-4;
/// Part of a thin place that squeezed layers take.
const SQUEEZED: f64 = 0.85;
/// Albedos below are black: no factor changes them.
const BLACK: f64 = 1e-4;

impl Answers {
    /// What `found` for `targets` can become.
    pub(super) fn new(context: &TargetContext<'_>, found: &[Found], targets: &[SearchTarget]) -> Result<Self, RunError> {
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
            grid: FrequencyGrid::of(vec![0.0]),
        };
        for (found, target) in found.iter().zip(targets) {
            let stacking = found.stacking();
            let layers: Vec<_> = stacking.pairs().map(|(mixture, mm)| (mixture.clone(), mm)).collect();
            let thickness: Vec<f64> = layers.iter().map(|layer| layer.1).collect();
            let promised = answers.albedo(&layers, &thickness, None);
            let asked = target.channels.iter().map(|channel| channel[0]).collect();
            answers.clusters.push(Base { layers, asked, promised });
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

    /// Answers to questions of one cluster and thickness.
    fn answer_run(&self, run: &[Question]) -> Vec<Answer> {
        let base = &self.clusters[run[0].cluster];
        let half = run[0].half_mm;
        let start = self.squeezed(&base.layers, half);
        let size = |question: &Question| question.ln_factor.iter().map(|ln| ln.abs()).sum::<f64>();
        let middle = (0..run.len()).fold(0, |best, n| if size(&run[n]) < size(&run[best]) { n } else { best });
        let mut answers: Vec<Option<Answer>> = vec![None; run.len()];
        for order in [(middle..run.len()).collect::<Vec<_>>(), (0..middle).rev().collect()] {
            let mut from = match &answers[middle] {
                Some(answer) => answer.stacking.layers.iter().map(|layer| layer.thickness_mm).collect(),
                None => start.clone(),
            };
            for n in order {
                let (thickness, answer) = self.solve(base, half, &from, &run[n].ln_factor);
                answers[n] = Some(answer);
                from = thickness;
            }
        }
        answers.into_iter().flatten().collect()
    }

    /// Thicknesses of the layers in a part of half thickness `half`.
    fn squeezed(&self, layers: &[(Mixture, f64)], half: Option<f64>) -> Vec<f64> {
        let mut thickness: Vec<f64> = layers.iter().map(|layer| layer.1).collect();
        let total: f64 = thickness.iter().sum();
        if let Some(half) = half.filter(|half| SQUEEZED * half < total) {
            thickness.iter_mut().for_each(|mm| *mm *= SQUEEZED * half / total);
            self.keep_limits(layers, &mut thickness);
        }
        thickness
    }

    /// No layer thinner than may be, no resin above its depth.
    fn keep_limits(&self, layers: &[(Mixture, f64)], thickness: &mut [f64]) {
        let mut above = 0.0;
        for n in 0..layers.len() {
            let limit = |resin: ResinId| self.limits.get(resin.0).copied().unwrap_or(ResinLimit::NONE);
            let parts = || layers[n].0.parts().iter().map(|(resin, _)| limit(*resin));
            let least = parts().map(|limit| limit.min_mm).fold(self.min_layer_mm, f64::max);
            let most = parts().map(|limit| limit.max_mm).fold(f64::INFINITY, f64::min);
            thickness[n] = thickness[n].max(least).min(most.max(least));
            let depth = parts().map(|limit| limit.min_depth_mm).fold(0.0, f64::max);
            if above < depth && above > 0.0 {
                thickness[..n].iter_mut().for_each(|mm| *mm *= depth / above);
                above = depth;
            }
            above += thickness[n];
        }
    }

    /// Thicknesses from `start` on that make the albedo what a factor asks for.
    fn solve(&self, base: &Base, half: Option<f64>, start: &[f64], ln_factor: &[f64]) -> (Vec<f64>, Answer) {
        // A flat slab without a factor is what was found; a thin part is asked for what the target is.
        let from = if half.is_some() { &base.asked } else { &base.promised };
        let goal: Vec<f64> = from.iter().zip(ln_factor).map(|(albedo, ln)| albedo.max(BLACK) * libm::exp(*ln)).collect();
        let missing = |albedo: &[f64]| -> Vec<f64> {
            goal.iter().zip(albedo).map(|(goal, albedo)| libm::log(goal / albedo.max(BLACK))).collect()
        };
        let size = |missing: &[f64]| missing.iter().map(|ln| ln * ln).sum::<f64>();
        let mut thickness = start.to_vec();
        let mut albedo = self.albedo(&base.layers, &thickness, half);
        let mut off = missing(&albedo);
        for _ in 0..STEPS {
            if off.iter().all(|ln| ln.abs() < CLOSE) {
                break;
            }
            let slopes: Vec<Vec<f64>> = (0..thickness.len())
                .map(|n| {
                    let mut moved = thickness.clone();
                    moved[n] *= 1.0 + DIFFERENCE;
                    let moved = self.albedo(&base.layers, &moved, half);
                    let slope = |(moved, here): (&f64, &f64)| libm::log(moved.max(BLACK) / here.max(BLACK)) / DIFFERENCE;
                    moved.iter().zip(&albedo).map(slope).collect()
                })
                .collect();
            let step = least_step(&slopes, &off);
            let mut better = None;
            for shorter in [1.0, 0.5, 0.2] {
                let mut next: Vec<f64> = thickness.clone();
                for (mm, ln) in next.iter_mut().zip(&step) {
                    *mm *= libm::exp((shorter * ln).clamp(-LONGEST, LONGEST));
                }
                self.keep_limits(&base.layers, &mut next);
                let there = self.albedo(&base.layers, &next, half);
                let left = missing(&there);
                if size(&left) < 0.98 * size(&off) {
                    better = Some((next, there, left));
                    break;
                }
            }
            let Some(better) = better else { break };
            (thickness, albedo, off) = better;
        }
        let layers = base.layers.iter().zip(&thickness).map(|((mixture, _), mm)| (mixture.clone(), *mm));
        let stacking = Stack::new(layers).over(Mixture::from(self.core));
        (thickness, Answer { stacking, albedo, short: off })
    }

    /// Albedo per channel of layers over the core, or cut off at half the thickness of a part over its mirror image.
    fn albedo(&self, layers: &[(Mixture, f64)], thickness: &[f64], half: Option<f64>) -> Vec<f64> {
        let in_channel = |volumes: &Vec<VolumeCoefficients>| {
            let mixed = |mixture: &Mixture| VolumeCoefficients::mixed(mixture.parts().iter().map(|(resin, share)| (volumes[resin.0], *share)));
            let pairs = layers.iter().zip(thickness).map(|((mixture, _), mm)| (mixed(mixture), *mm));
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
