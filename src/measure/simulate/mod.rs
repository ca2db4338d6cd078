//! A laboratory that does not exist: photographs of a resin whose profiles are known.
//!
//! What a camera would record is computed from profiles, spot, pixels and defects ([`scene`]), and exposed with photon
//! noise, read noise, dark current, rounding and clipping ([`sensor`]). The round trip through [`super::measure`] then
//! has a right answer. Nothing here shares code with the analysis but the file formats.

mod folder;
mod scene;
mod sensor;

pub use folder::{Laboratory, write_capture};
pub use scene::{Defects, Scene, Truth};
pub use sensor::SimulatedCamera;
#[cfg(test)]
pub(in crate::measure) use sensor::normal;
