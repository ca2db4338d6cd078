//! The light beyond the window, fitted to the total albedo.
//!
//! Far from the source light is diffuse and its profile falls like e^(−κr)/rᵐ⁺¹ (m between 0 and 1 from a thin slab to
//! a half-space: Farrell, Patterson and Wilson 1992). The tail goes on from the last rings by value and slope, and its
//! energy is what the albedo leaves over:
//!
//! ```text
//!   r f(r) = r_c P_c (r_c/r)ᵐ e^(−κ(r − r_c)),      κ + m/r_c = s,      2π∫ f r dr = A − window
//! ```
//!
//! With the slope s fixed, energy falls as κ grows, so bisection finds κ; m may turn negative where the window holds
//! more than its slope tells. A texel without a measured albedo gets the m of a half-space; that is a guess, and marked
//! as one.
//!
//! The rings of all texels have the same edges, so that profiles can be averaged and grouped.

use crate::numeric::quadrature::{GAUSS_3, of_unit};
use crate::parallel;

/// Each ring beyond the window is this much wider than the one before.
const GROWTH: f64 = 1.25;
/// Radius at which tails end, mm, or this many windows if that is more.
const REACH_MM: f64 = 40.0;
const REACH_WINDOWS: f64 = 4.0;
/// The slope is taken over this outer part of the window's rings.
const SLOPE_FROM: f64 = 0.6;
/// Slopes per mm are kept within 1/reach and this many per window radius: steeper, the tail holds nothing.
const STEEPEST: f64 = 50.0;
/// m of a tail whose energy was not measured.
const FAR_FIELD: f64 = 1.0;

/// How a texel's tail came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TailKind {
    /// Holds what the albedo leaves over.
    Fitted,
    /// The albedo is not known: continued by slope.
    Continued,
    /// The window holds all of the albedo, or more: none.
    None,
    /// The albedo leaves over more than any tail of this slope holds: the slope gives way.
    Stretched,
}

/// The rings beyond a window.
#[derive(Debug, Clone)]
pub struct TailRings {
    /// Middle radii of the window's rings, mm.
    middles: Vec<f64>,
    /// Where the window ends and the tail begins, then the edges of the tail's rings, mm.
    pub edges_mm: Vec<f64>,
    /// Per node: r, ln(r/r_c), 2π r_c · weight of r f.
    nodes: Vec<[f64; 3]>,
}

impl TailRings {
    /// Continues rings with these edges (mm).
    pub fn new(window_edges_mm: &[f64]) -> Self {
        let cut = window_edges_mm[window_edges_mm.len() - 1];
        let mut edges_mm = vec![cut];
        let reach = REACH_MM.max(REACH_WINDOWS * cut);
        let mut width = (GROWTH - 1.0) * cut;
        while edges_mm[edges_mm.len() - 1] < reach {
            edges_mm.push(edges_mm[edges_mm.len() - 1] + width);
            width *= GROWTH;
        }
        let nodes = edges_mm.windows(2).flat_map(|edge| {
            of_unit(GAUSS_3).map(|(x, weight)| {
                let r = edge[0] + x * (edge[1] - edge[0]);
                [r, libm::log(r / cut), std::f64::consts::TAU * cut * weight * (edge[1] - edge[0])]
            })
        });
        let nodes = nodes.collect();
        Self { middles: window_edges_mm.windows(2).map(|edge| 0.5 * (edge[0] + edge[1])).collect(), edges_mm, nodes }
    }

    /// Number of rings.
    #[allow(clippy::len_without_is_empty)] // a tail has some
    pub fn len(&self) -> usize {
        self.edges_mm.len() - 1
    }

    /// Energies of the tail's rings behind a profile of the window's rings (per mm²); `left` is what its albedo leaves
    /// over, if known.
    pub fn tail(&self, profile: &[f64], left: Option<f64>) -> (Vec<f64>, TailKind) {
        if left.is_some_and(|left| !(left > 0.0)) {
            return (vec![0.0; self.len()], TailKind::None);
        }
        let cut = self.edges_mm[0];
        let (value, slope) = self.end_of(profile);
        if !(value > 0.0) {
            // A window too small or too dark to go on from.
            return match left {
                Some(left) => (self.scaled(1.0, 1.0 / cut, 1.0, Some(left)), TailKind::Stretched),
                None => (vec![0.0; self.len()], TailKind::None),
            };
        }
        let Some(left) = left else {
            let m = FAR_FIELD.min(0.5 * slope * cut);
            return (self.scaled(value, slope - m / cut, m, None), TailKind::Continued);
        };
        let energy = |kappa: f64| self.energies(value, kappa, (slope - kappa) * cut).iter().sum::<f64>();
        let (mut low, mut high) = (0.0, slope);
        if energy(low) < left {
            return (self.scaled(value, low, slope * cut, Some(left)), TailKind::Stretched);
        }
        while energy(high) > left && high < 1e3 * slope {
            (low, high) = (high, 2.0 * high);
        }
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if energy(middle) > left { low = middle } else { high = middle }
        }
        (self.scaled(value, high, (slope - high) * cut, Some(left)), TailKind::Fitted)
    }

    /// Value at the cut per mm² and −d ln(r P)/dr there, from a line through the outer rings.
    fn end_of(&self, profile: &[f64]) -> (f64, f64) {
        let cut = self.edges_mm[0];
        let outer = |r: &f64| *r >= SLOPE_FROM * cut;
        let points: Vec<(f64, f64)> = self
            .middles
            .iter()
            .zip(profile)
            .filter(|(r, p)| outer(r) && **p > 0.0)
            .map(|(r, p)| (r - cut, libm::log(r * p)))
            .collect();
        let n = points.len() as f64;
        if points.len() < 2 {
            let value = profile.last().copied().unwrap_or(0.0);
            return (value, 1.0 / cut);
        }
        let (mean_x, mean_y) =
            (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
        let covariance: f64 = points.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
        let spread: f64 = points.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
        let slope = (-covariance / spread).clamp(1.0 / self.edges_mm[self.len()], STEEPEST / cut);
        (libm::exp(mean_y + slope * mean_x) / cut, slope)
    }

    /// Energy of each ring.
    fn energies(&self, value: f64, kappa: f64, m: f64) -> Vec<f64> {
        let cut = self.edges_mm[0];
        let node = |[r, log, weight]: &[f64; 3]| weight * value * libm::exp(-m * log - kappa * (r - cut));
        self.nodes.chunks(GAUSS_3.len()).map(|ring| ring.iter().map(node).sum()).collect()
    }

    fn scaled(&self, value: f64, kappa: f64, m: f64, total: Option<f64>) -> Vec<f64> {
        let mut energies = self.energies(value, kappa, m);
        if let Some(total) = total {
            let sum: f64 = energies.iter().sum();
            energies.iter_mut().for_each(|energy| *energy *= total / sum.max(f64::MIN_POSITIVE));
        }
        energies
    }

    /// Tails of many profiles at once, in their order.
    pub fn tails(&self, profiles: &[Vec<f64>], left: &[Option<f64>]) -> Vec<(Vec<f64>, TailKind)> {
        parallel::map(profiles.len(), |n| self.tail(&profiles[n], left[n]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::appearance::{
        NormalizedDiffusion,
        bssrdf::{Rings, areas},
    };

    /// Ring means of a material up to `window` pixels, and its energy beyond.
    fn cut(material: NormalizedDiffusion, window: usize, pitch: f64) -> (TailRings, Vec<f64>, f64) {
        let rings = Rings::new(window, window, pitch);
        let within: Vec<f64> = rings.edges_mm.iter().map(|r| material.energy_within(*r)).collect();
        let albedo = material.hankel(0.0);
        let means: Vec<f64> =
            within.windows(2).zip(areas(&rings.edges_mm)).map(|(e, area)| albedo * (e[1] - e[0]) / area).collect();
        (TailRings::new(&rings.edges_mm), means, albedo * (1.0 - within[within.len() - 1]))
    }

    #[test]
    fn energy_is_what_was_left_over() {
        let (rings, profile, _) = cut(NormalizedDiffusion::new(0.6, 1.0).unwrap(), 31, 0.06);
        for left in [1e-4, 0.01, 0.1, 0.3, 0.6] {
            let (energies, _) = rings.tail(&profile, Some(left));
            assert!((energies.iter().sum::<f64>() - left).abs() < 1e-9, "{left}");
            assert!(energies.iter().all(|energy| *energy >= 0.0));
        }
        assert_eq!(rings.tail(&profile, Some(-0.1)), (vec![0.0; rings.len()], TailKind::None));
    }

    /// The model's own tail: a third to two thirds of the light lie outside, and ring by ring it comes back.
    #[test]
    fn a_diffuse_tail_comes_back() {
        for (albedo, path, window) in [(0.6, 2.0, 61), (0.6, 1.0, 31), (0.3, 1.5, 61)] {
            let material = NormalizedDiffusion::new(albedo, path).unwrap();
            let (rings, profile, left) = cut(material, window, 0.0586);
            let (energies, kind) = rings.tail(&profile, Some(left));
            let truth = rings
                .edges_mm
                .windows(2)
                .map(|e| albedo * (material.energy_within(e[1]) - material.energy_within(e[0])));
            let off: f64 = energies.iter().zip(truth).map(|(found, truth)| (found - truth).abs()).sum();
            println!("A {albedo}, ℓ {path}: {:.3} outside, {:.4} of it misplaced", left / albedo, off / left);
            assert_eq!(kind, TailKind::Fitted);
            assert!(off < 0.06 * left, "{off} of {left}");
        }
    }

    #[test]
    fn without_an_albedo_it_goes_on() {
        let (rings, profile, left) = cut(NormalizedDiffusion::new(0.6, 0.8).unwrap(), 61, 0.06);
        let (energies, kind) = rings.tail(&profile, None);
        assert_eq!(kind, TailKind::Continued);
        let found: f64 = energies.iter().sum();
        assert!((found / left - 1.0).abs() < 0.5, "{found} for {left}");
    }

    #[test]
    fn a_window_of_one_pixel_still_has_a_tail() {
        let rings = TailRings::new(&Rings::new(1, 1, 0.06).edges_mm);
        let (energies, _) = rings.tail(&[10.0], Some(0.2));
        assert!((energies.iter().sum::<f64>() - 0.2).abs() < 1e-9);
    }
}
