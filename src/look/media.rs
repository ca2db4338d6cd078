//! What the resins of a print do to light in one channel.

use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::Rng};

use super::{Volume, strides::Strides};
use crate::optics::{
    VolumeCoefficients,
    monte_carlo::photon::{HenyeyGreenstein, uniform},
};

/// All resins in one channel.
#[derive(Debug)]
pub(super) struct Media {
    pub strides: Strides,
    /// 1/σt of each class, mm.
    pub mean_free_path: Vec<f64>,
    /// σt/σ of the class, by class and id: how many collisions are real.
    pub real: Vec<[f32; 256]>,
    sigma_t: [f64; 256],
    pub albedo: [f64; 256],
    pub phase: Vec<HenyeyGreenstein>,
    pub optical_depths: OpticalDepths,
}

impl Media {
    pub fn new(volume: &Volume, coefficients: &[VolumeCoefficients], present: &[bool; 256]) -> Self {
        // The background may be given coefficients, but nothing happens in it.
        let of = |id: usize| coefficients.get(id).filter(|_| id > 0);
        let sigma_t: [f64; 256] = std::array::from_fn(|id| of(id).map_or(0.0, VolumeCoefficients::sigma_t));
        let strides = Strides::new(volume, &sigma_t, present);
        let ratio = |sigma: f64, id: usize| if sigma > 0.0 { (sigma_t[id] / sigma) as f32 } else { 0.0 };
        Self {
            mean_free_path: strides.sigma.iter().map(|sigma| 1.0 / sigma).collect(),
            real: strides.sigma.iter().map(|&sigma| std::array::from_fn(|id| ratio(sigma, id))).collect(),
            albedo: std::array::from_fn(|id| of(id).map_or(0.0, VolumeCoefficients::albedo)),
            phase: (0..256).map(|id| HenyeyGreenstein::new(of(id).map_or(0.0, |volume| volume.g))).collect(),
            optical_depths: OpticalDepths::new(),
            sigma_t,
            strides,
        }
    }

    /// σt of an id, per mm.
    #[inline]
    pub fn sigma_t(&self, id: u8) -> f64 {
        self.sigma_t[usize::from(id)]
    }

    /// Class of a brick, and within how many bricks around it nothing is denser.
    #[inline]
    pub fn stride(&self, brick: usize) -> [u8; 2] {
        let stride = &self.strides.of[brick];
        [stride.class, stride.radius()]
    }

    /// The density that bounds a class, per mm.
    #[inline]
    pub fn bound(&self, class: u8) -> f64 {
        self.strides.sigma[usize::from(class)]
    }

    /// A random optical depth.
    #[inline]
    pub fn depth(&self, rng: &mut Xoshiro256PlusPlus) -> f64 {
        self.optical_depths.draw(rng)
    }

    /// Whether a collision at the density of a class is one with `id`.
    #[inline]
    pub fn is_real(&self, class: u8, id: u8, rng: &mut Xoshiro256PlusPlus) -> bool {
        let real = self.real[usize::from(class)][usize::from(id)];
        real >= 1.0 || uniform(rng) < f64::from(real)
    }
}

/// Random optical depths of flights, −ln u of a uniform u in (0, 1].
///
/// The logarithm by a table of 128 mantissas and three terms of its series: within 1e-10, the same on every machine,
/// and at a third of the time of the exact one, which a walk asks for at every event.
#[derive(Debug)]
pub(super) struct OpticalDepths {
    /// 1/m and ln m in the middle of each interval of mantissas.
    table: [[f64; 2]; 1 << MANTISSA_BITS],
}

const MANTISSA_BITS: u32 = 7;

impl OpticalDepths {
    fn new() -> Self {
        let entry = |n: usize| {
            let middle = 1.0 + (n as f64 + 0.5) / f64::from(1 << MANTISSA_BITS);
            [1.0 / middle, libm::log(middle)]
        };
        Self { table: std::array::from_fn(entry) }
    }

    #[inline]
    pub fn draw(&self, rng: &mut Xoshiro256PlusPlus) -> f64 {
        self.minus_log((rng.next_u64() >> 11) + 1)
    }

    /// −ln(n / 2⁵³), n from 1 to 2⁵³.
    #[inline]
    fn minus_log(&self, n: u64) -> f64 {
        let bits = (n as f64).to_bits();
        let exponent = (bits >> 52) as i64 - 1023 - 53;
        let mantissa = f64::from_bits(bits & ((1 << 52) - 1) | 1023 << 52);
        let [inverse, log] = self.table[(bits >> (52 - MANTISSA_BITS)) as usize & ((1 << MANTISSA_BITS) - 1)];
        let rest = mantissa * inverse - 1.0;
        let series = rest * (1.0 - rest * (0.5 - rest * (1.0 / 3.0)));
        // Rounding may put u = 1 a hair beyond.
        (-(exponent as f64 * std::f64::consts::LN_2 + log + series)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn optical_depths_are_logarithms() {
        let depths = OpticalDepths::new();
        let numbers = (0..53).flat_map(|bit| (0..997_u64).map(move |n| ((1 << bit) + (n << bit) / 997).max(1)));
        for n in numbers.chain([1, (1 << 53) - 1, 1 << 53]) {
            let exact = -libm::log(n as f64 / (1_u64 << 53) as f64);
            assert!((depths.minus_log(n) - exact).abs() < 1e-10, "{n}: {} instead of {exact}", depths.minus_log(n));
        }
    }
}
