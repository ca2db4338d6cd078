//! The Lp-averaged distance of Peng, Kristjansson and Zorin 2004 (*Interactive modeling of topologically complex
//! geometric detail*), which Hašan et al. 2010 (section 7.2) propose for creases.
//!
//! ```text
//!   d_p(x) = ( (p − 2)/2π · ∫_S |x − y|^−p dA(y) )^(−1/(p − 2))         p > 2
//! ```
//!
//! The factor makes it the distance to a plane: ∫ (h² + r²)^(−p/2) dA = 2π h^(2−p)/(p − 2). Off the surface it is
//! smooth, so its level sets round the creases that the exact distance has wherever two surface points are nearest.
//!
//! **Against the exact distance d.** Inside a convex body, p ≥ 3, (2(p − 2))^(−1/(p−2)) ≤ d_p/d ≤ ((p − 1)/(p −
//! 2))^(1/(p−2)), 0.66 to 1.03 for p = 8; a sphere's centre takes the lower bound. In general nothing bounds the ratio:
//! a thin spike that points at x is near, but has no area. What always holds is the way d_p varies: within r < d(x) of
//! x every |x − y| changes by at most the factor 1 ± r/d, hence d_p by at most (1 ± r/d)^(p/(p−2))
//! ([`LpField::range_within`]).
//!
//! **How it is computed.** Pieces of surface, far ones whole subtrees, near ones triangles bisected as often as needed,
//! count by their moments ([`super::lp_kernel`]). Bricks of voxels are halved along with the pieces: what is far enough
//! for all voxels of a cube is summed for all of them at once, the rest is left to its octants. The relative error
//! stays below [`RELATIVE_ERROR`] in the tests; it is not proven for surfaces whose area near x is much less than a
//! plane's.

use glam::{DVec3, Vec3};

use super::{
    kernel::BrickSurface,
    lp_kernel::{Positions, Sources, accumulate, finish},
    moments::{Content, Node, Outline, build_hierarchy},
};
use crate::voxel::{BRICK, BRICK_VOXELS, Lattice};

/// Relative error of the distance that the choice of pieces aims at. 1 µm per mm of depth.
pub const RELATIVE_ERROR: f64 = 1e-3;

/// Factor on the admissible spread of a piece. At 300 positions in and around a box and a ball the error then stays
/// below 1e-3 for p = 2.5 to 40 (the ignored accuracy test); 3.2 exceeds it.
const SPREAD_FACTOR: f64 = 2.5;

/// Beside a corner |x − y|^−p falls by e over a p-th of the distance; a piece may spread over this much of that.
const STEEPEST: f64 = 0.8;

/// Most of [`LpField`]'s growth: beyond p = 14 surface further away may be taken ever coarser on a plane, but not
/// beside an edge.
const MOST_GROWTH: f64 = 2.0;

/// A piece must be this many of its radii away, so that its Taylor series converges; nearer ones are bisected. 1.2 and
/// 2 cost more time.
const SEPARATION: f64 = 1.5;

/// A piece nearer to a cube than this many of the cube's radii is left to its octants rather than bisected further, by
/// the cube's edge of 1, 2, 4, 8 voxels. Octants may take pieces as coarse as their own greater gap allows, but eight
/// voxels make better use of a vector than one, hence the small value there.
const LEAVE: [f64; 4] = [0.0, 0.5, 1.0, 2.0];

/// Triangles that would need as many cuts per edge are bisected first: nearer parts need more than further ones.
const MOST_CUTS: f64 = 8.0;

/// Exact distances up to this, mm, are passed on: on the surface d_p = d = 0.
const ON_SURFACE: f32 = 1e-6;

/// The Lp-averaged distance to a surface.
#[derive(Debug)]
pub struct LpField {
    exponent: f64,
    nodes: Vec<Node>,
    /// A piece at distance ρ may spread over `spread` · ρ · max(1, ρ/d)^`growth`.
    spread: f64,
    growth: f64,
}

/// Positions of a brick's voxels for [`LpField::fill_brick`]: every cube of 8ⁿ voxels is one range (Morton order).
#[derive(Debug, Clone)]
pub struct LpOffsets {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    /// Which voxel of the brick stands where.
    voxel: Vec<u16>,
    pitch: DVec3,
}

/// Buffers of one worker.
#[derive(Debug, Default)]
pub struct LpScratch {
    pending: Vec<Piece>,
    stack: Vec<Piece>,
    parts: Vec<Part>,
    sources: Sources,
    /// Exact distance, its square and the sum per position.
    exact: Vec<f32>,
    scale: Vec<f32>,
    sum: Vec<f32>,
}

/// A piece of the surface: a node of the hierarchy, or a part of a triangle.
#[derive(Debug, Clone, Copy)]
enum Piece {
    Node(u32),
    Part(u32),
}

/// A part of a triangle, relative to the brick's centre. Bisected at most once per brick.
#[derive(Debug, Clone, Copy)]
struct Part {
    corners: [Vec3; 3],
    centre: Vec3,
    /// As in [`Outline`].
    spread: f32,
    radius: f32,
    /// The first of its two halves; 0 until there are any.
    halves: u32,
}

/// A cube of positions: a range of them, and the box around it.
struct Cube {
    range: std::ops::Range<usize>,
    centre: DVec3,
    half: DVec3,
}

/// What a computation looks at.
struct Scene<'a> {
    triangles: &'a [[DVec3; 3]],
    offsets: &'a LpOffsets,
    origin: DVec3,
}

impl LpField {
    /// The distance with exponent `exponent` > 2 to `triangles`, at least one.
    pub fn new(triangles: &[[DVec3; 3]], exponent: f64) -> Self {
        // The first term left out is at most p(p + 1)(p + 2)/6 · (spread/ρ)³ of the piece, and an error of F is divided
        // by p − 2.
        let third = exponent * (exponent + 1.0) * (exponent + 2.0) / 6.0;
        let spread = (SPREAD_FACTOR * libm::cbrt(RELATIVE_ERROR * (exponent - 2.0) / third)).min(STEEPEST / exponent);
        // Surface at ρ counts for (d/ρ)^(p−2) as much as at d. Half of that is used: the area near x may be small.
        let growth = ((exponent - 2.0) / 6.0).min(MOST_GROWTH);
        Self { exponent, nodes: build_hierarchy(triangles), spread, growth }
    }

    /// d_p at `p`, whose exact distance is `exact` mm. `triangles` are those of [`Self::new`].
    pub fn distance(&self, triangles: &[[DVec3; 3]], p: DVec3, exact: f64, scratch: &mut LpScratch) -> f64 {
        scratch.start([exact as f32]);
        if scratch.exact[0] <= ON_SURFACE {
            return exact;
        }
        let cube = Cube { range: 0..1, centre: DVec3::ZERO, half: DVec3::ZERO };
        self.sum(&Scene { triangles, offsets: &LpOffsets::point(), origin: p }, cube, scratch);
        f64::from(scratch.sum[0])
    }

    /// Replaces the exact distances of a brick around `centre` by d_p where `mask` says so. The rounding error becomes
    /// that of single precision.
    pub fn fill_brick(
        &self,
        triangles: &[[DVec3; 3]],
        centre: DVec3,
        offsets: &LpOffsets,
        mask: &[u8; BRICK_VOXELS / 8],
        surface: &mut BrickSurface,
        scratch: &mut LpScratch,
    ) {
        let wanted = |voxel: usize| mask[voxel / 8] >> (voxel % 8) & 1 != 0;
        // Voxels that are not asked for pass as lying on the surface.
        scratch.start(offsets.voxel.iter().map(|&voxel| {
            let voxel = usize::from(voxel);
            if wanted(voxel) { surface.distance[voxel] } else { 0.0 }
        }));
        let half = offsets.pitch * ((BRICK - 1) as f64 / 2.0);
        let cube = Cube { range: 0..BRICK_VOXELS, centre: DVec3::ZERO, half };
        self.sum(&Scene { triangles, offsets, origin: centre }, cube, scratch);
        for ((&voxel, &sum), &exact) in offsets.voxel.iter().zip(&scratch.sum).zip(&scratch.exact) {
            if exact > ON_SURFACE {
                surface.distance[usize::from(voxel)] = sum;
            }
        }
        surface.error = 0.0;
    }

    /// Bounds d_p within `radius` of a position whose d_p and exact distance are given; `None` if the surface may be
    /// met.
    pub fn range_within(&self, averaged: f64, exact: f64, radius: f64) -> Option<(f64, f64)> {
        let power = self.exponent / (self.exponent - 2.0);
        let margin = 2.0 * RELATIVE_ERROR;
        (radius < exact).then(|| {
            let bound = |factor: f64| averaged * libm::pow(factor, power);
            (bound(1.0 - radius / exact) * (1.0 - margin), bound(1.0 + radius / exact) * (1.0 + margin))
        })
    }

    /// Leaves d_p in `scratch.sum`.
    fn sum(&self, scene: &Scene<'_>, cube: Cube, scratch: &mut LpScratch) {
        scratch.parts.clear();
        scratch.pending.clear();
        scratch.pending.push(Piece::Node(0));
        self.descend(scene, &cube, 0..1, scratch);
        finish(self.exponent, &mut scratch.positions(scene.offsets, cube.range));
    }

    /// Adds the pieces at `pieces` of the pending ones to the positions of `cube`.
    fn descend(&self, scene: &Scene<'_>, cube: &Cube, pieces: std::ops::Range<usize>, scratch: &mut LpScratch) {
        let furthest = scratch.exact[cube.range.clone()].iter().copied().fold(0.0, f32::max);
        if furthest <= ON_SURFACE {
            return;
        }
        let (furthest, radius) = (f64::from(furthest), cube.half.length());
        let leave = LEAVE[(cube.range.len().trailing_zeros() / 3) as usize] * radius;
        let start = scratch.pending.len();
        scratch.sources.clear();
        for index in pieces {
            scratch.stack.push(scratch.pending[index]);
            while let Some(piece) = scratch.stack.pop() {
                let (centre, spread, size) = match piece {
                    Piece::Node(index) => {
                        let Outline { moments, spread, radius } = &self.nodes[index as usize].outline;
                        (moments.centre - scene.origin, *spread, *radius)
                    }
                    Piece::Part(index) => {
                        let part = &scratch.parts[index as usize];
                        (part.centre.as_dvec3(), f64::from(part.spread), f64::from(part.radius))
                    }
                };
                let gap = ((centre - cube.centre).abs() - cube.half).max(DVec3::ZERO).length();
                let cuts = if gap > SEPARATION * size { self.cuts(spread, size, gap, furthest) } else { u32::MAX };
                if gap < leave && size < radius && cuts > 1 {
                    scratch.pending.push(piece);
                } else if !self.add(piece, cuts, scene, scratch) {
                    self.split(piece, scene, scratch);
                }
            }
        }
        let sources = std::mem::take(&mut scratch.sources);
        accumulate(&sources, self.exponent, &mut scratch.positions(scene.offsets, cube.range.clone()));
        scratch.sources = sources;
        let left = start..scratch.pending.len();
        if !left.is_empty() {
            for octant in 0..8 {
                self.descend(scene, &cube.octant(octant, scene.offsets.pitch), left.clone(), scratch);
            }
        }
        scratch.pending.truncate(start);
    }

    /// Into how many parts each edge of a piece must be cut, for positions whose exact distance is at most `furthest`;
    /// `gap` is the distance of the piece's centroid. A part of the n-th size can be nearer by `radius` (1 − 1/n).
    fn cuts(&self, spread: f64, radius: f64, gap: f64, furthest: f64) -> u32 {
        let mut limit = self.spread;
        // The power is needed for few.
        if spread > limit * gap && gap - radius > furthest {
            limit *= libm::pow((gap - radius) / furthest, self.growth);
        }
        ((spread / limit - radius) / (gap - radius)).ceil().clamp(1.0, MOST_CUTS) as u32
    }

    /// Adds a piece to the sources; false if it has to be split instead.
    fn add(&self, piece: Piece, cuts: u32, scene: &Scene<'_>, scratch: &mut LpScratch) -> bool {
        let small = f64::from(cuts) < MOST_CUTS;
        match piece {
            Piece::Node(index) if cuts == 1 => {
                let moments = &self.nodes[index as usize].outline.moments;
                scratch.sources.add(moments, scene.origin, self.exponent);
            }
            Piece::Part(index) if small => {
                let corners = &scratch.parts[index as usize].corners;
                scratch.sources.add_triangle(corners, cuts, self.exponent);
            }
            _ => return false,
        }
        true
    }

    /// Puts the halves of a piece on the stack; a triangle becomes a part of itself.
    fn split(&self, piece: Piece, scene: &Scene<'_>, scratch: &mut LpScratch) {
        let whole = match piece {
            Piece::Node(index) => {
                return match self.nodes[index as usize].content {
                    Content::Pair(second) => scratch.stack.extend([Piece::Node(second), Piece::Node(index + 1)]),
                    Content::Triangle(triangle) => {
                        let corners = scene.triangles[triangle as usize].map(|c| (c - scene.origin).as_vec3());
                        scratch.stack.push(Piece::Part(scratch.parts.len() as u32));
                        scratch.parts.push(Part::new(corners));
                    }
                };
            }
            Piece::Part(index) => index as usize,
        };
        if scratch.parts[whole].halves == 0 {
            scratch.parts[whole].halves = scratch.parts.len() as u32;
            let halves = scratch.parts[whole].bisect();
            scratch.parts.extend(halves);
        }
        let first = scratch.parts[whole].halves;
        scratch.stack.extend([Piece::Part(first + 1), Piece::Part(first)]);
    }
}

impl Part {
    #[inline]
    fn new(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        let centre = (a + b + c) / 3.0;
        let squares = [a, b, c].map(|corner| corner.distance_squared(centre));
        let spread = ((squares[0] + squares[1] + squares[2]) / 12.0).sqrt();
        let radius = squares[0].max(squares[1]).max(squares[2]).sqrt();
        Self { corners, centre, spread, radius, halves: 0 }
    }

    /// Two parts, the longest edge halved, so that slivers become compact.
    #[inline]
    fn bisect(&self) -> [Self; 2] {
        let [a, b, c] = self.corners;
        let (ab, bc, ca) = (a.distance_squared(b), b.distance_squared(c), c.distance_squared(a));
        let (a, b, c) = if ab >= bc && ab >= ca {
            (a, b, c)
        } else if bc >= ca {
            (b, c, a)
        } else {
            (c, a, b)
        };
        let middle = (a + b) / 2.0;
        [Self::new([a, middle, c]), Self::new([middle, b, c])]
    }
}

impl Cube {
    /// One of the eight cubes of half the edge.
    fn octant(&self, octant: usize, pitch: DVec3) -> Self {
        let count = self.range.len() / 8;
        let start = self.range.start + octant * count;
        let sign = |axis: usize| if octant >> axis & 1 == 0 { -1.0 } else { 1.0 };
        let half = (self.half - pitch / 2.0) / 2.0;
        let shift = half + pitch / 2.0;
        let centre = self.centre + shift * DVec3::new(sign(0), sign(1), sign(2));
        Self { range: start..start + count, centre, half: half.max(DVec3::ZERO) }
    }
}

impl LpOffsets {
    /// For the bricks of `lattice`.
    pub fn new(lattice: &Lattice) -> Self {
        let place = |n: usize, axis: usize| (0..3).map(|level| (n >> (3 * level + axis) & 1) << level).sum::<usize>();
        let offset =
            |n: usize, axis: usize| ((place(n, axis) as f64 - (BRICK as f64 - 1.0) / 2.0) * lattice.pitch[axis]) as f32;
        let along = |axis: usize| (0..BRICK_VOXELS).map(|n| offset(n, axis)).collect();
        let voxel = |n: usize| (place(n, 0) + BRICK * (place(n, 1) + BRICK * place(n, 2))) as u16;
        Self {
            x: along(0),
            y: along(1),
            z: along(2),
            voxel: (0..BRICK_VOXELS).map(voxel).collect(),
            pitch: lattice.pitch,
        }
    }

    /// One position, the origin.
    fn point() -> Self {
        let [x, y, z] = Vec3::ZERO.to_array().map(|v| vec![v]);
        Self { x, y, z, voxel: vec![0], pitch: DVec3::ZERO }
    }
}

impl LpScratch {
    fn start(&mut self, exact: impl IntoIterator<Item = f32>) {
        self.exact.clear();
        self.exact.extend(exact);
        self.scale.clear();
        self.scale.extend(self.exact.iter().map(|d| d * d));
        self.sum.clear();
        self.sum.resize(self.exact.len(), 0.0);
    }

    fn positions<'a>(&'a mut self, offsets: &'a LpOffsets, range: std::ops::Range<usize>) -> Positions<'a> {
        Positions {
            x: &offsets.x[range.clone()],
            y: &offsets.y[range.clone()],
            z: &offsets.z[range.clone()],
            scale: &self.scale[range.clone()],
            sum: &mut self.sum[range],
        }
    }
}
