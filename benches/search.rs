//! How fast the search is, and how far ahead of Algorithm 1 as printed: `cargo bench --bench search`.
//!
//! Resins are the built-in sets, targets random; the numbers in docs/performance.md come from here. Times are the best
//! of three runs, so that a busy machine does not lie too much. `cargo bench --bench search -- colour` measures seven
//! resins in three channels alone.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

use std::time::{Duration, Instant};

use lumislice::{
    optics::{FrequencyGrid, MaterialSet, Model, ResinId, Stack, predict},
    search::{Found, Judge, Match, MatchOptions, Matcher, ResinLimit, SearchOptions, SearchTarget},
    watch::Unwatched,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

fn matcher(set: &MaterialSet, search: SearchOptions) -> Matcher {
    Matcher::new(set, &MatchOptions { search, judge: Judge::KubelkaMunk, ..MatchOptions::default() }).unwrap()
}

fn match_all(matcher: &Matcher, targets: &[SearchTarget]) -> Vec<Found> {
    matcher.match_targets(targets, &Unwatched).unwrap()
}

fn match_one(matcher: &Matcher, target: &SearchTarget) -> Match {
    match_all(matcher, std::slice::from_ref(target)).remove(0).search.unwrap()
}

fn targets(count: usize, channels: usize, seed: u64) -> Vec<SearchTarget> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut unit = move || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let mut target = || {
        let (albedo, width, tail) = (0.05 + 0.6 * unit(), 0.05 + 0.95 * unit().powi(2), 0.5 + unit());
        let grid = FrequencyGrid::default();
        grid.as_slice().iter().map(|k| albedo / (1.0 + (k * width).powi(2)).powf(tail / 2.0)).collect()
    };
    (0..count).map(|_| SearchTarget { channels: (0..channels).map(|_| target()).collect() }).collect()
}

/// What random stackings reflect in the transport model: 2 to 4 layers of any thickness of 5 mm, support below 0.2 mm,
/// over black.
fn realisable(set: &MaterialSet, count: usize, seed: u64) -> Vec<(String, SearchTarget)> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut unit = move || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let black = set.resin("black").unwrap().0;
    let support = set.resin("support").unwrap().0;
    let mut found = Vec::new();
    while found.len() < count {
        let layers = 2 + (3.0 * unit()) as usize;
        let mut stack: Vec<(ResinId, f64)> = Vec::new();
        while stack.len() < layers {
            let resin = ResinId((set.resins.len() as f64 * unit()) as usize);
            if stack.last().is_none_or(|last| last.0 != resin) {
                stack.push((resin, 0.05 * 40.0_f64.powf(unit())));
            }
        }
        let above: f64 = stack.iter().take_while(|layer| layer.0 != support).map(|layer| layer.1).sum();
        if above < 0.2 || stack.iter().map(|layer| layer.1).sum::<f64>() > 5.0 {
            continue;
        }
        let stack = Stack::new(stack).over(black);
        let light = predict(set, &stack, &Model::REFLECTION, &Unwatched).unwrap();
        let name = stack.pairs().map(|(&resin, mm)| format!("{} {mm:.2}", set[resin].name));
        let name = name.collect::<Vec<_>>().join(", ");
        found.push((name, SearchTarget { channels: light.reflection() }));
    }
    found
}

/// Seven resins in three channels, n = 64, depth 6, targets that can be reached: one thread.
fn colour() {
    let set = MaterialSet::builtin("inks-rgb-7").unwrap();
    let none = ResinLimit::NONE;
    let limits: Vec<_> = set
        .resins
        .iter()
        .map(|resin| ResinLimit { min_depth_mm: if resin.name == "support" { 0.2 } else { 0.0 }, ..none })
        .collect();
    let core = set.resin("black").map(|(black, _)| black);
    let options = SearchOptions { core, limits, ..Default::default() };
    let targets = realisable(&set, 30, 7);
    let (built, matcher) = best_of(3, || matcher(&set, options.clone()));
    println!("{}: n 64, depth 6, 30 realisable targets, one thread; table {:.1} ms", set.name, ms(built));
    println!("{:>9} {:>10} {:>10} {:>10} {:>6}  target", "ms", "nodes", "objective", "bound", "proven");
    let (mut times, mut proven) = (Vec::new(), 0);
    for (name, target) in &targets {
        let (time, found) = best_of(3, || match_one(&matcher, target));
        times.push(ms(time));
        proven += usize::from(found.proven);
        println!(
            "{:>9.1} {:>10} {:>10.2e} {:>10.2e} {:>6}  {name}",
            ms(time),
            found.nodes,
            found.objective,
            found.bound,
            if found.proven { "yes" } else { "no" }
        );
    }
    times.sort_by(f64::total_cmp);
    println!("proven {proven} of 30; median {:.0} ms, worst {:.0} ms", times[15], times[29]);
}

fn best_of<T>(runs: usize, mut work: impl FnMut() -> T) -> (Duration, T) {
    let mut best: Option<(Duration, T)> = None;
    for _ in 0..runs {
        let start = Instant::now();
        let result = work();
        let time = start.elapsed();
        if best.as_ref().is_none_or(|b| time < b.0) {
            best = Some((time, result));
        }
    }
    best.unwrap()
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// One line per space: ms a target on one thread.
fn table(
    set: &str,
    channels: usize,
    count: usize,
    spaces: &[(usize, usize)],
    options: impl Fn(usize, usize) -> SearchOptions,
) {
    let name = set;
    let set = MaterialSet::builtin(name).unwrap();
    println!(
        "{name}: {} resins, {channels} channels, one thread, {count} random targets; ms a target",
        set.resins.len()
    );
    println!("{:>5} {:>5} {:>9} {:>9} {:>9} {:>10} {:>8}", "n", "depth", "mean", "worst", "table", "nodes", "ns/node");
    for &(units, depth) in spaces {
        let (built, matcher) = best_of(3, || matcher(&set, options(units, depth)));
        let (mut sum, mut worst, mut nodes) = (0.0, 0.0f64, 0);
        for target in &targets(count, channels, 1) {
            let (time, found) = best_of(3, || match_one(&matcher, target));
            (sum, worst, nodes) = (sum + ms(time), worst.max(ms(time)), nodes + found.nodes);
        }
        let (mean, per_node) = (sum / count as f64, sum * 1e6 / nodes as f64);
        let nodes = nodes / count as u64;
        println!("{units:>5} {depth:>5} {mean:>9.3} {worst:>9.3} {:>9.3} {nodes:>10} {per_node:>8.0}", ms(built));
    }
}

fn main() {
    let asked = std::env::args().nth(1).filter(|argument| !argument.starts_with('-'));
    if asked.as_deref() == Some("colour") {
        return colour();
    }
    // As the paper's section 8: support no closer than 0.2 mm to the top, black below.
    let synthetic = |units, depth| {
        let limit = ResinLimit { min_depth_mm: 0.2, ..ResinLimit::NONE };
        let limits = vec![ResinLimit::NONE, ResinLimit::NONE, limit];
        SearchOptions { units, depth, core: Some(ResinId(1)), limits, ..Default::default() }
    };
    let inks = |units, depth| SearchOptions { units, depth, core: Some(ResinId(1)), ..Default::default() };
    table("synthetic", 1, 20, &[(64, 4), (64, 6), (64, 8), (64, 10), (256, 6), (256, 8)], synthetic);
    table("inks-rgb", 3, 10, &[(64, 4), (64, 5), (64, 6)], inks);

    let matcher = matcher(&MaterialSet::builtin("synthetic").unwrap(), synthetic(64, 6));
    let (mut printed, mut here, mut nodes) = (0.0, 0.0, (0, 0));
    for target in &targets(10, 1, 1) {
        let (slow, a) = best_of(1, || matcher.algorithm_1(target).unwrap());
        let (fast, b) = best_of(3, || match_one(&matcher, target));
        assert!((a.objective - b.objective).abs() < 1e-12);
        (printed, here, nodes) = (printed + ms(slow), here + ms(fast), (nodes.0 + a.nodes, nodes.1 + b.nodes));
    }
    println!("Algorithm 1 as printed, n 64, depth 6: {:.1} ms, {} nodes a target", printed / 10.0, nodes.0 / 10);
    println!("  ratio: {:.0} in time, {:.0} in nodes", printed / here, nodes.0 as f64 / nodes.1 as f64);

    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let hundred = targets(100, 1, 2);
    let (time, _) = best_of(3, || pool.install(|| match_all(&matcher, &hundred)));
    println!("100 clusters, n 64, depth 6, 2 threads: {:.1} ms", ms(time));
    colour();
}
