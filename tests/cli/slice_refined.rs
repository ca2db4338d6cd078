//! Jobs whose stackings are judged by the transport model.

use std::fs;

use serde_json::Value;

use crate::support::{Bench, JOB};

const FOUND: &str = "kind = \"texture\"\nalbedo-value = 0.4\nmean-free-path-mm = 0.8";
const GIVEN: &str = "kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"";

fn job(bench: &Bench, target: &str, stacking: &str) {
    let job = JOB.replace(GIVEN, target).replace("core = \"black\"", &format!("core = \"black\"\n{stacking}"));
    bench.write("job.toml", job.as_bytes());
}

/// The only stacking of the job in `out`.
fn stacking(bench: &Bench, out: &str) -> Value {
    let text = fs::read(bench.path(out).join("stackings.json")).unwrap();
    let json: Value = serde_json::from_slice(&text).unwrap();
    let find = |json: &Value| json["stackings"][0].clone();
    if json.is_array() { find(&json[0]) } else { find(json.get("objects").map_or(&json, |objects| &objects[0])) }
}

#[test]
fn a_job_may_ask_for_refined_stackings() {
    let bench = Bench::new();
    job(&bench, FOUND, "model = \"km\"");
    bench.slice("km");
    job(&bench, FOUND, "model = \"transport\"\nmin-layer-mm = 0.2\nlayer-step-mm = 0.1");
    bench.slice("transport");
    let (km, refined) = (stacking(&bench, "km"), stacking(&bench, "transport"));
    assert_eq!(km["search"]["transport"], Value::Null);
    assert!(refined["search"]["transport"]["objective"].as_f64().unwrap() > 0.0, "{refined}");
    assert_eq!(refined["search"]["proven"], true);
    for layer in refined["layers"].as_array().unwrap() {
        let steps = layer["thickness_mm"].as_f64().unwrap() / 0.1;
        assert!(steps > 1.9 && (steps - steps.round()).abs() < 1e-9, "{refined}");
    }
    bench.run(["verify", "transport"]).exits(0);
}

/// Faces look along x and y as well as along z.
#[test]
fn no_layer_is_thinner_than_a_voxel_is_long() {
    let bench = Bench::new();
    job(&bench, FOUND, "model = \"transport\"");
    let uneven = fs::read_to_string(bench.path("job.toml")).unwrap().replace("0.2, 0.2, 0.2", "0.1, 0.25, 0.05");
    bench.write("job.toml", uneven.as_bytes());
    let ran = bench.slice("out");
    let found = stacking(&bench, "out");
    for layer in found["layers"].as_array().unwrap() {
        assert!(layer["thickness_mm"].as_f64().unwrap() > 0.25 - 1e-9, "{found}");
    }
    assert!(!ran.stderr.contains("thinner"), "{}", ran.stderr);
}

#[test]
fn a_given_stacking_is_predicted_by_the_model_asked_for() {
    let bench = Bench::new();
    let albedo = |stacking_keys: &str, out: &str| {
        job(&bench, GIVEN, stacking_keys);
        bench.slice(out);
        stacking(&bench, out)["predicted_albedo"][0].as_f64().unwrap()
    };
    let (km, transport) = (albedo("model = \"km\"", "km"), albedo("model = \"transport\"", "transport"));
    let stack = ["--stack", "white:0.5,support:0.6", "--core", "black", "--model", "transport", "--json"];
    let json = bench.run(["predict", "--materials", "synthetic"].iter().chain(&stack)).exits(0).json();
    assert!((transport - json["reflection"][0].as_f64().unwrap()).abs() < 1e-3);
    assert!((km - transport).abs() > 1e-4, "{km} and {transport}");
}

#[test]
fn thicknesses_that_nothing_uses_are_refused() {
    let bench = Bench::new();
    job(&bench, FOUND, "min-layer-mm = 0.2\nmodel = \"km\"");
    bench.run(["slice", "job.toml"]).refuses(2, &["job.toml:14", "stacking.min-layer-mm", "model = \"transport\""]);
    job(&bench, FOUND, "model = \"transprot\"");
    bench.run(["slice", "job.toml"]).refuses(2, &["stacking.model", "did you mean `transport`?"]);
    assert!(!bench.path("job-out").exists());
}
