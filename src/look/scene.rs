//! A print ready for light: its voxels where they are, with what their resins do to light in each channel.
//!
//! Refractive indices count as matched unless the scene has surfaces ([`Scene::under`]): background has no events, and
//! light that leaves a part may enter another. All walks are followed backwards, from where light is seen to where it
//! came from, which for matched indices obeys the same law as forwards.

use std::sync::Arc;

use glam::DVec3;

use super::{Volume, media::Media, skin::Skin, strides::octant};
use crate::optics::{OpticsError, VolumeCoefficients};
use crate::sdf::Surface;
use crate::voxel::BRICK;

/// Voxels of resins, and light's coefficients in them.
#[derive(Debug)]
pub struct Scene {
    pub(super) volume: Volume,
    /// Voxels per mm.
    pub(super) per_mm: DVec3,
    /// End of the bricks, in voxels.
    end: DVec3,
    /// What is distinct of the channels.
    media: Vec<Media>,
    /// Which of `media` each channel has.
    of_channel: Vec<usize>,
    /// What bends light; `None` where refractive indices count as matched.
    pub(super) skin: Option<Skin>,
}

/// A point on its way, in voxels from the lattice's lower corner.
pub(super) type Place = DVec3;

impl Scene {
    /// A scene of `volume`; `coefficients[channel][id]`, of which id 0 is the background, that nothing happens in.
    ///
    /// # Errors
    /// [`OpticsError::Parameter`] for an id without coefficients, or coefficients out of range.
    pub fn new(volume: Volume, coefficients: &[Vec<VolumeCoefficients>]) -> Result<Self, OpticsError> {
        let present = volume.present();
        let mut distinct: Vec<&Vec<VolumeCoefficients>> = Vec::new();
        let mut of_channel = Vec::new();
        for channel in coefficients {
            channel.iter().try_for_each(VolumeCoefficients::check)?;
            if let Some(id) = (1..256).find(|&id| present[id] && id >= channel.len()) {
                let expected = format!("0 to {}, as there are coefficients", channel.len() as i64 - 1);
                return Err(OpticsError::parameter("material id", id, expected));
            }
            let known = distinct.iter().position(|other| *other == channel);
            of_channel.push(known.unwrap_or(distinct.len()));
            if known.is_none() {
                distinct.push(channel);
            }
        }
        let media = distinct.iter().map(|channel| Media::new(&volume, channel, &present)).collect();
        let per_mm = volume.lattice().pitch.recip();
        let end = DVec3::from(volume.bricks().map(|n| (n * BRICK) as f64));
        Ok(Self { volume, per_mm, end, media, of_channel, skin: None })
    }

    /// The same print under surfaces that reflect and bend light: those of the meshes it was made from, with outward
    /// corners counter-clockwise, and the refractive index of every id, the background's 1 first. Printed albedos and
    /// pictures then leave out the glint, as the models do.
    #[must_use]
    pub fn under(self, surfaces: Vec<Arc<Surface>>, indices: &[f64]) -> Self {
        let bends = indices.iter().any(|index| *index != 1.0);
        let skin = (bends && !surfaces.is_empty()).then(|| Skin::new(&self.volume, surfaces, indices));
        Self { skin, ..self }
    }

    /// The voxels.
    pub fn volume(&self) -> &Volume {
        &self.volume
    }

    /// Channels of light.
    pub fn channels(&self) -> usize {
        self.of_channel.len()
    }

    /// What is distinct of the channels.
    pub(super) fn media(&self) -> &[Media] {
        &self.media
    }

    /// Which of the channels that are distinct each channel is.
    pub fn distinct(&self) -> &[usize] {
        &self.of_channel
    }

    /// A position in mm as a place.
    pub(super) fn place(&self, position: DVec3) -> Place {
        (position - self.volume.lattice().origin) * self.per_mm
    }

    /// The id at a place within the bricks.
    #[inline(always)]
    pub(super) fn id_at(&self, place: Place) -> u8 {
        self.volume.id_in(self.brick(place), [place.x as usize, place.y as usize, place.z as usize])
    }

    /// The brick of a place within the bricks.
    #[inline(always)]
    pub(super) fn brick(&self, place: Place) -> usize {
        let [nx, ny, _] = self.volume.bricks();
        let voxel = [place.x as usize, place.y as usize, place.z as usize];
        (voxel[0] >> 3) + nx * ((voxel[1] >> 3) + ny * (voxel[2] >> 3))
    }

    /// Voxels per mm.
    pub(super) fn per_mm(&self) -> DVec3 {
        self.per_mm
    }

    /// Whether there is no voxel at `place` or none that is printed.
    pub(super) fn is_void(&self, place: Place) -> bool {
        self.volume.voxel(place.floor().to_array().map(|at| at as i64)).0 == 0
    }

    /// The first printed voxel on the way from `place` along `direction`, at most `reach` mm on: a place just
    /// inside of it.
    pub(super) fn first_printed(&self, place: Place, direction: DVec3, reach: f64) -> Option<Place> {
        self.first(true, place, direction, reach)
    }

    /// Where the way from `place` along `direction` first leaves what is printed, at most `reach` mm on.
    pub(super) fn first_void(&self, place: Place, direction: DVec3, reach: f64) -> Option<Place> {
        self.first(false, place, direction, reach)
    }

    fn first(&self, printed: bool, place: Place, direction: DVec3, reach: f64) -> Option<Place> {
        let step = direction * self.per_mm;
        let mut cell = place.floor().to_array().map(|at| at as i64);
        let mut entered = 0.0;
        while entered <= reach {
            if (self.volume.voxel(cell).0 != 0) == printed {
                return Some(place + step * (entered + NUDGE_MM));
            }
            let mut leaves = (f64::INFINITY, 0);
            for axis in 0..3 {
                let face = cell[axis] as f64 + f64::from(u8::from(step[axis] > 0.0));
                let way = (face - place[axis]) / step[axis];
                if step[axis] != 0.0 && way < leaves.0 {
                    leaves = (way, axis);
                }
            }
            let (way, axis) = leaves;
            entered = way.max(entered);
            cell[axis] += if step[axis] > 0.0 { 1 } else { -1 };
        }
        None
    }

    /// [`Self::first_printed`] over any distance: leaps through air.
    pub fn meets(&self, position: DVec3, direction: DVec3) -> Option<DVec3> {
        let step = direction * self.per_mm;
        let mut place = self.enter(self.place(position), direction)?;
        let [nx, ny, _] = self.volume.bricks();
        let strides = &self.media.first()?.strides;
        while self.holds(place) {
            let voxel = [place.x as usize, place.y as usize, place.z as usize];
            let brick = (voxel[0] >> 3) + nx * ((voxel[1] >> 3) + ny * (voxel[2] >> 3));
            let stride = strides.of[brick];
            let bricks = if stride.class == 0 { f64::from(stride.edges[octant(step)]) } else { 1.0 };
            let edge = BRICK as f64 * bricks;
            let low: [f64; 3] = std::array::from_fn(|axis| {
                let low = (voxel[axis] & !(BRICK - 1)) as f64;
                if step[axis] < 0.0 { low + BRICK as f64 - edge } else { low }
            });
            let leaves = way_out(place, step, low, edge);
            if stride.class > 0
                && let Some(found) = self.first_printed(place, direction, leaves)
            {
                return Some(self.position(found));
            }
            place += step * (leaves + NUDGE_MM);
        }
        None
    }

    /// How far, at most `farthest_mm`, the way from a position along a unit `direction` stays in what is printed, mm.
    pub fn way_out(&self, position: DVec3, direction: DVec3, farthest_mm: f64) -> f64 {
        let left = self.first_void(self.place(position), direction, farthest_mm);
        left.map_or(farthest_mm, |left| (self.position(left) - position).length().min(farthest_mm))
    }

    /// Whether a place lies within the bricks.
    #[inline(always)]
    pub(super) fn holds(&self, place: Place) -> bool {
        place.cmpge(DVec3::ZERO).all() && place.cmplt(self.end).all()
    }

    /// A place as a position in mm.
    pub(super) fn position(&self, place: Place) -> DVec3 {
        self.volume.lattice().origin + place * self.volume.lattice().pitch
    }

    /// Corners of the box around all bricks that hold something printed, mm.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        let n = self.volume.bricks();
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for brick in (0..n.iter().product()).filter(|&brick| !self.volume.is_void(brick)) {
            let at = [brick % n[0], brick / n[0] % n[1], brick / (n[0] * n[1])].map(|at| (at * BRICK) as f64);
            low = low.min(at.into());
            high = high.max(DVec3::from(at) + BRICK as f64);
        }
        let dims = DVec3::from(self.volume.lattice().dims.map(f64::from));
        (low.x < high.x).then(|| [self.position(low), self.position(high.min(dims))])
    }

    /// Where a ray from outside meets the box of all bricks; the place itself where it starts within.
    pub(super) fn enter(&self, place: Place, direction: DVec3) -> Option<Place> {
        let step = direction * self.per_mm;
        let (low, high) = (-place / step, (self.end - place) / step);
        let (near, far) = (low.min(high).max_element(), low.max(high).min_element());
        if !(near.max(0.0) < far) {
            return None;
        }
        Some(if near > 0.0 { place + step * (near + NUDGE_MM) } else { place })
    }
}

/// Way along `step` (voxels per mm) until a cube of voxels is left, mm.
#[inline]
pub(super) fn way_out(place: Place, step: DVec3, low: [f64; 3], edge: f64) -> f64 {
    let low = DVec3::from(low);
    let far = DVec3::select(step.cmpgt(DVec3::ZERO), low + edge, low);
    // A face along the way is never left by.
    let ways = DVec3::select(step.cmpeq(DVec3::ZERO), DVec3::INFINITY, (far - place) / step);
    ways.min_element().max(0.0)
}

/// How far beyond a face a flight goes on, mm, so that rounding cannot leave it before the face.
pub(super) const NUDGE_MM: f64 = 1e-7;
