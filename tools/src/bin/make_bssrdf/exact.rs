//! A dataset that is exactly of the form of equation 7, plus noise: profiles of normalised diffusion whose albedo and
//! mean free path vary; or squares of 8 texels, where light decays in 0.12 mm or in 0.35 mm. Pixels are point values
//! but for the lit one, which is the mean over a disc of its area. `truth.npy` holds the profiles themselves as means
//! over the rings of the window, [row][column][ring] per mm².

use std::f64::consts::{PI, TAU};

use lumislice::appearance::{
    NormalizedDiffusion,
    bssrdf::{Rings, write_npy},
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

use super::{Request, files};

/// Texels along a side of a square.
const SQUARE: isize = 8;
/// Radii in which light falls to 1/e in the squares, mm, and the albedo of both.
const DECAYS_MM: [f64; 2] = [0.12, 0.35];
const ALBEDO: f64 = 0.5;

#[derive(Clone, Copy)]
enum Material {
    Diffusion(NormalizedDiffusion),
    /// A e^(−r/d)/(2π d r).
    Decay(f64),
}

impl Material {
    /// Of a texel, also beyond the patch.
    fn at(kind: &str, x: isize, y: isize) -> Self {
        if kind == "squares" {
            let odd = (x.div_euclid(SQUARE) + y.div_euclid(SQUARE)).rem_euclid(2);
            return Self::Decay(DECAYS_MM[odd as usize]);
        }
        let wave = |a: f64, b: f64| (a * x as f64).sin() * (b * y as f64).cos();
        let (albedo, path) = (0.35 + 0.25 * wave(0.083, 0.061), 0.6 + 0.4 * wave(0.047, 0.109));
        // Both ranges lie within what a material may have.
        Self::Diffusion(NormalizedDiffusion::new(albedo, path).expect("an albedo within 0 and 1, a path above 0"))
    }

    fn profile(self, r: f64) -> f64 {
        match self {
            Self::Diffusion(material) => material.profile(r),
            Self::Decay(decay) => ALBEDO * (-r / decay).exp() / (TAU * decay * r),
        }
    }

    fn albedo(self) -> f64 {
        match self {
            Self::Diffusion(material) => material.hankel(0.0),
            Self::Decay(_) => ALBEDO,
        }
    }

    /// Share of the albedo within a radius.
    fn within(self, r: f64) -> f64 {
        match self {
            Self::Diffusion(material) => material.energy_within(r),
            Self::Decay(decay) => -(-r / decay).exp_m1(),
        }
    }
}

/// √P of a texel at every distance that occurs.
fn roots(material: Material, distances: &[f64], pitch_mm: f64) -> Vec<f32> {
    let area = pitch_mm * pitch_mm;
    let value = |r: f64| match r > 0.0 {
        true => material.profile(r),
        false => material.albedo() * material.within((area / PI).sqrt()) / area,
    };
    distances.iter().map(|r| value(*r).sqrt() as f32).collect()
}

pub fn make(request: &Request) -> Result<(), String> {
    let half = (request.window / 2) as isize;
    let material = |x: isize, y: isize| Material::at(&request.kind, x, y);
    let [columns, rows] = request.texels.map(|n| n as isize);
    let squares: Vec<usize> = (0..request.window * request.window)
        .map(|i| ((i % request.window) as isize - half, (i / request.window) as isize - half))
        .map(|(dx, dy)| (dx * dx + dy * dy) as usize)
        .collect();
    let mut known = squares.clone();
    known.sort_unstable();
    known.dedup();
    let distances: Vec<f64> = known.iter().map(|square| (*square as f64).sqrt() * request.pitch_mm).collect();
    let of_pixel: Vec<usize> = squares.iter().map(|square| known.partition_point(|k| k < square)).collect();
    // √P in a frame as wide as windows reach.
    let width = (columns + 2 * half) as usize;
    let frame: Vec<Vec<f32>> = (0..width * (rows + 2 * half) as usize)
        .into_par_iter()
        .map(|i| material((i % width) as isize - half, (i / width) as isize - half))
        .map(|material| roots(material, &distances, request.pitch_mm))
        .collect();
    let mut windows = files::Windows::create(request)?;
    for y in 0..rows as usize {
        let texels: Vec<Vec<f32>> = (0..columns as usize)
            .into_par_iter()
            .map(|x| {
                let stream = request.seed.wrapping_mul(0x9e37_79b9).wrapping_add((y * width + x) as u64);
                let mut random = Xoshiro256PlusPlus::seed_from_u64(stream);
                let mut unit = || ((random.next_u64() >> 40) as f32 + 0.5) / (1 << 24) as f32;
                let lit = &frame[(y + half as usize) * width + x + half as usize];
                let pixel = |i: usize| {
                    let seen = &frame[(y + i / request.window) * width + x + i % request.window];
                    let value = lit[of_pixel[i]] * seen[of_pixel[i]];
                    // Box and Muller: two normal numbers.
                    let (radius, angle) = ((-2.0 * unit().ln()).sqrt(), TAU as f32 * unit());
                    let noise = [radius * angle.cos(), radius * angle.sin()];
                    value * (1.0 + request.noise as f32 * noise[0]) + request.floor_per_mm2 as f32 * noise[1]
                };
                (0..of_pixel.len()).map(pixel).collect()
            })
            .collect();
        texels.iter().try_for_each(|window| windows.write(window))?;
    }
    let rings = Rings::new(request.window, request.window, request.pitch_mm);
    let truth: Vec<f32> = (0..rows as usize * columns as usize)
        .into_par_iter()
        .flat_map_iter(|i| {
            let material = material((i % columns as usize) as isize, (i / columns as usize) as isize);
            let roots = roots(material, &rings.distances_mm, request.pitch_mm);
            let values: Vec<f64> = roots.iter().map(|root| f64::from(*root).powi(2)).collect();
            rings.means(&values).into_iter().map(|mean| mean as f32)
        })
        .collect();
    let path = request.folder.join("truth.npy");
    std::fs::write(&path, write_npy(&[rows as usize, columns as usize, rings.len()], &truth))
        .map_err(|error| format!("{}: {error}", path.display()))?;
    let albedo: Vec<f32> = (0..rows).flat_map(|y| (0..columns).map(move |x| material(x, y).albedo() as f32)).collect();
    files::finish(request, windows, &albedo, "")
}
