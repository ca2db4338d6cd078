//! What counts as alike. All objectives are weighted sums of squares over the coefficients, as equation 5 of Hašan et
//! al. 2010 is, so that bounds, fits and clusters hold for each of them.
//!
//! With coefficients R̂_i, i < n, at evenly spaced frequencies from 0, per channel:
//!
//! | norm | weight of (R̂_i − R̂_t,i)² | |
//! | --- | --- | --- |
//! | natural | ∝ s²/i, DC [`NATURAL_DC`] s² | the error of the lightness under natural light |
//! | L2 | 1 | the paper's |
//! | spatial | ∝ k_i Δk | by Parseval ∫ (R − R_t)² dA = (1/2π) ∫ (R̂ − R̂_t)² k dk |
//! | relative | 1 / mean_j R̂_t,j² | a channel's error as a share of its target |
//!
//! The first, the albedo's, counts `dc_weight` times. A coefficient speaks for the ring of the frequency plane within
//! half a step of it. At k = 0 that is a disc, an eighth of the first ring's area: small, but not the nothing that k dk
//! would have. Spatial weights are scaled to 1 on average.

use super::SearchTarget;
use crate::colour::{difference_parts, lab, lightness_slope};

/// Which errors count how much.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Norm {
    /// The expected square of the error in lightness under natural light.
    #[default]
    Natural,
    /// Every coefficient alike, as in the paper.
    L2,
    /// The square of the error of R(r), integrated over the surface.
    Spatial,
    /// The square of the error in each channel, over the mean square of the channel's target.
    Relative,
}

/// What a search minimises.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Objective {
    /// Which errors count how much.
    pub norm: Norm,
    /// Factor on the weight of the albedo, the first coefficient; finite, ≥ 0.
    pub dc_weight: f64,
}

/// Root mean square of the coefficients below which a channel's target counts as black: relative errors there are taken
/// as shares of this. It is the order of what the models are off by (docs/accuracy.md).
pub(crate) const BLACK_RMS: f64 = 1e-3;

/// Weight of the albedo where the first frequency above it weighs 1 and the i-th 1/i. Over a grid of 128 steps these
/// sum to 5.4: light that varies by a tenth of its mean over the 40 mm that the grid spans. Evidence:
/// docs/objective.md.
const NATURAL_DC: f64 = 500.0;

impl Default for Objective {
    /// Natural light.
    fn default() -> Self {
        Self { norm: Norm::Natural, dc_weight: 1.0 }
    }
}

/// The error of an albedo in three channels, red, green and blue, as eyes see it: CIEDE2000.
///
/// Lightness by channel says enough near the goal. Far from it, where resins do not reach a colour, it does not: of a
/// dark red the channels that should be black weigh a hundred times what the red one does, and black comes out.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ColourError {
    /// The albedo that is asked for.
    pub asked: [f64; 3],
    /// Root of the weight of a unit of CIEDE2000, squared.
    root: f64,
}

/// Step of an albedo for slopes.
const STEP: f64 = 1e-5;

impl ColourError {
    /// Three residuals of an albedo, the sum of whose squares is its part of the objective.
    pub fn residuals(&self, albedo: [f64; 3]) -> [f64; 3] {
        difference_parts(lab(self.asked), lab(albedo)).map(|part| self.root * part)
    }

    /// Their slopes, index `[channel][residual]`.
    pub fn slopes(&self, albedo: [f64; 3]) -> [[f64; 3]; 3] {
        std::array::from_fn(|channel| {
            let moved = |by: f64| {
                let mut albedo = albedo;
                albedo[channel] += by;
                self.residuals(albedo)
            };
            let [more, less] = [STEP, -STEP].map(moved);
            std::array::from_fn(|i| (more[i] - less[i]) / (2.0 * STEP))
        })
    }
}

impl Norm {
    /// Every norm and its name in jobs and at the command line.
    pub const ALL: [(&'static str, Self); 4] =
        [("natural", Self::Natural), ("l2", Self::L2), ("spatial", Self::Spatial), ("relative", Self::Relative)];

    /// Its name in jobs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Natural => "natural",
            Self::L2 => "l2",
            Self::Spatial => "spatial",
            Self::Relative => "relative",
        }
    }
}

impl Objective {
    /// The paper's: every coefficient counts alike.
    pub const L2: Self = Self { norm: Norm::L2, dc_weight: 1.0 };

    /// Weights of one channel of `coefficients` coefficients, whatever the target.
    pub(crate) fn fixed_weights(&self, coefficients: usize) -> Vec<f64> {
        let ring = |i: usize| if i == 0 { 0.125 } else { i as f64 };
        let natural = |i: usize| if i == 0 { NATURAL_DC } else { 1.0 / i as f64 };
        let scaled = |weight: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let scale = coefficients as f64 / (0..coefficients).map(weight).sum::<f64>();
            (0..coefficients).map(|i| scale * weight(i)).collect()
        };
        let mut weights: Vec<f64> = match self.norm {
            Norm::Natural => scaled(&natural),
            Norm::L2 | Norm::Relative => vec![1.0; coefficients],
            Norm::Spatial => scaled(&ring),
        };
        if let Some(dc) = weights.first_mut() {
            *dc *= self.dc_weight;
        }
        weights
    }

    /// Weights of one channel whose coefficients should be `target`.
    pub fn weights(&self, target: &[f64]) -> Vec<f64> {
        let mut weights = self.fixed_weights(target.len());
        let factor = match (self.norm, target.first()) {
            (Norm::Relative, _) => {
                let square: f64 = weights.iter().zip(target).map(|(weight, t)| weight * t * t).sum();
                1.0 / (square / target.len() as f64).max(BLACK_RMS * BLACK_RMS)
            }
            (Norm::Natural, Some(&albedo)) => lightness_slope(albedo).powi(2),
            _ => return weights,
        };
        weights.iter_mut().for_each(|weight| *weight *= factor);
        weights
    }

    /// How much the albedo's colour counts where a fit can follow it; `None` where albedos count channel by channel: of
    /// other norms, and but for three channels.
    pub(crate) fn colour(&self, target: &SearchTarget) -> Option<ColourError> {
        let [r, g, b] = &target.channels[..] else { return None };
        let asked = [r, g, b].map(|channel| channel.first().copied().unwrap_or(0.0));
        let weight = self.fixed_weights(r.len()).first().copied().filter(|weight| *weight > 0.0)?;
        // A grey's error is in three channels.
        (self.norm == Norm::Natural).then(|| ColourError { asked, root: (3.0 * weight).sqrt() / 100.0 })
    }

    /// Σ over channels and coefficients of weight · (R̂ − R̂_t)².
    pub fn of(&self, reflection: &[Vec<f64>], target: &SearchTarget) -> f64 {
        let channel = |(r, t): (&Vec<f64>, &Vec<f64>)| -> f64 {
            let weights = self.weights(t);
            r.iter().zip(t).zip(&weights).map(|((r, t), weight)| weight * (r - t) * (r - t)).sum()
        };
        reflection.iter().zip(&target.channels).map(channel).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{colour::lightness, optics::FrequencyGrid};

    /// An albedo alone off by a little is off by as much in lightness, whatever its size.
    #[test]
    fn natural_errors_are_in_lightness() {
        let objective = Objective::default();
        let dc_share = NATURAL_DC / (NATURAL_DC + (1..128).map(|i| 1.0 / f64::from(i)).sum::<f64>());
        for albedo in [0.002, 0.05, 0.3, 0.9] {
            let target: Vec<f64> = (0..128).map(|i| albedo / f64::from(i + 1)).collect();
            let off = [0.999, 1.0].map(|factor| [vec![factor * albedo], target[1..].to_vec()].concat());
            let [error, none] = off.map(|reflection| {
                objective.of(&[reflection], &SearchTarget { channels: vec![target.clone()] }) / 128.0
            });
            let expected = dc_share * (lightness(albedo) - lightness(0.999 * albedo)).powi(2) / 1e4;
            assert!((error / expected - 1.0).abs() < 2e-3 && none == 0.0, "{albedo}: {error} for {expected}");
        }
    }

    /// R = e^{−r²/2s²}/(2πs²) has R̂ = e^{−k²s²/2}: two of them differ by an integral that is known.
    #[test]
    fn spatial_weights_are_parsevals() {
        let grid = FrequencyGrid::default();
        let gaussian = |s: f64| -> Vec<f64> { grid.as_slice().iter().map(|k| (-k * k * s * s / 2.0).exp()).collect() };
        let spatial = Objective { norm: Norm::Spatial, dc_weight: 1.0 };
        // ∫ (R_a − R_b)² dA = 1/4πa² + 1/4πb² − 1/π(a² + b²)
        let (pi, exact) =
            (std::f64::consts::PI, |a: f64, b: f64| 1.0 / (a * a) + 1.0 / (b * b) - 4.0 / (a * a + b * b));
        let step = grid.as_slice()[1];
        let scale = spatial.weights(&gaussian(1.0))[1] / (step * step / (2.0 * pi));
        for (a, b) in [(0.3, 0.5), (0.25, 1.0), (0.6, 0.7)] {
            let found = spatial.of(&[gaussian(a)], &SearchTarget { channels: vec![gaussian(b)] }) / scale;
            let exact = exact(a, b) / (4.0 * pi);
            assert!((found / exact - 1.0).abs() < 1e-3, "{found} against {exact}");
        }
    }

    #[test]
    fn relative_errors_are_shares_of_the_target() {
        let relative = Objective { norm: Norm::Relative, dc_weight: 1.0 };
        let target = SearchTarget { channels: vec![vec![0.5, 0.3, 0.1], vec![0.05, 0.03, 0.01]] };
        let scaled: Vec<Vec<f64>> =
            target.channels.iter().map(|channel| channel.iter().map(|r| 1.1 * r).collect()).collect();
        // A tenth off everywhere, in the bright channel and the dark one: 0.01 for each of six coefficients.
        assert!((relative.of(&scaled, &target) - 0.06).abs() < 1e-12);
        let black = SearchTarget { channels: vec![vec![0.0; 3]] };
        assert!(relative.of(&[vec![1e-3; 3]], &black) <= 3.0 * (1.0 + 1e-12));
    }

    #[test]
    fn weights_are_one_on_average() {
        for (_, norm) in Norm::ALL {
            let mean = Objective { norm, dc_weight: 1.0 }.fixed_weights(128).iter().sum::<f64>() / 128.0;
            assert!((mean - 1.0).abs() < 1e-12, "{norm:?}: {mean}");
        }
        let dc = |dc_weight| Objective { norm: Norm::Spatial, dc_weight }.fixed_weights(128)[0];
        assert!((dc(10.0) - 10.0 * dc(1.0)).abs() < 1e-12 && dc(1.0) > 0.0);
    }
}
