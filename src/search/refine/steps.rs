//! Refined thicknesses brought to multiples of a step, such as a printer's slices.

use super::{
    Fitted, Goal, RANKING_STEPS, Refiner,
    fit::{Fit, Residuals, fit},
    polytope::Polytope,
};
use crate::numeric::least_squares::{curvature, dot, gradient};

/// Moves between multiples of a step, and how many are tried before each.
const STEP_ROUNDS: usize = 12;
const STEP_TRIALS: usize = 4;

impl Refiner {
    /// Brings the thicknesses to multiples of a step: the layer that matters most first, down or up, whichever the
    /// others can make up for better. `None` where that ends outside the limits.
    pub(super) fn on_steps(&self, (sequence, found): Fitted, goal: &Goal, step_mm: f64) -> Option<Fitted> {
        let mut polytope = Polytope::new(&sequence, &self.options, self.refine.min_layer_mm)?;
        let residuals = |mm: &[f64]| self.fine.residuals(goal, &sequence, mm);
        let stiffness: Vec<f64> = residuals(&found.mm).per_mm.iter().map(|slope| dot(slope, slope)).collect();
        let mut order: Vec<usize> = (0..sequence.len()).collect();
        order.sort_by(|&a, &b| stiffness[b].total_cmp(&stiffness[a]));
        let mut best = found;
        for layer in order {
            let steps = best.mm[layer] / step_mm;
            let mut tried: Vec<(Polytope, Fit)> = Vec::new();
            for count in [steps.floor(), steps.floor() + 1.0] {
                let with = polytope.with_fixed(layer, count * step_mm);
                if let Some(found) = fit(&best.mm, &with, RANKING_STEPS, residuals) {
                    tried.push((with, found));
                }
            }
            (polytope, best) = tried.into_iter().min_by(|a, b| a.1.objective.total_cmp(&b.1.objective))?;
        }
        let polytope = Polytope::new(&sequence, &self.options, self.refine.min_layer_mm)?;
        let mut counts: Vec<f64> = best.mm.iter().map(|mm| (mm / step_mm).round()).collect();
        let thickness = |counts: &[f64]| -> Vec<f64> { counts.iter().map(|count| count * step_mm).collect() };
        let mut here = residuals(&thickness(&counts));
        for _ in 0..STEP_ROUNDS {
            let mut next = None;
            for counts in neighbours(&counts, &here, step_mm, |counts| polytope.contains(&thickness(counts))) {
                let there = residuals(&thickness(&counts));
                if there.objective() < here.objective() {
                    next = Some((counts, there));
                    break;
                }
            }
            let Some(better) = next else { break };
            (counts, here) = better;
        }
        Some((sequence, Fit { mm: thickness(&counts), objective: here.objective() }))
    }
}

/// Counts of steps with at most three layers one step thinner or thicker: those that promise most to second order, most
/// first.
fn neighbours(counts: &[f64], here: &Residuals, step_mm: f64, allowed: impl Fn(&[f64]) -> bool) -> Vec<Vec<f64>> {
    let n = counts.len();
    let curvature = curvature(&here.per_mm);
    let slope = gradient(&here.per_mm, &here.values);
    let mut moves: Vec<Vec<(usize, f64)>> = vec![Vec::new()];
    for first in 0..3 {
        let longer = moves.iter().filter(|m| m.len() == first).flat_map(|m| {
            let next = m.last().map_or(0, |last| last.0 + 1);
            (next..n).flat_map(move |layer| [1.0, -1.0].map(|sign| m.iter().copied().chain([(layer, sign)]).collect()))
        });
        let longer: Vec<Vec<(usize, f64)>> = longer.collect();
        moves.extend(longer);
    }
    let gain = |m: &Vec<(usize, f64)>| {
        let linear: f64 = m.iter().map(|&(i, sign)| 2.0 * sign * slope[i]).sum();
        let pairs = m.iter().flat_map(|&(i, a)| m.iter().map(move |&(j, b)| (i, a, j, b)));
        linear + step_mm * pairs.map(|(i, a, j, b)| a * b * curvature[i][j]).sum::<f64>()
    };
    let mut promising: Vec<(f64, Vec<f64>)> = moves
        .iter()
        .map(|m| {
            let mut next = counts.to_vec();
            m.iter().for_each(|&(layer, sign)| next[layer] += sign);
            (gain(m), next)
        })
        .filter(|(gain, next)| *gain < 0.0 && allowed(next))
        .collect();
    promising.sort_by(|a, b| a.0.total_cmp(&b.0));
    promising.into_iter().map(|(_, counts)| counts).take(STEP_TRIALS).collect()
}
