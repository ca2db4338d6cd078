//! How far the print follows a correction.
//!
//! Light that is let in at one place comes out around it. Where corrections change within the width of a glow, beside
//! edges, in hollows and thin parts, the print follows them by half, or answers to its neighbours' in the end; on wide
//! flat parts by all of it. What the last correction did is seen in the round after: the change of ln printed over the
//! change of the factors, by least squares over all points, as a function of the [`Shape`]. The next one is divided by
//! it.

use super::{
    Factors,
    residual::{Seen, sums},
    shape::Shape,
};
use crate::{job::plan::ObjectPlan, numeric::positive_definite};

/// A constant and [`Shape::ways_out`].
const TERMS: usize = 4;
/// Weight of the belief that the print follows by all of it, in squares of factors: the variance of a point's logarithm,
/// 0.12², over that of what the print follows by, 0.3².
const BELIEF: f64 = 0.16;
/// The print never follows by less, as far as a correction is concerned: it would be mostly noise.
const LEAST: f64 = 0.4;

/// A point between two rounds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub shape: Shape,
    /// Change of the factor's logarithm.
    pub wanted: f64,
    /// Change of the printed albedo's logarithm.
    pub seen: f64,
}

/// Seen over wanted, as a function of shape.
#[derive(Debug, Clone, Copy)]
pub(super) struct Response([f64; TERMS]);

impl Response {
    /// The print follows by all of it.
    pub const WHOLE: Self = Self([1.0, 0.0, 0.0, 0.0]);

    /// Of each factor of an object, from what was seen under the factors of one round and of the next.
    pub fn of(
        plan: &ObjectPlan,
        before: Option<(&[Option<Seen>], &Factors)>,
        now: (&[Option<Seen>], &Factors),
    ) -> Vec<Self> {
        let Some(before) = before else { return vec![Self::WHOLE; plan.factors()] };
        let sums_of = |(seen, _): (&[Option<Seen>], &Factors)| -> Vec<_> {
            seen.iter().map(|seen| seen.as_ref().map(|seen| sums(plan, seen))).collect()
        };
        let printed: Vec<_> = sums_of(before).into_iter().zip(sums_of(now)).collect();
        let of = |channel: usize| {
            let steps = printed.iter().enumerate().filter_map(|(at, (before_sums, now_sums))| {
                let (then, now_sample) = (before_sums.as_ref()?[channel], now_sums.as_ref()?[channel]);
                let seen = libm::log(now_sample.printed / then.printed);
                let wanted = now.1[at][channel] - before.1[at][channel];
                (seen.is_finite()).then_some(Step { shape: now_sample.shape, wanted, seen })
            });
            Self::fit(steps)
        };
        (0..plan.factors()).map(of).collect()
    }

    /// Fitted to what was seen.
    pub fn fit(steps: impl IntoIterator<Item = Step>) -> Self {
        let (mut matrix, mut right) = (vec![vec![0.0; TERMS]; TERMS], vec![0.0; TERMS]);
        for Step { shape, wanted, seen } in steps {
            let terms = terms(&shape);
            for (row, (right, term)) in matrix.iter_mut().zip(right.iter_mut().zip(terms)) {
                row.iter_mut().zip(terms).for_each(|(sum, other)| *sum += wanted * wanted * term * other);
                *right += wanted * term * (seen - wanted);
            }
        }
        matrix.iter_mut().enumerate().for_each(|(n, row)| row[n] += BELIEF);
        let Some(beyond) = positive_definite::solve(matrix, right, 0.0) else { return Self::WHOLE };
        Self(std::array::from_fn(|n| Self::WHOLE.0[n] + beyond[n]))
    }

    /// By what a correction at a place of a shape must be divided: 0.4 to 1.
    pub fn at(&self, shape: &Shape) -> f64 {
        self.0.iter().zip(terms(shape)).map(|(factor, term)| factor * term).sum::<f64>().clamp(LEAST, 1.0)
    }
}

fn terms(shape: &Shape) -> [f64; TERMS] {
    let [near, far, hidden] = shape.ways_out();
    [1.0, near, far, hidden]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps whose print follows by all of it on flat parts, by less the more light finds its way out.
    fn steps(scatter: f64) -> impl Iterator<Item = Step> {
        (0..5000).map(move |n| {
            let part = |step: f64| (f64::from(n) * step).fract();
            let shape = Shape::with_ways_out([0.0, 0.5 * part(0.618), 0.0]);
            let wanted = 0.5 * (part(0.755) - 0.5);
            let noise = if n % 2 == 0 { scatter } else { -scatter };
            let follows = 1.0 - shape.ways_out()[1];
            Step { shape, wanted, seen: follows * wanted + noise }
        })
    }

    #[test]
    fn what_the_print_follows_by_is_found_under_noise() {
        for scatter in [0.0, 0.1] {
            let response = Response::fit(steps(scatter));
            for far in [0.0, 0.2, 0.4] {
                let found = response.at(&Shape::with_ways_out([0.0, far, 0.0]));
                assert!((found - (1.0 - far)).abs() < 0.06, "{found} at {far}, noise {scatter}");
            }
        }
    }

    #[test]
    fn without_steps_the_print_follows_by_all_of_it_and_never_by_too_little() {
        let flat = Shape::with_ways_out([0.0; 3]);
        assert_eq!(Response::fit([]).at(&flat), 1.0);
        let against = (0..5000).map(|_| Step { shape: flat, wanted: 0.1, seen: -0.1 });
        assert_eq!(Response::fit(against).at(&flat), LEAST);
    }
}
