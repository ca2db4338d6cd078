//! The volume: which material fills each voxel.

use crate::optics::OpticsError;

/// Material ids on a regular grid below the lit top.
///
/// x and y run along the top, z **down** into the volume, so that layer 0 is the one that is lit. The id of voxel (i,
/// j, k) is `ids[i + dims[0]·(j + dims[1]·k)]`; the voxel fills [i, i + 1)·pitch and so on, its corner (0, 0, 0) at the
/// origin.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelGrid {
    dims: [usize; 3],
    pitch_mm: [f64; 3],
    ids: Vec<u8>,
}

impl VoxelGrid {
    /// A grid of `dims` voxels of `pitch_mm` each.
    ///
    /// # Errors
    /// [`OpticsError::Parameter`] for a grid without voxels, ids that are not one per voxel, or a pitch that is not
    /// finite and positive.
    pub fn new(dims: [usize; 3], pitch_mm: [f64; 3], ids: Vec<u8>) -> Result<Self, OpticsError> {
        let voxels = dims.iter().try_fold(1_usize, |product, &n| product.checked_mul(n)).unwrap_or(0);
        if voxels == 0 || voxels != ids.len() {
            let found = format!("{} ids", ids.len());
            let [x, y, z] = dims;
            return Err(OpticsError::parameter("voxel grid", found, format!("one for each of {x} × {y} × {z} voxels")));
        }
        if let Some(bad) = pitch_mm.iter().find(|pitch| !(**pitch > 0.0 && pitch.is_finite())) {
            return Err(OpticsError::parameter("voxel pitch", bad, "finite millimetres, more than 0".into()));
        }
        Ok(Self { dims, pitch_mm, ids })
    }

    /// Voxels along x, y and z.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Size of a voxel, mm.
    pub fn pitch_mm(&self) -> [f64; 3] {
        self.pitch_mm
    }

    /// Size of the grid, mm.
    pub fn size_mm(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.dims[axis] as f64 * self.pitch_mm[axis])
    }

    /// The ids, x fastest.
    pub fn ids(&self) -> &[u8] {
        &self.ids
    }
}
