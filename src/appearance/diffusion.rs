//! Normalised diffusion: Christensen and Burley, *Approximate Reflectance Profiles for Efficient Subsurface
//! Scattering*, Pixar Technical Memo 15-04, 2015; equation 2 for the profile, equation 6 for the diffuse-source fit of
//! s.
//!
//! With d = ℓ/s the profile and its Hankel transform are
//!
//! ```text
//!   R(r) = A (e^(−r/d) + e^(−r/3d)) / (8π d r)        s = 1.9 − A + 3.5 (A − 0.8)²
//!   R̂(k) = A/4 · [ 1/√(1 + k²d²) + 3/√(1 + 9k²d²) ]   R̂(0) = A
//! ```
//!
//! A is the albedo of the surface under diffuse light, ℓ the volume mean free path 1/σt of an isotropically scattering,
//! index-matched half-space. It is a fit of a few percent to Monte Carlo, and describes what is wanted, not what a
//! printer can do.

use std::f64::consts::PI;

use crate::optics::FrequencyGrid;

/// One material by albedo and mean free path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalizedDiffusion {
    albedo: f64,
    d_mm: f64,
}

/// Why a pair of numbers is not a material.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum DiffusionError {
    /// The albedo is not a share of light.
    #[error("albedo is {found}, expected 0 to 1")]
    Albedo {
        /// The albedo given.
        found: f64,
    },
    /// The mean free path is not a length.
    #[error("mean free path is {found} mm, expected a finite number, at least 0")]
    MeanFreePath {
        /// The mean free path given, mm.
        found: f64,
    },
}

impl crate::blame::Blamed for DiffusionError {}

impl NormalizedDiffusion {
    /// Albedo 0…1 and mean free path ℓ = 1/σt ≥ 0 in mm; ℓ = 0 is an opaque surface.
    ///
    /// # Errors
    /// A value outside its range.
    pub fn new(albedo: f64, mean_free_path_mm: f64) -> Result<Self, DiffusionError> {
        if !(0.0..=1.0).contains(&albedo) {
            return Err(DiffusionError::Albedo { found: albedo });
        }
        if !(mean_free_path_mm >= 0.0 && mean_free_path_mm.is_finite()) {
            return Err(DiffusionError::MeanFreePath { found: mean_free_path_mm });
        }
        let s = 1.9 - albedo + 3.5 * (albedo - 0.8) * (albedo - 0.8);
        Ok(Self { albedo, d_mm: mean_free_path_mm / s })
    }

    /// R(r) per mm² at `r_mm` > 0 from the point of entry; it grows as 1/r towards the centre.
    pub fn profile(&self, r_mm: f64) -> f64 {
        if self.d_mm == 0.0 {
            return 0.0;
        }
        let x = r_mm / self.d_mm;
        self.albedo * (libm::exp(-x) + libm::exp(-x / 3.0)) / (8.0 * PI * self.d_mm * r_mm)
    }

    /// Share of the reflected light that leaves within `r_mm` of the point of entry, 0…1.
    pub fn energy_within(&self, r_mm: f64) -> f64 {
        if self.d_mm == 0.0 {
            return 1.0;
        }
        let x = r_mm / self.d_mm;
        1.0 - 0.25 * libm::exp(-x) - 0.75 * libm::exp(-x / 3.0)
    }

    /// R̂(k) at `k` rad/mm.
    pub fn hankel(&self, k: f64) -> f64 {
        let q = k * self.d_mm * k * self.d_mm;
        0.25 * self.albedo * (1.0 / (1.0 + q).sqrt() + 3.0 / (1.0 + 9.0 * q).sqrt())
    }

    /// R̂ over a grid.
    pub fn spectrum(&self, grid: &FrequencyGrid) -> Vec<f64> {
        grid.as_slice().iter().map(|&k| self.hankel(k)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2π ∫ R(r) J₀(kr) r dr by Simpson's rule; R·r is smooth, so the pole at 0 costs nothing.
    fn quadrature(material: &NormalizedDiffusion, k: f64) -> f64 {
        let end = 60.0 * material.d_mm * 3.0;
        let n = 40_000;
        let h = end / n as f64;
        let f = |r: f64| 2.0 * PI * material.profile(r.max(1e-12)) * r.max(1e-12) * libm::j0(k * r);
        let inner: f64 = (1..n).map(|i| f(i as f64 * h) * if i % 2 == 1 { 4.0 } else { 2.0 }).sum();
        (f(0.0) + inner + f(end)) * h / 3.0
    }

    #[test]
    fn closed_form_is_the_integral() {
        for (albedo, path) in [(0.1, 0.5), (0.5, 0.2), (0.6, 1.0), (0.95, 2.0)] {
            let material = NormalizedDiffusion::new(albedo, path).unwrap();
            for k in [0.0, 0.3, 1.0, 5.0, 20.0] {
                let (closed, integral) = (material.hankel(k), quadrature(&material, k));
                assert!((closed - integral).abs() < 1e-7, "A {albedo}, ℓ {path}, k {k}: {closed} against {integral}");
            }
        }
    }

    #[test]
    fn first_coefficient_is_the_albedo_and_the_rest_falls() {
        let spectrum = NormalizedDiffusion::new(0.6, 0.7).unwrap().spectrum(&FrequencyGrid::default());
        assert!((spectrum[0] - 0.6).abs() < 1e-15);
        assert!(spectrum.is_sorted_by(|a, b| a > b));
    }

    #[test]
    fn scale_is_a_similarity() {
        let (one, two) = (NormalizedDiffusion::new(0.5, 1.0).unwrap(), NormalizedDiffusion::new(0.5, 2.0).unwrap());
        assert!((one.hankel(3.0) - two.hankel(1.5)).abs() < 1e-15);
        assert!((one.profile(0.4) - 4.0 * two.profile(0.8)).abs() < 1e-12);
    }

    #[test]
    fn energy_within_integrates_the_profile() {
        let material = NormalizedDiffusion::new(0.8, 0.6).unwrap();
        let n = 20_000;
        let h = 1.0 / n as f64;
        let rings: f64 = (0..n).map(|i| (i as f64 + 0.5) * h).map(|r| 2.0 * PI * r * material.profile(r) * h).sum();
        assert!((rings / 0.8 - material.energy_within(1.0)).abs() < 1e-6);
    }

    #[test]
    fn opaque_surface_reflects_all_frequencies_alike() {
        let opaque = NormalizedDiffusion::new(0.4, 0.0).unwrap();
        assert_eq!((opaque.hankel(0.0), opaque.hankel(20.0)), (0.4, 0.4));
        assert_eq!((opaque.profile(0.1), opaque.energy_within(0.0)), (0.0, 1.0));
    }

    #[test]
    fn numbers_out_of_range_are_refused() {
        assert!(matches!(NormalizedDiffusion::new(1.01, 1.0), Err(DiffusionError::Albedo { .. })));
        assert!(matches!(NormalizedDiffusion::new(f64::NAN, 1.0), Err(DiffusionError::Albedo { .. })));
        assert!(matches!(NormalizedDiffusion::new(0.5, -1.0), Err(DiffusionError::MeanFreePath { .. })));
        assert!(matches!(NormalizedDiffusion::new(0.5, f64::INFINITY), Err(DiffusionError::MeanFreePath { .. })));
    }
}
