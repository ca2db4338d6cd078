//! Light in a stack by the transport equation, at every spatial frequency on its own.
//!
//! What Kubelka–Munk lacks is direction. Here light has as many as the accuracy needs, its lateral course e^{ikx} couples them, and a slab's
//! reflection and transmission are matrices over them; equations 3 and 4 of Hašan et al. 2010 compose those as they compose
//! scalars. Index-matched resins with the phase function of Henyey and Greenstein; no resin–air boundary yet.
//!
//! ```text
//!   VolumeCoefficients ──► Scattering ──► Generator(k) ──► Slab ──► Below, from the core up ──► R̂(k), T̂(k)
//! ```
//!
//! Every frequency is reckoned on its own, so that the threads' number changes nothing.

mod beam;
mod directions;
mod modal;
mod once;
mod scattering;
mod slab;

use faer::{Col, Mat, Row, Scale, linalg::solvers::Solve};
use rayon::prelude::*;

pub use self::modal::{ModalReflection, ReflectionSlope};
use self::{
    beam::{Straight, unscattered},
    directions::Directions,
    once::Once,
    scattering::Scattering,
    slab::{Slab, factorise, plus_identity},
};
use super::{FrequencyGrid, Light, VolumeCoefficients};

/// Directions of the model: polar angles of a hemisphere and azimuthal orders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TransportOptions {
    /// Polar angles per hemisphere, 2 to 32.
    pub polar: usize,
    /// Azimuthal orders, 1 to 32. One will do where only totals matter.
    pub orders: usize,
}

impl TransportOptions {
    /// 5 × 8: R̂ within 3e-4 rms of Monte Carlo from 0 to 20 rad/mm (docs/accuracy.md), at a third of the default's cost.
    pub const REFLECTION: Self = Self { polar: 5, orders: 8 };
}

impl Default for TransportOptions {
    /// 7 × 10: T̂ of thin layers within 3e-3 rms of Monte Carlo from 0 to 20 rad/mm too (docs/accuracy.md).
    fn default() -> Self {
        Self { polar: 7, orders: 10 }
    }
}

/// The transport model of a stack in one channel.
#[derive(Debug, Clone, Copy)]
pub struct Transport<'a> {
    /// Layers from the observer down, each with its thickness in mm, finite and ≥ 0.
    pub layers: &'a [(VolumeCoefficients, f64)],
    /// The half-space below, if there is one.
    pub base: Option<VolumeCoefficients>,
    /// The source.
    pub light: Light,
    /// How many directions.
    pub options: TransportOptions,
}

/// Hankel transforms of what leaves a stack.
#[derive(Debug, Clone, PartialEq)]
pub struct TransportSpectra {
    /// R̂(k).
    pub reflection: Vec<f64>,
    /// T̂(k); 0 over a half-space.
    pub transmission: Vec<f64>,
}

/// A stack seen from above.
struct Below {
    reflection: Mat<f64>,
    /// Flux that leaves at the bottom for one unit from each direction.
    through: Row<f64>,
}

impl Transport<'_> {
    /// R̂ and T̂ over `grid`.
    pub fn spectra(&self, grid: &FrequencyGrid) -> TransportSpectra {
        let directions = Directions::new(self.options.polar, self.options.orders);
        let scattering = |volume: &VolumeCoefficients| Scattering::new(volume, &directions);
        let layers: Vec<_> = self.merged().into_iter().map(|(volume, mm)| (scattering(&volume), mm)).collect();
        let base = self.base.as_ref().map(scattering);
        let source = self.source(&directions);
        let few_turns = if base.is_none() { FewTurns::new(&layers, &directions, self.light) } else { None };
        let at = |&k: &f64| {
            let below = Below::new(&layers, base.as_ref(), &directions, k);
            let reflection = flux(&directions) * (&below.reflection * &source);
            let transmission = &below.through * &source + few_turns.as_ref().map_or(0.0, |light| light.correction(k));
            (reflection, transmission)
        };
        let (reflection, transmission) = grid.as_slice().par_iter().map(at).unzip();
        TransportSpectra { reflection, transmission }
    }

    /// The layers, neighbours of one resin as one: what is taken by quadrature over a layer must not depend on how it was written.
    fn merged(&self) -> Vec<(VolumeCoefficients, f64)> {
        let mut merged: Vec<(VolumeCoefficients, f64)> = Vec::new();
        for &(volume, mm) in self.layers {
            match merged.last_mut() {
                Some((above, sum)) if *above == volume => *sum += mm,
                _ => merged.push((volume, mm)),
            }
        }
        merged
    }

    fn source(&self, directions: &Directions) -> Col<f64> {
        match self.light {
            Light::Diffuse => {
                let flux: Vec<f64> = directions.diffuse().collect();
                Col::from_fn(flux.len(), |i| flux[i])
            }
            Light::Normal => Col::from_fn(directions.len(), |i| if i == directions.beam() { 1.0 } else { 0.0 }),
        }
    }
}

/// Sums flux over directions: the unknowns of order 0.
fn flux(directions: &Directions) -> Row<f64> {
    let order: Vec<usize> = directions.unknowns().map(|u| u.order).collect();
    Row::from_fn(order.len(), |i| if order[i] == 0 { 1.0 } else { 0.0 })
}

impl Below {
    fn new(layers: &[(Scattering, f64)], base: Option<&Scattering>, directions: &Directions, k: f64) -> Self {
        let n = directions.len();
        let bottom = Self {
            reflection: match base {
                Some(base) => Slab::half_space(&base.generator(k), base.extinction),
                None => Mat::zeros(n, n),
            },
            through: if base.is_some() { Row::zeros(n) } else { flux(directions) },
        };
        layers
            .iter()
            .rev()
            .fold(bottom, |below, (scattering, mm)| below.under(&Slab::new(&scattering.generator(k), *mm)))
    }

    /// Lays a slab on top: equations 3 and 4 with matrices.
    fn under(&self, slab: &Slab) -> Self {
        // What goes down between the two: (I − R_slab R_below)⁻¹ T_slab.
        let between = plus_identity(Scale(-1.0) * (&slab.reflection * &self.reflection), 1.0);
        let down = factorise(&between).solve(&slab.transmission);
        Self {
            reflection: &slab.reflection + &slab.transmission * (&self.reflection * &down),
            through: &self.through * &down,
        }
    }
}

/// What comes through a thin stack with one turn at most, better than the directions see it.
struct FewTurns<'a> {
    directions: &'a Directions,
    /// Diffuse light without a turn; the directions have a vertical beam of their own.
    straight: Option<Straight>,
    once: Once<'a>,
}

impl<'a> FewTurns<'a> {
    /// Where less comes through unscattered, T̂ is right to 1e-3 without (docs/accuracy.md).
    const LEAST: f64 = 1e-3;

    fn new(layers: &'a [(Scattering, f64)], directions: &'a Directions, light: Light) -> Option<Self> {
        let (tau, _) = extent(layers);
        let (through, straight) = match light {
            Light::Diffuse => (unscattered(tau, 0.0, 0.0), Some(Straight::new(layers, directions))),
            Light::Normal => ((-tau).exp(), None),
        };
        (through >= Self::LEAST).then(|| Self { directions, straight, once: Once::new(layers, directions, light) })
    }

    fn correction(&self, k: f64) -> f64 {
        let straight = self.straight.as_ref().map_or(0.0, |straight| straight.correction(self.directions, k));
        straight + self.once.correction(k)
    }
}

/// Optical and geometrical thickness (mm) of a stack.
fn extent(layers: &[(Scattering, f64)]) -> (f64, f64) {
    let add =
        |(tau, sum): (f64, f64), (scattering, mm): &(Scattering, f64)| (tau + scattering.extinction * mm, sum + mm);
    layers.iter().fold((0.0, 0.0), add)
}

#[cfg(test)]
mod tests;
