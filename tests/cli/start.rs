//! From a mesh alone: a job beside it, or none at all.

use std::{fs, path::Path};

use serde_json::Value;

use crate::support::{Bench, JOB, cube, run, stl};

/// An OBJ box of 30 × 20 × 10 units, y up, that stands on a flat foot; coloured by vertex, or not.
fn obj(colour: &str) -> Vec<u8> {
    let mut text = String::new();
    for [x, y, z] in [[0, 0, 0], [30, 0, 0], [30, 20, 0], [0, 20, 0], [0, 0, 10], [30, 0, 10], [29, 20, 9], [1, 20, 9]]
    {
        text += &format!("v {x} {y} {z} {colour}\n");
    }
    text += "f 5 6 7 8\nf 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    text.into_bytes()
}

#[test]
fn init_writes_a_job_that_says_what_was_guessed() {
    let bench = Bench::new();
    bench.write("meshes/figure.obj", &obj("0.8 0.2 0.1"));
    let ran = bench.run(["init", "meshes/figure.obj"]).exits(0);
    assert_eq!(ran.stdout.trim().replace('\\', "/"), "meshes/figure.toml");
    for word in
        ["note: size: 30.0000 × 10.0000 × 20.0000 mm", "note: orientation: guessed", "note: colour: the mesh's own"]
    {
        assert!(ran.stderr.contains(word), "{word}: {}", ran.stderr);
    }
    let text = fs::read_to_string(bench.path("meshes/figure.toml")).unwrap();
    for part in [
        "mesh = \"figure.obj\"",
        "scale = 1.0",
        "rotate-deg = [90, 0, 0]",
        "preset = \"j750-27um\"",
        "tray 490 × 390 × 200 mm: fits",
        "set = \"inks-rgb-7\"",
        "kind = \"texture\"",
    ] {
        assert!(text.contains(part), "{part}:\n{text}");
    }
    // It never overwrites.
    bench.run(["init", "meshes/figure.obj"]).refuses(2, &["figure.toml: found a file", "init never overwrites"]);
    assert_eq!(fs::read_to_string(bench.path("meshes/figure.toml")).unwrap(), text);
    bench.run(["init", "meshes/figure.toml"]).refuses(2, &["expected a mesh: glb"]);
    bench.run(["init", "missing.glb"]).refuses(2, &["missing.glb"]);
    // Elsewhere the job names the mesh so that it is found from there.
    fs::create_dir(bench.path("jobs")).unwrap();
    for (output, written) in [("jobs/other.toml", "jobs/other.toml"), ("jobs", "jobs/figure.toml")] {
        let ran = bench.run(["init", "meshes/figure.obj", "-o", output]).exits(0);
        assert_eq!(Path::new(ran.stdout.trim()), Path::new(written));
        bench.run(["slice", written, "--dry-run"]).exits(0);
    }
    let words = ["--output: found figure.json", "ends in .toml, or a folder"];
    bench.run(["init", "meshes/figure.obj", "-o", "figure.json"]).refuses(2, &words);
    bench.run(["init", "meshes/figure.obj", "-o", "nowhere/figure.toml"]).exits(3);
}

#[test]
fn dark_greys_stay_dark_and_bright_ones_keep_their_ratios() {
    let bench = Bench::new();
    // The default's name changes nothing.
    let cases: [(&str, bool, &[&str]); 4] = [
        ("0.3 0.3 0.3", false, &[]),
        ("0.9 0.9 0.9", true, &[]),
        ("0.3 0.3 0.3", false, &["--materials", "synthetic"]),
        ("0.9 0.9 0.9", true, &["--materials", "synthetic"]),
    ];
    for (colour, scaled, flags) in cases {
        // Every corner its own grey.
        let text = String::from_utf8(obj(colour)).unwrap().replacen(colour, "0.2 0.2 0.2", 1);
        bench.write("grey.obj", text.as_bytes());
        bench.run(["init", "grey.obj"].iter().chain(flags)).exits(0);
        let job = fs::read_to_string(bench.path("grey.toml")).unwrap();
        assert!(job.contains("set = \"synthetic\"") && !job.contains("gamut-map"), "{job}");
        assert_eq!(job.contains("max-albedo = 0.6"), scaled, "{job}");
        fs::remove_file(bench.path("grey.toml")).unwrap();
    }
}

#[test]
fn units_colours_and_heights_are_guessed() {
    let bench = Bench::new();
    let job = |name: &str, flags: &[&str]| {
        let path = bench.path(name).with_extension("toml");
        let _ = fs::remove_file(&path);
        bench.run(["init", name].iter().chain(flags)).exits(0);
        fs::read_to_string(path).unwrap()
    };
    // 0.06 of something is metres; a foot along y stands the box up as it is turned.
    bench.write("small.stl", &stl(&cube(0.06)));
    let small = job("small.stl", &[]);
    assert!(small.contains("unit = \"m\"") && small.contains("scale = 1.0"), "{small}");
    assert!(small.contains("preset = \"marble\"") && small.contains("set = \"synthetic\""), "{small}");
    // An image that is named after the mesh is its colour, projected where there are no coordinates.
    bench.write("small-normal.png", b"");
    let mut image = Vec::new();
    let mut encoder = png::Encoder::new(&mut image, 2, 2);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[200; 12]).unwrap();
    bench.write("small_Albedo.png", &image);
    let small = job("small.stl", &["--height-mm", "40", "--printer", "connex500-30um"]);
    for part in ["height-mm = 40", "albedo = \"small_Albedo.png\"", "projection = \"triplanar\"", "connex500-30um"] {
        assert!(small.contains(part), "{part}:\n{small}");
    }
    assert!(!small.contains("unit ="), "{small}");
    let skin = job("small.stl", &["--look", "skin"]);
    assert!(skin.contains("preset = \"skin\"") && !skin.contains("\nalbedo ="), "{skin}");
    // What was measured stays as dark, and as coloured, as it is.
    let espresso = job("small.stl", &["--look", "espresso"]);
    for (text, set) in [(skin, "inks-rgb-7"), (espresso, "synthetic")] {
        assert!(text.contains(&format!("set = \"{set}\"")), "{text}");
        assert_eq!(text.contains("gamut-map = true"), set == "inks-rgb-7", "{text}");
        assert!(!text.contains("max-albedo"), "{text}");
    }
    let gcvf = job("small.stl", &["--formats", "gcvf,stl"]);
    assert!(gcvf.contains("formats = [\"gcvf\", \"stl\", \"preview\"]"), "{gcvf}");
    for (flag, typo, says) in
        [("--formats", "gvcf", "expected one of png, masks"), ("--materials", "synthetik", "did you mean `synthetic`?")]
    {
        let ran = bench.run(["init", "small.stl", flag, typo]).exits(2);
        assert!(ran.stderr.contains(flag) && ran.stderr.contains(says), "{}", ran.stderr);
    }
    // A house does not fit.
    bench.write("house.stl", &stl(&cube(9000.0)));
    let house = job("house.stl", &["--materials", "inks-rgb"]);
    assert!(house.contains("height-mm = 40") && house.contains("no size to print"), "{house}");
    assert!(house.contains("set = \"inks-rgb\""), "{house}");
    for (flags, says) in [
        (["--look", "jade"], "expected a material that was measured"),
        (["--printer", "j75"], "unknown printer"),
        (["--height-mm", "0"], "expected a height in mm"),
    ] {
        let ran = bench.run(["init", "small.stl"].iter().chain(&flags)).exits(2);
        assert!(ran.stderr.contains(says), "{}", ran.stderr);
    }
}

#[test]
fn a_mesh_is_sliced_without_a_job() {
    let bench = Bench::new();
    bench.write("figure.stl", &stl(&cube(4.0)));
    let ran = bench.run(["slice", "figure.stl", "--dry-run", "--height-mm", "6", "--look", "espresso"]).exits(0);
    for part in ["mesh = \"figure.stl\"", "height-mm = 6", "preset = \"espresso\"", "figure: 6.01 × 6.01 × 6.02 mm"] {
        assert!(ran.stdout.contains(part), "{part}: {}", ran.stdout);
    }
    assert!(ran.stdout.contains("time: about "), "{}", ran.stdout);
    let json = bench.run(["slice", "figure.stl", "--dry-run", "--height-mm", "6", "--json"]).exits(0).json();
    for part in ["preparing", "rounds", "slices", "look"] {
        assert!(json["seconds"][part].as_f64().unwrap() > 0.0, "{part}: {}", json["seconds"]);
    }
    // The job that was made up does the same when it is kept.
    bench.write("figure.toml", json["job"].as_str().unwrap().as_bytes());
    let kept = bench.run(["slice", "figure.toml", "--dry-run", "--json"]).exits(0).json();
    assert_eq!((&kept["dims"], &kept["materials"]), (&json["dims"], &json["materials"]));
    let ran = bench.run(["slice", "figure.stl", "--dry-run", "--height-mm", "6"]).exits(0);
    assert!(ran.stderr.contains("figure.toml lies beside figure.stl and is not used"), "{}", ran.stderr);
    bench.run(["slice", "job.toml", "--height-mm", "6"]).refuses(2, &["--height-mm: found beside job.toml"]);
}

#[test]
fn a_colour_is_asked_for_on_the_command_line() {
    let bench = Bench::new();
    bench.write("figure.stl", &stl(&cube(12.0)));
    for flag in ["--colour", "--color"] {
        let ran = bench.run(["init", "figure.stl", flag, "#c08040"]).exits(0);
        assert!(ran.stderr.contains("note: glow: mean-free-path-mm = 0.5, a guess"), "{}", ran.stderr);
        let job = fs::read_to_string(bench.path("figure.toml")).unwrap();
        assert!(job.contains("albedo-colour = \"#c08040\"") && job.contains("\nmean-free-path-mm = 0.5"), "{job}");
        fs::remove_file(bench.path("figure.toml")).unwrap();
    }
    let flags = ["--albedo", "0.5,0.25,0.125", "--mean-free-path-mm", "1,0.5,0.25", "--printer", "connex500-16um"];
    bench.run(["init", "figure.stl"].iter().chain(&flags)).exits(0);
    let job = fs::read_to_string(bench.path("figure.toml")).unwrap();
    assert!(job.contains("albedo-colour = [0.5, 0.25, 0.125]") && job.contains("[1.0, 0.5, 0.25]"), "{job}");
    assert!(job.contains("connex500-16um takes 3;"), "{job}");
    fs::remove_file(bench.path("figure.toml")).unwrap();
    for (flags, says) in [
        (&["--colour", "brown"][..], "expected #RRGGBB"),
        (&["--colour", "#c08040", "--look", "skin"], "cannot be used with"),
        (&["--colour", "#c08040", "--albedo", "0.5"], "cannot be used with"),
        (&["--albedo", "0.5,0.5"], "--albedo: found 2 numbers, expected one, or three"),
        (&["--albedo", "1.5"], "expected a number from 0 to 0.999"),
        (&["--height-in", "2"], "lengths are in mm: --height-mm, and 1 in is 25.4 mm"),
        (&["--height-inches", "2"], "lengths are in mm: --height-mm, and 1 in is 25.4 mm"),
    ] {
        let ran = bench.run(["init", "figure.stl"].iter().chain(flags)).exits(2);
        assert!(ran.stderr.contains(says), "{}", ran.stderr);
    }
}

/// What is called the worst is so by the measure that all is judged by.
#[test]
fn the_worst_places_are_farthest_in_colour() {
    let bench = Bench::new();
    let target = "kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"";
    let job = JOB.replace(target, "kind = \"texture\"\nalbedo-colour = \"#c08040\"\nmean-free-path-mm = 0.3");
    bench.write("colour.toml", job.replace("synthetic", "inks-rgb-7").as_bytes());
    let look = bench.run(["slice", "colour.toml", "--quick", "--json"]).exits(0).json();
    let off: Vec<f64> =
        look["spots"].as_array().unwrap().iter().map(|spot| spot["delta_e_2000"].as_f64().unwrap()).collect();
    let worst: Vec<f64> =
        look["worst"].as_array().unwrap().iter().map(|spot| off[spot.as_u64().unwrap() as usize]).collect();
    let mut sorted = off.clone();
    sorted.sort_by(|a, b| b.total_cmp(a));
    assert_eq!(worst, sorted[..worst.len()]);
    assert_eq!(look["delta_e_2000"]["worst"].as_f64(), Some(worst[0]));
}

#[test]
fn init_writes_no_job_that_is_refused() {
    let bench = Bench::new();
    bench.write("flat.stl", &stl(&cube(12.0)));
    // Fewer slices than the container takes.
    let ran = bench.run(["init", "flat.stl", "--height-mm", "0.5", "--formats", "gcvf"]).exits(2);
    assert!(ran.stderr.contains("an object 0.81 mm high or more"), "{}", ran.stderr);
    // Higher than the tray.
    let ran = bench.run(["init", "flat.stl", "--height-mm", "250"]).exits(2);
    assert!(ran.stderr.contains("flat.stl reaches 250.000 mm in z"), "{}", ran.stderr);
    assert!(!bench.path("flat.toml").exists());
}

/// What `init` leaves out for a printer of three resins is in no stacking, and no stacking is refused for it.
#[test]
fn what_init_writes_for_printers_of_few_resins_goes_through() {
    let bench = Bench::new();
    bench.write("figure.stl", &stl(&cube(2.0)));
    let flags = ["--height-mm", "2", "--printer", "j750-hs-27um", "--materials", "inks-rgb", "--colour", "#806040"];
    bench.run(["init", "figure.stl"].iter().chain(&flags)).exits(0);
    let job = fs::read_to_string(bench.path("figure.toml")).unwrap();
    assert!(job.contains("there is none of it") && job.contains("gamut-map = true"), "{job}");
    let ran = bench.run(["slice", "figure.toml", "--dry-run", "--json"]).exits(0);
    let found = ran.json();
    let used = found["materials"].as_array().unwrap().iter().filter(|resin| resin["voxels"].as_u64() > Some(0));
    assert!((1..=3).contains(&used.count()), "{}", found["materials"]);
}

#[test]
fn a_quick_look_is_pictures_alone() {
    let bench = Bench::new();
    let ran = bench.run(["slice", "job.toml", "--quick"]).exits(0);
    assert!(ran.stdout.contains("pictures of a coarse print: job-look"), "{}", ran.stdout);
    assert!(bench.path("job-look/look.json").is_file() && !bench.path("job-out").exists());
    let files = bench.files("job-look");
    assert!(files.keys().any(|name| name.ends_with(".png")), "{:?}", files.keys());
    // What formats ask of the job's own voxels does not matter.
    let gcvf = JOB.replace("pitch-mm = [0.2, 0.2, 0.2]", "preset = \"j750-27um\"").replace("\"masks\"", "\"gcvf\"");
    bench.write("gcvf.toml", gcvf.as_bytes());
    let ran = bench.run(["slice", "gcvf.toml", "--quick"]).exits(0);
    assert!(!ran.stderr.contains("dpi") && !ran.stderr.contains("slices"), "{}", ran.stderr);
    assert!(ran.stderr.contains("a quick look: voxels of 0.20 mm"), "{}", ran.stderr);
    let look: Value = serde_json::from_slice(&fs::read(bench.path("gcvf-look/look.json")).unwrap()).unwrap();
    assert!(look["warnings"][0].as_str().unwrap().contains("nothing corrected"), "{}", look["warnings"]);
    bench.run(["slice", "job.toml", "--quick"]).refuses(2, &["job-look"]);
    bench.run(["slice", "job.toml", "--quick", "--dry-run"]).exits(2);
}

#[test]
fn the_schema_knows_what_a_job_may_say() {
    let schema: Value = run(["schema"]).exits(0).json();
    let keys = |table: &str| schema["definitions"][table]["properties"].clone();
    assert_eq!(schema["additionalProperties"], false);
    assert!(keys("object")["height-mm"]["description"].as_str().unwrap().contains("extent along z"));
    for name in ["wholemilk", "skin"] {
        assert!(keys("target")["preset"]["enum"].as_array().unwrap().contains(&name.into()));
    }
    // Every table and key of a job that is read is in it.
    let job: toml::Table = JOB.parse().unwrap();
    for (table, value) in &job {
        let entries = value.as_array().map_or(value, |list| &list[0]).as_table().unwrap();
        for key in entries.keys() {
            assert!(keys(table).get(key).is_some(), "{table}.{key}");
        }
    }
}
