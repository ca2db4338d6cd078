//! The transport model against our own photons: thin layers, and stacks of support over white over black. Proofs of
//! minutes.

use super::reference::{BLACK, SUPPORT, WHITE, rms};
use crate::optics::{
    FrequencyGrid, InverseHankel, Light, MaterialSet, MonteCarlo, MonteCarloResult, RingEdges, Stack, Transport,
    TransportOptions, VolumeCoefficients,
};

fn photons(stack: &Stack<VolumeCoefficients>, count: u64) -> MonteCarloResult {
    let job = MonteCarlo {
        stack: stack.clone(),
        light: Light::Diffuse,
        photons: count,
        seed: 77,
        rings: RingEdges::growing(),
    };
    job.run().unwrap()
}

fn transport(stack: &Stack<VolumeCoefficients>) -> Transport<'_> {
    Transport { stack, light: Light::Diffuse, options: TransportOptions::default() }
}

#[test]
#[ignore = "a proof of a minute: 2.4e8 photons through thin layers"]
fn thin_layers_are_those_of_monte_carlo() {
    const PHOTONS: u64 = 20_000_000;
    let set = MaterialSet::builtin("synthetic").unwrap();
    let grid = FrequencyGrid::linear(2, 1.0);
    println!(
        "{:8} {:>6} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "resin", "µm", "R", "off", "KM off", "T", "off", "KM off"
    );
    for (name, resin) in [("white", WHITE), ("black", BLACK), ("support", SUPPORT)] {
        for mm in [0.020, 0.078, 0.156, 0.312] {
            let layer = Stack::new([(resin, mm)]);
            let exact = photons(&layer, PHOTONS);
            let found = transport(&layer).spectra(&grid);
            let km = set.resin(name).unwrap().1.channels[0].kubelka_munk.slab(mm);
            let (r, t) = (exact.reflection, exact.transmission);
            let off = [found.reflection[0] / r.mean - 1.0, found.transmission[0] / t.mean - 1.0].map(|off| 100.0 * off);
            let km = [km.reflection[0] / r.mean - 1.0, km.transmission[0] / t.mean - 1.0].map(|off| 100.0 * off);
            println!(
                "{name:8} {:6.0} {:9.5} {:8.2}% {:8.1}% {:9.5} {:8.3}% {:8.1}%",
                1e3 * mm,
                r.mean,
                off[0],
                km[0],
                t.mean,
                off[1],
                km[1]
            );
            assert!(off.iter().all(|off| off.abs() < 1.0), "{name} {mm} mm: {off:?}%");
        }
    }
}

#[test]
#[ignore = "a proof of minutes: 1e8 photons through ten stacks"]
fn stacks_over_white_over_black_are_those_of_monte_carlo() {
    const PHOTONS: u64 = 10_000_000;
    let grid = FrequencyGrid::default();
    println!(
        "{:>24} {:>9} {:>8} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "support, white, black mm", "albedo", "off", "R̂ rms", "T̂ rms", "straight", "50% off", "90% off"
    );
    for mm in [
        [1.0, 1.0, 1.0],
        [0.2, 0.1, 0.5],
        [0.5, 0.3, 0.2],
        [2.0, 0.15, 0.1],
        [0.1, 0.05, 0.05],
        [4.0, 0.5, 0.5],
        [0.3, 2.0, 0.3],
        [1.5, 0.08, 0.08],
        [0.05, 0.4, 0.04],
        [6.0, 2.0, 0.5],
    ] {
        let stack = Stack::new([(SUPPORT, mm[0]), (WHITE, mm[1]), (BLACK, mm[2])]);
        let exact = photons(&stack, PHOTONS);
        let model = transport(&stack);
        let found = model.spectra(&grid);
        let spectra = (exact.reflection_profile.hankel(&grid).values, exact.transmission_profile.hankel(&grid).values);
        let (r, t) = (rms(&found.reflection, &spectra.0), rms(&found.transmission, &spectra.1));
        let albedo = found.reflection[0] / exact.reflection.mean - 1.0;
        let half = exact.reflection_profile.radius_of_energy(0.5).unwrap();
        // Until R̂ is below a hundredth, where light stays near.
        let mut k_max = grid.as_slice()[grid.len() - 1];
        while half < 0.25 && k_max < 320.0 {
            let end = model.spectra(&FrequencyGrid::linear(2, k_max)).reflection;
            if end[1] < 0.01 * end[0] {
                break;
            }
            k_max *= 2.0;
        }
        let wide = FrequencyGrid::linear(1 + (127.0 * k_max / 20.0) as usize, k_max);
        let reflection = model.spectra(&wide).reflection;
        let inverse = InverseHankel::new(&reflection, &wide);
        let radius = |share: f64| {
            let exact = exact.reflection_profile.radius_of_energy(share).unwrap();
            inverse.radius_of_energy(share).map_or(f64::NAN, |found| found / exact - 1.0)
        };
        let (fifty, ninety) = (radius(0.5), radius(0.9));
        let straight = exact.unscattered_transmission.mean;
        println!(
            "{:>24} {:9.5} {:7.3}% {r:9.1e} {t:9.1e} {straight:9.1e} {:8.2}% {:8.2}%",
            format!("{mm:?}"),
            found.reflection[0],
            100.0 * albedo,
            100.0 * fifty,
            100.0 * ninety
        );
        let error = exact.reflection.standard_error / exact.reflection.mean;
        assert!(albedo.abs() < (3.0 * error).max(1e-3), "{mm:?}: albedo off by {albedo}");
        assert!(r < 3e-4, "{mm:?}: R̂ off by {r}");
        assert!(t < if straight < 0.01 { 1e-3 } else { 3e-3 }, "{mm:?}: T̂ off by {t}");
        let limit = if half < 0.25 { 0.03 } else { 0.01 };
        assert!(fifty.abs() < limit && ninety.abs() < limit, "{mm:?}: radii off by {fifty}, {ninety}");
    }
}
