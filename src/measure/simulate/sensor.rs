//! Light into numbers, as a single-lens reflex camera of the 2010s does it.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use crate::parallel;

/// Above so many electrons a Poisson distribution is taken for normal.
const NORMAL_FROM: f64 = 60.0;

/// A sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedCamera {
    /// Electrons a pixel holds.
    pub full_well_e: f64,
    /// Electrons per DN.
    pub gain_e_per_dn: f64,
    /// Standard deviation of reading, electrons.
    pub read_noise_e: f64,
    /// Electrons per second in the dark.
    pub dark_e_per_s: f64,
    /// DN without light.
    pub black_level: f64,
    /// Largest number it writes.
    pub largest_dn: f64,
}

impl Default for SimulatedCamera {
    /// 14 bits, 40 000 electrons, 5 electrons of read noise: a full-frame body at ISO 100.
    fn default() -> Self {
        Self {
            full_well_e: 40_000.0,
            gain_e_per_dn: 2.6,
            read_noise_e: 5.0,
            dark_e_per_s: 0.1,
            black_level: 512.0,
            largest_dn: 16_383.0,
        }
    }
}

impl SimulatedCamera {
    /// Numbers for electrons per second in each pixel; rows have random numbers of their own, so threads do not matter.
    pub fn expose(&self, electrons_per_s: &[f32], width: usize, seconds: f64, seed: u64) -> Vec<u16> {
        let mut values = vec![0_u16; electrons_per_s.len()];
        parallel::rows(&mut values, width, |y, values| {
            let row_seed = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(y as u64);
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(row_seed);
            for (value, light) in values.iter_mut().zip(&electrons_per_s[y * width..]) {
                let mean = (f64::from(*light) + self.dark_e_per_s) * seconds;
                let electrons = poisson(mean, &mut rng).min(self.full_well_e) + self.read_noise_e * normal(&mut rng);
                let number = (electrons / self.gain_e_per_dn + self.black_level).round();
                *value = number.clamp(0.0, self.largest_dn) as u16;
            }
        });
        values
    }
}

impl SimulatedCamera {
    /// A number as a program writes it that puts black at 0, the largest at 65535, and sRGB's curve between.
    pub fn encoded(&self, number: u16) -> u16 {
        let linear = (f64::from(number) - self.black_level).max(0.0) / (self.largest_dn - self.black_level);
        (65_535.0 * crate::colour::linear_to_srgb(linear)).round() as u16
    }
}

/// Uniform in (0, 1).
fn uniform(rng: &mut impl Rng) -> f64 {
    ((rng.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
}

/// Normally distributed, by Box and Muller's transform (1958).
pub(in crate::measure) fn normal(rng: &mut impl Rng) -> f64 {
    let (a, b) = (uniform(rng), uniform(rng));
    (-2.0 * libm::log(a)).sqrt() * libm::cos(std::f64::consts::TAU * b)
}

fn poisson(mean: f64, rng: &mut impl Rng) -> f64 {
    if mean > NORMAL_FROM {
        return (mean + mean.sqrt() * normal(rng)).round().max(0.0);
    }
    // Knuth (1969): products of uniform numbers.
    let limit = libm::exp(-mean);
    let (mut count, mut product) = (0.0, uniform(rng));
    while product > limit {
        count += 1.0;
        product *= uniform(rng);
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_that_of_photons_and_reading() {
        let camera = SimulatedCamera { dark_e_per_s: 0.0, ..SimulatedCamera::default() };
        for light in [0.0, 7.0, 900.0, 20_000.0] {
            let values = camera.expose(&vec![light; 40_000], 200, 1.0, 3);
            let n = values.len() as f64;
            let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
            let variance = values.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / n;
            let expected = (f64::from(light) + 25.0) / 2.6_f64.powi(2) + 1.0 / 12.0;
            assert!((mean - 512.0 - f64::from(light) / 2.6).abs() < 5.0 * (expected / n).sqrt(), "{light}: {mean}");
            assert!((variance / expected - 1.0).abs() < 0.04, "{light}: variance {variance} for {expected}");
        }
    }
}
