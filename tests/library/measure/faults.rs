//! Captures that are wrong: each is refused, or what is wrong with it is said. None may be wrong and silent.

use lumislice::measure::simulate::{Defects, Laboratory};
use lumislice::measure::{Capture, Measurement, measure};
use lumislice::watch::Unwatched;

use super::{Errors, Round, errors};

/// Off by more than this, a measurement must not be silent.
const WRONG: f64 = 0.05;
/// Said of every capture that has no flat field, or of a dark resin, sound or not: no answer to anything.
const USUAL: [&str; 3] = ["no flat field", "is not given, estimated as", "nothing checks the albedo"];

/// What became of a capture.
struct Outcome {
    /// The refusal, or all that was noticed.
    said: Vec<String>,
    refused: bool,
    /// What the material is off by: albedos, half-energy radii, and the bright rings, as a share.
    off: f64,
}

impl Outcome {
    fn silent(&self) -> bool {
        !self.refused && self.said.iter().all(|line| USUAL.iter().any(|usual| line.contains(usual)))
    }

    fn says(&self, words: &str) -> bool {
        self.said.iter().any(|line| line.contains(words))
    }
}

fn outcome(round: &Round, laboratory: &Laboratory) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    let capture = round.write(laboratory, folder.path());
    match Capture::read(&capture).and_then(|capture| measure(capture, &Unwatched)) {
        Err(error) => Outcome { said: vec![error.to_string()], refused: true, off: f64::NAN },
        Ok(measurement) => Outcome { said: said(&measurement), refused: false, off: off(round, &measurement) },
    }
}

fn said(measurement: &Measurement) -> Vec<String> {
    let findings = measurement.channels[0].all_findings();
    findings.map(|(series, finding)| format!("{series}: {finding}")).collect()
}

/// The largest error, as a share.
pub(super) fn off(round: &Round, measurement: &Measurement) -> f64 {
    let channel = &measurement.channels[0];
    let worst = |errors: Errors| {
        if std::env::var_os("LUMISLICE_SHOW").is_some() {
            println!("    {errors:.4?}");
        }
        let bright = 10_f64.powf(errors.bright) - 1.0;
        bright.max(errors.albedo.abs()).max(errors.half_radius.abs())
    };
    worst(errors(&channel.reflection, &round.reflection)).max(worst(errors(&channel.transmission, &round.transmission)))
}

type Change = fn(&mut Laboratory, &mut Round);

/// Every fault: its name, what it does to the laboratory or the scene, and words that must be said (one of them).
const FAULTS: [(&str, Change, &[&str]); 22] = [
    (
        "level left out, longest exposure twice",
        |lab, _| {
            lab.camera_known = false;
            let longest = lab.exposures_s[lab.exposures_s.len() - 1];
            lab.exposures_s.push(longest);
        },
        &["saturation level (DN) is not given, estimated"],
    ),
    (
        "level left out, label 15 s written 30 s",
        |lab, _| {
            lab.camera_known = false;
            lab.exposures_s = vec![1.0 / 15.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 30.0, 30.0];
            lab.defects.mislabelled = Some((8, 0.5));
        },
        &["08.png is mislabelled"],
    ),
    ("labels reversed", |lab, _| lab.defects.labels_reversed = true, &["times are in reverse"]),
    (
        "labels reversed, level left out",
        |lab, _| {
            lab.camera_known = false;
            lab.defects.labels_reversed = true;
        },
        &["times are in reverse"],
    ),
    (
        "written through sRGB's curve",
        |lab, _| {
            lab.camera_known = false;
            lab.defects.encoded = true;
        },
        &["written through a curve"],
    ),
    ("card lit 20% unevenly", |lab, _| lab.defects.card_gradient = 0.2, &["grey card's picture is uneven"]),
    ("card and sample exchanged", |lab, _| lab.defects.card_swapped = true, &["exchanged"]),
    ("screen with and without exchanged", |lab, _| lab.defects.screen_swapped = true, &["exchanged"]),
    (
        "additive light in one frame, 5%",
        |lab, _| lab.defects.lit_up = Some((6, 0.05)),
        &["06.png has light of its own"],
    ),
    (
        "additive light in the longest frame, 1%",
        |lab, _| {
            lab.defects.lit_up = Some((11, 0.01));
        },
        &["11.png has light of its own"],
    ),
    (
        "additive light in the shortest frame, 10%",
        |lab, _| {
            lab.defects.lit_up = Some((0, 0.1));
        },
        &["00.png has light of its own"],
    ),
    (
        "spot near the border, 40 pixels",
        |_, round| {
            round.reflection.0.centre[0] = 40.3;
            round.transmission.0.centre[0] = 40.3;
        },
        &["from the border"],
    ),
    (
        "spot near the border, 25 pixels",
        |_, round| {
            round.reflection.0.centre[1] = 25.3;
            round.transmission.0.centre[1] = 25.3;
        },
        &["from the border", "whole rings"],
    ),
    ("vignetting 30%, spot in the middle", |lab, _| lab.defects.vignetting = 0.3, &["no flat field"]),
    (
        "vignetting 30%, spot aside",
        |lab, round| {
            lab.defects.vignetting = 0.3;
            round.reflection.0.centre[0] *= 0.7;
            round.transmission.0.centre[0] *= 0.7;
        },
        &["no flat field"],
    ),
    ("flare 2%", |lab, _| lab.defects.flare = 0.02, &["uneven", "blemish", "lopsided", "off their rings"]),
    ("flare 10%", |lab, _| lab.defects.flare = 0.1, &["uneven", "blemish", "lopsided", "off their rings"]),
    (
        "one frame shifted 1.2 pixels",
        |lab, _| {
            lab.defects.shifted = Some((3, [1.0, -0.7]));
        },
        &["03.png is shifted"],
    ),
    (
        "one frame shifted 6 pixels",
        |lab, _| {
            lab.defects.shifted = Some((3, [5.0, -3.3]));
        },
        &["03.png is shifted"],
    ),
    ("a hair of 0.06 mm", |lab, _| lab.defects.hair_mm = 0.06, &["hair", "something across"]),
    ("a hair of 0.15 mm", |lab, _| lab.defects.hair_mm = 0.15, &["hair", "something across"]),
    ("one frame at half its label", |lab, _| lab.defects.mislabelled = Some((6, 0.5)), &["06.png is mislabelled"]),
];

fn try_fault(resin: &str, farthest_mm: f64, (name, change, words): &(&str, Change, &[&str])) -> Result<(), String> {
    let mut laboratory = Laboratory::default();
    let mut round = Round::new(resin, farthest_mm);
    change(&mut laboratory, &mut round);
    let outcome = outcome(&round, &laboratory);
    println!(
        "{resin}, {name}: {}, off by {:.1}%",
        if outcome.refused { "REFUSED" } else { "measured" },
        100.0 * outcome.off
    );
    outcome.said.iter().for_each(|line| println!("    {line}"));
    if outcome.off > WRONG && outcome.silent() {
        return Err(format!("{resin}, {name}: wrong by {:.1}% and silent", 100.0 * outcome.off));
    }
    if !words.iter().any(|words| outcome.says(words)) {
        return Err(format!("{resin}, {name}: not said: {words:?}"));
    }
    Ok(())
}

/// Every fault with black, whose light is near, and with white, whose is not.
#[test]
#[ignore = "44 captures, minutes; scripts/prove measure runs it"]
fn no_fault_is_silent() {
    let all = FAULTS.iter().flat_map(|fault| [("black", 5.5), ("white", 12.0)].map(|(resin, mm)| (resin, mm, fault)));
    let wanted = std::env::var("LUMISLICE_FAULT").unwrap_or_default();
    let all: Vec<_> = all.filter(|(_, _, fault)| fault.0.contains(&wanted)).collect();
    assert!(!all.is_empty(), "no fault is called `{wanted}`");
    let failed: Vec<String> =
        all.into_iter().filter_map(|(resin, mm, fault)| try_fault(resin, mm, fault).err()).collect();
    assert!(failed.is_empty(), "{failed:#?}");
}

/// One of each kind, small.
#[test]
fn faults_of_each_kind_are_told() {
    for name in ["labels reversed", "written through sRGB's curve", "card and sample exchanged", "a hair of 0.15 mm"] {
        let fault = FAULTS.iter().find(|fault| fault.0 == name).unwrap();
        try_fault("black", 5.5, fault).unwrap();
    }
}

/// A flat field gives back what the lens' shading took.
#[test]
fn a_flat_field_corrects_shading() {
    let round = Round::new("black", 5.5);
    let defects = Defects { vignetting: 0.6, ..Defects::default() };
    let without = outcome(&round, &Laboratory { defects: defects.clone(), ..Laboratory::default() });
    let with = outcome(&round, &Laboratory { defects, flat_field: true, ..Laboratory::default() });
    println!("off by {:.4} without, {:.4} with a flat field", without.off, with.off);
    assert!(without.says("no flat field") && !with.says("no flat field"));
    assert!(with.off < 0.02 && with.off < without.off, "{} for {}", with.off, without.off);
}
