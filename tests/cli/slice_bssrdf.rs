//! Jobs whose target was factored from a measured BSSRDF: on a slab layered from its top, and on a mesh with texture
//! coordinates.

use std::fs;

use crate::support::Bench;

/// A slab of 4 × 2 × 1.2 mm, its texture coordinates those of its top seen from above.
const SLAB: &str = "\
v 0 0 0\nv 4 0 0\nv 4 2 0\nv 0 2 0\nv 0 0 1.2\nv 4 0 1.2\nv 4 2 1.2\nv 0 2 1.2
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
f 5/1 6/2 7/3 8/4\nf 4/4 3/3 2/2 1/1
f 1/1 2/2 6/2 5/1\nf 2/2 3/3 7/3 6/2\nf 3/3 4/4 8/4 7/3\nf 4/4 1/1 5/1 8/4
";

const JOB: &str = r#"
[[object]]
mesh = "slab.obj"
depth-from = "top"
[printer]
pitch-mm = [0.1, 0.1, 0.05]
[materials]
set = "synthetic"
[target]
kind = "bssrdf"
map = "factored/"
max-albedo = 0.6
[stacking]
max-thickness-mm = 1.0
units = 16
[output]
formats = ["png"]
"#;

/// A profile that falls as e^(−r/mm)/r.
fn profile(albedo: f64, mm: f64) -> String {
    let rows = (0..60).map(|i| 0.05 * f64::from(i) + 0.025);
    let value = |r: f64| albedo * (-r / mm).exp() / (std::f64::consts::TAU * mm * r);
    let rows: String = rows.map(|r| format!("{r},{}\n", value(r))).collect();
    format!("r_mm,reflection_per_mm2\n{rows}")
}

/// A bright and a dark cluster, side by side: profiles that a stacking of white, and one of black, have about.
pub fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("slab.obj", SLAB.as_bytes());
    bench.write("job.toml", JOB.as_bytes());
    fs::create_dir_all(bench.path("factored/profiles")).unwrap();
    bench.write("factored/profiles/cluster_000.csv", profile(0.9, 0.3).as_bytes());
    bench.write("factored/profiles/cluster_001.csv", profile(0.09, 0.1).as_bytes());
    bench.write("factored/factored.json", RECORD.as_bytes());
    // Rows from the top: the left half bright, but for the corner of largest y.
    let labels = [1_u16, 0, 1, 1, 0, 0, 1, 1];
    let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(4, 2, labels.to_vec()).unwrap();
    image.save(bench.path("factored/labels.png")).unwrap();
    bench
}

const RECORD: &str = r#"{"version": 1, "pitch_mm": 1.0, "width": 4, "height": 2, "channels": ["Y"],
 "clusters": [{"profiles": ["profiles/cluster_000.csv"]}, {"profiles": ["profiles/cluster_001.csv"]}]}"#;

/// RGBA of the pixel at column x of row y in a slice.
fn pixel(bench: &Bench, slice: u32, x: u32, y: u32) -> [u8; 4] {
    image::open(bench.path(format!("out/slices/slice_{slice}.png"))).unwrap().to_rgba8().get_pixel(x, y).0
}

#[test]
fn a_slab_is_layered_from_its_top() {
    let bench = bench();
    bench.run(["slice", "job.toml", "-o", "out"]).exits(0);
    let manifest = bench.manifest("out");
    let stackings = manifest["stackings"][0]["stackings"].as_array().unwrap();
    assert_eq!((stackings.len(), manifest["stackings"][0]["kind"].as_str()), (2, Some("bssrdf")));
    // Rescaled by one factor: the brightest becomes 0.6, the other stays a tenth of it.
    let albedo = |at: usize| stackings[at]["target_albedo"][0].as_f64().unwrap();
    assert!((albedo(0) - 0.6).abs() < 1e-9 && (albedo(1) / albedo(0) - 0.1).abs() < 0.01, "{stackings:?}");
    assert_eq!((stackings[0]["share"].as_f64(), stackings[1]["share"].as_f64()), (Some(3.0 / 8.0), Some(5.0 / 8.0)));
    let inputs = manifest["inputs"].as_array().unwrap();
    assert!(inputs.iter().any(|input| input["path"] == "factored/profiles/cluster_001.csv"), "{inputs:?}");
    // The top slice: white where cluster 0 is, black where 1 is.
    let (white, black) = (pixel(&bench, 23, 5, 15), pixel(&bench, 23, 35, 15));
    assert_ne!(white, black);
    assert_eq!(pixel(&bench, 23, 5, 4), black, "row 0 of the labels is the largest y");
    // Below the stacking there is core to the very bottom, for neither walls nor underside count.
    assert_eq!([pixel(&bench, 0, 0, 19), pixel(&bench, 2, 5, 15)], [black; 2]);
    bench.run(["verify", "out"]).exits(0);
}

/// Printed between its mirror images, what every texel of a patch shows under even light is what equation 7 says.
#[test]
fn a_patch_is_corrected_texel_by_texel() {
    let bench = bench();
    bench.write(
        "slab.obj",
        SLAB.replace("v 4 ", "v 2 ").replace(" 2 0\n", " 1 0\n").replace(" 2 1.2", " 1 1.2").as_bytes(),
    );
    bench.write(
        "factored/factored.json",
        RECORD.replace("1.0", "0.25").replace("4,", "8,").replace("2,", "4,").as_bytes(),
    );
    let labels: Vec<u16> = (0..32).map(|texel| u16::from(texel % 8 >= 4)).collect();
    let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(8, 4, labels).unwrap();
    image.save(bench.path("factored/labels.png")).unwrap();
    // Within what these resins do on either side, also beside the border.
    bench.write("factored/profiles/cluster_001.csv", profile(0.4, 0.2).as_bytes());
    let mixed = JOB
        .replace("units = 16", "mixtures = true")
        .replace("0.6", "0.45")
        .replace("[0.1, 0.1, 0.05]", "[0.05, 0.05, 0.05]");
    bench.write("job.toml", mixed.as_bytes());
    bench.run(["slice", "job.toml", "-o", "out"]).exits(0);
    let rounds: serde_json::Value = serde_json::from_slice(&bench.files("out")["rounds.json"]).unwrap();
    let factors = rounds["objects"][0]["ln_factor_thousandths"][0].as_array().unwrap();
    assert_eq!(factors.len(), 32);
    // Beside the border the bright half must be asked for more than away from it.
    let mean = |column: usize| (0..4).map(|row| factors[column + 8 * row].as_f64().unwrap()).sum::<f64>() / 4.0;
    let rms = |round: &serde_json::Value| round["fit"][0]["relative_rms"].as_f64().unwrap();
    let seen: Vec<f64> = rounds["rounds"].as_array().unwrap().iter().map(rms).collect();
    assert!(mean(3) > mean(0) + 20.0, "{factors:?}");
    assert!(seen[0] > 0.02 && seen.last().unwrap() < &(0.8 * seen[0]), "{seen:?}");
    // A look judges it likewise; standing free its sides would let in a third more light.
    let look = ["look", "out", "--job", "job.toml", "--spots", "40", "--photons", "20000", "--json"];
    let look = bench.run(look).exits(0).json();
    assert!(look["warnings"][0].as_str().unwrap().contains("between its mirror images"), "{}", look["warnings"]);
    assert!(look["against_asked"][0]["relative_rms"].as_f64().unwrap() < 0.04, "{}", look["against_asked"]);
    // Where its layers are to be height fields they are those of the texture that it has.
    bench.write(
        "job.toml",
        mixed.replace("mixtures = true", "").replace("[\"png\"]", "[\"png\", \"heights\"]").as_bytes(),
    );
    bench.run(["slice", "job.toml", "-o", "out", "--overwrite"]).exits(0);
    assert!(!bench.files("out").contains_key("rounds.json"));
}

#[test]
fn the_same_map_is_wrapped_around_a_mesh() {
    let bench = bench();
    bench.write("job.toml", JOB.replace("depth-from = \"top\"", "").as_bytes());
    bench.run(["slice", "job.toml", "-o", "out"]).exits(0);
    // Now the underside has layers too: white comes back at the bottom.
    assert_eq!(pixel(&bench, 0, 15, 15), pixel(&bench, 23, 15, 15));
}

#[test]
fn what_factor_did_not_write_is_refused() {
    let bench = bench();
    let with = |file: &str, content: &str, parts: &[&str]| {
        let kept = fs::read(bench.path(file)).unwrap();
        bench.write(file, content.as_bytes());
        bench.run(["slice", "job.toml", "-o", "out"]).refuses(2, parts);
        bench.write(file, &kept);
    };
    with("factored/factored.json", "", &["factored.json:1: record: found", "expected what `lumislice factor` writes"]);
    let other = |from: &str, to: &str| RECORD.replace(from, to);
    with("factored/factored.json", &other("\"version\": 1", "\"version\": 2"), &["version: found 2, expected 1"]);
    with("factored/factored.json", &other("4", "5"), &["labels.png: found 4 × 2 texels, not 5 × 2"]);
    with(
        "factored/factored.json",
        &other("profiles/cluster_001.csv", "../p.csv"),
        &["clusters[1].profiles: found `../p.csv`"],
    );
    with("factored/factored.json", &other("\"Y\"", "\"Y\", \"Z\""), &["clusters[0].profiles: found 1 paths"]);
    let one = r#"{"version": 1, "pitch_mm": 1.0, "width": 4, "height": 2, "channels": ["Y"],
    "clusters": [{"profiles": ["profiles/cluster_000.csv"]}]}"#;
    with("factored/factored.json", one, &["labels.png: found label 1 with 1 clusters"]);
    with("factored/labels.png", "", &["labels.png: found"]);
    with("factored/profiles/cluster_001.csv", "r_mm,reflection_per_mm2\n0,nan\n", &["cluster_001.csv"]);
    with(
        "slab.obj",
        &SLAB.replace("vt ", "# ").replace("/1", "").replace("/2", "").replace("/3", "").replace("/4", ""),
        &["without texture coordinates"],
    );
    fs::remove_file(bench.path("factored/profiles/cluster_001.csv")).unwrap();
    bench.run(["slice", "job.toml", "-o", "out"]).refuses(2, &["cluster_001.csv"]);
}
