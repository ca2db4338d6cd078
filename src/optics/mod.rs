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
pub(crate) mod fresnel;
mod grains;
mod hankel;
mod ids;
mod interface;
mod inverse;
mod kubelka_munk;
mod materials;
mod mixture;
pub(crate) mod monte_carlo;
mod predict;
mod prediction;
mod profile;
mod profile_csv;
mod quadrature;
mod repair;
mod stack;
mod tail;
mod transport;
mod volume;

pub use coefficient_fit::{CoefficientFit, FitRefusal};
pub use edge::EdgeResponse;
pub use error::OpticsError;
pub use frequency::FrequencyGrid;
pub use grains::Grains;
pub use hankel::ProfileSpectrum;
pub use ids::{ChannelId, ResinId};
pub use interface::Interface;
pub use kubelka_munk::{KubelkaMunk, KubelkaMunkError, SlabSpectrum};
pub use materials::{
    BUILTIN_PHOTONS, MaterialFile, MaterialSet, Resin, ResinChannel, SimulatedProfile, SlabPlan, SpectrumError,
    regenerate_builtin,
};
pub use mixture::Mixture;
pub(crate) use mixture::SHARES;
pub use monte_carlo::{Estimate, Light};
pub use predict::{Model, predict};
pub use prediction::{ChannelPrediction, PredictedRing, Prediction};
pub use profile::{ProfileError, RadialProfile};
pub use profile_csv::ProfileFile;
pub use repair::LostInNoise;
pub use stack::{Layer, Stack, StackError};
pub use tail::Tail;
pub use transport::TransportOptions;
pub use volume::VolumeCoefficients;

// Within the crate.
#[cfg(any(test, feature = "measure"))]
pub(crate) use materials::ResinSpectrum;
#[cfg(test)]
pub(crate) use stack::LAYER;
#[cfg(feature = "measure")]
pub(crate) use {coefficient_fit::fit_shapes, materials::resin_table};
pub(crate) use {
    coefficient_fit::{MeasuredSlab, fit_coefficients},
    composite::Composite,
    inverse::InverseHankel,
    monte_carlo::{MonteCarlo, MonteCarloResult, RingEdges},
    profile::MIN_SAMPLES,
    repair::{TransmissionRepair, repair_transmission},
    transport::{Base, LayeredReflection, Mixed, ModalReflection, Transport},
    volume::{MAX_COEFFICIENT_PER_MM, MAX_REFRACTIVE_INDEX},
};

#[cfg(test)]
mod tests;
