//! Light that comes through after one turn.
//!
//! Where a thin stack lets much light through, the few directions see waves in T̂ that are not there. What was not scattered and what was
//! scattered once are integrals, so both are taken exactly, in place of what the directions make of them: the idea of Nakajima and
//! Tanaka 1988, here for diffuse light too and at every spatial frequency.
//!
//! With e^{−ix cosφ} = Σ (2 − δ_m0) (−i)^m J_m(x) cos mφ and the addition theorem of Legendre functions, diffuse light has
//!
//! ```text
//! T̂₁(k) = Σ σs ∫ dz Σ_lm (2l + 1) g_l (2 − δ_m0) (−1)^m F_lm(z, τ) F_lm(h − z, τ_h − τ)
//! F_lm(z, τ) = ∫ p_l^m(μ) J_m(kz tanθ) e^{−τ/μ} dμ,
//! ```
//!
//! summed over the layers; for a vertical beam the first F is ½ e^{−τ} where m = 0, and 0 elsewhere. To the directions F is a sum over
//! their nodes, and J_m Gauss–Chebyshev quadrature over as many azimuths as they have orders.

use std::f64::consts::PI;

use super::{
    beam::GAUSS,
    directions::{Directions, gauss_legendre},
    scattering::{Scattering, legendre},
};
use crate::optics::Light;

/// Nodes of the exact integrals over μ. Twice as many change T̂ of 1 mm of support by 1e-5 rms from 0 to 20 rad/mm.
const EXACT_NODES: usize = 48;

/// Light scattered once on its way down through a stack.
pub(super) struct Once<'a> {
    layers: &'a [(Scattering, f64)],
    light: Light,
    thickness_mm: f64,
    tau: f64,
    exact: Quadrature,
    seen: Quadrature,
    /// Share of the exact light that the directions see at k = 0; kept, so that R + T stays what it is.
    share: f64,
}

/// Polar angles and azimuthal orders over which F is summed.
struct Quadrature {
    nodes: Vec<Node>,
    orders: usize,
    /// cos mφ for each azimuth φ and order m, and cosφ; none where J_m is exact.
    azimuths: Vec<(f64, Vec<f64>)>,
}

struct Node {
    mu: f64,
    weight: f64,
    /// p_l^m(μ): order m, l − m.
    legendre: Vec<Vec<f64>>,
}

impl<'a> Once<'a> {
    pub(super) fn new(layers: &'a [(Scattering, f64)], directions: &Directions, light: Light) -> Self {
        let terms = directions.terms();
        let (tau, thickness_mm) = super::extent(layers);
        let mut it = Self {
            layers,
            light,
            thickness_mm,
            tau,
            exact: Quadrature::exact(terms),
            seen: Quadrature::of(directions),
            share: 0.0,
        };
        let exact = it.through(&it.exact, 0.0);
        if exact > 0.0 {
            it.share = it.through(&it.seen, 0.0) / exact;
        }
        it
    }

    /// The exact light in place of the directions' own.
    pub(super) fn correction(&self, k: f64) -> f64 {
        self.share * self.through(&self.exact, k) - self.through(&self.seen, k)
    }

    fn through(&self, quadrature: &Quadrature, k: f64) -> f64 {
        let (mut z, mut tau, mut total) = (0.0, 0.0, 0.0);
        for (resin, mm) in self.layers {
            for (x, weight) in GAUSS {
                let (z, tau) = (z + x * mm, tau + x * mm * resin.extinction);
                let after = quadrature.moments(k * (self.thickness_mm - z), self.tau - tau);
                let turned = match self.light {
                    Light::Diffuse => turned(&quadrature.moments(k * z, tau), &after, &resin.factors),
                    Light::Normal => {
                        0.5 * (-tau).exp() * after[0].iter().zip(&resin.factors).map(|(f, g)| f * g).sum::<f64>()
                    }
                };
                total += mm * weight * resin.sigma_s * turned;
            }
            z += mm;
            tau += mm * resin.extinction;
        }
        total
    }
}

/// Σ_lm (2l + 1) g_l (2 − δ_m0) (−1)^m F_lm F′_lm.
fn turned(before: &[Vec<f64>], after: &[Vec<f64>], factors: &[f64]) -> f64 {
    let orders = before.iter().zip(after).enumerate();
    orders
        .map(|(m, (before, after))| {
            let sum: f64 = before.iter().zip(after).zip(&factors[m..]).map(|((a, b), f)| a * b * f).sum();
            match m {
                0 => sum,
                _ if m % 2 == 0 => 2.0 * sum,
                _ => -2.0 * sum,
            }
        })
        .sum()
}

impl Quadrature {
    fn new((mu, weight): (&[f64], &[f64]), orders: usize, terms: usize, azimuths: Vec<(f64, Vec<f64>)>) -> Self {
        let node =
            |(&mu, &weight)| Node { mu, weight, legendre: (0..orders).map(|m| legendre(m, terms, mu)).collect() };
        Self { nodes: mu.iter().zip(weight).map(node).collect(), orders, azimuths }
    }

    fn exact(terms: usize) -> Self {
        let (mu, weight) = gauss_legendre(EXACT_NODES);
        Self::new((&mu, &weight), terms, terms, Vec::new())
    }

    fn of(directions: &Directions) -> Self {
        let terms = directions.terms();
        let orders = directions.orders.min(terms);
        let azimuth = |j: usize| {
            let phi = (j as f64 + 0.5) * PI / directions.orders as f64;
            (phi.cos(), (0..orders).map(|m| (m as f64 * phi).cos()).collect())
        };
        let azimuths = (0..directions.orders).map(azimuth).collect();
        Self::new((&directions.mu, &directions.weight), orders, terms, azimuths)
    }

    /// F_lm at kz = `turn`: order m, l − m.
    fn moments(&self, turn: f64, tau: f64) -> Vec<Vec<f64>> {
        let mut moments: Vec<Vec<f64>> = self.nodes[0].legendre.iter().map(|values| vec![0.0; values.len()]).collect();
        let mut waves = vec![0.0; self.orders];
        for node in &self.nodes {
            let x = turn * (1.0 - node.mu * node.mu).sqrt() / node.mu;
            if self.azimuths.is_empty() {
                bessel(x, &mut waves)
            } else {
                self.waves(x, &mut waves)
            }
            let light = node.weight * (-tau / node.mu).exp();
            for ((sums, legendre), wave) in moments.iter_mut().zip(&node.legendre).zip(&waves) {
                sums.iter_mut().zip(legendre).for_each(|(sum, value)| *sum += light * wave * value);
            }
        }
        moments
    }

    /// J_m(x) = i^m ⟨e^{−ix cosφ} cos mφ⟩ over the azimuths.
    fn waves(&self, x: f64, waves: &mut [f64]) {
        waves.fill(0.0);
        let share = 1.0 / self.azimuths.len() as f64;
        for (cos_phi, cosines) in &self.azimuths {
            let (sin, cos) = (x * cos_phi).sin_cos();
            for (m, (wave, cosine)) in waves.iter_mut().zip(cosines).enumerate() {
                *wave += share * cosine * [cos, sin, -cos, -sin][m % 4];
            }
        }
    }
}

/// J_0(x) … for x ≥ 0: the recurrence upward where that is stable, else downward from far above (Abramowitz and Stegun 9.12).
fn bessel(x: f64, values: &mut [f64]) {
    /// Orders above the last one asked for at which the downward recurrence starts.
    const HEADROOM: usize = 22;
    /// Below, J_0 is 1, J_1 is x/2 and the others 0 to 1e-17.
    const SMALL: f64 = 1e-8;
    let orders = values.len();
    if x < SMALL {
        values.fill(0.0);
        values.iter_mut().zip([1.0, 0.5 * x]).for_each(|(value, limit)| *value = limit);
        return;
    }
    if x > orders as f64 {
        let (mut before, mut here) = (libm::j0(x), libm::j1(x));
        for (m, value) in values.iter_mut().enumerate() {
            *value = before;
            (before, here) = (here, 2.0 * (m + 1) as f64 / x * here - before);
        }
        return;
    }
    // J_0 + 2 J_2 + 2 J_4 + … = 1.
    let (mut above, mut here, mut sum) = (0.0, f64::MIN_POSITIVE, 0.0);
    for m in (1..=orders + HEADROOM).rev() {
        (above, here) = (here, 2.0 * m as f64 / x * here - above);
        if m <= orders {
            values[m - 1] = here;
        }
        if m % 2 == 1 {
            sum += if m == 1 { here } else { 2.0 * here };
        }
    }
    values.iter_mut().for_each(|value| *value /= sum);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bessel_functions_are_those_of_the_library() {
        for x in [0.0, 1e-9, 1e-5, 0.1, 1.0, 5.0, 8.9, 9.1, 30.0, 700.0] {
            let mut found = [0.0; 9];
            bessel(x, &mut found);
            for (m, found) in (0..).zip(found) {
                let expected = libm::jn(m, x);
                assert!((found - expected).abs() < 1e-11, "J_{m}({x}): {found} instead of {expected}");
            }
        }
    }

    #[test]
    fn enough_directions_see_the_same() {
        let directions = Directions::new(40, 80);
        let resin = Scattering::new(&crate::optics::tests::reference::SUPPORT, &directions);
        let layers = [(resin, 1.0)];
        for light in [Light::Diffuse, Light::Normal] {
            let once = Once::new(&layers, &directions, light);
            for k in [0.0, 3.0, 20.0] {
                let (exact, seen) = (once.through(&once.exact, k), once.through(&once.seen, k));
                assert!((exact - seen).abs() < 2e-5, "{light:?}, k = {k}: {exact} and {seen}");
            }
        }
    }
}
