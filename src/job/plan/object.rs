//! An object of a job, read and placed.

use glam::{DMat4, DVec3};

use super::{AskedMap, StackingReport};
use crate::mesh::{HealthReport, Solid};

/// An object, read and placed.
#[derive(Debug)]
pub struct PreparedObject {
    /// Its mesh file as the job writes it.
    pub mesh: String,
    /// Mesh file coordinates to lattice frame, mm.
    pub transform: DMat4,
    /// The state of its mesh.
    pub health: HealthReport,
    /// Least and greatest corner of its bounding box, mm.
    pub bounds: [DVec3; 2],
    /// Its stackings.
    pub stackings: StackingReport,
    /// What its texture asks for.
    pub asked: AskedMap,
}

/// Least and greatest corner of what triangles use, mm.
pub(super) fn bounds(solid: &Solid) -> [DVec3; 2] {
    let positions = || solid.mesh.triangles.iter().flatten().map(|&v| solid.mesh.positions[v as usize]);
    [positions().fold(DVec3::MAX, DVec3::min), positions().fold(DVec3::MIN, DVec3::max)]
}
