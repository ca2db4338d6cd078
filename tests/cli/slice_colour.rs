//! Jobs in colour: seven resins in three channels under a texture of four colours.

use std::fs;

use serde_json::Value;

use crate::support::{Bench, JOB};

/// A box with texture coordinates: its top sees the four texels, its other sides the first.
const BOX: &str = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 0 0 4\nv 4 0 4\nv 4 4 4\nv 0 4 4\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.1 0.9\n\
    f 5/1 6/2 7/3\nf 5/1 7/3 8/4\nf 1/5 3/5 2/5\nf 1/5 4/5 3/5\nf 1/5 2/5 6/5\nf 1/5 6/5 5/5\n\
    f 2/5 3/5 7/5\nf 2/5 7/5 6/5\nf 3/5 4/5 8/5\nf 3/5 8/5 7/5\nf 4/5 1/5 5/5\nf 4/5 5/5 8/5\n";

const COLOURS: [[u8; 3]; 4] = [[200, 60, 60], [60, 160, 80], [70, 80, 180], [200, 190, 180]];

/// A texture of `size` × `size` texels.
fn texture(bench: &Bench, size: usize, colour: impl Fn(usize, usize) -> [u8; 3]) {
    let texels: Vec<_> = (0..size * size).map(|texel| colour(texel % size, texel / size)).collect();
    let mut texture = Vec::new();
    let mut encoder = png::Encoder::new(&mut texture, size as u32, size as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(texels.as_flattened()).unwrap();
    bench.write("colours.png", &texture);
}

fn job(bench: &Bench, stacking: &str) {
    bench.write("box.obj", BOX.as_bytes());
    texture(bench, 2, |x, y| COLOURS[x + 2 * y]);
    let target = "kind = \"texture\"\nalbedo = \"colours.png\"\nmean-free-path-mm = 0.3";
    let job = JOB
        .replace("cube.stl", "box.obj")
        .replace("synthetic", "inks-rgb-7")
        .replace("kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"", target)
        .replace(
            "core = \"black\"",
            &format!("core = \"black\"\nmax-thickness-mm = 1.5\nunits = 32\ndepth = 4\n{stacking}"),
        );
    bench.write("job.toml", job.as_bytes());
}

fn linear(encoded: u8) -> f64 {
    let value = f64::from(encoded) / 255.0;
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

#[test]
fn every_colour_of_a_texture_gets_its_layers() {
    let bench = Bench::new();
    job(&bench, "");
    let ran = bench.slice("out");
    assert!(ran.stderr.contains("invented"), "{}", ran.stderr);
    let text = fs::read(bench.path("out/stackings.json")).unwrap();
    let json: Value = serde_json::from_slice(&text).unwrap();
    let object = if json.is_array() { &json[0] } else { &json["objects"][0] };
    let stackings = object["stackings"].as_array().unwrap();
    assert_eq!(stackings.len(), 4);
    for stacking in stackings {
        let channels = |key: &str| -> Vec<f64> {
            stacking[key].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
        };
        let (asked, predicted) = (channels("target_albedo"), channels("predicted_albedo"));
        let known = COLOURS.iter().any(|colour| colour.iter().zip(&asked).all(|(c, a)| (linear(*c) - a).abs() < 1e-3));
        assert!(known, "{asked:?}");
        assert_eq!(stacking["search"]["proven"], true);
        // Reddish stays reddish: the largest channel is the largest. The fourth is nearly grey.
        let largest = |values: &[f64]| (0..3).max_by(|&a, &b| values[a].total_cmp(&values[b]));
        let grey = asked.iter().all(|albedo| *albedo > 0.4);
        assert!(grey || largest(&asked) == largest(&predicted), "{stacking}");
    }
    bench.run(["verify", "out"]).exits(0);
}

/// Objectives differ in the layers that they choose for a colour.
#[test]
fn a_job_may_choose_its_objective() {
    let bench = Bench::new();
    let objectives = ["l2", "spatial", "relative"].map(|objective| {
        job(&bench, &format!("objective = \"{objective}\""));
        texture(&bench, 2, |_, _| COLOURS[0]);
        bench.slice(objective);
        let manifest = bench.manifest(objective);
        assert_eq!(manifest["job"]["stacking"]["objective"], objective);
        manifest["stackings"][0]["stackings"][0]["layers"].clone()
    });
    assert!(objectives[0] != objectives[1] && objectives[0] != objectives[2]);
    job(&bench, "objective = \"spatail\"");
    bench.run(["slice", "job.toml"]).refuses(2, &["stacking.objective", "did you mean `spatial`?"]);
}

#[test]
fn profiles_are_given_once_or_for_each_channel() {
    let bench = Bench::new();
    let stack = ["--stack", "cyan:0.3,white:1", "--core", "black", "--csv", "p.csv"];
    bench.run(["predict", "--materials", "inks-rgb-7"].iter().chain(&stack)).exits(0);
    let job = |profile: &str| {
        let target = format!("kind = \"profile\"\nprofile = {profile}");
        let job = JOB
            .replace("synthetic", "inks-rgb-7")
            .replace("kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"", &target);
        bench.write("job.toml", job.replace("core = \"black\"", "core = \"black\"\ndepth = 4").as_bytes());
    };
    job("[\"p-R.csv\", \"p-G.csv\", \"p-B.csv\"]");
    bench.slice("three");
    let json: Value = serde_json::from_slice(&fs::read(bench.path("three/stackings.json")).unwrap()).unwrap();
    let object = if json.is_array() { &json[0] } else { &json["objects"][0] };
    assert_eq!(object["stackings"][0]["layers"][0]["resin"], "cyan", "{object}");
    job("[\"p-R.csv\", \"p-G.csv\"]");
    bench.run(["slice", "job.toml"]).refuses(2, &["target.profile", "2 paths", "one for each of 3 channels"]);
    job("[]");
    bench.run(["slice", "job.toml"]).refuses(2, &["target.profile", "an empty array", "one for each channel"]);
}

/// Texels of 0.16 mm, and each of them written 64 times: voxels of 0.2 mm can tell no difference.
#[test]
fn a_texture_finer_than_voxels_is_averaged() {
    let bench = Bench::new();
    job(&bench, "model = \"km\"");
    let colour = |x: usize, y: usize| COLOURS[(x * x + 3 * y) % 4];
    let [plain, fine] = [(25, 1, "plain"), (200, 8, "fine")].map(|(size, each, out)| {
        texture(&bench, size, |x, y| colour(x / each, y / each));
        bench.slice(out);
        let mut files = bench.files(out);
        // Others have the job's digest.
        files.retain(|path, _| path.ends_with(".png"));
        files
    });
    assert_eq!(plain.keys().collect::<Vec<_>>(), fine.keys().collect::<Vec<_>>());
    let differ: Vec<_> = plain.iter().filter(|(path, bytes)| fine[*path] != **bytes).map(|(path, _)| path).collect();
    assert!(differ.is_empty(), "{differ:?}");
    // What lies between texels of 0.02 mm is their mean.
    texture(&bench, 200, |x, y| COLOURS[usize::from((x / 4 + y / 4) % 2 == 0)]);
    bench.slice("mixed");
    let json: Value = serde_json::from_slice(&fs::read(bench.path("mixed/stackings.json")).unwrap()).unwrap();
    let asked = json["objects"][0]["stackings"][0]["target_albedo"][0].as_f64().unwrap();
    let mean = f64::midpoint(linear(COLOURS[0][0]), linear(COLOURS[1][0]));
    assert!((asked - mean).abs() < 2e-3, "{asked} for {mean}");
}

/// A plate so thin that its layers are bent, in a colour that black would make easy: it stays below its depth, on all
/// sides, and the plate is made of other inks.
#[test]
fn a_resin_that_is_to_stay_deep_is_in_no_voxel_above() {
    let bench = Bench::new();
    // The upper four corners.
    bench.write("plate.obj", BOX.replace(" 4\nv", " 0.8\nv").as_bytes());
    let job = "[[object]]\nmesh = \"plate.obj\"\n[printer]\npitch-mm = [0.1, 0.1, 0.05]\n[materials]\nset = \"inks-rgb-7\"\n\
               [target]\nkind = \"texture\"\nalbedo-colour = [0.3, 0.16, 0.1]\nmean-free-path-mm = 0.4\n\
               [[stacking.limit]]\nresin = \"black\"\nmin-depth-mm = 0.3\n[appearance]\nrounds = 0\n\
               [output]\nformats = [\"png\"]\n";
    bench.write("job.toml", job.as_bytes());
    bench.run(["slice", "job.toml", "-o", "top", "--slices", "0..6"]).exits(0);
    let manifest = bench.manifest("top");
    let voxels = |resin: &str| {
        let of = manifest["materials"].as_array().unwrap().iter().find(|material| material["name"] == resin);
        of.and_then(|material| material["voxels"].as_u64()).unwrap_or(0)
    };
    assert_eq!(voxels("black"), 0);
    assert!(voxels("magenta") > 1000 && voxels("yellow") > 1000, "{}", manifest["materials"]);
}
