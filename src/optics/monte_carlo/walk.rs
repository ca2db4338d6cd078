//! One photon's random walk.
//!
//! Absorption is carried as a weight (implicit capture): a photon loses the absorbed share σa/σt at every event instead
//! of dying by chance, so every exit scores a smooth weight and the profiles' far tails, where one photon in 10⁵ would
//! survive, are filled by many small weights. Weights below [`FAINT`] play roulette, which ends the walk without bias.

use rand_xoshiro::Xoshiro256PlusPlus;

use super::Light;
use super::photon::{Direction, FAINT, HenyeyGreenstein, REVIVED, azimuth, uniform};
use super::tally::Tally;
use crate::optics::{Layer, Stack, VolumeCoefficients, fresnel::refraction};

/// Refractive index of what surrounds the stack.
const AIR: f64 = 1.0;

/// A plane layer as the walk sees it; z grows downwards from 0 at the lit top.
#[derive(Debug, Clone)]
struct Medium {
    top: f64,
    bottom: f64,
    sigma_t: f64,
    mean_free_path: f64,
    albedo: f64,
    phase: HenyeyGreenstein,
    /// Refractive indices of the medium, of what lies above it and of what lies below.
    index: f64,
    index_above: f64,
    index_below: f64,
}

/// Layers from the top down, the last one endless if there is a half-space below.
#[derive(Debug, Clone)]
pub(super) struct Media {
    media: Vec<Medium>,
}

impl Media {
    pub(super) fn new(stack: &Stack<VolumeCoefficients>) -> Self {
        let mut media = Vec::with_capacity(stack.layers.len() + 1);
        let mut top = 0.0;
        let core = stack.core.map(|core| Layer::new(core, f64::INFINITY));
        for layer in stack.layers.iter().chain(&core).filter(|layer| layer.thickness_mm > 0.0) {
            let coefficients = layer.resin;
            let bottom = top + layer.thickness_mm;
            media.push(Medium {
                top,
                bottom,
                sigma_t: coefficients.sigma_t(),
                mean_free_path: 1.0 / coefficients.sigma_t(), // ∞ in a void
                albedo: coefficients.albedo(),
                phase: HenyeyGreenstein::new(coefficients.g),
                index: coefficients.refractive_index,
                index_above: AIR,
                index_below: AIR,
            });
            top = bottom;
        }
        for i in 1..media.len() {
            (media[i].index_above, media[i - 1].index_below) = (media[i - 1].index, media[i].index);
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
        if let Some(first) = self.media.first().filter(|first| first.index != AIR)
            && let Some(inside) = refraction(direction.z, AIR, first.index)
        {
            tally.score_glint(inside.reflectance);
            weight -= inside.reflectance;
            direction = direction.bent(AIR / first.index, inside.cosine);
        }
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
                let beyond = if downwards { medium.index_below } else { medium.index_above };
                if beyond != medium.index {
                    match refraction(direction.z.abs(), medium.index, beyond) {
                        Some(found) if uniform(rng) >= found.reflectance => {
                            direction = direction.bent(medium.index / beyond, found.cosine);
                        }
                        _ => {
                            direction.z = -direction.z;
                            continue;
                        }
                    }
                }
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
