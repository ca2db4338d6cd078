//! Composition of layers: Hašan et al. 2010, equations 3 and 4.

/// Spectra of a stack of slabs: reflection seen from above and from below, and transmission.
#[derive(Debug, Clone, PartialEq)]
pub struct Composite {
    /// R̂∪, light from above reflected upwards.
    pub reflection_top: Vec<f64>,
    /// R̂∩, light from below reflected downwards.
    pub reflection_bottom: Vec<f64>,
    /// T̂, the same both ways.
    pub transmission: Vec<f64>,
}
