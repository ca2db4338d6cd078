//! Thicknesses of one sequence of resins: Levenberg and Marquardt's method with linear constraints.

use super::polytope::Polytope;
use crate::numeric::least_squares::{Budget, Descent, curvature, dot, gradient};

/// Residuals √w (R̂ − R̂_t) and their slopes per mm, layer after layer.
pub(in crate::search) struct Residuals {
    pub(in crate::search) values: Vec<f64>,
    pub(in crate::search) per_mm: Vec<Vec<f64>>,
}

impl Residuals {
    pub(in crate::search) fn objective(&self) -> f64 {
        dot(&self.values, &self.values)
    }
}

/// Where a fit ended.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::search) struct Fit {
    pub(in crate::search) mm: Vec<f64>,
    pub(in crate::search) objective: f64,
}

/// Damping is a share of H's diagonal.
const DESCENT: Descent = Descent { first_damping: 1e-3, most_damping: 1e6, least_gain: 1e-3 };
/// Share of the mean curvature that a layer without any gets, so that H can be inverted.
const FLOOR: f64 = 1e-9;

/// Lowers the objective from `mm`, brought within the constraints first, by at most `steps` evaluations. `None` where
/// nothing keeps the constraints.
pub(in crate::search) fn fit(
    mm: &[f64],
    polytope: &Polytope,
    steps: usize,
    residuals: impl Fn(&[f64]) -> Residuals,
) -> Option<Fit> {
    let moved = |mm: &[f64], step: &[f64]| -> Vec<f64> { mm.iter().zip(step).map(|(h, d)| h + d).collect() };
    let at = |mm: Vec<f64>| (residuals(&mm), mm);
    // Slopes without a sense end the fit without a result.
    let mut senseless = false;
    let (here, mm) = DESCENT.run(
        Budget::Evaluations(steps),
        at(polytope.nearest(mm)?),
        |(here, _)| here.objective(),
        |(here, _)| gradient(&here.per_mm, &here.values),
        |(here, mm), gradient, damping| {
            let inverse = damped_inverse(&here.per_mm, damping);
            senseless |= inverse.is_none();
            Some(at(moved(mm, &polytope.step(mm, &inverse?, gradient)?)))
        },
    );
    (!senseless).then(|| Fit { objective: here.objective(), mm })
}

impl Residuals {
    /// By how much the objective would rise were a layer left out and the others fitted anew, to second order: h² /
    /// (H⁻¹)_ii, after Hassibi and Stork 1992. `None` where the layers' effects cannot be told apart.
    pub(super) fn loss_without(&self, mm: &[f64]) -> Option<Vec<f64>> {
        let inverse = damped_inverse(&self.per_mm, 0.0)?;
        Some(mm.iter().enumerate().map(|(i, h)| h * h / inverse[i][i]).collect())
    }
}

/// (JᵀJ + damping · diag)⁻¹ by Gauss and Jordan's elimination with pivots on the diagonal: the matrix is positive
/// definite.
pub(in crate::search) fn damped_inverse(per_mm: &[Vec<f64>], damping: f64) -> Option<Vec<Vec<f64>>> {
    let n = per_mm.len();
    let mut matrix = curvature(per_mm);
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
