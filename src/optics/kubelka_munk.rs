//! Continuous change of layer thickness: Hašan et al. 2010, section 5.3, after Kubelka and Munk 1931.
//!
//! The theory holds for each Hankel coefficient apart. In place of the paper's halving limit the parameters are read off in
//! closed form: α = (1 + R² − T²)/2R, β = √(α² − 1), γh = asinh(βR/T) and γ = Sβ.

/// Reflection and transmission coefficients of one homogeneous slab, one pair per spatial frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct SlabSpectrum {
    /// R̂(k); the first entry is the albedo.
    pub reflection: Vec<f64>,
    /// T̂(k).
    pub transmission: Vec<f64>,
}

/// Kubelka–Munk parameters of one resin in one channel, one per spatial frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct KubelkaMunk {
    /// α = 1 + K/S, at least 1.
    pub alpha: Vec<f64>,
    /// β = √(α² − 1).
    pub beta: Vec<f64>,
    /// γ = Sβ, per mm.
    pub gamma: Vec<f64>,
    /// S = lim R_h/h, per mm.
    pub scattering: Vec<f64>,
}
