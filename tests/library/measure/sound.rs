//! Captures without a fault, at random: none is blamed.

use lumislice::measure::simulate::{Laboratory, Scene, SimulatedCamera, Truth};
use lumislice::measure::{Aperture, Finding};
use lumislice::optics::{SlabPlan, VolumeCoefficients};
use lumislice::watch::Unwatched;

use super::{Round, faults};

/// A number in a range, by a multiplicative congruence: the same everywhere.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, from: f64, to: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        from + (to - from) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// Even in the logarithm.
    fn scale(&mut self, from: f64, to: f64) -> f64 {
        self.roll(from.ln(), to.ln()).exp()
    }
}

/// Findings that blame nothing: what is usual, and the ends of what can be seen.
fn is_usual(finding: &Finding) -> bool {
    matches!(
        finding,
        Finding::NoFlatField
            | Finding::Estimated { .. }
            | Finding::Extrapolated { .. }
            | Finding::StrayLight { .. }
            | Finding::EnergyExcess { .. }
            | Finding::AlbedoUnchecked { .. }
            | Finding::Remark(_)
    )
}

#[test]
#[ignore = "60 captures, minutes; scripts/prove measure runs it"]
fn sixty_sound_captures_are_not_blamed() {
    let mut dice = Dice(17);
    let mut blamed = Vec::new();
    for number in 0..60_u64 {
        let reduced = dice.scale(1.5, 12.0);
        let g = dice.roll(0.0, 0.8);
        let absorption = reduced * dice.scale(0.003, 1.5);
        // What is true is traced by photons itself: ten thousand and more of them must come through.
        let decay = (3.0 * absorption * (absorption + reduced)).sqrt();
        let thickness = (dice.scale(2.5, 12.0) / (reduced + absorption)).min(3.0).min(5.0 / decay);
        let volume = VolumeCoefficients::new(reduced / (1.0 - g), absorption, g).unwrap();
        let plan = SlabPlan {
            resin: "any".into(),
            channel: "Y".into(),
            coefficients: volume,
            thickness_mm: thickness,
            seed: 100 + number,
            file: String::new(),
        };
        // Of what absorbs more than it scatters few do, and each ends soon: with 4 million, rings of the truth itself
        // at a ten-thousandth of the first were ± 18%, which counted as an error of 5%.
        let photons = if absorption > reduced { 16_000_000 } else { 4_000_000 };
        let profiles = plan.simulate(photons, &Unwatched).unwrap().profiles();
        let mut round = Round::new("black", 5.5);
        let (r, t) = (profiles.reflection.unwrap(), profiles.transmission.unwrap());
        round.resin.channels[0].slab_mm = thickness;
        let farthest = 1.5 * 6.0_f64.max(6.0 * thickness);
        let scene = |truth: &Truth, spot: Aperture, dice: &mut Dice| {
            let mut scene = Scene::around(truth, spot, farthest);
            scene.centre = scene.centre.map(|at| at + dice.roll(-20.0, 20.0));
            scene
        };
        let (r, t) = (Truth::new(&r, true), Truth::new(&t, false));
        let pinhole = dice.roll(0.2, 0.5_f64.min(0.5 * thickness).max(0.25));
        round.reflection = (scene(&r, Aperture::Square { side_mm: dice.roll(0.06, 0.15) }, &mut dice), r);
        round.transmission = (scene(&t, Aperture::Disc { diameter_mm: pinhole }, &mut dice), t);
        let count = 8 + (dice.roll(0.0, 5.0) as usize);
        let laboratory = Laboratory {
            camera: SimulatedCamera {
                full_well_e: dice.scale(20_000.0, 60_000.0),
                gain_e_per_dn: dice.roll(3.8, 5.0),
                read_noise_e: dice.roll(3.0, 9.0),
                ..SimulatedCamera::default()
            },
            exposures_s: (0..count).map(|i| 450_f64.powf(i as f64 / (count - 1) as f64) / 15.0).collect(),
            filled: dice.roll(0.3, 0.8),
            camera_known: dice.roll(0.0, 1.0) < 0.5,
            flat_field: dice.roll(0.0, 1.0) < 0.3,
            seed: 1000 + number,
            ..Laboratory::default()
        };
        let name = format!("{number}: reduced {reduced:.2}, absorption {absorption:.3}, g {g:.2}, {thickness:.2} mm");
        let folder = tempfile::tempdir().unwrap();
        let capture = round.write(&laboratory, folder.path());
        let read = lumislice::measure::Capture::read(&capture).unwrap();
        match lumislice::measure::measure(read, &Unwatched) {
            Err(error) => {
                println!("{name}: REFUSED {error}");
                blamed.push(format!("{name}: {error}"));
            }
            Ok(measurement) => {
                let channel = &measurement.channels[0];
                let fit = match &channel.fit {
                    Ok(fit) => format!("{:.1e} rms, g ± {:.2}", fit.residual, fit.g_uncertainty),
                    Err(refusal) => refusal.to_string(),
                };
                let off = faults::off(&round, &measurement);
                if off > 0.05 {
                    blamed.push(format!("{name}: off by {:.1}%", 100.0 * off));
                }
                println!("{name}: off by {:.2}%, fit {fit}", 100.0 * off);
                for (series, finding) in channel.all_findings() {
                    println!("    {series}: {finding}");
                    if !is_usual(finding) {
                        blamed.push(format!("{name}: {series}: {finding}"));
                    }
                }
                if channel.fit.is_err() {
                    blamed.push(format!("{name}: {fit}"));
                }
            }
        }
    }
    assert!(blamed.is_empty(), "{blamed:#?}");
}
