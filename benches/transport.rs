//! What the transport model costs: `cargo bench --bench transport`.
//!
//! Printed, not judged. One thread unless said otherwise; the best of five.

#![allow(clippy::print_stdout, missing_docs)]

use std::time::Instant;

use lumislice::{
    appearance::NormalizedDiffusion,
    optics::{
        KubelkaMunk, Light, MaterialSet, ModalReflection, Stack, Transport, TransportOptions, VolumeCoefficients,
    },
    search::{BlockTable, RefineOptions, Refiner, SearchOptions, SearchTarget, match_sequences, match_targets},
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
    let resin = |name: &str| set.resin(name).expect("a resin of the set").0;
    let (white, support, black) = (resin("white"), resin("support"), resin("black"));
    let volumes: Vec<Vec<VolumeCoefficients>> =
        set.resins.iter().map(|resin| resin.volumes().expect("coefficients")).collect();
    let channel: Vec<_> = volumes.iter().map(|resin| resin[0]).collect();
    let stack = [(white, 0.25), (support, 1.0), (white, 0.5)];
    let whole = Stack::new(stack).over(black).map(|resin| channel[resin.0]);
    let stack = stack.map(|(resin, mm)| (resin.0, mm));
    println!("three layers over black, {} frequencies, one thread:", set.grid.len());
    for (name, options) in [("6 × 5", TransportOptions::REFLECTION), ("10 × 6", TransportOptions::default())] {
        let new = || ModalReflection::new(&channel, Some(black.0), set.grid.as_slice(), options);
        let modal = new();
        let table = one.install(|| best_ms(|| drop(new())));
        let both = best_ms(|| drop(new()));
        let value = one.install(|| best_ms(|| drop(modal.reflection(&stack))));
        let slope = one.install(|| best_ms(|| drop(modal.slope(&stack))));
        let model = Transport { stack: &whole, light: Light::Diffuse, options };
        let scratch = one.install(|| best_ms(|| drop(model.spectra(&set.grid))));
        println!(
            "  {name:6} modes {value:6.1} ms, with slopes {slope:6.1} ms; from scratch {scratch:6.1} ms; \
             tables of three resins {table:6.1} ms, all threads {both:6.1} ms"
        );
    }

    let options = SearchOptions { core: Some(black), ..SearchOptions::default() };
    let parameters: Vec<Vec<KubelkaMunk>> =
        set.resins.iter().map(|resin| resin.channels.iter().map(|c| c.kubelka_munk.clone()).collect()).collect();
    let blocks = BlockTable::new(&parameters, &options).expect("good options");
    let targets: Vec<SearchTarget> = (0..100)
        .map(|i| {
            let (albedo, mm) = (0.05 + 0.5 * f64::from(i % 10) / 9.0, 0.1 * 20.0_f64.powf(f64::from(i / 10) / 9.0));
            let model = NormalizedDiffusion::new(albedo, mm).expect("in range");
            SearchTarget { channels: vec![model.spectrum(&set.grid)] }
        })
        .collect();
    let start = Instant::now();
    let refiner = Refiner::new(&volumes, &set.grid, &options, RefineOptions::default());
    println!("tables of a search, all threads: {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
    let mut times: Vec<f64> = one.install(|| {
        let one = |target: &SearchTarget| {
            let start = Instant::now();
            let found = match_sequences(&blocks, target, Refiner::SEQUENCES).expect("feasible");
            refiner.refine(&found, target).expect("feasible");
            start.elapsed().as_secs_f64() * 1e3
        };
        targets.iter().map(one).collect()
    });
    times.sort_by(f64::total_cmp);
    println!("a refined match, one thread: median {:.0} ms, worst of {} {:.0} ms", times[50], times.len(), times[99]);
    let km = best_ms(|| drop(match_targets(&blocks, &targets)));
    let start = Instant::now();
    refiner.match_targets(&blocks, &targets).expect("feasible");
    println!("100 targets, all threads: {:.1} s refined, {km:.0} ms in whole units", start.elapsed().as_secs_f64());
}
