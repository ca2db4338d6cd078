//! Light in resins: profiles, their Hankel transforms, and how slabs of resin stack.
//!
//! **In:** resins as volume coefficients or measured profiles. **Out:** for every resin and channel the
//! [`KubelkaMunk`] parameters over a [`FrequencyGrid`], from which any slab and any stacking follows.

mod composite;
mod frequency;
mod kubelka_munk;

pub use composite::Composite;
pub use frequency::FrequencyGrid;
pub use kubelka_munk::{KubelkaMunk, KubelkaMunkError, SlabSpectrum};
