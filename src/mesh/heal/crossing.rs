//! Triangles that pass through each other.
//!
//! Counted are pairs without a common corner where an edge of one properly pierces the other. Contact, coplanar overlap
//! and folds between neighbours do not count. Signs of volumes decide, in f64 with a tolerance: what grazes within
//! rounding is contact. Inside and outside do not depend on this count, it only goes into the report.

use std::time::Duration;

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use rayon::prelude::*;

use super::TriangleMesh;

/// Largest mesh that is checked: 100,000 triangles take about 0.1 s, a million ten times that.
const MAX_TRIANGLES: usize = 200_000;

/// Volumes below this times the cubed size of the pair are taken for 0.
const TOLERANCE: f64 = 1e-14;

/// Crossing pairs, or `None` for a mesh too large to check.
pub(super) fn count(mesh: &TriangleMesh) -> Option<usize> {
    if mesh.triangles.len() > MAX_TRIANGLES {
        return None;
    }
    let corners: Vec<[DVec3; 3]> = mesh.corners().collect();
    let boxes: Vec<Aabb> = corners.iter().map(outer_box).collect();
    let mut build_time = Duration::ZERO;
    let bvh = build_bvh2(&boxes, BvhBuildParams::very_fast_build(), &mut build_time);
    let crossing = |t: usize| {
        let mut found = 0;
        bvh.aabb_traverse(boxes[t], |bvh, node| {
            let node = &bvh.nodes[node as usize];
            let leaf = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            for &other in &bvh.primitive_indices[leaf] {
                let o = other as usize;
                // Every pair once, from its lower index.
                let strangers = || mesh.triangles[t].iter().all(|v| !mesh.triangles[o].contains(v));
                if o > t && boxes[t].intersect_aabb(&boxes[o]) && strangers() && cross(&corners[t], &corners[o]) {
                    found += 1;
                }
            }
            true
        });
        found
    };
    Some((0..corners.len()).into_par_iter().map(crossing).sum())
}

/// A box in single precision that surely holds the triangle.
fn outer_box(corners: &[DVec3; 3]) -> Aabb {
    let low = corners[0].min(corners[1]).min(corners[2]);
    let high = corners[0].max(corners[1]).max(corners[2]);
    let down = low.to_array().map(|c| (c as f32).next_down());
    let up = high.to_array().map(|c| (c as f32).next_up());
    Aabb::new(Vec3A::from_array(down), Vec3A::from_array(up))
}

fn cross(a: &[DVec3; 3], b: &[DVec3; 3]) -> bool {
    let size = a.iter().chain(b).map(|p| (*p - a[0]).abs().max_element()).fold(0.0, f64::max);
    let tolerance = TOLERANCE * size.powi(3);
    let pierces = |edge: [DVec3; 2], t: &[DVec3; 3]| {
        let [p, q] = edge;
        let side = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| sign((b - a).cross(c - a).dot(d - a), tolerance);
        let (sp, sq) = (side(t[0], t[1], t[2], p), side(t[0], t[1], t[2], q));
        if sp * sq >= 0 {
            return false;
        }
        let turns = [side(p, q, t[0], t[1]), side(p, q, t[1], t[2]), side(p, q, t[2], t[0])];
        turns == [1; 3] || turns == [-1; 3]
    };
    (0..3).any(|i| pierces([a[i], a[(i + 1) % 3]], b) || pierces([b[i], b[(i + 1) % 3]], a))
}

fn sign(volume: f64, tolerance: f64) -> i32 {
    i32::from(volume > tolerance) - i32::from(volume < -tolerance)
}
