//! Composition of layers: Hašan et al. 2010, equations 3, 4 and 6.
//!
//! Assumes that light between two layers has no memory of direction (scalar Kubelka–Munk); exact for layers of one
//! resin.

use super::SlabSpectrum;

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

/// 1 − R∩·R∪, kept off zero: it vanishes only between two perfect mirrors, and no light gets between those (T = 0).
#[inline]
pub(crate) fn trapped(reflection_bottom: f64, reflection_below: f64) -> f64 {
    (1.0 - reflection_bottom * reflection_below).max(f64::MIN_POSITIVE)
}

impl Composite {
    /// Nothing at all: reflects nothing, transmits everything. `len` is the number of coefficients.
    pub fn identity(len: usize) -> Self {
        Self { reflection_top: vec![0.0; len], reflection_bottom: vec![0.0; len], transmission: vec![1.0; len] }
    }

    /// A single homogeneous slab, the same from both sides.
    pub fn from_slab(slab: &SlabSpectrum) -> Self {
        Self {
            reflection_top: slab.reflection.clone(),
            reflection_bottom: slab.reflection.clone(),
            transmission: slab.transmission.clone(),
        }
    }

    /// `self` on top of `below`. Both must have the same number of coefficients; the shorter one decides otherwise.
    pub fn over(&self, below: &Self) -> Self {
        let len = self.transmission.len().min(below.transmission.len());
        let mut whole =
            Self { reflection_top: vec![0.0; len], reflection_bottom: vec![0.0; len], transmission: vec![0.0; len] };
        for i in 0..len {
            let (r1_top, r1_bottom, t1) = (self.reflection_top[i], self.reflection_bottom[i], self.transmission[i]);
            let (r2_top, r2_bottom, t2) = (below.reflection_top[i], below.reflection_bottom[i], below.transmission[i]);
            let between = 1.0 / trapped(r1_bottom, r2_top);
            whole.reflection_top[i] = r1_top + t1 * t1 * r2_top * between;
            whole.reflection_bottom[i] = r2_bottom + t2 * t2 * r1_bottom * between;
            whole.transmission[i] = t1 * t2 * between;
        }
        whole
    }

    /// R̂ of the stack lying on something that reflects `base`, one value per coefficient (equation 6).
    pub fn reflection_over(&self, base: &[f64]) -> Vec<f64> {
        let top = self.reflection_top.iter().zip(&self.reflection_bottom).zip(&self.transmission);
        top.zip(base).map(|(((r_top, r_bottom), t), r)| r_top + t * t * r / trapped(*r_bottom, *r)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A stack as composition makes them: asymmetric, energy conserving.
    fn stack() -> impl Strategy<Value = Composite> {
        let slab = || {
            (0.0..0.95f64, 0.0..1.0f64).prop_map(|(r, share)| {
                Composite::from_slab(&SlabSpectrum { reflection: vec![r], transmission: vec![(1.0 - r) * share] })
            })
        };
        (slab(), slab()).prop_map(|(a, b)| a.over(&b))
    }

    fn distance(a: &Composite, b: &Composite) -> f64 {
        (a.reflection_top[0] - b.reflection_top[0])
            .abs()
            .max((a.reflection_bottom[0] - b.reflection_bottom[0]).abs())
            .max((a.transmission[0] - b.transmission[0]).abs())
    }

    proptest! {
        #[test]
        fn composition_is_associative(a in stack(), b in stack(), c in stack()) {
            prop_assert!(distance(&a.over(&b).over(&c), &a.over(&b.over(&c))) < 1e-12);
        }

        #[test]
        fn identity_is_neutral(a in stack()) {
            prop_assert!(distance(&Composite::identity(1).over(&a), &a) < 1e-15);
            prop_assert!(distance(&a.over(&Composite::identity(1)), &a) < 1e-15);
        }

        #[test]
        fn energy_is_conserved(a in stack(), b in stack()) {
            let whole = a.over(&b);
            prop_assert!(whole.reflection_top[0] + whole.transmission[0] <= 1.0 + 1e-12);
            prop_assert!(whole.reflection_bottom[0] + whole.transmission[0] <= 1.0 + 1e-12);
        }

        #[test]
        fn base_is_a_stack_that_lets_nothing_through(a in stack(), base in 0.0..1.0f64) {
            let floor = Composite { reflection_top: vec![base], reflection_bottom: vec![0.0], transmission: vec![0.0] };
            prop_assert!((a.reflection_over(&[base])[0] - a.over(&floor).reflection_top[0]).abs() < 1e-14);
        }
    }

    #[test]
    fn mirrors_on_mirrors_stay_finite() {
        let mirror = Composite { reflection_top: vec![1.0], reflection_bottom: vec![1.0], transmission: vec![0.0] };
        assert_eq!(mirror.over(&mirror), mirror);
        assert_eq!(mirror.reflection_over(&[1.0]), [1.0]);
    }
}
