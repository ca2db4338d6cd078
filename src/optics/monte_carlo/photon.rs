//! What every walk of photons shares: directions, the phase function, roulette, random numbers, and sums of weights.

use glam::DVec3;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::Rng;

use super::Estimate;

/// Weight under which a photon plays roulette, with survivors raised to [`REVIVED`]: a compromise in favour of faint
/// transmission; on 3 mm of white 1/(σ² s) is 6.6e6 for R and 5.0e8 for T; at 0.01 and 0.1 they are 6.2e6 and 5.0e8, at
/// 0.2 and 0.5 6.3e6 and 4.0e8, at 0.5 and 1 (nearly analog) 9.5e6 and 2.5e8. Thin slabs do not care.
pub(crate) const FAINT: f64 = 0.05;
/// Weight a survivor of the roulette is raised to.
pub(crate) const REVIVED: f64 = 0.25;

/// A unit vector; z points down into the stack.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Direction {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
}

impl From<DVec3> for Direction {
    #[inline]
    fn from(DVec3 { x, y, z }: DVec3) -> Self {
        Self { x, y, z }
    }
}

impl From<Direction> for DVec3 {
    #[inline]
    fn from(Direction { x, y, z }: Direction) -> Self {
        Self { x, y, z }
    }
}

impl Direction {
    /// Beyond a horizontal boundary, where the sine is `ratio` times the old one and the cosine has the given size.
    #[inline]
    pub(super) fn bent(self, ratio: f64, cosine: f64) -> Self {
        Self { x: ratio * self.x, y: ratio * self.y, z: cosine.copysign(self.z) }
    }

    /// This direction turned by a polar angle of the given cosine, at an azimuth given as (cos φ, sin φ). The frame
    /// around the old direction is that of Duff et al. 2017, *Building an Orthonormal Basis, Revisited*: no pole, no
    /// branch.
    #[inline]
    pub(crate) fn turned(self, cosine: f64, (cos_phi, sin_phi): (f64, f64)) -> Self {
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let (u, v) = (sine * cos_phi, sine * sin_phi);
        let sign = 1.0_f64.copysign(self.z);
        let a = -1.0 / (sign + self.z);
        let b = self.x * self.y * a;
        Self {
            x: u * (1.0 + sign * self.x * self.x * a) + v * b + cosine * self.x,
            y: u * sign * b + v * (sign + self.y * self.y * a) + cosine * self.y,
            z: -u * sign * self.x - v * self.y + cosine * self.z,
        }
    }
}

/// Inverse of the phase function's distribution of cosines.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HenyeyGreenstein {
    g: f64,
    one_minus_g_squared: f64,
    one_plus_g_squared: f64,
    half_inverse_g: f64,
}

impl HenyeyGreenstein {
    /// |g| under which the inverse (error ~ ε/g²) is worse than taking scattering as isotropic (error ~ g).
    const ISOTROPIC: f64 = 1e-5;

    pub(crate) fn new(g: f64) -> Self {
        let g = if g.abs() < Self::ISOTROPIC { 0.0 } else { g };
        Self { g, one_minus_g_squared: 1.0 - g * g, one_plus_g_squared: 1.0 + g * g, half_inverse_g: 0.5 / g }
    }

    #[inline]
    pub(crate) fn sample(&self, u: f64) -> f64 {
        if self.g == 0.0 {
            return 2.0 * u - 1.0;
        }
        let s = self.one_minus_g_squared / (1.0 - self.g + 2.0 * self.g * u);
        ((self.one_plus_g_squared - s * s) * self.half_inverse_g).clamp(-1.0, 1.0)
    }
}

impl HenyeyGreenstein {
    /// Probability per steradian of a cosine.
    #[inline]
    pub(crate) fn density(&self, cosine: f64) -> f64 {
        let spread = self.one_plus_g_squared - 2.0 * self.g * cosine;
        self.one_minus_g_squared / (4.0 * std::f64::consts::PI * spread * spread.sqrt())
    }
}

/// Uniform in [0, 1), 53 bits.
#[inline]
pub(crate) fn uniform(rng: &mut Xoshiro256PlusPlus) -> f64 {
    (rng.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// (cos φ, sin φ) of a uniform azimuth by von Neumann's rejection from the disc: arithmetic only, so the same on every
/// machine.
#[inline]
pub(crate) fn azimuth(rng: &mut Xoshiro256PlusPlus) -> (f64, f64) {
    loop {
        let bits = rng.next_u64();
        let u = f64::from(bits as u32 as i32) * (1.0 / (1u64 << 31) as f64);
        let v = f64::from((bits >> 32) as u32 as i32) * (1.0 / (1u64 << 31) as f64);
        let squared = u * u + v * v;
        if squared <= 1.0 && squared > 0.0 {
            // Doubling the angle of (u, v) spares the square root.
            let inverse = 1.0 / squared;
            return ((u * u - v * v) * inverse, 2.0 * u * v * inverse);
        }
    }
}

/// First and second moment of weights.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Moments {
    weight: f64,
    squared: f64,
}

impl Moments {
    #[inline]
    pub(crate) fn score(&mut self, weight: f64) {
        self.weight += weight;
        self.squared += weight * weight;
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.weight += other.weight;
        self.squared += other.squared;
    }

    pub(crate) fn estimate(&self, photons: u64) -> Estimate {
        let n = photons as f64;
        let mean = self.weight / n;
        let variance = (self.squared / n - mean * mean).max(0.0);
        Estimate { mean, standard_error: (variance / (n - 1.0)).sqrt() }
    }
}
