//! Newton's rule: the numbers of a stacking that make its albedo what is asked for.

use std::ops::Range;

use super::{
    Answer, Answers, BLACK, Way,
    base::{Base, Below, SHARE},
    mixed_volume,
};
use crate::{
    numeric::{positive_definite, rounding::rounded},
    optics::{LayeredReflection, Mixed, Mixture, Stack, VolumeCoefficients},
};

/// Slopes are taken anew where a step leaves more than this of the square of what was missing.
const STALE: f64 = 0.25;
/// Newton's steps, and the error of ln albedo that ends them. Questions of a run are answered one from the other: with
/// eight times the error corrections of up to 0.4% came to nothing, or to twice as much, and all over a plate alike.
const STEPS: usize = 12;
pub(super) const EXACT: f64 = 0.0005;
/// What misses by more is not answered.
pub(super) const CLOSE: f64 = 0.004;
/// Change of a thickness, as a logarithm, that tells what gives way to it.
const DIFFERENCE: f64 = 1e-6;
/// Against slopes so flat that a step would be without end; more where a step went astray, for part of what is missing
/// is out of reach (Levenberg and Marquardt).
const DAMPINGS: [f64; 3] = [1e-4, 3e-3, 3e-2];
/// A step that leaves more than this of the square of what was missing is none.
const BETTER: f64 = 0.98;

impl Answers {
    /// The numbers that make the albedo what is wanted, from `start` on; `slopes` are those of an answer nearby, and
    /// then of this one.
    pub(super) fn solve(
        &self,
        base: &Base,
        way: Way,
        start: &[f64],
        ln_albedo: &[f64],
        slopes: &mut Option<Vec<Vec<f64>>>,
    ) -> (Vec<f64>, Answer) {
        let goal: Vec<f64> = ln_albedo.iter().map(|ln| libm::exp(*ln).max(BLACK)).collect();
        let missing = |albedo: &[f64]| -> Vec<f64> {
            goal.iter().zip(albedo).map(|(goal, albedo)| libm::log(goal / albedo.max(BLACK))).collect()
        };
        let size = |missing: &[f64]| missing.iter().map(|ln| ln * ln).sum::<f64>();
        let mut numbers = start.to_vec();
        let mut albedo = self.albedo(base, &numbers, way.below);
        let mut off = missing(&albedo);
        for _ in 0..STEPS {
            if off.iter().all(|ln| ln.abs() < EXACT) {
                break;
            }
            let (known, fresh) = match slopes.take() {
                Some(known) => (known, false),
                None => (self.slopes(base, way, &numbers, &albedo), true),
            };
            match self.stepped(base, way, (&numbers, &off, &known), &missing, &size) {
                Some(better) => {
                    *slopes = (size(&better.2) < STALE * size(&off)).then_some(known);
                    (numbers, albedo, off) = better;
                }
                None if fresh => break,
                None => {}
            }
        }
        numbers.iter_mut().chain(&mut albedo).for_each(|value| *value = rounded(*value));
        off = missing(&albedo);
        let mut laid = numbers[..base.layers.len()].to_vec();
        if let (Below::Middle(half), Some(last)) = (way.below, base.last()) {
            laid[last] = rounded(laid[last] + half);
        }
        let layers = base.mixtures(&numbers).zip(laid);
        let stacking = Stack::new(layers).over(Mixture::from(self.core));
        (numbers, Answer { stacking, albedo, short: off })
    }

    /// What ln albedo changes by with every number, in its unit: by number, then channel.
    pub(super) fn slopes(&self, base: &Base, way: Way, numbers: &[f64], albedo: &[f64]) -> Vec<Vec<f64>> {
        let mm = base.thicknesses(numbers, way.below);
        // What is cut off at the middle of a thin part counts no more, and what is there gives way to what grows.
        let grown = |n: usize| -> Vec<f64> {
            let mut moved = numbers.to_vec();
            base.shift(&mut moved, n, DIFFERENCE);
            let moved = base.thicknesses(&moved, way.below);
            moved.iter().zip(&mm).map(|(moved, here)| (moved - here) / DIFFERENCE).collect()
        };
        let grown: Vec<Vec<f64>> = (0..base.layers.len()).map(grown).collect();
        let in_channel = |((model, volumes), albedo): ((&LayeredReflection, &Vec<VolumeCoefficients>), &f64)| {
            let slope = model.slope(&mm, &self.mixed(base, numbers, volumes));
            let thicker = |grown: &Vec<f64>| grown.iter().zip(&slope.per_mm).map(|(mm, per_mm)| mm * per_mm[0]).sum();
            let of_shares = slope.along.iter().flatten().map(|along| SHARE * along[0]);
            let ln = |slope: f64| slope / albedo.max(BLACK);
            grown.iter().map(thicker).chain(of_shares).map(ln).collect()
        };
        let models = self.models[base.model].over(way.below);
        let by_channel: Vec<Vec<f64>> = models.iter().zip(&self.volumes).zip(albedo).map(in_channel).collect();
        (0..numbers.len()).map(|n| by_channel.iter().map(|channel| channel[n]).collect()).collect()
    }

    /// The top layer in a channel, where it may be mixed, with what each share changes of it.
    fn mixed(&self, base: &Base, numbers: &[f64], volumes: &[VolumeCoefficients]) -> Vec<Mixed> {
        let (Some((carrier, others)), Some(top)) = (&base.top, base.mixed_top(numbers)) else { return Vec::new() };
        let parts: Vec<_> =
            [carrier].into_iter().chain(others).map(|resin| (volumes[resin.0], top.share(*resin))).collect();
        let tangents = (1..parts.len()).map(|at| self.grains.slope(&parts, at, 0)).collect();
        vec![Mixed { volume: mixed_volume(self.grains, &top, volumes), tangents }]
    }

    /// A step of Newton's rule that misses less than `here`: numbers, by how much they miss, and slopes; `None` where
    /// none was found.
    fn stepped(
        &self,
        base: &Base,
        way: Way,
        (numbers, off, slopes): (&[f64], &[f64], &[Vec<f64>]),
        missing: &dyn Fn(&[f64]) -> Vec<f64>,
        size: &dyn Fn(&[f64]) -> f64,
    ) -> Option<(Vec<f64>, Vec<f64>, Vec<f64>)> {
        for damping in DAMPINGS {
            let step = self.allowed_step(base, numbers, off, slopes, (way, damping));
            for shorter in [1.0, 0.5, 0.2] {
                let mut next = numbers.to_vec();
                (0..next.len()).for_each(|n| base.shift(&mut next, n, shorter * step[n]));
                self.keep_limits(base, way.below, &mut next);
                let there = self.albedo(base, &next, way.below);
                let left = missing(&there);
                if size(&left) < BETTER * size(off) {
                    return Some((next, there, left));
                }
            }
        }
        None
    }
}

impl Answers {
    /// The least change that makes up for `off`, by numbers that can move the way it asks for: others are left out, and
    /// a top layer that is full gives one resin's place to another. Thicknesses move as easily as `way` says.
    fn allowed_step(
        &self,
        base: &Base,
        numbers: &[f64],
        off: &[f64],
        slopes: &[Vec<f64>],
        (way, damping): (Way, f64),
    ) -> Vec<f64> {
        let units: Vec<f64> = (0..numbers.len()).map(|n| if n < base.layers.len() { way.ease } else { 1.0 }).collect();
        let in_units = |of_number: (&Vec<f64>, &f64)| of_number.0.iter().map(|slope| slope * of_number.1).collect();
        let slopes: Vec<Vec<f64>> = slopes.iter().zip(&units).map(in_units).collect();
        let least_step = |slopes: &[Vec<f64>]| -> Vec<f64> {
            least_step(slopes, off, damping).iter().zip(&units).map(|(step, unit)| step * unit).collect()
        };
        let shares = base.layers.len()..numbers.len();
        let mut moves = vec![true; numbers.len()];
        let mut full = false;
        let mut step = least_step(&slopes);
        for _ in 0..=numbers.len() {
            let mut wanted = numbers.to_vec();
            (0..wanted.len()).for_each(|n| base.shift(&mut wanted, n, 1e-3 * step[n]));
            let filled: f64 = wanted[shares.clone()].iter().map(|share| share.max(0.0)).sum();
            if !full && filled > way.below.most_mixed() {
                full = true;
            } else {
                let mut kept = wanted.clone();
                self.keep_limits(base, way.below, &mut kept);
                let held = |n: &usize| (kept[*n] - wanted[*n]).abs() > 1e-6 * wanted[*n].abs().max(1e-6);
                let left_out: Vec<usize> = (0..numbers.len()).filter(|&n| step[n] != 0.0).filter(held).collect();
                if left_out.is_empty() {
                    break;
                }
                left_out.into_iter().for_each(|n| moves[n] = false);
            }
            step = least_step(&allowed(&slopes, &moves, full.then(|| shares.clone())));
        }
        step
    }
}

/// Slopes of the numbers that move; those in `exchanged` along changes that leave their sum as it is.
fn allowed(slopes: &[Vec<f64>], moves: &[bool], exchanged: Option<Range<usize>>) -> Vec<Vec<f64>> {
    let mut allowed = slopes.to_vec();
    allowed.iter_mut().zip(moves).filter(|(_, moves)| !**moves).for_each(|(slope, _)| slope.fill(0.0));
    let moved: Vec<usize> = exchanged.into_iter().flatten().filter(|&n| moves[n]).collect();
    for channel in 0..slopes.first().map_or(0, Vec::len) {
        let mean = moved.iter().map(|&n| slopes[n][channel]).sum::<f64>() / moved.len().max(1) as f64;
        moved.iter().for_each(|&n| allowed[n][channel] -= mean);
    }
    allowed
}

/// The least change x of numbers with slopesᵀ x = off: slopes (slopesᵀ slopes + damping)⁻¹ off.
fn least_step(slopes: &[Vec<f64>], off: &[f64], damping: f64) -> Vec<f64> {
    let product = |a: usize, b: usize| slopes.iter().map(|slope| slope[a] * slope[b]).sum::<f64>();
    let row =
        |a: usize| -> Vec<f64> { (0..off.len()).map(|b| product(a, b) + if a == b { damping } else { 0.0 }).collect() };
    // Damped it is positive definite; what is no number moves nothing.
    let solved = positive_definite::solve((0..off.len()).map(row).collect(), off.to_vec(), 0.0);
    let solved = solved.unwrap_or_else(|| vec![0.0; off.len()]);
    slopes.iter().map(|slope| slope.iter().zip(&solved).map(|(slope, x)| slope * x).sum()).collect()
}
