//! Diffuse light that goes straight through.
//!
//! A slab of optical thickness τ lets through ∫ e^{−τ/μ} J₀(k h tanθ) 2μ dμ of a diffuse point source at spatial frequency k, in the unit of the
//! flux that enters. Few directions sample this badly where k h is large.

use std::f64::consts::PI;

use super::{directions::Directions, scattering::Scattering};

/// Abscissae and weights of the 8-point Gauss–Legendre rule on [0, 1].
pub(super) const GAUSS: [(f64, f64); 8] = [
    (0.019_855_071_751_231_884, 0.050_614_268_145_188_13),
    (0.101_666_761_293_186_63, 0.111_190_517_226_687_24),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_64),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
    (0.591_717_321_247_825, 0.181_341_891_689_181),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_64),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_24),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_13),
];

/// What is left out of the integral, roughly.
const TOLERANCE: f64 = 1e-9;

/// Light that crosses the whole stack unscattered.
pub(super) struct Straight {
    tau: f64,
    thickness_mm: f64,
    /// Share of the exact beam that the directions see at k = 0; kept, so that R + T stays what it is.
    share: f64,
}

impl Straight {
    pub(super) fn new(layers: &[(Scattering, f64)], directions: &Directions) -> Self {
        let (tau, thickness_mm) =
            layers.iter().fold((0.0, 0.0), |(tau, sum), (scattering, mm)| (tau + scattering.extinction * mm, sum + mm));
        let exact = unscattered(tau, thickness_mm, 0.0);
        let share = if exact > 0.0 { unscattered_over(directions, tau, thickness_mm, 0.0) / exact } else { 0.0 };
        Self { tau, thickness_mm, share }
    }

    /// The exact beam in place of the directions' own.
    pub(super) fn correction(&self, directions: &Directions, k: f64) -> f64 {
        self.share * unscattered(self.tau, self.thickness_mm, k)
            - unscattered_over(directions, self.tau, self.thickness_mm, k)
    }
}

/// Unscattered diffuse light through optical thickness `tau` ≥ 0, `thickness_mm` ≥ 0 thick, at `k` ≥ 0 rad/mm.
pub(super) fn unscattered(tau: f64, thickness_mm: f64, k: f64) -> f64 {
    // In u = tanθ: ∫ e^{−τ√(1+u²)} J₀(k h u) 2u / (1 + u²)² du.
    let turn = k * thickness_mm;
    let (mut sum, mut from) = (0.0, 0.0_f64);
    loop {
        // What remains, with a wave cancelling what is over a length of 1/turn, is below u · envelope.
        let envelope = 2.0 * from / (1.0 + from * from).powi(2) * (-tau * from.hypot(1.0)).exp();
        if from > 2.0 && envelope * from.min(1.0 / turn.max(1e-300)) < TOLERANCE {
            return sum;
        }
        let step = (0.25 * (1.0 + from)).min(PI / turn);
        sum += step
            * GAUSS
                .iter()
                .map(|(x, weight)| {
                    let u = from + step * x;
                    let squared = 1.0 + u * u;
                    weight * (-tau * squared.sqrt()).exp() * libm::j0(turn * u) * 2.0 * u / (squared * squared)
                })
                .sum::<f64>();
        from += step;
    }
}

/// The same as the directions see it.
fn unscattered_over(directions: &Directions, tau: f64, thickness_mm: f64, k: f64) -> f64 {
    // The orders' coupling has the eigenvalues cos((j + ½)π/orders): Gauss–Chebyshev quadrature of the integral behind J₀.
    let orders = directions.orders;
    let wave = |x: f64| {
        (0..orders).map(|j| (x * ((j as f64 + 0.5) * PI / orders as f64).cos()).cos()).sum::<f64>() / orders as f64
    };
    let nodes = directions.mu.iter().zip(&directions.weight);
    nodes
        .map(|(mu, weight)| {
            let slope = (1.0 - mu * mu).sqrt() / mu;
            2.0 * weight * mu * (-tau / mu).exp() * wave(k * thickness_mm * slope)
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without extinction the light spreads as 1/(r² + h²)²; its transform is x K₁(x), Abramowitz and Stegun 9.6.25, x = kh.
    #[test]
    fn nothing_in_the_way() {
        for (x, x_k1) in
            [(0.0, 1.0), (0.1, 0.985_384_478_087_3), (1.0, 0.601_907_230_197_2), (5.0, 0.020_223_065_727_6)]
        {
            let found = unscattered(0.0, 0.5, x / 0.5);
            assert!((found - x_k1).abs() < 1e-6, "x = {x}: {found} instead of {x_k1}");
        }
    }

    /// 2 E₃(τ) of uniform light: Abramowitz and Stegun, table 5.4.
    #[test]
    fn uniform_light() {
        for (tau, e3) in [(0.1, 0.416_291_5), (0.5, 0.221_604_4), (1.0, 0.109_692_0), (2.0, 0.030_133_4)] {
            let found = unscattered(tau, 1.0, 0.0);
            assert!((found - 2.0 * e3).abs() < 2e-6, "τ = {tau}: {found} instead of {}", 2.0 * e3);
        }
    }

    #[test]
    fn enough_directions_see_the_same() {
        let directions = Directions::new(64, 200);
        for k in [0.0, 3.0, 20.0] {
            let (exact, seen) = (unscattered(1.6, 1.0, k), unscattered_over(&directions, 1.6, 1.0, k));
            assert!((exact - seen).abs() < 1e-5, "k = {k}: {exact} and {seen}");
        }
    }
}
