//! One photon's random walk through a slab: the flights of every print's [`Walker`], and what lies where the slab ends.
//!
//! ```text
//!   z = 0   ─────────────── lit; what comes back here leaves by the top
//!           │   voxels    │ sides: the slab again, its mirror image, or nothing
//!   z = end ───────────────
//!               base        a half-space as wide as the slab, or nothing: light leaves by the bottom
//! ```
//!
//! A flight that leaves the voxels is cut at the face it leaves by and drawn anew beyond it: optical depths have no
//! memory, so nothing is lost by that.

use glam::DVec3;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::{
    Sides, VoxelScene,
    scene::Place,
    walker::{Roulette, Walker},
};
use crate::optics::monte_carlo::photon::{Direction, FAINT, REVIVED};

/// How a walk ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum End {
    /// Through the top at `at`, mm, within the slab; `turns` are the periods that it left the slab by, as mm to add.
    Top { at: [f64; 2], turns: [f64; 2], weight: f64 },
    /// Through the bottom.
    Bottom { weight: f64 },
    /// Through an open side.
    Side { weight: f64 },
    /// Absorbed.
    Absorbed,
}

/// A slab as a walk sees it.
pub(super) struct Walk<'a> {
    walker: Walker<'a>,
    slab: &'a VoxelScene,
    /// Voxels along each axis.
    dims: DVec3,
}

/// A photon on its way, in voxels.
struct Photon {
    place: Place,
    direction: Direction,
    /// Periods that it left the slab by, mm.
    turns: [f64; 2],
    weight: f64,
}

/// How far inside a face a photon that comes in by it begins, voxels: the face on the far side belongs to no voxel.
const INSIDE: f64 = 1e-9;

impl<'a> Walk<'a> {
    pub fn new(slab: &'a VoxelScene) -> Self {
        let scene = &slab.scene;
        let dims = DVec3::from(scene.volume().lattice().dims.map(f64::from));
        // What leaves far from where it entered is told by faint walks.
        let roulette = Roulette { faint: FAINT, revived: REVIVED };
        Self { walker: Walker { roulette, ..Walker::new(scene, &scene.media()[0]) }, slab, dims }
    }

    /// Follows one photon that enters the top at `at`, mm, until it leaves or dies.
    pub fn trace(&self, at: [f64; 2], direction: Direction, rng: &mut Xoshiro256PlusPlus) -> End {
        let place = DVec3::new(at[0], at[1], 0.0) * self.walker.scene.per_mm();
        let place = place.min(self.dims - INSIDE);
        let mut photon = Photon { place, direction, turns: [0.0; 2], weight: 1.0 };
        let mut depth = self.walker.media.depth(rng);
        loop {
            let from = photon.place;
            let id = match self.walker.fly_on(&mut photon.place, photon.direction, &mut depth, rng) {
                Some(id) => id,
                None => {
                    depth = self.walker.media.depth(rng);
                    photon.place = from;
                    match self.leave(&mut photon, rng) {
                        Some(end) => return end,
                        None => continue,
                    }
                }
            };
            match self.walker.scatter(id, photon.direction, photon.weight, rng) {
                Some(next) => (photon.direction, photon.weight) = next,
                None => return End::Absorbed,
            }
        }
    }

    /// Takes a photon to the face that it leaves the voxels by and to what lies beyond; `None` where it comes in again.
    fn leave(&self, photon: &mut Photon, rng: &mut Xoshiro256PlusPlus) -> Option<End> {
        let Photon { place, direction, weight, .. } = *photon;
        let step = DVec3::new(direction.x, direction.y, direction.z) * self.walker.scene.per_mm();
        let mut nearest = (f64::INFINITY, 2);
        for axis in (0..3).filter(|&axis| step[axis] != 0.0) {
            let face = if step[axis] > 0.0 { self.dims[axis] } else { 0.0 };
            let way = ((face - place[axis]) / step[axis]).max(0.0);
            if way < nearest.0 {
                nearest = (way, axis);
            }
        }
        let (way, axis) = nearest;
        photon.place = (place + step * way).clamp(DVec3::ZERO, self.dims - INSIDE);
        match (axis, step[axis] > 0.0) {
            (2, false) => {
                let pitch = self.walker.scene.volume().lattice().pitch;
                let at = [0, 1].map(|axis| photon.place[axis] * pitch[axis]);
                Some(End::Top { at, turns: photon.turns, weight })
            }
            (2, true) => match self.slab.base {
                Some(base) => self.below(photon, base, rng),
                None => Some(End::Bottom { weight }),
            },
            (_, up) => {
                // Beyond the face by nothing: the next period begins there.
                let beyond = if up { self.dims[axis] } else { -INSIDE };
                photon.place[axis] = beyond;
                (!self.pass_sides(photon)).then_some(End::Side { weight })
            }
        }
    }

    /// Walks through the half-space below, of material `base`, until the slab is met from below (`None`) or all ends.
    fn below(&self, photon: &mut Photon, base: u8, rng: &mut Xoshiro256PlusPlus) -> Option<End> {
        let media = self.walker.media;
        let per_mm = self.walker.scene.per_mm();
        loop {
            let Direction { x, y, z } = photon.direction;
            let flight = media.depth(rng) / media.sigma_t(base);
            let up = (self.dims.z - photon.place.z) / (z * per_mm.z);
            let returns = z < 0.0 && up <= flight;
            photon.place += DVec3::new(x, y, z) * per_mm * if returns { up } else { flight };
            if !self.pass_sides(photon) {
                return Some(End::Side { weight: photon.weight });
            }
            if returns {
                photon.place.z = self.dims.z - INSIDE;
                return None;
            }
            match self.walker.scatter(base, photon.direction, photon.weight, rng) {
                Some(next) => (photon.direction, photon.weight) = next,
                None => return Some(End::Absorbed),
            }
        }
    }

    /// Brings a photon beyond the sides back into the slab; `false` where it is lost.
    fn pass_sides(&self, photon: &mut Photon) -> bool {
        let pitch = self.walker.scene.volume().lattice().pitch;
        for axis in 0..2 {
            let (at, dim) = (photon.place[axis], self.dims[axis]);
            if at >= 0.0 && at < dim {
                continue;
            }
            let passed = (at / dim).floor();
            let within = at - passed * dim;
            let turned = match self.slab.sides {
                Sides::Open => return false,
                Sides::Periodic => {
                    photon.turns[axis] += passed * dim * pitch[axis];
                    false
                }
                Sides::Mirrored => passed.rem_euclid(2.0) != 0.0,
            };
            let place = if turned { dim - within } else { within };
            photon.place[axis] = place.clamp(0.0, dim - INSIDE);
            if turned {
                let Direction { x, y, .. } = &mut photon.direction;
                let along = if axis == 0 { x } else { y };
                *along = -*along;
            }
        }
        true
    }
}
