//! What dithered resins are together when their grains are not small beside the way between two events.
//!
//! A grain that absorbs stands in its own shadow, so that a mixture takes away less light than its resins would by
//! volume. For media that fluctuate over a short length ℓ, a perturbation of the transport equation to second order
//! (Bourret's approximation, as for random mixtures in Levermore et al. 1986, *Linear transport theory in a random
//! medium*) takes from each moment σ_l = σ_t − σ_s g^l of the collisions its variance: σ_l − ℓ Var(σ_l). Here in the
//! form that stays positive,
//!
//! ```text
//!   σ_l = Σ f σ_l,i w_i / Σ f w_i,   w_i = 1 / (1 + ℓ σ_l,i)
//! ```
//!
//! for absorption (l = 0), for what turns light back (l = 1) and for all collisions (l → ∞): each resin's light is as
//! dim as its grains make it. ℓ is the integral of the correlation along a line, over all directions: for voxels that
//! have nothing to do with their neighbours half the mean way through them; less for those of a blue-noise mask, whose
//! neighbours are the other resin. Measured: docs/accuracy.md, laid mixtures.

use super::VolumeCoefficients;
use crate::numeric::quadrature::gauss_legendre;

/// The grains that mixtures are laid in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grains {
    /// From a point in a voxel to its end, mean over points and directions, mm.
    way_mm: f64,
}

/// Part of a voxel's correlation that its neighbours do not take back, where resins have equal shares, and how that
/// rises to 1 for rare grains: over the probability that two voxels differ. Least squares through the autocorrelation
/// of the mask at 2, 5, 10, 30 and 50%, J750 at 14 and 27 µm and cubes, all within 8%.
const DENSE: f64 = 0.58;
const RARE: f64 = 0.16;
/// Step of derivatives in shares.
const SHARE_STEP: f64 = 1e-5;

impl Grains {
    /// Too small to matter.
    pub const FINE: Self = Self { way_mm: 0.0 };

    /// Single voxels of `pitch_mm`, shared out by a blue-noise mask.
    pub fn of_voxels(pitch_mm: [f64; 3]) -> Self {
        const NODES: usize = 24;
        let (places, weights) = gauss_legendre(NODES);
        let nodes: Vec<_> = places.into_iter().zip(weights).collect();
        let mut sum = 0.0;
        for (z, weight_z) in &nodes {
            for (turn, weight_turn) in &nodes {
                let (sine, angle) = ((1.0 - z * z).sqrt(), turn * std::f64::consts::FRAC_PI_2);
                let rates = [sine * libm::cos(angle), sine * libm::sin(angle), *z];
                let [a, b, c]: [f64; 3] = std::array::from_fn(|axis| rates[axis] / pitch_mm[axis]);
                // ∫ (1 − as)(1 − bs)(1 − cs) ds to where the first is 0.
                let end = 1.0 / a.max(b).max(c);
                let [s2, s3, s4] = [end.powi(2), end.powi(3), end.powi(4)];
                let within = end - (a + b + c) * s2 / 2.0 + (a * b + b * c + c * a) * s3 / 3.0 - a * b * c * s4 / 4.0;
                sum += weight_z * weight_turn * within;
            }
        }
        Self { way_mm: sum }
    }

    /// Integral of the correlation along a line, mm, where resins have these shares.
    pub fn length_mm(self, shares: impl IntoIterator<Item = f64>) -> f64 {
        let differ = 1.0 - shares.into_iter().map(|share| share * share).sum::<f64>();
        self.way_mm * (DENSE + (1.0 - DENSE) * libm::exp(-differ.max(0.0) / RARE))
    }

    /// What `parts`, coefficients with their shares of the volume, are together. One part alone keeps its bits.
    pub fn mixed(self, parts: &[(VolumeCoefficients, f64)]) -> VolumeCoefficients {
        if self == Self::FINE || parts.len() < 2 {
            return VolumeCoefficients::mixed(parts.iter().copied());
        }
        let length = self.length_mm(parts.iter().map(|part| part.1));
        let moment = |of: fn(&VolumeCoefficients) -> f64| {
            let (mut sum, mut light) = (0.0, 0.0);
            for (part, share) in parts {
                let dim = share / (1.0 + length * of(part));
                sum += dim * of(part);
                light += dim;
            }
            sum / light
        };
        let sigma_a = moment(|part| part.sigma_a);
        let back = moment(|part| part.sigma_a + part.sigma_s * (1.0 - part.g));
        let sigma_s = moment(|part| part.sigma_s + part.sigma_a) - sigma_a;
        let plain = VolumeCoefficients::mixed(parts.iter().copied());
        let g = if sigma_s > 0.0 { (1.0 - (back - sigma_a) / sigma_s).clamp(-1.0, 1.0) } else { 0.0 };
        VolumeCoefficients { sigma_s: sigma_s.max(0.0), sigma_a, g, ..plain }
    }

    /// How σs and σa per mm and g of a mixture of `parts` change with the share of one of them, `more`, at the cost of
    /// the share of `less`.
    pub fn slope(self, parts: &[(VolumeCoefficients, f64)], more: usize, less: usize) -> [f64; 3] {
        let with = |by: f64| {
            let mut parts = parts.to_vec();
            parts[more].1 += by;
            parts[less].1 -= by;
            parts.retain(|part| part.1 != 0.0);
            self.mixed(&parts)
        };
        let [up, down] = [SHARE_STEP, -SHARE_STEP].map(with);
        let slope = |up: f64, down: f64| (up - down) / (2.0 * SHARE_STEP);
        [slope(up.sigma_s, down.sigma_s), slope(up.sigma_a, down.sigma_a), slope(up.g, down.g)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: VolumeCoefficients = VolumeCoefficients { sigma_s: 8.0, sigma_a: 0.17, g: 0.5, refractive_index: 1.0 };
    const BLACK: VolumeCoefficients = VolumeCoefficients { sigma_s: 2.5, sigma_a: 4.0, g: 0.5, refractive_index: 1.0 };

    #[test]
    fn the_way_out_of_a_voxel() {
        // A cube's mean over points and directions is half of the mean squared chord over the mean chord.
        let cube = Grains::of_voxels([0.03; 3]).way_mm / 0.03;
        assert!((0.44..0.48).contains(&cube), "{cube}");
        // Of a thin sheet only its thickness counts, but for directions along it.
        let sheet = Grains::of_voxels([1.0, 1.0, 0.001]).way_mm;
        assert!((0.001..0.01).contains(&sheet), "{sheet}");
        let grains = Grains::of_voxels([0.03; 3]);
        assert!(grains.length_mm([0.99, 0.01]) > 1.4 * grains.length_mm([0.5, 0.5]));
    }

    #[test]
    fn grains_take_less_than_their_volume() {
        let grains = Grains::of_voxels([0.042, 0.085, 0.027]);
        for dark in [0.02, 0.1, 0.3, 0.5] {
            let parts = [(WHITE, 1.0 - dark), (BLACK, dark)];
            let (plain, laid) = (VolumeCoefficients::mixed(parts), grains.mixed(&parts));
            // To first order in ℓ the variance.
            let length = grains.length_mm([1.0 - dark, dark]);
            let loss = length * dark * (1.0 - dark) * (BLACK.sigma_a - WHITE.sigma_a).powi(2);
            let found = plain.sigma_a - laid.sigma_a;
            assert!(found > 0.0 && (found / loss - 1.0).abs() < 0.1, "{dark}: {found} for {loss}");
            assert!(laid.sigma_s > 0.0 && laid.sigma_t() <= plain.sigma_t());
            assert!(laid.check().is_ok());
        }
        assert_eq!(grains.mixed(&[(WHITE, 1.0)]), WHITE);
        assert_eq!(
            Grains::FINE.mixed(&[(WHITE, 0.5), (BLACK, 0.5)]),
            VolumeCoefficients::mixed([(WHITE, 0.5), (BLACK, 0.5)])
        );
        let alike = grains.mixed(&[(WHITE, 0.5), (WHITE, 0.5)]);
        assert!((alike.sigma_a - WHITE.sigma_a).abs() < 1e-12 && (alike.g - WHITE.g).abs() < 1e-12);
    }
}
