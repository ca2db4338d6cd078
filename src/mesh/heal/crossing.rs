//! Triangles that pass through each other or lie on each other.
//!
//! Counted are pairs without a common corner: crossings, where an edge of one properly pierces the other, and contacts,
//! where they are coplanar and overlap or meet along a line, as where edge crosses edge. Folds between neighbours do not
//! count. Signs of volumes decide on crossings, in f64 with a tolerance: what grazes within rounding is contact. Inside
//! and outside do not depend on these counts; where there are any, faces may have inside on both sides.

use glam::DVec3;
use rayon::prelude::*;

use super::TriangleMesh;
use super::union::{Boxes, Frame, Tolerance, outer_box};

/// Volumes below this times the cubed size of the pair are taken for 0.
const TOLERANCE: f64 = 1e-14;

/// Pairs of triangles that meet.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Meetings {
    pub(super) crossings: usize,
    pub(super) contacts: usize,
}

/// Counts them: a million triangles take about half a second on two cores.
pub(super) fn count(mesh: &TriangleMesh, tolerance: Tolerance) -> Meetings {
    let corners: Vec<[DVec3; 3]> = mesh.corners().collect();
    let boxes = Boxes::new(corners.iter().map(|corners| outer_box(corners, 0.5 * tolerance.touch)).collect());
    let meetings = |t: usize| {
        let mut found = Meetings::default();
        let [a, b, c] = corners[t];
        let normal = (b - a).cross(c - a);
        let touch = tolerance.touch * normal.length();
        boxes.near(boxes.get(t), |o| {
            // Every pair once, from its lower index.
            let strangers = || mesh.triangles[t].iter().all(|v| !mesh.triangles[o].contains(v));
            if o <= t || !strangers() {
                return;
            }
            let heights = corners[o].map(|p| normal.dot(p - a));
            if heights.iter().all(|h| h.abs() <= touch) {
                let lies_on = |frame: Frame| frame.meet(&corners[o], [false; 3], tolerance, &mut Vec::new());
                found.contacts += usize::from(Frame::new(&corners[t]).is_some_and(lies_on));
            }
            let parted = heights.iter().all(|h| *h > 0.0) || heights.iter().all(|h| *h < 0.0);
            if !parted && cross(&corners[t], &corners[o]) {
                found.crossings += 1;
            } else if !parted && found == Meetings::default() {
                let meets = |frame: Frame| frame.meet(&corners[o], [false; 3], tolerance, &mut Vec::new());
                found.contacts += usize::from(Frame::new(&corners[t]).is_some_and(meets));
            }
        });
        found
    };
    let sum =
        |a: Meetings, b: Meetings| Meetings { crossings: a.crossings + b.crossings, contacts: a.contacts + b.contacts };
    (0..corners.len()).into_par_iter().map(meetings).reduce(Meetings::default, sum)
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
