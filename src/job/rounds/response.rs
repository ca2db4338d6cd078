//! How far the print follows a correction.
//!
//! Light that is let in at one place comes out around it. Where corrections change within the width of a glow, beside
//! edges, in hollows and thin parts, the print follows them by half, or answers to its neighbours' in the end; on wide
//! flat parts by all of it. What the last correction did is seen in the round after: the change of ln printed over the
//! change of the factors, by least squares over all points, as a function of the [`Shape`]. The next one is divided by
//! it: once by single points, and once by means around places. What differs from point to point, against grain and contrast, the
//! print follows by less than what a whole face has in common; divided by the former, faces were corrected by twice
//! what they missed. On a rabbit in one colour a correction of 0.8 of a miss moves flat parts by 0.8, hollows by 0.65
//! and thin parts by 0.55, and the next one, of what is left, by 0.8, 0.5 and 0.45.
//!
//! *Fails by a little:* noise of a look is in the correction that follows it, and in the change from there, so that
//! small corrections, of flat parts in late rounds, seem to be followed by more than they are. There it changes
//! nothing, for no correction is divided by more than 1.

use super::{
    Followed,
    residual::{PLACES, around_alike, counts_grain},
    shape::{Sample, Shape},
};
use crate::{job::plan::ObjectPlan, numeric::positive_definite::NormalEquations, parallel};

/// A constant and [`Shape::near_far_hidden`].
const TERMS: usize = 4;
/// By how much what the print follows by is believed to differ from 1 before anything is seen, each term's factor.
const BELIEVED: f64 = 0.3;
/// Error of the fit itself, as a logarithm: beside it noise below counts little.
const OWN_ERROR: f64 = 0.05;
/// The print never follows by less, as far as a correction is concerned: corrections are at most twice the miss.
const LEAST: f64 = 0.4;

/// A place between two rounds.
#[derive(Debug, Clone, Copy)]
struct Step {
    shape: Shape,
    /// Change of the factor's logarithm.
    wanted: f64,
    /// Change of the printed albedo's logarithm, and the variance of that.
    seen: f64,
    variance: f64,
}

impl Step {
    /// Between two looks at a place whose factor changed by `wanted`. `None` where one is black.
    fn between(before: &Sample<'_>, now: &Sample<'_>, wanted: f64) -> Option<Self> {
        let noise = |sample: &Sample<'_>| sample.variance / (sample.printed * sample.printed);
        let told = before.printed > 0.0 && now.printed > 0.0;
        told.then(|| Self {
            shape: now.shape,
            wanted,
            seen: libm::log(now.printed / before.printed),
            variance: noise(before) + noise(now),
        })
    }
}

/// How far the print follows one factor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Responses {
    /// Where it changes alike over a millimetre or two.
    of_means: Response,
    /// Where it differs from point to point, as what is asked for against grain and contrast does.
    of_points: Response,
}

/// Seen over wanted, as a function of shape.
#[derive(Debug, Clone, Copy)]
struct Response([f64; TERMS]);

impl Responses {
    /// The print follows by all of it.
    pub const WHOLE: Self = Self { of_means: Response::WHOLE, of_points: Response::WHOLE };

    /// Of one factor of an object, from what came of its values in one round and in the next.
    pub fn of(plan: &ObjectPlan, channel: usize, before: Option<&Followed<'_>>, now: &Followed<'_>) -> Self {
        let Some(before) = before else { return Self::WHOLE };
        let all = now.sums.len();
        let step = |[before, now]: [Option<(Sample<'_>, f64)>; 2]| {
            let [(before, reached_before), (now, reached)] = [before?, now?];
            Step::between(&before, &now, reached - reached_before)
        };
        let single = |at: usize| step([before, now].map(|round| at_point(round, at, channel)));
        let of_points = match counts_grain(&now.sums) || plan.point_a_texel_mm.is_some() {
            true => Response::fit((0..all).filter_map(single)),
            false => Response::WHOLE,
        };
        if plan.point_a_texel_mm.is_some() {
            return Self { of_means: of_points, of_points };
        }
        let places: Vec<usize> = (0..all).step_by(all.div_ceil(PLACES).max(1)).collect();
        let steps = parallel::map_all(&places, |&at| step([before, now].map(|round| around(plan, round, at, channel))));
        Self { of_means: Response::fit(steps.into_iter().flatten()), of_points }
    }

    #[cfg(test)]
    pub fn with(of_means: f64, of_points: f64) -> Self {
        let of = |by: f64| Response([by, 0.0, 0.0, 0.0]);
        Self { of_means: of(of_means), of_points: of(of_points) }
    }

    /// By what a correction at a place of a shape must be divided, 0.4 to 1: one that is alike around it, and one that
    /// is the point's own.
    pub fn at(&self, shape: &Shape) -> [f64; 2] {
        [self.of_means, self.of_points].map(|response| response.at(shape))
    }
}

/// What is seen at a point, and the factor that was reached there.
fn at_point<'a>(round: &Followed<'a>, at: usize, channel: usize) -> Option<(Sample<'a>, f64)> {
    Some((round.sums[at].as_ref()?[channel], round.reached[at][channel]))
}

/// The same in the mean of places of like shape around a point.
fn around<'a>(plan: &ObjectPlan, round: &Followed<'a>, at: usize, channel: usize) -> Option<(Sample<'a>, f64)> {
    let (here, _) = at_point(round, at, channel)?;
    let mut mean = Sample { printed: 0.0, variance: 0.0, ..here };
    let (mut weights, mut reached) = (0.0, 0.0);
    around_alike(&plan.points, &round.sums, at, |other, samples, weight| {
        weights += weight;
        reached += weight * round.reached[other][channel];
        mean.printed += weight * samples[channel].printed;
        mean.variance += weight * weight * samples[channel].variance;
    });
    mean.printed /= weights;
    mean.variance /= weights * weights;
    (weights > 0.0).then_some((mean, reached / weights))
}

impl Response {
    const WHOLE: Self = Self([1.0, 0.0, 0.0, 0.0]);

    fn fit(steps: impl IntoIterator<Item = Step>) -> Self {
        let mut equations = NormalEquations::new(TERMS);
        for Step { shape, wanted, seen, variance } in steps {
            let weight = shape.lit() / (variance + OWN_ERROR * OWN_ERROR);
            equations.add(&terms(&shape).map(|term| wanted * term), seen - wanted, weight);
        }
        let Some(beyond) = equations.solve(|_| 1.0 / (BELIEVED * BELIEVED)) else { return Self::WHOLE };
        Self(std::array::from_fn(|n| Self::WHOLE.0[n] + beyond[n]))
    }

    fn at(&self, shape: &Shape) -> f64 {
        self.0.iter().zip(terms(shape)).map(|(factor, term)| factor * term).sum::<f64>().clamp(LEAST, 1.0)
    }
}

fn terms(shape: &Shape) -> [f64; TERMS] {
    let [near, far, hidden] = shape.near_far_hidden();
    [1.0, near, far, hidden]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps whose print follows by all of it on flat parts, by less the more light finds its way out.
    fn steps(scatter: f64) -> impl Iterator<Item = Step> {
        (0..5000).map(move |n| {
            let part = |step: f64| (f64::from(n) * step).fract();
            let far = 0.5 * part(0.618);
            let wanted = 0.5 * (part(0.755) - 0.5);
            let noise = if n % 2 == 0 { scatter } else { -scatter };
            let shape = Shape::with([0.0, far, 0.0]);
            Step { shape, wanted, seen: (1.0 - far) * wanted + noise, variance: scatter * scatter }
        })
    }

    #[test]
    fn what_the_print_follows_by_is_found_under_noise() {
        for scatter in [0.0, 0.1] {
            let response = Response::fit(steps(scatter));
            for far in [0.0, 0.2, 0.4] {
                let found = response.at(&Shape::with([0.0, far, 0.0]));
                assert!((found - (1.0 - far)).abs() < 0.06, "{found} at {far}, noise {scatter}");
            }
        }
    }

    #[test]
    fn noisy_points_count_little() {
        let flat = Shape::with([0.0; 3]);
        let noisy = (0..5000).map(|_| Step { shape: flat, wanted: 0.2, seen: 3.0, variance: 25.0 });
        let still = (0..5000).map(|_| Step { shape: flat, wanted: 0.2, seen: 0.1, variance: 0.01 });
        let found = Response::fit(noisy.chain(still)).at(&flat);
        assert!((found - 0.5).abs() < 0.05, "{found}");
    }

    #[test]
    fn without_steps_the_print_follows_by_all_of_it_and_never_by_too_little() {
        let flat = Shape::with([0.0; 3]);
        assert_eq!(Response::fit([]).at(&flat), 1.0);
        let against = (0..5000).map(|_| Step { shape: flat, wanted: 0.1, seen: -0.1, variance: 0.01 });
        assert_eq!(Response::fit(against).at(&flat), LEAST);
    }
}
