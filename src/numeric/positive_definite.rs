//! Small systems of equations whose matrix is symmetric and positive definite, as normal equations are.
//!
//! Gauss's elimination with pivots on the diagonal: of such a matrix it needs no exchange of rows (Higham 2002, chapter
//! 10). Matrices are rows of rows; a few unknowns, so that no library's call would pay.

/// x with `matrix` x = `right`. `None` where a pivot is not above `least_pivot`: not positive definite, or too near it.
pub(crate) fn solve(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>, least_pivot: f64) -> Option<Vec<f64>> {
    let n = right.len();
    for column in 0..n {
        if !is_pivot(matrix[column][column], least_pivot) {
            return None;
        }
        for row in column + 1..n {
            let factor = matrix[row][column] / matrix[column][column];
            let (above, below) = matrix.split_at_mut(row);
            below[0].iter_mut().zip(&above[column]).for_each(|(value, pivot)| *value -= factor * pivot);
            right[row] -= factor * right[column];
        }
    }
    for row in (0..n).rev() {
        let known: f64 = (row + 1..n).map(|i| matrix[row][i] * right[i]).sum();
        right[row] = (right[row] - known) / matrix[row][row];
    }
    Some(right)
}

/// The normal equations of weighted least squares, added up over what is observed.
pub(crate) struct NormalEquations {
    matrix: Vec<Vec<f64>>,
    right: Vec<f64>,
}

impl NormalEquations {
    /// Of so many unknowns, with nothing observed.
    pub fn new(unknowns: usize) -> Self {
        Self { matrix: vec![vec![0.0; unknowns]; unknowns], right: vec![0.0; unknowns] }
    }

    /// That the unknowns times `terms` are `value`, which counts `weight` times.
    pub fn add(&mut self, terms: &[f64], value: f64, weight: f64) {
        for (row, (right, term)) in self.matrix.iter_mut().zip(self.right.iter_mut().zip(terms)) {
            row.iter_mut().zip(terms).for_each(|(sum, other)| *sum += weight * term * other);
            *right += weight * term * value;
        }
    }

    /// The unknowns, each pulled to 0 by a weight that is given of the weight it has been observed with. `None` where
    /// they are not told.
    pub fn solve(self, pull: impl Fn(f64) -> f64) -> Option<Vec<f64>> {
        self.solve_above(0.0, pull)
    }

    /// [`Self::solve`]; `None` too where a pivot is not above `least_pivot`.
    pub fn solve_above(mut self, least_pivot: f64, pull: impl Fn(f64) -> f64) -> Option<Vec<f64>> {
        self.matrix.iter_mut().enumerate().for_each(|(n, row)| row[n] += pull(row[n]));
        solve(self.matrix, self.right, least_pivot)
    }
}

/// The inverse, by Gauss and Jordan's elimination. `None` where the matrix is not positive definite.
pub(crate) fn inverse(mut matrix: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    let n = matrix.len();
    let mut inverse = vec![vec![0.0; n]; n];
    (0..n).for_each(|i| inverse[i][i] = 1.0);
    for column in 0..n {
        let pivot = matrix[column][column];
        if !is_pivot(pivot, 0.0) {
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

fn is_pivot(value: f64, least: f64) -> bool {
    value.is_finite() && value > least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::least_squares::dot;

    /// Hilbert's matrix, and its inverse, which is of whole numbers.
    const HILBERT: [[f64; 3]; 3] = [[1.0, 0.5, 1.0 / 3.0], [0.5, 1.0 / 3.0, 0.25], [1.0 / 3.0, 0.25, 0.2]];
    const INVERSE: [[f64; 3]; 3] = [[9.0, -36.0, 30.0], [-36.0, 192.0, -180.0], [30.0, -180.0, 180.0]];

    fn rows(matrix: [[f64; 3]; 3]) -> Vec<Vec<f64>> {
        matrix.iter().map(|row| row.to_vec()).collect()
    }

    #[test]
    fn a_known_system_is_solved() {
        let inverse = inverse(rows(HILBERT)).unwrap();
        let x = solve(rows(HILBERT), vec![1.0, -2.0, 0.5], 0.0).unwrap();
        for (row, (expected, x)) in inverse.iter().zip(INVERSE.iter().zip(x)) {
            assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{inverse:?}");
            assert!((x - dot(expected, &[1.0, -2.0, 0.5])).abs() < 1e-9, "{x}");
        }
    }

    #[test]
    fn what_is_observed_is_told_and_pulled_to_nothing() {
        let observed = || {
            let mut equations = NormalEquations::new(2);
            for (terms, weight) in [([1.0, 0.0], 2.0), ([1.0, 1.0], 0.5), ([1.0, 2.0], 4.0)] {
                equations.add(&terms, 3.0 * terms[0] - terms[1], weight);
            }
            equations
        };
        let exact = observed().solve(|_| 0.0).unwrap();
        assert!((exact[0] - 3.0).abs() < 1e-12 && (exact[1] + 1.0).abs() < 1e-12, "{exact:?}");
        assert!(observed().solve(|weight| 1e6 * weight).unwrap().iter().all(|x| x.abs() < 1e-5));
        assert_eq!(NormalEquations::new(1).solve(|_| 0.0), None);
    }

    #[test]
    fn what_is_not_positive_definite_has_no_answer() {
        for bad in [vec![vec![1.0, 2.0], vec![2.0, 1.0]], vec![vec![0.0]], vec![vec![f64::NAN]]] {
            assert_eq!(inverse(bad.clone()), None);
            assert_eq!(solve(bad.clone(), vec![1.0; bad.len()], 0.0), None);
        }
        assert_eq!(solve(vec![vec![1e-13]], vec![1.0], 1e-12), None);
    }
}
