//! Bad jobs: one line with file, place, found and expected, exit code 2, and nothing written.

use crate::support::{Bench, cube, stl};

/// Replaced in the job; by what; parts of the one line.
const CASES: [(&str, &str, &[&str]); 24] = [
    ("[[object]]", "[[objekt]]", &["job.toml:2", "objekt", "did you mean `object`?"]),
    ("mesh = ", "mesch = ", &["job.toml:3:1", "mesch", "did you mean `mesh`?"]),
    ("\"cube.stl\"", "\"none.stl\"", &["job.toml:3", "none.stl", "does not exist"]),
    ("\"cube.stl\"", "7", &["job.toml:3", "object[0].mesh", "found 7"]),
    ("\"cube.stl\"", "\"cube.stl\"\nscale = 0", &["job.toml:4", "scale", "found 0"]),
    ("\"cube.stl\"", "\"cube.stl\"\nheight-mm = nan", &["job.toml:4", "height-mm", "found nan"]),
    ("\"cube.stl\"", "\"cube.stl\"\nheight-mm = 1e9", &["job.toml:4", "height-mm"]),
    ("\"cube.stl\"", "\"cube.stl\"\nrotate-deg = [0, 0]", &["job.toml:4", "rotate-deg", "three numbers"]),
    ("\"cube.stl\"", "\"cube.stl\"\nposition-mm = [-1, 0, 0]", &["job.toml:4", "position-mm", "-1"]),
    ("\"cube.stl\"", "\"cube.stl\"\nunit = \"feet\"", &["job.toml:4", "unit", "feet"]),
    ("[0.2, 0.2, 0.2]", "[0.2, 0.2, 0]", &["job.toml:5", "printer.pitch-mm[2]", "found 0"]),
    ("pitch-mm = [0.2, 0.2, 0.2]", "preset = \"j750-27\"", &["job.toml:5", "j750-27um", "did you mean"]),
    ("pitch-mm = [0.2, 0.2, 0.2]", "", &["job.toml:4", "printer.pitch-mm", "found nothing"]),
    ("\"synthetic\"", "\"synthetik\"", &["job.toml:7", "did you mean `synthetic`?"]),
    ("set = \"synthetic\"", "file = \"cube.stl\"", &["cube.stl"]),
    ("\"stacking\"", "\"stackings\"", &["job.toml:9", "target.kind", "did you mean `stacking`?"]),
    ("white:0.5", "white", &["job.toml:10", "layer 1"]),
    ("white:0.5", "wite:0.5", &["job.toml:10", "wite", "did you mean `white`?"]),
    ("white:0.5", "white:-0.5", &["job.toml:10", "layer 1", "-0.5"]),
    ("core = \"black\"", "core = \"blakc\"", &["job.toml:12", "did you mean `black`?"]),
    ("core = \"black\"", "core = \"black\"\nunits = 60", &["job.toml:13", "stacking.units", "found 60"]),
    ("\"masks\"", "\"gcvf\"", &["job.toml:14", "gcvf", "not built yet"]),
    ("\"masks\"", "\"tiff\"", &["job.toml:14", "tiff"]),
    ("[output]", "[output", &["job.toml:13", "TOML"]),
];

#[test]
fn bad_jobs_are_refused_in_one_line() {
    let bench = Bench::new();
    for (from, to, parts) in CASES {
        bench.job_with(from, to);
        bench.run(["slice", "job.toml", "-o", "out"]).refuses(2, parts);
        assert!(!bench.path("out").exists(), "{to}");
    }
}

#[test]
fn bad_inputs_are_refused_in_one_line() {
    let bench = Bench::new();
    let with_mesh = |content: &[u8], parts: &[&str]| {
        bench.write("cube.stl", content);
        bench.run(["slice", "job.toml", "-o", "out"]).refuses(2, parts);
    };
    with_mesh(b"", &["cube.stl"]);
    with_mesh(b"solid nothing\nendsolid", &["cube.stl"]);
    with_mesh(&stl(&cube(4.0))[..200], &["cube.stl"]);
    let mut odd = cube(4.0);
    odd[3][1][2] = f32::NAN;
    with_mesh(&stl(&odd), &["cube.stl"]);
    with_mesh(&stl(&[[[0.0; 3]; 3]; 4]), &["cube.stl"]);
    let mut huge = cube(4.0);
    huge.iter_mut().flatten().flatten().for_each(|c| *c *= 1e6);
    with_mesh(&stl(&huge), &["cube.stl", "4e6 mm", "unit"]);
    let open = &cube(4.0)[..8];
    with_mesh(&stl(open), &["cube.stl: the mesh is an open sheet"]);
    assert!(!bench.path("out").exists());

    bench.run(["slice", "none.toml"]).refuses(2, &["none.toml", "no such file"]);
    bench.run(["slice", "."]).refuses(2, &["a folder"]);
    bench.write("bytes.toml", b"\xff\xfe");
    bench.run(["slice", "bytes.toml"]).refuses(2, &["bytes.toml", "UTF-8"]);
}

#[test]
fn an_object_smaller_than_a_voxel_is_told() {
    let bench = Bench::new();
    bench.write("cube.stl", &stl(&cube(0.05)));
    let ran = bench.slice("out");
    assert!(ran.stderr.contains("warning: no voxel's centre lies inside an object"), "{}", ran.stderr);
}
