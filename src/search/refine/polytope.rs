//! What thicknesses a printer and a job allow: linear constraints, and the nearest point that keeps them.

use crate::{
    numeric::{least_squares::dot, positive_definite},
    search::{ResinLimit, SearchOptions},
};

/// a·h ≥ b for the thicknesses h of one sequence of resins.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::search) struct Constraint {
    pub(in crate::search) a: Vec<f64>,
    pub(in crate::search) b: f64,
}

/// All constraints of one sequence of resins.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::search) struct Polytope {
    constraints: Vec<Constraint>,
}

/// Violations below this are rounding, mm.
const TOLERANCE_MM: f64 = 1e-9;
/// A constraint with less slack holds its point.
const ACTIVE: f64 = 1e-7;
/// Constraints that hold together are independent where no pivot of their products is smaller.
const LEAST_PIVOT: f64 = 1e-12;
/// Exchanges of constraints that hold in [`Polytope::exact_step`].
const MAX_EXCHANGES: usize = 60;
/// Sweeps of [`Polytope::step`]; a handful of constraints settles in tens.
const MAX_SWEEPS: usize = 2000;

impl Polytope {
    /// `None` where no thicknesses will do.
    pub(in crate::search) fn new(sequence: &[usize], options: &SearchOptions, min_layer_mm: f64) -> Option<Self> {
        let limit = |resin: usize| options.limits.get(resin).copied().unwrap_or(ResinLimit::NONE);
        let n = sequence.len();
        let above = |last: usize| (0..n).map(|i| if i < last { 1.0 } else { 0.0 }).collect::<Vec<_>>();
        let only = |layer: usize, sign: f64| (0..n).map(|i| if i == layer { sign } else { 0.0 }).collect::<Vec<_>>();
        let mut constraints = Vec::new();
        let mut keep_depth = |layer: usize, resin: usize| {
            let min_depth = limit(resin).min_depth_mm;
            if min_depth > 0.0 {
                constraints.push(Constraint { a: above(layer), b: min_depth });
            }
            layer > 0 || min_depth <= 0.0
        };
        let mut possible = sequence.iter().enumerate().all(|(layer, &resin)| keep_depth(layer, resin));
        if let Some(core) = options.core {
            possible &= keep_depth(n, core.0);
        }
        for (layer, &resin) in sequence.iter().enumerate() {
            let ResinLimit { min_mm, max_mm, .. } = limit(resin);
            let min_mm = min_mm.max(min_layer_mm);
            constraints.push(Constraint { a: only(layer, 1.0), b: min_mm });
            if max_mm.is_finite() {
                constraints.push(Constraint { a: only(layer, -1.0), b: -max_mm });
            }
            possible &= min_mm <= max_mm;
        }
        constraints.push(Constraint { a: vec![-1.0; n], b: -options.max_thickness_mm });
        possible.then_some(Self { constraints })
    }

    /// Of any linear constraints.
    pub(in crate::search) fn of(constraints: Vec<Constraint>) -> Self {
        Self { constraints }
    }

    /// The same as [`Self::step`] by an active-set method on the multipliers (Lawson and Hanson 1974, chapter 23):
    /// exact where numbers hardly matter or are hard to tell apart, and Hildreth's procedure crawls.
    pub(in crate::search) fn exact_step(&self, x: &[f64], inverse: &[Vec<f64>], gradient: &[f64]) -> Option<Vec<f64>> {
        let apply = |v: &[f64]| -> Vec<f64> { inverse.iter().map(|row| dot(row, v)).collect() };
        let free: Vec<f64> = apply(gradient).into_iter().map(|x| -x).collect();
        // Each constraint in the unit in which its own push is 1.
        let scaled = self.constraints.iter().filter_map(|c| {
            let push = apply(&c.a);
            let unit = dot(&c.a, &push).sqrt();
            let by = |v: &[f64]| -> Vec<f64> { v.iter().map(|v| v / unit).collect() };
            (unit > 0.0).then(|| (by(&c.a), by(&push), (c.b - dot(&c.a, x)) / unit))
        });
        let scaled: Vec<_> = scaled.collect();
        let mut multipliers = vec![0.0_f64; scaled.len()];
        let mut holding: Vec<usize> = Vec::new();
        let reached = |multipliers: &[f64]| -> Vec<f64> {
            let mut delta = free.clone();
            for ((_, push, _), multiplier) in scaled.iter().zip(multipliers).filter(|(_, m)| **m > 0.0) {
                delta.iter_mut().zip(push).for_each(|(d, p)| *d += multiplier * p);
            }
            delta
        };
        for _ in 0..MAX_EXCHANGES {
            let delta = reached(&multipliers);
            let lack = |i: usize| scaled[i].2 - dot(&scaled[i].0, &delta);
            let size = 1.0 + scaled.iter().map(|c| c.2.abs()).fold(0.0, f64::max);
            let next = (0..scaled.len()).filter(|i| !holding.contains(i)).max_by(|&a, &b| lack(a).total_cmp(&lack(b)));
            let Some(next) = next.filter(|&next| lack(next) > 1e-12 * size) else {
                // What rounding left outside is brought in.
                let there: Vec<f64> = x.iter().zip(&delta).map(|(x, d)| x + d).collect();
                return match self.contains(&there) {
                    true => Some(delta),
                    false => Some(self.nearest(&there)?.iter().zip(x).map(|(to, from)| to - from).collect()),
                };
            };
            holding.push(next);
            // Multipliers that hold all of them exactly; those that would pull are let go.
            loop {
                let lacks: Vec<f64> = holding.iter().map(|&i| scaled[i].2 - dot(&scaled[i].0, &free)).collect();
                let matrix =
                    holding.iter().map(|&i| holding.iter().map(|&j| dot(&scaled[i].0, &scaled[j].1)).collect());
                let Some(wanted) = positive_definite::solve(matrix.collect(), lacks, LEAST_PIVOT) else {
                    holding.retain(|&i| i != next);
                    break;
                };
                let back = holding.iter().zip(&wanted).filter(|(_, wanted)| **wanted <= 0.0);
                let share = back.map(|(&i, wanted)| multipliers[i] / (multipliers[i] - wanted)).fold(1.0, f64::min);
                for (&i, wanted) in holding.iter().zip(&wanted) {
                    multipliers[i] += share * (wanted - multipliers[i]);
                }
                if share >= 1.0 {
                    break;
                }
                holding.retain(|&i| multipliers[i] > 1e-14);
                for (i, multiplier) in multipliers.iter_mut().enumerate() {
                    if !holding.contains(&i) {
                        *multiplier = 0.0;
                    }
                }
            }
            if !holding.contains(&next) && multipliers[next] == 0.0 && lack(next) > 1e-9 * size {
                // It depends on others that hold already: nothing keeps all.
                return self.step(x, inverse, gradient);
            }
        }
        self.step(x, inverse, gradient)
    }

    /// The nearest point within, in the plain distance.
    pub(in crate::search) fn nearest(&self, x: &[f64]) -> Option<Vec<f64>> {
        let n = x.len();
        let identity: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
        let step = self.step(x, &identity, &vec![0.0; n])?;
        Some(x.iter().zip(step).map(|(x, d)| x + d).collect())
    }

    /// The constraints that hold with no slack at `x`.
    pub(in crate::search) fn active(&self, x: &[f64]) -> impl Iterator<Item = &Constraint> {
        self.constraints.iter().filter(move |c| dot(&c.a, x) <= c.b + ACTIVE)
    }

    /// The same with one layer of a given thickness.
    pub(in crate::search) fn with_fixed(&self, layer: usize, mm: f64) -> Self {
        let mut fixed = self.with_least(layer, mm);
        fixed.constraints.push(fixed.only(layer, -1.0, -mm));
        fixed
    }

    /// The same with one layer of a given thickness or more.
    pub(in crate::search) fn with_least(&self, layer: usize, mm: f64) -> Self {
        let mut limited = self.clone();
        limited.constraints.push(self.only(layer, 1.0, mm));
        limited
    }

    fn only(&self, layer: usize, sign: f64, b: f64) -> Constraint {
        let n = self.constraints.first().map_or(0, |constraint| constraint.a.len());
        Constraint { a: (0..n).map(|i| if i == layer { sign } else { 0.0 }).collect(), b }
    }

    /// Whether `mm` keeps all constraints.
    pub(in crate::search) fn contains(&self, mm: &[f64]) -> bool {
        self.constraints.iter().all(|c| dot(&c.a, mm) >= c.b - TOLERANCE_MM)
    }

    /// The step δ of least ½ δᵀHδ + gᵀδ for which `mm` + δ keeps all constraints, with H⁻¹ given: Hildreth's procedure,
    /// coordinate ascent on the multipliers. `None` where it does not settle: then nothing keeps them.
    pub(in crate::search) fn step(&self, mm: &[f64], inverse: &[Vec<f64>], gradient: &[f64]) -> Option<Vec<f64>> {
        let apply = |v: &[f64]| -> Vec<f64> { inverse.iter().map(|row| dot(row, v)).collect() };
        let mut delta: Vec<f64> = apply(gradient).into_iter().map(|x| -x).collect();
        let pushes: Vec<Vec<f64>> = self.constraints.iter().map(|c| apply(&c.a)).collect();
        let mut multipliers = vec![0.0_f64; self.constraints.len()];
        for _ in 0..MAX_SWEEPS {
            let mut moved = 0.0_f64;
            for ((constraint, push), multiplier) in self.constraints.iter().zip(&pushes).zip(&mut multipliers) {
                let stiffness = dot(&constraint.a, push);
                if stiffness <= 0.0 {
                    continue;
                }
                let lack = constraint.b - dot(&constraint.a, mm) - dot(&constraint.a, &delta);
                let change = (lack / stiffness).max(-*multiplier);
                *multiplier += change;
                for (d, p) in delta.iter_mut().zip(push) {
                    *d += change * p;
                    moved = moved.max((change * p).abs());
                }
            }
            if moved < 0.1 * TOLERANCE_MM {
                let there: Vec<f64> = mm.iter().zip(&delta).map(|(h, d)| h + d).collect();
                return self.contains(&there).then_some(delta);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::ResinId;

    fn options() -> SearchOptions {
        let free = ResinLimit::NONE;
        let limits = vec![free, ResinLimit { min_depth_mm: 0.2, ..free }, ResinLimit { max_mm: 1.0, ..free }];
        SearchOptions { max_thickness_mm: 3.0, limits, core: Some(ResinId(2)), ..SearchOptions::default() }
    }

    #[test]
    fn the_nearest_point_keeps_every_limit() {
        let polytope = Polytope::new(&[0, 1, 2], &options(), 0.03).unwrap();
        for (from, to) in [
            ([0.5, 1.0, 0.5], [0.5, 1.0, 0.5]),
            ([0.1, 1.0, 0.5], [0.2, 1.0, 0.5]),
            ([0.5, -1.0, 1.5], [0.5, 0.03, 1.0]),
            ([2.0, 2.0, 0.5], [1.5, 1.5, 0.03]),
        ] {
            let found = polytope.nearest(&from).unwrap();
            assert!(polytope.contains(&found), "{found:?}");
            if from[0] < 2.0 {
                assert!(found.iter().zip(to).all(|(a, b)| (a - b).abs() < 1e-8), "{from:?}: {found:?}");
            } else {
                assert!((found.iter().sum::<f64>() - 3.0).abs() < 1e-8, "{found:?}");
            }
        }
    }

    #[test]
    fn support_on_top_has_no_room() {
        assert_eq!(Polytope::new(&[1, 0], &options(), 0.03), None);
        assert_eq!(Polytope::new(&[2], &options(), 1.5), None);
    }

    /// Both ways to the constrained minimum agree where the slower one settles.
    #[test]
    fn exact_steps_are_steps() {
        let polytope = Polytope::new(&[0, 1, 2], &options(), 0.03).unwrap();
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        };
        for _ in 0..200 {
            let factor: Vec<Vec<f64>> = (0..3).map(|_| (0..3).map(|_| random()).collect()).collect();
            let product = |i: usize, j: usize| dot(&factor[i], &factor[j]) + if i == j { 0.01 } else { 0.0 };
            let inverse: Vec<Vec<f64>> = (0..3).map(|i| (0..3).map(|j| product(i, j)).collect()).collect();
            let gradient: Vec<f64> = (0..3).map(|_| 20.0 * random()).collect();
            let x = [0.5, 1.0, 0.5];
            let (slow, exact) = (polytope.step(&x, &inverse, &gradient), polytope.exact_step(&x, &inverse, &gradient));
            let (slow, exact) = (slow.unwrap(), exact.unwrap());
            assert!(slow.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-6), "{slow:?} against {exact:?}");
        }
    }
}
