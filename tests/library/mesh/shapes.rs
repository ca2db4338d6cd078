//! Meshes to test on.

use glam::{DVec3, Vec2};
use lumislice::mesh::TriangleMesh;

pub use crate::common::{box_triangles, corners, indexed, reversed, sphere, winding};

/// Triangles to a mesh with shared vertices, in order of first use.
pub fn mesh_of(triangles: &[[DVec3; 3]]) -> TriangleMesh {
    let (positions, triangles) = indexed(triangles);
    TriangleMesh { positions, triangles, ..TriangleMesh::default() }
}

/// Texture coordinates for [`box_triangles`], one chart for all faces, v downwards.
pub fn box_uvs() -> Vec<[Vec2; 3]> {
    let [a, b, c, d] = [[0.25, 0.75], [0.25, 0.125], [0.875, 0.125], [0.875, 0.75]].map(Vec2::from);
    (0..6).flat_map(|_| [[a, b, c], [a, c, d]]).collect()
}
