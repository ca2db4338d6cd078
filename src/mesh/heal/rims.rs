//! Shells whose rims run along each other: the wall of a hole and the plate around it, a boss and what it stands on,
//! drawn by a program that splits the curve between them differently for each. Each alone is open and may face either
//! way; together they are one body. What their caps enclose cancels out, for two caps lie on each other face to face,
//! but for the hairline between the rims.

use glam::DVec3;

use super::TriangleMesh;
use super::boundary::Hole;
use super::nesting::Shells;
use super::union::{Boxes, outer_box};
use crate::{disjoint_sets::DisjointSets, mesh::bounds};

/// Rims this far apart, in diagonals of the box around the shorter one, may be one curve. A circle of eight chords
/// leaves one of sixteen by 0.027.
const HAIRLINE: f64 = 0.03;
/// Rims as near as this, in the same measure, are on each other.
const MEETING: f64 = 1e-5;
/// Rims nowhere farther apart than this, in the same measure, are taken for one curve though they meet nowhere: 0.08 mm
/// around a hole 12 mm wide.
const SLIT: f64 = 5e-3;
/// Share of a rim that another has to run along.
const COVERED: f64 = 0.9;
/// Cosine of the angle between edges that run against each other.
const AGAINST: f64 = -0.5;

/// Bodies: shells by the rims that they have in common.
pub(super) struct Bodies {
    /// Body of every shell: the lowest of its shells.
    pub(super) of_shell: Vec<u32>,
    /// How far rims of a body's shells miss each other at most; 0 for a shell alone.
    pub(super) miss: Vec<f64>,
    /// How far rims that run along others but are no curve in common with them miss those at most.
    pub(super) unjoined_miss: f64,
    /// How many shells each has.
    sizes: Vec<usize>,
    /// For every shell: whether each of its rims meets others that run along it.
    pub(super) is_met: Vec<bool>,
}

impl Bodies {
    /// Every shell a body of its own, but for those that holes connect.
    pub(super) fn new(mesh: &TriangleMesh, shells: &Shells, holes: &[Hole]) -> Self {
        let mut sets = DisjointSets::new(shells.len());
        let mut misses = Vec::new();
        let mut unjoined_miss = 0.0f64;
        let mut unmet = vec![0usize; shells.len()];
        holes.iter().for_each(|hole| unmet[hole.shell as usize] += 1);
        for Neighbour { shell, others, miss, meets } in neighbours(&mesh.positions, holes) {
            others.iter().for_each(|&other| sets.join(shell, other));
            misses.push((shell, miss));
            if meets {
                unmet[shell as usize] -= 1;
            } else {
                unjoined_miss = unjoined_miss.max(miss);
            }
        }
        let of_shell: Vec<u32> = (0..shells.len() as u32).map(|shell| sets.root(shell)).collect();
        let mut miss = vec![0.0; shells.len()];
        for (shell, far) in misses {
            let body = &mut miss[of_shell[shell as usize] as usize];
            *body = far.max(*body);
        }
        let mut sizes = vec![0; shells.len()];
        of_shell.iter().for_each(|&body| sizes[body as usize] += 1);
        let is_met = (0..shells.len()).map(|s| sizes[of_shell[s] as usize] > 1 && unmet[s] == 0).collect();
        Self { of_shell, miss, unjoined_miss, sizes, is_met }
    }

    /// How many shells have rims in common with others.
    pub(super) fn joint(&self) -> usize {
        (0..self.of_shell.len()).filter(|&shell| self.is_joint(shell)).count()
    }

    /// Whether a shell has a rim in common with others.
    pub(super) fn is_joint(&self, shell: usize) -> bool {
        self.sizes[self.of_shell[shell] as usize] > 1
    }

    /// For every shell: whether its rim runs along that of another, and both together hold more than the gap between
    /// them does.
    pub(super) fn hold(&self, shells: &Shells) -> Vec<bool> {
        let mut sums = vec![(0.0, 0.0); shells.len()];
        for (shell, &body) in shells.all.iter().zip(&self.of_shell) {
            let (volume, area) = &mut sums[body as usize];
            (*volume, *area) = (*volume + shell.volume, *area + shell.area);
        }
        let holds = |&body: &u32| {
            let (volume, area): (f64, f64) = sums[body as usize];
            self.sizes[body as usize] > 1 && volume.abs() > self.miss[body as usize] * area
        };
        self.of_shell.iter().map(holds).collect()
    }
}

/// An edge of a rim, as its cap runs along it.
struct Segment {
    hole: usize,
    ends: [DVec3; 2],
}

/// What runs along a hole's rim.
struct Neighbour {
    shell: u32,
    /// Shells of the rims along it.
    others: Vec<u32>,
    /// How far they are apart at most.
    miss: f64,
    /// Whether they are on each other somewhere or a slit apart, as lines are that stand for one curve.
    meets: bool,
}

/// All holes whose rims others run along.
fn neighbours(positions: &[DVec3], holes: &[Hole]) -> Vec<Neighbour> {
    if holes.iter().all(|hole| hole.shell == holes[0].shell) {
        return Vec::new();
    }
    let rim = |hole: &Hole| hole.vertices.iter().map(|&v| positions[v as usize]).collect::<Vec<_>>();
    let mut segments = Vec::new();
    for (h, hole) in holes.iter().enumerate() {
        let rim = rim(hole);
        segments.extend((0..rim.len()).map(|i| Segment { hole: h, ends: [rim[i], rim[(i + 1) % rim.len()]] }));
    }
    let box_of = |Segment { ends: [a, b], .. }: &Segment| outer_box(&[*a, *b, *b], 0.0);
    let boxes = Boxes::new(segments.iter().map(box_of).collect());
    let mut found = Vec::new();
    let mut of_hole = segments.chunk_by(|a, b| a.hole == b.hole);
    for hole in holes {
        let own = of_hole.next().unwrap_or_default();
        let (low, high) = bounds(&rim(hole));
        let far = HAIRLINE * (high - low).length();
        let (mut others, mut covered, mut miss) = (Vec::new(), 0, 0.0f64);
        let samples = own.iter().flat_map(|Segment { ends: [a, b], .. }| [(*a, *b - *a), (0.5 * (*a + *b), *b - *a)]);
        for (p, along) in samples {
            let mut nearest = (far, None);
            boxes.near(outer_box(&[p; 3], far), |other| {
                let Segment { hole: of, ends: [a, b] } = &segments[other];
                let (shell, way) = (holes[*of].shell, *b - *a);
                let is_against = way.dot(along) <= AGAINST * way.length() * along.length();
                if shell == hole.shell || !is_against || way == DVec3::ZERO {
                    return;
                }
                let at = ((p - *a).dot(way) / way.length_squared()).clamp(0.0, 1.0);
                let distance = p.distance(*a + at * way);
                if (distance, Some(shell)) < nearest || nearest.1.is_none() && distance <= nearest.0 {
                    nearest = (distance, Some(shell));
                }
            });
            if let (distance, Some(shell)) = nearest {
                covered += 1;
                others.push(shell);
                miss = miss.max(distance);
            }
        }
        if covered as f64 >= COVERED * (2 * own.len()) as f64 {
            others.sort_unstable();
            others.dedup();
            let touch = MEETING * (high - low).length();
            let is_met = |Segment { ends, .. }: &Segment| {
                let mut is_met = false;
                boxes.near(outer_box(&[ends[0], ends[1], ends[1]], touch), |other| {
                    let Segment { hole: of, ends: others } = &segments[other];
                    is_met |= holes[*of].shell != hole.shell && apart(*ends, *others) <= touch;
                });
                is_met
            };
            let meets = miss <= SLIT * (high - low).length() || own.iter().any(is_met);
            found.push(Neighbour { shell: hole.shell, others, miss, meets });
        }
    }
    found
}

/// Distance of two segments (Ericson, *Real-Time Collision Detection*, 2005, section 5.1.9).
fn apart([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> f64 {
    let to_segment = |p: DVec3, [from, to]: [DVec3; 2]| {
        let way = to - from;
        let at = ((p - from).dot(way) / way.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        p.distance(from + at * way)
    };
    let ends = to_segment(a, [c, d]).min(to_segment(b, [c, d])).min(to_segment(c, [a, b])).min(to_segment(d, [a, b]));
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
    let area = uu * vv - uv * uv;
    if area <= 1e-12 * uu * vv {
        return ends;
    }
    let s = (uv * v.dot(w) - vv * u.dot(w)) / area;
    let t = (uu * v.dot(w) - uv * u.dot(w)) / area;
    let within = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
    if within { ends.min((w + s * u - t * v).length()) } else { ends }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_apart_between_ends_and_insides() {
        let x = [DVec3::ZERO, DVec3::X];
        for (other, distance) in [
            ([DVec3::new(0.5, -1.0, 0.25), DVec3::new(0.5, 1.0, 0.25)], 0.25),
            ([DVec3::new(3.0, 0.0, 0.0), DVec3::new(4.0, 0.0, 0.0)], 2.0),
            ([DVec3::new(0.25, 2.0, 0.0), DVec3::new(0.75, 2.0, 0.0)], 2.0),
            ([DVec3::new(2.0, 1.0, 0.0), DVec3::new(2.0, -1.0, 0.0)], 1.0),
        ] {
            assert!((apart(x, other) - distance).abs() < 1e-12, "{other:?}");
            assert!((apart(other, x) - distance).abs() < 1e-12, "{other:?}");
        }
    }
}
