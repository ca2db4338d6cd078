//! Patches made for tests, on disk as a user's would be.

use std::{f64::consts::PI, fs, path::PathBuf};

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use tempfile::TempDir;

use crate::appearance::{
    NormalizedDiffusion,
    bssrdf::{Dataset, Rings, write_npy},
};

/// A stream of normal numbers.
pub struct Random(Xoshiro256PlusPlus);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Box and Muller.
    pub fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (2.0 * PI * self.unit()).cos()
    }
}

/// A patch whose response is exactly of the form of equation 7.
pub struct Patch {
    pub width: usize,
    pub height: usize,
    pub window: usize,
    pub pitch_mm: f64,
    /// Standard deviation of the noise as a share of each value, and per mm².
    pub noise: [f64; 2],
}

impl Patch {
    pub const SMALL: Self = Self { width: 24, height: 20, window: 17, pitch_mm: 0.06, noise: [0.0, 0.0] };

    /// Albedo and mean free path anywhere, also beyond the patch: bright and translucent blobs on dark ground.
    pub fn material(x: isize, y: isize) -> NormalizedDiffusion {
        let wave = |f: f64, g: f64| (f * x as f64).sin() * (g * y as f64).cos();
        let albedo = 0.35 + 0.25 * wave(0.31, 0.23);
        NormalizedDiffusion::new(albedo, 0.25 + 0.15 * wave(0.17, 0.41)).unwrap()
    }

    /// P over a pixel at `r_mm`; the lit pixel is a disc of its area.
    pub fn profile(&self, material: NormalizedDiffusion, r_mm: f64) -> f64 {
        if r_mm > 0.0 {
            return material.profile(r_mm);
        }
        let area = self.pitch_mm * self.pitch_mm;
        material.hankel(0.0) * material.energy_within((area / PI).sqrt()) / area
    }

    /// Means over rings of P, `[ring]`.
    pub fn truth(&self, x: usize, y: usize, rings: &Rings) -> Vec<f64> {
        let material = Self::material(x as isize, y as isize);
        rings.means(&rings.distances_mm.iter().map(|r| self.profile(material, *r)).collect::<Vec<_>>())
    }

    /// Response windows, row-major.
    pub fn responses(&self, seed: u64) -> Vec<f32> {
        let (mut random, half) = (Random::new(seed), (self.window / 2) as isize);
        let mut values = Vec::with_capacity(self.width * self.height * self.window * self.window);
        for y in 0..self.height as isize {
            for x in 0..self.width as isize {
                let lit = Self::material(x, y);
                for dy in -half..=half {
                    for dx in -half..=half {
                        let r = ((dx * dx + dy * dy) as f64).sqrt() * self.pitch_mm;
                        let seen = Self::material(x + dx, y + dy);
                        let value = (self.profile(lit, r) * self.profile(seen, r)).sqrt();
                        let noise = self.noise[0] * value * random.normal() + self.noise[1] * random.normal();
                        values.push((value + noise) as f32);
                    }
                }
            }
        }
        values
    }

    pub fn shape(&self) -> [usize; 4] {
        [self.height, self.width, self.window, self.window]
    }

    pub fn write(&self, values: &[f32], more: &str) -> Folder {
        let folder = Folder(tempfile::tempdir().unwrap());
        folder.write("r.npy", &write_npy(&self.shape(), values));
        let header = format!("version = 1\npitch-mm = {}\nresponses = \"r.npy\"\n{more}", self.pitch_mm);
        folder.write("dataset.toml", header.as_bytes());
        folder
    }
}

/// A folder that goes when the test does.
pub struct Folder(TempDir);

impl Folder {
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, content: &[u8]) {
        fs::write(self.path(name), content).unwrap();
    }

    pub fn open(&self) -> Dataset {
        Dataset::open(&self.path(""), false).unwrap()
    }

    /// What is said about a dataset that cannot be read.
    pub fn complaint(&self, name: &str) -> String {
        Dataset::open(&self.path(name), false).unwrap_err().to_string()
    }
}
