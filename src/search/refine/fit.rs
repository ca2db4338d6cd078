//! Thicknesses of one sequence of resins: Levenberg and Marquardt's method with linear constraints.

use super::polytope::{Polytope, dot};

/// Residuals √w (R̂ − R̂_t) and their slopes per mm, layer after layer.
pub(super) struct Residuals {
    pub(super) values: Vec<f64>,
    pub(super) per_mm: Vec<Vec<f64>>,
}

impl Residuals {
    pub(super) fn objective(&self) -> f64 {
        dot(&self.values, &self.values)
    }
}

/// Where a fit ended.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fit {
    pub(super) mm: Vec<f64>,
    pub(super) objective: f64,
}

/// Damping to start with, as a share of H's diagonal; a tenth after a good step, ten times after a bad one.
const FIRST_DAMPING: f64 = 1e-3;
/// Gives up when no damping helps.
const MOST_DAMPING: f64 = 1e6;
/// A step that gains less than this share of the objective is the last.
const LEAST_GAIN: f64 = 1e-3;
/// Share of the mean curvature that a layer without any gets, so that H can be inverted.
const FLOOR: f64 = 1e-9;

/// Lowers the objective from `mm`, brought within the constraints first, by at most `steps` evaluations. `None` where nothing keeps
/// the constraints.
pub(super) fn fit(
    mm: &[f64],
    polytope: &Polytope,
    steps: usize,
    residuals: impl Fn(&[f64]) -> Residuals,
) -> Option<Fit> {
    let n = mm.len();
    let identity: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| if i == j { 1.0 } else { 0.0 }).collect()).collect();
    let inside = polytope.step(mm, &identity, &vec![0.0; n])?;
    let mut mm: Vec<f64> = mm.iter().zip(inside).map(|(h, d)| h + d).collect();
    let mut here = residuals(&mm);
    let mut damping = FIRST_DAMPING;
    let mut evaluations = 1;
    while evaluations < steps && damping < MOST_DAMPING {
        let gradient: Vec<f64> = here.per_mm.iter().map(|slope| dot(slope, &here.values)).collect();
        let Some(step) = polytope.step(&mm, &damped_inverse(&here.per_mm, damping)?, &gradient) else { break };
        let there: Vec<f64> = mm.iter().zip(&step).map(|(h, d)| h + d).collect();
        let next = residuals(&there);
        evaluations += 1;
        let (before, after) = (here.objective(), next.objective());
        if after < before {
            (mm, here) = (there, next);
            damping /= 10.0;
            if before - after < LEAST_GAIN * before {
                break;
            }
        } else {
            damping *= 10.0;
        }
    }
    Some(Fit { objective: here.objective(), mm })
}

impl Residuals {
    /// JᵀJ.
    pub(super) fn curvature(&self) -> Vec<Vec<f64>> {
        self.per_mm.iter().map(|a| self.per_mm.iter().map(|b| dot(a, b)).collect()).collect()
    }

    /// By how much the objective would rise were a layer left out and the others fitted anew, to second order: h² / (H⁻¹)_ii, after Hassibi
    /// and Stork 1992. `None` where the layers' effects cannot be told apart.
    pub(super) fn loss_without(&self, mm: &[f64]) -> Option<Vec<f64>> {
        let inverse = damped_inverse(&self.per_mm, 0.0)?;
        Some(mm.iter().enumerate().map(|(i, h)| h * h / inverse[i][i]).collect())
    }
}

/// (JᵀJ + damping · diag)⁻¹ by Gauss and Jordan's elimination with pivots on the diagonal: the matrix is positive definite.
fn damped_inverse(per_mm: &[Vec<f64>], damping: f64) -> Option<Vec<Vec<f64>>> {
    let n = per_mm.len();
    let mut matrix: Vec<Vec<f64>> = per_mm.iter().map(|a| per_mm.iter().map(|b| dot(a, b)).collect()).collect();
    let mean = (0..n).map(|i| matrix[i][i]).sum::<f64>() / n as f64;
    let mut inverse: Vec<Vec<f64>> = vec![vec![0.0; n]; n];
    for i in 0..n {
        matrix[i][i] += damping * matrix[i][i] + FLOOR * mean;
        inverse[i][i] = 1.0;
    }
    for column in 0..n {
        let pivot = matrix[column][column];
        if !(pivot.is_finite() && pivot > 0.0) {
            return None;
        }
        for values in [&mut matrix[column], &mut inverse[column]] {
            values.iter_mut().for_each(|value| *value /= pivot);
        }
        let (pivot_row, inverse_row) = (matrix[column].clone(), inverse[column].clone());
        for row in (0..n).filter(|&row| row != column) {
            let factor = matrix[row][column];
            for (values, pivots) in [(&mut matrix[row], &pivot_row), (&mut inverse[row], &inverse_row)] {
                values.iter_mut().zip(pivots).for_each(|(value, pivot)| *value -= factor * pivot);
            }
        }
    }
    Some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::SearchOptions;

    /// Distances to three points on a line, squared: the fit is their weighted mean, unless a limit keeps it away.
    #[test]
    fn a_known_minimum_is_found() {
        let options = SearchOptions { max_thickness_mm: 4.0, ..SearchOptions::default() };
        let polytope = Polytope::new(&[0, 1], &options, 0.1).unwrap();
        let towards = |goal: [f64; 2]| {
            move |mm: &[f64]| Residuals {
                values: vec![mm[0].exp() - goal[0].exp(), 3.0 * (mm[1] - goal[1]) + mm[0] - goal[0]],
                per_mm: vec![vec![mm[0].exp(), 1.0], vec![0.0, 3.0]],
            }
        };
        let free = fit(&[1.0, 1.0], &polytope, 50, towards([0.5, 2.0])).unwrap();
        assert!((free.mm[0] - 0.5).abs() < 1e-6 && (free.mm[1] - 2.0).abs() < 1e-6, "{free:?}");
        let pressed = fit(&[1.0, 1.0], &polytope, 50, towards([-1.0, 2.0])).unwrap();
        assert!((pressed.mm[0] - 0.1).abs() < 1e-9, "{pressed:?}");
        let outside = fit(&[9.0, 9.0], &polytope, 50, towards([0.5, 2.0])).unwrap();
        assert!((outside.mm[0] - 0.5).abs() < 1e-6, "{outside:?}");
    }
}
