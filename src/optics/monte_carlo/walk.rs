//! One photon's random walk.
//!
//! Absorption is carried as a weight (implicit capture): a photon loses the absorbed share σa/σt at every event instead of
//! dying by chance, so every exit scores a smooth weight and the profiles' far tails, where one photon in 10⁵ would
//! survive, are filled by many small weights. Weights below [`FAINT`] play roulette, which ends the walk without bias.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::Rng;

use super::tally::Tally;
use super::{Layer, Light};
use crate::optics::VolumeCoefficients;

/// Weight under which a photon plays roulette, with survivors raised to [`REVIVED`]: a compromise in favour of faint transmission;
/// on 3 mm of white 1/(σ² s) is 6.6e6 for R and 5.0e8 for T; at 0.01 and 0.1 they are 6.2e6 and 5.0e8, at 0.2 and 0.5
/// 6.3e6 and 4.0e8, at 0.5 and 1 (nearly analog) 9.5e6 and 2.5e8. Thin slabs do not care.
pub(super) const FAINT: f64 = 0.05;
/// Weight a survivor of the roulette is raised to.
pub(super) const REVIVED: f64 = 0.25;

/// A plane layer as the walk sees it; z grows downwards from 0 at the lit top.
#[derive(Debug, Clone)]
struct Medium {
    top: f64,
    bottom: f64,
    sigma_t: f64,
    mean_free_path: f64,
    albedo: f64,
    phase: HenyeyGreenstein,
}

/// Layers from the top down, the last one endless if there is a half-space below.
#[derive(Debug, Clone)]
pub(super) struct Stack {
    media: Vec<Medium>,
}

impl Stack {
    pub(super) fn new(layers: &[Layer], base: Option<VolumeCoefficients>) -> Self {
        let mut media = Vec::with_capacity(layers.len() + 1);
        let mut top = 0.0;
        let base = base.map(|coefficients| Layer { coefficients, thickness_mm: f64::INFINITY });
        for layer in layers.iter().chain(&base).filter(|layer| layer.thickness_mm > 0.0) {
            let coefficients = layer.coefficients;
            let bottom = top + layer.thickness_mm;
            media.push(Medium {
                top,
                bottom,
                sigma_t: coefficients.sigma_t(),
                mean_free_path: 1.0 / coefficients.sigma_t(), // ∞ in a void
                albedo: coefficients.albedo(),
                phase: HenyeyGreenstein::new(coefficients.g),
            });
            top = bottom;
        }
        Self { media }
    }

    /// Follows one photon until it leaves or dies, and scores its exit.
    pub(super) fn trace(&self, light: Light, rng: &mut Xoshiro256PlusPlus, tally: &mut Tally) {
        let (mut x, mut y, mut z) = (0.0, 0.0, 0.0);
        // Only the distance from the axis is scored, so the azimuth of the entering direction is free.
        let mut direction = match light {
            Light::Normal => Direction { x: 0.0, y: 0.0, z: 1.0 },
            Light::Diffuse => {
                let cosine_squared = 1.0 - uniform(rng); // in (0, 1]
                Direction { x: (1.0 - cosine_squared).sqrt(), y: 0.0, z: cosine_squared.sqrt() }
            }
        };
        let mut weight = 1.0;
        let mut scattered = false;
        let mut index = 0;
        loop {
            // Fly until the sampled optical depth is used up, crossing layers on the way.
            let mut optical_depth = -libm::log(1.0 - uniform(rng));
            let medium = loop {
                let Some(medium) = self.media.get(index) else {
                    tally.score_bottom(x * x + y * y, weight, scattered);
                    return;
                };
                let flight = optical_depth * medium.mean_free_path;
                let reached = z + flight * direction.z;
                let downwards = direction.z > 0.0;
                if if downwards { reached < medium.bottom } else { reached > medium.top } {
                    x += flight * direction.x;
                    y += flight * direction.y;
                    z = reached;
                    break medium;
                }
                let boundary = if downwards { medium.bottom } else { medium.top };
                let crossing = (boundary - z) / direction.z;
                x += crossing * direction.x;
                y += crossing * direction.y;
                z = boundary;
                optical_depth = (optical_depth - crossing * medium.sigma_t).max(0.0);
                if downwards {
                    index += 1;
                } else if index == 0 {
                    tally.score_top(x * x + y * y, weight);
                    return;
                } else {
                    index -= 1;
                }
            };
            weight *= medium.albedo;
            if weight < FAINT {
                if uniform(rng) * REVIVED >= weight {
                    return;
                }
                weight = REVIVED;
            }
            scattered = true;
            direction = direction.turned(medium.phase.sample(uniform(rng)), azimuth(rng));
        }
    }
}

/// A unit vector; z points down into the stack.
#[derive(Debug, Clone, Copy)]
pub(super) struct Direction {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) z: f64,
}

impl Direction {
    /// This direction turned by a polar angle of the given cosine, at an azimuth given as (cos φ, sin φ). The frame around
    /// the old direction is that of Duff et al. 2017, *Building an Orthonormal Basis, Revisited*: no pole, no branch.
    #[inline]
    pub(super) fn turned(self, cosine: f64, (cos_phi, sin_phi): (f64, f64)) -> Self {
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
pub(super) struct HenyeyGreenstein {
    g: f64,
    one_minus_g_squared: f64,
    one_plus_g_squared: f64,
    half_inverse_g: f64,
}

impl HenyeyGreenstein {
    /// |g| under which the inverse (error ~ ε/g²) is worse than taking scattering as isotropic (error ~ g).
    const ISOTROPIC: f64 = 1e-5;

    pub(super) fn new(g: f64) -> Self {
        let g = if g.abs() < Self::ISOTROPIC { 0.0 } else { g };
        Self { g, one_minus_g_squared: 1.0 - g * g, one_plus_g_squared: 1.0 + g * g, half_inverse_g: 0.5 / g }
    }

    #[inline]
    pub(super) fn sample(&self, u: f64) -> f64 {
        if self.g == 0.0 {
            return 2.0 * u - 1.0;
        }
        let s = self.one_minus_g_squared / (1.0 - self.g + 2.0 * self.g * u);
        ((self.one_plus_g_squared - s * s) * self.half_inverse_g).clamp(-1.0, 1.0)
    }
}

/// Uniform in [0, 1), 53 bits.
#[inline]
pub(super) fn uniform(rng: &mut Xoshiro256PlusPlus) -> f64 {
    (rng.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// (cos φ, sin φ) of a uniform azimuth by von Neumann's rejection from the disc: arithmetic only, so the same on every machine.
#[inline]
pub(super) fn azimuth(rng: &mut Xoshiro256PlusPlus) -> (f64, f64) {
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
