//! What a caller may rely on beside the optimum.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::optimum::keeps_limits;
use super::resins::*;
use crate::optics::{ResinId, Stack};
use crate::search::{
    algorithm_1::algorithm_1,
    branch_and_bound::{match_candidates, match_target, match_targets},
    forward::reflection_of,
    *,
};
use crate::watch::{Unwatched, Watch};

fn options() -> SearchOptions {
    SearchOptions { depth: 5, core: Some(BLACK), ..Default::default() }
}

#[test]
fn a_stacking_of_the_space_is_found_again() {
    let resins = three_resins();
    let table = BlockTable::new(&resins, &options()).unwrap();
    let unit = options().unit_mm();
    let made = Stack::new([(WHITE, 5.0 * unit), (SUPPORT, 32.0 * unit), (WHITE, 6.0 * unit)]).over(BLACK);
    let target = SearchTarget { channels: reflection_of(&resins, &made) };
    let found = match_target(&table, &target, &Unwatched).unwrap();
    assert_eq!(found.stacking.layers.len(), 3);
    for (a, b) in found.stacking.layers.iter().zip(&made.layers) {
        assert!(a.resin == b.resin && (a.thickness_mm - b.thickness_mm).abs() < 1e-12, "{:?}", found.stacking);
    }
    assert!(found.objective < 1e-24);
}

#[test]
fn candidates_are_the_best_ones_and_differ() {
    let table = BlockTable::new(&three_resins(), &options()).unwrap();
    for target in random_targets(4, 1, 5) {
        let eight = match_candidates(&table, &target, 8, &Unwatched).unwrap();
        let one = match_target(&table, &target, &Unwatched).unwrap();
        assert_eq!(eight.len(), 8);
        assert_eq!(eight[0].stacking, one.stacking);
        assert!(eight.is_sorted_by(|a, b| a.objective <= b.objective + 1e-15));
        for (i, a) in eight.iter().enumerate() {
            assert!(eight[..i].iter().all(|b| a.stacking != b.stacking));
            assert!(keeps_limits(&a.stacking, &options()));
        }
        // A longer list holds the shorter one.
        let twenty = match_candidates(&table, &target, 20, &Unwatched).unwrap();
        assert!(twenty.iter().zip(&eight).all(|(a, b)| (a.objective - b.objective).abs() < 1e-15));
    }
}

#[test]
fn a_search_hears_a_stop_on_its_way() {
    /// Asks to stop, and counts how often it was asked.
    #[derive(Default)]
    struct AtOnce(AtomicUsize);
    impl Watch for AtOnce {
        fn stop_requested(&self) -> bool {
            self.0.fetch_add(1, Ordering::Relaxed);
            true
        }
    }
    let options = SearchOptions { depth: 8, ..options() };
    let table = BlockTable::new(&three_resins(), &options).unwrap();
    let watch = AtOnce::default();
    assert!(matches!(match_target(&table, &random_targets(1, 1, 9)[0], &watch), Err(SearchError::Stopped(_))));
    // Once among the nodes, and once at the end.
    assert_eq!(watch.0.into_inner(), 2);
}

#[test]
fn a_budget_gives_a_bound_below_the_optimum() {
    let resins = three_resins();
    let full = BlockTable::new(&resins, &SearchOptions { depth: 6, ..options() }).unwrap();
    for target in random_targets(4, 1, 9) {
        let truth = match_target(&full, &target, &Unwatched).unwrap();
        assert!(truth.proven);
        for max_nodes in [30, 200, 700, truth.nodes / 2] {
            let options = SearchOptions { depth: 6, max_nodes: Some(max_nodes), ..options() };
            let found = match_target(&BlockTable::new(&resins, &options).unwrap(), &target, &Unwatched).unwrap();
            assert!(found.bound <= truth.objective * (1.0 + 1e-9), "{} over {}", found.bound, truth.objective);
            assert!(found.objective >= truth.objective * (1.0 - 1e-9));
            assert!(!found.proven || found.bound == found.objective);
        }
    }
}

#[test]
fn thread_count_changes_nothing() {
    let table = BlockTable::new(&three_resins(), &SearchOptions { depth: 4, ..options() }).unwrap();
    let targets = random_targets(12, 1, 1);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| match_targets(&table, &targets, &Unwatched).unwrap())
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn more_depth_is_never_worse() {
    let targets = random_targets(3, 1, 2);
    let mut last = vec![f64::INFINITY; 3];
    for depth in 1..=6 {
        let table = BlockTable::new(&three_resins(), &SearchOptions { depth, ..options() }).unwrap();
        for (target, last) in targets.iter().zip(&mut last) {
            let found = match_target(&table, target, &Unwatched).unwrap().objective;
            assert!(found <= *last + 1e-15);
            *last = found;
        }
    }
}

#[test]
fn a_core_too_deep_to_reach_is_infeasible() {
    let deep = ResinLimit { min_depth_mm: 1.0, ..ResinLimit::NONE };
    let thin = ResinLimit { max_mm: 0.1, ..ResinLimit::NONE };
    let options = SearchOptions { core: Some(SUPPORT), limits: vec![thin, thin, deep], ..options() };
    let table = BlockTable::new(&three_resins(), &options).unwrap();
    let target = &random_targets(1, 1, 0)[0];
    assert!(matches!(match_target(&table, target, &Unwatched), Err(SearchError::Infeasible { .. })));
    assert!(matches!(algorithm_1(&table, target), Err(SearchError::Infeasible { .. })));
}

#[test]
fn bad_questions_are_refused() {
    let resins = three_resins();
    let refuse = |options: SearchOptions| BlockTable::new(&resins, &options).map(|_| ()).unwrap_err();
    assert!(matches!(refuse(SearchOptions { units: 0, ..options() }), SearchError::Option { name: "units", .. }));
    assert!(matches!(
        refuse(SearchOptions { core: Some(ResinId(3)), ..options() }),
        SearchError::Option { name: "core", .. }
    ));
    assert!(matches!(
        refuse(SearchOptions { max_thickness_mm: f64::NAN, ..options() }),
        SearchError::Option { name: "max-thickness-mm", .. }
    ));
    let upside_down = ResinLimit { min_mm: 2.0, max_mm: 1.0, min_depth_mm: 0.0 };
    let bad = SearchOptions { limits: vec![ResinLimit::NONE, upside_down, ResinLimit::NONE], ..options() };
    assert!(matches!(refuse(bad), SearchError::Limit { resin: BLACK, .. }));
    assert!(matches!(refuse(SearchOptions { limits: vec![ResinLimit::NONE], ..options() }), SearchError::Limit { .. }));
    assert!(matches!(BlockTable::new(&[], &SearchOptions::default()), Err(SearchError::Resins { .. })));
    let table = BlockTable::new(&resins, &options()).unwrap();
    let short = SearchTarget { channels: vec![vec![0.5; 3]] };
    assert!(matches!(match_target(&table, &short, &Unwatched), Err(SearchError::Target { coefficients: 3, .. })));
    let nan = SearchTarget { channels: vec![vec![f64::NAN; 128]] };
    assert!(matches!(match_target(&table, &nan, &Unwatched), Err(SearchError::TargetValue { index: 0, .. })));
}
