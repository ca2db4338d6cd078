//! `lumislice factor`.

use serde_json::Value;

use lumislice::appearance::bssrdf::write_npy;

use super::support::{Bench, keys};

/// A patch of 8 × 6 texels with windows of 9 × 9, brighter towards the right.
pub fn bench() -> Bench {
    let bench = Bench::new();
    let (responses, albedo) = patch();
    bench.write("patch/responses.npy", &write_npy(&[6, 8, 9, 9], &responses));
    bench.write("patch/albedo.npy", &write_npy(&[6, 8], &albedo));
    bench.write("patch/dataset.toml", HEADER.as_bytes());
    bench
}

const HEADER: &str = "version = 1\npitch-mm = 0.1\nresponses = \"responses.npy\"\nalbedo = \"albedo.npy\"\n";

/// Its responses and albedo.
fn patch() -> (Vec<f32>, Vec<f32>) {
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
    (responses, albedo)
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

/// What is odd but can be measured is factored, and said.
#[test]
fn odd_patches_are_factored_and_say_so() {
    let bench = bench();
    let (responses, _) = patch();
    let write = |shape: &[usize], values: &[f32]| bench.write("patch/responses.npy", &write_npy(shape, values));
    let factor = |args: &[&str]| {
        let ran = bench.run(["factor", "patch", "-o", "out", "--overwrite"].iter().chain(args)).exits(0);
        let record: Value = serde_json::from_slice(&std::fs::read(bench.path("out/factored.json")).unwrap()).unwrap();
        (ran.stderr, record)
    };
    let error = |record: &Value| record["fits"][0]["relative_error"].as_f64().unwrap();
    // Holes: every tenth value, and all of one texel's window.
    let holed: Vec<f32> = responses.iter().enumerate().map(|(i, v)| if i % 10 == 3 { f32::NAN } else { *v }).collect();
    write(&[6, 8, 9, 9], &holed);
    let (said, record) = factor(&[]);
    assert!(said.contains("warning: Y: 389 values are missing and were left out"), "{said}");
    assert!(error(&record) < 0.02, "{record}");
    let mut holed = responses.clone();
    holed[19 * 81..20 * 81].fill(f32::NAN);
    write(&[6, 8, 9, 9], &holed);
    let (said, record) = factor(&[]);
    assert!(said.contains("warning: Y: 81 values are missing"), "{said}");
    assert!(error(&record) < 0.02, "{record}");
    // A few negative values are noise about zero.
    let noisy: Vec<f32> = responses.iter().enumerate().map(|(i, v)| if i % 9 == 0 { -0.1 * v } else { *v }).collect();
    write(&[6, 8, 9, 9], &noisy);
    assert!(factor(&[]).1["fits"][0]["relative_error"].as_f64().is_some());
    // All texels alike: one cluster is enough, and equation 7 has nothing to miss but what a ring's pixels differ by.
    let window = |dx: i32, dy: i32| {
        let r = 0.1 * f64::from(dx * dx + dy * dy).sqrt().max(0.35);
        ((-2.0 * r).exp() / r / 12.0) as f32
    };
    let one: Vec<f32> = (0..81).map(|i| window(i % 9 - 4, i / 9 - 4)).collect();
    write(&[6, 8, 9, 9], &one.repeat(48));
    bench.write("patch/albedo.npy", &write_npy(&[6, 8], &[0.4; 48]));
    let (_, record) = factor(&[]);
    let clusters = record["clusters"].as_array().unwrap();
    let albedos = || clusters.iter().map(|cluster| cluster["albedo"][0].as_f64().unwrap());
    assert!(albedos().all(|albedo| (albedo - 0.4).abs() < 1e-5), "{clusters:?}");
    assert!(error(&record) < 1e-3 && record["cluster_rms"].as_f64().unwrap() < 1e-4, "{record}");
    // One texel: its own window, of any odd shape.
    write(&[1, 1, 9, 9], &one);
    bench.write("patch/albedo.npy", &write_npy(&[1, 1], &[0.4]));
    let (_, record) = factor(&[]);
    assert_eq!((&record["width"], record["clusters"].as_array().unwrap().len()), (&1.into(), 1));
    write(&[1, 3, 3, 9], &one[27..54].repeat(3));
    bench.write("patch/albedo.npy", &write_npy(&[1, 3], &[0.4; 3]));
    assert_eq!(factor(&["-k", "2"]).1["window"], serde_json::json!([9, 3]));
    // A pitch in metres.
    bench.write("patch/dataset.toml", HEADER.replace("0.1", "0.0001").as_bytes());
    let (said, _) = factor(&[]);
    assert!(said.contains("is the pitch in mm?"), "{said}");
}

#[test]
fn data_without_light_are_refused_by_channel() {
    let bench = bench();
    let (responses, _) = patch();
    let refuses = |shape: &[usize], values: &[f32], parts: &[&str]| {
        bench.write("patch/responses.npy", &write_npy(shape, values));
        bench.write("patch/dataset.toml", HEADER.replace("albedo = \"albedo.npy\"\n", "").as_bytes());
        bench.run(["factor", "patch", "-o", "out"]).refuses(2, parts);
        assert!(!bench.path("out").exists());
    };
    let all = [6, 8, 9, 9];
    refuses(&all, &[f32::NAN; 3888], &["responses.npy: responses: found no value that is a number"]);
    refuses(&all, &[0.0; 3888], &["responses.npy: responses: found no value above 0"]);
    let negative: Vec<f32> = responses.iter().map(|value| if *value < 0.3 { -value } else { *value }).collect();
    refuses(&all, &negative, &["found negative values that take away", "expected noise about zero"]);
    // The green plane is missing.
    let planes: Vec<f32> = responses.chunks(81).flat_map(|window| [window, &[f32::NAN; 81], window].concat()).collect();
    refuses(&[6, 8, 3, 9, 9], &planes, &["responses.npy: responses, channel G: found no value that is a number"]);
}
