//! Straight ways through a stack, bent at its boundaries.

use std::f64::consts::FRAC_1_SQRT_2;

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
/// ρ at its end (see [`super::scattering`]); `backwards`, with C's transpose. By Taylor's series over parts of at most
/// [`PART`]. At most 32 orders.
pub(super) fn stream(orders: &mut [f64], x: f64, ratio: f64, backwards: bool) {
    /// Longest part.
    const PART: f64 = 1.0;
    /// Terms that are smaller end the series.
    const ENOUGH: f64 = 1e-9;
    const MOST: usize = 32;
    if x == 0.0 || orders.is_empty() {
        return;
    }
    let count = orders.len().min(MOST);
    let parts = (x / PART).ceil();
    let step = if backwards { x / parts } else { -x / parts };
    // The loss at the end damps in both directions.
    let loss = if count == 1 { ratio } else { 0.5 * ratio } * if backwards { -1.0 } else { 1.0 };
    // A zero on either side of the orders.
    let (mut term, mut next) = ([0.0; MOST + 2], [0.0; MOST + 2]);
    for _ in 0..parts as usize {
        term[1..=count].copy_from_slice(&orders[..count]);
        let mut power = 1.0;
        loop {
            for m in 1..=count {
                next[m] = 0.5 * (term[m - 1] - term[m + 1]);
            }
            // Order 0 is coupled by √½.
            if count > 1 {
                next[1] = -FRAC_1_SQRT_2 * term[2];
                next[2] = FRAC_1_SQRT_2 * term[1] - 0.5 * term[3];
            } else {
                next[1] = 0.0;
            }
            next[count] += loss * term[count];
            let scale = step / power;
            let mut largest = 0.0_f64;
            for (order, (term, next)) in
                orders[..count].iter_mut().zip(term[1..=count].iter_mut().zip(&next[1..=count]))
            {
                *term = scale * next;
                *order += *term;
                largest = largest.max(term.abs());
            }
            if largest < ENOUGH {
                break;
            }
            power += 1.0;
        }
    }
}
