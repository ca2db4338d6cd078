//! Light that comes through after one turn.
//!
//! Where a thin stack lets much light through, the few directions see waves in T̂ that are not there. What was not
//! scattered and what was scattered once are integrals, so both are taken exactly, in place of what the directions make
//! of them: the idea of Nakajima and Tanaka 1988, here for diffuse light too and at every spatial frequency.
//!
//! With e^{−ix cosφ} = Σ (2 − δ_m0) (−i)^m J_m(x) cos mφ and the addition theorem of Legendre functions, diffuse light
//! has
//!
//! ```text
//! T̂₁(k) = Σ σs ∫ dz Σ_lm (2l + 1) g_l F_lm F′_lm,   F_lm = n² ∫ p_l^m(μ) v_m e^{−Σ τ/μ} dμ above,   F′_lm = ∫ p_l^m(μ) v′_m e^{−Σ τ/μ} dμ below
//! v_m = (−1)^m √(2 − δ_m0) J_m(k Σ h tanθ),   v′_m = √(2 − δ_m0) J_m(k Σ h tanθ),
//! ```
//!
//! summed over the layers, with μ and n those of the layer that scatters, Σ over the way to it or from it, and
//! boundaries' transmittances on the way; for a vertical beam F is ½ e^{−Στ} where m = 0, and 0 elsewhere. To the
//! directions F is a sum over their nodes, and v what their orders make of it. Light that also turns round at a
//! boundary is left to them.

use std::f64::consts::SQRT_2;

use super::{
    directions::Directions,
    rays::{Ray, stream},
    scattering::{Scattering, legendre, ratio},
};
use crate::parallel;
use crate::{numeric::quadrature::gauss_legendre, optics::Light};

/// Nodes of the exact integrals over μ. Twice as many change T̂ of 1 mm of support by 2e-5 rms from 0 to 20 rad/mm.
const EXACT_NODES: usize = 40;
/// Beyond this kh the exact light is gone: every way through is at least h long, and waves on it cancel as e^{−kh}.
const CALM: f64 = 16.0;
/// From kh = 1 on the exact light is computed at kh this far apart, and interpolated between.
const SPACING: f64 = 0.3;
/// Gauss points of a layer h thick: one for each of these kh at the highest frequency, within limits.
const TURN: f64 = 2.5;
const POINTS: (usize, usize) = (4, 8);
/// Light on a node below this share needs no waves.
const DEAD: f64 = 1e-10;

/// Light scattered once on its way down through a stack.
pub(super) struct Once<'a> {
    layers: &'a [(Scattering, f64)],
    light: Light,
    seen: Quadrature,
    /// k, and the exact light there; 0 beyond.
    exact: Vec<(f64, f64)>,
    /// Share of the exact light that the directions see at k = 0; kept, so that R + T stays what it is.
    share: f64,
}

/// Polar angles and azimuthal orders over which F is summed.
struct Quadrature {
    rays: Vec<Ray>,
    /// p_l^m(μ): layer, ray, and then order after order l from m on.
    legendre: Vec<Vec<Vec<f64>>>,
    orders: usize,
    terms: usize,
    /// Depths in each layer, as shares of it, and their weights.
    depths: Vec<Vec<(f64, f64)>>,
    /// Whether v is what the directions make of it.
    discrete: bool,
}

impl<'a> Once<'a> {
    /// For the frequencies `k`, ascending.
    pub(super) fn new(layers: &'a [(Scattering, f64)], directions: &Directions, light: Light, k: &[f64]) -> Self {
        let terms = directions.terms();
        let orders = directions.orders.min(terms);
        let k_max = k.last().copied().unwrap_or(0.0);
        let seen = Quadrature::new(directions.crossing(layers), depths(layers, k_max), terms, orders, true);
        let thickness_mm: f64 = layers.iter().map(|(_, mm)| mm).sum();
        let mut it = Self { layers, light, seen, exact: Vec::new(), share: 0.0 };
        let quadrature = Quadrature::exact(layers, terms, k_max);
        let mut nodes: Vec<f64> = Vec::new();
        for &k in k.iter().take_while(|k| **k * thickness_mm <= CALM) {
            let far = nodes.last().is_none_or(|last| (k - last) * thickness_mm >= SPACING);
            if far || k * thickness_mm < 1.0 {
                nodes.push(k);
            }
        }
        // The last one is no node if it is too near the one before; then the next to come.
        if let (Some(&last), Some(&node)) = (k.iter().rfind(|k| **k * thickness_mm <= CALM), nodes.last())
            && last > node
        {
            nodes.push(last);
        }
        it.exact = parallel::map_all(&nodes, |&k| (k, it.through(&quadrature, k)));
        let exact = it.through(&quadrature, 0.0);
        if exact > 0.0 {
            it.share = it.through(&it.seen, 0.0) / exact;
        }
        it
    }

    /// The exact light in place of the directions' own.
    pub(super) fn correction(&self, k: f64) -> f64 {
        self.share * interpolated(&self.exact, k) - self.through(&self.seen, k)
    }

    fn through(&self, quadrature: &Quadrature, k: f64) -> f64 {
        let before = match self.light {
            Light::Diffuse => quadrature.moments(self.layers, k, false),
            Light::Normal => Vec::new(),
        };
        let after = quadrature.moments(self.layers, k, true);
        let vertical = Ray::new(self.layers, 1.0, 1.0);
        let (mut above, mut total, mut at) = (0.0_f64, 0.0, 0);
        for (layer, (resin, mm)) in self.layers.iter().enumerate() {
            let factors: Vec<f64> = (0..quadrature.orders).flat_map(|m| resin.factors[m..].iter().copied()).collect();
            for (x, weight) in &quadrature.depths[layer] {
                let turned: f64 = match self.light {
                    Light::Diffuse => {
                        before[at].iter().zip(&after[at]).zip(&factors).map(|((a, b), f)| a * b * f).sum()
                    }
                    Light::Normal => {
                        let beam = 0.5 * vertical.legs[layer].into * libm::exp(-above - x * mm * resin.extinction);
                        beam * after[at].iter().zip(&resin.factors).map(|(f, g)| f * g).sum::<f64>()
                    }
                };
                total += mm * weight * resin.sigma_s * turned;
                at += 1;
            }
            above += mm * resin.extinction;
        }
        total
    }
}

/// Cubic through the four nodes around k; 0 beyond them.
fn interpolated(nodes: &[(f64, f64)], k: f64) -> f64 {
    let above = nodes.partition_point(|node| node.0 < k);
    if above == nodes.len() {
        return 0.0;
    }
    if nodes[above].0 == k {
        return nodes[above].1;
    }
    let first = above.saturating_sub(2).min(nodes.len().saturating_sub(4));
    let four = &nodes[first..nodes.len().min(first + 4)];
    let share = |i: usize| {
        let others = (0..four.len()).filter(|&j| j != i);
        others.map(|j| (k - four[j].0) / (four[i].0 - four[j].0)).product::<f64>()
    };
    (0..four.len()).map(|i| share(i) * four[i].1).sum()
}

impl Quadrature {
    fn new(rays: Vec<Ray>, depths: Vec<Vec<(f64, f64)>>, terms: usize, orders: usize, discrete: bool) -> Self {
        let functions = |mu: f64| (0..orders).flat_map(|m| legendre(m, terms, mu)).collect();
        let within = |layer: usize| rays.iter().map(|ray| functions(ray.legs[layer].mu)).collect();
        Self { legendre: (0..depths.len()).map(within).collect(), depths, rays, orders, terms, discrete }
    }

    fn exact(layers: &[(Scattering, f64)], terms: usize, k_max: f64) -> Self {
        let (mu, weight) = gauss_legendre(EXACT_NODES);
        let rays = mu.iter().zip(&weight).map(|(&mu, &weight)| Ray::new(layers, mu, weight)).collect();
        Self::new(rays, depths(layers, k_max), terms, terms, false)
    }

    /// F at every Gauss point of every layer, from above; or F′, from below (`backwards`): order after order l from m
    /// on.
    fn moments(&self, layers: &[(Scattering, f64)], k: f64, backwards: bool) -> Vec<Vec<f64>> {
        let length = (0..self.orders).map(|m| self.terms - m).sum();
        let points: usize = self.depths.iter().map(Vec::len).sum();
        let mut moments = vec![vec![0.0; length]; points];
        let mut orders = vec![0.0; self.orders];
        for (index, ray) in self.rays.iter().enumerate() {
            let (mut phase, mut tau) = (0.0, 0.0_f64);
            orders.fill(0.0);
            orders[0] = 1.0;
            let mut at = if backwards { points } else { 0 };
            for step in 0..layers.len() {
                let layer = if backwards { layers.len() - 1 - step } else { step };
                let ((resin, mm), leg) = (&layers[layer], &ray.legs[layer]);
                let share = if backwards { leg.out } else { resin.index * resin.index * leg.into };
                let ratio = ratio(resin.extinction, k * (1.0 - leg.mu * leg.mu).sqrt());
                let mut reached = 0.0;
                let depths = &self.depths[layer];
                for point in 0..=depths.len() {
                    // The depths are symmetric; last of all the layer's end.
                    let end = point == depths.len();
                    let x = if end { 1.0 } else { depths[point].0 };
                    let here = at - usize::from(backwards && !end);
                    at = if end || backwards { here } else { at + 1 };
                    let way = (x - reached) * mm;
                    reached = x;
                    phase += k * way * leg.slope;
                    tau += way * resin.extinction / leg.mu;
                    let light = leg.weight * share * libm::exp(-tau);
                    if light < DEAD {
                        continue;
                    }
                    if self.discrete {
                        stream(&mut orders, k * way * leg.slope, ratio, backwards);
                    }
                    if end {
                        continue;
                    }
                    if !self.discrete {
                        waves(phase, backwards, &mut orders);
                    }
                    let (mut sums, mut values) = (&mut moments[here][..], &self.legendre[layer][index][..]);
                    for (m, order) in orders.iter().enumerate() {
                        let (these, others) = sums.split_at_mut(self.terms - m);
                        let (functions, rest) = values.split_at(self.terms - m);
                        (sums, values) = (others, rest);
                        these.iter_mut().zip(functions).for_each(|(sum, value)| *sum += light * order * value);
                    }
                }
            }
        }
        moments
    }
}

/// Gauss points and weights of every layer.
fn depths(layers: &[(Scattering, f64)], k_max: f64) -> Vec<Vec<(f64, f64)>> {
    let one = |(_, mm): &(Scattering, f64)| {
        let (x, weight) = gauss_legendre(((k_max * mm / TURN).ceil() as usize).clamp(POINTS.0, POINTS.1));
        x.into_iter().zip(weight).collect()
    };
    layers.iter().map(one).collect()
}

/// v, or v′ `backwards`.
fn waves(phase: f64, backwards: bool, orders: &mut [f64]) {
    bessel(phase, orders);
    for (m, order) in orders.iter_mut().enumerate().skip(1) {
        *order *= if m % 2 == 1 && !backwards { -SQRT_2 } else { SQRT_2 };
    }
}

/// J_0(x) … for x ≥ 0: the recurrence upward where that is stable, else downward from far above (Abramowitz and Stegun
/// 9.12).
fn bessel(x: f64, values: &mut [f64]) {
    /// Orders above the last one asked for at which the downward recurrence starts.
    const HEADROOM: usize = 22;
    /// Below, J_0 is 1, J_1 is x/2 and the others 0 to 1e-17.
    const SMALL: f64 = 1e-8;
    /// Where the recurrence is scaled down.
    const LARGE: f64 = 1e200;
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
        if here.abs() > LARGE {
            for value in [&mut above, &mut here, &mut sum].into_iter().chain(values.iter_mut().skip(m)) {
                *value /= LARGE;
            }
        }
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
    use crate::optics::{FrequencyGrid, TransportOptions, tests::reference::SUPPORT};

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
    fn what_lies_between_is_interpolated() {
        let directions = Directions::new([], TransportOptions { polar: 6, orders: 5 });
        let k: Vec<f64> = FrequencyGrid::default().as_slice().to_vec();
        for mm in [0.05, 0.3, 1.0, 4.0] {
            let layers = [(Scattering::new(&SUPPORT, &directions), mm)];
            let exact = Quadrature::exact(&layers, directions.terms(), 20.0);
            let once = Once::new(&layers, &directions, Light::Diffuse, &k);
            for &k in &k {
                let (found, exact) = (interpolated(&once.exact, k), once.through(&exact, k));
                assert!((found - exact).abs() < 5e-5, "{mm} mm, k = {k}: {found} instead of {exact}");
            }
        }
    }

    #[test]
    fn enough_directions_see_the_same() {
        for index in [1.0, 1.5] {
            let directions = Directions::new([index], TransportOptions { polar: 40, orders: 30 });
            let resin = Scattering::new(&SUPPORT.with_refractive_index(index), &directions);
            let layers = [(resin, 1.0)];
            let exact = Quadrature::exact(&layers, directions.terms(), 20.0);
            for light in [Light::Diffuse, Light::Normal] {
                let once = Once::new(&layers, &directions, light, &[0.0, 20.0]);
                for k in [0.0, 3.0, 15.0] {
                    let (exact, seen) = (once.through(&exact, k), once.through(&once.seen, k));
                    assert!((exact - seen).abs() < 2e-5, "{light:?}, n = {index}, k = {k}: {exact} and {seen}");
                }
            }
        }
    }
}
