//! Laws of the model, and its figures against programs that are not ours.

use proptest::prelude::*;

use super::*;
use crate::optics::{
    MonteCarlo, RingEdges,
    fresnel::refraction,
    tests::reference::{BLACK, SUPPORT, WHITE, numbers, reference, rms, stack},
};

fn spectra(
    layers: &[(VolumeCoefficients, f64)],
    base: Option<VolumeCoefficients>,
    light: Light,
    k: &[f64],
) -> TransportSpectra {
    let grid = FrequencyGrid::linear(k.len(), k[k.len() - 1]);
    let stack = of(layers).over(base);
    Transport { stack: &stack, light, options: TransportOptions::default() }.spectra(&grid)
}

fn of(layers: &[(VolumeCoefficients, f64)]) -> Stack<VolumeCoefficients> {
    Stack::new(layers.iter().copied())
}

/// What the surface reflects at once.
fn mirrored(layers: &[(VolumeCoefficients, f64)], light: Light) -> f64 {
    Transport { stack: &of(layers), light, options: TransportOptions::default() }.glint()
}

fn volume() -> impl Strategy<Value = VolumeCoefficients> {
    let index = prop_oneof![Just(1.0), Just(1.3), Just(1.5), Just(1.52)];
    (0.0..20.0, 0.0..5.0, -0.99..0.95, index).prop_map(|(sigma_s, sigma_a, g, refractive_index)| VolumeCoefficients {
        sigma_s,
        sigma_a,
        g,
        refractive_index,
    })
}

fn light() -> impl Strategy<Value = Light> {
    prop_oneof![Just(Light::Diffuse), Just(Light::Normal)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn no_light_is_made(layers in prop::collection::vec((volume(), 0.01..3.0), 1..4), light in light()) {
        let found = spectra(&layers, None, light, &[0.0, 5.0]);
        for (r, t) in found.reflection.iter().zip(&found.transmission) {
            prop_assert!(r.abs() + t.abs() + mirrored(&layers, light) <= 1.0 + 1e-9, "{r} + {t}");
        }
    }

    #[test]
    fn without_absorption_no_light_is_lost(
        layers in prop::collection::vec((volume(), 0.01..3.0), 1..4),
        light in light(),
    ) {
        let clear: Vec<_> = layers.iter().map(|(v, mm)| (VolumeCoefficients { sigma_a: 0.0, ..*v }, *mm)).collect();
        let found = spectra(&clear, None, light, &[0.0, 5.0]);
        let sum = found.reflection[0] + found.transmission[0] + mirrored(&clear, light);
        prop_assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    }

    #[test]
    fn a_layer_split_in_two_is_the_same(resin in volume(), mm in 0.01..3.0, share in 0.01..0.99, light in light()) {
        let whole = spectra(&[(resin, mm)], None, light, &[0.0, 10.0]);
        let split = spectra(&[(resin, share * mm), (resin, (1.0 - share) * mm)], None, light, &[0.0, 10.0]);
        let of = |found: &TransportSpectra| [found.reflection.clone(), found.transmission.clone()].concat();
        for (a, b) in of(&whole).iter().zip(of(&split)) {
            prop_assert!((a - b).abs() < 1e-9, "{a} and {b}");
        }
    }

    #[test]
    fn a_half_space_over_itself_is_itself(resin in volume(), mm in 0.01..3.0) {
        let bare = spectra(&[], Some(resin), Light::Diffuse, &[0.0, 10.0]);
        let covered = spectra(&[(resin, mm)], Some(resin), Light::Diffuse, &[0.0, 10.0]);
        // A half-space is a slab through which 1e-12 comes, or as much as 30 doublings leave.
        for (a, b) in bare.reflection.iter().zip(&covered.reflection) {
            prop_assert!((a - b).abs() < 1e-7, "{a} and {b}");
        }
    }
}

#[test]
fn nothing_is_in_the_way() {
    let found = spectra(&[], None, Light::Diffuse, &[0.0, 20.0]);
    assert_eq!(found.reflection, [0.0, 0.0]);
    assert!(found.transmission.iter().all(|t| (t - 1.0).abs() < 1e-8), "{:?}", found.transmission);
}

/// Modes against doubling: two ways to the same matrices, which share the equations only.
#[test]
fn modes_and_doubling_agree() {
    let k = [0.7, 5.0, 20.0];
    let options = TransportOptions::REFLECTION;
    for (indices, tolerance) in [([1.0; 3], 1e-10), ([1.5; 3], 1e-9), ([1.3, 1.5, 1.52], 1e-8)] {
        let resins = [WHITE, SUPPORT, BLACK];
        let resins: Vec<_> = resins.iter().zip(indices).map(|(resin, n)| resin.with_refractive_index(n)).collect();
        for base in [None, Some(2)] {
            let modal = ModalReflection::new(&resins, base, &k, options);
            for stack in [
                vec![(0, 1.0)],
                vec![(1, 1e-3)],
                vec![(0, 0.25), (1, 2.0), (0, 0.5)],
                vec![(0, 0.05), (1, 0.078), (2, 0.03), (1, 3.0), (1, 0.0), (0, 8.0)],
            ] {
                let layers: Vec<_> = stack.iter().map(|&(resin, mm)| (resins[resin], mm)).collect();
                // A table has the directions of all its resins, whether a stack uses them or not.
                let directions = Directions::new(resins.iter().map(|resin| resin.refractive_index), options);
                let whole = of(&layers).over(base.map(|base| resins[base]));
                let model = Transport { stack: &whole, light: Light::Diffuse, options };
                let doubled = Doubled::over(&model, &layers, directions);
                let found = modal.discrete(&stack);
                for (k, found) in k.iter().zip(found.reflection.iter().zip(&found.transmission)) {
                    let exact = doubled.spectra(*k);
                    let off = (found.0 - exact.0).abs().max((found.1 - exact.1).abs());
                    assert!(off < tolerance, "{indices:?} {stack:?}, k = {k}: {found:?} and {exact:?}");
                }
            }
        }
    }
}

/// Tables and a stack computed on its own: the same but for the least absorption of the one.
#[test]
fn tables_know_light_of_few_turns() {
    let grid = FrequencyGrid::linear(9, 20.0);
    let options = TransportOptions::default();
    let modal = ModalReflection::new(&[WHITE, SUPPORT], None, grid.as_slice(), options);
    let stack = Stack::new([(WHITE, 0.1), (SUPPORT, 0.3), (WHITE, 0.1)]);
    let exact = Transport { stack: &stack, light: Light::Diffuse, options }.spectra(&grid);
    let found = modal.spectra(&[(0, 0.1), (1, 0.2), (1, 0.1), (0, 0.1)]);
    for (found, exact) in found.transmission.iter().zip(&exact.transmission) {
        assert!((found - exact).abs() < 1e-7, "{found} and {exact}");
    }
}

#[test]
fn nothing_over_a_half_space_is_the_half_space() {
    for index in [1.0, 1.5] {
        let black = BLACK.with_refractive_index(index);
        let modal = ModalReflection::new(&[black], Some(0), &[0.7, 20.0], TransportOptions::REFLECTION);
        let (bare, covered) = (modal.spectra(&[]), modal.spectra(&[(0, 1.0)]));
        for (a, b) in bare.reflection.iter().zip(&covered.reflection) {
            assert!((a - b).abs() < 1e-10, "{a} and {b}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn modes_hold_for_any_resins(
        resins in prop::collection::vec(volume(), 2..4),
        mm in prop::collection::vec(0.001..3.0, 1..4),
    ) {
        let k = [0.5, 6.0, 12.0];
        let options = TransportOptions { polar: 4, orders: 5 };
        let modal = ModalReflection::new(&resins, Some(0), &k, options);
        let stack: Vec<_> = mm.iter().enumerate().map(|(i, &mm)| ((i + 1) % resins.len(), mm)).collect();
        let layers: Vec<_> = stack.iter().map(|&(resin, mm)| (resins[resin], mm)).collect();
        let directions = Directions::new(resins.iter().map(|resin| resin.refractive_index), options);
        let whole = of(&layers).over(resins[0]);
        let model = Transport { stack: &whole, light: Light::Diffuse, options };
        let doubled = Doubled::over(&model, &layers, directions);
        for (k, found) in k.iter().zip(modal.reflection(&stack)) {
            let exact = doubled.spectra(*k).0;
            prop_assert!((found - exact).abs() < 1e-6, "{found} and {exact}");
        }
    }

    #[test]
    fn slopes_are_those_of_differences(
        mm in prop::collection::vec(0.02..2.0, 3),
        index in prop_oneof![Just(1.0), Just(1.5)],
    ) {
        /// Step of the differences, mm: their error is of its square.
        const STEP: f64 = 1e-4;
        let resins = [WHITE, SUPPORT, BLACK].map(|resin| resin.with_refractive_index(index));
        let modal = ModalReflection::new(&resins, Some(2), &[0.0, 3.0, 20.0], TransportOptions::REFLECTION);
        let stack: Vec<_> = [0, 1, 0].into_iter().zip(mm).collect();
        let slope = modal.slope(&stack);
        for layer in 0..stack.len() {
            let moved = |by: f64| {
                let mut moved = stack.clone();
                moved[layer].1 += by;
                modal.reflection(&moved)
            };
            for ((above, below), slope) in moved(STEP).iter().zip(moved(-STEP)).zip(&slope.per_mm[layer]) {
                let difference = (above - below) / (2.0 * STEP);
                prop_assert!((difference - slope).abs() < 1e-5 * (1.0 + slope.abs()), "{difference} and {slope}");
            }
        }
    }
}

#[test]
fn without_scattering_light_goes_straight() {
    let clear = VolumeCoefficients { sigma_s: 0.0, sigma_a: 0.5, g: 0.0, refractive_index: 1.0 };
    let beam = spectra(&[(clear, 2.0)], None, Light::Normal, &[0.0, 7.0]);
    assert!(beam.reflection.iter().all(|r| r.abs() < 1e-12));
    assert!(beam.transmission.iter().all(|t| (t - (-1.0_f64).exp()).abs() < 1e-12), "{:?}", beam.transmission);
}

/// A slab that only absorbs: what one way through leaves, summed over the turns at its faces, over the angles by a fine
/// rule.
#[test]
fn a_clear_slab_reflects_at_both_faces() {
    let dye = VolumeCoefficients { sigma_s: 0.0, sigma_a: 0.5, g: 0.0, refractive_index: 1.5 };
    let way = |mu: f64| {
        let there = refraction(mu, AIR, 1.5).unwrap();
        let (face, once) = (there.reflectance, (-1.0 / there.cosine).exp());
        let between = (1.0 - face).powi(2) / (1.0 - (face * once).powi(2));
        [face, between * face * once * once, between * once]
    };
    const STEPS: usize = 20_000;
    let mut diffuse = [0.0; 3];
    for i in 0..STEPS {
        let mu = (i as f64 + 0.5) / STEPS as f64;
        diffuse.iter_mut().zip(way(mu)).for_each(|(sum, value)| *sum += 2.0 * mu * value / STEPS as f64);
    }
    let stack = Stack::new([(dye, 2.0)]);
    for (light, [glint, r, t]) in [(Light::Normal, way(1.0)), (Light::Diffuse, diffuse)] {
        let model = Transport { stack: &stack, light, options: TransportOptions::default() };
        let found = model.spectra(&FrequencyGrid::linear(2, 1.0));
        let off = [model.glint() - glint, found.reflection[0] - r, found.transmission[0] - t];
        assert!(off.iter().all(|off| off.abs() < 2e-6), "{light:?}: off by {off:?}");
    }
}

/// Totals of slabs of refractive index 1.5 by iadpython's adding–doubling, whose own error is 3e-4:
/// `scripts/fresnel-slabs`.
#[test]
fn slabs_in_air_are_those_of_adding_doubling() {
    let mut worst = [0.0_f64; 2];
    for row in numbers(include_str!("../tests/fresnel_slabs.csv")) {
        let [albedo, tau, g, r_normal, t_normal, r_diffuse, t_diffuse] = row[..] else { panic!("columns") };
        let resin = VolumeCoefficients { sigma_s: albedo, sigma_a: 1.0 - albedo, g, refractive_index: 1.5 };
        let stack = Stack::new([(resin, tau)]);
        let exact = [(Light::Normal, r_normal, t_normal), (Light::Diffuse, r_diffuse, t_diffuse)];
        for (worst, (light, r, t)) in worst.iter_mut().zip(exact) {
            let options = TransportOptions { polar: if light == Light::Normal { 12 } else { 7 }, orders: 1 };
            let model = Transport { stack: &stack, light, options };
            let found = model.spectra(&FrequencyGrid::linear(2, 1.0));
            *worst = worst.max((found.reflection[0] + model.glint() - r).abs()).max((found.transmission[0] - t).abs());
        }
    }
    println!("furthest from iadpython, n = 1.5: normal {:.1e}, diffuse {:.1e}", worst[0], worst[1]);
    assert!(worst[0] < 5e-4 && worst[1] < 5e-4, "{worst:?}");
}

/// Photons see the same boundaries: between resins of different indices, and under a total reflection.
#[test]
fn boundaries_are_those_of_monte_carlo() {
    let glassy = |volume: VolumeCoefficients, n: f64, mm: f64| (volume.with_refractive_index(n), mm);
    agrees_with_photons(&of(&[glassy(WHITE, 1.5, 0.5)]));
    agrees_with_photons(&of(&[glassy(SUPPORT, 1.3, 0.5), glassy(WHITE, 1.6, 0.2), glassy(SUPPORT, 1.0, 0.3)]));
    let black = BLACK.with_refractive_index(1.5);
    agrees_with_photons(&of(&[glassy(WHITE, 1.5, 0.2), glassy(SUPPORT, 1.48, 0.4)]).over(black));
}

/// A backward peak is sharper than the directions are apart: photons that turn round know nothing of them.
#[test]
fn backward_scattering_is_that_of_monte_carlo() {
    for n in [1.0, 1.5] {
        let resin = VolumeCoefficients { sigma_s: 6.0, sigma_a: 0.05, g: -0.9, refractive_index: n };
        agrees_with_photons(&of(&[(resin, 0.8)]));
        agrees_with_photons(&of(&[(WHITE.with_refractive_index(n), 0.1)]).over(resin));
    }
}

/// R̂ and T̂ by the default directions against 200,000 photons.
fn agrees_with_photons(stack: &Stack<VolumeCoefficients>) {
    let grid = FrequencyGrid::linear(9, 8.0);
    let model = Transport { stack, light: Light::Diffuse, options: TransportOptions::default() };
    let found = model.spectra(&grid);
    let (stack, rings) = (stack.clone(), RingEdges::growing());
    let photons = MonteCarlo { stack, light: Light::Diffuse, photons: 200_000, seed: 3, rings }.run().unwrap();
    let off = model.glint() - photons.glint.mean;
    assert!(off.abs() < 4.0 * photons.glint.standard_error + 1e-4, "glint off by {off}");
    for (what, found, profile) in [
        ("R", &found.reflection, &photons.reflection_profile),
        ("T", &found.transmission, &photons.transmission_profile),
    ] {
        for (found, exact) in found.iter().zip(profile.hankel(&grid).values) {
            assert!((found - exact).abs() < 4e-3, "{what}: {found} and {exact} of {:?}", model.stack);
        }
    }
}

/// Totals of every slab by adding–doubling with 40 streams: 16 directions agree within 1e-5.
#[test]
fn totals_are_those_of_adding_doubling() {
    let Some(text) = reference("adding_doubling_slabs.csv") else { return };
    let mut worst = [0.0_f64; 2];
    for row in numbers(&text) {
        let [albedo, tau, g, r_normal, t_normal, r_diffuse, t_diffuse, _] = row[..] else { panic!("columns") };
        let resin = VolumeCoefficients { sigma_s: albedo, sigma_a: 1.0 - albedo, g, refractive_index: 1.0 };
        let stack = Stack::new([(resin, tau)]);
        let options = TransportOptions { polar: 16, orders: 1 };
        let exact = [(Light::Normal, r_normal, t_normal), (Light::Diffuse, r_diffuse, t_diffuse)];
        for (worst, (light, r, t)) in worst.iter_mut().zip(exact) {
            let model = Transport { stack: &stack, light, options };
            let found = model.spectra(&FrequencyGrid::linear(2, 1.0));
            *worst = worst.max((found.reflection[0] - r).abs()).max((found.transmission[0] - t).abs());
        }
    }
    println!("furthest from adding-doubling: normal {:.1e}, diffuse {:.1e}", worst[0], worst[1]);
    assert!(worst[0] < 1e-5 && worst[1] < 1e-6, "{worst:?}");
}

/// The stacks of the reference.
const STACKS: [(&str, &[(VolumeCoefficients, f64)]); 11] = [
    ("S1", &[(SUPPORT, 1.0)]),
    ("S5.6", &[(SUPPORT, 5.6)]),
    ("S6", &[(SUPPORT, 6.0)]),
    ("W1", &[(WHITE, 1.0)]),
    ("W2", &[(WHITE, 2.0)]),
    ("W3", &[(WHITE, 3.0)]),
    ("W4", &[(WHITE, 4.0)]),
    ("B0.25", &[(BLACK, 0.25)]),
    ("B0.75", &[(BLACK, 0.75)]),
    ("W4_B0.25", &[(WHITE, 4.0), (BLACK, 0.25)]),
    ("W0.25_S4.5_B0.25", &[(WHITE, 0.25), (SUPPORT, 4.5), (BLACK, 0.25)]),
];

/// The multi-layer Monte Carlo's own noise is 1e-4 to 2e-4 of R̂ rms.
#[test]
fn spectra_are_those_of_monte_carlo() {
    let grid = FrequencyGrid::default();
    println!("{:18} {:>9} {:>9} {:>9} {:>9}", "stack", "albedo", "off", "R̂ rms", "T̂ rms");
    for (name, layers) in STACKS {
        let Some((reflection, transmission)) = stack(name) else { return };
        let (reflection, transmission) = (reflection.hankel(&grid).values, transmission.hankel(&grid).values);
        let whole = of(layers);
        let model = Transport { stack: &whole, light: Light::Diffuse, options: TransportOptions::default() };
        let found = model.spectra(&grid);
        let off = found.reflection[0] / reflection[0] - 1.0;
        let (r, t) = (rms(&found.reflection, &reflection), rms(&found.transmission, &transmission));
        println!("{name:18} {:9.5} {:8.3}% {r:9.1e} {t:9.1e}", found.reflection[0], 100.0 * off);
        assert!(off.abs() < 1e-3 && r < 3e-4, "{name}: albedo off by {off}, R̂ by {r}");
        // 5% of the light crosses 1 mm of support unscattered.
        assert!(t < if name == "S1" { 3e-3 } else { 1e-3 }, "{name}: T̂ off by {t}");
    }
}

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

/// White with a tenth of black, and support, of the set `synthetic`.
fn mixed_layers(index: f64) -> [VolumeCoefficients; 4] {
    let of = |sigma_s, sigma_a, g| VolumeCoefficients { sigma_s, sigma_a, g, refractive_index: index };
    let (white, black, support) = (of(8.0, 0.17, 0.5), of(2.5, 4.0, 0.5), of(1.6, 0.025, 0.75));
    [VolumeCoefficients::mixed([(white, 0.9), (black, 0.1)]), support, white, black]
}

#[test]
fn slopes_of_mixtures_are_differences() {
    for (index, base) in [(1.0, false), (1.0, true), (1.5, false)] {
        let [grey, support, white, black] = mixed_layers(index);
        let k = [0.0, 0.3, 2.0, 15.0];
        let options = TransportOptions { polar: 4, orders: 4 };
        let base = if base { Base::Mirror } else { Base::HalfSpace(black) };
        let model = LayeredReflection::new(&[None, Some(support), None, Some(white)], &[index], base, &k, options);
        // Thick enough for nothing to come through at some frequencies.
        let mm = if index == 1.0 { [0.4, 0.7, 0.2, 0.5] } else { [0.4, 0.7, 4.0, 0.5] };
        let tangents = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-5.5, 3.8, 0.1]];
        let mixtures = [grey, VolumeCoefficients { sigma_a: 1.0, g: 0.8, ..grey }];
        let mixed = mixtures.map(|volume| Mixed { volume, tangents: tangents.clone() });
        let slope = model.slope(&mm, &mixed);
        let same = |a: &[f64], b: &[f64], what: &str| {
            for (a, b) in a.iter().zip(b) {
                assert!((a - b).abs() < 2e-7 * (1.0 + 10.0 * b.abs()), "{what}, n {index}: {a} against {b}");
            }
        };
        same(&slope.reflection, &model.reflection(&mm, &mixtures), "R̂");
        const STEP: f64 = 1e-4;
        let difference = |more: Vec<f64>, less: Vec<f64>| -> Vec<f64> {
            more.iter().zip(&less).map(|(more, less)| (more - less) / (2.0 * STEP)).collect()
        };
        for layer in 0..mm.len() {
            let [more, less] = [STEP, -STEP].map(|by| {
                let mut moved = mm;
                moved[layer] += by;
                model.reflection(&moved, &mixtures)
            });
            same(&slope.per_mm[layer], &difference(more, less), "per mm");
        }
        for mixture in 0..2 {
            for (tangent, [s, a, g]) in tangents.iter().enumerate() {
                let [more, less] = [STEP, -STEP].map(|by| {
                    let mut moved = mixtures;
                    moved[mixture].sigma_s += by * s;
                    moved[mixture].sigma_a += by * a;
                    moved[mixture].g += by * g;
                    model.reflection(&mm, &moved)
                });
                same(&slope.along[mixture][tangent], &difference(more, less), &format!("mixture {mixture} {tangent}"));
            }
        }
    }
}

/// Layers of one order are what they are to every model, and over a mirror what their symmetric slab reflects and lets
/// through.
#[test]
fn layers_in_order_are_a_stack() {
    let [grey, support, white, black] = mixed_layers(1.0);
    let grid = FrequencyGrid::linear(8, 6.0);
    let options = TransportOptions { polar: 4, orders: 4 };
    let layers = [(grey, 0.4), (support, 0.7), (white, 0.5)];
    let places = [None, Some(support), Some(white)];
    let mm = layers.map(|layer| layer.1);
    let close = |found: &[f64], expected: &[f64]| {
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-7, "{a} against {b}");
        }
    };
    let over = |base| LayeredReflection::new(&places, &[1.0], base, grid.as_slice(), options).reflection(&mm, &[grey]);
    let spectra =
        |stack: &Stack<VolumeCoefficients>| Transport { stack, light: Light::Diffuse, options }.spectra(&grid);
    close(&over(Base::HalfSpace(black)), &spectra(&Stack::new(layers).over(black)).reflection);
    close(&over(Base::Nothing), &spectra(&Stack::new(layers)).reflection);
    let symmetric = layers.into_iter().chain(layers.into_iter().rev());
    let indices: Vec<_> = symmetric.clone().map(|layer| layer.0).collect();
    let modal = ModalReflection::new(&indices, None, grid.as_slice(), options);
    let slab: Vec<_> = symmetric.enumerate().map(|(place, layer)| (place, layer.1)).collect();
    let through = modal.discrete(&slab);
    let both: Vec<_> = through.reflection.iter().zip(&through.transmission).map(|(r, t)| r + t).collect();
    close(&over(Base::Mirror), &both);
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
