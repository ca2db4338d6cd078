//! Profiles of a slab from volume coefficients, by Monte Carlo: what `lumislice material simulate` writes.

use std::path::Path;

use crate::optics::{
    Estimate, Light, MonteCarlo, MonteCarloResult, OpticsError, ProfileFile, RadialProfile, RingEdges, Stack,
    VolumeCoefficients,
};
use crate::watch::Watch;

/// Profiles of a simulated slab under a Lambertian point source.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedProfile {
    /// Of what resin.
    pub coefficients: VolumeCoefficients,
    /// Thickness of the slab, mm.
    pub thickness_mm: f64,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Profiles and totals.
    pub(in crate::optics) result: MonteCarloResult,
}

/// Simulates a slab, index-matched whatever the resin's refractive index: what Kubelka–Munk parameters are read from
/// must not have the slab's own surfaces in it. `watch` hears of the photons about every million.
///
/// # Errors
/// As [`MonteCarlo::run_with`].
pub fn simulate_profile(
    coefficients: VolumeCoefficients,
    thickness_mm: f64,
    photons: u64,
    seed: u64,
    watch: &dyn Watch,
) -> Result<SimulatedProfile, OpticsError> {
    let job = MonteCarlo {
        stack: Stack::new([(coefficients.with_refractive_index(1.0), thickness_mm)]),
        light: Light::Diffuse,
        photons,
        seed,
        rings: RingEdges::growing(),
    };
    Ok(SimulatedProfile { coefficients, thickness_mm, seed, result: job.run_with(watch)? })
}

impl SimulatedProfile {
    /// Share of the light that is reflected.
    pub fn reflection(&self) -> Estimate {
        self.result.reflection
    }

    /// Share of the light that comes through.
    pub fn transmission(&self) -> Estimate {
        self.result.transmission
    }

    /// The profiles as a file, without the outer rings no photon reached.
    pub fn profiles(&self) -> ProfileFile {
        let (reflection, transmission) = (&self.result.reflection_profile, &self.result.transmission_profile);
        let lit = |profile: &RadialProfile| profile.value_per_mm2().iter().rposition(|value| *value > 0.0);
        let rings = lit(reflection).max(lit(transmission)).map_or(0, |last| last + 1).max(super::super::MIN_SAMPLES);
        ProfileFile { reflection: Some(reflection.truncated(rings)), transmission: Some(transmission.truncated(rings)) }
    }

    /// What the file's comment says: the slab, the totals, and that nothing was measured.
    pub fn comment(&self) -> String {
        let VolumeCoefficients { sigma_s, sigma_a, g, .. } = self.coefficients;
        let (r, t) = (self.result.reflection, self.result.transmission);
        format!(
            "simulated, not measured: slab of {} mm, sigma_s {sigma_s}, sigma_a {sigma_a} per mm, g {g} \
             (Henyey-Greenstein), index-matched\n\
             diffuse point source, {} photons, seed {}; values are means over rings\n\
             reflection {:.6} +- {:.6}, transmission {:.6} +- {:.6}",
            self.thickness_mm, self.result.photons, self.seed, r.mean, r.standard_error, t.mean, t.standard_error,
        )
    }

    /// Writes the profiles as CSV.
    ///
    /// # Errors
    /// [`OpticsError::File`] if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), OpticsError> {
        self.profiles().write(path, &self.comment())
    }
}
