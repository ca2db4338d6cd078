//! An object of a job, read and placed.

use glam::{DMat4, DVec3};

use super::{AskedMap, StackingReport};
use crate::{
    job::{Job, file::DepthFrom},
    mesh::{HealthReport, Solid},
};

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
    /// Whether it is a patch: a box whose depth is measured from its top, alone on the tray. It is looked at as a piece
    /// of a larger one.
    pub is_patch: bool,
    /// Its stackings.
    pub stackings: StackingReport,
    /// What its texture asks for.
    pub asked: AskedMap,
}

impl Job {
    /// Whether an object is a patch, see [`PreparedObject::is_patch`].
    pub(super) fn is_patch(&self, object: usize, solid: &Solid) -> bool {
        self.objects.len() == 1 && self.objects[object].depth_from == DepthFrom::Top && solid.is_box()
    }
}

/// Least and greatest corner of what triangles use, mm.
pub(super) fn bounds(solid: &Solid) -> [DVec3; 2] {
    let positions = || solid.mesh.triangles.iter().flatten().map(|&v| solid.mesh.positions[v as usize]);
    [positions().fold(DVec3::MAX, DVec3::min), positions().fold(DVec3::MIN, DVec3::max)]
}
