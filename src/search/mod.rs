//! The inverse problem: which stacking of resins reflects like the target (Hašan et al. 2010, section 6).

/// One homogeneous layer.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Layer {
    /// Index of the resin in its material set.
    pub resin: usize,
    /// Thickness in mm, above 0.
    pub thickness_mm: f64,
}

/// Layers from the observer down; adjacent layers differ in resin.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Stacking {
    /// Top layer first.
    pub layers: Vec<Layer>,
}

/// What a resin is allowed to do in a stacking.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ResinLimit {
    /// No part of the resin lies above this depth, mm.
    pub min_depth_mm: f64,
    /// Every layer of it is at least this thick, mm.
    pub min_mm: f64,
    /// Every layer of it is at most this thick, mm.
    pub max_mm: f64,
}

impl ResinLimit {
    /// Everything is allowed.
    pub const NONE: Self = Self { min_depth_mm: 0.0, min_mm: 0.0, max_mm: f64::INFINITY };
}
