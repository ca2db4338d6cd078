//! Where the voxels are.

use glam::DVec3;
use thiserror::Error;

use crate::words::short;

/// A regular lattice of voxels; the pitch differs per axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Lower corner of voxel (0, 0, 0), mm.
    pub origin: DVec3,
    /// Edge lengths of a voxel, mm.
    pub pitch: DVec3,
    /// Voxels per axis.
    pub dims: [u32; 3],
}

/// A lattice that cannot be.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LatticeError {
    /// The pitch is not a positive length.
    #[error("the pitch along {axis} is {} mm, expected a positive length", short(*found))]
    Pitch {
        /// x, y or z.
        axis: char,
        /// The offending value.
        found: f64,
    },
    /// Too many voxels along one axis.
    #[error(
        "{} mm along {axis} at a pitch of {} mm is {voxels:.0} voxels, expected at most {max}",
        short(*extent_mm), short(*pitch_mm)
    )]
    TooLarge {
        /// x, y or z.
        axis: char,
        /// Extent of the objects, mm.
        extent_mm: f64,
        /// Pitch, mm.
        pitch_mm: f64,
        /// Voxels it would take.
        voxels: f64,
        /// The most there may be.
        max: u32,
    },
}

impl crate::blame::Blamed for LatticeError {}

impl Lattice {
    /// Most voxels along an axis: indices and their products with slab sizes stay within 32 and 64 bits.
    pub const MAX_DIM: u32 = 1 << 20;

    /// The lattice whose origin is 0 and that covers `extent` mm: dims = ceil(extent / pitch), at least 1, no margin.
    ///
    /// A quotient within one part in 10⁹ above a whole number counts as that number, so that 30 mm at 0.1 mm is 300.
    pub fn covering(extent: DVec3, pitch: DVec3) -> Result<Self, LatticeError> {
        const ROUNDING: f64 = 1e-9;
        let mut dims = [0; 3];
        for (axis, name) in ['x', 'y', 'z'].into_iter().enumerate() {
            let (extent_mm, pitch_mm) = (extent[axis], pitch[axis]);
            if !(pitch_mm.is_finite() && pitch_mm > 0.0) {
                return Err(LatticeError::Pitch { axis: name, found: pitch_mm });
            }
            let voxels = (extent_mm / pitch_mm * (1.0 - ROUNDING)).ceil();
            if !(voxels <= f64::from(Self::MAX_DIM)) {
                return Err(LatticeError::TooLarge { axis: name, extent_mm, pitch_mm, voxels, max: Self::MAX_DIM });
            }
            dims[axis] = (voxels as u32).max(1);
        }
        Ok(Self { origin: DVec3::ZERO, pitch, dims })
    }

    /// Coordinate along `axis` of the centre of voxel `index`, mm.
    #[inline]
    pub fn coordinate(&self, axis: usize, index: u32) -> f64 {
        self.origin[axis] + (f64::from(index) + 0.5) * self.pitch[axis]
    }

    /// Centre of voxel (i, j, k), mm.
    #[inline]
    pub fn centre(&self, index: [u32; 3]) -> DVec3 {
        DVec3::new(self.coordinate(0, index[0]), self.coordinate(1, index[1]), self.coordinate(2, index[2]))
    }

    /// Number of voxels.
    pub fn voxels(&self) -> u64 {
        self.dims.iter().map(|&d| u64::from(d)).product()
    }

    /// Volume of one voxel, mm³.
    pub fn voxel_volume(&self) -> f64 {
        self.pitch.x * self.pitch.y * self.pitch.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_quotients_do_not_gain_a_voxel() {
        let lattice = Lattice::covering(DVec3::new(30.0, 0.3, 1.05), DVec3::splat(0.1)).unwrap();
        assert_eq!(lattice.dims, [300, 3, 11]);
        assert_eq!(lattice.coordinate(2, 10), 10.5 * 0.1);
    }

    #[test]
    fn absurd_sizes_are_refused() {
        assert!(Lattice::covering(DVec3::splat(1e9), DVec3::splat(0.01)).is_err());
        assert!(Lattice::covering(DVec3::ONE, DVec3::new(0.1, 0.0, 0.1)).is_err());
        assert!(Lattice::covering(DVec3::ONE, DVec3::new(0.1, f64::NAN, 0.1)).is_err());
    }
}
