//! The layers of an object as height fields over its texture.

use crate::appearance::HeightFields;

/// The layer maps of one object, one per page of its texture.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::job) struct LayerMaps {
    /// Depths over each page.
    pub pages: Vec<HeightFields>,
    /// Names of all resins.
    pub resins: Vec<String>,
    /// Distance of samples in mm, where the map lies flat over the object.
    pub pitch_mm: Option<[f64; 2]>,
}
