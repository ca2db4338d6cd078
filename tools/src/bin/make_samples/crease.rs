//! Finding sharp creases of an implicit solid: quadric error functions (Ju, Losasso, Schaefer, Warren 2002,
//! *Dual Contouring of Hermite Data*, section 2.1) over ever smaller neighbourhoods.

use glam::{DMat3, DVec3};

use crate::shape::Figure;

/// Normals that differ by less, whatever the magnification, belong to a smooth surface (cosine of 25°).
const CREASE_COSINE: f64 = 0.906;
/// Eigenvalues below this part of the largest count as 0: the point is then free to move along that direction.
/// Dual contouring uses 0.1; the probes here lie all round the crease, so that 0.03 still ignores its curvature.
const RANK_CUTOFF: f64 = 0.03;
/// Each pass looks at a fourth of the previous neighbourhood; four passes reach 1/64, well inside any rounding.
const PASSES: usize = 4;

/// The point of a sharp crease nearest to `start` among those within `radius`; `None` where the surface is smooth.
pub fn crease_point(figure: &Figure, start: DVec3, radius: f64) -> Option<DVec3> {
    let mut point = start;
    let mut reach = radius;
    for _ in 0..PASSES {
        let samples = probe(figure, point, reach);
        let sharpest = samples.iter().flat_map(|a| samples.iter().map(move |b| a.1.dot(b.1))).fold(1.0, f64::min);
        if sharpest > CREASE_COSINE {
            return None;
        }
        point = minimise(&samples);
        reach /= 4.0;
    }
    (point.distance(start) <= radius).then_some(point)
}

/// Surface points round `centre` with their normals.
fn probe(figure: &Figure, centre: DVec3, reach: f64) -> Vec<(DVec3, DVec3)> {
    let mut samples = Vec::with_capacity(14);
    for code in 0..27 {
        let offset = DVec3::new(f64::from(code % 3 - 1), f64::from(code / 3 % 3 - 1), f64::from(code / 9 - 1));
        // The 6 axes and the 8 diagonals of a cube.
        if matches!(offset.length_squared() as i32, 1 | 3) {
            let p = figure.project(centre + offset.normalize() * reach, 1e-3 * reach);
            if p.distance(centre) < 2.0 * reach {
                samples.push((p, figure.normal(p)));
            }
        }
    }
    if samples.is_empty() {
        samples.push((centre, figure.normal(centre)));
    }
    samples
}

/// The point with the least sum of squared distances to the samples' tangent planes, nearest to their mean.
fn minimise(samples: &[(DVec3, DVec3)]) -> DVec3 {
    let mean = samples.iter().map(|s| s.0).sum::<DVec3>() / samples.len() as f64;
    let mut matrix = DMat3::ZERO;
    let mut right = DVec3::ZERO;
    for &(p, n) in samples {
        matrix += DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        right += n * n.dot(p - mean);
    }
    let (values, vectors) = eigen(matrix);
    let cutoff = RANK_CUTOFF * values.max_element();
    (0..3).filter(|&i| values[i] > cutoff).fold(mean, |p, i| {
        let axis = vectors.col(i);
        p + axis * (axis.dot(right) / values[i])
    })
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix by Jacobi rotations.
fn eigen(mut matrix: DMat3) -> (DVec3, DMat3) {
    let mut vectors = DMat3::IDENTITY;
    // Convergence is quadratic; six sweeps reach rounding for any 3×3 matrix.
    for _ in 0..6 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = matrix.col(q)[p];
            if off.abs() < 1e-300 {
                continue;
            }
            let theta = (matrix.col(q)[q] - matrix.col(p)[p]) / (2.0 * off);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let mut rotation = DMat3::IDENTITY;
            rotation.col_mut(p)[p] = c;
            rotation.col_mut(q)[q] = c;
            rotation.col_mut(q)[p] = s;
            rotation.col_mut(p)[q] = -s;
            matrix = rotation.transpose() * matrix * rotation;
            vectors *= rotation;
        }
    }
    (DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z), vectors)
}
