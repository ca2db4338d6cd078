//! Refining recovers what is known, and keeps what is asked.

use super::*;
use crate::{
    optics::{MaterialSet, Resin},
    search::ResinLimit,
    watch::Unwatched,
};

struct Bench {
    table: BlockTable,
    refiner: Refiner,
    grid: FrequencyGrid,
}

const WHITE: ResinId = ResinId(0);
const BLACK: ResinId = ResinId(1);
const SUPPORT: ResinId = ResinId(2);

fn bench(refine: RefineOptions) -> Bench {
    let set = MaterialSet::builtin("synthetic").unwrap();
    let index = |name: &str| set.resin(name).unwrap().0;
    assert_eq!([index("white"), index("black"), index("support")], [WHITE, BLACK, SUPPORT]);
    let limits = set.resins.iter().map(|resin| match resin.name.as_str() {
        "support" => ResinLimit { min_depth_mm: 0.2, ..ResinLimit::NONE },
        _ => ResinLimit::NONE,
    });
    let options = SearchOptions { limits: limits.collect(), core: Some(BLACK), depth: 4, ..SearchOptions::default() };
    let parameters: Vec<_> = set.resins.iter().map(Resin::kubelka_munk).collect();
    let volumes: Vec<_> = set.resins.iter().map(|resin| resin.volumes().unwrap()).collect();
    Bench {
        table: BlockTable::new(&parameters, &options).unwrap(),
        refiner: Refiner::new(&volumes, &set.grid, &options, refine),
        grid: set.grid.clone(),
    }
}

impl Bench {
    fn refine(&self, target: &SearchTarget) -> Result<Refined, SearchError> {
        let start = std::time::Instant::now();
        let candidates = match_sequences(&self.table, target, Refiner::SEQUENCES, &Unwatched).unwrap();
        let searched = start.elapsed();
        let refined = self.refiner.refine(&candidates, target, &Unwatched);
        println!("search {searched:?}, refine {:?}", start.elapsed() - searched);
        refined
    }

    fn target(&self, layers: &[(ResinId, f64)]) -> SearchTarget {
        SearchTarget { channels: self.refiner.reflection(&Stack::joined(layers.iter().copied())) }
    }
}

#[test]
fn what_a_stacking_reflects_is_found_again() {
    let bench = bench(RefineOptions::default());
    for layers in [
        vec![(WHITE, 0.31), (SUPPORT, 1.27), (BLACK, 0.1), (WHITE, 0.9)],
        vec![(WHITE, 0.22), (SUPPORT, 3.3)],
        vec![(BLACK, 0.04), (WHITE, 0.5), (SUPPORT, 0.7)],
    ] {
        let target = bench.target(&layers);
        let refined = bench.refine(&target).unwrap();
        println!("{layers:?}: {:.1e} → {:.1e} {:?}", refined.unrefined, refined.objective, refined.stacking.layers);
        assert!(refined.objective < 1e-5, "{layers:?}: {refined:?}");
        assert!(refined.objective < 0.1 * refined.unrefined);
    }
}

#[test]
fn limits_and_steps_are_kept() {
    let step_mm = 0.027;
    let refine = RefineOptions { min_layer_mm: 0.1, step_mm: Some(step_mm), ..RefineOptions::default() };
    let bench = bench(refine);
    let layers = [(WHITE, 0.25), (SUPPORT, 1.0), (WHITE, 0.15), (BLACK, 0.5)];
    let target = bench.target(&layers);
    let refined = bench.refine(&target).unwrap();
    let mut depth = 0.0;
    for layer in &refined.stacking.layers {
        let steps = layer.thickness_mm / step_mm;
        assert!((steps - steps.round()).abs() < 1e-6, "{refined:?}");
        assert!(layer.thickness_mm > 0.1, "{refined:?}");
        assert!(layer.resin != SUPPORT || depth > 0.2 - 1e-9, "{refined:?}");
        depth += layer.thickness_mm;
    }
    assert!(depth < 5.0 + 1e-9);
    let rounded = Stack::joined(layers.map(|(resin, mm)| (resin, (mm / step_mm).round() * step_mm)));
    let rounded = SearchOptions::default().objective.of(&bench.refiner.reflection(&rounded), &target);
    println!("{:.1e}, rounded one by one {rounded:.1e}", refined.objective);
    assert!(refined.objective <= rounded, "{refined:?}");
}

#[test]
fn the_targets_grid_is_the_refiners() {
    let bench = bench(RefineOptions::default());
    assert_eq!(bench.target(&[(WHITE, 1.0)]).channels[0].len(), bench.grid.len());
}
