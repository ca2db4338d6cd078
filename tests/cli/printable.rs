//! Will it print: what breaks, falls off or washes away is said before it is printed, and drawn.

use crate::support::{Bench, Triangle, stl};

/// A box between two corners.
fn block(low: [f32; 3], high: [f32; 3]) -> Vec<Triangle> {
    let corner = |n: usize| [0, 1, 2].map(|axis| if n >> axis & 1 == 1 { high[axis] } else { low[axis] });
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).map(|corners| corners.map(corner)).collect()
}

/// A cord of short prisms along a slope, 0.1 mm thick: thinner than the voxels of 0.2 mm that it crosses at an angle.
fn cord() -> Vec<Triangle> {
    let (from, to, r) = ([4.0_f32, 2.0, 2.0], [9.0_f32, 3.3, 3.7], 0.05);
    let end = |at: [f32; 3]| {
        [[0.0, -r, -r], [0.0, r, -r], [0.0, r, r], [0.0, -r, r]].map(|d| [0, 1, 2].map(|a| at[a] + d[a]))
    };
    let (a, b) = (end(from), end(to));
    let mut found = vec![[a[0], a[2], a[1]], [a[0], a[3], a[2]], [b[0], b[1], b[2]], [b[0], b[2], b[3]]];
    for n in 0..4 {
        let m = (n + 1) % 4;
        found.extend([[a[n], a[m], b[m]], [a[n], b[m], b[n]]]);
    }
    found
}

#[test]
fn a_sound_block_is_not_spoken_of() {
    let bench = Bench::new();
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(0);
    assert!(!ran.stderr.contains("warning:"), "{}", ran.stderr);
    let json = bench.run(["slice", "job.toml", "--dry-run", "--json"]).exits(0).json();
    assert_eq!((&json["printable"]["pieces"]["count"], &json["printable"]["pieces"]["crumbs"]), (&1.into(), &0.into()));
    assert_eq!(json["printable"]["walls"][0]["thin_share"], 0.0);
}

#[test]
fn a_cord_that_breaks_into_beads_is_said_and_drawn() {
    let bench = Bench::new();
    let mut parts = block([0.0; 3], [4.1, 4.0, 4.0]);
    parts.extend(cord());
    parts.extend(block([8.9, 0.0, 0.0], [13.0, 4.0, 4.0]));
    bench.write("cube.stl", &stl(&parts));
    bench.job_with("[\"png\", \"masks\"]", "[\"png\", \"preview\"]");
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(0);
    for word in
        ["break into beads", "2 pieces that nothing holds together, of 1 object", "thinner than 3 voxels (0.600 mm)"]
    {
        assert!(ran.stderr.contains(word), "{word}: {}", ran.stderr);
    }
    let json = bench.run(["slice", "job.toml", "--dry-run", "--json"]).exits(0).json();
    let walls = &json["printable"]["walls"][0];
    let thinnest = walls["thinnest_mm"].as_f64().unwrap();
    assert!((0.05..0.15).contains(&thinnest), "{thinnest}");
    // The cord is 5 mm of four sides of 0.1 mm, of 205 mm².
    let share = walls["thin_share"].as_f64().unwrap();
    assert!((0.002..0.03).contains(&share), "{share}");
    bench.slice("out");
    assert!(bench.path("out/preview/checks.png").is_file());
    let warnings = bench.manifest("out")["warnings"].to_string();
    assert!(warnings.contains("break into beads"), "{warnings}");
    bench.run(["verify", "out"]).exits(0);
    // Who wants the printer's files only is told as well.
    bench.job_with("[\"png\", \"masks\"]", "[\"png\"]");
    let ran = bench.run(["slice", "job.toml", "-o", "slices"]).exits(0);
    assert!(ran.stderr.contains("break into beads"), "{}", ran.stderr);
}

#[test]
fn support_that_lies_bare_or_alone_is_said() {
    let bench = Bench::new();
    bench.job_with("white:0.5,support:0.6", "support:0.4,white:0.5");
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(0);
    assert!(ran.stderr.contains("support lies bare on 100% of its surface"), "{}", ran.stderr);
    // A plate of 1.6 mm: 0.3 mm of white on either side, and nothing but support between.
    bench.job_with("white:0.5,support:0.6", "white:0.3,support:1.0");
    bench.write("cube.stl", &stl(&block([0.0; 3], [12.0, 12.0, 1.6])));
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(0);
    for word in ["a skin over a wall of support", "too thin for their layers"] {
        assert!(ran.stderr.contains(word), "{word}: {}", ran.stderr);
    }
}

#[test]
fn layers_that_are_given_are_never_taken_to_follow_thin_parts() {
    let bench = Bench::new();
    // Slices and pictures only: layers that are searched for could be mixtures, and would follow.
    bench.job_with_all(&[["[\"png\", \"masks\"]", "[\"png\"]"], ["white:0.5,support:0.6", "white:0.3,support:1.0"]]);
    bench.write("cube.stl", &stl(&block([0.0; 3], [12.0, 12.0, 1.6])));
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(0);
    for word in ["a skin over a wall of support", "too thin for their layers", "write layers that fit"] {
        assert!(ran.stderr.contains(word), "{word}: {}", ran.stderr);
    }
}

#[test]
fn support_that_comes_out_at_the_sides_lets_the_print_fall_apart() {
    let bench = Bench::new();
    bench.write("cube.stl", &stl(&block([0.0; 3], [12.0, 12.0, 1.6])));
    let top = ["mesh = \"cube.stl\"", "mesh = \"cube.stl\"\ndepth-from = \"top\""];
    let sheets = ["white:0.5,support:0.6", "white:0.4,support:0.4,white:0.4"];
    bench.job_with_all(&[top, sheets, ["[\"png\", \"masks\"]", "[\"png\", \"preview\"]"]]);
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(0);
    let word = "falls into 2 pieces where support is washed off";
    assert!(ran.stderr.contains(word) && ran.stderr.contains("background-as"), "{}", ran.stderr);
    let json = bench.run(["slice", "job.toml", "--dry-run", "--json"]).exits(0).json();
    let washed = &json["printable"]["washed"];
    assert_eq!(washed["pieces"], 2, "{washed}");
    // What comes off is the upper sheet: the lower one has the core below it.
    let loose = &washed["loose"][0];
    assert!((loose["mm3"].as_f64().unwrap() - 57.6).abs() < 1e-6 && loose["high_mm"][2] == 1.6, "{loose}");
    bench.slice("out");
    assert!(purple(&bench, "out/preview/checks.png") > 5000);
    // Printed in its place there is a resin, and all holds.
    bench.job_with_all(&[top, sheets, ["[output]", "[output]\nbackground-as = \"white\""]]);
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(0);
    assert!(!ran.stderr.contains("washed off"), "{}", ran.stderr);
    // Layers from the top are too many where they come out below.
    bench.job_with_all(&[top, ["white:0.5,support:0.6", "white:1.5,black:0.5"]]);
    let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(0);
    assert!(ran.stderr.contains("100% of its surface is on parts too thin for their layers"), "{}", ran.stderr);
}

/// Pixels of a picture in the colour of what is loose or lost, its legend among them.
fn purple(bench: &Bench, name: &str) -> usize {
    let file = std::io::BufReader::new(std::fs::File::open(bench.path(name)).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let samples = reader.next_frame(&mut pixels).unwrap().color_type.samples();
    let is_purple = |pixel: &&[u8]| pixel[0] > pixel[1] + 20 && pixel[2] > pixel[1] + 20;
    pixels.chunks_exact(samples).filter(|pixel| pixel[0].min(pixel[2]) < 235).filter(is_purple).count()
}

#[test]
fn a_piece_in_the_air_is_placed_and_drawn() {
    let bench = Bench::new();
    let parts = [block([0.0; 3], [10.0, 10.0, 4.0]), block([3.0, 3.0, 6.0], [6.0, 6.0, 9.0])];
    bench.write("cube.stl", &stl(&parts.concat()));
    bench.job_with("[\"png\", \"masks\"]", "[\"png\", \"preview\"]");
    let ran = bench.slice("out");
    let word = "27.0 mm³ within 3.0 × 3.0 × 3.0 mm at (4.5, 4.5, 7.5) mm is apart; 1 of them begins above the tray";
    assert!(ran.stderr.contains(word), "{}", ran.stderr);
    let json = bench.run(["slice", "job.toml", "--dry-run", "--json"]).exits(0).json();
    assert_eq!(json["printable"]["pieces"]["loose"].as_array().unwrap().len(), 1);
    let drawn = purple(&bench, "out/preview/checks.png");
    assert!(drawn > 5000, "{drawn}");
}

#[test]
fn a_sheet_between_the_centres_is_missed_aloud() {
    let bench = Bench::new();
    // Voxels of 0.2 mm have their centres at 0.1 mm, 0.3 mm and so on.
    let sheet = block([6.0, 0.0, 0.22], [9.0, 3.0, 0.28]);
    bench.write("cube.stl", &stl(&[block([0.0; 3], [4.0; 3]), sheet].concat()));
    let json = bench.run(["slice", "job.toml", "--dry-run", "--json"]).exits(0).json();
    let lost = &json["printable"]["lost_shells"][0];
    assert_eq!(lost["count"], 1, "{lost}");
    assert!((lost["mm3"].as_f64().unwrap() - 0.54).abs() < 1e-6, "{lost}");
    let warnings = json["warnings"].to_string();
    assert!(warnings.contains("1 shell of 0.540 mm³ together will not be printed, the first at (7."), "{warnings}");
}

#[test]
fn copies_are_arranged_on_the_tray_and_cost_what_they_weigh() {
    let bench = Bench::new();
    bench.run(["material", "simulate", "synthetic", "--photons", "40000", "-o", "m"]).exits(0);
    let resins = std::fs::read_to_string(bench.path("m/synthetic.toml")).unwrap();
    bench.write("m/synthetic.toml", resins.replace("\nrgba", "\nprice-per-kg = 200\nrgba").as_bytes());
    bench.job_with("set = \"synthetic\"", "file = \"m/synthetic.toml\"");
    let job = std::fs::read_to_string(bench.path("job.toml")).unwrap();
    let job = job.replace("mesh = \"cube.stl\"", "mesh = \"cube.stl\"\ncount = 3");
    bench.write("job.toml", job.as_bytes());
    bench
        .run(["slice", "job.toml", "--dry-run"])
        .refuses(2, &["object[0].count: found 3 at one place", "arrange = true"]);
    let job = format!("arrange = true\ngap-mm = 1.5\n{job}").replace("[\"png\", \"masks\"]", "[\"png\", \"preview\"]");
    let job = job.replace("pitch-mm = [0.2, 0.2, 0.2]", "pitch-mm = [0.2, 0.2, 0.2]\ntray-mm = [10, 10, 10]");
    bench.write("job.toml", job.as_bytes());
    let json = bench.run(["slice", "job.toml", "--dry-run", "--json"]).exits(0).json();
    // Two fit beside each other on 10 mm; 4 + 1.5 mm is 5.6 mm in voxels of 0.2 mm.
    let places: Vec<_> = json["objects"].as_array().unwrap().iter().map(|o| o["position_mm"].clone()).collect();
    for (place, expected) in places.iter().zip([[0.0, 0.0], [5.6, 0.0], [0.0, 5.6]]) {
        let found = [0, 1].map(|axis| place[axis].as_f64().unwrap());
        assert!(found.iter().zip(expected).all(|(found, mm)| (found - mm).abs() < 1e-9), "{place} {expected:?}");
    }
    let white = &json["materials"][0];
    assert!((white["cost"].as_f64().unwrap() - 0.2 * white["mass_g"].as_f64().unwrap()).abs() < 1e-9);
    let ran = bench.run(["slice", "job.toml", "-o", "out"]).exits(0);
    assert!(ran.stdout.contains("by the prices of the material file"), "{}", ran.stdout);
    assert!(bench.path("out/preview/tray.png").is_file());
    let voxels: u64 =
        bench.manifest("out")["materials"].as_array().unwrap().iter().map(|m| m["voxels"].as_u64().unwrap()).sum();
    assert_eq!(voxels, 3 * 8000);
    let moved = job.replace("count = 3", "count = 3\nposition-mm = [1, 1, 0]");
    bench.write("job.toml", moved.as_bytes());
    bench.run(["slice", "job.toml", "--dry-run"]).refuses(2, &["object[0].position-mm", "the job finds one"]);
}
