//! How far two pictures of radiosity are apart.

use serde::Serialize;

/// Differences of a picture from another, over all texels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Difference {
    /// Mean of found − goal.
    pub bias: f64,
    /// Root mean square of found − goal, what the noise of photons adds taken off.
    pub rms: f64,
    /// The same over the root mean square of the goal.
    pub relative_rms: f64,
    /// Pearson's correlation, the noise of photons taken off; `None` where either is the same everywhere.
    pub correlation: Option<f64>,
    /// Root mean square of the noise of photons; 0 where there is none.
    pub noise: f64,
}

impl Difference {
    /// `noise` holds one standard deviation of each value found, if known.
    pub fn new(found: &[f32], goal: &[f32], noise: Option<&[f32]>) -> Self {
        let n = found.len() as f64;
        let mean = |values: &[f32]| values.iter().map(|&value| f64::from(value)).sum::<f64>() / n;
        let (mean_found, mean_goal) = (mean(found), mean(goal));
        let pairs = || found.iter().zip(goal).map(|(&a, &b)| (f64::from(a), f64::from(b)));
        let noise = noise.map_or(0.0, |sigma| sigma.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>() / n);
        let square = (pairs().map(|(a, b)| (a - b).powi(2)).sum::<f64>() / n - noise).max(0.0);
        let variance = |mean: f64, of: fn((f64, f64)) -> f64| pairs().map(|p| (of(p) - mean).powi(2)).sum::<f64>() / n;
        let (var_found, var_goal) = (variance(mean_found, |p| p.0) - noise, variance(mean_goal, |p| p.1));
        let covariance = pairs().map(|(a, b)| (a - mean_found) * (b - mean_goal)).sum::<f64>() / n;
        let varies = |variance: f64, mean: f64| variance > (1e-6 * mean).powi(2);
        let both = varies(var_found, mean_found) && varies(var_goal, mean_goal);
        let rms_goal = (var_goal + mean_goal * mean_goal).sqrt();
        Self {
            bias: mean_found - mean_goal,
            rms: square.sqrt(),
            relative_rms: if rms_goal > 0.0 { square.sqrt() / rms_goal } else { 0.0 },
            correlation: both.then(|| (covariance / (var_found * var_goal).sqrt()).clamp(-1.0, 1.0)),
            noise: noise.sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_taken_off() {
        // Alternating ±0.1 is noise of 0.1 rms that no average notices.
        let goal: Vec<f32> = (0..400).map(|i| (i / 100) as f32).collect();
        let found: Vec<f32> =
            goal.iter().enumerate().map(|(i, v)| v + 0.5 + if i % 2 == 0 { 0.1 } else { -0.1 }).collect();
        let apart = Difference::new(&found, &goal, Some(&[0.1; 400]));
        assert!((apart.bias - 0.5).abs() < 1e-6 && (apart.rms - 0.5).abs() < 1e-6 && (apart.noise - 0.1).abs() < 1e-6);
        assert!((apart.correlation.unwrap() - 1.0).abs() < 1e-6);
        let raw = Difference::new(&found, &goal, None);
        assert!((raw.rms - 0.26_f64.sqrt()).abs() < 1e-6 && raw.correlation.unwrap() < 1.0);
        assert_eq!(Difference::new(&found, &[1.0; 400], None).correlation, None);
        let same = Difference::new(&goal, &goal, None);
        assert_eq!((same.bias, same.rms, same.relative_rms), (0.0, 0.0, 0.0));
    }
}
