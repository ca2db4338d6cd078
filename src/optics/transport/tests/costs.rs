//! Measurements, not laws: what directions are worth, and what the model costs.

use super::{mixtures::mixed_layers, referees::STACKS, *};
use crate::optics::tests::reference::{BLACK, SUPPORT, WHITE, rms, stack};

#[test]
#[ignore = "a measurement, not a law: what directions are worth"]
fn directions_and_what_they_are_worth() {
    let (grid, coarse) = (FrequencyGrid::default(), FrequencyGrid::linear(33, 20.0));
    // Light in thin layers, by many directions.
    let thin: [(&str, &[(VolumeCoefficients, f64)]); 5] = [
        ("S0.5 W0.1", &[(SUPPORT, 0.5), (WHITE, 0.1)]),
        ("W0.1 S0.3 W0.1", &[(WHITE, 0.1), (SUPPORT, 0.3), (WHITE, 0.1)]),
        ("S0.1 W0.05 B0.05", &[(SUPPORT, 0.1), (WHITE, 0.05), (BLACK, 0.05)]),
        ("S0.05 W0.4 B0.04", &[(SUPPORT, 0.05), (WHITE, 0.4), (BLACK, 0.04)]),
        ("S0.03 W0.1 S0.1 W0.05", &[(SUPPORT, 0.03), (WHITE, 0.1), (SUPPORT, 0.1), (WHITE, 0.05)]),
    ];
    let clear = [(SUPPORT.with_refractive_index(1.5), 0.3)];
    let by = |layers: &[(VolumeCoefficients, f64)], grid: &FrequencyGrid, polar, orders| {
        Transport { stack: &of(layers), light: Light::Diffuse, options: TransportOptions { polar, orders } }
            .spectra(grid)
    };
    let exact: Vec<_> = thin.iter().map(|(_, layers)| by(layers, &coarse, 20, 10)).collect();
    let exact_clear = by(&clear, &coarse, 12, 8);
    let print = |name: &str, found: &TransportSpectra, exact: (&[f64], &[f64])| {
        print!(" {name} {:.1e} {:.1e};", rms(&found.reflection, exact.0), rms(&found.transmission, exact.1));
    };
    for (polar, orders) in [(4, 4), (5, 5), (6, 5), (8, 5), (10, 6), (14, 8)] {
        print!("{polar} × {orders}:");
        for (name, layers) in STACKS.iter().filter(|(name, _)| ["S1", "S5.6", "W1"].contains(name)) {
            let Some((reflection, transmission)) = stack(name) else { return };
            let found = by(layers, &grid, polar, orders);
            print(name, &found, (&reflection.hankel(&grid).values, &transmission.hankel(&grid).values));
        }
        for ((name, layers), exact) in thin.iter().zip(&exact) {
            let found = by(layers, &coarse, polar, orders);
            print(name, &found, (&exact.reflection, &exact.transmission));
        }
        let found = by(&clear, &coarse, polar, orders);
        print("S0.3, n = 1.5", &found, (&exact_clear.reflection, &exact_clear.transmission));
        println!();
    }
}

#[test]
#[ignore = "a measurement, not a law: time of a stack"]
fn time_of_a_stack() {
    let grid = FrequencyGrid::default();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    // Time that the thread ran, not that it waited for a processor.
    let ran = || -> f64 {
        let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
        stat.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(0.0) / 1e6
    };
    let best = |run: &(dyn Fn() + Sync)| {
        let once = |_| {
            pool.install(|| {
                let start = ran();
                run();
                ran() - start
            })
        };
        (0..7).map(once).fold(f64::INFINITY, f64::min)
    };
    let stack = [(0, 0.1), (1, 1.0), (0, 0.1)];
    for index in [1.0, 1.5] {
        let resins = [WHITE, SUPPORT, BLACK].map(|resin| resin.with_refractive_index(index));
        let layers: Vec<_> = stack.iter().map(|&(resin, mm)| (resins[resin], mm)).collect();
        let of_layers = of(&layers);
        for options in
            [TransportOptions::REFLECTION, TransportOptions { polar: 8, orders: 5 }, TransportOptions::default()]
        {
            let tables = best(&|| drop(ModalReflection::new(&resins, None, grid.as_slice(), options)));
            let modal = ModalReflection::new(&resins, None, grid.as_slice(), options);
            let value = best(&|| drop(modal.discrete(&stack)));
            let all = best(&|| drop(modal.spectra(&stack)));
            let slope = best(&|| drop(modal.slope(&stack)));
            let whole = best(&|| drop(Transport { stack: &of_layers, light: Light::Diffuse, options }.spectra(&grid)));
            let doubled = Doubled::new(&Transport { stack: &of_layers, light: Light::Diffuse, options }, &layers);
            let new = || FewTurns::new(&doubled.layers, &doubled.directions, Light::Diffuse, grid.as_slice());
            let prepare = best(&|| drop(std::hint::black_box(new())));
            let few = new();
            let corrections = best(&|| {
                grid.as_slice().iter().for_each(|&k| {
                    std::hint::black_box(few.as_ref().map(|few| few.correction(k)));
                })
            });
            println!(
                "n {index} {options:?}: tables {tables:.1} ms, R and T {value:.1}, with few turns {all:.1}, slopes \
                    {slope:.1}, few turns {prepare:.1} + {corrections:.1}, from scratch {whole:.1}"
            );
        }
    }
}

/// What an evaluation costs: printed.
#[test]
#[ignore = "a measurement"]
fn time_of_mixed_layers() {
    for (index, options) in [1.0, 1.52].into_iter().flat_map(|index| {
        [(3, 3), (4, 3), (4, 4), (6, 5)].map(|(polar, orders)| (index, TransportOptions { polar, orders }))
    }) {
        let [grey, support, white, black] = mixed_layers(index);
        let k: Vec<f64> = (0..18).map(f64::from).collect();
        let places = [None, Some(support), Some(white)];
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        pool.install(|| {
            let model = LayeredReflection::new(&places, &[index], Base::HalfSpace(black), &k, options);
            let mm = [0.4, 0.7, 0.5];
            let time = |run: &dyn Fn()| {
                let started = std::time::Instant::now();
                (0..10).for_each(|_| run());
                started.elapsed().as_secs_f64() * 1e3 / 180.0
            };
            let value = time(&|| drop(model.reflection(&mm, &[grey])));
            let mixed = Mixed { volume: grey, tangents: vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };
            let slope = time(&|| drop(model.slope(&mm, std::slice::from_ref(&mixed))));
            println!("n {index}, {options:?}: {value:.3} ms a frequency, {slope:.3} with slopes");
        });
    }
}
