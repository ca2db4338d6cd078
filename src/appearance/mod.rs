//! What every surface point should reflect, and the layers that do it.
//!
//! **In:** profiles or textures, and the stackings the search found for them. **Out:** a [`LayerField`]: the material
//! at any surface point and depth.

mod align;
mod areas;
mod blends;
mod borders;
pub mod bssrdf;
mod charts;
mod clusters;
mod diffusion;
mod equation_7;
mod filling;
mod fractions;
mod heights;
mod layers;
mod limits;
mod lookups;
mod material;
mod measured;
mod metric;
mod nodes;
mod reduction;
mod slots;
mod surface_points;
mod texture;
mod textured;

pub use crate::numeric::similarity::{isotropic_path_factor, similarity};
pub use align::{AlignedStackings, MixedSlot, align, align_mixtures};
pub use charts::{Atlas, ChartMap, Place};
pub use clusters::{ClusterError, ClusterFit, ClusterId, ClusterOptions, Clusters, cluster};
pub use diffusion::{DiffusionError, NormalizedDiffusion};
pub use equation_7::{LocalProfiles, TexelRings};
pub(crate) use equation_7::{mirrored, spread};
pub use filling::{Blend, Filling};
pub use heights::HeightFields;
pub use layers::{BrickQuery, LayerField, LayerStack, SurfaceShare};
pub use limits::{SlotLimits, enforce_limits};
pub use material::{MaterialError, material_target, srgb_albedo};
pub use measured::MeasuredMedium;
pub(crate) use measured::diffuse_reflectance;
pub use nodes::{MAX_NODES, TexelSite};
pub use reduction::Reduction;
pub use slots::SlotTable;
pub use surface_points::{PointOfSurface, SurfacePoints};
pub use texture::{Appearance, AppearancePage, Appearances, distinct_appearances};
pub use textured::{LabelMap, TexturedLayers};
