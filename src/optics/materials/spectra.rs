//! From a slab's two profiles to Kubelka–Munk parameters: Hašan et al. 2010, sections 5.2 and 5.3.

use crate::optics::{
    FrequencyGrid, Interface, KubelkaMunk, KubelkaMunkError, LostInNoise, RadialProfile, SlabSpectrum, Tail,
    TransmissionRepair, repair_transmission,
};

/// R̂ + T̂ may exceed 1 by this much in a measurement; the pair is then scaled to 1. Two separate albedo measurements
/// against a grey card are no better than a percent.
pub const MEASURED_EXCESS: f64 = 0.01;

/// What a slab's profiles say about its resin.
#[derive(Debug, Clone, PartialEq)]
pub struct ResinSpectrum {
    /// R̂(k), T̂(k) of the slab, made usable.
    pub slab: SlabSpectrum,
    /// The parameters they yield.
    pub kubelka_munk: KubelkaMunk,
    /// Light beyond the last sample of R(r).
    pub reflection_tail: Tail,
    /// Light beyond the last sample of T(r).
    pub transmission_tail: Tail,
    /// Where T̂ was continued out of the noise.
    pub repair: Option<TransmissionRepair>,
    /// Coefficients of R̂ below 0, set to 0 as the paper does.
    pub clipped: usize,
    /// By how much the worst R̂ + T̂ exceeded 1 before it was scaled; 0 if none did.
    pub excess: f64,
}

/// Why profiles are not usable as a resin's.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SpectrumError {
    /// T̂ is all noise.
    #[error("{0}")]
    Noise(#[from] LostInNoise),
    /// More light leaves than enters.
    #[error("reflection + transmission at {k:.2} rad/mm: found {found:.4}, expected at most 1")]
    Energy {
        /// Frequency.
        k: f64,
        /// R̂ + T̂ there.
        found: f64,
    },
    /// The parameters do not exist.
    #[error("{0}")]
    KubelkaMunk(#[from] KubelkaMunkError),
}

impl crate::blame::Blamed for SpectrumError {}

impl ResinSpectrum {
    /// Transforms the profiles of a slab `thickness_mm` thick, which has `surfaces` on both faces, and reads off the
    /// parameters of its resin.
    ///
    /// # Errors
    /// [`SpectrumError`]: T̂ is all noise, R̂ + T̂ > 1 + [`MEASURED_EXCESS`], or no parameters exist.
    pub fn from_profiles(
        reflection: &RadialProfile,
        transmission: &RadialProfile,
        thickness_mm: f64,
        surfaces: Interface,
        grid: &FrequencyGrid,
    ) -> Result<Self, SpectrumError> {
        let (r, t) = (reflection.hankel(grid), transmission.hankel(grid));
        let mut slab = SlabSpectrum { reflection: r.values, transmission: t.values };
        let repair = repair_transmission(&mut slab.transmission, t.standard_error.as_deref(), grid)?;
        let negative = slab.reflection.iter_mut().filter(|value| **value < 0.0);
        let clipped = negative.map(|value| *value = 0.0).count();
        let mut excess = 0.0_f64;
        for ((k, r), t) in grid.as_slice().iter().zip(&mut slab.reflection).zip(&mut slab.transmission) {
            let sum = *r + *t;
            if sum > 1.0 + MEASURED_EXCESS {
                return Err(SpectrumError::Energy { k: *k, found: sum });
            }
            if sum > 1.0 {
                excess = excess.max(sum - 1.0);
                (*r, *t) = (*r / sum, *t / sum);
            }
        }
        let kubelka_munk = KubelkaMunk::from_slab(&surfaces.taken_off(&slab), thickness_mm)?;
        Ok(Self { slab, kubelka_munk, reflection_tail: r.tail, transmission_tail: t.tail, repair, clipped, excess })
    }

    /// One line per thing that was done to the data, for the user.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        for (name, tail) in [("reflection", self.reflection_tail), ("transmission", self.transmission_tail)] {
            match tail {
                Tail::Negligible => {}
                Tail::Exponential { from_mm, share, .. } => remarks.push(format!(
                    "{name} continued as an exponential beyond {from_mm:.2} mm, {:.1}% of its energy",
                    100.0 * share
                )),
                Tail::Cut { from_mm } => {
                    remarks.push(format!("{name} ends at {from_mm:.2} mm with light still left, and is cut there"));
                }
            }
        }
        if let Some(repair) = self.repair {
            remarks.push(format!("transmission extrapolated out of the noise from {:.2} rad/mm on", repair.from_k));
        }
        if self.clipped > 0 {
            remarks.push(format!("{} negative reflection coefficients set to 0", self.clipped));
        }
        if self.excess > 1e-6 {
            remarks.push(format!("reflection + transmission exceeded 1 by {:.4} and was scaled", self.excess));
        }
        remarks
    }
}
