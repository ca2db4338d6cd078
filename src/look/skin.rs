//! The surface of a print to light where refractive indices differ from air's: it reflects after Fresnel and bends
//! after Snell, by the **mesh's** normal, for a print is smooth where its voxels have steps.
//!
//! ```text
//!   in resin ──► leaves a printed voxel, outwards by the mesh ──► mirrored back, or bent into air
//!                          inwards by the mesh: a step of voxels, not a surface ──► goes on as it was
//!   in air ────► meets a printed voxel, inwards by the mesh ────► mirrored, or bent into resin
//! ```
//!
//! Flights step from voxel to voxel only in bricks that hold both print and air; elsewhere they leap as ever, to where
//! bricks of the other kind may begin. Boundaries between resins of unlike indices are not seen.
//!
//! *Tried:* leaps in bricks of both kinds, through cubes of like voxels: light that scatters every two or three voxels
//! gains nothing.

use std::sync::Arc;

use glam::DVec3;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::{
    Scene, Volume,
    normals::{Normals, cell},
    scene::{NUDGE_MM, Place, way_out},
    strides::steps_to,
    walker::{Walker, WayOut},
};
use crate::optics::{
    Interface,
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
    /// Transmittance for diffuse light from outside, by id.
    gets_in: [f64; 256],
    /// Steps to the nearest brick that is not all print, or not all air, as this one is; 0: this one holds both.
    alike: Vec<u8>,
    /// Normals that were asked for before.
    normals: Normals,
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

impl Ray {
    /// On its way through air.
    pub fn in_air(place: Place, direction: DVec3) -> Self {
        Self { place, direction, medium: Medium::Air, left: place }
    }
}

/// Light that meets the surface from inside.
#[derive(Debug)]
pub(super) struct Leaving {
    /// Outside, over the steps of the voxels if there is air.
    pub place: Place,
    /// The mesh's outward unit normal.
    pub normal: DVec3,
    /// The share that gets out.
    pub passes: f64,
    index: f64,
    /// Transmittance for diffuse light from outside.
    gets_in: f64,
}

impl Leaving {
    /// What of light from outside gets in where its cosine to the normal is this, over what of diffuse light does.
    pub fn entering(&self, cosine: f64) -> f64 {
        refraction(cosine.min(1.0), 1.0, self.index).map_or(0.0, |found| 1.0 - found.reflectance) / self.gets_in
    }
}

/// What lies outside of the surface, to light that comes from inside.
pub(super) trait Outside {
    /// Light meets the surface; whether it passes is not drawn yet.
    fn meets(&mut self, leaving: &Leaving);

    /// Light passes, bent by Snell's law towards `bent`: where it goes.
    fn passes(&mut self, leaving: &Leaving, bent: DVec3, rng: &mut Xoshiro256PlusPlus) -> DVec3;
}

/// Air over a smooth surface.
struct Air;

impl Outside for Air {
    #[inline]
    fn meets(&mut self, _: &Leaving) {}

    #[inline]
    fn passes(&mut self, _: &Leaving, bent: DVec3, _: &mut Xoshiro256PlusPlus) -> DVec3 {
        bent
    }
}

impl Skin {
    /// `indices` by id, that of the background first; `surfaces` are what the volume was made from, outward corners
    /// counter-clockwise.
    pub fn new(volume: &Volume, surfaces: Vec<Arc<Surface>>, indices: &[f64]) -> Self {
        let n = volume.bricks();
        let kinds: Vec<u8> = (0..n.iter().product()).map(|brick| kind(volume, brick)).collect();
        let to_others = |kind: u8| steps_to(&kinds, n, |other| other != kind);
        let (of_print, of_air) = (to_others(PRINT), to_others(AIR));
        // Beyond the lattice there is air.
        let to_outside = |brick: usize| {
            let at = [brick % n[0], brick / n[0] % n[1], brick / (n[0] * n[1])];
            let steps = at.iter().zip(n).map(|(at, n)| 1 + at.min(&(n - 1 - at)));
            steps.min().unwrap_or(1).min(usize::from(u8::MAX)) as u8
        };
        let index = std::array::from_fn(|id| indices.get(id).copied().unwrap_or(1.0));
        Self {
            surfaces,
            gets_in: index.map(|index| 1.0 - Interface::between(1.0, index).above),
            index,
            // Either is 0 in bricks of the other kind.
            alike: (0..kinds.len()).map(|brick| of_print[brick].min(to_outside(brick)).max(of_air[brick])).collect(),
            normals: Normals::new(kinds.len()),
        }
    }

    /// Whether light is bent at the surface of this resin.
    pub fn bends(&self, id: u8) -> bool {
        self.index[usize::from(id)] != 1.0
    }

    /// Outward unit normal of the surface near a voxel: at its middle's nearest point of any mesh.
    pub fn normal(&self, scene: &Scene, place: Place) -> Option<DVec3> {
        let find = || {
            let middle = scene.position(place.floor() + 0.5);
            let nearest = self.surfaces.iter().map(|surface| (surface, surface.closest(middle)));
            let (surface, found) = nearest.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))?;
            let [a, b, c] = surface.triangles()[found.triangle as usize];
            (b - a).cross(c - a).try_normalize()
        };
        if scene.holds(place) { self.normals.at(scene.brick(place), cell(place), find) } else { find() }
    }
}

/// A brick of nothing but print, or of nothing but air; one of both is their sum.
const PRINT: u8 = 1;
const AIR: u8 = 2;

fn kind(volume: &Volume, brick: usize) -> u8 {
    let of = |id: u8| if id == 0 { AIR } else { PRINT };
    match volume.tile(brick, &mut [0; BRICK_VOXELS]) {
        Tile::Uniform(id) => of(id.0),
        Tile::Dense(ids) => ids.iter().fold(0, |kinds, id| kinds | of(*id)),
    }
}

/// A unit vector mirrored at a surface; `cosine` is that to its normal.
fn mirrored(direction: DVec3, normal: DVec3, cosine: f64) -> DVec3 {
    (direction - 2.0 * cosine * normal).normalize()
}

/// A unit vector bent by Snell's law from a medium of index `from` into one of index `into`; `cosine` is that to
/// `along`, the normal on the far side, and `beyond` what becomes of it there.
fn bent(direction: DVec3, along: DVec3, [cosine, beyond]: [f64; 2], from: f64, into: f64) -> DVec3 {
    let ratio = from / into;
    (ratio * direction + (beyond - ratio * cosine) * along).normalize()
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
        let (mut ray, entered) = self.enter(skin, place, direction.into(), normal);
        let out = |weight: f64, ray: &Ray| WayOut { weight, from: ray.left, direction: ray.direction.into() };
        let mut weight = 1.0;
        while let Some(id) = self.fly_under(skin, &mut ray, &mut Air, rng) {
            match self.scatter(id, ray.direction.into(), weight, rng) {
                Some((direction, left)) => (ray.direction, weight) = (direction.into(), left),
                None => return out(0.0, &ray),
            }
            ray.left = ray.place;
        }
        out(entered * weight, &ray)
    }

    /// A line of sight as it goes on inside where it enters the print at `place`, under a surface of outward normal
    /// `normal`, and the share of it that does: what is mirrored is the glint.
    pub fn enter(&self, skin: &Skin, place: Place, direction: DVec3, normal: DVec3) -> (Ray, f64) {
        let (cosine, index) = (-direction.dot(normal), skin.index[usize::from(self.scene.id_at(place))]);
        let within = |direction: DVec3| Ray { place, direction, medium: Medium::Resin, left: place };
        if cosine <= 0.0 || index == 1.0 {
            return (within(direction), 1.0);
        }
        match refraction(cosine.min(1.0), 1.0, index) {
            Some(found) => {
                let bent = bent(direction, -normal, [cosine, found.cosine], 1.0, index);
                (within(bent), 1.0 - found.reflectance)
            }
            None => (within(direction), 0.0),
        }
    }

    /// Flies to the next event; `None` where the ray leaves the scene.
    pub fn fly_under(
        &self,
        skin: &Skin,
        ray: &mut Ray,
        outside: &mut impl Outside,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Option<u8> {
        let scene = self.scene;
        let edge = BRICK as f64;
        let mut depth = self.media.depth(rng);
        while scene.holds(ray.place) {
            let step = ray.direction * scene.per_mm();
            let voxel = [ray.place.x as usize, ray.place.y as usize, ray.place.z as usize];
            let brick = scene.brick(ray.place);
            let alike = skin.alike[brick];
            let [class, radius] = self.media.stride(brick);
            let (leaves, sigma) = if alike == 0 {
                let leaves = way_out(ray.place, step, voxel.map(|at| at as f64), 1.0);
                (leaves, self.media.sigma_t(scene.volume().id_in(brick, voxel)))
            } else {
                let bricks = f64::from(radius.min(alike - 1));
                let low = voxel.map(|at| (at & !(BRICK - 1)) as f64 - edge * bricks);
                (way_out(ray.place, step, low, edge * (1.0 + 2.0 * bricks)), self.media.bound(class))
            };
            if leaves * sigma > depth {
                ray.place += step * (depth / sigma);
                if !scene.holds(ray.place) {
                    return None;
                }
                let id = if alike == 0 { scene.volume().id_in(brick, voxel) } else { scene.id_at(ray.place) };
                if alike == 0 || self.media.is_real(class, id, rng) {
                    ray.medium = Medium::Resin;
                    return Some(id);
                }
                depth = self.media.depth(rng);
                continue;
            }
            depth -= leaves * sigma;
            let next = ray.place + step * (leaves + NUDGE_MM);
            // Where it is if it is sent back.
            ray.place += step * (leaves - NUDGE_MM).max(0.0);
            // Beyond the bricks there is air.
            let [left, entered] = [ray.place, next].map(|at| if scene.holds(at) { scene.id_at(at) } else { 0 });
            match (left, entered) {
                (0, entered @ 1..) => self.meets_resin(skin, ray, next, entered, rng),
                (left @ 1.., 0) => self.meets_air(skin, ray, next, left, outside, rng),
                _ => ray.place = next,
            }
        }
        None
    }

    /// From a voxel of `left` into one that is not printed, at `next`.
    fn meets_air(
        &self,
        skin: &Skin,
        ray: &mut Ray,
        next: Place,
        left: u8,
        outside: &mut impl Outside,
        rng: &mut Xoshiro256PlusPlus,
    ) {
        let left = usize::from(left);
        let index = skin.index[left];
        let outward = if ray.medium == Medium::Air || index == 1.0 { None } else { skin.normal(self.scene, next) };
        let cosine = outward.map_or(0.0, |normal| ray.direction.dot(normal));
        let Some(normal) = outward.filter(|_| cosine > 0.0) else {
            // A step of the voxels, or no boundary to light.
            if index == 1.0 {
                ray.medium = Medium::Air;
            }
            ray.place = next;
            ray.left = next;
            return;
        };
        let Some(found) = refraction(cosine.min(1.0), index, 1.0) else {
            ray.direction = mirrored(ray.direction, normal, cosine);
            return;
        };
        // Over the steps that are still ahead.
        let pitch = self.scene.volume().lattice().pitch;
        let over = next + normal * pitch.length() / pitch;
        let place = if !self.scene.holds(over) || self.scene.id_at(over) == 0 { over } else { next };
        let leaving = Leaving { place, normal, passes: 1.0 - found.reflectance, index, gets_in: skin.gets_in[left] };
        outside.meets(&leaving);
        if uniform(rng) < found.reflectance {
            ray.direction = mirrored(ray.direction, normal, cosine);
            return;
        }
        let bent = bent(ray.direction, normal, [cosine, found.cosine], index, 1.0);
        *ray = Ray { place, direction: outside.passes(&leaving, bent, rng), medium: Medium::Air, left: next };
    }

    /// From air into a voxel of `entered`, at `next`.
    fn meets_resin(&self, skin: &Skin, ray: &mut Ray, next: Place, entered: u8, rng: &mut Xoshiro256PlusPlus) {
        let index = skin.index[usize::from(entered)];
        let outward = if ray.medium == Medium::Resin || index == 1.0 { None } else { skin.normal(self.scene, next) };
        let cosine = outward.map_or(0.0, |normal| -ray.direction.dot(normal));
        let Some(normal) = outward.filter(|_| cosine > 0.0) else {
            ray.place = next;
            return;
        };
        match refraction(cosine.min(1.0), 1.0, index).filter(|found| uniform(rng) >= found.reflectance) {
            Some(found) => {
                ray.direction = bent(ray.direction, -normal, [cosine, found.cosine], 1.0, index);
                (ray.medium, ray.place) = (Medium::Resin, next);
            }
            None => ray.direction = mirrored(ray.direction, normal, -cosine),
        }
    }
}
