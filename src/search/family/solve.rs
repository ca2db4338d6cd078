//! One target: the numbers of the stacking that comes closest.
//!
//! A fit runs in the cheap model, as if that erred by what it errs by where the fit stands (space mapping, Bandler et
//! al. 1994, with a shift for the mapping); the expensive one judges. What a like target's fit knew of the error serves
//! the next.
//!
//! Where the profile does not tell, the numbers are pulled to 0: less resin, less ink in white. The pull is part of
//! what is minimised and the same for all, so that answers to like targets are alike wherever they started.

use super::{
    PartTarget,
    descent::{Ended, descend},
    model::{Below, Goal, Model},
    shape::Shape,
};
use crate::{
    numeric::least_squares::{damped_inverse, dot, gradient},
    search::{
        SearchOptions,
        refine::{fit::Residuals, polytope::Polytope},
    },
};

/// What a mm of resin costs in the objective, squared, and what a share of an ink does. Evidence: docs/objective.md.
const PULL_PER_MM: f64 = 2e-6;
const PULL_OF_SHARE: f64 = 1e-5;
/// Evaluations of the cheap model in one fit.
const EVALUATIONS: usize = 24;
/// And in one that only ranks starts.
const RANKING: usize = 12;
/// Fits, each with what the expensive model says of the last.
const FITS: usize = 4;
/// What the expensive model may say otherwise than foreseen: this share of the objective, or so much of the weight, an
/// error of 3e-5 in every coefficient.
const FORESEEN: f64 = 0.01;
const ENOUGH: f64 = 1e-9;

/// Share of the weight, an error of 0.005 in every coefficient, from which on other starts are tried.
const FAR: f64 = 2.5e-5;

/// One R̂ per channel.
pub(super) type Spectra = Vec<Vec<f64>>;

/// Where a fit ended.
#[derive(Debug, Clone)]
pub(super) struct Solved {
    pub x: Vec<f64>,
    /// R̂ by the expensive model.
    pub reflection: Spectra,
    pub objective: f64,
    /// With the pull: what is minimised.
    pub total: f64,
    /// By how much the expensive model's R̂ is larger than the cheap one's.
    pub shift: Spectra,
}

/// What is asked, in numbers.
#[derive(Clone)]
pub(super) struct Asked {
    goal: Goal,
    below: Below,
    limits: Polytope,
    weight: f64,
}

impl Asked {
    /// `None` where no stacking of the shape keeps the limits.
    pub fn new(part: &PartTarget, shape: &Shape, options: &SearchOptions) -> Option<Self> {
        let channels = &part.target.channels;
        let roots = |channel: &Vec<f64>| options.objective.weights(channel).into_iter().map(f64::sqrt).collect();
        let roots: Spectra = channels.iter().map(roots).collect();
        // Nothing fills a part that has no core.
        let half_mm = part.half_thickness_mm.filter(|_| options.core.is_some());
        let room_mm = half_mm.map_or(options.max_thickness_mm, |half| half.min(options.max_thickness_mm));
        Some(Self {
            weight: roots.iter().flatten().map(|root| root * root).sum(),
            goal: Goal { wanted: channels.clone(), roots, colour: options.objective.colour(&part.target) },
            below: half_mm.map_or(Below::Endless, Below::Middle),
            limits: shape.limits(options, room_mm, half_mm.is_some())?,
        })
    }

    /// Whether an answer is off so far that its fit may have got stuck.
    pub fn is_far(&self, solved: &Solved) -> bool {
        solved.objective > FAR * self.weight
    }

    /// The same with a slot left out, and with one of `least_mm` or more.
    pub fn without_or_with(&self, slot: usize, least_mm: f64) -> [Self; 2] {
        [self.limits.with_fixed(slot, 0.0), self.limits.with_least(slot, least_mm)]
            .map(|limits| Self { limits, ..self.clone() })
    }

    /// The nearest numbers that keep the limits.
    pub fn within(&self, x: &[f64]) -> Option<Vec<f64>> {
        self.limits.nearest(x)
    }

    fn shifted(&self, shift: Option<&Spectra>) -> Goal {
        match shift {
            None => self.goal.clone(),
            Some(shift) => Goal { wanted: less(&self.goal.wanted, shift), ..self.goal.clone() },
        }
    }
}

/// Both models of one shape.
pub(super) struct Solver<'a> {
    pub shape: &'a Shape,
    pub cheap: &'a Model,
    pub expensive: &'a Model,
}

impl Shape {
    /// What each number is pulled to 0 by, squared.
    fn pulls(&self) -> impl Iterator<Item = f64> {
        let slots = self.slots.len();
        (0..self.len()).map(move |at| if at < slots { PULL_PER_MM } else { PULL_OF_SHARE })
    }

    fn pull(&self, x: &[f64]) -> f64 {
        self.pulls().zip(x).map(|(pull, x)| pull * x * x).sum()
    }

    fn pulled(&self, mut residuals: Residuals, x: &[f64]) -> Residuals {
        for (at, (pull, value)) in self.pulls().zip(x).enumerate() {
            residuals.values.push(pull.sqrt() * value);
            for (other, slopes) in residuals.per_mm.iter_mut().enumerate() {
                slopes.push(if other == at { pull.sqrt() } else { 0.0 });
            }
        }
        residuals
    }
}

/// The best that the cheap model alone finds from `start`, with what it minimised.
pub(super) fn roughly(
    shape: &Shape,
    cheap: &Model,
    asked: &Asked,
    start: &[f64],
    shift: Option<&Spectra>,
) -> Option<(Vec<f64>, f64)> {
    let Ended { x, residuals } = fitted(shape, cheap, asked, start, &asked.shifted(shift), RANKING)?;
    Some((x, residuals.objective()))
}

fn fitted(
    shape: &Shape,
    cheap: &Model,
    asked: &Asked,
    start: &[f64],
    goal: &Goal,
    evaluations: usize,
) -> Option<Ended> {
    descend(start, &asked.limits, evaluations, |x| shape.pulled(cheap.residuals(shape, x, asked.below, goal), x))
}

impl Solver<'_> {
    /// The best from `start`.
    pub fn solve(&self, asked: &Asked, start: &[f64], shift: Option<&Spectra>) -> Option<Solved> {
        let Self { shape, cheap, expensive, .. } = self;
        let mut x = start.to_vec();
        let mut shift = shift.cloned();
        let mut best: Option<Solved> = None;
        for _ in 0..FITS {
            x = fitted(shape, cheap, asked, &x, &asked.shifted(shift.as_ref()), EVALUATIONS)?.x;
            shape.tidy(&mut x);
            let reflection = expensive.reflection(shape, &x, asked.below);
            let shift_here = less(&reflection, &cheap.reflection(shape, &x, asked.below));
            let objective = asked.goal.off(&reflection);
            let total = objective + shape.pull(&x);
            let surprise = match &shift {
                Some(shift) => asked.goal.size(&less(&shift_here, shift)),
                None => f64::INFINITY,
            };
            shift = Some(shift_here.clone());
            if best.as_ref().is_none_or(|best| total < best.total) {
                best = Some(Solved { x: x.clone(), reflection, objective, total, shift: shift_here });
            }
            if surprise <= (FORESEEN * objective).max(ENOUGH * asked.weight) {
                break;
            }
        }
        best
    }

    /// What the answer to one target would be worth as it stands for another.
    pub fn borrowed(&self, asked: &Asked, own: &Solved, x: &[f64]) -> f64 {
        let Some(x) = asked.limits.nearest(x) else { return f64::INFINITY };
        let reflection = self.cheap.reflection(self.shape, &x, asked.below);
        asked.goal.off(&more(&reflection, &own.shift)) + self.shape.pull(&x)
    }

    /// How the numbers change with the logarithm of each channel's spectrum, to first order, at the answer: Gauss and
    /// Newton's step, on the limits that hold it.
    pub fn response(&self, asked: &Asked, solved: &Solved) -> Vec<Vec<f64>> {
        let Self { shape, cheap, .. } = self;
        let shifted = asked.shifted(Some(&solved.shift));
        let residuals = cheap.residuals(shape, &solved.x, asked.below, &shifted);
        // What is asked moves the colour's error as what is found does, the other way.
        let of_colour = asked
            .goal
            .colour
            .as_ref()
            .map(|colour| colour.slopes(std::array::from_fn(|channel| solved.reflection[channel][0])));
        let (mut from, mut slopes) = (0, Vec::new());
        for (wanted, roots) in asked.goal.wanted.iter().zip(&asked.goal.roots) {
            let mut towards = vec![0.0; residuals.values.len()];
            for ((to, wanted), root) in towards[from..].iter_mut().zip(wanted).zip(roots) {
                *to = -root * wanted;
            }
            if let (Some(of_colour), firsts) = (&of_colour, asked.goal.firsts()) {
                let slopes = of_colour[slopes.len()];
                towards[from] = 0.0;
                firsts.iter().zip(slopes).for_each(|(&at, slope)| towards[at] = -slope * wanted[0]);
            }
            from += wanted.len();
            slopes.push(gradient(&residuals.per_mm, &towards));
        }
        let pulled = shape.pulled(residuals, &solved.x);
        let none = || vec![vec![0.0; shape.len()]; slopes.len()];
        let Some(inverse) = damped_inverse(&pulled.per_mm, 0.0) else { return none() };
        // Limits that the fit presses against stay what they are; those it merely touches do too.
        let active: Vec<Vec<f64>> = asked.limits.active(&solved.x).map(|limit| limit.a.clone()).collect();
        let free = |slope: &Vec<f64>| -> Vec<f64> {
            let apply = |v: &[f64]| -> Vec<f64> { inverse.iter().map(|row| dot(row, v)).collect() };
            let mut step: Vec<f64> = apply(slope).into_iter().map(|x| -x).collect();
            // Kept on the limits one after another, until all hold.
            let pushes: Vec<Vec<f64>> = active.iter().map(|a| apply(a)).collect();
            for _ in 0..200 {
                let mut moved = 0.0_f64;
                for (a, push) in active.iter().zip(&pushes) {
                    let by = dot(a, &step) / dot(a, push).max(f64::MIN_POSITIVE);
                    step.iter_mut().zip(push).for_each(|(x, p)| *x -= by * p);
                    moved = push.iter().fold(moved, |most, p| most.max((by * p).abs()));
                }
                if moved < 1e-12 {
                    break;
                }
            }
            step
        };
        slopes.iter().map(free).collect()
    }
}

impl Goal {
    /// The objective of R̂.
    fn off(&self, reflection: &Spectra) -> f64 {
        let mut difference = less(reflection, &self.wanted);
        let Some(colour) = &self.colour else { return self.size(&difference) };
        let albedo = std::array::from_fn(|channel| colour.asked[channel] + difference[channel][0]);
        difference.iter_mut().for_each(|channel| channel[0] = 0.0);
        self.size(&difference) + colour.residuals(albedo).iter().map(|residual| residual * residual).sum::<f64>()
    }

    /// Weighted squares of a difference.
    fn size(&self, difference: &Spectra) -> f64 {
        let channel = |(d, roots): (&Vec<f64>, &Vec<f64>)| -> f64 {
            d.iter().zip(roots).map(|(d, root)| (root * d).powi(2)).sum()
        };
        difference.iter().zip(&self.roots).map(channel).sum()
    }
}

fn combined(a: &Spectra, b: &Spectra, of: impl Fn(f64, f64) -> f64 + Copy) -> Spectra {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| of(*a, *b)).collect()).collect()
}

fn less(a: &Spectra, b: &Spectra) -> Spectra {
    combined(a, b, |a, b| a - b)
}

fn more(a: &Spectra, b: &Spectra) -> Spectra {
    combined(a, b, |a, b| a + b)
}
