//! How far single places are from what was asked for, and how that spreads.
//!
//! A look's walks have noise, and noise alone is a difference: squares of the two add up. So the noise that is expected
//! is taken off each square. What is above the noise is then right on the mean over places; what is below it stays too
//! large, for no square is less than 0. Of one place it is a guess, as its printed albedo is.

use super::{Differences, Fit, SpotRecord, Spread};
use crate::{
    colour::{delta_e_2000, lab},
    optics::Estimate,
};

/// Shares are of no less than this albedo: what is off by a share of black tells nothing.
const DARKEST: f64 = 0.05;

/// ΔE2000 between an albedo that is asked for and one that is printed; `None` unless there are three channels.
pub(super) fn of_colours(asked: &[f64], printed: &[Estimate]) -> Option<f64> {
    let asked = lab(asked.try_into().ok()?);
    let mean: [f64; 3] = printed.iter().map(|channel| channel.mean).collect::<Vec<_>>().try_into().ok()?;
    let here = lab(mean);
    let noise = |channel: usize| {
        let mut there = mean;
        there[channel] += printed[channel].standard_error;
        delta_e_2000(here, lab(there)).powi(2)
    };
    Some(without_noise(delta_e_2000(asked, here).powi(2), (0..3).map(noise).sum()))
}

/// How far a spot is from `goal`, as a share of that, or of an albedo of 0.05 where it is darker.
pub(super) fn share_off(spot: &SpotRecord, goal: &[f64]) -> f64 {
    let squares = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
    let apart = squares(&mut spot.printed.iter().zip(goal).map(|(printed, goal)| printed - goal));
    let noise = squares(&mut spot.standard_error.iter().copied());
    without_noise(apart, noise) / squares(&mut goal.iter().copied()).sqrt().max(DARKEST)
}

/// A difference, from its square as seen and the square that noise adds to it on average.
fn without_noise(seen: f64, noise: f64) -> f64 {
    (seen - noise).max(0.0).sqrt()
}

impl Differences {
    /// `None` of none.
    pub(super) fn of(mut differences: Vec<f64>) -> Option<Self> {
        differences.sort_by(f64::total_cmp);
        let Spread { median, ninety_five_percent } = Spread::of(&differences)?;
        Some(Self {
            median,
            ninety_percent: percentile(&differences, 90)?,
            ninety_five_percent: Some(ninety_five_percent),
            worst: *differences.last()?,
        })
    }
}

impl Spread {
    /// Of ascending numbers; `None` of none.
    fn of(ascending: &[f64]) -> Option<Self> {
        Some(Self { median: percentile(ascending, 50)?, ninety_five_percent: percentile(ascending, 95)? })
    }

    /// How far spots are from what was asked for, as shares of that; `None` of no spots.
    pub(super) fn of_spots(spots: &[&SpotRecord], asked: &[Vec<f64>]) -> Option<Self> {
        let mut shares: Vec<f64> = spots.iter().zip(asked).map(|(spot, asked)| share_off(spot, asked)).collect();
        shares.sort_by(f64::total_cmp);
        Self::of(&shares)
    }
}

/// The number that so many percent of ascending ones lie below; `None` of none.
fn percentile(ascending: &[f64], percent: usize) -> Option<f64> {
    ascending.get((ascending.len() * percent / 100).min(ascending.len().max(1) - 1)).copied()
}

/// Printed against expected in each channel.
pub(super) fn fits(spots: &[&SpotRecord], expected: &[Vec<f64>], channels: usize) -> Vec<Fit> {
    let values = |channel: usize| {
        let value = move |(spot, expected): (&&SpotRecord, &Vec<f64>)| {
            [spot.printed[channel], spot.standard_error[channel], expected[channel]]
        };
        Fit::of(spots.iter().zip(expected).map(value))
    };
    (0..channels).map(values).collect()
}

impl Fit {
    /// Of what is printed, its standard error and what is expected.
    pub(super) fn of(values: impl Iterator<Item = [f64; 3]>) -> Self {
        let (mut n, mut bias, mut squared, mut noise, mut level) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for [printed, error, expected] in values {
            let apart: f64 = printed - expected;
            n += 1.0;
            bias += apart;
            squared += apart * apart;
            noise += error * error;
            level += expected * expected;
        }
        let rms = ((squared - noise).max(0.0) / f64::max(n, 1.0)).sqrt();
        let level = (level / f64::max(n, 1.0)).sqrt();
        let relative_rms = if level > 0.0 { rms / level } else { 0.0 };
        Self { bias: bias / f64::max(n, 1.0), rms, relative_rms }
    }
}

#[cfg(test)]
mod tests {
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    use super::*;
    use crate::optics::monte_carlo::photon::uniform;

    /// Colours of one distance, seen through noise half as large to twice as large.
    #[test]
    fn noise_does_not_count_as_a_difference() {
        let asked = [0.36, 0.25, 0.32];
        for off in [0.0, 0.02] {
            let printed = asked.map(|albedo| albedo * (1.0 + off));
            let told = delta_e_2000(lab(asked), lab(printed));
            for noise in [0.005, 0.02] {
                let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
                let mut noisy = || (0..12).map(|_| uniform(&mut rng)).sum::<f64>() - 6.0;
                let mut seen = || {
                    let seen = |albedo: &f64| {
                        let standard_error = noise * albedo;
                        Estimate { mean: albedo + standard_error * noisy(), standard_error }
                    };
                    let seen: Vec<Estimate> = printed.iter().map(seen).collect();
                    of_colours(&asked, &seen).unwrap().powi(2)
                };
                let n = 4000;
                let mean = (0..n).map(|_| seen()).sum::<f64>() / f64::from(n);
                let alone = |channel: usize| {
                    let mut seen = printed;
                    seen[channel] *= 1.0 + noise;
                    delta_e_2000(lab(printed), lab(seen)).powi(2)
                };
                // What is cut off at 0 leaves some of it.
                let most = 0.1 * told * told + 0.5 * (0..3).map(alone).sum::<f64>();
                assert!((mean - told * told).abs() < most, "{off} {noise}: {mean} {}", told * told);
            }
        }
    }

    #[test]
    fn percentiles_are_values_that_occur() {
        let ascending: Vec<f64> = (0..200).map(f64::from).collect();
        let found = Differences::of(ascending).unwrap();
        assert_eq!((found.median, found.ninety_percent, found.worst), (100.0, 180.0, 199.0));
        assert!(Differences::of(Vec::new()).is_none());
    }
}
