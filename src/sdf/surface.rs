//! The closest surface point of a position: best-first descent of a bounding volume hierarchy.
//!
//! The hierarchy is built by obvhs over single-precision boxes that are rounded outwards, so that they contain the
//! double-precision triangles; distances to triangles are computed in double precision. Ties go to the lowest index.

use glam::{DVec3, Vec3A};
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2, bvh2::builder::build_bvh2};

use super::triangle::closest_point;
use crate::mesh::TriangleMesh;

/// All triangles of an object, ready for closest-point queries.
pub struct Surface {
    triangles: Vec<[DVec3; 3]>,
    bvh: Bvh2,
}

/// The surface point nearest to a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Index of its triangle in the mesh.
    pub triangle: u32,
    /// The point, mm.
    pub point: DVec3,
    /// Its weights of the triangle's corners.
    pub barycentric: [f64; 3],
    /// Unsigned distance from the position, mm.
    pub distance: f64,
}

impl std::fmt::Debug for Surface {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Surface").field("triangles", &self.triangles.len()).finish_non_exhaustive()
    }
}

impl Surface {
    /// Builds the hierarchy; `None` for a mesh without triangles.
    pub fn new(mesh: &TriangleMesh) -> Option<Self> {
        let corners = |t: &[u32; 3]| t.map(|v| mesh.positions[v as usize]);
        Self::of_triangles(mesh.triangles.iter().map(corners).collect())
    }

    /// The same of triangles by their corners; `None` without any.
    pub fn of_triangles(triangles: Vec<[DVec3; 3]>) -> Option<Self> {
        if triangles.is_empty() {
            return None;
        }
        let boxes: Vec<_> = triangles.iter().map(outward_box).collect();
        let bvh = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Default::default());
        Some(Self { triangles, bvh })
    }

    /// Corners of every triangle, mm.
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// The surface point nearest to `p`.
    pub fn closest(&self, p: DVec3) -> SurfacePoint {
        self.closest_among(p, (f64::INFINITY, u32::MAX))
    }

    /// The same, sooner where one of the triangles `likely` is near.
    pub fn closest_near(&self, p: DVec3, likely: &[u32]) -> SurfacePoint {
        let known = |&triangle: &u32| (closest_point(p, &self.triangles[triangle as usize]).distance_squared, triangle);
        let nearer = |best: (f64, u32), other: (f64, u32)| if other < best { other } else { best };
        self.closest_among(p, likely.iter().map(known).fold((f64::INFINITY, u32::MAX), nearer))
    }

    /// The surface point nearest to `p`, if a triangle at a squared distance is known.
    fn closest_among(&self, p: DVec3, mut best: (f64, u32)) -> SurfacePoint {
        let mut stack = Vec::with_capacity(64);
        stack.push((0.0, 0_usize));
        while let Some((bound, node)) = stack.pop() {
            if bound > best.0 {
                continue;
            }
            let node = &self.bvh.nodes[node];
            let first = node.first_index as usize;
            if node.is_leaf() {
                for &triangle in &self.bvh.primitive_indices[first..first + node.prim_count as usize] {
                    let d = closest_point(p, &self.triangles[triangle as usize]).distance_squared;
                    if d < best.0 || (d == best.0 && triangle < best.1) {
                        best = (d, triangle);
                    }
                }
            } else {
                let mut children = [first, first + 1].map(|c| (box_distance_squared(p, self.bvh.nodes[c].aabb()), c));
                if children[0].0 < children[1].0 {
                    children.swap(0, 1); // the nearer one is visited first
                }
                stack.extend(children.into_iter().filter(|c| c.0 <= best.0));
            }
        }
        let found = closest_point(p, &self.triangles[best.1 as usize]);
        SurfacePoint {
            triangle: best.1,
            point: found.point,
            barycentric: found.barycentric,
            distance: found.distance_squared.sqrt(),
        }
    }

    /// Replaces `found` by the indices of all triangles within `radius` of `p`, ascending; some slightly further away
    /// may be among them.
    pub fn within(&self, p: DVec3, radius: f64, found: &mut Vec<u32>) {
        found.clear();
        let limit = radius * radius;
        let mut stack = Vec::with_capacity(64);
        stack.push(0_usize);
        while let Some(node) = stack.pop() {
            let node = &self.bvh.nodes[node];
            if box_distance_squared(p, node.aabb()) > limit {
                continue;
            }
            let first = node.first_index as usize;
            if node.is_leaf() {
                let primitives = &self.bvh.primitive_indices[first..first + node.prim_count as usize];
                found.extend(
                    primitives
                        .iter()
                        .filter(|&&t| closest_point(p, &self.triangles[t as usize]).distance_squared <= limit),
                );
            } else {
                stack.extend([first, first + 1]);
            }
        }
        found.sort_unstable();
    }
}

/// The box of a triangle in single precision, rounded outwards.
fn outward_box(triangle: &[DVec3; 3]) -> Aabb {
    let low = triangle[0].min(triangle[1]).min(triangle[2]);
    let high = triangle[0].max(triangle[1]).max(triangle[2]);
    let down = |v: f64| (v as f32).next_down();
    let up = |v: f64| (v as f32).next_up();
    Aabb::new(Vec3A::new(down(low.x), down(low.y), down(low.z)), Vec3A::new(up(high.x), up(high.y), up(high.z)))
}

#[inline]
fn box_distance_squared(p: DVec3, aabb: &Aabb) -> f64 {
    let (low, high) = (aabb.min.as_dvec3(), aabb.max.as_dvec3());
    (low - p).max(p - high).max(DVec3::ZERO).length_squared()
}
