//! Nearest of a few triangles for the 512 voxels of a brick.
//!
//! Single precision, in coordinates relative to the brick's centre, without branches, so that the compiler turns it into
//! vector code; built for several instruction sets and chosen at run time. Nothing is contracted or reordered, so
//! every instruction set gives the same bits.
//!
//! A voxel's distance is the one to the triangle's plane where the voxel projects into the triangle, else the least of the
//! distances to its three edges. [`BrickSurface::error`] bounds the rounding error; who needs more (a depth near a
//! layer boundary) asks [`super::closest_point`] again in double precision.

use glam::{DVec3, Vec3};
use multiversion::multiversion;

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
}

impl Default for BrickSurface {
    fn default() -> Self {
        Self { distance: [0.0; BRICK_VOXELS], candidate: [0; BRICK_VOXELS], error: 0.0 }
    }
}

/// Rounding of the kernel in units of the largest coordinate's last place. Against double precision the worst of 28 million distances to
/// triangles of all shapes, slivers 60 mm long among them, is 3.1 units; what [`MARGIN_ULPS`] takes for outside can add 2·3·√3.
const ERROR_ULPS: f32 = 16.0;

/// Rounding of a distance from an edge within the triangle's plane, in units of the last place of the furthest corner's distance.
/// Without it, voxels beyond the tip of a sliver pass for inside, and the way to the tip is lost: 0.04 mm were seen.
const MARGIN_ULPS: f32 = 3.0;

/// A triangle made ready for one brick.
#[derive(Clone, Copy)]
struct Prepared {
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
}

/// Finds for every voxel of the brick around `centre` the nearest of `candidates` (at least one; ties go to the first).
pub fn nearest_in_brick(
    triangles: &[[DVec3; 3]],
    candidates: &[u32],
    centre: DVec3,
    offsets: &BrickOffsets,
    out: &mut BrickSurface,
) {
    out.distance.fill(f32::INFINITY);
    let mut reach = 0.0_f32;
    for (position, &candidate) in (0..).zip(candidates) {
        let prepared = Prepared::new(&triangles[candidate as usize], centre);
        reach = prepared.corner.iter().fold(reach, |reach, corner| reach.max(corner.abs().max_element()));
        compare(&prepared, position, offsets, out);
    }
    for distance in &mut out.distance {
        *distance = distance.sqrt();
    }
    out.error = ERROR_ULPS * f32::EPSILON * reach;
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn compare(triangle: &Prepared, position: u32, offsets: &BrickOffsets, out: &mut BrickSurface) {
    for voxel in 0..BRICK_VOXELS {
        let [x, y, z] = [offsets.x[voxel], offsets.y[voxel], offsets.z[voxel]];
        let edges: [_; 3] = [edge(triangle, 0, x, y, z), edge(triangle, 1, x, y, z), edge(triangle, 2, x, y, z)];
        let height = dot(triangle.normal, x, y, z) + triangle.height;
        let margin = &triangle.margin;
        let inside = (edges[0].inward >= margin[0]) & (edges[1].inward >= margin[1]) & (edges[2].inward >= margin[2]);
        let border = lesser(lesser(edges[0].squared, edges[1].squared), edges[2].squared);
        let squared = if inside { height * height } else { border };
        let nearer = squared < out.distance[voxel];
        out.distance[voxel] = if nearer { squared } else { out.distance[voxel] };
        out.candidate[voxel] = if nearer { position } else { out.candidate[voxel] };
    }
}

/// A voxel against one edge.
struct Edge {
    /// Squared distance to the edge.
    squared: f32,
    /// On which side of the edge, in the triangle's plane; positive inside.
    inward: f32,
}

#[inline(always)]
fn edge(triangle: &Prepared, i: usize, x: f32, y: f32, z: f32) -> Edge {
    let (corner, edge) = (triangle.corner[i], triangle.edge[i]);
    let (qx, qy, qz) = (x - corner.x, y - corner.y, z - corner.z);
    let t = dot(edge, qx, qy, qz) * triangle.inverse_length_squared[i];
    let t = lesser(greater(t, 0.0), 1.0);
    let (rx, ry, rz) = (qx - t * edge.x, qy - t * edge.y, qz - t * edge.z);
    Edge { squared: rx * rx + ry * ry + rz * rz, inward: dot(triangle.inward[i], qx, qy, qz) }
}

#[inline(always)]
fn dot(v: Vec3, x: f32, y: f32, z: f32) -> f32 {
    v.x * x + v.y * y + v.z * z
}

/// `a.min(b)` without its rules for NaN, which cost a blend.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
