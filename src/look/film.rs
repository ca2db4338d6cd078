//! A picture of a print under all lamps at once, by [paths](super::path) from the camera.

use std::ops::Range;

use glam::DVec3;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use rayon::prelude::*;

use super::{Camera, Ground, LAMPS, Lamps, SEED_STEP, Scene, path::Path};
use crate::optics::monte_carlo::photon::uniform;
use crate::parallel;
use crate::watch::{Stopped, Watch};

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
    /// Whether light meets the print's surface, if the scene has one ([`Scene::under`]).
    pub surface: bool,
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
                let seen = Path::new(self, media).radiance(self.scene.place(from), -toward, &mut rng);
                for (sum, seen) in sums.iter_mut().zip(seen) {
                    let white = (seen * std::f64::consts::PI) as f32;
                    sum[0] += white;
                    sum[1] += white * white;
                }
            }
        }
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
