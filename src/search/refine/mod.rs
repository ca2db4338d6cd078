//! From the best stackings in the scalar model to the best in the transport model.
//!
//! Scalar Kubelka–Munk mispredicts thin and clear layers, and an optimiser finds exactly those mistakes. So its search ranks many
//! stackings of whole units; transport judges them again, one per sequence of resins, and the thicknesses of the best are refined
//! continuously, with exact slopes, within what a job and a printer allow.
//!
//! ```text
//!   match_sequences ──► a short fit of each ──► a long fit of the best few ──► with one layer more or less? ──► Refined
//!                        coarse directions                        fine directions
//! ```
//!
//! Fits see a third of the frequencies, close together where R̂ bends; the objective that is reported sees all of them. Nothing is random, and
//! nothing depends on the number of threads.

mod fit;
mod polytope;

use std::cmp::Ordering;

use self::{
    fit::{Fit, Residuals, fit},
    polytope::Polytope,
};
use super::{Match, SearchError, SearchOptions, SearchTarget, Stacking, objective};
use crate::optics::{FrequencyGrid, ModalReflection, TransportOptions, VolumeCoefficients};

/// What refining may do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineOptions {
    /// No layer is thinner, mm.
    pub min_layer_mm: f64,
    /// Thicknesses are multiples of this, mm; `None`: any thickness.
    pub step_mm: Option<f64>,
    /// Of the candidates, how many are fitted to the end.
    pub finalists: usize,
}

impl Default for RefineOptions {
    /// Layers of at least 27 µm, a slice of the J750; 3 finalists.
    fn default() -> Self {
        Self { min_layer_mm: 0.027, step_mm: None, finalists: 3 }
    }
}

/// A stacking that was refined.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// The layers.
    pub stacking: Stacking,
    /// The objective of the search, in the transport model.
    pub objective: f64,
    /// R̂ per channel in the transport model.
    pub reflection: Vec<Vec<f64>>,
    /// What the first candidate's objective is in the transport model.
    pub unrefined: f64,
}

/// Tables of a set of resins, for any number of targets.
#[derive(Debug)]
pub struct Refiner {
    options: SearchOptions,
    refine: RefineOptions,
    /// Indices of the frequencies that fits see, and what each weighs.
    nodes: Vec<(usize, f64)>,
    /// One per channel: few directions at the nodes, all directions at the nodes, and at every frequency.
    coarse: Vec<ModalReflection>,
    fine: Vec<ModalReflection>,
    full: Vec<ModalReflection>,
    resins: usize,
}

/// Directions that tell good sequences from bad ones.
const COARSE: TransportOptions = TransportOptions { polar: 4, orders: 6 };
/// Evaluations of a fit that only ranks, and of one that counts.
const RANKING_STEPS: usize = 5;
const FINAL_STEPS: usize = 25;
/// A layer more must lower the objective by this share.
const WORTH_A_LAYER: f64 = 0.1;
/// Rounds of trying a layer more or less.
const EDITS: usize = 3;

impl Refiner {
    /// Sequences of resins worth asking [`match_sequences`](super::match_sequences) for. Evidence: docs/accuracy.md, "Refined stackings".
    pub const SEQUENCES: usize = 16;

    /// `resins` has index `[resin][channel]`; `options` are those of the search whose candidates will be refined.
    pub fn new(
        resins: &[Vec<VolumeCoefficients>],
        grid: &FrequencyGrid,
        options: &SearchOptions,
        refine: RefineOptions,
    ) -> Self {
        let nodes = nodes(grid.len());
        let chosen: Vec<f64> = nodes.iter().map(|&(i, _)| grid.as_slice()[i]).collect();
        let channels = resins.first().map_or(0, Vec::len);
        let tables = |k: &[f64], directions: TransportOptions| -> Vec<ModalReflection> {
            let channel = |channel: usize| {
                let resins: Vec<_> = resins.iter().map(|resin| resin[channel]).collect();
                ModalReflection::new(&resins, options.core, k, directions)
            };
            (0..channels).map(channel).collect()
        };
        Self {
            coarse: tables(&chosen, COARSE),
            fine: tables(&chosen, TransportOptions::REFLECTION),
            full: tables(grid.as_slice(), TransportOptions::REFLECTION),
            options: options.clone(),
            refine,
            nodes,
            resins: resins.len(),
        }
    }

    /// R̂ of a stacking per channel in the transport model.
    pub fn reflection(&self, stacking: &Stacking) -> Vec<Vec<f64>> {
        let layers: Vec<_> = stacking.layers.iter().map(|layer| (layer.resin, layer.thickness_mm)).collect();
        self.full.iter().map(|channel| channel.reflection(&layers)).collect()
    }

    /// The best stacking for `target` that can be reached from `candidates`, best first as
    /// [`match_sequences`](super::match_sequences) gives them; at least one.
    ///
    /// # Errors
    /// No multiples of the step within reach that keep the limits.
    pub fn refine(&self, candidates: &[Match], target: &SearchTarget) -> Result<Refined, SearchError> {
        let unrefined = candidates.first().map_or(Vec::new(), |best| self.reflection(&best.stacking));
        let unrefined_objective = objective(&unrefined, target, self.options.dc_weight);
        let mut ranked = self.fits(&self.coarse, target, RANKING_STEPS, distinct(candidates));
        ranked.truncate(self.refine.finalists);
        let starts = ranked.into_iter().map(|(sequence, fit)| (sequence, fit.mm));
        let finished = self.fits(&self.fine, target, FINAL_STEPS, starts.collect());
        let Some(mut best) = finished.into_iter().next() else {
            // Limits that whole units keep and thin layers do not: nothing to refine.
            let stacking = candidates.first().map_or_else(Stacking::default, |best| best.stacking.clone());
            return Ok(Refined {
                stacking,
                objective: unrefined_objective,
                reflection: unrefined,
                unrefined: unrefined_objective,
            });
        };
        for _ in 0..EDITS {
            let Some(better) = self.edit(&best, target) else { break };
            best = better;
        }
        if let Some(step_mm) = self.refine.step_mm {
            best = self.on_steps(best, target, step_mm).ok_or(SearchError::Steps { step_mm })?;
        }
        let (sequence, Fit { mm, .. }) = best;
        let stacking = Stacking::from_layers(sequence.into_iter().zip(mm));
        let reflection = self.reflection(&stacking);
        let found = objective(&reflection, target, self.options.dc_weight);
        Ok(Refined { stacking, objective: found, reflection, unrefined: unrefined_objective })
    }

    /// Fits each start, best first.
    fn fits(
        &self,
        model: &[ModalReflection],
        target: &SearchTarget,
        steps: usize,
        starts: Vec<(Vec<usize>, Vec<f64>)>,
    ) -> Vec<(Vec<usize>, Fit)> {
        let fitted = starts.into_iter().filter_map(|(sequence, mm)| {
            let polytope = Polytope::new(&sequence, &self.options, self.refine.min_layer_mm)?;
            let found = fit(&mm, &polytope, steps, |mm| self.residuals(model, target, &sequence, mm))?;
            Some((sequence, found))
        });
        let mut fitted: Vec<_> = fitted.collect();
        fitted.sort_by(|a, b| a.1.objective.total_cmp(&b.1.objective));
        fitted
    }

    fn residuals(&self, model: &[ModalReflection], target: &SearchTarget, sequence: &[usize], mm: &[f64]) -> Residuals {
        let layers: Vec<_> = sequence.iter().copied().zip(mm.iter().copied()).collect();
        let mut residuals = Residuals { values: Vec::new(), per_mm: vec![Vec::new(); layers.len()] };
        for (model, wanted) in model.iter().zip(&target.channels) {
            let slope = model.slope(&layers);
            let root = |&(i, weight): &(usize, f64)| {
                let weight = if i == 0 { self.options.dc_weight } else { weight };
                weight.sqrt()
            };
            let of = |at: usize, node: &(usize, f64)| root(node) * (slope.reflection[at] - wanted[node.0]);
            residuals.values.extend(self.nodes.iter().enumerate().map(|(at, node)| of(at, node)));
            for (all, per_mm) in residuals.per_mm.iter_mut().zip(&slope.per_mm) {
                all.extend(self.nodes.iter().zip(per_mm).map(|(node, value)| root(node) * value));
            }
        }
        residuals
    }

    /// The best of all stackings with one layer more or one less, if it is worth it.
    fn edit(&self, (sequence, found): &(Vec<usize>, Fit), target: &SearchTarget) -> Option<(Vec<usize>, Fit)> {
        let mut starts = Vec::new();
        let polytope = Polytope::new(sequence, &self.options, self.refine.min_layer_mm)?;
        for layer in 0..sequence.len() {
            // A layer pressed to its least thickness may be one too many.
            if found.mm[layer] <= polytope.least[layer] * 1.001 {
                let layers = sequence.iter().zip(&found.mm).enumerate().filter(|&(i, _)| i != layer);
                starts.push(joined(layers.map(|(_, (&resin, &mm))| (resin, mm))));
            }
        }
        let fewer = self.fits(&self.fine, target, FINAL_STEPS, starts);
        if let Some(fewer) = fewer.into_iter().next().filter(|fewer| fewer.1.objective <= found.objective) {
            return Some(fewer);
        }
        if sequence.len() >= self.options.depth {
            return None;
        }
        // ∂objective/∂h of a layer of no thickness, at every boundary and in the middle of every layer.
        let mut places = Vec::new();
        for at in 0..=2 * sequence.len() {
            let mut layers: Vec<(usize, f64)> = sequence.iter().copied().zip(found.mm.iter().copied()).collect();
            let (boundary, split) = (at / 2, at % 2 == 1);
            if split {
                layers[boundary].1 *= 0.5;
                layers.insert(boundary, layers[boundary]);
            }
            let position = boundary + usize::from(split);
            for resin in 0..self.resins {
                let mut with = layers.clone();
                with.insert(position, (resin, 0.0));
                places.push((position, with));
            }
        }
        let slope = |(position, layers): &(usize, Vec<(usize, f64)>)| {
            let (sequence, mm): (Vec<_>, Vec<_>) = layers.iter().copied().unzip();
            let residuals = self.residuals(&self.coarse, target, &sequence, &mm);
            polytope::dot(&residuals.per_mm[*position], &residuals.values)
        };
        let mut steepest: Vec<_> = places.iter().map(|place| (slope(place), place)).filter(|(s, _)| *s < 0.0).collect();
        steepest.sort_by(|a, b| a.0.total_cmp(&b.0));
        let thicker = |(_, (position, layers)): &(f64, &(usize, Vec<(usize, f64)>))| {
            let mut layers = layers.clone();
            layers[*position].1 = self.refine.min_layer_mm;
            joined(layers)
        };
        let mut starts: Vec<(Vec<usize>, Vec<f64>)> = Vec::new();
        for start in steepest.iter().map(thicker) {
            if start.0 != *sequence && start.0.len() <= self.options.depth && starts.iter().all(|s| s.0 != start.0) {
                starts.push(start);
            }
        }
        starts.truncate(self.refine.finalists);
        let more = self.fits(&self.fine, target, FINAL_STEPS, starts).into_iter().next()?;
        (more.1.objective < (1.0 - WORTH_A_LAYER) * found.objective).then_some(more)
    }

    /// Brings the thicknesses to multiples of a step: from the rounded ones to better neighbours, which have a step more in one layer or a
    /// step moved from one layer to another, until there is none. `None` where no multiples within reach keep the limits.
    fn on_steps(
        &self,
        (sequence, found): (Vec<usize>, Fit),
        target: &SearchTarget,
        step_mm: f64,
    ) -> Option<(Vec<usize>, Fit)> {
        let polytope = Polytope::new(&sequence, &self.options, self.refine.min_layer_mm)?;
        // What breaks a limit is worse than anything that keeps them all.
        let judge = |steps: &[f64]| {
            let mm: Vec<f64> = steps.iter().map(|count| count * step_mm).collect();
            let violation = polytope.violation(&mm);
            if violation > 0.0 {
                return (violation, 0.0);
            }
            let residuals = self.residuals(&self.fine, target, &sequence, &mm);
            (0.0, polytope::dot(&residuals.values, &residuals.values))
        };
        let mut steps: Vec<f64> = found.mm.iter().map(|mm| (mm / step_mm).round()).collect();
        let mut lowest = judge(&steps);
        let n = steps.len();
        loop {
            let moves =
                (0..n).flat_map(|i| (0..=n).flat_map(move |j| [(i, j, 1.0), (i, j, -1.0)])).filter(|m| m.0 != m.1);
            let neighbours = moves.map(|(i, j, sign)| {
                let mut next = steps.clone();
                next[i] += sign;
                if let Some(other) = next.get_mut(j) {
                    *other -= sign;
                }
                (judge(&next), next)
            });
            let Some((value, next)) = neighbours.min_by(|a, b| a.0.partial_cmp(&b.0).unwrap_or(Ordering::Equal)) else {
                break;
            };
            if value.partial_cmp(&lowest) != Some(Ordering::Less) {
                break;
            }
            (lowest, steps) = (value, next);
        }
        let mm = steps.iter().map(|count| count * step_mm).collect();
        (lowest.0 == 0.0).then_some((sequence, Fit { mm, objective: lowest.1 }))
    }
}

/// The first candidate of every sequence of resins.
fn distinct(candidates: &[Match]) -> Vec<(Vec<usize>, Vec<f64>)> {
    let mut starts: Vec<(Vec<usize>, Vec<f64>)> = Vec::new();
    for candidate in candidates {
        let start: (Vec<usize>, Vec<f64>) =
            candidate.stacking.layers.iter().map(|layer| (layer.resin, layer.thickness_mm)).unzip();
        if !start.0.is_empty() && starts.iter().all(|known| known.0 != start.0) {
            starts.push(start);
        }
    }
    starts
}

fn joined(layers: impl IntoIterator<Item = (usize, f64)>) -> (Vec<usize>, Vec<f64>) {
    Stacking::from_layers(layers).layers.iter().map(|layer| (layer.resin, layer.thickness_mm)).unzip()
}

/// Indices of a third of `len` frequencies, dense at the low ones, and the number of frequencies that each speaks for: those between two nodes
/// count for both, the more the nearer. The first speaks for itself.
fn nodes(len: usize) -> Vec<(usize, f64)> {
    let mut indices = vec![0];
    let mut at = 1;
    while at < len {
        indices.push(at);
        at += match at {
            ..8 => 1,
            8..24 => 2,
            24..56 => 4,
            _ => 8,
        };
    }
    if indices[indices.len() - 1] + 1 < len {
        indices.push(len - 1);
    }
    let mut nodes: Vec<(usize, f64)> = indices.into_iter().map(|i| (i, 1.0)).collect();
    for i in 2..nodes.len() {
        let (low, high) = (nodes[i - 1].0, nodes[i].0);
        // Half of the frequencies strictly between.
        let share = (high - low - 1) as f64 / 2.0;
        nodes[i - 1].1 += share;
        nodes[i].1 += share;
    }
    nodes
}

#[cfg(test)]
mod tests;
