//! Heterogeneous materials: from a measured BSSRDF to a local profile per texel, and clusters of them.
//!
//! **In:** a [`Dataset`], response windows around every texel of a flat patch. **Out:** [`Factors`], a profile P(x, r)
//! per texel with R(xᵢ, xₒ) ≈ √(P(xᵢ, r) P(xₒ, r)) (Hašan et al. 2010, section 7.1).
//!
//! ```text
//!   dataset.toml + .npy ──► Dataset ──► survey ──► global profile g(r)
//!                             │ bands of rows        │
//!                             └──► gradient ◄── model √(P/g) ◄── conjugate gradients
//! ```

mod belief;
mod dataset;
mod error;
mod exr_rows;
mod factor;
mod groups;
mod header;
mod images;
mod kernel;
mod misses;
mod npy;
mod npz;
mod operator;
mod passes;
mod planes;
mod reciprocity;
mod responses;
mod rings;
mod shape;
mod survey;
mod tail;

pub use dataset::{Dataset, MAX_SIDE, MAX_WINDOW, Noise, PITCH_MM};
pub use error::BssrdfError;
pub use factor::{FactorOptions, Factors, Freedom, Round, factor};
pub use groups::{ClusterCount, Metric};
pub use kernel::Variance;
pub use misses::{Dark, Gate, Misses, Sums};
pub use npy::{NpyHeader, write_npy};
pub use planes::Planes;
pub use reciprocity::{Breach, Reciprocity};
pub use responses::{Channel, Responses};
pub use rings::{Offset, Rings, areas};
pub use tail::{TailKind, TailRings};

#[cfg(test)]
mod tests;
