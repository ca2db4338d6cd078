//! Levenberg and Marquardt's method: the least sum of squared residuals r(x) near a start (Levenberg 1944, Marquardt
//! 1963).
//!
//! Each step solves (JᵀJ + damping) δ = −Jᵀr, J the slopes of the residuals. A step that lowers the sum is taken and
//! the damping falls; otherwise the damping rises until a step does, or none will. *Finds* the minimum of the valley it
//! starts in, no more.
//!
//! How the damped equations are solved and what keeps x in bounds is the caller's: one has limits on every parameter,
//! another sums that may not grow. Here stands when to try, to take, and to stop.

use super::positive_definite;

/// How a descent starts and ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Descent {
    /// Damping to start with; a tenth after a good step, ten times after a bad one.
    pub first_damping: f64,
    /// Gives up where no damping below this helps.
    pub most_damping: f64,
    /// A step that gains less than this share of the sum is the last.
    pub least_gain: f64,
}

/// What a descent may spend.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Budget {
    /// So many steps taken, however many were tried.
    Steps(usize),
    /// So many evaluations of the residuals, the start's among them.
    Evaluations(usize),
}

impl Descent {
    /// Descends from `start`. `sum` is what is lowered; `slopes` is asked once for every point that steps are tried
    /// from; `attempt` gives the point that a damping leads to, or `None` to stop where it stands.
    pub fn run<Point, Slopes>(
        &self,
        budget: Budget,
        start: Point,
        sum: impl Fn(&Point) -> f64,
        slopes: impl Fn(&Point) -> Slopes,
        mut attempt: impl FnMut(&Point, &Slopes, f64) -> Option<Point>,
    ) -> Point {
        let mut here = start;
        let mut damping = self.first_damping;
        let (mut steps, mut evaluations) = (0, 1);
        let spent = |steps: usize, evaluations: usize| match budget {
            Budget::Steps(most) => steps >= most,
            Budget::Evaluations(most) => evaluations >= most,
        };
        while !spent(steps, evaluations) {
            let (slopes, before) = (slopes(&here), sum(&here));
            let gain = loop {
                if spent(steps, evaluations) || !(damping < self.most_damping) {
                    return here;
                }
                let Some(there) = attempt(&here, &slopes, damping) else { return here };
                evaluations += 1;
                let after = sum(&there);
                if after < before {
                    here = there;
                    break before - after;
                }
                damping *= 10.0;
            };
            damping /= 10.0;
            steps += 1;
            if gain < self.least_gain * before {
                break;
            }
        }
        here
    }
}

/// a · b.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// JᵀJ from the slopes of all residuals, parameter after parameter.
pub(crate) fn curvature(slopes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    slopes.iter().map(|a| slopes.iter().map(|b| dot(a, b)).collect()).collect()
}

/// Jᵀr.
pub(crate) fn gradient(slopes: &[Vec<f64>], residuals: &[f64]) -> Vec<f64> {
    slopes.iter().map(|slope| dot(slope, residuals)).collect()
}

/// Share of the mean curvature that a parameter without any gets, so that the curvature can be inverted.
const FLOOR: f64 = 1e-9;

/// (JᵀJ + damping · diag)⁻¹; `None` where the parameters' effects cannot be told apart.
pub(crate) fn damped_inverse(slopes: &[Vec<f64>], damping: f64) -> Option<Vec<Vec<f64>>> {
    let n = slopes.len();
    let mut matrix = curvature(slopes);
    let mean = (0..n).map(|i| matrix[i][i]).sum::<f64>() / n as f64;
    (0..n).for_each(|i| matrix[i][i] += damping * matrix[i][i] + FLOOR * mean);
    positive_definite::inverse(matrix)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DESCENT: Descent = Descent { first_damping: 1e-3, most_damping: 1e6, least_gain: 1e-9 };

    /// The exponent of e^{ax} through points of one; `from` is where the search starts.
    fn exponent(from: f64, budget: Budget) -> (f64, usize) {
        let x = [0.0, 0.5, 1.0, 1.5_f64];
        let residuals = |a: &f64| x.map(|x| (a * x).exp() - (0.7 * x).exp());
        let tried = std::cell::Cell::new(0);
        let found = DESCENT.run(
            budget,
            from,
            |a| dot(&residuals(a), &residuals(a)),
            |a| {
                let slopes = [x.map(|x| x * (a * x).exp()).to_vec()];
                (curvature(&slopes)[0][0], gradient(&slopes, &residuals(a))[0])
            },
            |a, (curvature, gradient), damping| {
                tried.set(tried.get() + 1);
                Some(a - gradient / (curvature * (1.0 + damping)))
            },
        );
        (found, tried.get())
    }

    #[test]
    fn a_curve_comes_back_from_either_side() {
        for from in [-3.0, 0.0, 0.7, 3.0] {
            let (found, _) = exponent(from, Budget::Steps(60));
            assert!((found - 0.7).abs() < 1e-6, "{from}: {found}");
        }
    }

    #[test]
    fn a_budget_is_kept() {
        assert_eq!(exponent(3.0, Budget::Steps(0)), (3.0, 0));
        assert_eq!(exponent(3.0, Budget::Evaluations(1)), (3.0, 0));
        assert_eq!(exponent(3.0, Budget::Evaluations(4)).1, 3);
    }

    #[test]
    fn where_nothing_helps_it_stays() {
        let stays = DESCENT.run(Budget::Steps(5), 1.0, |x: &f64| *x, |_| (), |x, (), _| Some(x + 1.0));
        assert_eq!(stays, 1.0);
        assert_eq!(DESCENT.run(Budget::Steps(5), 1.0, |x: &f64| *x, |_| (), |_, (), _| None), 1.0);
    }
}
