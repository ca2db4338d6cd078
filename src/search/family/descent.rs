//! Down a narrow, bent valley between linear constraints.
//!
//! The albedo weighs so much that what meets it is a curved surface, along which the rest of the profile is fitted. A
//! step of Levenberg and Marquardt's method leaves that surface to second order. So where a step gains less than it
//! promised, a second one follows with the same slopes but the residuals found there (a chord step, Shamanskii 1967),
//! which leads back.

use crate::{
    numeric::least_squares::{curvature, dot, gradient},
    search::refine::{
        fit::{Residuals, damped_inverse},
        polytope::Polytope,
    },
};

/// Where a descent ended.
pub(super) struct Ended {
    pub x: Vec<f64>,
    pub residuals: Residuals,
}

/// Damping is a share of the curvature of each number.
const FIRST_DAMPING: f64 = 1e-5;
const LEAST_DAMPING: f64 = 1e-9;
const MOST_DAMPING: f64 = 1e3;
/// Share of the gain that was promised below which a step is mended.
const AS_PROMISED: f64 = 0.75;
/// Such steps at most.
const MENDS: usize = 1;
/// A step that gains less than this share of the sum is the last.
const LEAST_GAIN: f64 = 1e-3;

/// Lowers Σ r² from `x`, brought within the limits first, by at most `evaluations`. `None` where nothing keeps them.
pub(super) fn descend(
    x: &[f64],
    limits: &Polytope,
    evaluations: usize,
    residuals: impl Fn(&[f64]) -> Residuals,
) -> Option<Ended> {
    let moved = |x: &[f64], step: &[f64]| -> Vec<f64> { x.iter().zip(step).map(|(x, d)| x + d).collect() };
    let x = limits.nearest(x)?;
    let mut here = Ended { residuals: residuals(&x), x };
    let mut left = evaluations.saturating_sub(1);
    let mut damping = FIRST_DAMPING;
    while left > 0 && damping <= MOST_DAMPING {
        let before = here.residuals.objective();
        let slopes = &here.residuals.per_mm;
        let downhill = gradient(slopes, &here.residuals.values);
        let Some(inverse) = damped_inverse(slopes, damping) else { break };
        let Some(step) = limits.exact_step(&here.x, &inverse, &downhill) else {
            damping *= 10.0;
            continue;
        };
        let bend: f64 = curvature(slopes).iter().zip(&step).map(|(row, d)| d * dot(row, &step)).sum();
        let promised = -2.0 * dot(&downhill, &step) - bend;
        if !(promised > 1e-3 * LEAST_GAIN * before) {
            break;
        }
        let mut there = at(moved(&here.x, &step), &residuals);
        left -= 1;
        for _ in 0..MENDS {
            if left == 0 || before - there.residuals.objective() >= AS_PROMISED * promised {
                break;
            }
            let downhill = gradient(slopes, &there.residuals.values);
            let Some(back) = limits.exact_step(&there.x, &inverse, &downhill) else { break };
            let mended = at(moved(&there.x, &back), &residuals);
            left -= 1;
            if !(mended.residuals.objective() < there.residuals.objective()) {
                break;
            }
            there = mended;
        }
        let gain = before - there.residuals.objective();
        if gain > 0.0 {
            here = there;
            damping = (0.1 * damping).max(LEAST_DAMPING);
            if gain < LEAST_GAIN * before {
                break;
            }
        } else {
            damping *= 30.0;
        }
    }
    Some(here)
}

fn at(x: Vec<f64>, residuals: impl Fn(&[f64]) -> Residuals) -> Ended {
    Ended { residuals: residuals(&x), x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::refine::polytope::Constraint;

    fn disc(x: &[f64]) -> Residuals {
        // A stiff circle, and a goal on it to the right.
        let (r, stiff) = (x[0].hypot(x[1]), 20.0);
        Residuals {
            values: vec![stiff * (r - 1.0), x[0] - 1.0, x[1]],
            per_mm: vec![vec![stiff * x[0] / r, 1.0, 0.0], vec![stiff * x[1] / r, 0.0, 1.0]],
        }
    }

    #[test]
    fn a_bent_valley_is_followed_to_its_end() {
        let anywhere = Polytope::of(vec![Constraint { a: vec![0.0, 1.0], b: 0.0 }]);
        let ended = descend(&[0.5, 0.9], &anywhere, 60, disc).unwrap();
        assert!((ended.x[0] - 1.0).abs() < 1e-2 && ended.x[1].abs() < 2e-2, "{:?}", ended.x);
        let right =
            Polytope::of(vec![Constraint { a: vec![-1.0, 0.0], b: -0.6 }, Constraint { a: vec![0.0, 1.0], b: 0.1 }]);
        let ended = descend(&[0.1, 1.0], &right, 60, disc).unwrap();
        assert!((ended.x[0] - 0.6).abs() < 1e-3 && (ended.x[1] - 0.7969).abs() < 1e-3, "{:?}", ended.x);
    }
}
