//! Integrals over a radial profile.
//!
//! What is interpolated is g(r) = r·f(r), the energy per mm of radius over 2π: it stays finite where f grows like 1/r,
//! so no energy is lost at the centre (a discrete Hankel transform of the point samples loses 5% at 78 µm spacing).
//! Between samples g is a polynomial of degree 3 or less: a cubic Hermite curve through point samples, with parabolic
//! slopes, or a line per ring that keeps the ring's energy exactly. Where a radius *within* a ring is asked for, a line
//! is too coarse: a thin dark slab returns half of its light within the first ring of 44 µm, and there g falls like an
//! exponential; by a line through the means the half-energy radius is 6% too large, by the exponential 1.6%. Every
//! integral of g against a smooth kernel is then a sum over Gauss–Legendre nodes.

use std::f64::consts::TAU;

use crate::numeric::quadrature::GAUSS_4;

/// Largest advance of the kernel's phase (radians) over one application of the rule: a cubic times a quarter wave
/// leaves the 4-point rule an error under 1e-8 of the interval's energy.
const MAX_PHASE: f64 = 1.5;

/// A polynomial piece of g = r·f on [start, end], in t = r − start.
#[derive(Debug, Clone, Copy)]
struct Piece {
    start: f64,
    end: f64,
    coefficients: [f64; 4],
}

impl Piece {
    fn value(&self, r: f64) -> f64 {
        let t = r - self.start;
        let [c0, c1, c2, c3] = self.coefficients;
        c0 + t * (c1 + t * (c2 + t * c3))
    }

    /// ∫ g dr from the start to r.
    fn integral_to(&self, r: f64) -> f64 {
        let t = r - self.start;
        let [c0, c1, c2, c3] = self.coefficients;
        t * (c0 + t * (c1 / 2.0 + t * (c2 / 3.0 + t * c3 / 4.0)))
    }
}

/// g(r) = r·f(r) over the sampled range, in pieces.
#[derive(Debug, Clone)]
pub(super) struct Density {
    pieces: Vec<Piece>,
    /// Whether the pieces are rings, of which only the energies are known.
    rings: bool,
}

impl Density {
    /// Through point samples at ascending radii, the first > 0, at least 3 of them. The centre continues the parabola
    /// of the first three samples of g, which gives g(0) = lim r·f whether f is regular or grows like 1/r.
    pub(super) fn from_points(r: &[f64], f: &[f64]) -> Self {
        let g: Vec<f64> = r.iter().zip(f).map(|(r, f)| r * f).collect();
        let last = r.len() - 1;
        let secant = |i: usize| (g[i + 1] - g[i]) / (r[i + 1] - r[i]);
        let slope = |i: usize| {
            // Derivative at sample i of the parabola through three neighbours.
            let centre = i.clamp(1, last - 1);
            let curvature = (secant(centre) - secant(centre - 1)) / (r[centre + 1] - r[centre - 1]);
            secant(centre - 1) + curvature * (2.0 * r[i] - r[centre] - r[centre - 1])
        };
        let mut pieces = Vec::with_capacity(r.len());
        let curvature = (secant(1) - secant(0)) / (r[2] - r[0]);
        let inward = slope(0) - 2.0 * curvature * r[0];
        let centre = g[0] - slope(0) * r[0] + curvature * r[0] * r[0];
        pieces.push(if centre >= 0.0 {
            Piece { start: 0.0, end: r[0], coefficients: [centre, inward, curvature, 0.0] }
        } else {
            Piece { start: 0.0, end: r[0], coefficients: [0.0, g[0] / r[0], 0.0, 0.0] } // r·f cannot be negative
        });
        for i in 0..last {
            let (width, from, to, mean) = (r[i + 1] - r[i], slope(i), slope(i + 1), secant(i));
            let c2 = (3.0 * mean - 2.0 * from - to) / width;
            let c3 = (from + to - 2.0 * mean) / (width * width);
            pieces.push(Piece { start: r[i], end: r[i + 1], coefficients: [g[i], from, c2, c3] });
        }
        Self { pieces, rings: false }
    }

    /// Over rings: g's mean in each is its energy over 2π and its width; the slope comes from the neighbours' means,
    /// limited so that no line turns negative in a ring whose mean is not.
    pub(super) fn from_rings(edges: &[f64], means: &[f64]) -> Self {
        let middle = |i: usize| 0.5 * (edges[i] + edges[i + 1]);
        let g = |i: usize| means[i] * middle(i); // f̄ π(b² − a²) / (2π (b − a))
        let last = means.len() - 1;
        let pieces = (0..means.len())
            .map(|i| {
                let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
                let slope =
                    if after > before { (g(after) - g(before)) / (middle(after) - middle(before)) } else { 0.0 };
                let width = edges[i + 1] - edges[i];
                let steepest = 2.0 * g(i).abs() / width;
                let slope = slope.clamp(-steepest, steepest);
                let coefficients = [g(i) - 0.5 * slope * width, slope, 0.0, 0.0];
                Piece { start: edges[i], end: edges[i + 1], coefficients }
            })
            .collect();
        Self { pieces, rings: true }
    }

    /// 2π∫ g dr from 0 to r.
    pub(super) fn energy_within(&self, r: f64) -> f64 {
        let inside = self.pieces.iter().take_while(|piece| piece.start < r);
        TAU * inside.map(|piece| piece.integral_to(r.min(piece.end))).sum::<f64>()
    }

    pub(super) fn radius_of_energy(&self, share: f64) -> Option<f64> {
        let end = self.pieces.last()?.end;
        let total = self.energy_within(end);
        if !(total > 0.0 && (0.0..=1.0).contains(&share)) {
            return None;
        }
        let straight = bisect(0.0, end, |r| self.energy_within(r) < share * total);
        let ring = self.pieces.iter().position(|piece| straight <= piece.end)?;
        let bent = self.falling(ring).map(|fall| {
            let Piece { start, end, .. } = self.pieces[ring];
            let [before, upto] = [start, end].map(|r| self.energy_within(r));
            let within = ((share * total - before) / (upto - before)).clamp(0.0, 1.0);
            start + (end - start) * libm::log1p(within * libm::expm1(-fall)) / -fall
        });
        Some(bent.unwrap_or(straight))
    }

    /// How fast g falls over a ring of which the next is known, as the exponent of e over its width: that of the
    /// exponential whose means over the neighbours have this ring's line between them. `None` where it does not fall.
    fn falling(&self, ring: usize) -> Option<f64> {
        if !self.rings || ring + 1 >= self.pieces.len() {
            return None;
        }
        let Piece { start, end, coefficients: [at_start, slope, ..] } = self.pieces[ring];
        let width = end - start;
        let change = slope * width / (at_start + 0.5 * slope * width);
        // From the middle of the first ring to that of the second; else from that before to that after.
        let fall = if ring == 0 { -libm::log1p(change.max(STEEPEST)) } else { -libm::asinh(change) };
        (change.is_finite() && fall > FLAT).then_some(fall)
    }
}

/// A second ring with less than a hundredth of the first one's g says nothing of how it falls within the first.
const STEEPEST: f64 = -0.99;
/// Falls by less than this share are lines.
const FLAT: f64 = 1e-3;

/// The point in [low, high] where `below` turns from true to false, to the last bit but a few.
pub(super) fn bisect(mut low: f64, mut high: f64, below: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if below(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Radii and the energies they stand for: ∫ 2π g(r) q(r) dr ≈ Σ energy · q(r) for kernels q no faster than q(k_max r).
#[derive(Debug, Clone)]
pub(super) struct Nodes(Vec<(f64, f64)>);

impl Nodes {
    /// Nodes fit for kernels up to the shortest wavelength given, in mm (∞: constants only).
    pub(super) fn new(density: &Density, shortest_wave_mm: f64) -> Self {
        let mut nodes = Self(Vec::with_capacity(4 * density.pieces.len()));
        for piece in density.pieces.iter().filter(|piece| piece.coefficients != [0.0; 4]) {
            nodes.push_interval(piece.start, piece.end, shortest_wave_mm, |r| piece.value(r));
        }
        nodes
    }

    /// Adds ∫ 2π g over [start, end].
    pub(super) fn push_interval(&mut self, start: f64, end: f64, shortest_wave_mm: f64, g: impl Fn(f64) -> f64) {
        let longest = MAX_PHASE * shortest_wave_mm / TAU;
        let parts = ((end - start) / longest).ceil().max(1.0);
        let half = 0.5 * (end - start) / parts;
        for part in 0..parts as usize {
            let middle = start + (2 * part + 1) as f64 * half;
            self.0.extend(GAUSS_4.iter().map(|(x, weight)| {
                let r = middle + half * x;
                (r, TAU * half * weight * g(r))
            }));
        }
    }

    pub(super) fn energy(&self) -> f64 {
        self.0.iter().map(|(_, energy)| energy).sum()
    }

    pub(super) fn integrate(&self, kernel: impl Fn(f64) -> f64) -> f64 {
        self.0.iter().map(|(r, energy)| energy * kernel(*r)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rings of so many times the length over which r f falls by e: energies are exact, and so is the radius within
    /// which half of the light lies, in the first ring or in a later one.
    #[test]
    fn half_of_what_falls_within_a_ring_is_found() {
        for width in [0.1, 0.5, 1.0, 1.4, 2.0] {
            let edges: Vec<f64> = (0..200).map(|i| f64::from(i) * width).collect();
            let energy = |r: f64| -libm::expm1(-r);
            let mean = |pair: &[f64]| {
                (energy(pair[1]) - energy(pair[0])) / (0.5 * TAU * (pair[1] * pair[1] - pair[0] * pair[0]))
            };
            let means: Vec<f64> = edges.windows(2).map(mean).collect();
            let density = Density::from_rings(&edges, &means);
            for share in [0.2, 0.5, 0.8] {
                let found = density.radius_of_energy(share).unwrap();
                let exact = -libm::log1p(-share);
                assert!((found / exact - 1.0).abs() < 1e-6, "{width}, {share}: {found} instead of {exact}");
            }
        }
    }
}
