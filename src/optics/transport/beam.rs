//! Diffuse light that goes straight through.
//!
//! A stack lets through ∫ e^{−Σ τ/μ} J₀(k Σ h tanθ) 2μ dμ of a diffuse point source at spatial frequency k, less what
//! its boundaries reflect, in the unit of the flux that enters; Σ is over the layers, each with its own μ and θ. Few
//! directions sample this badly where kh is large.

use std::f64::consts::PI;

use super::{
    directions::{AIR, Directions},
    rays::{Ray, stream},
    scattering::{Scattering, ratio},
};
use crate::numeric::quadrature::GAUSS_8_OF_UNIT;

/// What is left out of the integral, roughly.
const TOLERANCE: f64 = 1e-9;
/// Light on a node below this share needs no waves.
const DEAD: f64 = 1e-10;

/// Light that crosses the whole stack unscattered.
pub(super) struct Straight<'a> {
    layers: &'a [(Scattering, f64)],
    exact: Beam,
    rays: Vec<Ray>,
    orders: usize,
    /// Share of the exact beam that the directions see at k = 0; kept, so that R + T stays what it is.
    share: f64,
}

impl<'a> Straight<'a> {
    /// For spatial frequencies up to `k_max` rad/mm.
    pub(super) fn new(layers: &'a [(Scattering, f64)], directions: &Directions, k_max: f64) -> Self {
        let (exact, rays) = (Beam::new(layers, k_max), directions.crossing(layers));
        let mut it = Self { layers, exact, rays, orders: directions.orders, share: 0.0 };
        let exact = it.exact.unscattered(0.0);
        if exact > 0.0 {
            it.share = it.seen(0.0) / exact;
        }
        it
    }

    /// Share of the light that comes through unscattered.
    pub(super) fn through(&self) -> f64 {
        self.exact.unscattered(0.0)
    }

    /// The exact beam in place of the directions' own.
    pub(super) fn correction(&self, k: f64) -> f64 {
        self.share * self.exact.unscattered(k) - self.seen(k)
    }

    /// The beam as the directions see it.
    fn seen(&self, k: f64) -> f64 {
        let mut orders = vec![0.0; self.orders];
        let one = |ray: &Ray| {
            orders.fill(0.0);
            orders[0] = ray.flux * ray.crossings() * libm::exp(-depth(self.layers, ray));
            if orders[0] > DEAD {
                for (leg, (resin, mm)) in ray.legs.iter().zip(self.layers) {
                    let ratio = ratio(resin.extinction, k * (1.0 - leg.mu * leg.mu).sqrt());
                    stream(&mut orders, k * mm * leg.slope, ratio, false);
                }
            }
            orders[0]
        };
        self.rays.iter().map(one).sum()
    }
}

/// Σ τ/μ.
fn depth(layers: &[(Scattering, f64)], ray: &Ray) -> f64 {
    ray.legs.iter().zip(layers).map(|(leg, (resin, mm))| mm * resin.extinction / leg.mu).sum()
}

/// Unscattered diffuse light as a sum of shares J₀(k a).
struct Beam {
    /// Share, and a = Σ h tanθ.
    ways: Vec<(f64, f64)>,
}

impl Beam {
    /// Nodes in u = tanθ of the air, where the integral is ∫ … J₀ 2u / (1 + u²)² du, close enough for `k_max`.
    fn new(layers: &[(Scattering, f64)], k_max: f64) -> Self {
        let mut ways = Vec::new();
        let mut from = 0.0_f64;
        loop {
            let squared = 1.0 + from * from;
            let ray = Ray::new(layers, 1.0 / squared.sqrt(), 1.0);
            // How fast the wave turns: d(k h tanθ)/du, p = n sinθ.
            let turns = layers.iter().zip(&ray.legs).map(|((resin, mm), leg)| {
                let denser = (resin.index * leg.mu).powi(2);
                k_max
                    * mm
                    * if resin.index == AIR { 1.0 } else { resin.index / (leg.mu * denser * libm::pow(squared, 1.5)) }
            });
            let turn = turns.fold(1e-300, |sum: f64, turn| sum + turn);
            // What remains, with a wave cancelling what is over a length of 1/turn, is below u · envelope.
            let envelope = 2.0 * from / (squared * squared) * libm::exp(-depth(layers, &ray));
            if from > 2.0 && envelope * from.min(1.0 / turn) < TOLERANCE {
                return Self { ways };
            }
            let step = (0.25 * (1.0 + from)).min(PI / turn);
            for (x, weight) in GAUSS_8_OF_UNIT {
                let u = from + step * x;
                let squared = 1.0 + u * u;
                let ray = Ray::new(layers, 1.0 / squared.sqrt(), 1.0);
                let across: f64 = ray.legs.iter().zip(layers).map(|(leg, (_, mm))| mm * leg.slope).sum();
                let through = ray.crossings() * libm::exp(-depth(layers, &ray));
                ways.push((step * weight * through * 2.0 * u / (squared * squared), across));
            }
            from += step;
        }
    }

    fn unscattered(&self, k: f64) -> f64 {
        self.ways.iter().map(|(share, across)| share * libm::j0(k * across)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::{TransportOptions, VolumeCoefficients};

    /// One layer that only absorbs, of optical thickness `tau` > 0.
    fn dye(tau: f64, mm: f64, directions: &Directions) -> [(Scattering, f64); 1] {
        let volume = VolumeCoefficients { sigma_s: 0.0, sigma_a: tau / mm, g: 0.0, refractive_index: 1.0 };
        [(Scattering::new(&volume, directions), mm)]
    }

    fn few() -> Directions {
        Directions::new([], TransportOptions { polar: 2, orders: 1 })
    }

    /// Without extinction the light spreads as 1/(r² + h²)²; its transform is x K₁(x), Abramowitz and Stegun 9.6.25, x
    /// = kh.
    #[test]
    fn nothing_in_the_way() {
        for (x, x_k1) in
            [(0.0, 1.0), (0.1, 0.985_384_478_087_3), (1.0, 0.601_907_230_197_2), (5.0, 0.020_223_065_727_6)]
        {
            let found = Beam::new(&dye(1e-12, 0.5, &few()), x / 0.5).unscattered(x / 0.5);
            assert!((found - x_k1).abs() < 1e-6, "x = {x}: {found} instead of {x_k1}");
        }
    }

    /// 2 E₃(τ) of uniform light: Abramowitz and Stegun, table 5.4.
    #[test]
    fn uniform_light() {
        for (tau, e3) in [(0.1, 0.416_291_5), (0.5, 0.221_604_4), (1.0, 0.109_692_0), (2.0, 0.030_133_4)] {
            let found = Beam::new(&dye(tau, 1.0, &few()), 0.0).unscattered(0.0);
            assert!((found - 2.0 * e3).abs() < 2e-6, "τ = {tau}: {found} instead of {}", 2.0 * e3);
        }
    }

    #[test]
    fn enough_directions_see_the_same() {
        let directions = Directions::new([], TransportOptions { polar: 64, orders: 60 });
        let layers = dye(1.6, 1.0, &directions);
        let straight = Straight::new(&layers, &directions, 20.0);
        for k in [0.0, 3.0, 20.0] {
            let (exact, seen) = (straight.exact.unscattered(k), straight.seen(k));
            assert!((exact - seen).abs() < 1e-5, "k = {k}: {exact} and {seen}");
        }
    }
}
