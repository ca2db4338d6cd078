//! The model against programs that are not ours, and against photons.

use super::*;
use crate::optics::{
    MonteCarlo, RingEdges,
    tests::reference::{BLACK, SUPPORT, WHITE, numbers, reference, rms, stack},
};

/// Totals of slabs of refractive index 1.5 by iadpython's adding–doubling, whose own error is 3e-4:
/// `scripts/fresnel-slabs`.
#[test]
fn slabs_in_air_are_those_of_adding_doubling() {
    let mut worst = [0.0_f64; 2];
    for row in numbers(include_str!("../../tests/fresnel_slabs.csv")) {
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
pub(super) const STACKS: [(&str, &[(VolumeCoefficients, f64)]); 11] = [
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
