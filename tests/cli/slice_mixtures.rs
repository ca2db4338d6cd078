//! Layers that are mixtures, from the job file to the slices and back.

use std::fs;

use serde_json::Value;

use crate::support::{Bench, JOB};

const STACK: &str = "stack = \"white:0.5,support:0.6\"";

/// The job with a grey on top and pictures in place of masks.
fn grey(stack: &str, formats: &str) -> String {
    JOB.replace(STACK, &format!("stack = \"{stack}\"")).replace("[\"png\", \"masks\"]", formats)
}

fn manifest(bench: &Bench, out: &str) -> Value {
    serde_json::from_slice(&fs::read(bench.path(format!("{out}/manifest.json"))).unwrap()).unwrap()
}

fn voxels(manifest: &Value, resin: &str) -> f64 {
    let materials = manifest["materials"].as_array().unwrap();
    materials.iter().find(|material| material["name"] == resin).unwrap()["voxels"].as_f64().unwrap()
}

#[test]
fn a_stacking_with_a_mixture_is_sliced_verified_and_looked_at() {
    let bench = Bench::new();
    bench.write("job.toml", grey("75% white + 25% black:1.2,support:0.4", "[\"png\", \"preview\"]").as_bytes());
    bench.slice("out");
    let found = manifest(&bench, "out");
    let layer = &found["stackings"][0]["stackings"][0]["layers"][0];
    assert_eq!(layer["resin"], "75% white + 25% black");
    // 20³ voxels, 6 deep in the grey by centres of 0.1, 0.3 … mm, all but the inner 8³; black is the core's, too.
    let in_grey = voxels(&found, "white") / 0.75;
    assert!((in_grey / f64::from(20 * 20 * 20 - 8 * 8 * 8) - 1.0).abs() < 0.01, "{in_grey}");
    bench.run(["verify", "out"]).exits(0);
    bench.run(["verify", "out", "--job", "job.toml"]).exits(0);
    let ran =
        bench.run(["look", "job.toml", "-o", "look", "--spots", "4", "--photons", "200", "--size", "32"]).exits(0);
    assert!(!ran.stderr.contains("warning: layers"), "{}", ran.stderr);
    let report = fs::read_to_string(bench.path("out/report.html")).unwrap();
    assert!(report.contains("75% white + 25% black"));
}

#[test]
fn slices_asked_for_alone_are_those_of_the_whole() {
    let bench = Bench::new();
    bench.write("job.toml", grey("90% white + 10% black:0.5,support:0.6", "[\"png\"]").as_bytes());
    bench.slice("whole");
    for (range, out) in [("0..7", "low"), ("7..20", "high")] {
        bench.run(["slice", "job.toml", "--slices", range, "-o", out]).exits(0);
        for entry in fs::read_dir(bench.path(format!("{out}/slices"))).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            let [part, whole] = [out, "whole"].map(|o| fs::read(bench.path(format!("{o}/slices/{name}"))).unwrap());
            assert_eq!(part, whole, "{name}");
        }
    }
}

#[test]
fn formats_that_hold_no_mixtures_refuse_them() {
    let bench = Bench::new();
    let stack = "90% white + 10% black:0.5,support:0.6";
    for format in ["masks", "stl", "3mf", "heights"] {
        bench.write("job.toml", grey(stack, &format!("[\"png\", \"{format}\"]")).as_bytes());
        let parts = ["output.formats: found", format, "mixtures", "expected"];
        bench.run(["slice", "job.toml", "-o", "out"]).refuses(2, &parts);
    }
    // The job says how: dithered voxels per mask.
    let job = grey(stack, "[\"masks\"]").replace("[stacking]", "[stacking]\nmixtures = true");
    bench.write("job.toml", job.as_bytes());
    bench.slice("out");
    for (stack, words) in [
        ("90% white + 20% black:0.5", "sum to 100%"),
        ("90% white + 10% blakc:0.5", "did you mean `black`?"),
        ("90% white + 10% support:0.5", "wash off"),
        ("90 white + 10% black:0.5", "sum to 100%"),
    ] {
        bench.write("job.toml", grey(stack, "[\"png\"]").as_bytes());
        bench.run(["slice", "job.toml", "-o", "no"]).refuses(2, &["target.stack", words]);
    }
}

/// Layers of 0.25 mm in voxels of 0.2: by centres 0.2 or 0.4, dithered 0.25 on every face.
#[test]
fn boundaries_are_dithered_where_the_job_says_so() {
    let bench = Bench::new();
    let job = |field: &str| {
        let job = grey("white:1.0,support:0.25,black:0.25,white:0.4", "[\"png\"]");
        job.replace("[output]", &format!("[field]\n{field}\n[output]"))
    };
    bench.write("job.toml", job("dither = false").as_bytes());
    bench.slice("steps");
    bench.write("plain.toml", job("").as_bytes());
    bench.run(["slice", "plain.toml", "-o", "plain"]).exits(0);
    let [steps, plain] =
        ["steps", "plain"].map(|out| fs::read(bench.path(format!("{out}/slices/slice_9.png"))).unwrap());
    assert_eq!(steps, plain, "pure layers keep their bytes");
    bench.write("job.toml", job("dither = true").as_bytes());
    bench.slice("dithered");
    let shell = |outer: f64, inner: f64| ((4.0 - 2.0 * outer).powi(3) - (4.0 - 2.0 * inner).powi(3)) / 0.008;
    let support = shell(1.0, 1.25);
    let [steps, dithered] = ["steps", "dithered"].map(|out| voxels(&manifest(&bench, out), "support"));
    assert!((dithered / support - 1.0).abs() < 0.03, "{dithered} of {support}");
    assert!((steps / support - 1.0).abs() > 0.15, "{steps} of {support}");
    bench.write("job.toml", job("distance = \"grid\"\ndither = true").as_bytes());
    bench.run(["slice", "job.toml", "-o", "no"]).refuses(2, &["field.dither", "distance = \"exact\""]);
}
