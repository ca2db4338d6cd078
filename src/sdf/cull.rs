//! Which triangles can be the nearest one somewhere in a block of voxels: the convex cull.
//!
//! The distance d(x, T) to a triangle is convex in x. So its tangent plane at the block's centre bounds it from below
//! everywhere, and the difference between a rival's distance and that plane is convex as well: if it is ≤ 0 at the
//! block's 8 corners it is ≤ 0 in the whole block, the rival is nearer everywhere, and T cannot win. The plain Lipschitz
//! rule (keep T if d ≤ d_min + 2r) keeps some twenty times as many.
//!
//! Guarantee: for every position of the block, the nearest triangle (and every triangle as near within the slack) is kept.
//! Not guaranteed: that what is kept is minimal; one rival is tried per round, [`ROUNDS`] rounds.

use glam::DVec3;
use multiversion::multiversion;

use super::triangle::closest_point;

/// Triangles are dropped only when beaten by more than this, mm: far above the rounding of a distance, so that ties reach the
/// comparison that breaks them by index.
pub const SLACK: f64 = 1e-7;

/// Rivals tried per block. On the marble rabbit at J750 pitch one leaves 18.1 candidates a brick, a second (the one nearest at the corner
/// where the first is weakest) 16.4, a third 16.06, a fifth 16.01; from the third on the cull costs more than it saves.
const ROUNDS: usize = 2;

/// An axis-aligned box of positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockBox {
    /// Centre, mm.
    pub centre: DVec3,
    /// Half edge lengths, mm.
    pub half: DVec3,
}

impl BlockBox {
    /// Half the diagonal, mm.
    pub fn radius(&self) -> f64 {
        self.half.length()
    }

    /// The corners, numbered as [`CORNERS`].
    fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|corner| self.centre + self.half * DVec3::from(CORNERS.map(|signs| signs[corner])))
    }
}

/// Signs of x, y and z of a box's corners.
const CORNERS: [[f64; 8]; 3] = [
    [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0],
    [-1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0],
    [-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0],
];

/// Bounds on the distance from the positions of a block to the surface, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthRange {
    /// No position is nearer.
    pub min: f64,
    /// No position is further.
    pub max: f64,
}

/// Tangent planes of the candidates of one block, reused.
#[derive(Debug, Default)]
pub struct CullScratch {
    planes: Vec<Plane>,
    alive: Vec<bool>,
}

#[derive(Debug, Clone, Copy)]
struct Plane {
    /// Distance at the centre.
    value: f64,
    /// What it rises by from the centre to the faces, per axis.
    rise: DVec3,
    /// Lowest value of the plane in the block.
    low: f64,
}

/// Moves the candidates that can be nearest somewhere in `block` from `candidates` to the end of `kept`, in order, and
/// bounds the distance over the block. `candidates` must hold every triangle that can be nearest, and not be empty. Every triangle
/// that is within `slack` mm, at least [`SLACK`], of being nearest is kept as well.
pub fn cull(
    triangles: &[[DVec3; 3]],
    block: &BlockBox,
    candidates: std::ops::Range<usize>,
    slack: f64,
    list: &mut Vec<u32>,
    scratch: &mut CullScratch,
) -> DepthRange {
    let CullScratch { planes, alive } = scratch;
    planes.clear();
    let mut nearest = 0;
    for &candidate in &list[candidates.clone()] {
        let found = closest_point(block.centre, &triangles[candidate as usize]);
        let value = found.distance_squared.sqrt();
        // On the triangle itself 0 is a subgradient.
        let gradient = if value > 0.0 { (block.centre - found.point) / value } else { DVec3::ZERO };
        if planes.get(nearest).is_some_and(|best: &Plane| value < best.value) {
            nearest = planes.len();
        }
        let rise = gradient * block.half;
        planes.push(Plane { value, rise, low: value - rise.abs().element_sum() });
    }
    let mut highest = f64::INFINITY;
    let mut rival = nearest;
    alive.clear();
    alive.resize(planes.len(), true);
    for _ in 0..ROUNDS {
        let triangle = &triangles[list[candidates.start + rival] as usize];
        let ceiling = block.corners().map(|corner| closest_point(corner, triangle).distance_squared.sqrt());
        highest = ceiling.iter().copied().fold(0.0, f64::max).min(highest);
        match drop_beaten(planes, alive, rival, &ceiling, slack) {
            Some(next) => rival = next,
            None => break,
        }
    }
    let mut lowest = f64::INFINITY;
    for (index, candidate) in candidates.enumerate() {
        if alive[index] {
            list.push(list[candidate]);
            lowest = planes[index].low.min(lowest);
        }
    }
    DepthRange { min: lowest.max(0.0), max: highest }
}

/// Drops every candidate that is behind `rival`, whose distances at the corners are `ceiling`, by more than `slack` mm everywhere.
/// Returns the one that is furthest before it at some corner.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn drop_beaten(planes: &[Plane], alive: &mut [bool], rival: usize, ceiling: &[f64; 8], slack: f64) -> Option<usize> {
    let mut weakest = (f64::NEG_INFINITY, None);
    for (index, (plane, alive)) in planes.iter().zip(alive).enumerate() {
        if !*alive || index == rival {
            continue;
        }
        // How far the rival is behind the plane at the corners.
        let mut behind = [0.0; 8];
        for (corner, behind) in behind.iter_mut().enumerate() {
            let [x, y, z] = CORNERS.map(|signs| signs[corner]);
            *behind = ceiling[corner] - (plane.value + x * plane.rise.x + y * plane.rise.y + z * plane.rise.z);
        }
        let greater = |a: f64, b: f64| if a > b { a } else { b };
        let four: [f64; 4] = std::array::from_fn(|i| greater(behind[i], behind[i + 4]));
        let worst = greater(greater(four[0], four[2]), greater(four[1], four[3]));
        if worst < -slack {
            *alive = false;
        } else if worst > weakest.0 {
            weakest = (worst, Some(index));
        }
    }
    weakest.1
}
