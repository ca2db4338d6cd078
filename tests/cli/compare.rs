//! `compare`: what each step from a factored dataset to a printed slab costs.

use std::fs;

use serde_json::Value;

use lumislice::appearance::bssrdf::write_npy;

use crate::slice_bssrdf::bench;
use crate::support::{Bench, keys};

const COMPARE: [&str; 8] = ["compare", "out", "--map", "factored", "--photons", "40000", "-o", "sheet"];

fn stage<'a>(comparison: &'a Value, name: &str) -> &'a Value {
    comparison["stages"].as_array().unwrap().iter().find(|stage| stage["name"] == name).unwrap()
}

/// A slab of one cluster that a stacking can match, its labels all 0.
fn uniform() -> Bench {
    let bench = bench();
    let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(4, 2, vec![0_u16; 8]).unwrap();
    image.save(bench.path("factored/labels.png")).unwrap();
    bench.run(["slice", "job.toml", "-o", "out"]).exits(0);
    bench
}

#[test]
fn an_even_slab_prints_as_predicted() {
    let bench = uniform();
    let found = bench.run(COMPARE.into_iter().chain(["--json"])).exits(0).json();
    assert_eq!(found["lights"], serde_json::json!(["area", "edge", "spot"]));
    let names: Vec<_> =
        found["stages"].as_array().unwrap().iter().map(|stage| stage["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["clustered", "predicted", "printed"]);
    assert_eq!(
        keys(&stage(&found, "printed")["differences"][0]),
        ["bias", "rms", "relative_rms", "correlation", "noise"]
    );
    // Under even light the printed slab has the albedo of its stacking, to a standard error of 0.002 and what lies
    // beyond 1.2 mm.
    let against = |name: &str, other: &str| {
        let pairs = stage(&found, name)["against"].as_array().unwrap();
        pairs.iter().find(|pair| pair[0] == other).unwrap()[1][0]["bias"].as_f64().unwrap()
    };
    assert!(against("printed", "predicted").abs() < 0.01, "{found}");
    assert!(against("predicted", "predicted by Kubelka–Munk").abs() < 0.02, "{found}");
    // A picture of one value has no correlation; light falls across the edge.
    assert_eq!(stage(&found, "predicted")["differences"][0]["correlation"], Value::Null);
    let edge: Vec<_> =
        stage(&found, "printed")["edge"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    assert!(edge.len() == 4 && edge[0] > 4.0 * edge[3] && edge[3] > 0.0, "{edge:?}");
}

#[test]
fn a_sheet_is_a_page_and_pictures() {
    let bench = uniform();
    let ran = bench.run(COMPARE).exits(0);
    assert!(ran.stdout.starts_with("4 × 2 texels, sheet/sheet.html\n"), "{}", ran.stdout);
    let first = bench.files("sheet");
    let names: Vec<_> = first.keys().map(String::as_str).collect();
    let expected = [
        "comparison.json",
        "edge.png",
        "manifest.json",
        "noise.npy",
        "places.csv",
        "radiosity.npy",
        "sheet.html",
        "sheet.png",
    ];
    assert_eq!(names, expected);
    // The numbers behind the pictures: 4 × 2 texels, a row each, and the same in an array.
    let found: Value = serde_json::from_slice(&first["comparison.json"]).unwrap();
    let pictures = found["stages"].as_array().unwrap().len() * 3;
    let places = String::from_utf8(first["places.csv"].clone()).unwrap();
    let rows: Vec<&str> = places.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())).collect();
    assert!(rows.len() == 8 && rows.iter().all(|row| row.split(',').count() == 4 + pictures), "{places}");
    let array = &first["radiosity.npy"];
    let value = array[array.len() - 4 * 8 * pictures..][..4].try_into().map(f32::from_le_bytes).unwrap();
    let told: f32 = rows[0].split(',').nth(4).unwrap().parse().unwrap();
    assert!((value - told).abs() < 1e-5 && value > 0.0, "{value} {told}");
    let page = String::from_utf8(first["sheet.html"].clone()).unwrap();
    assert!(page.contains("<svg") && !page.contains("src=\"http") && !page.contains("href=\"http"));
    bench.run(COMPARE).refuses(2, &["sheet: found a folder that is not empty"]);
    bench.run(COMPARE.into_iter().chain(["--overwrite"])).exits(0);
    assert_eq!(bench.files("sheet"), first, "the same bytes again");
}

#[test]
fn what_does_not_fit_is_refused() {
    let bench = uniform();
    let refused = |args: &[&str], parts: &[&str]| {
        bench.run(["compare"].iter().chain(args).chain(&["-o", "sheet"])).refuses(2, parts);
    };
    refused(&["nothing", "--map", "factored"], &["nothing: found"]);
    refused(&["out", "--map", "out"], &["factored.json"]);
    refused(&["out", "--map", "factored", "--photons", "1"], &["--photons: found 1, expected 0 or at least 2"]);
    let record = fs::read_to_string(bench.path("factored/factored.json")).unwrap();
    bench.write("factored/factored.json", record.replace("\"pitch_mm\": 1.0", "\"pitch_mm\": 2.0").as_bytes());
    refused(&["out", "--map", "factored"], &["out: found an object of 4.000 mm along x with a map of 8.000 mm"]);
    bench.write("factored/factored.json", record.as_bytes());
    fs::write(bench.path("out/slices/slice_3.png"), "").unwrap();
    refused(&["out", "--map", "factored"], &["slice_3.png: found"]);
    fs::remove_file(bench.path("out/slices/slice_3.png")).unwrap();
    refused(&["out", "--map", "factored"], &["slice_3.png: found"]);
}

/// From the 4D data to two prints, side by side: the job with the paper's settings and the refined one, as `factor`
/// writes them.
#[test]
fn a_dataset_and_two_jobs_are_compared() {
    let bench = crate::factor::bench();
    bench.run(["factor", "patch", "-o", "map", "-k", "4"]).exits(0);
    // Not moved into the gamut, the refined job's targets are those of the other.
    let refined = fs::read_to_string(bench.path("map/refined.toml")).unwrap();
    assert!(refined.contains("gamut-map = true\n"), "{refined}");
    // Nor are they weighed as eyes see them, but by the objective that both are held against here.
    let refined = refined.replace("gamut-map = true\n", "").replace("[stacking]\n", "[stacking]\nobjective = \"l2\"\n");
    assert!(refined.contains("objective"), "{refined}");
    bench.write("map/refined.toml", refined.as_bytes());
    for job in ["slab", "refined"] {
        bench.run(["slice", &format!("map/{job}.toml"), "-o", job]).exits(0);
    }
    let args = ["compare", "slab", "refined", "--map", "map", "--dataset", "patch", "--photons", "4000", "-o", "sheet"];
    let ran = bench.run(args.into_iter().chain(["--json"])).exits(0);
    let found = ran.json();
    let names: Vec<_> =
        found["stages"].as_array().unwrap().iter().map(|stage| stage["name"].as_str().unwrap()).collect();
    let printed = ["slab: predicted", "slab: printed", "refined: predicted", "refined: printed"];
    assert_eq!(names[..3], ["original", "factored", "clustered"]);
    assert_eq!(names[3..], printed);
    // The data are of equation 7's form; its light is theirs but for what lies beyond the patch.
    let factored = &stage(&found, "factored")["differences"][0];
    let scale = stage(&found, "original")["scale"].as_f64().unwrap();
    assert!(factored["bias"].as_f64().unwrap().abs() < 0.02 * scale, "{factored}");
    assert!(factored["correlation"].as_f64().unwrap() > 0.98, "{factored}");
    // Both jobs are held against the same clusters by the same objective; the refined one is nearer to them, and
    // the other was chosen by a model that promises more.
    let fit = |job: usize, model: &str| found["jobs"][job][model]["mean"].as_f64().unwrap();
    assert_eq!((&found["jobs"][0]["name"], &found["jobs"][1]["name"]), (&"slab".into(), &"refined".into()));
    assert!(fit(1, "transport") < fit(0, "transport"), "{}", found["jobs"]);
    assert!(fit(0, "kubelka_munk") < fit(0, "transport"), "{}", found["jobs"]);
    let page = fs::read_to_string(bench.path("sheet/sheet.html")).unwrap();
    assert!(page.contains("Stackings against clusters") && page.contains("refined: printed, area"), "{page}");

    bench.write("other/responses.npy", &write_npy(&[1, 2, 3, 3], &[0.1; 18]));
    bench.write("other/dataset.toml", b"version = 1\npitch-mm = 0.1\nresponses = \"responses.npy\"\n");
    let other = ["compare", "slab", "--map", "map", "--dataset", "other", "-o", "sheet2"];
    bench.run(other).refuses(2, &["other: found 2 × 1 texels, expected the dataset that the map was factored from"]);
    // The same patch with another pitch, and another sample of its size.
    assert_eq!(found["warnings"], serde_json::json!([]));
    bench.write("other/responses.npy", &write_npy(&[6, 8, 9, 9], &[0.5; 6 * 8 * 81]));
    bench.write("other/dataset.toml", b"version = 1\npitch-mm = 0.2\nresponses = \"responses.npy\"\n");
    bench.run(other).refuses(2, &["other: found texels of 0.2 mm where the map has 0.1 mm"]);
    bench.write("other/dataset.toml", b"version = 1\npitch-mm = 0.1\nresponses = \"responses.npy\"\n");
    let ran = bench.run(other.into_iter().chain(["--photons", "1000", "--json"])).exits(0).json();
    let warning = ran["warnings"][0].as_str().unwrap();
    assert!(warning.starts_with("other: under even light its texels are ") && warning.contains("other data"), "{ran}");
}

/// Any shape is seen by a camera: here the slab itself.
#[test]
fn objects_are_compared_with_their_job() {
    let bench = uniform();
    let with = |more: &[&'static str]| {
        let common = ["--job", "job.toml", "--map", "factored", "--size", "48", "--samples", "32", "--view", "-60,90"];
        [&["compare"], more, &common].concat()
    };
    let found = bench.run(with(&["-o", "sheet", "--json"])).exits(0).json();
    assert_eq!(found["lights"], serde_json::json!(["sky", "edge", "behind", "spot"]));
    assert_eq!(found["view_deg"], serde_json::json!([-60.0, 90.0]));
    let names: Vec<_> = found["stages"].as_array().unwrap().iter().map(|stage| &stage["name"]).collect();
    assert_eq!(names, ["clustered", "predicted", "printed"]);
    // Seen from straight above all that shows is the top. Under the sky it is somewhat darker than predicted of a slab
    // without end: 4 × 2 mm lose light by their sides, which show the core. Under the edge it is bright and dark where
    // it should be.
    let printed = &stage(&found, "printed")["against"][0];
    assert_eq!(printed[0], "predicted");
    let [sky, edge] = [&printed[1][0], &printed[1][1]];
    let [bias, rms, noise] = ["bias", "rms", "noise"].map(|key| sky[key].as_f64().unwrap());
    assert!((-0.15..0.0).contains(&bias) && rms < 0.15 && noise > 0.0, "{printed}");
    assert!(edge["correlation"].as_f64().unwrap() > 0.9, "{printed}");
    let files: Vec<_> = bench.files("sheet").into_keys().collect();
    assert!(!files.contains(&"edge.png".to_owned()) && files.contains(&"sheet.html".to_owned()), "{files:?}");
    let places = fs::read_to_string(bench.path("sheet/places.csv")).unwrap();
    assert!(places.contains("row,column,x_mm,y_mm,z_mm,\"clustered"), "{places}");
    // The slices show the same voxels.
    let slices = bench.run(with(&["out", "-o", "again", "--json"])).exits(0).json();
    assert_eq!(slices, found);
    bench.run(with(&["-o", "sheet"])).refuses(2, &["sheet: found a folder that is not empty"]);
    bench.run(with(&["out", "out", "-o", "more"])).refuses(2, &["OUT: found 2 folders with --job"]);
    let other = ["compare", "--job", "job.toml", "--map", "out", "-o", "more"];
    bench.run(other).refuses(2, &["job.toml: found object 1 with map"]);
    let alone = bench.run(["compare", "--map", "factored", "--size", "32", "-o", "more"]).exits(2);
    assert!(alone.stderr.contains("--job <JOB.toml>"), "{}", alone.stderr);
}
