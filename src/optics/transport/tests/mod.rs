//! Laws of the model.

mod costs;
mod mixtures;
mod referees;

use proptest::prelude::*;

use super::*;
use crate::optics::{
    fresnel::refraction,
    tests::reference::{BLACK, SUPPORT, WHITE},
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
