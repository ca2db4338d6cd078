//! Light in resins: profiles, their Hankel transforms, and how slabs of resin stack.
//!
//! **In:** resins as volume coefficients or measured profiles. **Out:** for every resin and channel the
//! [`KubelkaMunk`] parameters over a [`FrequencyGrid`], from which any slab and any stacking follows.
//!
//! ```text
//!   VolumeCoefficients ──► MonteCarlo ──► RadialProfile ◄── ProfileFile (CSV, measured)
//!                                             │ hankel
//!                                        ProfileSpectrum ──► repair_transmission
//!                                             │
//!                                        SlabSpectrum ──► KubelkaMunk ──► Composite ──► InverseHankel
//!   VolumeCoefficients ──► Transport ──────────────────────────────────────────────────►─┘
//! ```

mod coefficient_fit;
mod composite;
mod edge;
mod error;
mod frequency;
mod fresnel;
mod hankel;
mod ids;
mod inverse;
mod kubelka_munk;
mod materials;
pub(crate) mod monte_carlo;
mod prediction;
mod profile;
mod profile_csv;
mod quadrature;
mod repair;
mod stack;
mod tail;
mod transport;
mod volume;

pub use coefficient_fit::{CoefficientFit, FitRefusal, MAX_FIT_RESIDUAL, MeasuredSlab, fit_coefficients};
pub use composite::Composite;
pub use edge::EdgeResponse;
pub use error::OpticsError;
pub use frequency::FrequencyGrid;
pub use hankel::ProfileSpectrum;
pub use ids::{ChannelId, ResinId};
pub use inverse::InverseHankel;
pub use kubelka_munk::{KubelkaMunk, KubelkaMunkError, SlabSpectrum};
pub(crate) use materials::resin_table;
pub use materials::{
    BUILTIN_PHOTONS, DEFAULT_PHOTONS, DEFAULT_SEED, MEASURED_EXCESS, MaterialFile, MaterialSet, Resin, ResinChannel,
    ResinSpectrum, SimulatedProfile, SlabPlan, SpectrumError, regenerate_builtin, simulate_profile,
};
pub use monte_carlo::{Estimate, Light, MonteCarlo, MonteCarloResult, RingEdges};
pub use prediction::{ChannelPrediction, PhotonOptions, PredictedRing, Prediction};
pub use profile::{MAX_CENTRE_SHARE, MAX_RADIUS_MM, MIN_SAMPLES, NEGATIVE_TOLERANCE, ProfileError, RadialProfile};
pub use profile_csv::ProfileFile;
pub use repair::{LostInNoise, TransmissionRepair, repair_transmission};
pub use stack::{Layer, Stack};
pub use tail::Tail;
pub use transport::{ModalReflection, ReflectionSlope, Transport, TransportOptions, TransportSpectra};
pub use volume::{MAX_COEFFICIENT_PER_MM, MAX_REFRACTIVE_INDEX, VolumeCoefficients};

#[cfg(test)]
mod tests;
