//! `appearance.rounds`: what was asked is what prints, the same bytes every time, and found once.

use std::{collections::BTreeMap, sync::LazyLock};

use crate::support::{Bench, cube, sphere, stl};

const JOB: &str = r#"
[[object]]
mesh = "ball.stl"
[printer]
pitch-mm = [0.05, 0.05, 0.05]
[materials]
set = "synthetic"
[target]
kind = "texture"
albedo-value = 0.3
mean-free-path-mm = 0.5
[stacking]
mixtures = true
[appearance]
rounds = 2
[output]
formats = ["png"]
"#;

pub fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("ball.stl", &stl(&sphere(1.25, 24)));
    bench.write("job.toml", JOB.as_bytes());
    bench
}

/// What the job makes, and what the program says of it: made once for all tests.
static SLICED: LazyLock<(BTreeMap<String, Vec<u8>>, String)> = LazyLock::new(|| {
    let bench = bench();
    let said = bench.slice("out").stdout;
    let mut files = bench.files("out");
    files.insert("timings.json".into(), std::fs::read(bench.path("out/timings.json")).unwrap());
    (files, said)
});

/// With the job's folder, as a run has left it in `out`.
fn sliced() -> Bench {
    let bench = bench();
    SLICED.0.iter().for_each(|(path, bytes)| bench.write(format!("out/{path}"), bytes));
    bench
}

#[test]
fn rounds_bring_the_print_to_what_was_asked() {
    let (bench, said) = (sliced(), &SLICED.1);
    assert!(said.contains("round 2: printed less asked"), "{said}");
    let manifest = bench.manifest("out");
    let rounds = manifest["rounds"].as_array().unwrap();
    let bias: Vec<f64> = rounds.iter().map(|round| round["fit"][0]["bias"].as_f64().unwrap()).collect();
    assert_eq!(bias.len(), 2);
    // A ball of 2.5 mm is lighter than a flat slab; what was found in the first round the second sees made up for.
    assert!(bias[0].abs() > 0.03 && bias[1].abs() < 0.4 * bias[0].abs(), "{bias:?}");
    let look = ["look", "out", "--job", "job.toml", "--spots", "12", "--photons", "40000", "--json"];
    let seen = bench.run(look).exits(0).json();
    // Grains of a mixture stay, which a spot of half a millimetre does not even out.
    let fit = |name: &str| seen["against_asked"][0][name].as_f64().unwrap();
    assert!(fit("bias").abs() < 0.02 * 0.3 && fit("relative_rms") < 0.05, "{}", seen["against_asked"]);
}

#[test]
fn they_find_the_same_in_parts_and_on_any_number_of_threads() {
    let bench = sliced();
    let whole = bench.files("out");
    let mut alone = bench.command(["slice", "job.toml", "-o", "alone", "--slices", "7..12"]);
    assert!(alone.env("RAYON_NUM_THREADS", "1").output().unwrap().status.success());
    let part = bench.files("alone");
    for name in ["rounds.json", "stackings.json", "slices/slice_7.png", "slices/slice_11.png"] {
        assert!(part[name] == whole[name], "{name}");
    }
}

#[test]
fn a_worker_takes_what_another_found() {
    let bench = sliced();
    let whole = bench.files("out");
    let worker = ["slice", "job.toml", "-o", "part", "--slices", "3..5", "--rounds-from", "out"];
    bench.run(worker).exits(0);
    assert!(bench.files("part")["slices/slice_4.png"] == whole["slices/slice_4.png"]);
    assert!(bench.files("part")["rounds.json"] == whole["rounds.json"]);
}

#[test]
fn what_they_found_is_taken_from_the_folder() {
    let bench = sliced();
    bench.run(["verify", "out", "--job", "job.toml"]).exits(0);
    // Other factors make other layers, so they were read.
    let found = bench.files("out")["rounds.json"].clone();
    let mut rounds: serde_json::Value = serde_json::from_slice(&found).unwrap();
    for factor in rounds["objects"][0]["ln_factor_thousandths"][0].as_array_mut().unwrap() {
        *factor = serde_json::json!(-900);
    }
    bench.write("out/rounds.json", rounds.to_string().as_bytes());
    let ran = bench.run(["verify", "out", "--job", "job.toml"]).exits(1);
    assert!(ran.stdout.contains("stackings"), "{}", ran.stdout);
    // Of another job nothing is taken.
    bench.write("out/rounds.json", &found);
    bench.write("job.toml", JOB.replace("rounds = 2", "rounds = 1").as_bytes());
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).exits(0);
    assert_eq!(bench.manifest("out")["rounds"].as_array().unwrap().len(), 1);
    bench.run(["verify", "out", "--job", "job.toml"]).exits(0);
}

#[test]
fn rounds_want_a_model_that_holds() {
    let bench = bench();
    bench.write("job.toml", JOB.replace("mixtures = true", "model = \"km\"").as_bytes());
    bench.run(["slice", "job.toml", "-o", "out"]).refuses(2, &["appearance.rounds", "Kubelka-Munk", "transport"]);
}

#[test]
fn without_rounds_nothing_is_looked_at() {
    let bench = bench();
    bench.write("job.toml", JOB.replace("rounds = 2", "rounds = 0\nthin-parts = false").as_bytes());
    bench.slice("out");
    assert!(!bench.files("out").contains_key("rounds.json"));
    assert!(bench.manifest("out")["rounds"].is_null());
}

#[test]
fn the_timings_tell_of_every_round() {
    let bench = sliced();
    let timings: serde_json::Value =
        serde_json::from_slice(&std::fs::read(bench.path("out/timings.json")).unwrap()).unwrap();
    let seconds = |name: &str| timings[name].as_f64().unwrap();
    let rounds: Vec<f64> =
        timings["rounds_s"].as_array().unwrap().iter().map(|round| round.as_f64().unwrap()).collect();
    assert_eq!(rounds.len(), 2);
    assert!(
        rounds.iter().all(|round| *round > 0.0) && rounds.iter().sum::<f64>() < seconds("preparing_s"),
        "{timings}"
    );
    assert!(seconds("preparing_s") + seconds("slicing_s") <= seconds("total_s"), "{timings}");
    // Those that lie in the folder are not made again.
    bench.run(["slice", "job.toml", "-o", "part", "--slices", "3..5", "--rounds-from", "out"]).exits(0);
    let part: serde_json::Value =
        serde_json::from_slice(&std::fs::read(bench.path("part/timings.json")).unwrap()).unwrap();
    assert_eq!(part["rounds_s"], serde_json::json!([]));
}

/// An albedo that no resin has: after the first correction all that is left is out of reach.
#[test]
fn rounds_end_where_nothing_is_left_to_reach() {
    let bench = bench();
    bench.write(
        "job.toml",
        JOB.replace("albedo-value = 0.3", "albedo-value = 0.99").replace("rounds = 2", "rounds = 6").as_bytes(),
    );
    let ran = bench.slice("out");
    let rounds = bench.manifest("out")["rounds"].as_array().unwrap().clone();
    assert!(rounds.len() < 6, "{}", ran.stdout);
    let last = &rounds[rounds.len() - 1];
    let words = ["nothing-left", "out-of-reach", "no-better", "worse"];
    assert!(words.iter().any(|word| last["ended"] == *word), "{last}");
    assert!(rounds[..rounds.len() - 1].iter().all(|round| round.get("ended").is_none()));
    assert!(ran.stdout.contains("no further round: "), "{}", ran.stdout);
}

/// Beside an edge light comes in by the other face. Corrections that change over half a millimetre left a dark cube
/// half as light again there, 0.15 mm from its edges; what all of the dark resin cannot make up for is a quarter.
#[test]
fn dark_edges_print_dark() {
    let bench = Bench::new();
    bench.write("ball.stl", &stl(&cube(4.0)));
    let job = JOB.replace("albedo-value = 0.3", "albedo-value = 0.2").replace("path-mm = 0.5", "path-mm = 0.3");
    bench.write("job.toml", job.replace("rounds = 2", "rounds = 3").as_bytes());
    bench.slice("out");
    let (low, near, far) = (0.0, 0.15, 3.85);
    let along = [0.4, 1.0, 1.4, 2.0, 2.6, 3.0, 3.6];
    let beside = along.iter().flat_map(|&at| [[at, low, near], [low, at, far], [near, at, 4.0], [4.0, near, at]]);
    let at = beside.flat_map(|[x, y, z]| ["--at".to_owned(), format!("{x},{y},{z}")]);
    let look = ["look", "out", "--job", "job.toml", "--spots", "1", "--photons", "10000", "--json"];
    let seen = bench.run(look.map(str::to_owned).into_iter().chain(at)).exits(0).json();
    let spots = &seen["spots"].as_array().unwrap()[1..];
    assert_eq!(spots.len(), 28);
    let off = |spot: &serde_json::Value| spot["printed"][0].as_f64().unwrap() / 0.2 - 1.0;
    let mean = spots.iter().map(off).sum::<f64>() / 28.0;
    assert!((0.0..0.36).contains(&mean), "{mean}");
}
