//! Which triangles can be the nearest one somewhere in a block of voxels: the convex cull.
//!
//! The distance d(x, T) to a triangle is convex in x. So its tangent plane at the block's centre bounds it from below
//! everywhere, and the difference between a rival's distance and that plane is convex as well: if it is ≤ 0 at the
//! block's 8 corners it is ≤ 0 in the whole block, the rival is nearer everywhere, and T cannot win. The plain
//! Lipschitz rule (keep T if d ≤ d_min + 2r) keeps some twenty times as many.
//!
//! Guarantee: for every position of the block, the nearest triangle (and every triangle as near within the slack) is
//! kept. Not guaranteed: that what is kept is minimal; one rival is tried per round, [`ROUNDS`] rounds.

use glam::DVec3;
use multiversion::multiversion;

use super::closest_many::{LANES, Pairs};

/// Triangles are dropped only when beaten by more than this, mm: far above the rounding of a distance, so that ties
/// reach the comparison that breaks them by index.
pub const SLACK: f64 = 1e-7;

/// Rivals tried per block. On the marble rabbit at J750 pitch one leaves 18.1 candidates a brick, a second (the one
/// nearest at the corner where the first is weakest) 16.4, a third 16.06, a fifth 16.01; from the third on the cull
/// costs more than it saves.
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
    planes: Vec<Planes>,
    alive: Vec<bool>,
}

/// Tangent planes of [`LANES`] candidates.
#[derive(Debug, Clone, Copy)]
struct Planes {
    /// Distances at the centre.
    value: [f64; LANES],
    /// What they rise by from the centre to the faces, per axis.
    rise: [[f64; LANES]; 3],
}

impl Planes {
    /// The lowest value of one of them in the block.
    fn low(&self, lane: usize) -> f64 {
        self.value[lane] - (self.rise[0][lane].abs() + self.rise[1][lane].abs() + self.rise[2][lane].abs())
    }
}

/// Moves the candidates that can be nearest somewhere in `block` from `candidates` to the end of `kept`, in order, and
/// bounds the distance over the block. `candidates` must hold every triangle that can be nearest, and not be empty.
/// Every triangle that is within `slack` mm, at least [`SLACK`], of being nearest is kept as well.
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
    let mut pairs = Pairs::EMPTY;
    for lane in 0..LANES {
        pairs.set_position(lane, block.centre);
    }
    let (mut nearest, mut least) = (0, f64::INFINITY);
    for (block_of, some) in list[candidates.clone()].chunks(LANES).enumerate() {
        for (lane, &candidate) in some.iter().enumerate() {
            pairs.set_triangle(lane, &triangles[candidate as usize]);
        }
        let found = pairs.closest();
        for (lane, &value) in found.distance[..some.len()].iter().enumerate() {
            if value < least {
                (nearest, least) = (block_of * LANES + lane, value);
            }
        }
        let rise = |axis: usize| found.gradient[axis].map(|gradient| gradient * block.half[axis]);
        planes.push(Planes { value: found.distance, rise: [rise(0), rise(1), rise(2)] });
    }
    let mut highest = f64::INFINITY;
    let mut rival = nearest;
    alive.clear();
    alive.resize(candidates.len(), true);
    for (corner, position) in block.corners().into_iter().enumerate() {
        pairs.set_position(corner, position);
    }
    for _ in 0..ROUNDS {
        let triangle = &triangles[list[candidates.start + rival] as usize];
        for lane in 0..LANES {
            pairs.set_triangle(lane, triangle);
        }
        let ceiling = pairs.closest().distance;
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
            lowest = planes[index / LANES].low(index % LANES).min(lowest);
        }
    }
    DepthRange { min: lowest.max(0.0), max: highest }
}

/// Drops every candidate that is behind `rival`, whose distances at the corners are `ceiling`, by more than `slack` mm
/// everywhere. Returns the one that is furthest before it at some corner.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn drop_beaten(planes: &[Planes], alive: &mut [bool], rival: usize, ceiling: &[f64; 8], slack: f64) -> Option<usize> {
    let mut weakest = (f64::NEG_INFINITY, None);
    for (block, (planes, alive)) in planes.iter().zip(alive.chunks_mut(LANES)).enumerate() {
        let (value, [rx, ry, rz]) = (&planes.value, &planes.rise);
        // How far the rival is behind the planes at the corners, at most.
        let mut behind = [f64::NEG_INFINITY; LANES];
        for corner in 0..8 {
            let [x, y, z] = [CORNERS[0][corner], CORNERS[1][corner], CORNERS[2][corner]];
            for lane in 0..LANES {
                let plane = value[lane] + x * rx[lane] + y * ry[lane] + z * rz[lane];
                let at_corner = ceiling[corner] - plane;
                behind[lane] = if at_corner > behind[lane] { at_corner } else { behind[lane] };
            }
        }
        for (lane, alive) in alive.iter_mut().enumerate() {
            let index = block * LANES + lane;
            let (worst, rivals) = (behind[lane], *alive & (index != rival));
            let beaten = worst < -slack;
            *alive &= !(rivals & beaten);
            if rivals & !beaten & (worst > weakest.0) {
                weakest = (worst, Some(index));
            }
        }
    }
    weakest.1
}
