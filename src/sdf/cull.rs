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

use super::triangle::closest_point;

/// Triangles are dropped only when beaten by more than this, mm: far above the rounding of a distance, so that ties reach the
/// comparison that breaks them by index.
pub const SLACK: f64 = 1e-7;

/// Rivals tried per block. A second and third rival (those nearest at the corner where the first is weakest) drop a further
/// fifth of the candidates at brick level; a fourth costs more than it saves.
const ROUNDS: usize = 3;

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

    fn corner_offset(&self, corner: usize) -> DVec3 {
        let sign = |bit: usize| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
        self.half * DVec3::new(sign(0), sign(1), sign(2))
    }
}

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
    gradient: DVec3,
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
        planes.push(Plane { value, gradient, low: value - gradient.abs().dot(block.half) });
    }
    let mut range = DepthRange { min: f64::INFINITY, max: f64::INFINITY };
    for plane in planes.iter() {
        range.min = range.min.min(plane.low);
    }
    range.min = range.min.max(0.0);

    let mut rival = nearest;
    alive.clear();
    alive.resize(planes.len(), true);
    let offsets: [DVec3; 8] = std::array::from_fn(|corner| block.corner_offset(corner));
    for _ in 0..ROUNDS {
        let triangle = &triangles[list[candidates.start + rival] as usize];
        let mut ceiling = [0.0; 8];
        for (ceiling, offset) in ceiling.iter_mut().zip(offsets) {
            *ceiling = closest_point(block.centre + offset, triangle).distance_squared.sqrt();
        }
        let highest = ceiling.iter().copied().fold(0.0, f64::max);
        range.max = range.max.min(highest);
        let mut weakest = (f64::NEG_INFINITY, usize::MAX);
        for (index, plane) in planes.iter().enumerate() {
            if !alive[index] || index == rival {
                continue;
            }
            if plane.low > highest + slack {
                alive[index] = false;
                continue;
            }
            // How far the rival is behind the plane, at worst over the corners.
            let mut behind = f64::NEG_INFINITY;
            for (ceiling, offset) in ceiling.iter().zip(offsets) {
                behind = behind.max(ceiling - (plane.value + plane.gradient.dot(offset)));
            }
            if behind < -slack {
                alive[index] = false;
            } else if behind > weakest.0 {
                weakest = (behind, index);
            }
        }
        if weakest.1 == usize::MAX {
            break;
        }
        rival = weakest.1;
    }
    for (index, candidate) in candidates.enumerate() {
        if alive[index] {
            list.push(list[candidate]);
        }
    }
    range
}
