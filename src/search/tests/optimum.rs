//! The optimum: against brute force, and against Algorithm 1 as printed.

use super::resins::*;
use crate::optics::{KubelkaMunk, MaterialSet, Resin, ResinId, Stack};
use crate::search::{algorithm_1::algorithm_1, branch_and_bound::match_target, forward::reflection_of, *};
use crate::watch::Unwatched;

/// Every stacking of at most `depth` blocks, without any bound: (objective, layers in units), core's tail removed.
fn brute_force(resins: &[Vec<KubelkaMunk>], options: &SearchOptions, target: &SearchTarget) -> Option<f64> {
    let unit = options.unit_mm();
    let n = options.units;
    let mut best = None::<f64>;
    // Runs of whole units; a run of u units costs as many blocks as u has ones.
    let mut open: Vec<Vec<(usize, usize)>> = vec![vec![]];
    while let Some(runs) = open.pop() {
        let total: usize = runs.iter().map(|run| run.1).sum();
        let blocks: u32 = runs.iter().map(|run| run.1.count_ones()).sum();
        let layers = runs.iter().map(|&(resin, units)| (ResinId(resin), units as f64 * unit));
        let stacking = Stack::joined(layers).over(options.core);
        if keeps_limits(&stacking, options) {
            let value = options.objective.of(&reflection_of(resins, &stacking), target);
            best = Some(best.map_or(value, |b| b.min(value)));
        }
        for resin in (0..resins.len()).filter(|resin| runs.last().is_none_or(|run| run.0 != *resin)) {
            for units in (1..=n - total).filter(|units| blocks + units.count_ones() <= options.depth as u32) {
                open.push(runs.iter().copied().chain([(resin, units)]).collect());
            }
        }
    }
    best
}

/// The limits in words, straight from millimetres.
pub(super) fn keeps_limits(stacking: &Stack, options: &SearchOptions) -> bool {
    let mut depth = 0.0;
    let core = options.core;
    let layers = &stacking.layers;
    let fits = layers.iter().enumerate().all(|(i, layer)| {
        let limit = options.limits.get(layer.resin.0).copied().unwrap_or(ResinLimit::NONE);
        let merges = i + 1 == layers.len() && core == Some(layer.resin);
        let h = layer.thickness_mm;
        let deep = depth >= limit.min_depth_mm - 1e-9;
        depth += h;
        deep && (merges || (h >= limit.min_mm - 1e-9 && h <= limit.max_mm + 1e-9))
    });
    let core_deep = core.is_none_or(|core| {
        let top = if layers.last().is_some_and(|l| l.resin == core) {
            depth - layers[layers.len() - 1].thickness_mm
        } else {
            depth
        };
        top >= options.limits.get(core.0).map_or(0.0, |limit| limit.min_depth_mm) - 1e-9
    });
    fits && core_deep
}

fn limits(resins: usize, of: &[(ResinId, f64, f64, f64)]) -> Vec<ResinLimit> {
    let mut limits = vec![ResinLimit::NONE; resins];
    for &(resin, min_depth_mm, min_mm, max_mm) in of {
        limits[resin.0] = ResinLimit { min_depth_mm, min_mm, max_mm };
    }
    limits
}

fn assert_same(a: f64, b: f64, what: &str) {
    assert!((a - b).abs() <= 1e-9 * (a.abs() + b.abs()) + 1e-13, "{what}: {a:e} against {b:e}");
}

#[test]
fn equals_brute_force_at_depth_3() {
    let resins = three_resins();
    let none = f64::INFINITY;
    let spaces = [
        (None, vec![]),
        (Some(BLACK), vec![]),
        (Some(BLACK), limits(3, &[(SUPPORT, 0.6, 0.0, none)])),
        (Some(SUPPORT), limits(3, &[(SUPPORT, 0.9, 0.0, none), (WHITE, 0.0, 0.5, 1.3)])),
        (Some(BLACK), limits(3, &[(BLACK, 0.3, 0.9, 1.0), (WHITE, 0.0, 0.7, none), (SUPPORT, 0.2, 0.0, 0.7)])),
    ];
    for (core, limits) in spaces {
        let of = |norm, dc_weight| Objective { norm, dc_weight };
        for objective in [
            of(Norm::Natural, 1.0),
            of(Norm::L2, 1.0),
            of(Norm::L2, 10.0),
            of(Norm::Spatial, 1.0),
            of(Norm::Relative, 1.0),
        ] {
            let options =
                SearchOptions { units: 12, depth: 3, objective, core, limits: limits.clone(), ..Default::default() };
            let table = BlockTable::new(&resins, &options).unwrap();
            for (i, target) in random_targets(4, 1, 7).iter().enumerate() {
                let truth = brute_force(&resins, &options, target).unwrap();
                for (name, found) in
                    [("match", match_target(&table, target, &Unwatched)), ("algorithm 1", algorithm_1(&table, target))]
                {
                    let found = found.unwrap();
                    assert_same(found.objective, truth, &format!("{name}, core {core:?}, target {i}"));
                    assert!(keeps_limits(&found.stacking, &options), "{name}: {:?}", found.stacking);
                }
            }
        }
    }
}

#[test]
fn equals_brute_force_in_colour() {
    let resins = colour_resins();
    let options = SearchOptions { units: 6, depth: 3, core: Some(BLACK), ..Default::default() };
    let table = BlockTable::new(&resins, &options).unwrap();
    for (i, target) in random_targets(6, 3, 11).iter().enumerate() {
        let truth = brute_force(&resins, &options, target).unwrap();
        assert_same(match_target(&table, target, &Unwatched).unwrap().objective, truth, &format!("target {i}"));
    }
}

/// Section 8.2 of the paper: five targets of equal albedo and falling width, from mostly support to white.
fn interpolated_targets(resins: &[Vec<KubelkaMunk>]) -> Vec<SearchTarget> {
    let wide = Stack::new([(WHITE, 0.3), (SUPPORT, 4.5)]).over(BLACK);
    let wide = reflection_of(resins, &wide).swap_remove(0);
    let narrow = resins[WHITE.0][0].half_space();
    let scale = wide[0] / narrow[0];
    (0..5)
        .map(|i| {
            let f = i as f64 / 4.0;
            SearchTarget {
                channels: vec![wide.iter().zip(&narrow).map(|(w, n)| (1.0 - f) * w + f * scale * n).collect()],
            }
        })
        .collect()
}

fn against_algorithm_1(resins: &[Vec<KubelkaMunk>], targets: usize, units: usize, depth: usize) {
    for core in [None, Some(BLACK)] {
        let limits = limits(3, &[(SUPPORT, 0.2, 0.0, f64::INFINITY)]);
        let options = SearchOptions { units, depth, core, limits, ..Default::default() };
        let table = BlockTable::new(resins, &options).unwrap();
        let (mut printed_nodes, mut nodes) = (0, 0);
        for (i, target) in interpolated_targets(resins).iter().chain(&random_targets(targets, 1, 3)).enumerate() {
            let printed = algorithm_1(&table, target).unwrap();
            let found = match_target(&table, target, &Unwatched).unwrap();
            assert_same(found.objective, printed.objective, &format!("core {core:?}, target {i}"));
            assert!(found.proven && found.bound == found.objective);
            (printed_nodes, nodes) = (printed_nodes + printed.nodes, nodes + found.nodes);
        }
        println!("core {core:?}: {printed_nodes} nodes as printed, {nodes} here");
    }
}

#[test]
fn equals_algorithm_1() {
    against_algorithm_1(&three_resins(), 10, 64, 4);
}

#[test]
#[ignore = "50 random and 5 interpolated targets at the paper's n = 64, depth 6: half a minute"]
fn equals_algorithm_1_at_the_papers_size() {
    // White, black, support, as in the stand-ins.
    let set = MaterialSet::builtin("synthetic").unwrap();
    let resins: Vec<_> = set.resins.iter().map(Resin::kubelka_munk).collect();
    against_algorithm_1(&resins, 50, 64, 6);
}
