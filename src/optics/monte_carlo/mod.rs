//! Multi-layer Monte Carlo: the referee that shares no equation with the Hankel models.
//!
//! Photons random-walk through plane layers as in Wang, Jacques and Zheng 1995 (MCML), with the phase function of
//! Henyey and Greenstein 1941. Where refractive indices differ, air's 1 included, Fresnel's reflectance decides by
//! chance between reflection and refraction. **In:** layers, an optional half-space below them, the light at the origin
//! of the top. **Out:** total reflection and transmission and their radial profiles, each with a standard error; what
//! the top surface reflects before any light has entered, the glint, is kept apart.
//!
//! *Guaranteed:* estimates without bias; the same bytes for the same seed whatever the number of threads, because
//! photons come in batches of fixed size, each with a random stream of its own, summed in their order. *Not covered:*
//! polarisation, time of flight; lateral inhomogeneity is [`voxels`]' task, which is index-matched.

pub(crate) mod photon;
mod rings;
mod tally;
mod walk;

use std::ops::Range;

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

use super::{OpticsError, RadialProfile, Stack, VolumeCoefficients};
use crate::parallel;
#[cfg(test)]
use crate::watch::Unwatched;
use crate::watch::{Stopped, Watch};
pub use rings::RingEdges;
use tally::Tally;
use walk::Media;

/// Photons per batch: some 10 ms of work, long against the cost of merging a tally, short against a user's patience.
const BATCH: u64 = 16_384;
/// Batches between two looks at the watch; bounds the memory of unmerged tallies too.
const GROUP: usize = 64;

/// The light entering the top at the origin, unit flux.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Light {
    /// Radiance the same from every direction of the hemisphere: the Lambertian point source of the paper's profiles.
    Diffuse,
    /// A pencil beam straight down.
    Normal,
}

/// A simulation to be run.
#[derive(Debug, Clone, PartialEq)]
pub struct MonteCarlo {
    /// From the lit top down, thicknesses finite and ≥ 0; layers of no thickness change nothing. Without a core, what
    /// leaves the last layer is transmitted.
    pub stack: Stack<VolumeCoefficients>,
    /// The source.
    pub light: Light,
    /// Number of photons, at least 2.
    pub photons: u64,
    /// Same seed, same result.
    pub seed: u64,
    /// Radii between which exits are counted together.
    pub rings: RingEdges,
}

/// A mean of photons with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The estimate.
    pub mean: f64,
    /// One standard deviation of it.
    pub standard_error: f64,
}

/// What [`MonteCarlo::run`] found. Profiles are ring means per mm² of unit flux.
#[derive(Debug, Clone, PartialEq)]
pub struct MonteCarloResult {
    /// Photons traced.
    pub photons: u64,
    /// Total reflection, the albedo under this light, without the glint.
    pub reflection: Estimate,
    /// What the top surface reflects at once, like a mirror; 0 where it is index-matched.
    pub glint: Estimate,
    /// Total transmission, scattered or not.
    pub transmission: Estimate,
    /// The part of the transmission that was never scattered.
    pub unscattered_transmission: Estimate,
    /// R(r).
    pub reflection_profile: RadialProfile,
    /// T(r), scattered or not.
    pub transmission_profile: RadialProfile,
    /// The part of T(r) that was never scattered.
    pub unscattered_profile: RadialProfile,
}

/// Hands `photons` to `trace` in batches, in parallel, each with a random stream of its own, and what came of them to
/// `take`, in their order: the same for any number of threads. `watch` hears of the photons about every million.
pub(crate) fn in_batches<T: Send>(
    photons: u64,
    seed: u64,
    watch: &dyn Watch,
    trace: impl Fn(Range<u64>, Xoshiro256PlusPlus) -> T + Sync,
    mut take: impl FnMut(T),
) -> Result<(), Stopped> {
    let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut traced = 0;
    while traced < photons {
        let (before, mut group) = (traced, Vec::with_capacity(GROUP));
        while group.len() < GROUP && traced < photons {
            let end = photons.min(traced + BATCH);
            group.push((traced..end, stream.clone()));
            stream.jump();
            traced = end;
        }
        let batches: Vec<T> = parallel::map_all(&group, |(batch, stream)| trace(batch.clone(), stream.clone()));
        batches.into_iter().for_each(&mut take);
        watch.advance(traced - before);
        watch.go_on()?;
    }
    Ok(())
}

impl MonteCarlo {
    /// Traces all photons.
    ///
    /// # Errors
    /// [`OpticsError::Parameter`] if a layer, the base or the number of photons is out of range.
    #[cfg(test)]
    pub fn run(&self) -> Result<MonteCarloResult, OpticsError> {
        self.run_with(&Unwatched)
    }

    /// Traces all photons; `watch` hears of them about every million.
    ///
    /// # Errors
    /// As [`MonteCarlo::run`]; [`OpticsError::Stopped`].
    pub fn run_with(&self, watch: &dyn Watch) -> Result<MonteCarloResult, OpticsError> {
        let media = self.checked_stack()?;
        let mut total = Tally::new(&self.rings);
        let trace = |photons: Range<u64>, mut rng: Xoshiro256PlusPlus| {
            let mut tally = Tally::new(&self.rings);
            for _ in photons {
                media.trace(self.light, &mut rng, &mut tally);
            }
            tally
        };
        in_batches(self.photons, self.seed, watch, trace, |tally| total.add(&tally))?;
        Ok(total.result(self.photons, &self.rings))
    }

    fn checked_stack(&self) -> Result<Media, OpticsError> {
        if self.photons < 2 {
            return Err(OpticsError::parameter("photons", self.photons, "at least 2".into()));
        }
        for layer in &self.stack.layers {
            layer.resin.check()?;
            if !(layer.thickness_mm >= 0.0 && layer.thickness_mm.is_finite()) {
                return Err(OpticsError::parameter(
                    "thickness",
                    layer.thickness_mm,
                    "finite millimetres, 0 or more".into(),
                ));
            }
        }
        if let Some(base) = &self.stack.core {
            base.check()?;
            // A conservative half-space returns every photon, after a walk of infinite mean length.
            if base.sigma_a <= 0.0 {
                return Err(OpticsError::parameter(
                    "absorption-per-mm of the half-space below",
                    base.sigma_a,
                    "more than 0".into(),
                ));
            }
        }
        Ok(Media::new(&self.stack))
    }
}
