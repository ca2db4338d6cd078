//! Meshes to test on.

use glam::{DVec3, Vec2};
use lumislice::mesh::TriangleMesh;

/// Triangles to a mesh with shared vertices, in order of first use.
pub fn mesh_of(triangles: &[[DVec3; 3]]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for t in triangles {
        mesh.triangles.push(t.map(|p| {
            let found = mesh.positions.iter().position(|q| *q == p).unwrap_or_else(|| {
                mesh.positions.push(p);
                mesh.positions.len() - 1
            });
            found as u32
        }));
    }
    mesh
}

/// Corners of every triangle.
pub fn corners(mesh: &TriangleMesh) -> Vec<[DVec3; 3]> {
    mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).collect()
}

/// A box of 12 triangles that faces outwards.
pub fn box_triangles(low: DVec3, high: DVec3) -> Vec<[DVec3; 3]> {
    // Corner i has bit 0 for x, bit 1 for y, bit 2 for z.
    let corner = |i: u32| DVec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|t| t.map(corner)).collect()
}

/// Texture coordinates for [`box_triangles`], one chart for all faces, v downwards.
pub fn box_uvs() -> Vec<[Vec2; 3]> {
    let [a, b, c, d] = [[0.25, 0.75], [0.25, 0.125], [0.875, 0.125], [0.875, 0.75]].map(Vec2::from);
    (0..6).flat_map(|_| [[a, b, c], [a, c, d]]).collect()
}

/// A sphere by latitude and longitude that faces outwards.
pub fn sphere(center: DVec3, radius: f64, rings: usize) -> Vec<[DVec3; 3]> {
    let around = 2 * rings;
    let at = |i: usize, j: usize| {
        if i == 0 || i == rings {
            return center + DVec3::new(0.0, 0.0, if i == 0 { radius } else { -radius });
        }
        let (st, ct) = (std::f64::consts::PI * i as f64 / rings as f64).sin_cos();
        let (sp, cp) = (std::f64::consts::TAU * (j % around) as f64 / around as f64).sin_cos();
        center + radius * DVec3::new(st * cp, st * sp, ct)
    };
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..around {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if i + 1 < rings {
                triangles.push([a, b, c]);
            }
            if i > 0 {
                triangles.push([a, c, d]);
            }
        }
    }
    triangles
}

/// The same surface seen from the other side.
pub fn reversed(triangles: &[[DVec3; 3]]) -> Vec<[DVec3; 3]> {
    triangles.iter().map(|&[a, b, c]| [a, c, b]).collect()
}

/// Winding number of a surface around a point, as a real number (van Oosterom and Strackee 1983, eq. 8).
pub fn winding(surface: &[[DVec3; 3]], p: DVec3) -> f64 {
    let angle = |t: &[DVec3; 3]| {
        let [a, b, c] = t.map(|q| q - p);
        let [la, lb, lc] = [a.length(), b.length(), c.length()];
        let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(denominator)
    };
    surface.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}
