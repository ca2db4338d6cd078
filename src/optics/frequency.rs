//! The spatial frequencies at which profiles are compared.

use std::sync::Arc;

/// Spatial frequencies in rad/mm, ascending, starting at 0 so that the first coefficient is the albedo.
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyGrid(Arc<[f64]>);

impl FrequencyGrid {
    /// Number of samples of [`FrequencyGrid::default`].
    pub const DEFAULT_LEN: usize = 128;
    /// Highest frequency of [`FrequencyGrid::default`], rad/mm.
    pub const DEFAULT_MAX: f64 = 20.0;

    /// `len` ≥ 2 evenly spaced frequencies from 0 to `k_max` rad/mm, both included.
    pub fn linear(len: usize, k_max: f64) -> Self {
        let step = k_max / (len.max(2) - 1) as f64;
        Self((0..len.max(2)).map(|i| i as f64 * step).collect())
    }

    /// These frequencies in rad/mm, ascending from 0, at least one.
    pub(crate) fn of(k: Vec<f64>) -> Self {
        debug_assert!(k.first() == Some(&0.0) && k.windows(2).all(|pair| pair[0] < pair[1]), "{k:?}");
        Self(k.into())
    }

    /// Number of frequencies.
    #[allow(clippy::len_without_is_empty)] // never empty
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The frequencies, rad/mm.
    pub fn as_slice(&self) -> &[f64] {
        &self.0
    }
}

impl Default for FrequencyGrid {
    /// k_i = 20·i/127 rad/mm, i = 0…127.
    fn default() -> Self {
        Self::linear(Self::DEFAULT_LEN, Self::DEFAULT_MAX)
    }
}
