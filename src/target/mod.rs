//! What every surface point should reflect, and the layers that do it.
//!
//! **In:** profiles or textures, and the stackings the search found for them. **Out:** a [`LayerField`]: the material at any
//! surface point and depth.

mod layers;

pub use layers::{BrickQuery, LayerField, LayerStack};
