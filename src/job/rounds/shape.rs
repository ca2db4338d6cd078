//! What the shape of an object around a point does to its print there.
//!
//! Beside an edge light finds its way out sooner, through a thin part it comes from behind, in a hollow it is sent back:
//! the print is lighter or darker than a flat slab of the same layers, by up to half, within a fraction of a
//! millimetre. Few walks end there, too few to tell. But places of like shape miss alike, and there are thousands of
//! points: what all of them miss is fitted by functions of the shape, and only what is left is told apart by where it
//! lies.
//!
//! Shape is what light meets: the mean of exp(−d/ℓ) over the ways d out of the print, weighted with the cosine to the
//! surface's normal, for a few lengths ℓ. It is 0 under a plane, and 1 at the tip of a needle. With the share of the
//! sky that is hidden, that is taken once and squared, and both times the albedo: less is lost of a light resin.

use super::super::look::shade;
use crate::{
    look::{Scene, Site},
    numeric::positive_definite,
};

/// Lengths ℓ, mm.
const LENGTHS_MM: [f64; 5] = [0.15, 0.3, 0.6, 1.2, 2.5];
/// Longest way that is followed, mm.
const FARTHEST_MM: f64 = 5.0;
const SHAPE: usize = LENGTHS_MM.len() + 1;
/// Terms of the fit: a constant, each number of a shape and its square, and these times the albedo.
const TERMS: usize = 1 + 4 * SHAPE;
/// Relative error of the fit itself: beside it noise below counts little.
const OWN_ERROR: f64 = 0.05;
/// Pulls coefficients to 0 that points do not tell, by this share of their weight.
const RIDGE: f64 = 1e-4;
/// Printed over asked is fitted within these, and said to be within these.
const RATIOS: [f64; 2] = [0.25, 4.0];

/// The shape around a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape([f64; SHAPE]);

impl Shape {
    /// At a site of the surface that sees a share of the `sky`; rays are turned by `turn`, 0 to 1.
    pub fn new(scene: &Scene, site: &Site, sky: f64, turn: f64) -> Self {
        let inwards = Site { normal: -site.normal, ..*site };
        let from = site.point - site.normal * scene.volume().lattice().pitch.length();
        let mut shape = [0.0; SHAPE];
        for direction in shade::directions(&inwards, turn) {
            let way = scene.way_out(from, direction, FARTHEST_MM);
            for (mean, length) in shape.iter_mut().zip(LENGTHS_MM) {
                *mean += libm::exp(-way / length) / shade::RAYS as f64;
            }
        }
        shape[SHAPE - 1] = 1.0 - sky;
        Self(shape)
    }

    fn terms(&self, albedo: f64) -> [f64; TERMS] {
        let mut terms = [1.0; TERMS];
        for (n, &value) in self.0.iter().enumerate() {
            terms[1 + 4 * n..5 + 4 * n].copy_from_slice(&[
                value,
                value * value,
                value * albedo,
                value * value * albedo,
            ]);
        }
        terms
    }
}

/// A look at a place of a shape.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub shape: Shape,
    /// Albedo that is asked for there.
    pub asked: f64,
    /// Albedo that is printed, and the square of its standard error.
    pub printed: f64,
    pub variance: f64,
}

/// Printed over asked, as a function of shape and albedo.
#[derive(Debug, Clone)]
pub(super) struct ByShape(Vec<f64>);

impl ByShape {
    /// Fitted to `samples`; 1 everywhere where they are fewer than tell.
    pub fn fit(samples: &[Sample]) -> Self {
        let none = vec![0.0; TERMS];
        let [least, most] = RATIOS;
        let (mut matrix, mut right) = (vec![none.clone(); TERMS], none.clone());
        let mut total = 0.0;
        for sample in samples.iter().filter(|sample| sample.asked > 0.0) {
            let terms = sample.shape.terms(sample.asked);
            let missed = (sample.printed / sample.asked).clamp(least, most) - 1.0;
            let weight = 1.0 / (sample.variance / (sample.asked * sample.asked) + OWN_ERROR * OWN_ERROR);
            total += weight;
            for (row, (right, term)) in matrix.iter_mut().zip(right.iter_mut().zip(terms)) {
                row.iter_mut().zip(terms).for_each(|(sum, other)| *sum += weight * term * other);
                *right += weight * term * missed;
            }
        }
        if samples.len() < 4 * TERMS {
            return Self(none);
        }
        matrix.iter_mut().enumerate().for_each(|(n, row)| row[n] += RIDGE * total);
        Self(positive_definite::solve(matrix, right, 0.0).unwrap_or(none))
    }

    /// Printed over asked at a place of a shape.
    pub fn ratio(&self, shape: &Shape, asked: f64) -> f64 {
        let [least, most] = RATIOS;
        let missed: f64 = self.0.iter().zip(shape.terms(asked)).map(|(factor, term)| factor * term).sum();
        (1.0 + missed).clamp(least, most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(thin: f64, asked: f64, noise: f64) -> Sample {
        let mut shape = [0.0; SHAPE];
        shape[..LENGTHS_MM.len()].iter_mut().enumerate().for_each(|(n, value)| *value = thin.powi(n as i32 + 1));
        let printed = asked * (1.0 + 0.4 * thin * (1.0 - asked)) * (1.0 + noise);
        Sample { shape: Shape(shape), asked, printed, variance: (asked * noise).powi(2) }
    }

    #[test]
    fn what_shapes_have_in_common_is_found_under_noise() {
        let samples: Vec<Sample> = (0..3000)
            .map(|n| {
                let part = |step: f64| (f64::from(n) * step).fract();
                let noise = if n % 2 == 0 { 0.1 } else { -0.1 };
                sample(part(0.618), 0.1 + 0.5 * part(0.755), noise)
            })
            .collect();
        let fit = ByShape::fit(&samples);
        for (thin, asked) in [(0.0, 0.3), (0.5, 0.2), (0.9, 0.5)] {
            let exact = 1.0 + 0.4 * thin * (1.0 - asked);
            let found = fit.ratio(&sample(thin, asked, 0.0).shape, asked);
            assert!((found - exact).abs() < 0.02, "{thin} {asked}: {found} for {exact}");
        }
    }

    #[test]
    fn few_samples_say_nothing() {
        let samples: Vec<Sample> = (0..20).map(|n| sample(f64::from(n) / 20.0, 0.3, 0.0)).collect();
        assert_eq!(ByShape::fit(&samples).ratio(&samples[7].shape, 0.3), 1.0);
    }
}
