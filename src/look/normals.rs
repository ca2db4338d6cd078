//! Normals by voxel, each found when it is first asked for: walks meet the same surface again and again, and the
//! nearest triangle takes far longer to find than a walk takes to its next event.

use std::sync::{
    OnceLock,
    atomic::{AtomicU32, Ordering::Relaxed},
};

use glam::{DVec2, DVec3, swizzles::Vec2Swizzles};

use super::scene::Place;
use crate::voxel::{BRICK, BRICK_VOXELS};

/// Normals of the voxels of bricks that a surface runs through; which thread found one first makes no difference.
pub(super) struct Normals {
    bricks: Vec<OnceLock<Box<[AtomicU32; BRICK_VOXELS]>>>,
}

/// Not asked for yet; asked for, and there is none. Both coordinates of a normal are at least 1.
const UNKNOWN: u32 = 0;
const NONE: u32 = 1;
/// Steps from the middle of a coordinate to either end.
const STEPS: f64 = 32767.0;

impl Normals {
    /// None yet, of so many bricks.
    pub fn new(bricks: usize) -> Self {
        Self { bricks: std::iter::repeat_with(OnceLock::new).take(bricks).collect() }
    }

    /// The normal at a voxel of a brick, within 1e-4 of what `find` tells of that voxel.
    #[inline]
    pub fn at(&self, brick: usize, cell: usize, find: impl FnOnce() -> Option<DVec3>) -> Option<DVec3> {
        let cells = self.bricks[brick].get_or_init(|| Box::new([const { AtomicU32::new(UNKNOWN) }; BRICK_VOXELS]));
        let mut packed = cells[cell].load(Relaxed);
        if packed == UNKNOWN {
            packed = find().map_or(NONE, pack);
            cells[cell].store(packed, Relaxed);
        }
        (packed != NONE).then(|| unpack(packed))
    }
}

/// Which voxel of its brick a place lies in.
#[inline]
pub(super) fn cell(place: Place) -> usize {
    let [x, y, z] = [place.x as usize % BRICK, place.y as usize % BRICK, place.z as usize % BRICK];
    x + BRICK * (y + BRICK * z)
}

/// The corners of a face of an octahedron that face down, folded over the others.
fn folded(at: DVec2) -> DVec2 {
    (1.0 - at.yx().abs()) * DVec2::new(1_f64.copysign(at.x), 1_f64.copysign(at.y))
}

/// A unit vector as a point of an octahedron laid flat (Meyer et al. 2010), 16 bits a coordinate.
fn pack(normal: DVec3) -> u32 {
    let on_octahedron = normal / normal.abs().element_sum();
    let flat = if normal.z < 0.0 { folded(on_octahedron.truncate()) } else { on_octahedron.truncate() };
    let [x, y] = flat.to_array().map(|at| ((at * STEPS).round() + STEPS + 1.0) as u32);
    x << 16 | y
}

fn unpack(packed: u32) -> DVec3 {
    let at = |bits: u32| (f64::from(bits) - STEPS - 1.0) / STEPS;
    let flat = DVec2::new(at(packed >> 16), at(packed & 0xFFFF));
    let z = 1.0 - flat.abs().element_sum();
    let flat = if z < 0.0 { folded(flat) } else { flat };
    flat.extend(z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_come_back_and_are_found_once() {
        let normals = Normals::new(2);
        for n in 0..BRICK_VOXELS {
            // Poles, the equator's seams, and what lies between.
            let (z, turn) = (1.0 - (n / 8) as f64 / 31.5, std::f64::consts::FRAC_PI_4 * (n % 8) as f64);
            let across = (1.0 - z * z).max(0.0).sqrt();
            let normal = DVec3::new(across * libm::cos(turn), across * libm::sin(turn), z);
            let found = normals.at(1, n, || Some(normal)).unwrap();
            assert!(found.distance(normal) < 1e-4, "{normal}: {found}");
            assert_eq!(normals.at(1, n, || unreachable!()), Some(found));
        }
        assert_eq!(normals.at(0, 7, || None), None);
        assert_eq!(normals.at(0, 7, || unreachable!()), None);
    }

    #[test]
    fn cells_are_voxels_of_a_brick() {
        let cells: std::collections::BTreeSet<usize> = (0..BRICK_VOXELS)
            .map(|n| cell(DVec3::new((n % 8) as f64 + 8.5, (n / 8 % 8) as f64 + 16.2, (n / 64) as f64 + 0.9)))
            .collect();
        assert_eq!(cells.len(), BRICK_VOXELS);
    }
}
