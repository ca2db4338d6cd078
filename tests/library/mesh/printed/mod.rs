//! Only the part is printed, and all of it: instances, poses, what a slicer marks as help or takes away.

mod gltf;
mod threemf;

use glam::DVec3;
use lumislice::mesh::{LoadOptions, Loaded, MeshError, close, load};

use super::writers::put;

fn try_read(name: &str, bytes: Vec<u8>) -> Result<Loaded, MeshError> {
    let folder = tempfile::tempdir().unwrap();
    load(&put(folder.path(), name, bytes), &LoadOptions::default())
}

/// Volume, and the longest sides.
fn solid(loaded: &Loaded) -> (f64, DVec3) {
    let health = close(loaded.mesh.clone()).unwrap().health;
    let positions = &loaded.mesh.positions;
    let low = positions.iter().copied().reduce(DVec3::min).unwrap();
    let high = positions.iter().copied().reduce(DVec3::max).unwrap();
    (health.volume_mm3, high - low)
}

fn near(found: f64, expected: f64) -> bool {
    (found / expected - 1.0).abs() < 1e-6
}

fn said(loaded: &Loaded, part: &str) -> bool {
    loaded.warnings.iter().any(|warning| warning.contains(part))
}
