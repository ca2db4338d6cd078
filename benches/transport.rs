//! What the transport model costs: `cargo bench --bench transport`.
//!
//! Printed, not judged. One thread unless said otherwise; the best of five.

#![allow(clippy::print_stdout, missing_docs)]

use std::time::Instant;

use lumislice::{
    appearance::material_target,
    optics::{Light, MaterialSet, Model, ResinId, Stack, TransportOptions, predict},
    search::{Judge, MatchOptions, Matcher, SearchOptions, SearchTarget},
    watch::Unwatched,
};

fn best_ms(mut run: impl FnMut()) -> f64 {
    let once = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..5).map(once).fold(f64::INFINITY, f64::min)
}

fn main() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let set = MaterialSet::builtin("synthetic").expect("built in");
    let (black, _) = set.resin("black").expect("a resin of the set");
    // What the model itself costs, `time_of_a_stack` of the library's tests tells.
    let stack = Stack::new([(ResinId(0), 0.25), (ResinId(2), 1.0), (ResinId(0), 0.5)]).over(black);
    for (name, options) in [("6 × 5", TransportOptions::REFLECTION), ("10 × 6", TransportOptions::default())] {
        let model = Model::Transport { light: Light::Diffuse, options };
        let scratch = one.install(|| best_ms(|| drop(predict(&set, &stack, &model, &Unwatched))));
        println!("three layers over black, {name}, {} frequencies, one thread: {scratch:.1} ms", set.grid.len());
    }

    let search = SearchOptions { core: Some(black), ..SearchOptions::default() };
    let options = |judge| MatchOptions { search: search.clone(), judge, ..MatchOptions::default() };
    let by_km = Matcher::new(&set, &options(Judge::KubelkaMunk)).expect("good options");
    let targets: Vec<SearchTarget> = (0..100)
        .map(|i| {
            let (albedo, mm) = (0.05 + 0.5 * f64::from(i % 10) / 9.0, 0.1 * 20.0_f64.powf(f64::from(i / 10) / 9.0));
            material_target(&[albedo], &[mm], 1, &set.grid).expect("in range")
        })
        .collect();
    let start = Instant::now();
    let refining = Matcher::new(&set, &options(Judge::Transport)).expect("good options");
    println!("tables of a search, all threads: {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
    let mut times: Vec<f64> = one.install(|| {
        let one = |target: &SearchTarget| {
            let start = Instant::now();
            refining.match_targets(std::slice::from_ref(target), &Unwatched).expect("feasible");
            start.elapsed().as_secs_f64() * 1e3
        };
        targets.iter().map(one).collect()
    });
    times.sort_by(f64::total_cmp);
    println!("a refined match, one thread: median {:.0} ms, worst of {} {:.0} ms", times[50], times.len(), times[99]);
    let km = best_ms(|| drop(by_km.match_targets(&targets, &Unwatched)));
    let start = Instant::now();
    refining.match_targets(&targets, &Unwatched).expect("feasible");
    println!("100 targets, all threads: {:.1} s refined, {km:.0} ms in whole units", start.elapsed().as_secs_f64());
}
