//! Light that comes through after one turn.
//!
//! Where a thin stack lets much light through, the few directions see waves in T̂ that are not there. What was not scattered and what was
//! scattered once are integrals, so both are taken exactly, in place of what the directions make of them: the idea of Nakajima and
//! Tanaka 1988, here for diffuse light too and at every spatial frequency.
//!
//! With e^{−ix cosφ} = Σ (2 − δ_m0) (−i)^m J_m(x) cos mφ and the addition theorem of Legendre functions, diffuse light has
//!
//! ```text
//! T̂₁(k) = Σ σs ∫ dz Σ_lm (2l + 1) g_l F_lm F′_lm,   F_lm = n² ∫ p_l^m(μ) v_m e^{−Σ τ/μ} dμ above,   F′_lm = ∫ p_l^m(μ) v′_m e^{−Σ τ/μ} dμ below
//! v_m = (−1)^m √(2 − δ_m0) J_m(k Σ h tanθ),   v′_m = √(2 − δ_m0) J_m(k Σ h tanθ),
//! ```
//!
//! summed over the layers, with μ and n those of the layer that scatters, Σ over the way to it or from it, and boundaries' transmittances on the way;
//! for a vertical beam F is ½ e^{−Στ} where m = 0, and 0 elsewhere. To the directions F is a sum over their nodes, and v what their
//! orders make of it. Light that also turns round at a boundary is left to them.

use super::{
    beam::GAUSS,
    directions::{Directions, gauss_legendre},
    rays::{Ray, stream},
    scattering::{Scattering, legendre, ratio},
};
use crate::optics::Light;

/// Nodes of the exact integrals over μ. Twice as many change T̂ of 1 mm of support by 1e-5 rms from 0 to 20 rad/mm.
const EXACT_NODES: usize = 48;
/// Beyond this kh the exact light is gone: every way through is at least h long, and waves on it cancel as e^{−kh}.
const CALM: f64 = 16.0;
/// Light on a node below this share needs no waves.
const DEAD: f64 = 1e-10;

/// Light scattered once on its way down through a stack.
pub(super) struct Once<'a> {
    layers: &'a [(Scattering, f64)],
    light: Light,
    thickness_mm: f64,
    exact: Quadrature,
    seen: Quadrature,
    /// Share of the exact light that the directions see at k = 0; kept, so that R + T stays what it is.
    share: f64,
}

/// Polar angles and azimuthal orders over which F is summed.
struct Quadrature {
    rays: Vec<Ray>,
    /// p_l^m(μ): layer, ray, order m, l − m.
    legendre: Vec<Vec<Vec<Vec<f64>>>>,
    orders: usize,
    /// Whether v is what the directions make of it.
    discrete: bool,
}

/// F_lm: order m, l − m.
type Moments = Vec<Vec<f64>>;

impl<'a> Once<'a> {
    pub(super) fn new(layers: &'a [(Scattering, f64)], directions: &Directions, light: Light) -> Self {
        let terms = directions.terms();
        let (mu, weight) = gauss_legendre(EXACT_NODES);
        let exact = mu.iter().zip(&weight).map(|(&mu, &weight)| Ray::new(layers, mu, weight)).collect();
        let mut it = Self {
            layers,
            light,
            thickness_mm: layers.iter().map(|(_, mm)| mm).sum(),
            exact: Quadrature::new(exact, layers.len(), terms, terms, false),
            seen: Quadrature::new(directions.crossing(layers), layers.len(), terms, directions.orders.min(terms), true),
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
        let exact = if k * self.thickness_mm > CALM { 0.0 } else { self.through(&self.exact, k) };
        self.share * exact - self.through(&self.seen, k)
    }

    fn through(&self, quadrature: &Quadrature, k: f64) -> f64 {
        let before = quadrature.moments(self.layers, k, false);
        let after = quadrature.moments(self.layers, k, true);
        let (mut above, mut crossed) = (0.0_f64, 1.0);
        let vertical = Ray::new(self.layers, 1.0, 1.0);
        let mut total = 0.0;
        for (layer, (resin, mm)) in self.layers.iter().enumerate() {
            crossed = if let Some(leg) = vertical.legs.get(layer) { leg.into } else { crossed };
            for (i, (x, weight)) in GAUSS.iter().enumerate() {
                let at = layer * GAUSS.len() + i;
                let turned: f64 = match self.light {
                    Light::Diffuse => {
                        let orders = before[at].iter().zip(&after[at]).enumerate();
                        orders
                            .map(|(m, (before, after))| {
                                before
                                    .iter()
                                    .zip(after)
                                    .zip(&resin.factors[m..])
                                    .map(|((a, b), f)| a * b * f)
                                    .sum::<f64>()
                            })
                            .sum()
                    }
                    Light::Normal => {
                        let beam = 0.5 * crossed * (-above - x * mm * resin.extinction).exp();
                        beam * after[at][0].iter().zip(&resin.factors).map(|(f, g)| f * g).sum::<f64>()
                    }
                };
                total += mm * weight * resin.sigma_s * turned;
            }
            above += mm * resin.extinction;
        }
        total
    }
}

impl Quadrature {
    fn new(rays: Vec<Ray>, layers: usize, terms: usize, orders: usize, discrete: bool) -> Self {
        let functions = |mu: f64| (0..orders).map(|m| legendre(m, terms, mu)).collect();
        let within = |layer: usize| rays.iter().map(|ray| functions(ray.legs[layer].mu)).collect();
        Self { legendre: (0..layers).map(within).collect(), rays, orders, discrete }
    }

    /// F at every Gauss point of every layer, from above; or F′, from below (`backwards`).
    fn moments(&self, layers: &[(Scattering, f64)], k: f64, backwards: bool) -> Vec<Moments> {
        let points = layers.len() * GAUSS.len();
        let empty: Moments = self
            .legendre
            .first()
            .and_then(|rays| rays.first())
            .map_or_else(Vec::new, |functions| functions.iter().map(|values| vec![0.0; values.len()]).collect());
        let mut moments = vec![empty; points];
        let (mut orders, mut waves) = (vec![0.0; self.orders], vec![0.0; self.orders]);
        let mut scratch = vec![0.0; 2 * self.orders];
        for (index, ray) in self.rays.iter().enumerate() {
            let (mut phase, mut tau) = (0.0, 0.0_f64);
            orders.fill(0.0);
            orders[0] = 1.0;
            for step in 0..layers.len() {
                let layer = if backwards { layers.len() - 1 - step } else { step };
                let ((resin, mm), leg) = (&layers[layer], &ray.legs[layer]);
                let light =
                    if backwards { leg.weight * leg.out } else { resin.index * resin.index * leg.weight * leg.into };
                let ratio = ratio(resin.extinction, k * (1.0 - leg.mu * leg.mu).sqrt());
                let mut reached = 0.0;
                for point in 0..=GAUSS.len() {
                    // The Gauss points are symmetric; last of all the layer's end.
                    let x = GAUSS.get(point).map_or(1.0, |(x, _)| *x);
                    let way = (x - reached) * mm;
                    reached = x;
                    phase += k * way * leg.slope;
                    tau += way * resin.extinction / leg.mu;
                    let light = light * (-tau).exp();
                    if light < DEAD {
                        continue;
                    }
                    if self.discrete {
                        stream(&mut orders, k * way * leg.slope, ratio, backwards, &mut scratch);
                    }
                    if point == GAUSS.len() {
                        continue;
                    }
                    if !self.discrete {
                        bessel(phase, &mut waves);
                        for (m, (order, wave)) in orders.iter_mut().zip(&waves).enumerate() {
                            let size = if m == 0 { *wave } else { std::f64::consts::SQRT_2 * wave };
                            *order = if m % 2 == 1 && !backwards { -size } else { size };
                        }
                    }
                    let at = layer * GAUSS.len() + if backwards { GAUSS.len() - 1 - point } else { point };
                    let functions = self.legendre[layer][index].iter().zip(&orders);
                    for (sums, (values, order)) in moments[at].iter_mut().zip(functions) {
                        sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += light * order * value);
                    }
                }
            }
        }
        moments
    }
}

/// J_0(x) … for x ≥ 0: the recurrence upward where that is stable, else downward from far above (Abramowitz and Stegun 9.12).
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
    use crate::optics::{TransportOptions, tests::reference::SUPPORT};

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
        for index in [1.0, 1.5] {
            let directions = Directions::new([index], TransportOptions { polar: 40, orders: 30 });
            let resin = Scattering::new(&SUPPORT.with_refractive_index(index), &directions);
            let layers = [(resin, 1.0)];
            for light in [Light::Diffuse, Light::Normal] {
                let once = Once::new(&layers, &directions, light);
                for k in [0.0, 3.0, 15.0] {
                    let (exact, seen) = (once.through(&once.exact, k), once.through(&once.seen, k));
                    assert!((exact - seen).abs() < 2e-5, "{light:?}, n = {index}, k = {k}: {exact} and {seen}");
                }
            }
        }
    }
}
