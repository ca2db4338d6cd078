//! `lumislice factor`.

use serde_json::Value;

use lumislice::target::bssrdf::write_npy;

use super::support::{Bench, keys};

/// A patch of 8 × 6 texels with windows of 9 × 9, brighter towards the right.
fn bench() -> Bench {
    let bench = Bench::new();
    let (mut responses, mut albedo) = (Vec::new(), Vec::new());
    for _y in 0..6 {
        for x in 0..8_i32 {
            let level = |x: i32| 0.2 + 0.05 * f64::from(x);
            for dy in -4..=4_i32 {
                for dx in -4..=4_i32 {
                    let r = 0.1 * f64::from(dx * dx + dy * dy).sqrt().max(0.35);
                    let value = (level(x) * level(x + dx).max(0.01)).sqrt() * (-2.0 * r).exp() / r / 5.0;
                    responses.push(value as f32);
                }
            }
            albedo.push((1.2 * level(x)) as f32);
        }
    }
    bench.write("patch/responses.npy", &write_npy(&[6, 8, 9, 9], &responses));
    bench.write("patch/albedo.npy", &write_npy(&[6, 8], &albedo));
    let header = "version = 1\npitch-mm = 0.1\nresponses = \"responses.npy\"\nalbedo = \"albedo.npy\"\n";
    bench.write("patch/dataset.toml", header.as_bytes());
    bench
}

#[test]
fn a_patch_becomes_a_folder_of_profiles() {
    let bench = bench();
    let ran = bench.run(["factor", "patch", "-o", "out", "-k", "5", "--compare", "--json"]).exits(0);
    let record = ran.json();
    assert_eq!(
        keys(&record),
        [
            "generator",
            "version",
            "pitch_mm",
            "width",
            "height",
            "channels",
            "window",
            "ring_edges_mm",
            "window_rings",
            "settings",
            "fits",
            "texels_without_data",
            "cluster_rms",
            "clusters"
        ]
    );
    assert_eq!((&record["version"], &record["width"], &record["height"]), (&1.into(), &8.into(), &6.into()));
    let fit = &record["fits"][0];
    assert!(fit["relative_error"].as_f64().unwrap() < 0.02, "{fit}");
    assert!(
        fit["simpler"]
            .as_array()
            .unwrap()
            .iter()
            .all(|s| s["relative_error"].as_f64() > fit["relative_error"].as_f64())
    );
    assert!(fit["tail"]["albedo_rms_error_with"].as_f64().unwrap() < 1e-6);
    let clusters = record["clusters"].as_array().unwrap();
    assert_eq!(clusters.len(), 5);
    let shares: f64 = clusters.iter().map(|cluster| cluster["share"].as_f64().unwrap()).sum();
    assert!((shares - 1.0).abs() < 1e-12);
    let files = bench.files("out");
    assert_eq!(files["factored.json"], ran.stdout.as_bytes());
    let manifest = bench.manifest("out");
    assert_eq!(manifest["files"].as_array().unwrap().len() + 1, files.len(), "{manifest}");
    for name in ["albedo.png", "clusters.png", "labels.png", "palette.png", "residual.png", "profiles/cluster_004.csv"]
    {
        assert!(files.contains_key(name), "{name}");
    }
    // What a profile file says is what a match can be asked for.
    let albedo = clusters[0]["albedo"][0].as_f64().unwrap();
    let args = ["match", "--materials", "synthetic", "--target", "out/profiles/cluster_000.csv", "--json"];
    let matched: Value = bench.run(args).exits(0).json();
    assert!(matched["stack"].as_array().is_some_and(|stack| !stack.is_empty()), "albedo {albedo}");

    bench.run(["factor", "patch", "-o", "out"]).refuses(2, &["out: found a folder that is not empty"]);
    bench.run(["factor", "patch", "-o", "out", "-k", "3", "--overwrite"]).exits(0);
    assert!(!bench.files("out").contains_key("profiles/cluster_004.csv"), "files of the earlier run are gone");
}

#[test]
fn the_same_bytes_whatever_the_threads() {
    let bench = bench();
    for threads in ["1", "3"] {
        let out = format!("out{threads}");
        let mut command = bench.command(["factor", "patch", "-o", &out]);
        assert!(command.env("RAYON_NUM_THREADS", threads).status().unwrap().success());
    }
    assert_eq!(bench.files("out1"), bench.files("out3"));
}

#[test]
fn bad_input_is_refused_in_one_line() {
    let bench = bench();
    let refuses = |args: &[&str], parts: &[&str]| {
        bench.run(["factor"].iter().chain(args)).refuses(2, parts);
        assert!(!bench.path("out/factored.json").exists());
    };
    refuses(&["nowhere", "-o", "out"], &["nowhere"]);
    refuses(&["patch", "-o", "out", "-k", "49"], &["clusters: found 49, expected at most the 48 texels"]);
    bench.write("patch/dataset.toml", b"version = 1\npitch-mm = 10.0\nresponses = \"responses.npy\"\n");
    refuses(&["patch", "-o", "out2"], &["responses.npy", "times the light sent in"]);
    bench.write("patch/dataset.toml", b"version = 1\npitch = 0.1\n");
    refuses(&["patch", "-o", "out3"], &["dataset.toml: line 2: found unknown field `pitch`"]);
    bench.write("patch/responses.npy", b"\x93NUMPY");
    bench.write("patch/dataset.toml", b"version = 1\npitch-mm = 0.1\nresponses = \"responses.npy\"\n");
    refuses(&["patch", "-o", "out4"], &["responses.npy: header: found a file that ends in its header"]);
}
