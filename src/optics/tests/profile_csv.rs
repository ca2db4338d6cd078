//! Profile files: what is written is read back, and what is wrong is named with its line.

use std::path::Path;

use crate::optics::{ProfileFile, RadialProfile};

fn parse(text: &str) -> Result<ProfileFile, String> {
    ProfileFile::parse(text, Path::new("p.csv")).map_err(|error| error.to_string())
}

/// A profile of ten samples with one of its lines replaced.
fn with_line(number: usize, line: &str) -> String {
    let mut lines: Vec<String> = vec!["r_mm,reflection_per_mm2".into()];
    lines.extend((1..=10).map(|i| format!("{},{}", f64::from(i) * 0.1, 1.0 / f64::from(i))));
    lines[number - 1] = line.into();
    lines.join("\n")
}

#[test]
fn written_profiles_read_back() {
    let edges: Vec<f64> = (0..=12).map(|i| f64::from(i) * 0.1).collect();
    let values: Vec<f64> = (0..12).map(|i| 0.125 / f64::from(1 << i)).collect();
    let rings = |scale: f64| {
        let values: Vec<f64> = values.iter().map(|v| v * scale).collect();
        let errors = values.iter().map(|v| v * 0.5).collect();
        RadialProfile::from_rings(edges.clone(), values, Some(errors)).unwrap()
    };
    let file = ProfileFile { reflection: Some(rings(1.0)), transmission: Some(rings(0.25)) };
    let again = parse(&file.to_csv("two\nlines")).unwrap();
    for (a, b) in [(&file.reflection, &again.reflection), (&file.transmission, &again.transmission)] {
        let (a, b) = (a.as_ref().unwrap(), b.as_ref().unwrap());
        for (a, b) in [(a.value_per_mm2(), b.value_per_mm2()), (a.r_mm(), b.r_mm())] {
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 5e-6 * a), "{a:?} {b:?}");
        }
        assert!(b.standard_error().is_some() && b.ring_edges().is_some());
    }
}

#[test]
fn a_target_needs_no_transmission_and_may_carry_comments() {
    let file = parse(&format!("# a target\n\n{}", with_line(1, "r_mm, reflection_per_mm2"))).unwrap();
    assert_eq!(file.reflection.unwrap().r_mm().len(), 10);
    assert!(file.transmission.is_none());
}

#[test]
fn a_profile_starting_at_zero_is_a_row_of_rings() {
    let text = (0..10).fold("r_mm,reflection_per_mm2\n".to_string(), |text, i| text + &format!("{i},0.001\n"));
    let profile = parse(&text).unwrap().reflection.unwrap();
    assert!((profile.energy() - 1e-3 * std::f64::consts::PI * 9.5 * 9.5).abs() < 1e-12);
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let cases = [
        ("", "p.csv: header: found an empty file"),
        (&with_line(1, "r,reflection_per_mm2"), "p.csv:1: header: found column `r`"),
        (&with_line(1, "r_mm,reflexion_per_mm2"), "did you mean reflection_per_mm2?"),
        (&with_line(1, "r_mm,r_mm"), "p.csv:1: header: found `r_mm` twice"),
        (&with_line(4, "0.3"), "p.csv:4: row: found 1 columns, expected 2"),
        (&with_line(4, "0.3,abc"), "p.csv:4: reflection_per_mm2: found `abc`, expected a number"),
        (&with_line(4, "0.3,NaN"), "p.csv:4: reflection_per_mm2: found NaN"),
        (&with_line(4, "0.3,-0.5"), "p.csv:4: reflection_per_mm2: found -0.5"),
        (&with_line(4, "0.05,0.1"), "p.csv:4: reflection_per_mm2: found radius 0.05"),
        (&with_line(4, "0.3,50"), "p.csv:1: reflection_per_mm2: found an albedo of"),
        ("r_mm,reflection_per_mm2\n1,1\n", "found 1 samples in all, expected at least 8"),
    ];
    for (text, expected) in cases {
        let message = parse(text).unwrap_err();
        assert!(message.contains(expected), "{message:?} lacks {expected:?}");
        assert_eq!(message.lines().count(), 1);
    }
}
