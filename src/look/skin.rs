//! The surface of a print to light where refractive indices differ from air's: it reflects after Fresnel and bends
//! after Snell, by the **mesh's** normal, for a print is smooth where its voxels have steps.
//!
//! ```text
//!   in resin ──► leaves a printed voxel, outwards by the mesh ──► mirrored back, or bent into air
//!                          inwards by the mesh: a step of voxels, not a surface ──► goes on as it was
//!   in air ────► meets a printed voxel, inwards by the mesh ────► mirrored, or bent into resin
//! ```
//!
//! Flights step from voxel to voxel only in bricks that may hold a surface; elsewhere they leap as ever. Boundaries
//! between resins of unlike indices are not seen.

use std::sync::Arc;

use glam::DVec3;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::{
    Volume,
    scene::{NUDGE_MM, Place, way_out},
    strides::steps_to,
    walker::{Walker, WayOut},
};
use crate::optics::{
    fresnel::refraction,
    monte_carlo::photon::{Direction, uniform},
};
use crate::sdf::Surface;
use crate::voxel::{BRICK, BRICK_VOXELS, Tile};

/// What bends light, and where.
pub(super) struct Skin {
    surfaces: Vec<Arc<Surface>>,
    /// Refractive index by id.
    index: [f64; 256],
    /// Within so many bricks around each there is no surface; 0: there may be one in the brick itself.
    clear: Vec<u8>,
}

impl std::fmt::Debug for Skin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Skin").field("surfaces", &self.surfaces.len()).finish_non_exhaustive()
    }
}

/// Where light is: in air, or in resin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Medium {
    Air,
    Resin,
}

/// A ray on its way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub place: Place,
    pub direction: DVec3,
    pub medium: Medium,
    /// Where it last scattered or left the print.
    pub left: Place,
}

impl Skin {
    /// `indices` by id, that of the background first; `surfaces` are what the volume was made from, outward corners
    /// counter-clockwise.
    pub fn new(volume: &Volume, surfaces: Vec<Arc<Surface>>, indices: &[f64]) -> Self {
        let [nx, ny, nz] = volume.bricks();
        // Bit 0: something is printed in it; bit 1: something is not.
        let holds = |brick: usize| match volume.tile(brick, &mut [0; BRICK_VOXELS]) {
            Tile::Uniform(id) => 1 + u8::from(id.0 == 0),
            Tile::Dense(ids) => ids.iter().map(|id| 1 + u8::from(*id == 0)).fold(0, |all: u8, one| all | one),
        };
        let held: Vec<u8> = (0..nx * ny * nz).map(holds).collect();
        let around = |brick: usize| {
            let at = [brick % nx, brick / nx % ny, brick / (nx * ny)];
            let range = |axis: usize, n: usize| at[axis].saturating_sub(1)..(at[axis] + 2).min(n);
            let all = range(2, nz).flat_map(|z| {
                range(1, ny).flat_map(move |y| range(0, nx).map(move |x| x + nx * (y + ny * z))).collect::<Vec<_>>()
            });
            // Beyond the lattice there is air.
            let border = (0..3).any(|axis| at[axis] == 0 || at[axis] + 1 == [nx, ny, nz][axis]);
            all.fold(if border { 2 } else { 0 }, |held_around, brick| held_around | held[brick])
        };
        let may: Vec<u8> = (0..held.len()).map(|brick| u8::from(held[brick] == 3 || around(brick) == 3)).collect();
        Self {
            surfaces,
            index: std::array::from_fn(|id| indices.get(id).copied().unwrap_or(1.0)),
            clear: steps_to(&may, [nx, ny, nz], |may| may > 0),
        }
    }

    /// Outward unit normal of the nearest point of any surface.
    fn normal(&self, p: DVec3) -> Option<DVec3> {
        let nearest = self.surfaces.iter().map(|surface| (surface, surface.closest(p)));
        let (surface, found) = nearest.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))?;
        let [a, b, c] = surface.triangles()[found.triangle as usize];
        (b - a).cross(c - a).try_normalize()
    }
}

/// A ray that meets a boundary with outward normal `normal`.
enum Met {
    Mirrored(DVec3),
    Bent(DVec3),
}

/// Of light in a medium of index `from` that meets one of index `into`; `cosine` > 0 is that of the ray to `along`, the
/// normal on the far side.
fn meet(direction: DVec3, along: DVec3, cosine: f64, from: f64, into: f64, share: impl FnOnce() -> f64) -> Met {
    let mirrored = || Met::Mirrored((direction - 2.0 * cosine * along).normalize());
    match refraction(cosine.min(1.0), from, into) {
        None => mirrored(),
        Some(found) if share() < found.reflectance => mirrored(),
        Some(found) => {
            let ratio = from / into;
            Met::Bent((ratio * direction + (found.cosine - ratio * cosine) * along).normalize())
        }
    }
}

fn as_vector(direction: Direction) -> DVec3 {
    DVec3::new(direction.x, direction.y, direction.z)
}

fn as_direction(vector: DVec3) -> Direction {
    Direction { x: vector.x, y: vector.y, z: vector.z }
}

impl Walker<'_> {
    /// Light that is seen where a line of sight onto a point of the surface with outward normal `normal` enters the
    /// print at `place`: without the glint, the share of what it meets there, and then as much as is left when the
    /// scene is.
    pub fn walk_under(
        &self,
        skin: &Skin,
        place: Place,
        direction: Direction,
        normal: DVec3,
        rng: &mut Xoshiro256PlusPlus,
    ) -> WayOut {
        let mut ray = Ray { place, direction: as_vector(direction), medium: Medium::Resin, left: place };
        let out = |weight: f64, ray: &Ray| WayOut { weight, from: ray.left, direction: as_direction(ray.direction) };
        let mut weight = 1.0;
        let (cosine, index) = (-ray.direction.dot(normal), skin.index[usize::from(self.scene.id_at(place))]);
        if cosine > 0.0 && index != 1.0 {
            let Some(found) = refraction(cosine.min(1.0), 1.0, index) else { return out(0.0, &ray) };
            weight = 1.0 - found.reflectance;
            // Bent for certain: what is mirrored is the glint.
            if let Met::Bent(bent) = meet(ray.direction, -normal, cosine, 1.0, index, || 1.0) {
                ray.direction = bent;
            }
        }
        let entered = weight;
        weight = 1.0;
        while let Some(id) = self.fly_under(skin, &mut ray, rng) {
            match self.scatter(id, as_direction(ray.direction), weight, rng) {
                Some((direction, left)) => (ray.direction, weight) = (as_vector(direction), left),
                None => return out(0.0, &ray),
            }
            ray.left = ray.place;
        }
        out(entered * weight, &ray)
    }

    /// Flies to the next event; `None` where the ray leaves the scene.
    fn fly_under(&self, skin: &Skin, ray: &mut Ray, rng: &mut Xoshiro256PlusPlus) -> Option<u8> {
        let scene = self.scene;
        let [nx, ny, _] = scene.volume().bricks();
        let mut depth = self.media.depth(rng);
        loop {
            if !scene.holds(ray.place) {
                return None;
            }
            let step = ray.direction * scene.per_mm();
            let voxel = [ray.place.x as usize, ray.place.y as usize, ray.place.z as usize];
            let brick = (voxel[0] >> 3) + nx * ((voxel[1] >> 3) + ny * (voxel[2] >> 3));
            let clear = skin.clear[brick];
            if clear == 0 {
                let id = scene.volume().id_in(brick, voxel);
                let sigma = self.media.sigma_t(id);
                let leaves = way_out(ray.place, step, voxel.map(|at| at as f64), 1.0);
                if leaves * sigma > depth {
                    ray.place += step * (depth / sigma);
                    ray.medium = Medium::Resin;
                    return Some(id);
                }
                depth -= leaves * sigma;
                let next = ray.place + step * (leaves + NUDGE_MM);
                // Where it is if it is sent back.
                ray.place += step * (leaves - NUDGE_MM).max(0.0);
                match (id, if scene.holds(next) { scene.id_at(next) } else { 0 }) {
                    (0, entered @ 1..) => self.meets_resin(skin, ray, next, entered, rng),
                    (left @ 1.., 0) => self.meets_air(skin, ray, next, left, rng),
                    _ => ray.place = next,
                }
                continue;
            }
            // No surface within `clear` − 1 bricks around this one.
            let [class, radius] = self.media.stride(brick);
            let bricks = f64::from(radius.min(clear - 1));
            let edge = BRICK as f64;
            let low = voxel.map(|at| (at & !(BRICK - 1)) as f64 - edge * bricks);
            let leaves = way_out(ray.place, step, low, edge * (1.0 + 2.0 * bricks));
            let sigma = self.media.bound(class);
            if leaves * sigma <= depth {
                depth -= leaves * sigma;
                ray.place += step * (leaves + NUDGE_MM);
                continue;
            }
            ray.place += step * (depth / sigma);
            if !scene.holds(ray.place) {
                return None;
            }
            let id = scene.id_at(ray.place);
            if self.media.is_real(class, id, rng) {
                ray.medium = Medium::Resin;
                return Some(id);
            }
            depth = self.media.depth(rng);
        }
    }

    /// From a voxel of `left` into one that is not printed, at `next`.
    fn meets_air(&self, skin: &Skin, ray: &mut Ray, next: Place, left: u8, rng: &mut Xoshiro256PlusPlus) {
        let index = skin.index[usize::from(left)];
        let outward =
            if ray.medium == Medium::Air || index == 1.0 { None } else { skin.normal(self.scene.position(next)) };
        let cosine = outward.map_or(0.0, |normal| ray.direction.dot(normal));
        let Some(normal) = outward.filter(|_| cosine > 0.0) else {
            // A step of the voxels, or no boundary to light.
            ray.place = next;
            ray.left = next;
            return;
        };
        match meet(ray.direction, normal, cosine, index, 1.0, || uniform(rng)) {
            Met::Mirrored(direction) => ray.direction = direction,
            Met::Bent(direction) => {
                ray.direction = direction;
                ray.medium = Medium::Air;
                ray.left = next;
                // Over the steps that are still ahead.
                let pitch = self.scene.volume().lattice().pitch;
                let over = next + normal * pitch.length() / pitch;
                ray.place = if !self.scene.holds(over) || self.scene.id_at(over) == 0 { over } else { next };
            }
        }
    }

    /// From air into a voxel of `entered`, at `next`.
    fn meets_resin(&self, skin: &Skin, ray: &mut Ray, next: Place, entered: u8, rng: &mut Xoshiro256PlusPlus) {
        let index = skin.index[usize::from(entered)];
        let outward =
            if ray.medium == Medium::Resin || index == 1.0 { None } else { skin.normal(self.scene.position(next)) };
        let cosine = outward.map_or(0.0, |normal| -ray.direction.dot(normal));
        let Some(normal) = outward.filter(|_| cosine > 0.0) else {
            ray.place = next;
            return;
        };
        match meet(ray.direction, -normal, cosine, 1.0, index, || uniform(rng)) {
            Met::Mirrored(direction) => ray.direction = direction,
            Met::Bent(direction) => (ray.direction, ray.medium, ray.place) = (direction, Medium::Resin, next),
        }
    }
}
