//! Nearest of a few triangles for the 512 voxels of a brick.
//!
//! Single precision, in coordinates relative to the brick's centre, without branches, so that the compiler turns it
//! into vector code; built for several instruction sets and chosen at run time. Nothing is contracted or reordered, so
//! every instruction set gives the same bits.
//!
//! A voxel's distance is the one to the triangle's plane where the voxel projects into the triangle, else the least of
//! the distances to its three edges. [`BrickSurface::error`] bounds the rounding error; who needs more (a depth near a
//! layer boundary) asks [`super::closest_point`] again in double precision.

use glam::{DVec3, Vec3};
use multiversion::multiversion;

use super::{
    cull::DepthRange,
    parts::{PART_COLUMNS, PART_SLICES, Part, Parts},
};
use crate::voxel::{BRICK, BRICK_VOXELS, Lattice};

/// Positions of a brick's voxels relative to its centre, mm; the same for all bricks of a lattice.
#[derive(Debug, Clone)]
pub struct BrickOffsets {
    x: [f32; BRICK_VOXELS],
    y: [f32; BRICK_VOXELS],
    z: [f32; BRICK_VOXELS],
}

impl BrickOffsets {
    /// Offsets for the pitch of `lattice`.
    pub fn new(lattice: &Lattice) -> Self {
        let offset = |axis: usize, n: usize| ((n as f64 - (BRICK as f64 - 1.0) / 2.0) * lattice.pitch[axis]) as f32;
        Self {
            x: std::array::from_fn(|v| offset(0, v % BRICK)),
            y: std::array::from_fn(|v| offset(1, v / BRICK % BRICK)),
            z: std::array::from_fn(|v| offset(2, v / (BRICK * BRICK))),
        }
    }

    /// Position of a voxel relative to its brick's centre, mm.
    #[inline(always)]
    pub fn of(&self, voxel: usize) -> Vec3 {
        Vec3::new(self.x[voxel], self.y[voxel], self.z[voxel])
    }
}

/// The nearest surface point of each voxel of a brick.
#[derive(Debug, Clone)]
pub struct BrickSurface {
    /// Unsigned distance, mm.
    pub distance: [f32; BRICK_VOXELS],
    /// Position of the nearest triangle in the list of candidates.
    pub candidate: [u32; BRICK_VOXELS],
    /// No distance is off by more than this, mm.
    pub error: f32,
    /// The candidates, ready for the kernel.
    parts: Parts,
}

impl Default for BrickSurface {
    fn default() -> Self {
        Self { distance: [0.0; BRICK_VOXELS], candidate: [0; BRICK_VOXELS], error: 0.0, parts: Parts::default() }
    }
}

/// Rounding of the kernel in units of the largest coordinate's last place. Against double precision the worst of 28
/// million distances to triangles of all shapes, slivers 60 mm long among them, is 3.1 units; what [`MARGIN_ULPS`]
/// takes for outside can add 2·3·√3.
const ERROR_ULPS: f32 = 16.0;

/// Rounding of a distance from an edge within the triangle's plane, in units of the last place of the furthest corner's
/// distance. Without it, voxels beyond the tip of a sliver pass for inside, and the way to the tip is lost: 0.04 mm
/// were seen.
const MARGIN_ULPS: f32 = 3.0;

/// A triangle made ready for one brick.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prepared {
    corner: [Vec3; 3],
    edge: [Vec3; 3],
    inverse_length_squared: [f32; 3],
    /// Normals of the planes through the edges, pointing into the triangle.
    inward: [Vec3; 3],
    normal: Vec3,
    /// Signed distance of the brick's centre from the plane.
    height: f32,
    /// Rounding of the products with `inward`: a voxel is inside for certain when all are above.
    margin: [f32; 3],
}

impl Prepared {
    fn new(triangle: &[DVec3; 3], centre: DVec3) -> Self {
        let edges: [DVec3; 3] = std::array::from_fn(|i| triangle[(i + 1) % 3] - triangle[i]);
        let normal = edges[0].cross(-edges[2]).normalize_or_zero();
        let reach = triangle.iter().map(|v| (*v - centre).length_squared()).fold(0.0, f64::max).sqrt();
        let rounding = f64::from(MARGIN_ULPS * f32::EPSILON) * reach;
        Self {
            corner: triangle.map(|v| (v - centre).as_vec3()),
            edge: edges.map(|e| e.as_vec3()),
            inverse_length_squared: edges.map(|e| (1.0 / e.length_squared()) as f32),
            inward: edges.map(|e| normal.cross(e).as_vec3()),
            normal: normal.as_vec3(),
            height: normal.dot(centre - triangle[0]) as f32,
            margin: edges.map(|e| (rounding * e.length()) as f32),
        }
    }

    /// The squared distance of a position, given as seen from the three corners.
    #[inline(always)]
    fn squared(&self, sight: [EdgeSight; 3], height: f32) -> f32 {
        let (edges, inside) = self.edges(sight);
        let border = lesser(lesser(edges[0].squared, edges[1].squared), edges[2].squared);
        if inside { height * height } else { border }
    }

    /// The position as seen from its nearest point on the triangle, and the squared distance.
    #[inline(always)]
    pub(super) fn seen_from_foot(&self, [x, y, z]: [f32; 3]) -> ([f32; 3], f32) {
        let height = self.normal.x * x + self.normal.y * y + self.normal.z * z + self.height;
        let (edges, inside) = self.edges([self.sight(0, x, y, z), self.sight(1, x, y, z), self.sight(2, x, y, z)]);
        let [mut best, second, third] = edges;
        for edge in [second, third] {
            let stays = best.squared < edge.squared;
            for axis in 0..3 {
                best.from_foot[axis] = if stays { best.from_foot[axis] } else { edge.from_foot[axis] };
            }
            best.squared = if stays { best.squared } else { edge.squared };
        }
        let n = self.normal;
        let from_foot = [
            if inside { n.x * height } else { best.from_foot[0] },
            if inside { n.y * height } else { best.from_foot[1] },
            if inside { n.z * height } else { best.from_foot[2] },
        ];
        (from_foot, if inside { height * height } else { best.squared })
    }

    #[inline(always)]
    fn sight(&self, i: usize, x: f32, y: f32, z: f32) -> EdgeSight {
        let (corner, edge, inward) = (self.corner[i], self.edge[i], self.inward[i]);
        let (qx, qy) = (x - corner.x, y - corner.y);
        let (along, across) = (edge.x * qx + edge.y * qy, inward.x * qx + inward.y * qy);
        self.lift(i, [qx, qy, along, across], z)
    }

    /// Completes what is known of a position's x and y: its place relative to an edge's start, and its products with
    /// the edge and with the normal inwards as far as they depend on x and y.
    #[inline(always)]
    fn lift(&self, i: usize, [qx, qy, along, across]: [f32; 4], z: f32) -> EdgeSight {
        let qz = z - self.corner[i].z;
        EdgeSight { q: [qx, qy, qz], along: along + self.edge[i].z * qz, inward: across + self.inward[i].z * qz }
    }

    /// The three edges, and whether the position projects into the triangle for certain.
    #[inline(always)]
    fn edges(&self, sight: [EdgeSight; 3]) -> ([Edge; 3], bool) {
        let margin = &self.margin;
        let inside = (sight[0].inward >= margin[0]) & (sight[1].inward >= margin[1]) & (sight[2].inward >= margin[2]);
        ([self.edge(0, sight[0]), self.edge(1, sight[1]), self.edge(2, sight[2])], inside)
    }

    #[inline(always)]
    fn edge(&self, i: usize, EdgeSight { q: [qx, qy, qz], along, .. }: EdgeSight) -> Edge {
        let edge = self.edge[i];
        let t = along * self.inverse_length_squared[i];
        let t = lesser(greater(t, 0.0), 1.0);
        let (rx, ry, rz) = (qx - t * edge.x, qy - t * edge.y, qz - t * edge.z);
        Edge { from_foot: [rx, ry, rz], squared: rx * rx + ry * ry + rz * rz }
    }
}

/// A position as seen from the start of an edge.
#[derive(Clone, Copy)]
struct EdgeSight {
    q: [f32; 3],
    /// Its product with the edge.
    along: f32,
    /// On which side of the edge it is, in the triangle's plane; positive inside.
    inward: f32,
}

/// A position against one edge.
#[derive(Clone, Copy)]
struct Edge {
    /// From the nearest point of the edge to the position.
    from_foot: [f32; 3],
    /// Squared distance to the edge.
    squared: f32,
}

/// Finds for every voxel of the brick around `centre` the nearest of `candidates` (at least one; ties go to the first).
pub fn nearest_in_brick(
    triangles: &[[DVec3; 3]],
    candidates: &[u32],
    centre: DVec3,
    offsets: &BrickOffsets,
    out: &mut BrickSurface,
) {
    nearest_in_parts(triangles, candidates, centre, offsets, out, |_| true, |_, _, _| false);
}

/// The same for the parts of the brick that are `wanted` and that `settle` leaves. It is given a part, the positions in
/// `candidates` of all that can be nearest in it, and the distances there, and returns whether that is all one needs to
/// know. Voxels of other parts keep what they had.
pub fn nearest_in_parts(
    triangles: &[[DVec3; 3]],
    candidates: &[u32],
    centre: DVec3,
    offsets: &BrickOffsets,
    out: &mut BrickSurface,
    wanted: impl Fn(Part) -> bool,
    mut settle: impl FnMut(Part, &[u32], DepthRange) -> bool,
) {
    let mut parts = std::mem::take(&mut out.parts);
    parts.prepared.clear();
    parts.prepared.extend(candidates.iter().map(|&c| Prepared::new(&triangles[c as usize], centre)));
    let corners = parts.prepared.iter().flat_map(|prepared| prepared.corner);
    let reach = corners.fold(0.0_f32, |reach, corner| reach.max(corner.abs().max_element()));
    out.error = ERROR_ULPS * f32::EPSILON * reach;
    parts.lay_planes(offsets, out.error);
    for part in Part::all() {
        if wanted(part) {
            let range = parts.cull(part, out.error);
            if !settle(part, &parts.kept, range) {
                compare(&parts.prepared, &parts.kept, offsets, part, out);
            }
        }
    }
    out.parts = parts;
}

/// Finds for every voxel of a part the nearest of the triangles at the positions in `kept`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn compare(prepared: &[Prepared], kept: &[u32], offsets: &BrickOffsets, part: Part, out: &mut BrickSurface) {
    type Lanes = [f32; PART_COLUMNS];
    let first = part.first();
    let [x, y]: [Lanes; 2] = [&offsets.x, &offsets.y].map(|row| std::array::from_fn(|lane| row[first + lane]));
    // What depends on x and y alone: the same in all slices.
    let mut columns = [[[0.0; PART_COLUMNS]; 4]; 3];
    let mut heights = [0.0; PART_COLUMNS];
    let mut distance = [[f32::INFINITY; PART_COLUMNS]; PART_SLICES];
    let mut nearest = [[0; PART_COLUMNS]; PART_SLICES];
    for &position in kept {
        let triangle = &prepared[position as usize];
        for (i, [qx, qy, along, across]) in columns.iter_mut().enumerate() {
            let (corner, edge, inward) = (triangle.corner[i], triangle.edge[i], triangle.inward[i]);
            for lane in 0..PART_COLUMNS {
                qx[lane] = x[lane] - corner.x;
                qy[lane] = y[lane] - corner.y;
                along[lane] = edge.x * qx[lane] + edge.y * qy[lane];
                across[lane] = inward.x * qx[lane] + inward.y * qy[lane];
            }
        }
        for lane in 0..PART_COLUMNS {
            heights[lane] = triangle.normal.x * x[lane] + triangle.normal.y * y[lane];
        }
        for slice in 0..PART_SLICES {
            let z = offsets.z[first + slice * BRICK * BRICK];
            let (distance, nearest) = (&mut distance[slice], &mut nearest[slice]);
            for lane in 0..PART_COLUMNS {
                let column = |i: usize| {
                    let [qx, qy, along, across] = &columns[i];
                    [qx[lane], qy[lane], along[lane], across[lane]]
                };
                let sight =
                    [triangle.lift(0, column(0), z), triangle.lift(1, column(1), z), triangle.lift(2, column(2), z)];
                let squared = triangle.squared(sight, heights[lane] + triangle.normal.z * z + triangle.height);
                let nearer = squared < distance[lane];
                distance[lane] = if nearer { squared } else { distance[lane] };
                nearest[lane] = if nearer { position } else { nearest[lane] };
            }
        }
    }
    for slice in 0..PART_SLICES {
        let start = first + slice * BRICK * BRICK;
        for lane in 0..PART_COLUMNS {
            out.distance[start + lane] = distance[slice][lane].sqrt();
            out.candidate[start + lane] = nearest[slice][lane];
        }
    }
}

/// `a.min(b)` without its rules for NaN, which cost a blend.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
