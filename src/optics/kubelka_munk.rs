//! Continuous change of layer thickness: Hašan et al. 2010, section 5.3, after Kubelka and Munk 1931.
//!
//! The theory holds for each Hankel coefficient apart. In place of the paper's halving limit the parameters are read
//! off in closed form: α = (1 + R² − T²)/2R, β = √(α² − 1), γh = asinh(βR/T) and γ = Sβ. The halving limit is the test
//! of it.
//!
//! Assumes that R and T of a coefficient form a slab of a one-dimensional medium: 0 ≤ R, 0 < T, R + T ≤ 1. Where light
//! keeps its direction through a layer (thin layers, forward scattering) the theory is wrong by up to a third; the
//! transport model judges there. A measured T̂(k) that has sunk into noise must be extrapolated before it comes here.

/// Reflection and transmission coefficients of one homogeneous slab, one pair per spatial frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct SlabSpectrum {
    /// R̂(k); the first entry is the albedo.
    pub reflection: Vec<f64>,
    /// T̂(k).
    pub transmission: Vec<f64>,
}

/// Kubelka–Munk parameters of one resin in one channel, one per spatial frequency.
///
/// A coefficient that does not scatter at all (R = 0) has α = β = ∞, S = 0 and a finite γ; one that does not absorb has
/// α = 1 and β = γ = 0. Both are ordinary inputs to [`KubelkaMunk::slab`].
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

/// Why a slab's spectrum has no Kubelka–Munk parameters.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum KubelkaMunkError {
    /// The slab's thickness is not a length.
    #[error("slab thickness is {found} mm, expected a finite number above 0")]
    Thickness {
        /// The thickness given, mm.
        found: f64,
    },
    /// Reflection and transmission differ in length.
    #[error(
        "slab has {reflection} reflection and {transmission} transmission coefficients, expected as many of each, at \
         least 1"
    )]
    Length {
        /// Number of reflection coefficients.
        reflection: usize,
        /// Number of transmission coefficients.
        transmission: usize,
    },
    /// A reflection coefficient below 0, above 1 or not a number.
    #[error("reflection coefficient {index} is {found}, expected 0 to 1")]
    Reflection {
        /// Index into the frequency grid.
        index: usize,
        /// The coefficient.
        found: f64,
    },
    /// A transmission coefficient that is not positive: the slab lets through nothing to extrapolate from.
    #[error(
        "transmission coefficient {index} is {found}, expected above 1e-300 and at most 1; extrapolate it or use a \
         thinner slab"
    )]
    Transmission {
        /// Index into the frequency grid.
        index: usize,
        /// The coefficient.
        found: f64,
    },
    /// More light leaves the slab than enters it.
    #[error("coefficient {index}: reflection {reflection} + transmission {transmission} exceed 1")]
    Energy {
        /// Index into the frequency grid.
        index: usize,
        /// R̂ at that index.
        reflection: f64,
        /// T̂ at that index.
        transmission: f64,
    },
}

impl crate::blame::Blamed for KubelkaMunkError {}

/// R + T may exceed 1 by this much before it is an error: rounding of a non-absorbing slab, not a measurement's fault.
const ENERGY_SLACK: f64 = 1e-9;
/// Below this βR/T overflows.
const LEAST_TRANSMISSION: f64 = 1e-300;

impl KubelkaMunk {
    /// The parameters of the resin that `slab`, `thickness_mm` thick, is made of.
    ///
    /// # Errors
    /// The first coefficient that is not 0 ≤ R, 0 < T, R + T ≤ 1; a thickness that is not a finite number above 0.
    pub fn from_slab(slab: &SlabSpectrum, thickness_mm: f64) -> Result<Self, KubelkaMunkError> {
        let len = slab.reflection.len();
        if len == 0 || len != slab.transmission.len() {
            return Err(KubelkaMunkError::Length { reflection: len, transmission: slab.transmission.len() });
        }
        if !(thickness_mm > 0.0 && thickness_mm.is_finite()) {
            return Err(KubelkaMunkError::Thickness { found: thickness_mm });
        }
        let empty = || Vec::with_capacity(len);
        let mut parameters = Self { alpha: empty(), beta: empty(), gamma: empty(), scattering: empty() };
        for (index, (&r, &t)) in slab.reflection.iter().zip(&slab.transmission).enumerate() {
            if !(0.0..=1.0).contains(&r) {
                return Err(KubelkaMunkError::Reflection { index, found: r });
            }
            if !(LEAST_TRANSMISSION..=1.0 + ENERGY_SLACK).contains(&t) {
                return Err(KubelkaMunkError::Transmission { index, found: t });
            }
            if r + t > 1.0 + ENERGY_SLACK {
                return Err(KubelkaMunkError::Energy { index, reflection: r, transmission: t });
            }
            // (α − 1)R and (α + 1)R, free of cancellation and of division by R.
            let alpha_minus_1_r = 0.5 * (1.0 - r - t).max(0.0) * (1.0 - r + t);
            let alpha_plus_1_r = 0.5 * (1.0 + r - t).max(0.0) * (1.0 + r + t);
            let beta_r = (alpha_minus_1_r * alpha_plus_1_r).sqrt();
            let x = beta_r / t;
            let gamma_h = libm::asinh(x);
            let scattering_h = if x > 0.0 { r / t * (gamma_h / x) } else { r / t };
            let scatters = r > 0.0;
            parameters.alpha.push(if scatters { 1.0 + alpha_minus_1_r / r } else { f64::INFINITY });
            parameters.beta.push(if scatters { beta_r / r } else { f64::INFINITY });
            parameters.gamma.push(gamma_h / thickness_mm);
            parameters.scattering.push(scattering_h / thickness_mm);
        }
        Ok(parameters)
    }

    /// A slab `thickness_mm` ≥ 0 thick, infinity included.
    pub fn slab(&self, thickness_mm: f64) -> SlabSpectrum {
        let (reflection, transmission) = (0..self.len()).map(|i| self.slab_coefficient(i, thickness_mm)).unzip();
        SlabSpectrum { reflection, transmission }
    }

    /// (R̂, T̂) of the slab at coefficient `i` alone.
    ///
    /// With u = sinh(γh)/γ the paper's equations read T = 1/((K+S)u + cosh γh), R = S·u·T; both are scaled by e^(−γh),
    /// so that no thickness overflows, and u has the limit h where nothing absorbs.
    pub(crate) fn slab_coefficient(&self, i: usize, thickness_mm: f64) -> (f64, f64) {
        let h = thickness_mm;
        let (gamma, s) = (self.gamma[i], self.scattering[i]);
        if gamma == 0.0 {
            // Non-absorbing: R = Sh/(1 + Sh). A clear resin (S = 0) stays clear at any thickness.
            let sh = if s == 0.0 { 0.0 } else { s * h };
            return if sh.is_finite() { (sh / (1.0 + sh), 1.0 / (1.0 + sh)) } else { (1.0, 0.0) };
        }
        let gamma_h = gamma * h;
        let u = -libm::expm1(-2.0 * gamma_h) / (2.0 * gamma);
        let cosh = 0.5 * (1.0 + libm::exp(-2.0 * gamma_h));
        let denominator = self.k_plus_s(i) * u + cosh;
        (s * u / denominator, libm::exp(-gamma_h) / denominator)
    }

    /// K + S = αS of coefficient `i`, per mm; finite also where S is 0.
    pub(crate) fn k_plus_s(&self, i: usize) -> f64 {
        if self.alpha[i].is_finite() { self.alpha[i] * self.scattering[i] } else { self.gamma[i] }
    }

    /// R̂ of an infinitely thick slab: α − β, as 1/(α + β), which does not cancel.
    pub fn half_space(&self) -> Vec<f64> {
        self.alpha.iter().zip(&self.beta).map(|(alpha, beta)| 1.0 / (alpha + beta)).collect()
    }

    /// What `parts`, at least one, all of one length, are together by their shares of the volume: K and S add. One
    /// part alone keeps its bits.
    pub fn mixed<'a>(parts: impl IntoIterator<Item = (&'a Self, f64)>) -> Self {
        let parts: Vec<_> = parts.into_iter().collect();
        if let [(only, _)] = parts[..] {
            return only.clone();
        }
        let len = parts.iter().map(|(part, _)| part.len()).min().unwrap_or_default();
        let sum = |of: &dyn Fn(&Self, usize) -> f64| -> Vec<f64> {
            (0..len).map(|i| parts.iter().map(|(part, share)| share * of(part, i)).sum()).collect()
        };
        let scattering = sum(&|part, i| part.scattering[i]);
        // K as K + S less S would cancel: K = γ²/(K + 2S).
        let absorption = sum(&|part, i| {
            let k_plus_2s = part.k_plus_s(i) + part.scattering[i];
            if k_plus_2s > 0.0 { part.gamma[i].powi(2) / k_plus_2s } else { 0.0 }
        });
        let each = |of: &dyn Fn(f64, f64) -> f64| {
            absorption.iter().zip(&scattering).map(|(&k, &s)| of(k, s)).collect::<Vec<f64>>()
        };
        let beta = |k: f64, s: f64| if s > 0.0 { (k * (k + 2.0 * s)).sqrt() / s } else { f64::INFINITY };
        Self {
            alpha: each(&|k, s| if s > 0.0 { 1.0 + k / s } else { f64::INFINITY }),
            beta: each(&beta),
            gamma: each(&|k, s| (k * (k + 2.0 * s)).sqrt()),
            scattering,
        }
    }

    /// Number of coefficients.
    #[allow(clippy::len_without_is_empty)] // never empty
    pub fn len(&self) -> usize {
        self.alpha.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::Composite;
    use proptest::prelude::*;

    /// Two resins in the thinnest layers are a mixture of both.
    #[test]
    fn a_mixture_is_the_limit_of_thin_layers() {
        let of = |r: f64, t: f64| KubelkaMunk::from_slab(&single(r, t), 1.0).unwrap();
        let (a, b) = (of(0.6, 0.2), of(0.05, 0.3));
        let mixed = KubelkaMunk::mixed([(&a, 0.7), (&b, 0.3)]).slab(2.0);
        let steps = 20_000;
        let [thin_a, thin_b] = [(&a, 0.7), (&b, 0.3)]
            .map(|(resin, share)| Composite::from_slab(&resin.slab(2.0 * share / f64::from(steps))));
        let pair = thin_a.over(&thin_b);
        let fine = (0..steps).fold(Composite::identity(1), |top, _| top.over(&pair));
        // Whichever resin lies on top makes up for the other one.
        let reflection = 0.5 * (fine.reflection_top[0] + fine.reflection_bottom[0]);
        assert!((mixed.reflection[0] - reflection).abs() < 1e-7, "{mixed:?} against {fine:?}");
        assert!((mixed.transmission[0] - fine.transmission[0]).abs() < 1e-7, "{mixed:?} against {fine:?}");
        assert_eq!(KubelkaMunk::mixed([(&a, 1.0)]), a);
        let clear = KubelkaMunk::mixed([(&of(0.0, 0.9), 0.5), (&of(0.0, 0.5), 0.5)]).slab(1.0);
        assert!((clear.transmission[0] - 0.45_f64.sqrt()).abs() < 1e-12 && clear.reflection[0] == 0.0);
    }

    /// The paper's limit: halve the slab, read S and K off the thin one.
    fn halving(mut r: f64, mut t: f64, mut h: f64, steps: usize) -> (f64, f64) {
        for _ in 0..steps {
            r /= t + 1.0;
            t = (t * (1.0 - r * r)).sqrt();
            h /= 2.0;
        }
        (r / h, (1.0 - r - t) / h)
    }

    fn single(r: f64, t: f64) -> SlabSpectrum {
        SlabSpectrum { reflection: vec![r], transmission: vec![t] }
    }

    /// A slab that exists: R and T of random α and γh.
    fn physical() -> impl Strategy<Value = (f64, f64)> {
        (0.001..0.95f64, 0.01..1.0f64).prop_map(|(r, share)| (r, (1.0 - r) * share))
    }

    proptest! {
        #[test]
        fn halving_limit_is_the_closed_form((r, t) in physical(), h in 0.05..6.0f64) {
            let km = KubelkaMunk::from_slab(&single(r, t), h).unwrap();
            // 26 steps: at 30 the paper's K has lost half its digits, at 40 all of them.
            let (s, k) = halving(r, t, h, 26);
            let scale = s + k;
            prop_assert!((km.scattering[0] - s).abs() < 3e-6 * scale, "S {} against {s}", km.scattering[0]);
            let k_closed = (km.alpha[0] - 1.0) * km.scattering[0];
            prop_assert!((k_closed - k).abs() < 3e-6 * scale, "K {k_closed} against {k}");
        }

        #[test]
        fn slab_returns_what_it_was_made_from((r, t) in physical(), h in 0.05..6.0f64) {
            let again = KubelkaMunk::from_slab(&single(r, t), h).unwrap().slab(h);
            prop_assert!((again.reflection[0] - r).abs() < 1e-11);
            prop_assert!((again.transmission[0] - t).abs() < 1e-11);
        }

        #[test]
        fn splitting_a_layer_changes_nothing((r, t) in physical(), h in 0.01..10.0f64, cut in 0.0..1.0f64) {
            let km = KubelkaMunk::from_slab(&single(r, t), 1.0).unwrap();
            let whole = Composite::from_slab(&km.slab(h));
            let parts = Composite::from_slab(&km.slab(h * cut)).over(&Composite::from_slab(&km.slab(h * (1.0 - cut))));
            prop_assert!((whole.reflection_top[0] - parts.reflection_top[0]).abs() < 1e-12);
            prop_assert!((whole.reflection_bottom[0] - parts.reflection_bottom[0]).abs() < 1e-12);
            prop_assert!((whole.transmission[0] - parts.transmission[0]).abs() < 1e-12);
        }

        #[test]
        fn energy_is_not_created((r, t) in physical(), h in 0.0..1e4f64) {
            let slab = KubelkaMunk::from_slab(&single(r, t), 1.0).unwrap().slab(h);
            prop_assert!(slab.reflection[0] >= 0.0 && slab.transmission[0] >= 0.0);
            prop_assert!(slab.reflection[0] + slab.transmission[0] <= 1.0 + 1e-14);
        }

        #[test]
        fn infinite_thickness_is_the_half_space((r, t) in physical()) {
            let km = KubelkaMunk::from_slab(&single(r, t), 1.0).unwrap();
            let far = km.slab(f64::INFINITY);
            prop_assert!((far.reflection[0] - km.half_space()[0]).abs() < 1e-12);
            prop_assert_eq!(far.transmission[0], 0.0);
            // γ tells how fast: the distance to the limit falls as e^(−2γh).
            let deep = km.slab(20.0 / km.gamma[0]);
            prop_assert!((deep.reflection[0] - km.half_space()[0]).abs() < 1e-12);
        }
    }

    #[test]
    fn zero_thickness_is_the_identity() {
        let km = KubelkaMunk::from_slab(
            &SlabSpectrum { reflection: vec![0.5, 0.0, 0.3], transmission: vec![0.5, 0.4, 0.2] },
            2.0,
        )
        .unwrap();
        assert_eq!(Composite::from_slab(&km.slab(0.0)), Composite::identity(3));
    }

    #[test]
    fn non_absorbing_resin_follows_sh_over_one_plus_sh() {
        let km = KubelkaMunk::from_slab(&single(0.5, 0.5), 2.0).unwrap();
        assert_eq!((km.alpha[0], km.beta[0], km.gamma[0], km.scattering[0]), (1.0, 0.0, 0.0, 0.5));
        let slab = km.slab(6.0);
        assert!((slab.reflection[0] - 0.75).abs() < 1e-15 && (slab.transmission[0] - 0.25).abs() < 1e-15);
        assert_eq!(km.slab(f64::INFINITY), single(1.0, 0.0));
        assert_eq!(km.half_space(), [1.0]);
        // Rounding may push R + T a little over 1.
        assert_eq!(KubelkaMunk::from_slab(&single(0.5, 0.5 + 1e-12), 2.0).unwrap().alpha[0], 1.0);
    }

    #[test]
    fn black_resin_follows_lambert_beer() {
        let km = KubelkaMunk::from_slab(&single(0.0, (-3.0f64).exp()), 1.5).unwrap();
        assert!((km.gamma[0] - 2.0).abs() < 1e-12);
        let slab = km.slab(0.5);
        assert_eq!(slab.reflection[0], 0.0);
        assert!((slab.transmission[0] - (-1.0f64).exp()).abs() < 1e-12);
        assert_eq!(km.half_space(), [0.0]);
        // The limit is approached, not jumped to.
        let nearly = KubelkaMunk::from_slab(&single(1e-200, (-3.0f64).exp()), 1.5).unwrap().slab(0.5);
        assert!((nearly.transmission[0] - (-1.0f64).exp()).abs() < 1e-12 && nearly.reflection[0] < 1e-199);
    }

    #[test]
    fn impossible_slabs_are_named() {
        let error = |r, t| KubelkaMunk::from_slab(&single(r, t), 1.0).unwrap_err();
        assert!(matches!(error(0.6, 0.6), KubelkaMunkError::Energy { index: 0, .. }));
        assert!(matches!(error(-0.1, 0.6), KubelkaMunkError::Reflection { .. }));
        assert!(matches!(error(0.1, 0.0), KubelkaMunkError::Transmission { .. }));
        assert!(matches!(error(f64::NAN, 0.1), KubelkaMunkError::Reflection { .. }));
        assert!(matches!(
            KubelkaMunk::from_slab(&single(0.1, 0.1), 0.0).unwrap_err(),
            KubelkaMunkError::Thickness { .. }
        ));
    }
}
