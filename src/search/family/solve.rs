//! One target: the numbers of the stacking that comes closest.

use super::{
    model::{Below, Goal, Model},
    shape::{Shape, Slot},
};
use crate::{
    numeric::least_squares::dot,
    optics::{FrequencyGrid, Mixture, Stack, TransportOptions, VolumeCoefficients},
    search::{
        SearchOptions, SearchTarget,
        refine::{
            fit::{Residuals, fit},
            nodes::Nodes,
            polytope::Polytope,
        },
    },
};

/// Stackings of one order of slots, for any number of targets.
pub struct Family {
    pub(super) shape: Shape,
    options: SearchOptions,
    cheap: Model,
    expensive: Model,
    pub tune: Tune,
}

#[derive(Clone, Copy)]
pub struct Tune {
    pub pull_mm: f64,
    pub pull_share: f64,
    pub steps: usize,
    pub corrections: usize,
}

/// What a target got.
#[derive(Debug, Clone)]
pub struct FamilyAnswer {
    pub parameters: Vec<f64>,
    pub stacking: Stack<Mixture>,
    pub reflection: Vec<Vec<f64>>,
    pub objective: f64,
    pub response: Vec<Vec<f64>>,
    pub shift: Vec<Vec<f64>>,
    pub log: String,
}

impl Family {
    pub fn new(
        slots: Vec<(Vec<usize>, f64)>,
        resins: &[Vec<VolumeCoefficients>],
        grid: &FrequencyGrid,
        options: &SearchOptions,
        directions: TransportOptions,
    ) -> Self {
        let shape =
            Shape { slots: slots.into_iter().map(|(resins, least_mm)| Slot { resins, least_mm }).collect() };
        let core = options.core.map(|core| core.0);
        Self {
            cheap: Model::new(&shape, resins, core, grid, Nodes::few(grid.len()), directions),
            expensive: Model::new(&shape, resins, core, grid, Nodes::new(grid.len()), TransportOptions::REFLECTION),
            options: options.clone(),
            shape,
            tune: Tune { pull_mm: 2e-6, pull_share: 1e-5, steps: 12, corrections: 3 },
        }
    }

    pub fn parameters(&self) -> usize {
        self.shape.len()
    }

    fn goal(&self, target: &SearchTarget) -> Goal {
        let roots = |channel: &Vec<f64>| self.options.objective.weights(channel).into_iter().map(f64::sqrt).collect();
        Goal { wanted: target.channels.clone(), roots: target.channels.iter().map(roots).collect() }
    }

    fn pulled(&self, mut residuals: Residuals, x: &[f64]) -> Residuals {
        for (at, value) in x.iter().enumerate() {
            let root = if at < self.shape.slots.len() { self.tune.pull_mm } else { self.tune.pull_share }.sqrt();
            residuals.values.push(root * value);
            for (other, slopes) in residuals.per_mm.iter_mut().enumerate() {
                slopes.push(if other == at { root } else { 0.0 });
            }
        }
        residuals
    }

    fn pull(&self, x: &[f64]) -> f64 {
        let of = |at: usize| if at < self.shape.slots.len() { self.tune.pull_mm } else { self.tune.pull_share };
        x.iter().enumerate().map(|(at, value)| of(at) * value * value).sum()
    }

    /// The best from a start.
    pub fn solve(&self, target: &SearchTarget, half_mm: Option<f64>, start: &[f64], shift: Option<&[Vec<f64>]>) -> Option<FamilyAnswer> {
        let goal = self.goal(target);
        let below = half_mm.map_or(Below::Endless, Below::Middle);
        let room = half_mm.map_or(self.options.max_thickness_mm, |half| half.min(self.options.max_thickness_mm));
        let limits = self.shape.limits(&self.options, room, half_mm.is_some())?;
        let mut log = String::new();
        let evaluations = std::cell::Cell::new(0);
        let mut x = start.to_vec();
        let mut shift: Vec<Vec<f64>> = match shift {
            Some(shift) => shift.to_vec(),
            None => goal.wanted.iter().map(|channel| vec![0.0; channel.len()]).collect(),
        };
        let mut best: Option<FamilyAnswer> = None;
        for _ in 0..self.tune.corrections {
            let shifted = Goal { wanted: less(&goal.wanted, &shift), roots: goal.roots.clone() };
            evaluations.set(0);
            let found = fit(&x, &limits, self.tune.steps, |x| {
                evaluations.set(evaluations.get() + 1);
                self.pulled(self.cheap.residuals(&self.shape, x, below, &shifted), x)
            })?;
            x = found.mm;
            let cheap = self.cheap.reflection(&self.shape, &x, below);
            let reflection = self.expensive.reflection(&self.shape, &x, below);
            let objective = self.options.objective.of(&reflection, target);
            let expected: Vec<Vec<f64>> =
                cheap.iter().zip(&shift).map(|(cheap, shift)| cheap.iter().zip(shift).map(|(c, s)| c + s).collect()).collect();
            let mismatch: f64 = expected.iter().zip(&reflection).zip(&goal.roots).flat_map(|((e, r), roots)| {
                e.iter().zip(r).zip(roots).map(|((e, r), root)| (root * (e - r)).powi(2))
            }).sum();
            shift = less(&reflection, &cheap);
            log += &format!("{} evals {:.2e} fine {objective:.2e} mismatch {mismatch:.1e}; ", evaluations.get(), found.objective);
            let total = objective + self.pull(&x);
            if best.as_ref().is_none_or(|best| total < best.objective + self.pull(&best.parameters)) {
                best = Some(FamilyAnswer {
                    parameters: x.clone(),
                    stacking: self.shape.stacking(&x, self.options.core),
                    reflection,
                    objective,
                    response: Vec::new(),
                    shift: shift.clone(),
                    log: String::new(),
                });
            }
            if mismatch < 0.01 * objective || mismatch < 1e-7 {
                break;
            }
        }
        best.map(|mut best| { best.log = log; best })
    }
}

fn less(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<Vec<f64>> {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect()
}
