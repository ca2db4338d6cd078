//! A boundary between refractive indices as a layer of its own, for light without memory of direction.
//!
//! Diffuse light that meets the surface of a resin from inside is reflected by 60% at n = 1.5, by 9% from outside; the
//! shares are those of Fresnel's equations over all directions. As a layer without thickness, with these reflectances
//! and with √(T↓T↑) for its transmission, it composes like any other (Hašan et al. 2010, equations 3 and 4), and a
//! stack under it is corrected as Saunderson 1942 corrects a paint, at every spatial frequency alike: the boundary
//! spreads nothing. What the topmost surface mirrors before any light has entered, the glint, is kept apart as in the
//! other models.

use super::{Composite, SlabSpectrum, fresnel::refraction};
use crate::numeric::quadrature::gauss_legendre;

/// Shares of diffuse light at a boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interface {
    /// What is reflected of light from above, 0 to 1.
    pub above: f64,
    /// What is reflected of light from below, 0 to 1.
    pub below: f64,
}

/// Nodes of the quadrature over directions.
const NODES: usize = 64;

impl Interface {
    /// Between two media of one index: nothing.
    pub const NONE: Self = Self { above: 0.0, below: 0.0 };

    /// Between a medium of index `above` and one of index `below`, each 1 or more.
    pub fn between(above: f64, below: f64) -> Self {
        if above == below {
            return Self::NONE;
        }
        let (thin, dense) = (above.min(below), above.max(below));
        // ∫ 2µ R(µ) dµ over light from the thinner side, of which none is reflected wholly.
        let (cosines, weights) = gauss_legendre(NODES);
        let share = |(&mu, weight): (&f64, &f64)| {
            2.0 * mu * weight * refraction(mu, thin, dense).map_or(1.0, |found| found.reflectance)
        };
        let outside: f64 = cosines.iter().zip(&weights).map(share).sum();
        // Étendue times transmittance is the same both ways.
        let inside = 1.0 - (1.0 - outside) * (thin / dense).powi(2);
        if above < below { Self { above: outside, below: inside } } else { Self { above: inside, below: outside } }
    }

    /// T↓T↑, the product of what passes down and what passes up.
    pub fn both_ways(self) -> f64 {
        (1.0 - self.above) * (1.0 - self.below)
    }

    /// As a layer of `len` coefficients.
    pub fn layer(self, len: usize) -> Composite {
        Composite {
            reflection_top: vec![self.above; len],
            reflection_bottom: vec![self.below; len],
            transmission: vec![self.both_ways().sqrt(); len],
        }
    }

    /// As the topmost layer, the surface to the light that enters: without what it mirrors before.
    pub fn surface(self, len: usize) -> Composite {
        Composite { reflection_top: vec![0.0; len], ..self.layer(len) }
    }

    /// R̂ of what reflects `below` under this boundary as a surface: Saunderson's correction.
    pub(crate) fn surface_over(self, below: &[f64]) -> Vec<f64> {
        if self == Self::NONE {
            return below.to_vec();
        }
        below.iter().map(|r| self.both_ways() * r / (1.0 - self.below * r)).collect()
    }

    /// R̂ of what reflects `below` under this boundary between two media.
    pub(crate) fn over(self, below: Vec<f64>) -> Vec<f64> {
        if self == Self::NONE {
            return below;
        }
        self.surface_over(&below).into_iter().map(|r| self.above + r).collect()
    }

    /// R̂ and T̂ of the slab inside, of one that has this boundary on either face and was measured with both: R̂
    /// without the glint. Lit alike from both sides, or oppositely, it reflects R̂ ± T̂, and each is corrected by
    /// itself.
    pub(crate) fn taken_off(self, slab: &SlabSpectrum) -> SlabSpectrum {
        if self == Self::NONE {
            return slab.clone();
        }
        let (both, below) = (self.both_ways(), self.below);
        // Light that keeps its direction, in clear slabs, may pretend to more than a slab can do.
        let possible = |b: f64| b.clamp(-both / (1.0 + below), both / (1.0 - below));
        let pairs = slab.reflection.iter().zip(&slab.transmission).map(|(r, t)| {
            let (even, odd) = (possible(r + t), possible(r - t));
            let [under_even, under_odd] = [even, odd].map(|b| both + below * b);
            // Half the sum, and half the difference without cancelling.
            let whole = even == r + t && odd == r - t;
            let half = if whole { *t } else { 0.5 * (even - odd) };
            let transmission = both * half / (under_even * under_odd);
            ((0.5 * (even / under_even + odd / under_odd)).max(0.0), transmission)
        });
        let (reflection, transmission) = pairs.unzip();
        SlabSpectrum { reflection, transmission }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published values for n = 1.5: 0.0918 from outside, 0.5963 from inside (Walsh 1926; fresnel.rs has the closed
    /// form).
    #[test]
    fn diffuse_light_at_a_surface() {
        let surface = Interface::between(1.0, 1.5);
        assert!((surface.above - 0.0918).abs() < 5e-5 && (surface.below - 0.5963).abs() < 5e-5, "{surface:?}");
        let turned = Interface::between(1.5, 1.0);
        assert_eq!([turned.above, turned.below], [surface.below, surface.above]);
        assert_eq!(Interface::between(1.3, 1.3), Interface::NONE);
        assert_eq!(Interface::NONE.layer(2), Composite::identity(2));
    }

    /// A slab under two surfaces, as it is measured, and the same slab when they are taken off.
    #[test]
    fn what_is_put_on_comes_off() {
        let surface = Interface::between(1.0, 1.52);
        for (r, t) in [(0.6, 0.3), (0.05, 0.9), (0.5, 1e-12), (0.0, 0.4), (0.0, 1.0)] {
            let slab = SlabSpectrum { reflection: vec![r], transmission: vec![t] };
            let lower = Interface::between(1.52, 1.0).layer(1);
            let whole = surface.surface(1).over(&Composite::from_slab(&slab)).over(&lower);
            // What is counted below has passed a surface down and one up.
            let measured =
                SlabSpectrum { reflection: whole.reflection_top.clone(), transmission: whole.transmission.clone() };
            let found = surface.taken_off(&measured);
            let apart = (found.reflection[0] - r).abs().max((found.transmission[0] / t - 1.0).abs());
            assert!(apart < 1e-12, "{r}, {t}: {found:?}");
            assert!((surface.surface_over(&[r])[0] - surface.surface(1).reflection_over(&[r])[0]).abs() < 1e-15);
        }
    }
}
