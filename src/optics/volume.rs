//! Volume coefficients of a resin and the derived lengths the room computes with.

use super::OpticsError;

/// How a resin scatters, absorbs and bends light in one channel, with the phase function of Henyey and Greenstein 1941.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeCoefficients {
    /// σs, scattering events per mm, ≥ 0.
    pub sigma_s: f64,
    /// σa, absorption per mm, ≥ 0.
    pub sigma_a: f64,
    /// g, the mean cosine of a scattering event, in (−1, 1); positive is forward.
    pub g: f64,
    /// Refractive index n, 1 to 3; 1, that of air, is index-matched as the paper assumes.
    pub refractive_index: f64,
}

/// Above this many events per mm the mean free path is under 10 nm: not a resin but a slip of units.
pub const MAX_COEFFICIENT_PER_MM: f64 = 1e5;

/// Diamond has 2.4; nothing that is printed comes near.
pub const MAX_REFRACTIVE_INDEX: f64 = 3.0;

/// How far a representative slab should reach into the diffuse decay: κ·h. At 4.5 a slab lets through about 1% of what
/// enters it, which both its R̂ (within 1e-4 of the half-space) and its T̂ (above the noise of 2e6 photons) can be read
/// from. The paper's slabs have κh = 4.4 (white, 3 mm), 6.0 (black, 0.75 mm) and 1.0 (support, 5.6 mm).
const REPRESENTATIVE_DECAY: f64 = 4.5;
/// Thickest representative slab, mm; the paper's thickest is 5.6.
const REPRESENTATIVE_MAX_MM: f64 = 6.0;
/// Thickest representative slab in reduced mean free paths: bounds the simulation's cost where hardly anything absorbs.
const REPRESENTATIVE_MAX_REDUCED: f64 = 20.0;

impl VolumeCoefficients {
    /// Checked coefficients of an index-matched resin; [`VolumeCoefficients::with_refractive_index`] gives it another
    /// index.
    ///
    /// # Errors
    /// [`OpticsError::Parameter`] naming the first value that is not finite, negative, absurdly large, or g outside
    /// (−1, 1).
    pub fn new(sigma_s: f64, sigma_a: f64, g: f64) -> Result<Self, OpticsError> {
        let it = Self { sigma_s, sigma_a, g, refractive_index: 1.0 };
        it.check().map(|()| it)
    }

    /// The same resin with another refractive index, 1 to 3.
    #[must_use]
    pub const fn with_refractive_index(self, refractive_index: f64) -> Self {
        Self { refractive_index, ..self }
    }

    /// The check behind [`VolumeCoefficients::new`], for values put together by hand.
    ///
    /// # Errors
    /// See [`VolumeCoefficients::new`].
    pub fn check(&self) -> Result<(), OpticsError> {
        let per_mm = |name, value: f64| {
            if (0.0..=MAX_COEFFICIENT_PER_MM).contains(&value) {
                Ok(())
            } else {
                Err(OpticsError::parameter(name, value, format!("0 to {MAX_COEFFICIENT_PER_MM:e} per mm")))
            }
        };
        per_mm("scattering-per-mm", self.sigma_s)?;
        per_mm("absorption-per-mm", self.sigma_a)?;
        if !(self.g > -1.0 && self.g < 1.0) {
            return Err(OpticsError::parameter("g", self.g, "a mean cosine between -1 and 1, both excluded".into()));
        }
        if (1.0..=MAX_REFRACTIVE_INDEX).contains(&self.refractive_index) {
            Ok(())
        } else {
            let expected = format!("1 to {MAX_REFRACTIVE_INDEX}");
            Err(OpticsError::parameter("refractive-index", self.refractive_index, expected))
        }
    }

    /// σt = σs + σa, per mm.
    pub fn sigma_t(&self) -> f64 {
        self.sigma_s + self.sigma_a
    }

    /// Single-scattering albedo σs/σt in [0, 1]; 0 in a void.
    pub fn albedo(&self) -> f64 {
        if self.sigma_t() > 0.0 { self.sigma_s / self.sigma_t() } else { 0.0 }
    }

    /// σt′ = σs(1 − g) + σa, per mm: extinction with the forward part of scattering left out.
    pub fn reduced_extinction(&self) -> f64 {
        self.sigma_s * (1.0 - self.g) + self.sigma_a
    }

    /// κ = √(3 σa σt′), per mm: how fast diffuse light dies out with depth.
    pub fn diffuse_attenuation(&self) -> f64 {
        (3.0 * self.sigma_a * self.reduced_extinction()).sqrt()
    }

    /// Thickness in mm at which a slab of this resin should be simulated or measured so that both its profiles carry
    /// information: κh = 4.5, at most 20 reduced mean free paths, at most 6 mm.
    pub fn representative_thickness_mm(&self) -> f64 {
        let by_decay = REPRESENTATIVE_DECAY / self.diffuse_attenuation();
        let by_cost = REPRESENTATIVE_MAX_REDUCED / self.reduced_extinction();
        by_decay.min(by_cost).min(REPRESENTATIVE_MAX_MM) // division by 0 gives ∞, which min drops
    }
}
