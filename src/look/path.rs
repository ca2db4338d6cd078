//! One sample of a picture: a path from the camera backwards, which serves all lamps.
//!
//! Lines of sight go through the voxels as any flight does; where one scatters, one of the beams is asked whether it
//! gets there (a flight towards it that nothing ends), and what leaves the print in the end sees the sky, or the
//! ground, which asks the same. Estimates are without bias but for the light of more than [`BOUNCES`] turns between
//! ground and print.
//!
//! **Under a surface** of resins with refractive indices no straight line leads from a beam to where light scatters.
//! There the beams are asked where the path meets the surface from inside, and a path that passes it leaves towards
//! anywhere, drawn with the cosine to the normal: as if the surface were matt for what it lets through, by Fresnel's
//! shares for each direction, inside and out. Under even light that is the smooth surface's mean; prints are never
//! smooth to a beam, and what has scattered a few times has forgotten where it came from. The glint, light that has not
//! been in the print, is left out where the camera sees it, as in printed albedos; so is light of a beam that is
//! mirrored onto the ground or another part.

use glam::DVec3;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::{
    Beam, LAMPS, Lamps, Stage,
    media::Media,
    scene::Place,
    skin::{Leaving, Outside, Ray, Skin},
    spots::over,
    walker::Walker,
};
use crate::optics::monte_carlo::photon::{Direction, uniform};

/// Turns of a path at the ground.
const BOUNCES: u32 = 3;

/// A path on its way.
pub(super) struct Path<'a> {
    stage: &'a Stage<'a>,
    walker: Walker<'a>,
    /// Radiance of each lamp so far.
    seen: [f64; LAMPS],
    weight: f64,
    bounces: u32,
}

impl<'a> Path<'a> {
    /// In one of the channels.
    pub fn new(stage: &'a Stage<'a>, media: &'a Media) -> Self {
        let walker = Walker::new(stage.scene, media);
        Self { stage, walker, seen: [0.0; LAMPS], weight: 1.0, bounces: 0 }
    }

    /// One sample of the radiance that comes to `place` against `direction`, under each lamp.
    pub fn radiance(mut self, place: Place, direction: DVec3, rng: &mut Xoshiro256PlusPlus) -> [f64; LAMPS] {
        match self.skin() {
            Some(skin) => self.follow_under(skin, place, direction, rng),
            None => self.follow(place, direction, rng),
        }
        self.seen
    }

    fn follow(&mut self, mut place: Place, direction: DVec3, rng: &mut Xoshiro256PlusPlus) {
        let mut direction = Direction::from(direction);
        loop {
            match self.walker.fly_in(&mut place, direction, rng) {
                Some(id) => {
                    self.ask_a_beam(place, id, direction.into(), rng);
                    match self.walker.scatter(id, direction, self.weight, rng) {
                        Some(next) => (direction, self.weight) = next,
                        None => return,
                    }
                }
                None => match self.meet_ground(place, direction.into(), rng) {
                    Some((ground, up)) => (place, direction) = (ground, up.into()),
                    None => return,
                },
            }
        }
    }

    fn follow_under(&mut self, skin: &Skin, place: Place, direction: DVec3, rng: &mut Xoshiro256PlusPlus) {
        let scene = self.stage.scene;
        let mut ray = match scene.meets(scene.position(place), direction) {
            Some(met) => {
                let place = scene.place(met);
                let normal = skin.normal(scene, place).unwrap_or(-direction);
                let (ray, entered) = self.walker.enter(skin, place, direction, normal);
                self.weight = entered;
                ray
            }
            None => Ray::in_air(place, direction),
        };
        loop {
            let walker = self.walker;
            let within = scene.holds(ray.place).then_some(ray.place).or_else(|| scene.enter(ray.place, ray.direction));
            let event = within.and_then(|place| {
                ray.place = place;
                walker.fly_under(skin, &mut ray, self, rng)
            });
            match event {
                Some(id) => {
                    if !skin.bends(id) {
                        self.ask_a_beam(ray.place, id, ray.direction, rng);
                    }
                    match self.walker.scatter(id, ray.direction.into(), self.weight, rng) {
                        Some((direction, weight)) => (ray.direction, self.weight) = (direction.into(), weight),
                        None => return,
                    }
                }
                None => match self.meet_ground(ray.place, ray.direction, rng) {
                    Some((ground, up)) => ray = Ray::in_air(ground, up),
                    None => return,
                },
            }
        }
    }

    /// Leaves the print towards the ground: where from and where to it goes on there. `None` where the path ends, at
    /// the sky mostly.
    fn meet_ground(&mut self, place: Place, direction: DVec3, rng: &mut Xoshiro256PlusPlus) -> Option<(Place, DVec3)> {
        if direction.z >= 0.0 {
            self.seen[0] += self.weight * Lamps::sky(direction);
            return None;
        }
        if self.bounces == BOUNCES {
            return None;
        }
        self.bounces += 1;
        let (scene, ground) = (self.stage.scene, &self.stage.ground);
        let from = scene.position(place);
        let way = (ground.z - from.z) / direction.z;
        let place = scene.place(DVec3::new(from.x + way * direction.x, from.y + way * direction.y, ground.z));
        self.weight *= ground.albedo;
        // What is level shows the beams' shadows as they are, so each is asked.
        for (lamp, beam) in self.stage.lamps.beams.iter().enumerate() {
            let share = self.weight * beam.toward.z.max(0.0) / std::f64::consts::PI;
            if share > 0.0 && self.reaches(place, beam, rng) {
                self.seen[lamp + 1] += share;
            }
        }
        Some((place, over(DVec3::Z, rng).0))
    }

    /// Adds what one of the beams, drawn by chance, sends to an event at `place`, which light comes to along `from`.
    #[inline]
    fn ask_a_beam(&mut self, place: Place, id: u8, from: DVec3, rng: &mut Xoshiro256PlusPlus) {
        let beams = &self.stage.lamps.beams;
        let lamp = ((uniform(rng) * beams.len() as f64) as usize).min(beams.len() - 1);
        let beam = &beams[lamp];
        if self.reaches(place, beam, rng) {
            let [albedo, density] = self.walker.towards(id, from.dot(beam.toward));
            self.seen[lamp + 1] += beams.len() as f64 * (self.weight * albedo * density);
        }
    }

    /// Whether a photon of a beam gets to `place`; under a surface none goes straight through the print.
    #[inline]
    fn reaches(&self, place: Place, beam: &Beam, rng: &mut Xoshiro256PlusPlus) -> bool {
        let lit = beam.lights(self.stage.scene.position(place));
        lit && match self.skin() {
            Some(_) => !self.is_shaded(place, beam),
            None => self.walker.fly_in(&mut { place }, beam.toward.into(), rng).is_none(),
        }
    }

    /// Whether any print is in the way of a beam to `place`.
    fn is_shaded(&self, place: Place, beam: &Beam) -> bool {
        let scene = self.stage.scene;
        scene.meets(scene.position(place), beam.toward).is_some()
    }

    fn skin(&self) -> Option<&'a Skin> {
        self.stage.scene.skin.as_ref().filter(|_| self.stage.surface)
    }
}

impl Outside for Path<'_> {
    fn meets(&mut self, leaving: &Leaving) {
        let position = self.stage.scene.position(leaving.place);
        for (lamp, beam) in self.stage.lamps.beams.iter().enumerate() {
            let cosine = leaving.normal.dot(beam.toward);
            if cosine > 0.0 && beam.lights(position) && !self.is_shaded(leaving.place, beam) {
                let entering = cosine * leaving.entering(cosine);
                self.seen[lamp + 1] += self.weight * leaving.passes * entering / std::f64::consts::PI;
            }
        }
    }

    fn passes(&mut self, leaving: &Leaving, _bent: DVec3, rng: &mut Xoshiro256PlusPlus) -> DVec3 {
        let (direction, cosine) = over(leaving.normal, rng);
        self.weight *= leaving.entering(cosine);
        direction
    }
}
