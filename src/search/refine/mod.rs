//! From the best stackings in the scalar model to the best in the transport model.
//!
//! Scalar Kubelka–Munk mispredicts thin and clear layers, and an optimiser finds exactly those mistakes. So its search
//! ranks many stackings of whole units; transport judges them again, one per sequence of resins, and the thicknesses of
//! the best are refined continuously, with exact slopes, within what a job and a printer allow.
//!
//! ```text
//!   match_sequences ──► a short fit of each ──► a long fit of the best few ──► one layer more or less? ──► Refined
//!                       the coarse model               the coarse model, corrected by the fine one
//! ```
//!
//! All but the last steps are done in few directions at an eighth of the frequencies, as if that erred by what it errs
//! by where the fit stands: a fit asks for what the coarse model gives where the fine one, of more directions at a
//! third of the frequencies ([`nodes`]), gives the target (space mapping, Bandler et al. 1994, with a shift for the
//! mapping). Nothing is random, and nothing depends on the number of threads.

pub(super) mod fit;
pub(super) mod nodes;
pub(super) mod polytope;
mod steps;
mod tables;

use serde::{Deserialize, Serialize};

use self::{
    fit::{Fit, fit},
    nodes::Nodes,
    polytope::Polytope,
    tables::{Goal, Tables},
};
use super::{BlockTable, Match, SearchError, SearchOptions, SearchTarget, branch_and_bound::match_sequences};
use crate::{
    numeric::{least_squares::dot, rounding::rounded},
    optics::{FrequencyGrid, ResinId, Stack, TransportOptions, VolumeCoefficients},
    parallel,
    watch::Watch,
};

/// What refining may do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineOptions {
    /// No layer is thinner, mm.
    pub min_layer_mm: f64,
    /// Thicknesses are multiples of this, mm; `None`: any thickness.
    pub step_mm: Option<f64>,
    /// Of the candidates, how many are fitted to the end.
    pub finalists: usize,
    /// Whether layers of one resin below mixtures may be thinner than `min_layer_mm` all the same: where boundaries are
    /// dithered, voxels hold layers of any thickness. Of families alone.
    pub thin_below_mixtures: bool,
    /// Whether targets lie beside each other on one surface, where light that goes far below one comes out of another.
    /// Of families alone.
    pub side_by_side: bool,
}

impl Default for RefineOptions {
    /// Layers of at least 27 µm, a slice of the J750, all of them; 3 finalists.
    fn default() -> Self {
        Self { min_layer_mm: 0.027, step_mm: None, finalists: 3, thin_below_mixtures: false, side_by_side: false }
    }
}

/// A stacking that was refined.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Refined {
    /// The layers over the search's core.
    pub stacking: Stack,
    /// The objective of the search, in the transport model.
    pub objective: f64,
    /// R̂ per channel in the transport model.
    pub reflection: Vec<Vec<f64>>,
    /// What the first candidate's objective is in the transport model.
    pub unrefined: f64,
}

/// Tables of a set of resins, for any number of targets.
#[derive(Debug)]
pub(super) struct Refiner {
    options: SearchOptions,
    refine: RefineOptions,
    coarse: Tables,
    fine: Tables,
    resins: usize,
}

/// Directions of the coarse model.
const COARSE: TransportOptions = TransportOptions { polar: 4, orders: 4 };
/// Candidates that are fitted at all.
const RANKED: usize = 8;
/// Evaluations of a fit that only ranks, and of one that counts.
const RANKING_STEPS: usize = 5;
const FINAL_STEPS: usize = 8;
/// Corrections of the coarse model by the fine one in a fit that counts, and evaluations of the fine one that end it.
const CORRECTIONS: usize = 2;
const POLISHING_STEPS: usize = 3;
/// A correction that moves no layer by more, mm, is the last.
const SETTLED_MM: f64 = 1e-4;
/// An edit whose objective by the corrected coarse model is larger by this factor is not asked of the fine one.
const PROMISING: f64 = 1.1;
/// A layer more must lower the objective by this share.
const WORTH_A_LAYER: f64 = 0.1;
/// Rounds of trying a layer more or less, and layers that are tried in each.
const EDITS: usize = 3;
const INSERTIONS: usize = 2;
/// Root mean square error of a coefficient that is good enough: the model itself is off by 1e-4 (docs/accuracy.md).
const ENOUGH: f64 = 1e-4;

/// Layers of a fit: the resins and where their thicknesses ended.
type Fitted = (Vec<usize>, Fit);
/// Layers to start from.
type Start = (Vec<usize>, Vec<f64>);

impl Refiner {
    /// Sequences of resins worth asking `match_sequences` for. Evidence: docs/accuracy.md, "Refined stackings".
    pub const SEQUENCES: usize = 16;

    /// `resins` has index `[resin][channel]`; `options` are those of the search whose candidates will be refined.
    pub fn new(
        resins: &[Vec<VolumeCoefficients>],
        grid: &FrequencyGrid,
        options: &SearchOptions,
        refine: RefineOptions,
    ) -> Self {
        let tables = |nodes, directions| Tables::new(resins, options.core, grid, nodes, directions);
        Self {
            coarse: tables(Nodes::few(grid.len()), COARSE),
            fine: tables(Nodes::new(grid.len()), TransportOptions::REFLECTION),
            options: options.clone(),
            refine,
            resins: resins.len(),
        }
    }

    /// R̂ of a stacking over the search's core per channel in the transport model.
    pub fn reflection(&self, stacking: &Stack) -> Vec<Vec<f64>> {
        let layers: Vec<_> = stacking.pairs().map(|(resin, mm)| (resin.0, mm)).collect();
        self.fine.reflection(&layers)
    }

    /// The best stacking for `target` that can be reached from `candidates`, best first as
    /// [`match_sequences`] gives them; at least one.
    ///
    /// # Errors
    /// No multiples of the step within reach that keep the limits; [`SearchError::Stopped`], asked between fits.
    pub fn refine(
        &self,
        candidates: &[Match],
        target: &SearchTarget,
        watch: &dyn Watch,
    ) -> Result<Refined, SearchError> {
        let unrefined = candidates.first().map_or(Vec::new(), |best| self.reflection(&best.stacking));
        let unrefined_objective = self.options.objective.of(&unrefined, target);
        let goal = self.goal(target);
        let starts = distinct(candidates);
        let mut ranked = self.fits(&self.coarse, &goal, RANKING_STEPS, self.promising(&goal, starts.clone()));
        ranked.truncate(self.refine.finalists);
        watch.go_on()?;
        let finished = self.corrected(&goal, ranked.into_iter().map(start).collect());
        let Some(mut best) = finished.into_iter().next().and_then(|best| self.polished(&goal, best)) else {
            // Limits that whole units keep and thin layers do not: nothing to refine.
            let stacking = candidates.first().map_or_else(Stack::default, |best| best.stacking.clone());
            return Ok(Refined {
                stacking,
                objective: unrefined_objective,
                reflection: unrefined,
                unrefined: unrefined_objective,
            });
        };
        watch.go_on()?;
        if let Some(better) = self.deeper(&best, starts, &goal) {
            best = better;
        }
        let weight: f64 = target.channels.iter().flat_map(|channel| self.options.objective.weights(channel)).sum();
        for _ in 0..EDITS {
            if best.1.objective <= weight * ENOUGH * ENOUGH {
                break;
            }
            watch.go_on()?;
            let Some(better) = self.edit(&best, &goal) else { break };
            best = better;
        }
        if let Some(step_mm) = self.refine.step_mm {
            watch.go_on()?;
            best = self.on_steps(best, &goal, step_mm).ok_or(SearchError::Steps { step_mm })?;
        }
        let (sequence, Fit { mm, .. }) = best;
        let mm = mm.into_iter().map(rounded);
        let stacking = Stack::joined(sequence.into_iter().map(ResinId).zip(mm)).over(self.options.core);
        let reflection = self.reflection(&stacking);
        let found = self.options.objective.of(&reflection, target);
        // Steps may cost more than they are worth.
        let kept = candidates.first().filter(|first| unrefined_objective < found && self.allows(&first.stacking));
        Ok(match kept {
            Some(first) => Refined {
                stacking: first.stacking.clone(),
                objective: unrefined_objective,
                reflection: unrefined,
                unrefined: unrefined_objective,
            },
            None => Refined { stacking, objective: found, reflection, unrefined: unrefined_objective },
        })
    }

    /// Whether a stacking of whole units keeps what only refined ones must.
    fn allows(&self, stacking: &Stack) -> bool {
        let (sequence, mm): Start = stacking.pairs().map(|(resin, mm)| (resin.0, mm)).unzip();
        self.refine.step_mm.is_none()
            && Polytope::new(&sequence, &self.options, self.refine.min_layer_mm)
                .is_some_and(|limits| limits.contains(&mm))
    }

    /// Searches and refines every target, in parallel; the answers do not depend on the number of threads. The first of
    /// each pair is what the search found.
    ///
    /// # Errors
    /// The first error in the order of the targets, of [`match_sequences`] or of [`Self::refine`].
    pub fn match_targets(
        &self,
        table: &BlockTable,
        targets: &[SearchTarget],
        watch: &dyn Watch,
    ) -> Result<Vec<(Match, Refined)>, SearchError> {
        let one = |target: &SearchTarget| {
            let mut candidates = match_sequences(table, target, Self::SEQUENCES, watch)?;
            let refined = self.refine(&candidates, target, watch)?;
            Ok((candidates.swap_remove(0), refined))
        };
        let answers: Vec<_> = parallel::map_all(targets, one);
        answers.into_iter().collect()
    }

    /// The best of `starts` as they stand.
    fn promising(&self, goal: &Goal, starts: Vec<Start>) -> Vec<Start> {
        let stands = |start: Start| (self.coarse.objective(goal, &start.0, &start.1), start);
        let mut starts: Vec<_> = starts.into_iter().map(stands).collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts.into_iter().map(|(_, start)| start).take(RANKED).collect()
    }

    /// Fits each start, best first.
    fn fits(&self, model: &Tables, goal: &Goal, steps: usize, starts: Vec<Start>) -> Vec<Fitted> {
        best_first(starts.into_iter().filter_map(|start| self.fit(model, goal, steps, start)))
    }

    fn fit(&self, model: &Tables, goal: &Goal, steps: usize, (sequence, mm): Start) -> Option<Fitted> {
        let polytope = Polytope::new(&sequence, &self.options, self.refine.min_layer_mm)?;
        let found = fit(&mm, &polytope, steps, |mm| model.residuals(goal, &sequence, mm))?;
        Some((sequence, found))
    }

    /// Fits each start in the coarse model, corrected by the fine one where the fit stands, best first.
    fn corrected(&self, goal: &Goal, starts: Vec<Start>) -> Vec<Fitted> {
        let one = |start: Start| {
            let mut best: Option<Fitted> = None;
            let mut here = start;
            for _ in 0..CORRECTIONS {
                let shifted = self.shifted(goal, &here);
                let next = self.fit(&self.coarse, &shifted, FINAL_STEPS, here.clone())?;
                let moved = next.1.mm.iter().zip(&here.1).map(|(to, from)| (to - from).abs()).fold(0.0, f64::max);
                here = (next.0.clone(), next.1.mm.clone());
                best = Some(next);
                if moved < SETTLED_MM {
                    break;
                }
            }
            best
        };
        best_first(starts.into_iter().filter_map(one))
    }

    /// The end of a fit, in the fine model.
    fn polished(&self, goal: &Goal, found: Fitted) -> Option<Fitted> {
        self.fit(&self.fine, goal, POLISHING_STEPS, start(found))
    }

    fn goal(&self, target: &SearchTarget) -> Goal {
        let roots = |channel: &Vec<f64>| self.options.objective.weights(channel).into_iter().map(f64::sqrt).collect();
        Goal { wanted: target.channels.clone(), roots: target.channels.iter().map(roots).collect() }
    }

    /// What the coarse model should give near `layers` for the fine one to give `goal` there.
    fn shifted(&self, goal: &Goal, (sequence, mm): &Start) -> Goal {
        let layers: Vec<_> = sequence.iter().copied().zip(mm.iter().copied()).collect();
        let (coarse, fine) = (self.coarse.reflection(&layers), self.fine.reflection(&layers));
        let channel = |((wanted, coarse), fine): ((&Vec<f64>, Vec<f64>), Vec<f64>)| {
            wanted.iter().zip(coarse).zip(fine).map(|((wanted, coarse), fine)| wanted + coarse - fine).collect()
        };
        let wanted = goal.wanted.iter().zip(coarse).zip(fine).map(channel).collect();
        Goal { wanted, roots: goal.roots.clone() }
    }

    /// Fits end in the nearest valley: a start that is better as it stands lies in a deeper one, which no finalist was
    /// in.
    fn deeper(&self, found: &Fitted, starts: Vec<Start>, goal: &Goal) -> Option<Fitted> {
        let shifted = self.shifted(goal, &start(found.clone()));
        let better = |(sequence, mm): &Start| self.coarse.objective(&shifted, sequence, mm) < found.1.objective;
        let starts = starts.into_iter().filter(better).collect();
        let best = self.corrected(goal, starts).into_iter().next()?;
        self.polished(goal, best).filter(|fitted| fitted.1.objective < found.1.objective)
    }

    /// The best of all stackings with one layer less or more, if it is worth it.
    fn edit(&self, found: &Fitted, goal: &Goal) -> Option<Fitted> {
        let shifted = self.shifted(goal, &start(found.clone()));
        let objective = found.1.objective;
        let best_of = |starts: Vec<Start>| {
            let mut ranked = self.fits(&self.coarse, &shifted, 2 * RANKING_STEPS, starts);
            ranked.truncate(1);
            ranked.retain(|fitted| fitted.1.objective <= PROMISING * objective);
            let best = self.corrected(goal, ranked.into_iter().map(start).collect()).into_iter().next()?;
            self.polished(goal, best)
        };
        let fewer = best_of(self.without_a_layer(found, &shifted)).filter(|fewer| fewer.1.objective <= objective);
        fewer.or_else(|| {
            let more = best_of(self.with_a_layer(found, &shifted))?;
            (more.1.objective < (1.0 - WORTH_A_LAYER) * objective).then_some(more)
        })
    }

    /// The stacking without the layer that is missed least.
    fn without_a_layer(&self, (sequence, found): &Fitted, goal: &Goal) -> Vec<Start> {
        let residuals = self.coarse.residuals(goal, sequence, &found.mm);
        let Some(loss) = residuals.loss_without(&found.mm) else { return Vec::new() };
        let Some(least) = (0..sequence.len()).min_by(|&a, &b| loss[a].total_cmp(&loss[b])) else { return Vec::new() };
        let layers = sequence.iter().zip(&found.mm).enumerate().filter(|&(i, _)| i != least);
        let start = joined(layers.map(|(_, (&resin, &mm))| (resin, mm)));
        if start.0.is_empty() { Vec::new() } else { vec![start] }
    }

    /// A thin layer more, where and of what the objective falls fastest with its thickness.
    fn with_a_layer(&self, (sequence, found): &Fitted, goal: &Goal) -> Vec<Start> {
        if sequence.len() >= self.options.depth {
            return Vec::new();
        }
        // Every resin at every boundary and in the middle of every layer, 0 mm thick: what is not there changes nothing
        // but has slopes.
        let nothing = || (0..self.resins).map(|resin| (resin, 0.0));
        let mut layers: Vec<(usize, f64)> = nothing().collect();
        for (&resin, &mm) in sequence.iter().zip(&found.mm) {
            layers.push((resin, 0.5 * mm));
            layers.extend(nothing());
            layers.push((resin, 0.5 * mm));
            layers.extend(nothing());
        }
        let (all, mm): Start = layers.iter().copied().unzip();
        let residuals = self.coarse.residuals(goal, &all, &mm);
        let mut slopes: Vec<(f64, usize)> = residuals
            .per_mm
            .iter()
            .map(|slope| dot(slope, &residuals.values))
            .zip(0..)
            .filter(|&(slope, at)| slope < 0.0 && mm[at] == 0.0)
            .collect();
        slopes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut starts: Vec<Start> = Vec::new();
        for (_, at) in slopes {
            let mut thicker = layers.clone();
            thicker[at].1 = self.refine.min_layer_mm;
            let start = joined(thicker);
            let new = start.0 != *sequence && starts.iter().all(|known| known.0 != start.0);
            if new && start.0.len() <= self.options.depth && starts.len() < INSERTIONS {
                starts.push(start);
            }
        }
        starts
    }
}

fn best_first(fitted: impl Iterator<Item = Fitted>) -> Vec<Fitted> {
    let mut fitted: Vec<_> = fitted.collect();
    fitted.sort_by(|a, b| a.1.objective.total_cmp(&b.1.objective));
    fitted
}

/// The first candidate of every sequence of resins.
fn distinct(candidates: &[Match]) -> Vec<Start> {
    let mut starts: Vec<Start> = Vec::new();
    for candidate in candidates {
        let start: Start = candidate.stacking.pairs().map(|(resin, mm)| (resin.0, mm)).unzip();
        if !start.0.is_empty() && starts.iter().all(|known| known.0 != start.0) {
            starts.push(start);
        }
    }
    starts
}

fn start((sequence, fit): Fitted) -> Start {
    (sequence, fit.mm)
}

fn joined(layers: impl IntoIterator<Item = (usize, f64)>) -> Start {
    Stack::joined(layers).layers.into_iter().map(|layer| (layer.resin, layer.thickness_mm)).unzip()
}

#[cfg(test)]
mod tests;
