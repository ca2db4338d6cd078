//! The transport equation of one resin over discrete directions.
//!
//! For light that varies sideways as e^{ikx}, in flux per direction, downward L⁺ and upward L⁻:
//!
//! ```text
//! d/dz [L⁺; L⁻] = [−A, B; −B, A] [L⁺; L⁻]      A = σt/μ + i k √(1 − μ²) cosφ / μ − same-side scattering,   B = other-side scattering
//! ```
//!
//! Only A − B and A + B are needed, which hold the Legendre functions of even and of odd l + m. The forward peak that
//! the terms cannot resolve counts as unscattered: delta-M, Wiscombe 1977, with f = g^terms. The backward peak of g < 0
//! turns light round to where it came from, from (μ, φ) to (−μ, φ + π), as a share f = |g|^terms of its own: left to
//! the terms it falls between the nodes, and a direction may give more light than it gets. Where nodes are not a
//! double-Gauss rule (between media of different indices), what a direction's discrete phase function lacks to 1 goes
//! straight on too, so that no light is lost.
//!
//! Of the azimuthal orders the first one left out, M, is not 0 but −ρ times the last: light that left a source along a
//! slanted way has orders that fall by the ratio ρ = (√(σt′² + κ²) − σt′)/κ, κ = k √(1 − μ²), the Fourier series of
//! 1/(σt′ + iκ cosφ). So 5 orders do what takes 10 with M = 0 (support 1 mm, 7 polar angles, k from 2 to 20 rad/mm: R̂
//! within 1e-4).

use faer::Mat;

use super::directions::{Directions, coupling};
use crate::optics::VolumeCoefficients;

/// A resin over the directions.
#[derive(Debug, Clone)]
pub(super) struct Scattering {
    /// Refractive index.
    pub(super) index: f64,
    /// σt′ per mm, without the forward peak.
    pub(super) extinction: f64,
    /// σs′ per mm, without the peak.
    pub(super) sigma_s: f64,
    /// (2l + 1) g_l of the phase function without its peak.
    pub(super) factors: Vec<f64>,
    /// Scattering in A − B and in A + B: flux gained per mm by the row from the column.
    even: Mat<f64>,
    odd: Mat<f64>,
    /// Coupling of neighbouring orders per rad/mm: the unknowns and √(1 − μ²)/μ times the share of cosφ.
    lateral: Vec<(usize, usize, f64)>,
    /// Unknowns of the last order and their √(1 − μ²)/μ times the share of cosφ.
    last: Vec<(usize, f64)>,
    mu: Vec<f64>,
    /// Light per mm that neither goes on nor is scattered elsewhere: extinction less what discrete scattering lacks.
    lost: Vec<f64>,
}

/// A − B and A + B, per mm.
pub(super) struct Generator {
    pub(super) minus: Mat<f64>,
    pub(super) plus: Mat<f64>,
}

impl Scattering {
    pub(super) fn new(volume: &VolumeCoefficients, directions: &Directions) -> Self {
        let terms = directions.terms();
        let peak = volume.g.abs().powi(terms as i32);
        let sigma_s = volume.sigma_s * (1.0 - peak);
        let turned = if volume.g < 0.0 { volume.sigma_s * peak } else { 0.0 };
        let of_peak = |l: usize| if volume.g < 0.0 && l % 2 == 1 { -peak } else { peak };
        let moment = |l: usize| (volume.g.powi(l as i32) - of_peak(l)) / (1.0 - peak);
        let factors: Vec<f64> = (0..terms).map(|l| (2 * l + 1) as f64 * moment(l)).collect();
        let hemisphere = directions.within(volume.refractive_index);
        let unknowns: Vec<_> = directions.unknowns(volume.refractive_index).collect();
        let functions: Vec<Vec<f64>> = unknowns.iter().map(|u| legendre(u.order, terms, u.mu)).collect();
        let (n, nodes, beam) = (unknowns.len(), directions.nodes(), directions.beam());
        // The parts of p over even and odd l + m: ½ Σ (2l + 1) …, twice.
        let part = |parity: usize| {
            Mat::from_fn(n, n, |i, j| {
                let (to, from) = (unknowns[i], unknowns[j]);
                if to.order != from.order {
                    return 0.0;
                }
                let terms = functions[i].iter().zip(&functions[j]).zip(factors.iter().skip(to.order));
                let sum: f64 = terms.skip(parity).step_by(2).map(|((a, b), factor)| a * b * factor).sum();
                // cos m(φ + π) = (−1)^m cos mφ: to the other side, which A − B counts as gained and A + B as lost.
                let turns = i == j && (i == beam || hemisphere.travels(i % nodes));
                let back = match turns {
                    true if (to.order + parity).is_multiple_of(2) => turned,
                    true => -turned,
                    false => 0.0,
                };
                sigma_s * to.weight / from.mu * sum + back / from.mu
            })
        };
        let (even, odd) = (part(0), part(1));
        let slope: Vec<f64> = (0..nodes).map(|node| hemisphere.slope(node)).collect();
        let lateral = (1..directions.orders).flat_map(|order| {
            let pair = move |node: usize| ((order - 1) * nodes + node, order * nodes + node);
            slope.iter().enumerate().map(move |(node, slope)| (pair(node).0, pair(node).1, slope * coupling(order)))
        });
        // Between orders m and m + 1, in either direction: cos mφ cosφ = ½ cos (m + 1)φ + …, and twice that from order
        // 0.
        let share = if directions.orders == 1 { 1.0 } else { coupling(directions.orders) };
        let last =
            slope.iter().enumerate().map(|(node, slope)| ((directions.orders - 1) * nodes + node, slope * share));
        let extinction = sigma_s + turned + volume.sigma_a;
        // Flux into the unknowns of order 0 out of every direction.
        let kept = |j: usize| (0..nodes).chain([beam]).map(|i| even[(i, j)]).sum::<f64>() * unknowns[j].mu;
        let lost = (0..n).map(|j| match j {
            _ if j == beam => extinction - sigma_s - turned + kept(beam),
            _ if hemisphere.travels(j % nodes) => extinction - sigma_s - turned + kept(j % nodes),
            // No light is there. Equal rates would leave the modes of several such unknowns undefined.
            _ => extinction.max(1.0) * (1.0 + (j + 1) as f64 / n as f64),
        });
        Self {
            index: volume.refractive_index,
            sigma_s,
            factors,
            lateral: lateral.collect(),
            last: last.collect(),
            lost: lost.collect(),
            extinction,
            even,
            odd,
            mu: unknowns.iter().map(|u| u.mu).collect(),
        }
    }

    /// The equations at spatial frequency `k` rad/mm.
    pub(super) fn generator(&self, k: f64) -> Generator {
        let n = self.mu.len();
        let block = |scattering: &Mat<f64>| {
            let mut block = Mat::from_fn(n, n, |i, j| -scattering[(i, j)]);
            for (i, mu) in self.mu.iter().enumerate() {
                block[(i, i)] += self.lost[i] / mu;
            }
            for &(low, high, rate) in &self.lateral {
                block[(low, high)] -= k * rate;
                block[(high, low)] += k * rate;
            }
            for &(i, rate) in &self.last {
                let kappa = k * (1.0 - self.mu[i] * self.mu[i]).sqrt();
                block[(i, i)] += k * rate * ratio(self.extinction, kappa);
            }
            block
        };
        Generator { minus: block(&self.even), plus: block(&self.odd) }
    }
}

/// ρ: by how much azimuthal orders of light that goes straight fall from one to the next.
pub(super) fn ratio(extinction: f64, kappa: f64) -> f64 {
    if kappa > 0.0 { kappa / (extinction + libm::hypot(extinction, kappa)) } else { 0.0 }
}

/// √((l − m)!/(l + m)!) P_l^m(μ) for l = m … terms − 1.
pub(super) fn legendre(m: usize, terms: usize, mu: f64) -> Vec<f64> {
    let s = (1.0 - mu * mu).max(0.0).sqrt();
    let order = m as f64;
    let first: f64 = (1..=m).map(|i| s * ((2 * i - 1) as f64 / (2 * i) as f64).sqrt()).product();
    let mut values = Vec::with_capacity(terms.saturating_sub(m));
    for l in m..terms {
        let degree = l as f64;
        values.push(match l - m {
            0 => first,
            1 => (2.0 * order + 1.0).sqrt() * mu * first,
            i => {
                let rise = (2.0 * degree - 1.0) * mu * values[i - 1];
                let fall = ((degree - 1.0).powi(2) - order * order).sqrt() * values[i - 2];
                (rise - fall) / (degree * degree - order * order).sqrt()
            }
        });
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::TransportOptions;

    /// p_l^m over μ and φ obeys the addition theorem: Σ_m (2 − δ) p_l^m(μ) p_l^m(μ′) cos mφ = P_l(cos of the angle
    /// between).
    #[test]
    fn addition_theorem() {
        let (mu, other, phi) = (0.3_f64, 0.8_f64, 1.1_f64);
        let between = mu * other + ((1.0 - mu * mu) * (1.0 - other * other)).sqrt() * phi.cos();
        let expected = legendre(0, 12, between);
        for (l, expected) in expected.into_iter().enumerate() {
            let term = |m: usize| {
                let twice = if m == 0 { 1.0 } else { 2.0 };
                twice * legendre(m, 12, mu)[l - m] * legendre(m, 12, other)[l - m] * (m as f64 * phi).cos()
            };
            let sum: f64 = (0..=l).map(term).sum();
            assert!((sum - expected).abs() < 1e-13, "l {l}: {sum} instead of {expected}");
        }
    }

    #[test]
    fn without_absorption_no_flux_is_lost() {
        let directions = Directions::new([], TransportOptions { polar: 6, orders: 4 });
        let generator = Scattering::new(
            &VolumeCoefficients { sigma_s: 8.0, sigma_a: 0.0, g: 0.9, refractive_index: 1.0 },
            &directions,
        )
        .generator(0.0);
        for j in (0..6).chain([directions.beam()]) {
            let lost: f64 = (0..6).map(|i| generator.minus[(i, j)]).sum::<f64>()
                + if j == directions.beam() { generator.minus[(j, j)] } else { 0.0 };
            assert!(lost.abs() < 1e-11, "direction {j} loses {lost} per mm");
        }
    }
}
