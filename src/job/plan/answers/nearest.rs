//! The numbers of a stacking that bring its albedo nearest to what is asked for: Gauss and Newton's rule.
//!
//! What is minimised is the difference of the colours that eyes see, CIEDE2000 squared, where three channels are one, as a
//! family's fit has it; else errors of ln albedo, channel by channel. By channel a dark one that cannot be reached would
//! count as much as the light one beside it, and where a part is thin the one is given up for the other, in bands.
//!
//! A weak pull leads back to the cluster's own stacking, squeezed into the part. So of all numbers that give an albedo
//! those are found that differ least, wherever the search started: like questions have like answers.

use super::{Answer, Answers, BLACK, Base};
use crate::{
    numeric::{
        least_squares::{damped_inverse, dot, gradient},
        rounding::rounded,
    },
    optics::{Mixture, Stack},
    search::ColourError,
};

/// What an error of ln albedo counts: lightness L* of an albedo of 0.27.
const PER_LN: f64 = 25.0;
/// What a number counts that is a unit from the cluster's, squared. Ten units, as of white to an even mixture, cost a
/// tenth of what is just visible.
const PULL: f64 = 1e-3;
/// Steps at most, and the gain that is worth one: so much, or that share of what is left.
const STEPS: usize = 12;
const GAIN: f64 = 2e-3;
const GAIN_SHARE: f64 = 0.01;
/// Slopes are taken anew where a step gains less than this share of what they promised.
const STALE: f64 = 0.7;
/// Damping of steps, by which a longer one is tried after a shorter.
const DAMPINGS: [f64; 4] = [1e-6, 1e-2, 0.3, 10.0];

/// What is asked for.
pub(super) struct Goal {
    albedo: Vec<f64>,
    colour: Option<ColourError>,
    /// Where the pull leads.
    towards: Vec<f64>,
}

impl Goal {
    fn residuals(&self, albedo: &[f64]) -> Vec<f64> {
        match (&self.colour, albedo) {
            (Some(colour), &[r, g, b]) => colour.residuals([r, g, b]).to_vec(),
            _ => self.missing(albedo).map(|ln| -PER_LN * ln).collect(),
        }
    }

    /// By what the residuals change with the albedo: channel, residual.
    fn slopes(&self, albedo: &[f64]) -> Vec<Vec<f64>> {
        match (&self.colour, albedo) {
            (Some(colour), &[r, g, b]) => colour.slopes([r, g, b]).map(|slopes| slopes.to_vec()).to_vec(),
            _ => {
                let n = albedo.len();
                let of = |channel: usize, residual: usize| {
                    if channel == residual { PER_LN / albedo[channel].max(BLACK) } else { 0.0 }
                };
                (0..n).map(|channel| (0..n).map(|residual| of(channel, residual)).collect()).collect()
            }
        }
    }

    /// Logarithm of what an albedo is short of, by channel.
    fn missing(&self, albedo: &[f64]) -> impl Iterator<Item = f64> {
        self.albedo.iter().zip(albedo).map(|(goal, albedo)| libm::log(goal / albedo.max(BLACK)))
    }
}

/// A stacking on the way.
struct Here {
    numbers: Vec<f64>,
    albedo: Vec<f64>,
    /// Of the albedo, then of the pull.
    residuals: Vec<f64>,
}

impl Here {
    fn sum(&self) -> f64 {
        dot(&self.residuals, &self.residuals)
    }
}

impl Answers {
    /// The numbers nearest to what a factor asks for, from `start` on; `slopes` are those of an answer nearby, and then
    /// of this one.
    pub(super) fn nearest(
        &self,
        base: &Base,
        half: Option<f64>,
        start: &[f64],
        ln_factor: &[f64],
        slopes: &mut Option<Vec<Vec<f64>>>,
    ) -> (Vec<f64>, Answer) {
        // A flat slab without a factor is what was found; a thin part is asked for what the target is.
        let from = if half.is_some() { &base.asked } else { &base.promised };
        let albedo: Vec<f64> =
            from.iter().zip(ln_factor).map(|(albedo, ln)| albedo.max(BLACK) * libm::exp(*ln)).collect();
        let of_three = |albedo: &Vec<f64>| <[f64; 3]>::try_from(albedo.as_slice()).ok();
        let colour = self.colour.then(|| of_three(&albedo)).flatten().map(ColourError::of);
        let goal = Goal { albedo, colour, towards: self.squeezed(base, half) };
        let mut here = self.at(base, half, &goal, start.to_vec());
        for _ in 0..STEPS {
            let fresh = slopes.is_none();
            let known = slopes.take().unwrap_or_else(|| self.slopes(base, half, &goal, &here));
            let worth = GAIN.max(GAIN_SHARE * here.sum());
            match self.stepped(base, half, &goal, &here, &known, worth) {
                Stepped::Better { there, as_promised } => {
                    *slopes = as_promised.then_some(known);
                    here = there;
                }
                // What old slopes say is believed where little is missing.
                Stepped::NotWorthIt if fresh || here.sum() < 100.0 * GAIN => {
                    *slopes = Some(known);
                    break;
                }
                Stepped::Nowhere if fresh => break,
                Stepped::NotWorthIt | Stepped::Nowhere => {}
            }
        }
        let Here { mut numbers, mut albedo, .. } = here;
        numbers.iter_mut().chain(&mut albedo).for_each(|value| *value = rounded(*value));
        let short = goal.missing(&albedo).collect();
        let layers = numbers.iter().zip(base.mixtures(&numbers)).map(|(mm, mixture)| (mixture, *mm));
        let stacking = Stack::new(layers).over(Mixture::from(self.core));
        (numbers, Answer { stacking, albedo, short })
    }

    fn at(&self, base: &Base, half: Option<f64>, goal: &Goal, numbers: Vec<f64>) -> Here {
        let albedo = self.albedo(base, &numbers, half);
        let mut residuals = goal.residuals(&albedo);
        residuals.extend(base.apart(&numbers, &goal.towards).map(|units| PULL.sqrt() * units));
        Here { numbers, albedo, residuals }
    }

    /// By what all residuals change with every number, in its unit: number, residual.
    fn slopes(&self, base: &Base, half: Option<f64>, goal: &Goal, here: &Here) -> Vec<Vec<f64>> {
        let (of_albedo, of_numbers) = (goal.slopes(&here.albedo), self.albedo_slopes(base, &here.numbers, half));
        let count = here.numbers.len();
        let of = |n: usize| -> Vec<f64> {
            let residuals = here.residuals.len() - count;
            let along = |residual: usize| -> f64 {
                of_albedo.iter().zip(&of_numbers).map(|(albedo, numbers)| albedo[residual] * numbers[n]).sum()
            };
            let pull = (0..count).map(|other| if other == n { PULL.sqrt() } else { 0.0 });
            (0..residuals).map(along).chain(pull).collect()
        };
        (0..count).map(of).collect()
    }

    /// A step that leaves less than `here`.
    fn stepped(
        &self,
        base: &Base,
        half: Option<f64>,
        goal: &Goal,
        here: &Here,
        slopes: &[Vec<f64>],
        worth: f64,
    ) -> Stepped {
        let mut worth_it = false;
        for damping in DAMPINGS {
            let Some((step, promised)) = self.free_step(base, here, slopes, damping) else { break };
            if promised < worth {
                break;
            }
            worth_it = true;
            let mut next = here.numbers.clone();
            (0..next.len()).for_each(|n| base.shift(&mut next, n, step[n]));
            self.keep_limits(base, &mut next);
            let there = self.at(base, half, goal, next);
            let gain = here.sum() - there.sum();
            if gain > 0.0 {
                return Stepped::Better { as_promised: gain > STALE * promised, there };
            }
        }
        if worth_it { Stepped::Nowhere } else { Stepped::NotWorthIt }
    }

    /// The step of the numbers that can move as it says, and what it should gain: what limits hold back is left out, and
    /// the others make up for it.
    fn free_step(&self, base: &Base, here: &Here, slopes: &[Vec<f64>], damping: f64) -> Option<(Vec<f64>, f64)> {
        let count = here.numbers.len();
        let mut free = vec![true; count];
        loop {
            let which: Vec<usize> = (0..count).filter(|&n| free[n]).collect();
            let left: Vec<Vec<f64>> = which.iter().map(|&n| slopes[n].clone()).collect();
            let downhill = gradient(&left, &here.residuals);
            let inverse = damped_inverse(&left, damping)?;
            let mut step = vec![0.0; count];
            for (&n, row) in which.iter().zip(&inverse) {
                step[n] = -dot(row, &downhill);
            }
            let mut probe = here.numbers.clone();
            (0..count).for_each(|n| base.shift(&mut probe, n, 1e-3 * step[n]));
            let wanted = probe.clone();
            self.keep_limits(base, &mut probe);
            let held = |n: &usize| (probe[*n] - wanted[*n]).abs() > 1e-6 * wanted[*n].abs().max(1e-6);
            let held: Vec<usize> = which.iter().copied().filter(held).collect();
            if held.is_empty() {
                let promised = -which.iter().zip(&downhill).map(|(&n, slope)| step[n] * slope).sum::<f64>();
                return Some((step, promised));
            }
            held.into_iter().for_each(|n| free[n] = false);
        }
    }
}

/// What became of a step.
enum Stepped {
    /// It leaves less, and as much less as it promised or not.
    Better { there: Here, as_promised: bool },
    /// It promises too little.
    NotWorthIt,
    /// However short, it leaves more.
    Nowhere,
}
