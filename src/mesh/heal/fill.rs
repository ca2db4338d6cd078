//! Caps for boundary loops.
//!
//! Loops are triangulated with least total area by dynamic programming over all sub-loops (Barequet and Sharir,
//! *Filling gaps in the boundary of a polyhedron*, CAGD 1995), which fills a flat loop without overlap, convex or not.
//! The method is cubic; loops beyond [`MAX_EXACT`] corners, and whatever comes after [`BUDGET`] is spent, get a fan
//! around their centroid, which has the right boundary too but may fold over itself if the loop is not star-shaped.

use glam::DVec3;

use super::area;
use super::boundary::Hole;
use crate::parallel;

/// Longest loop filled with least area: 300³/6 triangles are 4.5 million, about 30 ms.
const MAX_EXACT: usize = 300;

/// Triangles that all loops together may try: about half a second.
const BUDGET: usize = 100_000_000;

/// A triangle that closes a hole, and the shell it belongs to.
pub(super) struct Cap {
    pub(super) shell: u32,
    pub(super) corners: [DVec3; 3],
}

/// Triangles whose boundary is the loops'. Their corners are the mesh's own positions, bit for bit, and centroids.
pub(super) fn fill(positions: &[DVec3], holes: &[Hole]) -> Vec<Cap> {
    let mut spent = 0;
    let exact: Vec<bool> = holes
        .iter()
        .map(|hole| {
            let n = hole.vertices.len();
            let cost = n * n * n / 6;
            let affordable = n <= MAX_EXACT && spent + cost <= BUDGET;
            spent += if affordable { cost } else { 0 };
            affordable
        })
        .collect();
    let filled: Vec<Vec<Cap>> = parallel::map(holes.len(), |n| {
        let hole = &holes[n];
        let rim: Vec<DVec3> = hole.vertices.iter().map(|&v| positions[v as usize]).collect();
        let triangles = if exact[n] { least_area(&rim) } else { fan(&rim) };
        triangles.into_iter().map(|corners| Cap { shell: hole.shell, corners }).collect()
    });
    filled.into_iter().flatten().collect()
}

/// Triangles between the centroid and every edge.
fn fan(rim: &[DVec3]) -> Vec<[DVec3; 3]> {
    let centroid = rim.iter().sum::<DVec3>() / rim.len() as f64;
    (0..rim.len()).map(|i| [rim[i], rim[(i + 1) % rim.len()], centroid]).collect()
}

/// The triangulation of least area that uses no other corners; among equals the one whose apexes come first.
fn least_area(rim: &[DVec3]) -> Vec<[DVec3; 3]> {
    let n = rim.len();
    // For the sub-loop from i to j: its least area, and the apex of the triangle on its closing edge.
    let mut best = vec![0.0f64; n * n];
    let mut apex = vec![0u32; n * n];
    for span in 2..n {
        for i in 0..n - span {
            let j = i + span;
            let mut least = f64::INFINITY;
            for k in i + 1..j {
                let total = best[i * n + k] + best[k * n + j] + area([rim[i], rim[k], rim[j]]);
                if total < least {
                    least = total;
                    apex[i * n + j] = k as u32;
                }
            }
            best[i * n + j] = least;
        }
    }
    let mut triangles = Vec::with_capacity(n - 2);
    let mut open = vec![(0, n - 1)];
    while let Some((i, j)) = open.pop() {
        if j > i + 1 {
            let k = apex[i * n + j] as usize;
            triangles.push([rim[i], rim[k], rim[j]]);
            open.extend([(i, k), (k, j)]);
        }
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_loop_that_is_not_convex_is_filled_without_overlap() {
        // An L of area 3: the centroid's fan would leave it.
        let rim = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)].map(|(x, y)| DVec3::new(x.into(), y.into(), 5.0));
        let triangles = least_area(&rim);
        assert_eq!(triangles.len(), 4);
        assert!((triangles.iter().copied().map(area).sum::<f64>() - 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_loop_of_three_is_the_triangle() {
        let rim = [DVec3::X, DVec3::Y, DVec3::Z];
        assert_eq!(least_area(&rim), [rim]);
    }
}
