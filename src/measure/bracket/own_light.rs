//! What keeps numbers from being proportional to the time: light that one exposure has alone, a black level that is
//! not theirs, a curve they were written through.
//!
//! Of two exposures a and b of one scene, a = α + ρ b in every pixel: ρ is the ratio of their times, α what is not
//! light of the scene. With c the constant in each exposure, α = c_a − ρ c_b. A wrong time changes ρ alone, light in
//! one exposure its c alone, a wrong black level all c alike; c in proportion to the times is light of the scene (a
//! level, taken off later). A curve like x^γ leaves the ratio constant and turns all times into t^γ; sRGB's, a power
//! above a straight foot, moves black as well.

use super::consistency::{Link, Settling};
use super::{Sensor, Survey};

/// Fewest exposures a majority is made of.
const MIN_EXPOSURES: usize = 4;
/// Constants are told from this share of the range on…
const NAMED_SHARE: f64 = 0.005;
/// …and this many standard errors.
const NAMED_SIGMAS: f64 = 6.0;
/// Times that grow like another power of their labels are told from this exponent's distance to 1 on: nominal times
/// (1/15 is 1/16) are off by 7% at random, which over a factor of 450 is 0.02.
const NAMED_POWER: f64 = 0.04;
/// A power explains the times if it leaves this share of what they are off by.
const EXPLAINED: f64 = 0.35;

/// y = α + ρ x over the shared pixels of a link.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub alpha: f64,
    pub alpha_variance: f64,
    pub rho: f64,
}

impl Line {
    /// By weighted least squares in two rounds, the second without what is 4 σ off.
    pub fn through(x: &[f64], y: &[f64], ratio: f64, sensor: &Sensor) -> Option<Self> {
        let weight = |k: usize| 1.0 / (sensor.variance(y[k]) + ratio * ratio * sensor.variance(x[k]));
        let mut limit = f64::INFINITY;
        let mut line = None;
        for _ in 0..2 {
            let (mut w, mut wx, mut wy, mut wxx, mut wxy, mut n) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
            for k in 0..x.len() {
                let off = line.map_or(0.0, |line: Self| y[k] - line.alpha - line.rho * x[k]);
                let weight = weight(k);
                if off * off * weight > limit {
                    continue;
                }
                (w, wx, wy) = (w + weight, wx + weight * x[k], wy + weight * y[k]);
                (wxx, wxy, n) = (wxx + weight * x[k] * x[k], wxy + weight * x[k] * y[k], n + 1.0);
            }
            let determinant = w * wxx - wx * wx;
            if !(determinant > 1e-6 * w * wxx) || n < 8.0 {
                return None;
            }
            let found = Self {
                alpha: (wxx * wy - wx * wxy) / determinant,
                alpha_variance: 0.0,
                rho: (w * wxy - wx * wy) / determinant,
            };
            let mut squares: Vec<f64> =
                (0..x.len()).map(|k| (y[k] - found.alpha - found.rho * x[k]).powi(2) * weight(k)).collect();
            // The median of χ² with one degree of freedom is 0.4549.
            let chi = (super::consistency::median(&mut squares) / 0.4549).max(1.0);
            limit = 16.0 * chi;
            line = Some(Self { alpha_variance: chi * wxx / determinant, ..found });
        }
        line
    }
}

/// What is not proportional to the time.
#[derive(Debug, Clone, Default)]
pub(super) struct OwnLight {
    /// Exposures with light of their own (by index), DN.
    pub lit: Vec<(usize, f64)>,
    /// The number of no light over the black level that was used, DN, where it is told from 0.
    pub black_off: Option<f64>,
}

impl OwnLight {
    /// From the links of a survey; `seconds` are the exposures' true times as far as they are known.
    pub fn of(survey: &Survey, sensor: &Sensor, links: &[Link], seconds: &[f64]) -> Self {
        let count = survey.windows.len();
        let linked: Vec<usize> =
            (0..count).filter(|&k| links.iter().any(|link| link.joins(k) && link.line.is_some())).collect();
        if linked.len() < MIN_EXPOSURES {
            return Self::default();
        }
        let (constants, errors) = constants(count, links);
        let range = if sensor.clipped.is_finite() { sensor.clipped } else { f64::from(survey.top()) } - sensor.black;
        let Some([level, rate]) = majority(&linked, &constants, seconds) else { return Self::default() };
        let least = |k: usize| (NAMED_SHARE * range).max(NAMED_SIGMAS * errors[k]);
        let off = |k: usize| constants[k] - level - rate * seconds[k];
        let lit: Vec<(usize, f64)> =
            linked.iter().map(|&k| (k, off(k))).filter(|(k, off)| off.abs() > least(*k)).collect();
        let usual = linked.iter().map(|&k| errors[k]).fold(f64::INFINITY, f64::min);
        let black_off = (level.abs() > (NAMED_SHARE * range).max(NAMED_SIGMAS * usual)).then_some(level);
        if 2 * lit.len() > linked.len() {
            // No majority: whatever this is, it is not light in some exposures.
            return Self { lit: Vec::new(), black_off };
        }
        Self { lit, black_off }
    }
}

/// c of every exposure by least squares over α = c_a − ρ c_b (Gauss–Seidel), and the error its links leave.
fn constants(count: usize, links: &[Link]) -> (Vec<f64>, Vec<f64>) {
    // Constants that grow like the times fit everything: they are held near 0.
    let settling = Settling { sweeps: 3000, least: 1e-6, held: 1e-6 };
    let (values, weights) = settling.run(count, |k, values| {
        let (mut sum, mut weight) = (0.0, 0.0);
        for link in links {
            let Some(line) = link.line else { continue };
            let w = 1.0 / line.alpha_variance;
            if link.i == k {
                sum += w * (line.alpha + line.rho * values[link.j]);
                weight += w;
            } else if link.j == k {
                sum += w * line.rho * (values[link.i] - line.alpha);
                weight += w * line.rho * line.rho;
            }
        }
        (sum, weight)
    });
    let errors = weights.iter().map(|weight| 1.0 / weight.sqrt()).collect();
    (values, errors)
}

/// c = level + rate · t for most: the line through two of the points that leaves the least sum of distances.
fn majority(linked: &[usize], constants: &[f64], seconds: &[f64]) -> Option<[f64; 2]> {
    let pairs = linked.iter().enumerate().flat_map(|(n, &i)| linked[n + 1..].iter().map(move |&j| (i, j)));
    let lines = pairs.filter(|&(i, j)| seconds[i] != seconds[j]).map(|(i, j)| {
        let rate = (constants[j] - constants[i]) / (seconds[j] - seconds[i]);
        [constants[i] - rate * seconds[i], rate]
    });
    let left =
        |[level, rate]: [f64; 2]| linked.iter().map(|&k| (constants[k] - level - rate * seconds[k]).abs()).sum::<f64>();
    lines.map(|line| (left(line), line)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1)
}

/// The power of the labels that the true times grow like, if it is not 1 and explains what they are off by: a curve
/// that the numbers were written through.
pub(super) fn power(labels: &[f64], log_times: &[f64], linked: &[bool]) -> Option<f64> {
    let all: Vec<(f64, f64)> = (0..labels.len())
        .filter(|&k| linked[k])
        .map(|k| (libm::log(labels[k]), libm::log(labels[k]) + log_times[k]))
        .collect();
    if all.len() < MIN_EXPOSURES {
        return None;
    }
    let pairs = all.iter().enumerate().flat_map(|(n, a)| all[n + 1..].iter().map(move |b| (b.0 - a.0, b.1 - a.1)));
    let mut slopes: Vec<f64> = pairs.filter(|(x, _)| x.abs() > 0.1).map(|(x, y)| y / x).collect();
    if slopes.is_empty() {
        return None;
    }
    let power = super::consistency::median(&mut slopes);
    let spread = |power: f64| {
        let mut off: Vec<f64> = all.iter().map(|(x, y)| y - power * x).collect();
        let middle = super::consistency::median(&mut off);
        off.iter_mut().for_each(|off| *off = (*off - middle).abs());
        super::consistency::median(&mut off)
    };
    ((power - 1.0).abs() > NAMED_POWER && spread(power) < EXPLAINED * spread(1.0)).then_some(power)
}
