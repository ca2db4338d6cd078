//! A picture of a print under all lamps at once, by paths from the camera.
//!
//! Lines of sight go through the voxels as any flight does; where one scatters, one of the beams is asked whether it
//! gets there (a flight towards it that nothing ends), and what leaves the print in the end sees the sky, or the
//! ground, which asks the same. So one path serves all lamps. Estimates are without bias but for the light of more than
//! [`BOUNCES`] turns between ground and print.

use std::ops::Range;

use glam::DVec3;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use rayon::prelude::*;

use super::{
    Beam, Camera, Ground, LAMPS, Lamps, SEED_STEP, Scene, media::Media, scene::Place, spots::over, walker::Walker,
};
use crate::optics::monte_carlo::photon::{Direction, uniform};
use crate::parallel;
use crate::watch::{Stopped, Watch};

/// Turns of a path at the ground.
const BOUNCES: u32 = 3;
/// Samples of a pixel between two looks at the watch.
const PASS: u32 = 4;
/// Of so many samples a pixel that shows no print gets one: nothing there is darker than a shadow's edge.
const GROUND_SAMPLES: u32 = 2;

/// What is photographed.
#[derive(Debug, Clone, Copy)]
pub struct Stage<'a> {
    /// The print.
    pub scene: &'a Scene,
    /// The camera.
    pub camera: Camera,
    /// The lamps.
    pub lamps: Lamps,
    /// The ground.
    pub ground: Ground,
}

/// Radiance in every pixel, per channel and lamp, in units of what a white matt sheet shows under an irradiance of 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Where the line of sight through a pixel's middle meets the print, mm.
    pub met: Vec<Option<DVec3>>,
    channels: usize,
    /// Sum and sum of squares, by pixel, channel and lamp.
    sums: Vec<[f32; 2]>,
    /// Samples of pixels that show the print, and of the others.
    samples: [u32; 2],
}

impl<'a> Stage<'a> {
    /// An empty film; channels that are alike are one.
    pub fn film(&self) -> Film {
        let [width, height] = self.camera.size;
        let met = |pixel: usize| {
            let (x, y) = ((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
            self.scene.meets(self.camera.from(x, y), -self.camera.axes[2])
        };
        let channels = self.scene.media().len();
        Film {
            size: self.camera.size,
            met: (0..width * height).into_par_iter().map(met).collect(),
            channels,
            sums: vec![[0.0; 2]; width * height * channels * LAMPS],
            samples: [0; 2],
        }
    }

    /// Adds `samples` of every pixel that shows the print, in passes, as long as `more` says so between them. Same seed
    /// and samples, same film.
    ///
    /// # Errors
    /// [`Stopped`]; the film holds whole passes only.
    pub fn expose(
        &self,
        film: &mut Film,
        samples: u32,
        seed: u64,
        watch: &dyn Watch,
        mut more: impl FnMut() -> bool,
    ) -> Result<(), Stopped> {
        let width = self.camera.size[0];
        let mut done = 0;
        while done < samples && (done == 0 || more()) {
            let pass = PASS.min(samples - done);
            let first = film.samples[0];
            let ground = film.samples[1]..film.samples[1].max((first + pass).div_ceil(GROUND_SAMPLES));
            let stride = film.channels * LAMPS;
            let met = &film.met;
            parallel::rows(&mut film.sums, stride * width, |y, sums| {
                if watch.stop_requested() {
                    return;
                }
                for (x, (sums, met)) in sums.chunks_mut(stride).zip(&met[y * width..]).enumerate() {
                    let samples = if met.is_some() { first..first + pass } else { ground.clone() };
                    self.expose_pixel([x, y], samples, seed, sums);
                }
            });
            // A pass that was cut short is of no use.
            watch.go_on()?;
            film.samples = [first + pass, ground.end];
            done += pass;
            watch.advance(u64::from(pass));
        }
        Ok(())
    }

    fn expose_pixel(&self, [x, y]: [usize; 2], samples: Range<u32>, seed: u64, sums: &mut [[f32; 2]]) {
        if samples.is_empty() {
            return;
        }
        let pixel = (x + self.camera.size[0] * y) as u64;
        let stream = seed ^ pixel.wrapping_mul(SEED_STEP) ^ u64::from(samples.start).rotate_right(16);
        let toward = self.camera.axes[2];
        for (media, sums) in self.scene.media().iter().zip(sums.chunks_mut(LAMPS)) {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(stream);
            for _ in samples.clone() {
                let (u, v) = (uniform(&mut rng), uniform(&mut rng));
                let from = self.camera.from(x as f64 + u, y as f64 + v);
                let seen = self.radiance(media, self.scene.place(from), -toward, &mut rng);
                for (sum, seen) in sums.iter_mut().zip(seen) {
                    let white = (seen * std::f64::consts::PI) as f32;
                    sum[0] += white;
                    sum[1] += white * white;
                }
            }
        }
    }

    /// One sample of the radiance that comes to `place` against `direction`, under each lamp.
    fn radiance(
        &self,
        media: &Media,
        mut place: Place,
        direction: DVec3,
        rng: &mut Xoshiro256PlusPlus,
    ) -> [f64; LAMPS] {
        let walker = Walker::new(self.scene, media);
        let mut direction = Direction { x: direction.x, y: direction.y, z: direction.z };
        let mut seen = [0.0; LAMPS];
        let (mut weight, mut bounces) = (1.0, 0);
        loop {
            match walker.fly_in(&mut place, direction, rng) {
                Some(id) => {
                    let from = DVec3::new(direction.x, direction.y, direction.z);
                    self.ask_a_beam(&walker, place, &mut seen, rng, |toward| {
                        let [albedo, density] = walker.towards(id, from.dot(toward));
                        weight * albedo * density
                    });
                    match walker.scatter(id, direction, weight, rng) {
                        Some(next) => (direction, weight) = next,
                        None => return seen,
                    }
                }
                None if direction.z < 0.0 => {
                    if bounces == BOUNCES {
                        return seen;
                    }
                    bounces += 1;
                    let from = self.scene.position(place);
                    let way = (self.ground.z - from.z) / direction.z;
                    place = self.scene.place(DVec3::new(
                        from.x + way * direction.x,
                        from.y + way * direction.y,
                        self.ground.z,
                    ));
                    weight *= self.ground.albedo;
                    // What is level shows the beams' shadows as they are, so each is asked.
                    for (lamp, beam) in self.lamps.beams.iter().enumerate() {
                        let share = weight * beam.toward.z.max(0.0) / std::f64::consts::PI;
                        if share > 0.0 && self.reaches(&walker, place, beam, rng) {
                            seen[lamp + 1] += share;
                        }
                    }
                    let (up, _) = over(DVec3::Z, rng);
                    direction = Direction { x: up.x, y: up.y, z: up.z };
                }
                None => {
                    seen[0] += weight * Lamps::sky(DVec3::new(direction.x, direction.y, direction.z));
                    return seen;
                }
            }
        }
    }

    /// Adds what one of the beams, drawn by chance, sends to `place`; `share` of it goes on along the path.
    #[inline]
    fn ask_a_beam(
        &self,
        walker: &Walker<'a>,
        place: Place,
        seen: &mut [f64; LAMPS],
        rng: &mut Xoshiro256PlusPlus,
        share: impl Fn(DVec3) -> f64,
    ) {
        let beams = &self.lamps.beams;
        let lamp = ((uniform(rng) * beams.len() as f64) as usize).min(beams.len() - 1);
        let beam = &beams[lamp];
        if self.reaches(walker, place, beam, rng) {
            seen[lamp + 1] += beams.len() as f64 * share(beam.toward);
        }
    }

    /// Whether a photon of a beam gets to `place`.
    #[inline]
    fn reaches(&self, walker: &Walker<'a>, place: Place, beam: &Beam, rng: &mut Xoshiro256PlusPlus) -> bool {
        let toward = Direction { x: beam.toward.x, y: beam.toward.y, z: beam.toward.z };
        beam.lights(self.scene.position(place)) && walker.fly_in(&mut { place }, toward, rng).is_none()
    }
}

impl Film {
    /// Mean and variance of the mean of every pixel, in one of the channels that are distinct and under one lamp.
    pub fn image(&self, channel: usize, lamp: usize) -> (Vec<f32>, Vec<f32>) {
        let at = |pixel: usize| {
            let n = self.samples[usize::from(self.met[pixel].is_none())].max(1) as f32;
            let [sum, squared] = self.sums[(pixel * self.channels + channel) * LAMPS + lamp];
            let mean = sum / n;
            (mean, (squared / n - mean * mean).max(0.0) / (n - 1.0).max(1.0))
        };
        (0..self.met.len()).map(at).unzip()
    }

    /// Samples of every pixel that shows the print.
    pub fn samples(&self) -> u32 {
        self.samples[0]
    }
}
