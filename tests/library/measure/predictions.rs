//! What is predicted from a measurement against photons in the true resins.

use lumislice::optics::{
    ChannelPrediction, Light, MaterialFile, MaterialSet, Model, Stack, TransportOptions, VolumeCoefficients, predict,
};
use lumislice::watch::Unwatched;

use super::whole;

type Layers = &'static [(&'static str, f64)];

/// By Kubelka–Munk, whose parameters are read off the measured slabs.
const THICK: [Layers; 3] = [&[("white", 2.0)], &[("white", 4.0)], &[("white", 4.0), ("black", 0.25)]];
/// By transport, whose coefficients are fitted to them: Kubelka–Munk is wrong about thin layers and clear ones.
const THIN: [Layers; 4] = [
    &[("support", 1.0), ("white", 1.0)],
    &[("support", 1.0), ("white", 1.0), ("black", 1.0)],
    &[("white", 0.25), ("support", 4.5), ("black", 0.25)],
    &[("support", 0.3), ("white", 0.2), ("support", 0.5), ("white", 2.0)],
];

/// Three resins measured one by one; their [[resin]] tables in one file, as docs/measure.md says.
fn measured_set(folder: &std::path::Path) -> MaterialFile {
    let mut file = String::from("provenance = \"measured\"\n");
    for name in ["white", "black", "support"] {
        for (path, text) in whole(name).1.files(name) {
            if path.ends_with(".toml") {
                file += &text[text.find("[[resin]]").unwrap()..];
            } else {
                std::fs::write(folder.join(path), text).unwrap();
            }
        }
    }
    let path = folder.join("measured.toml");
    std::fs::write(&path, file).unwrap();
    MaterialFile::read(&path).unwrap()
}

/// Share by which albedo and half-energy radius are off.
fn off(found: &ChannelPrediction, truth: &ChannelPrediction) -> [f64; 2] {
    let half = |light: &ChannelPrediction| light.radius_of_energy_mm(0.5).unwrap();
    [found.reflection_hankel[0] / truth.reflection_hankel[0] - 1.0, half(found) / half(truth) - 1.0]
}

fn predicted(set: &MaterialSet, layers: Layers, model: Model) -> ChannelPrediction {
    let stack = Stack::new(layers.iter().map(|(name, mm)| (set.resin(name).unwrap().0, *mm)));
    predict(set, &stack, &model, &Unwatched).unwrap().light.remove(0)
}

#[test]
fn predictions_from_the_measurement_hold() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = measured_set(folder.path());
    // No coefficients are in the file: `predict`, `match` and jobs fit them by the same call.
    let refused = file.fit(None, &Unwatched).unwrap();
    assert!(refused.is_empty(), "{refused:?}");
    let measured = file.into_set(&Unwatched).unwrap();
    let exact = MaterialSet::builtin("synthetic").unwrap();
    for resin in &measured.resins {
        let (fit, truth) =
            (resin.channels[0].fit.unwrap(), exact.resin(&resin.name).unwrap().1.channels[0].volume.unwrap());
        println!("{}: {fit:.4?}", resin.name);
        let within = |found: f64, truth: f64, share: f64| (found / truth - 1.0).abs() < 2.0 * share;
        let reduced = |volume: &VolumeCoefficients| volume.sigma_s * (1.0 - volume.g);
        assert!(within(reduced(&fit.coefficients), reduced(&truth), fit.reduced_scattering_share));
        assert!(within(fit.coefficients.sigma_a, truth.sigma_a, fit.absorption_share));
        assert!((fit.coefficients.g - truth.g).abs() < 2.0 * fit.g_uncertainty);
    }
    for (thin, stack) in THICK.iter().map(|stack| (false, *stack)).chain(THIN.iter().map(|stack| (true, *stack))) {
        let transport = Model::Transport { light: Light::Diffuse, options: TransportOptions::default() };
        let photons = Model::MonteCarlo { light: Light::Diffuse, photons: 200_000, seed: 4 };
        let photons = predicted(&exact, stack, photons);
        let km = off(&predicted(&measured, stack, Model::KubelkaMunk), &photons);
        let found = predicted(&measured, stack, transport);
        let by_transport = off(&found, &photons);
        let of_measuring = off(&found, &predicted(&exact, stack, transport));
        let percent = |off: [f64; 2]| off.map(|share| format!("{:+.2}%", 100.0 * share)).join(", ");
        println!(
            "{stack:?}: albedo, half-energy radius: transport {}; km {}; measuring alone {}",
            percent(by_transport),
            percent(km),
            percent(of_measuring)
        );
        let hold = |[albedo, half]: [f64; 2]| albedo.abs() < 0.01 && half.abs() < 0.03;
        assert!(hold(by_transport), "{stack:?}: {by_transport:?}");
        assert!(thin || hold(km), "{stack:?}: {km:?}");
        assert!(of_measuring[0].abs() < 0.002 && of_measuring[1].abs() < 0.005, "{stack:?}: {of_measuring:?}");
    }
}
