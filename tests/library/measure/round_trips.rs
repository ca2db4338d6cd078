//! Resins of the synthetic set come back, with and without defects, from a camera that is known or not.

use lumislice::measure::Finding;
use lumislice::measure::simulate::{Defects, Laboratory};

use super::{Round, errors, hold, measured, show, whole};

fn round_trip(resin: &str) {
    let (round, measurement) = whole(resin);
    let channel = &measurement.channels[0];
    let reflection = errors(&channel.reflection, &round.reflection);
    let transmission = errors(&channel.transmission, &round.transmission);
    show(&format!("{resin} reflection"), measurement, &reflection);
    println!("{resin} transmission: {transmission:.4?}");
    hold(resin, &reflection, 1.0);
    hold(resin, &transmission, 1.0);
}

#[test]
fn white_comes_back() {
    round_trip("white");
}

#[test]
fn black_comes_back() {
    round_trip("black");
}

#[test]
fn support_comes_back() {
    round_trip("support");
}

/// White's profiles check its card; black's would fit another as well, and that is said.
#[test]
fn an_albedo_that_nothing_checks_is_said() {
    let is_said = |resin: &str| {
        let (_, measurement) = whole(resin);
        let mut findings = measurement.channels[0].findings.iter();
        findings.any(|finding| matches!(finding, Finding::AlbedoUnchecked { series: "reflection", .. }))
    };
    assert!(is_said("black") && !is_said("white"));
}

#[test]
fn defects_are_named_and_do_little() {
    let round = Round::new("white", 22.0);
    let defects = Defects::together();
    let measurement = round.measure(&Laboratory { defects, ..Laboratory::default() });
    let channel = &measurement.channels[0];
    let reflection = errors(&channel.reflection, &round.reflection);
    show("white with defects", &measurement, &reflection);
    let transmission = errors(&channel.transmission, &round.transmission);
    println!("transmission: {transmission:.4?}");
    hold("reflection", &reflection, 2.0);
    hold("transmission", &transmission, 2.0);
    let found = |test: &dyn Fn(&Finding) -> bool| channel.reflection.scan.findings.iter().any(test);
    assert!(found(&|finding| matches!(finding, Finding::MislabelledExposure { file, measured_s, label_s }
        if file.ends_with("reflection-07.png") && (measured_s / label_s - 2.0).abs() < 0.05)));
    assert!(found(&|finding| matches!(finding, Finding::HotPixels { count, .. } if (18..=22).contains(count))));
    assert!(found(&|finding| matches!(finding, Finding::StrayLight { share, .. } if (0.012..0.022).contains(share))));
    assert!(found(&|finding| matches!(finding, Finding::Gradient { .. })));
    // Perspective tells the tilt: at 1 degree by light that goes far, the transmission's; nearer light leaves it to ±
    // 0.4 degrees.
    let tilt = channel.transmission.scan.findings.iter().find_map(|finding| match finding {
        Finding::Tilt { degrees, error } => Some((*degrees, *error)),
        _ => None,
    });
    let (degrees, error) = tilt.expect("a tilt");
    assert!((degrees - 1.0).abs() < 0.2 && (degrees - 1.0).abs() < 3.0 * error, "{degrees} ± {error}");
}

/// A shifted exposure is named and left out.
#[test]
fn a_shifted_exposure_is_left_out() {
    let round = Round::new("black", 22.0);
    let defects = Defects { shifted: Some((3, [0.8, -0.5])), ..Defects::default() };
    let measurement = round.measure(&Laboratory { defects, ..Laboratory::default() });
    let channel = &measurement.channels[0];
    let reflection = errors(&channel.reflection, &round.reflection);
    show("black, one exposure shifted", &measurement, &reflection);
    hold("reflection", &reflection, 1.0);
    let shift = channel.reflection.scan.findings.iter().find_map(|finding| match finding {
        Finding::Misaligned { file, shift_px } if file.ends_with("reflection-03.png") => Some(*shift_px),
        _ => None,
    });
    let [x, y] = shift.expect("the shifted exposure");
    assert!((x - 0.8).abs() < 0.2 && (y + 0.5).abs() < 0.2, "{x}, {y}");
}

/// Without gain, read noise, black level and saturation in the capture file they are told from the pictures.
#[test]
fn an_unknown_camera_is_measured_too() {
    let round = Round::new("white", 6.0);
    let folder = tempfile::tempdir().unwrap();
    let path = round.write(&Laboratory::default(), folder.path());
    let known = ["black-level", "saturation-level", "gain-e-per-dn", "read-noise-e"];
    let text = std::fs::read_to_string(&path).unwrap();
    let unknown: Vec<&str> = text.lines().filter(|line| !known.iter().any(|key| line.starts_with(key))).collect();
    std::fs::write(&path, unknown.join("\n")).unwrap();
    let measurement = measured(&path);
    let reflection = errors(&measurement.channels[0].reflection, &round.reflection);
    show("white, unknown camera", &measurement, &reflection);
    hold("reflection", &reflection, 1.0);
    let gain = measurement.channels[0].reflection.scan.gain_e_per_dn;
    assert!((gain / 2.6 - 1.0).abs() < 0.1, "gain {gain}");
}

/// 24 pictures of 24 megapixels: `scripts/prove measure` runs it; time and memory are those of the measurement alone.
#[test]
#[ignore = "writes 0.8 GB of pictures and takes minutes; scripts/prove measure runs it"]
fn full_size_pictures_stream() {
    let mut round = Round::new("support", 22.0);
    round.transmission = Round::new("white", 6.0).transmission;
    round.reflection.0.size = [6000, 4000];
    round.reflection.0.mm_per_pixel = 0.011;
    round.reflection.0.centre = [3011.3, 1987.8];
    let folder = tempfile::tempdir().unwrap();
    let path = round.write(&Laboratory::default(), folder.path());
    let start = std::time::Instant::now();
    let measurement = measured(&path);
    let seconds = start.elapsed().as_secs_f64();
    let reflection = errors(&measurement.channels[0].reflection, &round.reflection);
    show("24 pictures of 24 megapixels", &measurement, &reflection);
    println!("{seconds:.1} s");
    hold("full size", &reflection, 1.0);
}
