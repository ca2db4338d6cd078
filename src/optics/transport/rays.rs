//! Straight ways through a stack, bent at its boundaries.

use super::{directions::AIR, scattering::Scattering};
use crate::optics::fresnel::refraction;

/// A way from the air above through every layer into the air below. Light that turns round at a boundary is not on it.
#[derive(Debug, Clone)]
pub(super) struct Ray {
    /// Flux that enters on it, of unit diffuse light.
    pub(super) flux: f64,
    /// Its course in every layer.
    pub(super) legs: Vec<Leg>,
}

/// A way's course in one layer.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leg {
    pub(super) mu: f64,
    /// dμ in the layer.
    pub(super) weight: f64,
    /// tanθ.
    pub(super) slope: f64,
    /// What the boundaries above the layer, and below it, let through.
    pub(super) into: f64,
    pub(super) out: f64,
}

impl Ray {
    /// The way of cosine `mu` in air, for a share `weight` = dμ there.
    pub(super) fn new(layers: &[(Scattering, f64)], mu: f64, weight: f64) -> Self {
        let cosine = |index: f64| (1.0 - (1.0 - mu * mu) / (index * index)).sqrt();
        let mut legs: Vec<Leg> = Vec::with_capacity(layers.len());
        let (mut above, mut into) = (AIR, 1.0);
        for (resin, _) in layers {
            let inside = cosine(resin.index);
            into *= crossing(cosine(above), above, resin.index);
            above = resin.index;
            let weight = mu * weight / (resin.index * resin.index * inside);
            legs.push(Leg { mu: inside, weight, slope: (1.0 - inside * inside).sqrt() / inside, into, out: 1.0 });
        }
        let (mut below, mut out) = (AIR, 1.0);
        for (leg, (resin, _)) in legs.iter_mut().zip(layers).rev() {
            out *= crossing(leg.mu, resin.index, below);
            (leg.out, below) = (out, resin.index);
        }
        Self { flux: 2.0 * mu * weight, legs }
    }

    /// What all boundaries together let through.
    pub(super) fn crossings(&self) -> f64 {
        self.legs.first().map_or(1.0, |leg| leg.into * leg.out)
    }
}

/// Transmittance of a boundary.
fn crossing(cosine: f64, from: f64, into: f64) -> f64 {
    if from == into { 1.0 } else { refraction(cosine, from, into).map_or(0.0, |found| 1.0 - found.reflectance) }
}

/// Azimuthal orders along a way as the directions see it: v ← e^{−xC} v, x = k z tanθ, with C the orders' coupling and
/// ρ at its end (see [`super::scattering`]); `backwards`, with C's transpose. By Taylor's series over parts of at most [`PART`].
pub(super) fn stream(orders: &mut [f64], x: f64, ratio: f64, backwards: bool, scratch: &mut [f64]) {
    /// Longest part, and terms for it: what is left out is below 1e-10.
    const PART: f64 = 1.0;
    const TERMS: usize = 12;
    let parts = (x / PART).ceil().max(1.0);
    let step = if backwards { x / parts } else { -x / parts };
    let (last, loss) = (orders.len() - 1, if orders.len() == 1 { ratio } else { 0.5 * ratio });
    let (term, next) = scratch.split_at_mut(orders.len());
    for _ in 0..parts as usize {
        term.copy_from_slice(orders);
        for i in 1..=TERMS {
            for m in 0..=last {
                let lower = if m > 0 { super::directions::coupling(m) * term[m - 1] } else { 0.0 };
                let upper = if m < last { super::directions::coupling(m + 1) * term[m + 1] } else { 0.0 };
                next[m] = lower - upper;
            }
            // The loss at the end damps in both directions.
            next[last] += if backwards { -loss } else { loss } * term[last];
            for ((order, term), next) in orders.iter_mut().zip(term.iter_mut()).zip(next.iter()) {
                *term = step / i as f64 * next;
                *order += *term;
            }
        }
    }
}
