//! Noise taken off a picture: edge-avoiding wavelets (Dammertz et al. 2010) that know each pixel's own noise, as in
//! Schied et al. 2017.
//!
//! Pixels are averaged with neighbours that show the same surface and differ by no more than noise explains. For the
//! eye only; no number comes from what is smoothed.

use glam::Vec3;
use rayon::prelude::*;

/// What a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shown {
    /// Where, mm.
    pub position: Vec3,
    /// Unit normal of the surface.
    pub normal: Vec3,
    /// Pixels of different kinds are kept apart.
    pub kind: u32,
}

/// Rounds; in each the neighbours are twice as far apart.
const ROUNDS: u32 = 4;
/// Standard deviations of noise that a difference may have.
const NOISE: f32 = 2.0;
/// Weights of neighbours 0, 1 and 2 steps off: a cubic B-spline.
const SPLINE: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];

/// Smooths a picture of rows of `shown.len() / height` pixels, given the variance of every pixel.
pub fn smooth(shown: &[Shown], width: usize, pixel_mm: f32, mut image: Vec<f32>, mut variance: Vec<f32>) -> Vec<f32> {
    for round in 0..ROUNDS {
        let step = 1_isize << round;
        let height = shown.len() / width;
        let near = |x: isize, y: isize| {
            (x >= 0 && y >= 0 && x < width as isize && y < height as isize).then(|| x as usize + width * y as usize)
        };
        // A pixel's own variance is as noisy as it is.
        let blurred = |pixel: usize| {
            let (x, y) = ((pixel % width) as isize, (pixel / width) as isize);
            let (mut sum, mut total) = (0.0, 0.0);
            for (dx, dy) in (-2..=2).flat_map(|dx: isize| (-2..=2).map(move |dy: isize| (dx, dy))) {
                if let Some(other) = near(x + dx, y + dy).filter(|&other| shown[other].kind == shown[pixel].kind) {
                    let weight = SPLINE[dx.unsigned_abs()] * SPLINE[dy.unsigned_abs()];
                    sum += weight * variance[other];
                    total += weight;
                }
            }
            sum / f32::max(total, f32::MIN_POSITIVE)
        };
        let noise: Vec<f32> = (0..shown.len()).into_par_iter().map(blurred).collect();
        let pixel = |pixel: usize| {
            let (x, y) = ((pixel % width) as isize, (pixel / width) as isize);
            let here = &shown[pixel];
            let (mut sum, mut spread, mut total) = (0.0, 0.0, 0.0);
            for (dx, dy) in (-2..=2).flat_map(|dx: isize| (-2..=2).map(move |dy: isize| (dx, dy))) {
                let Some(other) = near(x + dx * step, y + dy * step) else { continue };
                let there = &shown[other];
                if there.kind != here.kind {
                    continue;
                }
                let apart =
                    (image[other] - image[pixel]).powi(2) / (NOISE * NOISE * (noise[pixel] + noise[other]) + 1e-9);
                let out_of_plane =
                    here.normal.dot(there.position - here.position).abs() / (2.0 * step as f32 * pixel_mm);
                let turned = here.normal.dot(there.normal).max(0.0).powi(8);
                let near = SPLINE[dx.unsigned_abs()] * SPLINE[dy.unsigned_abs()];
                let weight = near * turned * libm::expf(-apart - out_of_plane);
                sum += weight * image[other];
                spread += weight * weight * variance[other];
                total += weight;
            }
            if total > 0.0 { (sum / total, spread / (total * total)) } else { (image[pixel], variance[pixel]) }
        };
        (image, variance) = (0..shown.len()).into_par_iter().map(pixel).unzip();
    }
    image
}
