//! Corners that miss each other by rounding: writers that compute each triangle's corners by themselves, or print too
//! few digits, leave cracks along every edge.
//!
//! Only corners on open edges are joined, and only if fewer edges are open then, so that a mesh without cracks stays as
//! it is. A corner moves to the one of lowest index among those that it is joined with.

use std::collections::HashMap;

use glam::{DVec3, I64Vec3};

use super::edges::Edges;
use super::{HealthReport, TriangleMesh};
use crate::{disjoint_sets::DisjointSets, mesh::bounds};

/// Gaps up to this times the longest side of the mesh are rounding. Coordinates with six digits are off by up to half a
/// millionth each, so that two corners miss each other by up to 1.7 millionths; corners computed in single precision
/// were seen to miss by 1.3. The finest voxel is seven times as long as this gap on the J750's whole tray.
pub(super) const GAP: f64 = 4e-6;

/// Joins corners; says whether any were.
pub(super) fn join(mesh: &mut TriangleMesh, edges: &Edges, health: &mut HealthReport) -> bool {
    let open = |edges: &Edges| edges.iter().filter(|edge| edge.half_edges.len() == 1).count();
    let Some((triangles, count)) = renamed(mesh, edges) else { return false };
    if open(&Edges::new(mesh.positions.len(), &triangles)) >= open(edges) {
        return false;
    }
    mesh.triangles = triangles;
    health.joined_corners = count;
    true
}

/// The triangles with corners on open edges joined, and how many were; `None` where none were.
pub(super) fn renamed(mesh: &TriangleMesh, edges: &Edges) -> Option<(Vec<[u32; 3]>, usize)> {
    let mut rim: Vec<u32> = edges.iter().filter(|edge| edge.half_edges.len() == 1).flat_map(|edge| edge.ends).collect();
    rim.sort_unstable();
    rim.dedup();
    let (low, high) = bounds(&mesh.positions);
    let gap = GAP * (high - low).max_element();
    if rim.is_empty() || !(gap > 0.0) {
        return None;
    }
    let mut clusters = DisjointSets::new(rim.len());
    let cell = |p: DVec3| ((p - low) / gap).floor().as_i64vec3();
    let mut cells: HashMap<I64Vec3, Vec<u32>> = HashMap::new();
    for (i, &v) in (0..).zip(&rim) {
        let p = mesh.positions[v as usize];
        for around in 0..27 {
            let step = I64Vec3::new(around % 3, around / 3 % 3, around / 9) - I64Vec3::ONE;
            for &other in cells.get(&(cell(p) + step)).into_iter().flatten() {
                if mesh.positions[rim[other as usize] as usize].distance(p) <= gap {
                    clusters.join(i, other);
                }
            }
        }
        cells.entry(cell(p)).or_default().push(i);
    }
    let mut target: HashMap<u32, u32> = HashMap::new();
    for (i, &v) in (0..).zip(&rim) {
        let root = clusters.root(i);
        if root != i {
            target.insert(v, rim[root as usize]);
        }
    }
    let renamed = |v: u32| target.get(&v).copied().unwrap_or(v);
    let triangles = mesh.triangles.iter().map(|triangle| triangle.map(renamed)).collect();
    (!target.is_empty()).then_some((triangles, target.len()))
}
