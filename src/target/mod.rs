//! What every surface point should reflect, and the layers that do it.
//!
//! **In:** profiles or textures, and the stackings the search found for them. **Out:** a [`LayerField`]: the material at any
//! surface point and depth.

mod charts;
mod layers;
mod slots;
mod textured;

pub use layers::{BrickQuery, LayerField, LayerStack};
pub use slots::SlotTable;
pub use textured::{LabelMap, TexturedLayers};
