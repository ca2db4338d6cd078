//! Light in a stack by the transport equation, at every spatial frequency on its own.
//!
//! What Kubelka–Munk lacks is direction. Here light has as many as the accuracy needs, its lateral course e^{ikx}
//! couples them, and a slab's reflection and transmission are matrices over them; equations 3 and 4 of Hašan et al.
//! 2010 compose those as they compose scalars. Resins have the phase function of Henyey and Greenstein; where
//! refractive indices differ, air's 1 included, boundaries reflect after Fresnel and bend light after Snell.
//!
//! ```text
//!   VolumeCoefficients ──► Scattering ──► Generator(k) ──► Modes, Interface ──► from the base up ──► R̂(k), T̂(k)
//!                                              └──► Slab (doubling): k = 0, and the test of the modes
//! ```
//!
//! Every frequency is computed on its own, so that the threads' number changes nothing.

mod beam;
mod directions;
mod doubled;
mod interface;
mod mixed;
mod modal;
mod modes;
mod once;
mod rays;
mod scattering;
mod slab;

use faer::{Col, Row};

use self::{
    beam::Straight,
    directions::{AIR, Directions},
    doubled::Doubled,
    interface::glint,
    modal::{Frequency, Setting},
    once::Once,
    scattering::Scattering,
};
pub use self::{
    mixed::{Base, LayeredReflection, Mixed},
    modal::ModalReflection,
};
use super::{FrequencyGrid, Light, Stack, VolumeCoefficients};
use crate::parallel;

/// Directions of the model: polar angles of a hemisphere and azimuthal orders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TransportOptions {
    /// Polar angles per hemisphere, 2 to 32.
    pub polar: usize,
    /// Azimuthal orders, 1 to 32. One will do where only totals matter.
    pub orders: usize,
}

impl TransportOptions {
    /// 6 × 5: R̂ within 2.5e-4 rms of Monte Carlo from 0 to 20 rad/mm, 1e-3 for stacks of layers below 0.1 mm
    /// (docs/accuracy.md), at a third of the default's cost.
    pub const REFLECTION: Self = Self { polar: 6, orders: 5 };

    /// As many directions as R̂ needs to be within about `accuracy` rms from 0 to 20 rad/mm, 1e-3 to 1e-4; below that
    /// more, which no reference has judged. What takes most is light that turns once in a thin layer on another resin.
    /// A pencil beam gets four polar angles more.
    pub fn for_accuracy(accuracy: f64, light: Light) -> Self {
        let (polar, orders) = match accuracy {
            _ if accuracy >= 1e-3 => (6, 5),
            _ if accuracy >= 3e-4 => (10, 6),
            _ if accuracy >= 1e-4 => (14, 8),
            _ => (20, 10),
        };
        Self { polar: if light == Light::Normal { polar + 4 } else { polar }, orders }
    }
}

impl Default for TransportOptions {
    /// 10 × 6: R̂ of any stack of docs/accuracy.md within 3e-4 rms of Monte Carlo from 0 to 20 rad/mm, T̂ of thin
    /// layers within 2e-3.
    fn default() -> Self {
        Self { polar: 10, orders: 6 }
    }
}

/// The transport model of a stack in one channel.
#[derive(Debug, Clone, Copy)]
pub struct Transport<'a> {
    /// The stack; thicknesses are finite and ≥ 0.
    pub stack: &'a Stack<VolumeCoefficients>,
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

impl Transport<'_> {
    /// R̂, without the glint, and T̂ over `grid`.
    pub fn spectra(&self, grid: &FrequencyGrid) -> TransportSpectra {
        let (merged, core) = (self.merged(), self.stack.core);
        let mut resins: Vec<VolumeCoefficients> = Vec::new();
        for volume in merged.iter().map(|(volume, _)| *volume).chain(core) {
            if !resins.contains(&volume) {
                resins.push(volume);
            }
        }
        let place = |volume: &VolumeCoefficients| resins.iter().position(|known| known == volume);
        let layers: Vec<(usize, f64)> =
            merged.iter().filter_map(|(volume, mm)| place(volume).map(|resin| (resin, *mm))).collect();
        let base = core.as_ref().and_then(place);
        let setting = Setting::new(&resins, base, self.light, self.options);
        let doubled = Doubled::new(self, &merged);
        let few_turns = match base {
            None => FewTurns::new(&doubled.layers, &doubled.directions, self.light, grid.as_slice()),
            Some(_) => None,
        };
        let at = |&k: &f64| {
            // Without absorption there are no modes at k = 0, and there the energy has to be right.
            let (reflection, transmission) =
                if k > 0.0 { Frequency::new(&setting, k).spectra(&layers) } else { doubled.spectra(k) };
            (reflection, transmission + few_turns.as_ref().map_or(0.0, |light| light.correction(k)))
        };
        let (reflection, transmission) = parallel::map_all(grid.as_slice(), at).into_iter().unzip();
        TransportSpectra { reflection, transmission }
    }

    /// Share of the light that the top surface reflects like a mirror before any has entered; the same at every
    /// frequency.
    pub fn glint(&self) -> f64 {
        let layers = self.stack.pairs().filter(|(_, mm)| *mm > 0.0);
        let indices = layers.map(|(volume, _)| volume).chain(&self.stack.core);
        let indices: Vec<f64> = indices.map(|volume| volume.refractive_index).collect();
        let Some(&first) = indices.first() else { return 0.0 };
        let directions = Directions::new(indices, self.options);
        let source = source(self.light, &directions);
        glint(&directions, first, source.iter().copied())
    }

    /// The layers that are there, neighbours of one resin as one: what is taken by quadrature over a layer must not
    /// depend on how it was written.
    fn merged(&self) -> Vec<(VolumeCoefficients, f64)> {
        let mut merged: Vec<(VolumeCoefficients, f64)> = Vec::new();
        for (&volume, mm) in self.stack.pairs().filter(|(_, mm)| *mm > 0.0) {
            match merged.last_mut() {
                Some((above, sum)) if *above == volume => *sum += mm,
                _ => merged.push((volume, mm)),
            }
        }
        merged
    }
}

/// Flux in every unknown of a unit of light, in air.
fn source(light: Light, directions: &Directions) -> Col<f64> {
    match light {
        Light::Diffuse => {
            let flux: Vec<f64> = directions.diffuse().collect();
            Col::from_fn(flux.len(), |i| flux[i])
        }
        Light::Normal => Col::from_fn(directions.len(), |i| if i == directions.beam() { 1.0 } else { 0.0 }),
    }
}

/// Sums flux over directions: the unknowns of order 0.
fn flux(directions: &Directions) -> Row<f64> {
    let order: Vec<usize> = directions.unknowns(AIR).map(|u| u.order).collect();
    Row::from_fn(order.len(), |i| if order[i] == 0 { 1.0 } else { 0.0 })
}

/// What comes through a thin stack with one turn at most, better than the directions see it.
struct FewTurns<'a> {
    /// Diffuse light without a turn; the directions have a vertical beam of their own.
    straight: Option<Straight<'a>>,
    once: Once<'a>,
}

impl<'a> FewTurns<'a> {
    /// Where less comes through unscattered, T̂ is right to 1e-3 without (docs/accuracy.md).
    const LEAST: f64 = 1e-3;

    fn new(layers: &'a [(Scattering, f64)], directions: &Directions, light: Light, k: &[f64]) -> Option<Self> {
        let tau: f64 = layers.iter().map(|(resin, mm)| resin.extinction * mm).sum();
        // What comes through under any angle is less than what comes straight down.
        if layers.is_empty() || libm::exp(-tau) < Self::LEAST {
            return None;
        }
        let straight = match light {
            Light::Diffuse => {
                let straight = Straight::new(layers, directions, k.last().copied().unwrap_or(0.0));
                Some(straight).filter(|straight| straight.through() >= Self::LEAST)
            }
            Light::Normal => None,
        };
        let needed = light == Light::Normal || straight.is_some();
        needed.then(|| Self { straight, once: Once::new(layers, directions, light, k) })
    }

    fn correction(&self, k: f64) -> f64 {
        self.straight.as_ref().map_or(0.0, |straight| straight.correction(k)) + self.once.correction(k)
    }
}

#[cfg(test)]
mod tests;
