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

/// Voxels over which grains of dithered inks run together, as a standard deviation.
const GRAINS: f32 = 1.5;
/// Most rounds in which colours run together: 1, 2, 4 and 8 pixels.
const CHROMA_ROUNDS: u32 = 4;
/// Light below which there is no colour.
const DARK: f32 = 1e-5;

/// Lets the colours of neighbours on the same surface run together, over the few voxels of `voxel_pixels` edge that a
/// dithered ink needs to become a share of it, and leaves the sum of the channels as it is. What a picture shows of
/// single voxels are dots of cyan, magenta and yellow, which nobody sees of a print: its voxels are smaller, or the eye
/// is farther off. Photons of several channels make such noise too.
pub fn smooth_chroma(shown: &[Shown], width: usize, voxel_pixels: f32, channels: &mut [Vec<f32>]) {
    let sigma = (GRAINS * voxel_pixels).max(1.0);
    let height = shown.len() / width;
    let total = |channels: &[Vec<f32>], pixel: usize| channels.iter().map(|channel| channel[pixel]).sum::<f32>();
    let sums: Vec<f32> = (0..shown.len()).map(|pixel| total(channels, pixel)).collect();
    let mut wide: Vec<Vec<f32>> = channels.to_vec();
    let (mut reached, mut round) = (0.0, 0);
    while reached < sigma && round < CHROMA_ROUNDS {
        let step = 1_isize << round;
        let pixel = |pixel: usize| {
            let (x, y) = ((pixel % width) as isize, (pixel / width) as isize);
            let here = &shown[pixel];
            let taps = (-2..=2).flat_map(|dx: isize| (-2..=2).map(move |dy: isize| (dx, dy)));
            let near = taps.filter_map(|(dx, dy)| {
                let (x, y) = (x + dx * step, y + dy * step);
                let inside = x >= 0 && y >= 0 && x < width as isize && y < height as isize;
                let other = inside.then(|| x as usize + width * y as usize)?;
                let there = &shown[other];
                let turned = here.normal.dot(there.normal).max(0.0).powi(8);
                let weight = SPLINE[dx.unsigned_abs()] * SPLINE[dy.unsigned_abs()] * turned;
                (there.kind == here.kind).then_some((other, weight))
            });
            // Of more channels than three the rest keep their own.
            let mut sum = [0.0; 3];
            let mut weights = 0.0;
            for (other, weight) in near {
                sum.iter_mut().zip(&wide).for_each(|(sum, channel)| *sum += weight * channel[other]);
                weights += weight;
            }
            sum.map(|sum| sum / f32::max(weights, f32::MIN_POSITIVE))
        };
        let smoothed: Vec<[f32; 3]> = (0..shown.len()).into_par_iter().map(pixel).collect();
        for (c, channel) in wide.iter_mut().take(3).enumerate() {
            channel.iter_mut().zip(&smoothed).for_each(|(value, smoothed)| *value = smoothed[c]);
        }
        // A cubic B-spline has the variance of a pixel.
        reached = (reached * reached + (step * step) as f32).sqrt();
        round += 1;
    }
    for pixel in 0..shown.len() {
        let wide_sum = total(&wide, pixel);
        if wide_sum > DARK && sums[pixel] > DARK {
            for (channel, wide) in channels.iter_mut().zip(&wide) {
                channel[pixel] = sums[pixel] * wide[pixel] / wide_sum;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(pixels: usize) -> Vec<Shown> {
        let shown = |n: usize| Shown { position: Vec3::new(n as f32, 0.0, 0.0), normal: Vec3::Z, kind: 1 };
        (0..pixels).map(shown).collect()
    }

    #[test]
    fn dots_of_inks_run_together_and_light_stays() {
        let (width, height) = (24, 20);
        // A shadow's edge, over dots of two inks.
        let light = |n: usize| if n % width < 12 { 0.05 } else { 0.5 };
        let ink = |n: usize| [[0.9, 0.3, 0.3], [0.3, 0.9, 0.3]][(n % width + n / width) % 2];
        let dots = |c: usize| (0..width * height).map(|n| light(n) * ink(n)[c]).collect::<Vec<f32>>();
        let before: Vec<Vec<f32>> = (0..3).map(dots).collect();
        let mut after = before.clone();
        smooth_chroma(&wall(width * height), width, 1.5, &mut after);
        for n in 0..width * height {
            let of = |channels: &[Vec<f32>]| [0, 1, 2].map(|c| channels[c][n]);
            let ([r, g, b], sum) = (of(&after), of(&before).iter().sum::<f32>());
            assert!((r + g + b - sum).abs() < 1e-5, "pixel {n}: {r} {g} {b} of {sum}");
            let (x, y) = (n % width, n / width);
            let within = (4..width - 4).contains(&x) && (4..height - 4).contains(&y);
            assert!(!within || (r - g).abs() < 0.1 * r, "pixel {n}: {r} {g} {b}");
        }
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
