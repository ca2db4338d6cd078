//! Triangles that pass through each other or lie on each other.
//!
//! Of pairs without a common corner, crossings are counted, where an edge of one properly pierces the other; of
//! contacts, where they are coplanar and overlap or meet along a line, as where edge crosses edge, it is told whether
//! there are any. Signs of volumes decide on crossings, in f64 with a tolerance: what grazes within rounding is
//! contact. Pairs with a corner in common are folds where they meet beyond it by more than rounding: the sides of a
//! pyramid over a star pass through each other in lines that all begin at its top. Inside and outside do not depend on
//! these; where there are any, faces may have inside on both sides.

use glam::DVec3;

use super::TriangleMesh;
use super::union::{Boxes, Frame, Tolerance, outer_box};
use crate::parallel;

/// Triangles that one thread looks at in one go.
const CHUNK: usize = 64;

/// Volumes below this times the cubed size of the pair are taken for 0.
const TOLERANCE: f64 = 1e-14;

/// Pairs of triangles that meet.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Meetings {
    pub(super) crossings: usize,
    pub(super) has_contacts: bool,
    pub(super) has_folds: bool,
}

impl Meetings {
    pub(super) fn any(self) -> bool {
        self != Self::default()
    }
}

/// Finds them: a million triangles take about half a second on two cores.
pub(super) fn find(mesh: &TriangleMesh, tolerance: Tolerance) -> Meetings {
    let corners: Vec<[DVec3; 3]> = mesh.corners().collect();
    let boxes = Boxes::new(corners.iter().map(|corners| outer_box(corners, 0.5 * tolerance.touch)).collect());
    let meetings = |t: usize| {
        let mut found = Meetings::default();
        let [a, b, c] = corners[t];
        let normal = (b - a).cross(c - a);
        let [touch, rounding] = [tolerance.touch, tolerance.rounding].map(|distance| distance * normal.length());
        boxes.near(boxes.get(t), |o| {
            // Every pair once, from its lower index.
            if o <= t {
                return;
            }
            let shared = mesh.triangles[o].map(|v| mesh.triangles[t].iter().position(|&other| other == v));
            let heights = corners[o].map(|p| normal.dot(p - a));
            if let Some(at) = (0..3).find_map(|i| shared[i].map(|corner| [corner, i])) {
                let sides = [0, 1, 2].map(|i| if shared[i].is_some() { 0 } else { sign(heights[i], rounding) });
                let is_fold = || match shared.iter().flatten().count() {
                    1 => meet_beyond([&corners[t], &corners[o]], at, heights, sides),
                    _ => sides == [0; 3] && lie_on_each_other(&corners[t], &corners[o], shared, tolerance),
                };
                found.has_folds = found.has_folds || is_fold();
                return;
            }
            let meets = || {
                let meets = |frame: Frame| frame.meet(&corners[o], [false; 3], tolerance, &mut Vec::new());
                Frame::new(&corners[t]).is_some_and(meets)
            };
            if heights.iter().all(|h| h.abs() <= touch) {
                found.has_contacts = found.has_contacts || meets();
            }
            let parted = heights.iter().all(|h| *h > 0.0) || heights.iter().all(|h| *h < 0.0);
            if !parted && cross(&corners[t], &corners[o]) {
                found.crossings += 1;
            } else if !parted && !found.any() {
                found.has_contacts = meets();
            }
        });
        found
    };
    let sum = |a: Meetings, b: Meetings| Meetings {
        crossings: a.crossings + b.crossings,
        has_contacts: a.has_contacts || b.has_contacts,
        has_folds: a.has_folds || b.has_folds,
    };
    let sum_of = |chunk: usize| {
        let corners = chunk * CHUNK..corners.len().min((chunk + 1) * CHUNK);
        corners.map(meetings).fold(Meetings::default(), sum)
    };
    parallel::map(corners.len().div_ceil(CHUNK), sum_of).into_iter().fold(Meetings::default(), sum)
}

/// Whether neighbours in one plane overlap; `shared` tells which corners of the other are corners of the first.
fn lie_on_each_other(
    corners: &[DVec3; 3],
    other: &[DVec3; 3],
    shared: [Option<usize>; 3],
    tolerance: Tolerance,
) -> bool {
    // Those that meet at a flat angle would touch all along.
    let tight = Tolerance { touch: tolerance.rounding, ..tolerance };
    let shared = shared.map(|corner| corner.is_some());
    Frame::new(corners).is_some_and(|frame| frame.meet(other, shared, tight, &mut Vec::new()))
}

/// Whether two triangles with one corner in common, `at` of either, meet beyond it. `heights` of the second's corners
/// over the first's plane are times the double of its area; `sides` are their signs.
fn meet_beyond([first, second]: [&[DVec3; 3]; 2], at: [usize; 2], heights: [f64; 3], sides: [i32; 3]) -> bool {
    let spread = |corners: &[DVec3; 3], at: usize| [1, 2].map(|next| corners[(at + next) % 3] - corners[at]);
    let (one, two) = (spread(first, at[0]), spread(second, at[1]));
    let (i, j) = ((at[1] + 1) % 3, (at[1] + 2) % 3);
    match [sides[i], sides[j]] {
        [0, 0] => {
            // Most lie beside each other, which is found sooner than that none leads into the other: a line along one
            // of the sides parts them. The first's go from a to b, the second's from c to d; turns from one side to
            // another are positive the way from a to b.
            let normal = one[0].cross(one[1]);
            let [[ac, ad], [bc, bd]] = one.map(|a| two.map(|c| normal.dot(a.cross(c))));
            let cd = normal.dot(two[0].cross(two[1]));
            let a_parts = ac <= 0.0 && ad <= 0.0;
            let b_parts = bc >= 0.0 && bd >= 0.0;
            // From c to a it is -ac, the other way than to d where ac has the sign of cd; from d to c it is -cd.
            let c_parts = ac * cd >= 0.0 && bc * cd >= 0.0;
            let d_parts = ad * cd <= 0.0 && bd * cd <= 0.0;
            if a_parts || b_parts || c_parts || d_parts {
                return false;
            }
            let between = two[0].normalize_or_zero() + two[1].normalize_or_zero();
            two.iter().chain([&between]).any(|ahead| leads_into(one, *ahead))
                || one.iter().any(|ahead| leads_into(two, *ahead))
        }
        [0, _] => leads_into(one, two[0]),
        [_, 0] => leads_into(one, two[1]),
        [a, b] => a != b && leads_into(one, two[0].lerp(two[1], heights[i] / (heights[i] - heights[j]))),
    }
}

/// Whether a direction in the plane of two sides lies between them.
fn leads_into([from, to]: [DVec3; 2], ahead: DVec3) -> bool {
    /// Sine of the angle to a side below which it leads along that. Coordinates of 1e3 mm carry 2e-13 mm of rounding,
    /// which turns sides of 1 µm by 2e-10; faces that fold onto each other by less than this are as good as one.
    const ALONG: f64 = 1e-9;
    let normal = from.cross(to);
    let turns = |a: DVec3, b: DVec3| {
        let turn = normal.dot(a.cross(b));
        turn > 0.0 && turn > ALONG * normal.length() * a.length() * b.length()
    };
    turns(from, ahead) && turns(ahead, to)
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

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_3;

    use super::*;

    /// A fan around the origin in a plane that leans, `from` and `to` in parts of 60 degrees.
    fn fan([from, to]: [f64; 2], length: f64) -> [DVec3; 3] {
        let (u, v) = (DVec3::new(0.6, 0.8, 0.0), DVec3::new(-0.64, 0.48, 0.6));
        let at = |turn: f64| {
            let (sin, cos) = libm::sincos(FRAC_PI_3 * turn);
            length * (cos * u + sin * v)
        };
        [DVec3::ZERO, at(from), at(to)]
    }

    /// Both fans with each of their corners first.
    fn turned(first: [DVec3; 3], second: [DVec3; 3]) -> impl Iterator<Item = ([[DVec3; 3]; 2], [usize; 2])> {
        let rolled = |corners: [DVec3; 3], by: usize| [0, 1, 2].map(|i| corners[(i + 3 - by) % 3]);
        (0..9).map(move |i| ([rolled(first, i / 3), rolled(second, i % 3)], [i / 3, i % 3]))
    }

    #[test]
    fn fans_in_one_plane_meet_where_they_overlap() {
        for (second, meet) in [
            ([2.0, 3.0], false),
            ([3.0, 4.0], false),
            // A side in common.
            ([1.0, 2.0], false),
            ([-1.0, 0.0], false),
            ([0.5, 1.5], true),
            ([-0.5, 0.5], true),
            // One within the other, with a side in common or without.
            ([0.3, 0.6], true),
            ([-0.5, 1.5], true),
            ([0.0, 0.5], true),
            ([0.0, 1.0], true),
        ] {
            for length in [1.0, 1e-3, 1e3] {
                for second in [second, [second[1], second[0]]] {
                    for ([one, two], at) in turned(fan([0.0, 1.0], 1.0), fan(second, length)) {
                        assert_eq!(meet_beyond([&one, &two], at, [0.0; 3], [0; 3]), meet, "{second:?} {length} {at:?}");
                        assert_eq!(meet_beyond([&two, &one], [at[1], at[0]], [0.0; 3], [0; 3]), meet, "{second:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn fans_in_two_planes_meet_where_one_leads_into_the_other() {
        let one = fan([0.0, 1.0], 1.0);
        let normal = one[1].cross(one[2]).normalize();
        for (turn, meet) in [(0.5, true), (-0.5, false), (1.5, false), (1e-10, false), (1e-8, true), (1.0 - 1e-8, true)]
        {
            let ahead = fan([turn, turn], 1.0)[1];
            // A side in the plane, and one on either side of it.
            for heights in [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 1.0, -1.0], [0.0, -0.5, 1.0]] {
                let two = [DVec3::ZERO, ahead + heights[1] * normal, ahead + heights[2] * normal];
                let sides = heights.map(|height| sign(height, 0.0));
                assert_eq!(meet_beyond([&one, &two], [0, 0], heights, sides), meet, "{turn} {heights:?}");
            }
        }
        let above = [DVec3::ZERO, one[1] + normal, one[2] + normal];
        assert!(!meet_beyond([&one, &above], [0, 0], [0.0, 1.0, 1.0], [0, 1, 1]));
    }
}
