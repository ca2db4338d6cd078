//! A sharp shadow's edge on a translucent surface: what shows how far light travels inside (Hašan et al. 2010, section
//! 8.2).
//!
//! Where one half of the plane is lit evenly, the light that leaves x mm inside the lit half is the integral of the
//! line spread ℓ(u) = ∫ R(√(u² + v²)) dv up to x. The transform of ℓ along u is R̂ itself, so
//!
//! ```text
//!   L(x) = ½ R̂(0) + 1/π ∫₀^∞ R̂(k) sin(kx)/k dk:   0 deep in the shadow, ½ R̂(0) on the edge, R̂(0) far in the light.
//! ```

use std::f64::consts::PI;

use super::{FrequencyGrid, InverseHankel};

/// The integral ends where R̂/k, falling like 1/k², has left out less than 1e-3 of R̂(0) for any x.
const END: f64 = 400.0;
/// A fortieth of the default grid's spacing: sin(kx) has 80 steps a period at x = 20 mm.
const STEP: f64 = 0.004;

/// Half of the widest edge that is told, mm: where the integral is known to 1e-3.
const FARTHEST_MM: f64 = 20.0;

/// L(x) of one spectrum.
#[derive(Debug, Clone)]
pub struct EdgeResponse {
    total: f64,
    /// R̂(k)/k times the step, at the middles of the steps.
    weight: Vec<f64>,
}

impl EdgeResponse {
    /// Of R̂ over `grid`; beyond it the transform goes on as `InverseHankel` has it.
    pub fn new(reflection: &[f64], grid: &FrequencyGrid) -> Self {
        let light = InverseHankel::new(reflection, grid);
        let steps = (END / STEP) as usize;
        let weight = (0..steps).map(|n| (n as f64 + 0.5) * STEP).map(|k| light.value(k) / k * STEP).collect();
        Self { total: reflection.first().copied().unwrap_or(0.0), weight }
    }

    /// Light that leaves at `x_mm` from the edge, for unit irradiance of the lit half; x is negative in the shadow. To
    /// 1e-3 of R̂(0) within 20 mm of the edge.
    pub fn at(&self, x_mm: f64) -> f64 {
        let terms =
            self.weight.iter().zip(0..).map(|(weight, n)| weight * libm::sin((f64::from(n) + 0.5) * STEP * x_mm));
        0.5 * self.total + terms.sum::<f64>() / PI
    }

    /// The widest edge that [`width_mm`](Self::width_mm) finds, mm.
    pub const WIDEST_MM: f64 = 2.0 * FARTHEST_MM;

    /// How far apart, in mm, a tenth and nine tenths of R̂(0) leave; `None` where that is beyond 40 mm or nothing
    /// leaves.
    pub fn width_mm(&self) -> Option<f64> {
        let below = |x_mm: f64| self.at(x_mm) < 0.9 * self.total;
        let (mut low, mut high) = (0.0, FARTHEST_MM);
        if !(self.total > 0.0 && below(low)) || below(high) {
            return None;
        }
        // The response about the edge is odd, so one half says it all. To a thousandth, or 0.02 µm.
        while high - low > 5e-4 * high + 1e-5 {
            // From the far side down by quarters: most edges are narrow.
            let middle = low + 0.25 * (high - low);
            if below(middle) { low = middle } else { high = middle }
        }
        Some(low + high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_makes_an_error_function() {
        let grid = FrequencyGrid::default();
        let sigma = 0.7;
        let values: Vec<f64> = grid.as_slice().iter().map(|k| 0.5 * (-0.5 * (k * sigma).powi(2)).exp()).collect();
        let edge = EdgeResponse::new(&values, &grid);
        for x in [-3.0, -0.7, -0.1, 0.0, 0.2, 1.0, 5.0] {
            let expected = 0.25 * (1.0 + libm::erf(x / (sigma * 2.0_f64.sqrt())));
            assert!((edge.at(x) - expected).abs() < 5e-4, "{x}: {} not {expected}", edge.at(x));
        }
        // ½ (1 + erf(x/σ√2)) = 0.9 at 1.28155 σ.
        let width = edge.width_mm().unwrap();
        assert!((width / (2.0 * 1.281_552 * sigma) - 1.0).abs() < 2e-3, "{width}");
        assert_eq!(EdgeResponse::new(&vec![0.0; grid.len()], &grid).width_mm(), None);
    }

    #[test]
    fn light_and_shadow_add_up() {
        let grid = FrequencyGrid::default();
        // R = A b e^(−br)/(2πr).
        let values: Vec<f64> = grid.as_slice().iter().map(|k| 0.6 * 2.0 / k.hypot(2.0)).collect();
        let edge = EdgeResponse::new(&values, &grid);
        for x in [0.0, 0.05, 0.3, 2.0, 10.0] {
            assert!((edge.at(x) + edge.at(-x) - 0.6).abs() < 1e-9);
        }
        assert!(edge.at(-10.0).abs() < 1e-3 && (edge.at(10.0) - 0.6).abs() < 1e-3);
        // ∫ of the line spread (A b/π) K₀(b|u|): L(0.3) − L(0) by quadrature of R over strips.
        let n = 4000;
        let strip = |u: f64| -> f64 {
            // v = u sinh t: R dv is smooth in t.
            (0..n)
                .map(|i| 10.0 * (f64::from(i) + 0.5) / f64::from(n))
                .map(|t: f64| {
                    let r = u * t.cosh();
                    2.0 * 0.6 * 2.0 * (-2.0 * r).exp() / (2.0 * PI) * (10.0 / f64::from(n))
                })
                .sum()
        };
        // The logarithm at u = 0 is tamed by u = w².
        let m = 400;
        let integral: f64 = (0..m)
            .map(|i| 0.3_f64.sqrt() * (f64::from(i) + 0.5) / f64::from(m))
            .map(|w| strip(w * w) * 2.0 * w * 0.3_f64.sqrt() / f64::from(m))
            .sum();
        let found = edge.at(0.3) - edge.at(0.0);
        assert!((found - integral).abs() < 1e-3, "{found} not {integral}");
    }
}
