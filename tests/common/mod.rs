//! What several test programs need: shapes, winding numbers, and the files that lie beside the project.

mod shapes;

use std::path::{Path, PathBuf};

use glam::DVec3;
use lumislice::mesh::TriangleMesh;

pub use shapes::{Triangles, box_triangles, indexed, reversed, sphere};

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

/// Corners of every triangle.
pub fn corners(mesh: &TriangleMesh) -> Triangles {
    mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).collect()
}

/// A file of the folder that lies beside the project, if it does; what is skipped is said.
pub fn shared(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("LUMISLICE_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let path = folder.join(name);
    if !path.exists() {
        println!("skipped: {name} is not there");
        return None;
    }
    Some(path)
}
