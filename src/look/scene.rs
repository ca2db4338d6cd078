//! A print ready for light: its voxels, and what their resins do to light in each channel.
//!
//! Refractive indices count as matched unless the scene has surfaces ([`Scene::under`]): background has no events, and
//! light that leaves a part may enter another. All walks are followed backwards, from where light is seen to where it
//! came from, which for matched indices obeys the same law as forwards.

use std::sync::Arc;

use glam::DVec3;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::Rng};

use super::{
    Volume,
    skin::Skin,
    strides::{Strides, octant},
};
use crate::optics::{
    OpticsError, VolumeCoefficients,
    monte_carlo::photon::{Direction, FAINT, HenyeyGreenstein, REVIVED, azimuth, uniform},
};
use crate::sdf::Surface;
use crate::voxel::BRICK;

/// Voxels of resins, and light's coefficients in them.
#[derive(Debug)]
pub struct Scene {
    volume: Volume,
    /// Voxels per mm.
    per_mm: DVec3,
    /// End of the bricks, in voxels.
    end: DVec3,
    /// What is distinct of the channels.
    media: Vec<Media>,
    /// Which of `media` each channel has.
    of_channel: Vec<usize>,
    /// What bends light; `None` where refractive indices count as matched.
    skin: Option<Skin>,
}

/// All resins in one channel.
#[derive(Debug)]
pub(super) struct Media {
    strides: Strides,
    /// 1/σt of each class, mm.
    mean_free_path: Vec<f64>,
    /// σt/σ of the class, by class and id: how many collisions are real.
    real: Vec<[f32; 256]>,
    sigma_t: [f64; 256],
    albedo: [f64; 256],
    phase: Vec<HenyeyGreenstein>,
    optical_depths: OpticalDepths,
}

/// Random optical depths of flights, −ln u of a uniform u in (0, 1].
///
/// The logarithm by a table of 128 mantissas and three terms of its series: within 1e-10, the same on every machine,
/// and at a third of the time of the exact one, which a walk asks for at every event.
#[derive(Debug)]
struct OpticalDepths {
    /// 1/m and ln m in the middle of each interval of mantissas.
    table: [[f64; 2]; 1 << MANTISSA_BITS],
}

const MANTISSA_BITS: u32 = 7;

impl OpticalDepths {
    fn new() -> Self {
        let entry = |n: usize| {
            let middle = 1.0 + (n as f64 + 0.5) / f64::from(1 << MANTISSA_BITS);
            [1.0 / middle, libm::log(middle)]
        };
        Self { table: std::array::from_fn(entry) }
    }

    #[inline]
    fn draw(&self, rng: &mut Xoshiro256PlusPlus) -> f64 {
        self.minus_log((rng.next_u64() >> 11) + 1)
    }

    /// −ln(n / 2⁵³), n from 1 to 2⁵³.
    #[inline]
    fn minus_log(&self, n: u64) -> f64 {
        let bits = (n as f64).to_bits();
        let exponent = (bits >> 52) as i64 - 1023 - 53;
        let mantissa = f64::from_bits(bits & ((1 << 52) - 1) | 1023 << 52);
        let [inverse, log] = self.table[(bits >> (52 - MANTISSA_BITS)) as usize & ((1 << MANTISSA_BITS) - 1)];
        let rest = mantissa * inverse - 1.0;
        let series = rest * (1.0 - rest * (0.5 - rest * (1.0 / 3.0)));
        // Rounding may put u = 1 a hair beyond.
        (-(exponent as f64 * std::f64::consts::LN_2 + log + series)).max(0.0)
    }
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
    /// corners counter-clockwise, and the refractive index of every id, the background's 1 first. Printed albedos then
    /// leave out the glint, as the models do; pictures know no surface.
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
        let [nx, ny, _] = self.volume.bricks();
        let voxel = [place.x as usize, place.y as usize, place.z as usize];
        self.volume.id_in((voxel[0] >> 3) + nx * ((voxel[1] >> 3) + ny * (voxel[2] >> 3)), voxel)
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

impl Media {
    fn new(volume: &Volume, coefficients: &[VolumeCoefficients], present: &[bool; 256]) -> Self {
        // The background may be given coefficients, but nothing happens in it.
        let of = |id: usize| coefficients.get(id).filter(|_| id > 0);
        let sigma_t: [f64; 256] = std::array::from_fn(|id| of(id).map_or(0.0, VolumeCoefficients::sigma_t));
        let strides = Strides::new(volume, &sigma_t, present);
        let ratio = |sigma: f64, id: usize| if sigma > 0.0 { (sigma_t[id] / sigma) as f32 } else { 0.0 };
        Self {
            mean_free_path: strides.sigma.iter().map(|sigma| 1.0 / sigma).collect(),
            real: strides.sigma.iter().map(|&sigma| std::array::from_fn(|id| ratio(sigma, id))).collect(),
            albedo: std::array::from_fn(|id| of(id).map_or(0.0, VolumeCoefficients::albedo)),
            phase: (0..256).map(|id| HenyeyGreenstein::new(of(id).map_or(0.0, |volume| volume.g))).collect(),
            optical_depths: OpticalDepths::new(),
            sigma_t,
            strides,
        }
    }
}

impl Media {
    /// σt of an id, per mm.
    #[inline]
    pub fn sigma_t(&self, id: u8) -> f64 {
        self.sigma_t[usize::from(id)]
    }

    /// Class of a brick, and within how many bricks around it nothing is denser.
    #[inline]
    pub fn stride(&self, brick: usize) -> [u8; 2] {
        let stride = &self.strides.of[brick];
        [stride.class, stride.radius()]
    }

    /// The density that bounds a class, per mm.
    #[inline]
    pub fn bound(&self, class: u8) -> f64 {
        self.strides.sigma[usize::from(class)]
    }

    /// A random optical depth.
    #[inline]
    pub fn depth(&self, rng: &mut Xoshiro256PlusPlus) -> f64 {
        self.optical_depths.draw(rng)
    }

    /// Whether a collision at the density of a class is one with `id`.
    #[inline]
    pub fn is_real(&self, class: u8, id: u8, rng: &mut Xoshiro256PlusPlus) -> bool {
        let real = self.real[usize::from(class)][usize::from(id)];
        real >= 1.0 || uniform(rng) < f64::from(real)
    }
}

/// Light in one channel of a scene.
#[derive(Clone, Copy)]
pub(super) struct Walker<'a> {
    pub scene: &'a Scene,
    pub media: &'a Media,
}

impl<'a> Walker<'a> {
    pub fn new(scene: &'a Scene, media: &'a Media) -> Self {
        Self { scene, media }
    }

    /// Flies from `place` to the next event, and tells in which material it is; `None` if the flight leaves the scene.
    #[inline]
    pub fn fly(&self, place: &mut Place, direction: Direction, rng: &mut Xoshiro256PlusPlus) -> Option<u8> {
        let mut depth = self.media.optical_depths.draw(rng);
        self.fly_on(place, direction, &mut depth, rng)
    }

    /// [`Self::fly`] over a random optical depth that was drawn before; leaves one that was drawn for the next flight.
    ///
    /// Random numbers are drawn before it is known what they are for: whether a collision is real nobody can foresee, a
    /// processor neither, and what it has to do after it was wrong should be little.
    #[inline]
    pub fn fly_on(
        &self,
        place: &mut Place,
        direction: Direction,
        depth: &mut f64,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Option<u8> {
        let Self { scene, media } = self;
        let per_mm = scene.per_mm;
        // −0 + 0 = +0, so that the face ahead of a flight along it is infinitely far off, and not infinitely far
        // behind.
        let step = DVec3::new(direction.x * per_mm.x, direction.y * per_mm.y, direction.z * per_mm.z) + 0.0;
        let octant = octant(step);
        // Which face of a cube of bricks is left, from the lower corner of the brick that it begins with.
        let ahead = step.to_array().map(|step| if step >= 0.0 { [0.0, 1.0] } else { [BRICK as f64, -1.0] });
        let [nx, ny, _] = scene.volume.bricks();
        // The last class may be the first, that of air, which must be crossed.
        let last = if media.strides.sigma.len() > 1 { media.strides.sigma.len() - 1 } else { usize::MAX };
        let mut at = *place;
        if !scene.holds(at) {
            return None;
        }
        loop {
            let voxel = [at.x as usize, at.y as usize, at.z as usize];
            let brick = (voxel[0] >> 3) + nx * ((voxel[1] >> 3) + ny * (voxel[2] >> 3));
            let stride = &media.strides.of[brick];
            let class = usize::from(stride.class);
            // Nothing anywhere is denser than the last class, so a flight through it asks for no end.
            if class != last {
                let edge = f64::from(stride.edges[octant]) * BRICK as f64;
                let mut leaves = f64::INFINITY;
                for axis in 0..3 {
                    let [corner, sign] = ahead[axis];
                    let face = (voxel[axis] & !(BRICK - 1)) as f64 + corner + sign * edge;
                    leaves = leaves.min((face - at[axis]) / step[axis]);
                }
                let passed = leaves * media.strides.sigma[class];
                if passed <= *depth {
                    *depth -= passed;
                    at += step * (leaves + NUDGE_MM);
                    if !scene.holds(at) {
                        *place = at;
                        return None;
                    }
                    continue;
                }
            }
            at += step * (*depth * media.mean_free_path[class]);
            if !scene.holds(at) {
                *place = at;
                return None;
            }
            let chance = uniform(rng);
            *depth = media.optical_depths.draw(rng);
            let voxel = [at.x as usize, at.y as usize, at.z as usize];
            let brick = (voxel[0] >> 3) + nx * ((voxel[1] >> 3) + ny * (voxel[2] >> 3));
            let id = scene.volume.id_in(brick, voxel);
            if chance < f64::from(media.real[class][usize::from(id)]) {
                *place = at;
                return Some(id);
            }
        }
    }

    /// [`Self::fly`] from anywhere, outside of the bricks too.
    #[inline]
    pub fn fly_in(&self, place: &mut Place, direction: Direction, rng: &mut Xoshiro256PlusPlus) -> Option<u8> {
        if !self.scene.holds(*place) {
            *place = self.scene.enter(*place, DVec3::new(direction.x, direction.y, direction.z))?;
        }
        self.fly(place, direction, rng)
    }

    /// The share of light that an event in material `id` leaves, and per steradian what of that goes where the cosine
    /// to the old direction is `cosine`.
    #[inline]
    pub fn towards(&self, id: u8, cosine: f64) -> [f64; 2] {
        let id = usize::from(id);
        [self.media.albedo[id], self.media.phase[id].density(cosine)]
    }

    /// Scatters in material `id`: a new direction and weight; `None` where the walk dies.
    #[inline]
    pub fn scatter(
        &self,
        id: u8,
        direction: Direction,
        weight: f64,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Option<(Direction, f64)> {
        let id = usize::from(id);
        let mut weight = weight * self.media.albedo[id];
        if weight < FAINT {
            if uniform(rng) * REVIVED >= weight {
                return None;
            }
            weight = REVIVED;
        }
        Some((direction.turned(self.media.phase[id].sample(uniform(rng)), azimuth(rng)), weight))
    }

    /// Walks until the scene is left; `normal` is the outward one where the line of sight meets the surface.
    #[inline]
    pub fn walk(
        &self,
        mut place: Place,
        mut direction: Direction,
        normal: DVec3,
        rng: &mut Xoshiro256PlusPlus,
    ) -> WayOut {
        if let Some(skin) = &self.scene.skin {
            return self.walk_under(skin, place, direction, normal, rng);
        }
        let mut weight = 1.0;
        let mut depth = self.media.optical_depths.draw(rng);
        loop {
            let from = place;
            let Some(id) = self.fly_on(&mut place, direction, &mut depth, rng) else {
                return WayOut { weight, from, direction };
            };
            match self.scatter(id, direction, weight, rng) {
                Some(next) => (direction, weight) = next,
                None => return WayOut { weight: 0.0, from, direction },
            }
        }
    }
}

/// How a walk ends.
#[derive(Debug, Clone, Copy)]
pub(super) struct WayOut {
    /// What of it gets out.
    pub weight: f64,
    /// Where its last leg begins: in the print, or right over its surface.
    pub from: Place,
    /// Where to.
    pub direction: Direction,
}

#[cfg(test)]
mod tests {
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    use super::*;
    use crate::voxel::Lattice;

    #[test]
    fn optical_depths_are_logarithms() {
        let depths = OpticalDepths::new();
        let numbers = (0..53).flat_map(|bit| (0..997_u64).map(move |n| ((1 << bit) + (n << bit) / 997).max(1)));
        for n in numbers.chain([1, (1 << 53) - 1, 1 << 53]) {
            let exact = -libm::log(n as f64 / (1_u64 << 53) as f64);
            assert!((depths.minus_log(n) - exact).abs() < 1e-10, "{n}: {} instead of {exact}", depths.minus_log(n));
        }
    }
    /// A small white cube in the middle of much air: flights along an axis, with zeros of either sign across, get
    /// there.
    #[test]
    fn flights_along_an_axis_meet_what_is_ahead() {
        let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::splat(0.1), dims: [200; 3] };
        let mut volume = Volume::new(lattice).unwrap();
        let middle = 96..104;
        for start in (0..200).step_by(8) {
            volume.add_slices(start..start + 8, |j, k, row| {
                let inside = |i: usize| [i, j as usize, k as usize].iter().all(|at| middle.contains(at));
                row.iter_mut().enumerate().for_each(|(i, id)| *id = u8::from(inside(i)));
            });
        }
        let void = VolumeCoefficients::new(0.0, 0.0, 0.0).unwrap();
        let white = VolumeCoefficients::new(1e4, 0.0, 0.0).unwrap();
        let scene = Scene::new(volume, &[vec![void, white]]).unwrap();
        let walker = Walker::new(&scene, &scene.media()[0]);
        for axis in 0..3 {
            for (sign, zero) in [(1.0, 0.0), (1.0, -0.0), (-1.0, 0.0), (-1.0, -0.0)] {
                let mut to = [zero; 3];
                to[axis] = sign;
                let [x, y, z] = to;
                let from = DVec3::splat(10.0) - DVec3::from(to) * 5.0;
                let mut place = scene.place(from);
                let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
                assert_eq!(walker.fly_in(&mut place, Direction { x, y, z }, &mut rng), Some(1), "{to:?}");
                let reached = scene.position(place);
                assert!((reached - (DVec3::splat(10.0) - DVec3::from(to) * 0.4)).length() < 2e-3, "{to:?}: {reached}");
                assert!(scene.meets(from, to.into()).is_some(), "{to:?}");
            }
        }
    }
}
