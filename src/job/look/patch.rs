//! A flat patch seen from above, as a piece of a larger one.
//!
//! Depth that is measured from the top of a box is that of a patch: what was asked for was measured or painted without
//! its sides, which are not layered, and let in light that no layer can make up for. So the patch is looked at between
//! its mirror images, as equation 7 has it and `lumislice compare` looks at it, on more of its core: no light comes
//! from below it, for which nothing was asked.

use std::sync::Arc;

use glam::DVec3;

use super::{LOOK_VOXELS, LookError};
use crate::{
    appearance::mirrored,
    job::Prepared,
    look::{Scene, Volume},
    sdf::Surface,
    voxel::{Lattice, MaterialId},
};

/// How far mirror images reach, and the core below, mm: beyond it hardly any light comes from.
const MARGIN_MM: f64 = 6.0;

impl Prepared {
    /// Voxels that light goes through when the print is looked at: a patch's and those of its mirror images. The core
    /// below them takes hardly any memory.
    pub(in crate::job) fn looked_at_voxels(&self) -> u64 {
        let Lattice { dims: [x, y, z], pitch, .. } = self.lattice;
        if !self.objects.first().is_some_and(|object| object.is_patch) {
            return self.lattice.voxels();
        }
        let wide = |n: u32, pitch: f64| u64::from(n) + 2 * margin(pitch);
        wide(x, pitch.x) * wide(y, pitch.y) * u64::from(z)
    }

    /// Where the job is a [patch](crate::job::PreparedObject::is_patch), what fills `scene` between its mirror images.
    pub(in crate::job) fn between_mirrors(&self, scene: &Scene) -> Result<Option<Scene>, LookError> {
        let Some(object) = self.objects.first().filter(|object| object.is_patch) else { return Ok(None) };
        if self.looked_at_voxels() > LOOK_VOXELS {
            return Ok(None);
        }
        let (core, _) = self.materials.mixture(&object.stackings.core)?.parts()[0];
        let core = MaterialId::from_resin(core.0);
        let Some((volume, surface)) = between_mirrors(scene.volume(), object.bounds, core)? else { return Ok(None) };
        self.lit_under(volume, vec![Arc::new(surface)]).map(Some)
    }
}

/// Voxels that a mirror image is wide.
fn margin(pitch_mm: f64) -> u64 {
    (MARGIN_MM / pitch_mm).ceil() as u64
}

/// The voxels of a box of `bounds` (mm) with those of its mirror images beside it and `core` below, and the top of them
/// all. `None` where no voxel is inside.
fn between_mirrors(
    volume: &Volume,
    [low, high]: [DVec3; 2],
    core: MaterialId,
) -> Result<Option<(Volume, Surface)>, LookError> {
    let lattice = *volume.lattice();
    // Columns whose centres are inside, and mirrored ones on either side.
    let inside = |axis: usize| {
        let is_inside = |&n: &u32| {
            let mut voxel = [0; 3];
            voxel[axis] = n;
            (low[axis]..high[axis]).contains(&lattice.centre(voxel)[axis])
        };
        let mut columns = (0..lattice.dims[axis]).filter(is_inside);
        let first = columns.next()?;
        Some((first, 1 + columns.count() as u32, margin(lattice.pitch[axis]) as u32))
    };
    let (Some(x), Some(y)) = (inside(0), inside(1)) else { return Ok(None) };
    let source = |at: u32, (first, count, margin): (u32, u32, u32)| {
        i64::from(first) + mirrored(at as isize - margin as isize, count as usize) as i64
    };
    let before = |(first, _, margin): (u32, u32, u32)| f64::from(first) - f64::from(margin);
    let below = margin(lattice.pitch.z) as u32;
    let wide = Lattice {
        origin: lattice.origin + lattice.pitch * DVec3::new(before(x), before(y), -f64::from(below)),
        dims: [x.1 + 2 * x.2, y.1 + 2 * y.2, lattice.dims[2] + below],
        ..lattice
    };
    let mut found = Volume::new(wide)?;
    for start in (0..wide.dims[2]).step_by(Volume::LAYER as usize) {
        found.add_slices(start..wide.dims[2].min(start + Volume::LAYER), |j, k, row| {
            if wide.centre([0, 0, k]).z < low.z {
                row.fill(core.0);
                return;
            }
            let (j, k) = (source(j, y), i64::from(k) - i64::from(below));
            for (i, id) in (0..).zip(row) {
                *id = volume.voxel([source(i, x), j, k]).0;
            }
        });
    }
    let end = wide.origin + wide.pitch * DVec3::from(wide.dims.map(f64::from));
    let corner = |x: f64, y: f64| DVec3::new(x, y, high.z);
    let [a, b, c, d] = [
        corner(wide.origin.x, wide.origin.y),
        corner(end.x, wide.origin.y),
        corner(end.x, end.y),
        corner(wide.origin.x, end.y),
    ];
    Ok(Surface::of_triangles(vec![[a, b, c], [a, c, d]]).map(|surface| (found, surface)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patch_goes_on_as_its_mirror_images() {
        // Columns 1 to 3 of 5 along x are inside, and 0 to 1 of 2 along y; of 3 slices the upper two.
        let pitch = DVec3::new(2.0, 3.0, 1.0);
        let lattice = Lattice { origin: DVec3::new(-2.0, 0.0, 0.0), pitch, dims: [5, 2, 3] };
        let mut volume = Volume::new(lattice).unwrap();
        volume.add_slices(0..3, |j, k, row| {
            row.iter_mut().enumerate().for_each(|(i, id)| *id = (1 + i + 10 * j as usize + 50 * k as usize) as u8);
        });
        let bounds = [DVec3::Z, DVec3::new(6.0, 6.0, 3.0)];
        let (found, surface) = between_mirrors(&volume, bounds, MaterialId(99)).unwrap().unwrap();
        assert_eq!(found.lattice().dims, [3 + 2 * 3, 2 + 2 * 2, 6 + 3]);
        assert_eq!(found.lattice().origin, DVec3::new(-6.0, -6.0, -6.0));
        let row = |j: i64, k: i64| (0..9).map(|i| found.voxel([i, j, 6 + k]).0).collect::<Vec<_>>();
        assert!([row(0, -6), row(3, -1), row(4, 0)].into_iter().flatten().all(|id| id == 99));
        assert_eq!(row(2, 1), [54, 53, 52, 52, 53, 54, 54, 53, 52]);
        assert_eq!(row(1, 2), row(2, 2));
        assert_eq!(row(0, 1), row(3, 1));
        assert_eq!(row(3, 1)[3], 2 + 10 + 50);
        assert!(surface.triangles().iter().flatten().all(|corner| corner.z == 3.0 && corner.x.abs() <= 12.0));
    }
}
