//! `predict`: the JSON that scripts read, the table people read, the profile both can plot.

use std::{fs, process::Stdio};

use crate::support::{Bench, keys, lumislice, run};

fn predict(more: &[&str]) -> crate::support::Ran {
    run(["predict", "--materials", "synthetic"].iter().chain(more))
}

#[test]
fn json_has_the_agreed_form() {
    let json = predict(&["--stack", "white:5.0", "--core", "black", "--json"]).exits(0).json();
    let expected = [
        "channels",
        "reflection",
        "transmission",
        "k_rad_per_mm",
        "reflection_hankel",
        "transmission_hankel",
        "glint",
        "half_energy_radius_mm",
    ];
    assert_eq!(keys(&json), expected);
    assert_eq!(json["channels"][0], "Y");
    // The paper: "about 0.6".
    let albedo = json["reflection"][0].as_f64().unwrap();
    assert!((albedo - 0.628).abs() < 2e-3, "{albedo}");
    assert_eq!(json["reflection_hankel"][0][0].as_f64(), Some(albedo));
    let k = json["k_rad_per_mm"].as_array().unwrap();
    assert_eq!((k.len(), k[0].as_f64(), k[127].as_f64()), (128, Some(0.0), Some(20.0)));
    let colours = run(["predict", "--materials", "inks-rgb", "--stack", "cyan:0.5", "--json"]).exits(0).json();
    for key in expected.into_iter().filter(|key| *key != "k_rad_per_mm") {
        assert_eq!(colours[key].as_array().unwrap().len(), 3, "{key}");
    }
}

#[test]
fn words_and_data_are_apart_and_nothing_passes_for_a_measurement() {
    for json in [&[][..], &["--json"]] {
        let ran = predict(&[&["--stack", "white:2.0, support:1.0"], json].concat()).exits(0);
        assert!(ran.stderr.starts_with("note: ") && ran.stderr.contains("not a measurement"), "{}", ran.stderr);
        assert!(!ran.stdout.contains("note"));
    }
    let table = predict(&["--stack", "white:2.0,support:1.0"]).stdout;
    assert!(
        ["albedo", "transmission", "50% within mm", "90% within mm"].iter().all(|word| table.contains(word)),
        "{table}"
    );
}

#[test]
fn photons_repeat_with_their_seed() {
    let trace = |seed: &str| {
        predict(&["--stack", "white:0.3", "--model", "monte-carlo", "--photons", "40000", "--seed", seed, "--json"])
            .exits(0)
    };
    let (one, again, other) = (trace("1"), trace("1"), trace("2"));
    assert_eq!(one.stdout, again.stdout);
    assert_ne!(one.stdout, other.stdout);
    let (a, b) = (one.json()["reflection"][0].as_f64().unwrap(), other.json()["reflection"][0].as_f64().unwrap());
    assert!((a - b).abs() < 0.02, "{a} against {b}");
    let beam =
        predict(&["--stack", "support:0.2", "--model", "monte-carlo", "--light", "normal", "--photons", "20000"]);
    assert!(beam.exits(0).stdout.contains("pencil beam"));
}

#[test]
fn csv_has_the_agreed_header_and_one_file_a_channel() {
    let bench = Bench::new();
    bench.run(["predict", "--materials", "synthetic", "--stack", "white:1", "--csv", "p.csv"]).exits(0);
    let text = fs::read_to_string(bench.path("p.csv")).unwrap();
    assert!(text.starts_with("r_mm,reflection_per_mm2,transmission_per_mm2\n0.005,"), "{}", &text[..80]);
    bench.run(["predict", "--materials", "inks-rgb", "--stack", "white:1", "--csv", "c.csv"]).exits(0);
    for channel in ["R", "G", "B"] {
        assert!(bench.path(format!("c-{channel}.csv")).is_file());
    }
    let ran = bench.run(["predict", "--materials", "synthetic", "--stack", "white:1", "--csv", "none/p.csv"]);
    ran.refuses(3, &["none/p.csv", "writing failed"]);
    let left: Vec<_> = fs::read_dir(bench.path("")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().contains(".part")), "{left:?}");
}

#[test]
fn what_cannot_be_predicted_is_refused() {
    predict(&["--stack", "white:1", "--light", "normal", "--model", "km"])
        .refuses(2, &["--light normal", "diffuse light only"]);
    predict(&["--stack", "white:1", "--photons", "10"]).refuses(2, &["monte-carlo"]);
    predict(&["--stack", "whit:1"]).refuses(2, &["`whit`", "did you mean `white`?"]);
    predict(&["--stack", "white:1", "--core", "blakc"]).refuses(2, &["did you mean `black`?"]);
    predict(&["--stack", "white"]).refuses(2, &["--stack: layer 1", "name:thickness"]);
    predict(&["--stack", "white:1,black:-1"]).refuses(2, &["layer 2", "-1"]);
    predict(&["--stack", ""]).refuses(2, &["empty stack"]);
    run(["predict", "--materials", "synthetik", "--stack", "a:1"]).refuses(2, &["did you mean `synthetic`?"]);
    run(["predict", "--materials", "none.toml", "--stack", "a:1"]).refuses(2, &["none.toml"]);
}

/// What nothing is said about is predicted as `match` and jobs have it.
#[test]
fn transport_is_what_predicts_unless_asked_otherwise() {
    let albedo = |more: &[&str]| {
        let stack = ["--stack", "white:0.1,support:0.4,white:0.6", "--core", "black", "--json"];
        predict(&[&stack, more].concat()).exits(0).json()["reflection"][0].as_f64().unwrap()
    };
    assert_eq!(albedo(&[]), albedo(&["--model", "transport"]));
    assert!((albedo(&["--model", "km"]) - albedo(&[])).abs() > 1e-3);
}

/// The model without photons and the photons, which share no code, predict the same.
#[test]
fn transport_predicts_what_photons_do() {
    let totals = |model: &str, light: &str| {
        let stack =
            ["--stack", "support:0.3,white:0.1", "--core", "black", "--light", light, "--model", model, "--json"];
        let json = predict(&stack).exits(0).json();
        (json["reflection"][0].as_f64().unwrap(), json["half_energy_radius_mm"][0].as_f64().unwrap())
    };
    for light in ["diffuse", "normal"] {
        let ((r, half), (photons, half_of_photons)) = (totals("transport", light), totals("monte-carlo", light));
        // Five standard errors of 2 million photons.
        assert!((r - photons).abs() < 1.5e-3, "{light}: {r} and {photons}");
        assert!((half / half_of_photons - 1.0).abs() < 0.03, "{light}: {half} and {half_of_photons}");
    }
}

#[test]
fn a_resin_without_coefficients_has_no_photons_to_trace() {
    let bench = Bench::new();
    bench.run(["predict", "--materials", "synthetic", "--stack", "white:1", "--csv", "p.csv"]).exits(0);
    bench.write(
        "m.toml",
        b"[[resin]]\nname = \"glass\"\nrgba = [1, 2, 3]\ndensity-g-per-cm3 = 1\nreflection = \"p.csv\"\nthickness-mm \
            = 1",
    );
    let ran = bench.run(["predict", "--materials", "m.toml", "--stack", "glass:1", "--json"]).exits(0);
    assert!((ran.json()["reflection"][0].as_f64().unwrap() - 0.55).abs() < 0.1);
    assert!(!ran.stderr.contains("note:"), "only built-in sets are no measurement: {}", ran.stderr);
    bench.write("p.csv", crate::matching::no_resins_profile().as_bytes());
    let ran = bench.run(["predict", "--materials", "m.toml", "--stack", "glass:1", "--model", "monte-carlo"]);
    ran.refuses(2, &["glass", "no coefficients fit"]);
    let ran = bench.run(["predict", "--materials", "m.toml", "--stack", "glass:1", "--model", "transport"]).exits(0);
    assert!(ran.stderr.contains("by Kubelka-Munk instead") && ran.stdout.contains("Kubelka-Munk"), "{}", ran.stderr);
}

#[test]
fn a_reader_that_leaves_early_is_no_error() {
    let mut child = lumislice()
        .args(["predict", "--materials", "synthetic", "--stack", "white:1", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !words.contains("error"), "{words}");
}
