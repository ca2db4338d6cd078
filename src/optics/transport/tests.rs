//! Laws of the model, and its figures against programs that are not ours.

use proptest::prelude::*;

use super::*;
use crate::optics::tests::reference::{BLACK, SUPPORT, WHITE, numbers, reference, rms, stack};

fn spectra(
    layers: &[(VolumeCoefficients, f64)],
    base: Option<VolumeCoefficients>,
    light: Light,
    k: &[f64],
) -> TransportSpectra {
    let grid = FrequencyGrid::linear(k.len(), k[k.len() - 1]);
    Transport { layers, base, light, options: TransportOptions::default() }.spectra(&grid)
}

fn volume() -> impl Strategy<Value = VolumeCoefficients> {
    (0.0..20.0, 0.0..5.0, -0.9..0.95).prop_map(|(sigma_s, sigma_a, g)| VolumeCoefficients {
        sigma_s,
        sigma_a,
        g,
        refractive_index: 1.0,
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
            prop_assert!(r.abs() + t.abs() <= 1.0 + 1e-9, "{r} + {t}");
        }
    }

    #[test]
    fn without_absorption_no_light_is_lost(layers in prop::collection::vec((volume(), 0.01..3.0), 1..4), light in light()) {
        let clear: Vec<_> = layers.iter().map(|(v, mm)| (VolumeCoefficients { sigma_a: 0.0, ..*v }, *mm)).collect();
        let found = spectra(&clear, None, light, &[0.0, 5.0]);
        prop_assert!((found.reflection[0] + found.transmission[0] - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_layer_split_in_two_is_the_same(resin in volume(), mm in 0.01..3.0, share in 0.01..0.99, light in light()) {
        let whole = spectra(&[(resin, mm)], None, light, &[0.0, 10.0]);
        let split = spectra(&[(resin, share * mm), (resin, (1.0 - share) * mm)], None, light, &[0.0, 10.0]);
        for (a, b) in whole.reflection.iter().chain(&whole.transmission).zip(split.reflection.iter().chain(&split.transmission)) {
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

/// Modes against doubling: two ways to the same matrices, which share the equations only.
#[test]
fn modes_and_doubling_agree() {
    let k = [0.0, 0.7, 5.0, 20.0];
    let grid = FrequencyGrid::linear(k.len(), 20.0);
    let resins = [WHITE, SUPPORT, BLACK];
    let options = TransportOptions::REFLECTION;
    for base in [None, Some(2)] {
        let modal = ModalReflection::new(&resins, base, grid.as_slice(), options);
        for stack in [
            vec![],
            vec![(0, 1.0)],
            vec![(1, 1e-3)],
            vec![(0, 0.25), (1, 2.0), (0, 0.5)],
            vec![(0, 0.05), (1, 0.078), (2, 0.03), (1, 3.0), (1, 0.0), (0, 8.0)],
        ] {
            let layers: Vec<_> = stack.iter().map(|&(resin, mm)| (resins[resin], mm)).collect();
            let base = base.map(|base| resins[base]);
            let exact = Transport { layers: &layers, base, light: Light::Diffuse, options }.spectra(&grid);
            for (found, exact) in modal.reflection(&stack).iter().zip(&exact.reflection) {
                assert!((found - exact).abs() < 1e-10, "{stack:?}: {found} and {exact}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn modes_hold_for_any_resins(resins in prop::collection::vec(volume(), 2..4), mm in prop::collection::vec(0.001..3.0, 1..4)) {
        let grid = FrequencyGrid::linear(3, 12.0);
        let options = TransportOptions { polar: 4, orders: 5 };
        let modal = ModalReflection::new(&resins, Some(0), grid.as_slice(), options);
        let stack: Vec<_> = mm.iter().enumerate().map(|(i, &mm)| ((i + 1) % resins.len(), mm)).collect();
        let layers: Vec<_> = stack.iter().map(|&(resin, mm)| (resins[resin], mm)).collect();
        let model = Transport { layers: &layers, base: Some(resins[0]), light: Light::Diffuse, options };
        for (found, exact) in modal.reflection(&stack).iter().zip(&model.spectra(&grid).reflection) {
            prop_assert!((found - exact).abs() < 1e-6, "{found} and {exact}");
        }
    }

    #[test]
    fn slopes_are_those_of_differences(mm in prop::collection::vec(0.02..2.0, 3)) {
        /// Step of the differences, mm: their error is of its square.
        const STEP: f64 = 1e-4;
        let modal = ModalReflection::new(&[WHITE, SUPPORT, BLACK], Some(2), &[0.0, 3.0, 20.0], TransportOptions::REFLECTION);
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

#[test]
fn nothing_is_in_the_way() {
    let found = spectra(&[], None, Light::Diffuse, &[0.0, 20.0]);
    assert_eq!(found.reflection, [0.0, 0.0]);
    assert!(found.transmission.iter().all(|t| (t - 1.0).abs() < 1e-8), "{:?}", found.transmission);
}

/// Totals of every slab by adding–doubling with 40 streams: 16 directions agree within 1e-5.
#[test]
fn totals_are_those_of_adding_doubling() {
    let Some(text) = reference("adding_doubling_slabs.csv") else { return };
    let mut worst = [0.0_f64; 2];
    for row in numbers(&text) {
        let [albedo, tau, g, r_normal, t_normal, r_diffuse, t_diffuse, _] = row[..] else { panic!("columns") };
        let layers = [(VolumeCoefficients { sigma_s: albedo, sigma_a: 1.0 - albedo, g, refractive_index: 1.0 }, tau)];
        let options = TransportOptions { polar: 16, orders: 1 };
        let exact = [(Light::Normal, r_normal, t_normal), (Light::Diffuse, r_diffuse, t_diffuse)];
        for (worst, (light, r, t)) in worst.iter_mut().zip(exact) {
            let model = Transport { layers: &layers, base: None, light, options };
            let found = model.spectra(&FrequencyGrid::linear(2, 1.0));
            *worst = worst.max((found.reflection[0] - r).abs()).max((found.transmission[0] - t).abs());
        }
    }
    println!("furthest from adding-doubling: normal {:.1e}, diffuse {:.1e}", worst[0], worst[1]);
    assert!(worst[0] < 1e-5 && worst[1] < 1e-6, "{worst:?}");
}

/// The multi-layer Monte Carlo's own noise is 1e-4 to 2e-4 of R̂ rms.
#[test]
fn spectra_are_those_of_monte_carlo() {
    let grid = FrequencyGrid::default();
    let stacks: [(&str, &[(VolumeCoefficients, f64)]); 11] = [
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
    println!("{:18} {:>9} {:>9} {:>9} {:>9}", "stack", "albedo", "off", "R̂ rms", "T̂ rms");
    for (name, layers) in stacks {
        let Some((reflection, transmission)) = stack(name) else { return };
        let (reflection, transmission) = (reflection.hankel(&grid).values, transmission.hankel(&grid).values);
        let model = Transport { layers, base: None, light: Light::Diffuse, options: TransportOptions::default() };
        let found = model.spectra(&grid);
        let off = found.reflection[0] / reflection[0] - 1.0;
        let (r, t) = (rms(&found.reflection, &reflection), rms(&found.transmission, &transmission));
        println!("{name:18} {:9.5} {:8.3}% {r:9.1e} {t:9.1e}", found.reflection[0], 100.0 * off);
        assert!(off.abs() < 1e-3 && r < 3e-4, "{name}: albedo off by {off}, R̂ by {r}");
        // 5% of the light crosses 1 mm of support unscattered.
        assert!(t < if name == "S1" { 3e-3 } else { 1e-3 }, "{name}: T̂ off by {t}");
    }
}
