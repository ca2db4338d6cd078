//! What thicknesses a printer and a job allow: linear constraints, and the nearest point that keeps them.

use crate::{
    numeric::least_squares::dot,
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
        let n = self.constraints.first().map_or(0, |constraint| constraint.a.len());
        let only = |sign: f64| (0..n).map(|i| if i == layer { sign } else { 0.0 }).collect();
        let mut fixed = self.clone();
        fixed.constraints.extend([Constraint { a: only(1.0), b: mm }, Constraint { a: only(-1.0), b: -mm }]);
        fixed
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
}
