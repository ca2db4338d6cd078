//! Noise taken off a picture: edge-avoiding wavelets (Dammertz et al. 2010) that know each pixel's own noise, as in
//! Schied et al. 2017.
//!
//! Pixels are averaged with neighbours that show the same surface and differ by no more than noise explains. Before
//! that, sparks (a rare path of much light) are brought down to the brightest pixel around them. For the eye only; no
//! number comes from what is smoothed.

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

/// So many standard deviations of its own a spark is brighter than all pixels around it: one path of much light among
/// many of none has a mean as large as its standard deviation.
const SPARK: f32 = 0.5;
/// Neighbours of the same kind that tell a spark.
const WITNESSES: usize = 5;

/// Brings sparks down to the brightest of the pixels around them, with its variance.
fn quench(shown: &[Shown], width: usize, image: &mut Vec<f32>, variance: &mut Vec<f32>) {
    let height = shown.len() / width;
    let pixel = |pixel: usize| {
        let (x, y) = (pixel % width, pixel / width);
        let (mut witnesses, mut brightest) = (0, pixel);
        for ny in y.saturating_sub(1)..height.min(y + 2) {
            for nx in x.saturating_sub(1)..width.min(x + 2) {
                let other = nx + width * ny;
                if other == pixel || shown[other].kind != shown[pixel].kind {
                    continue;
                }
                witnesses += 1;
                if brightest == pixel || image[other] > image[brightest] {
                    brightest = other;
                }
            }
        }
        let spark = image[pixel] > image[brightest] + SPARK * variance[pixel].sqrt();
        let from = if witnesses >= WITNESSES && spark { brightest } else { pixel };
        (image[from], variance[from])
    };
    (*image, *variance) = (0..shown.len()).into_par_iter().map(pixel).unzip();
}

/// Smooths a picture of rows of `shown.len() / height` pixels, given the variance of every pixel.
pub fn smooth(shown: &[Shown], width: usize, pixel_mm: f32, mut image: Vec<f32>, mut variance: Vec<f32>) -> Vec<f32> {
    quench(shown, width, &mut image, &mut variance);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(pixels: usize) -> Vec<Shown> {
        let shown = |n: usize| Shown { position: Vec3::new(n as f32, 0.0, 0.0), normal: Vec3::Z, kind: 1 };
        (0..pixels).map(shown).collect()
    }

    #[test]
    fn a_spark_goes_and_an_edge_stays() {
        let (width, height) = (16, 12);
        let edge = |n: usize| if n % width < 8 { 0.2 } else { 0.6 };
        let (mut image, mut variance): (Vec<f32>, Vec<f32>) = (0..width * height).map(|n| (edge(n), 1e-6)).unzip();
        let spark = 5 + 6 * width;
        (image[spark], variance[spark]) = (9.0, 16.0);
        let smoothed = smooth(&wall(width * height), width, 0.1, image, variance);
        for (n, value) in smoothed.iter().enumerate() {
            assert!((value - edge(n)).abs() < 0.02, "pixel {n}: {value} in place of {}", edge(n));
        }
    }
}
