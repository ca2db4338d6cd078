//! A tilt is seen by perspective: which angle is, and that the report says from where on.

use lumislice::measure::simulate::{Defects, Laboratory};
use lumislice::measure::{Finding, SeenTilt};

use super::Round;

/// The measured tilt in reflection and in transmission.
fn tilts(round: &Round, defects: Defects) -> [(SeenTilt, bool); 2] {
    let measurement = round.measure(&Laboratory { defects, ..Laboratory::default() });
    let channel = &measurement.channels[0];
    [&channel.reflection, &channel.transmission].map(|series| {
        let named = series.scan.findings.iter().any(|finding| matches!(finding, Finding::Tilt { .. }));
        (series.scan.tilt.unwrap(), named)
    })
}

/// White's reflection, which goes least far for its brightness, and black's transmission in small pictures. Tilts are
/// told within their errors, those of twice the stated limit are named, and none is named where there is none.
fn assert_named(stray: &[f64], tilts_degrees: &[f64]) {
    let mut round = Round::new("white", 22.0);
    round.transmission = Round::new("black", 5.5).transmission;
    for &stray_share in stray {
        for &tilt_degrees in tilts_degrees {
            let defects = Defects { tilt_degrees, tilt_direction_degrees: 30.0, stray_share, ..Defects::default() };
            for ((seen, named), name) in tilts(&round, defects).into_iter().zip(["white, R", "black, T"]) {
                println!(
                    "{name}, stray {stray_share}, tilt {tilt_degrees}: {:.2} ± {:.2}, named {named}, from {:.2} on",
                    seen.degrees,
                    seen.error,
                    seen.least()
                );
                assert_eq!(named, seen.is_seen(), "{name}");
                assert!((seen.degrees - tilt_degrees).abs() < 4.0 * seen.error, "{name}: {seen:?} for {tilt_degrees}");
                assert!(named || tilt_degrees < 2.0 * seen.least(), "{name}: {seen:?} for {tilt_degrees}");
                assert!(!named || tilt_degrees > 0.0, "{name}: {seen:?}");
            }
        }
    }
}

#[test]
fn tilts_are_named_from_the_stated_limit_on() {
    assert_named(&[0.02], &[0.0, 4.0]);
}

#[test]
#[ignore = "eight captures, a quarter of a minute; scripts/prove measure runs it"]
fn small_tilts_are_told_within_their_errors() {
    assert_named(&[0.0, 0.02], &[0.0, 1.0, 2.0, 4.0]);
}
