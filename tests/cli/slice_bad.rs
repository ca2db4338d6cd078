//! Bad jobs: one line with file, place, found and expected, exit code 2, and nothing written.

use crate::support::{Bench, JOB, cube, stl};

/// Replaced in the job; by what; parts of the one line.
const CASES: [(&str, &str, &[&str]); 25] = [
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
    ("\"masks\"", "\"svx\"", &["job.toml:14", "svx", "not built yet"]),
    ("\"masks\"", "\"gcvf\"", &["job.toml:14", "\"gcvf\" of 20 slices", "at least 30"]),
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
    with_mesh(&stl(&huge), &["cube.stl", "4000000 mm", "unit"]);
    assert!(!bench.path("out").exists());

    // Without one of its sides the cube is an open sheet.
    with_mesh(&stl(&cube(4.0)[2..]), &["error: cube.stl: the mesh is an open sheet"]);
    let mut tiny = cube(4.0);
    tiny.iter_mut().flatten().flatten().for_each(|c| *c *= 1e-3);
    with_mesh(&stl(&tiny), &["job.toml:3", "object[0].mesh", "4.000e-3", "a voxel", "unit"]);
    assert!(!bench.path("out").exists());

    bench.run(["slice", "none.toml"]).refuses(2, &["none.toml", "no such file"]);
    bench.run(["slice", "."]).refuses(2, &["a folder"]);
    bench.write("bytes.toml", b"\xc3\x28 = 1\n");
    bench.run(["slice", "bytes.toml"]).refuses(2, &["bytes.toml", "UTF-8"]);
}

#[test]
fn what_would_fail_after_the_slices_fails_before_them() {
    let bench = Bench::new();
    let job = JOB
        .replace("\"masks\"]", "\"stl\"]\nmesh-pitch-mm = 0.001")
        .replace("\"cube.stl\"", "\"cube.stl\"\nscale = 10");
    bench.write("job.toml", job.as_bytes());
    bench
        .run(["slice", "job.toml", "-o", "out"])
        .refuses(2, &["job.toml:16", "output.mesh-pitch-mm", "0.001", "nodes"]);
    bench.run(["slice", "job.toml", "--dry-run"]).refuses(2, &["output.mesh-pitch-mm"]);
    assert!(!bench.path("out").exists());
}

#[test]
fn an_error_says_its_cause_once() {
    let bench = Bench::new();
    bench.job_with("\"cube.stl\"", "\"cube.stl\"\nheight-mm = 10");
    let flat: Vec<_> =
        cube(4.0).into_iter().filter(|triangle| triangle.iter().all(|corner| corner[2] == 0.0)).collect();
    bench.write("cube.stl", &stl(&flat));
    let ran = bench.run(["slice", "job.toml", "-o", "out"]);
    assert_eq!(ran.stderr.matches("height-mm").count(), 1, "{}", ran.stderr);
    ran.refuses(2, &["error: cube.stl: height-mm", "flat"]);
}

#[test]
fn a_set_without_black_needs_a_core() {
    let bench = Bench::new();
    let resin = "[[resin]]\nname = \"grey\"\nrgba = [9, 9, 9]\ndensity-g-per-cm3 = 1.1\n\
                 scattering-per-mm = 1.0\nabsorption-per-mm = 1.0\ng = 0.0\n";
    bench.write("resins.toml", resin.as_bytes());
    let job = JOB.replace("set = \"synthetic\"", "file = \"resins.toml\"").replace("core = \"black\"", "");
    bench.write("job.toml", job.replace("white:0.5,support:0.6", "grey:1").as_bytes());
    bench.run(["slice", "job.toml", "-o", "out"]).refuses(2, &["job.toml:11", "stacking.core", "no core", "`black`"]);
}

/// Only where the job asks for the mesh's own colour does it matter that it is lost.
#[test]
fn a_base_colour_that_cannot_be_read_is_no_white() {
    let bench = Bench::new();
    let mut mesh = "mtllib cube.mtl\nusemtl marble\nvt 0 0\n".to_owned();
    for (n, triangle) in cube(4.0).iter().enumerate() {
        triangle.iter().for_each(|[x, y, z]| mesh += &format!("v {x} {y} {z}\n"));
        mesh += &format!("f {}/1 {}/1 {}/1\n", 3 * n + 1, 3 * n + 2, 3 * n + 3);
    }
    bench.write("cube.obj", mesh.as_bytes());
    let own =
        JOB.replace("cube.stl", "cube.obj").replace("\"stacking\"\nstack = \"white:0.5,support:0.6\"", "\"texture\"");
    bench.write("job.toml", own.as_bytes());
    bench
        .run(["slice", "job.toml", "-o", "out"])
        .refuses(2, &["job.toml:8", "target", "cube.obj", "cube.mtl", "albedo"]);
    bench.write("cube.mtl", b"newmtl marble\nmap_Kd none.png\n");
    bench.run(["slice", "job.toml", "-o", "out"]).refuses(2, &["cube.obj", "cube.mtl, line 2", "none.png", "albedo"]);
    assert!(!bench.path("out").exists());
    bench.write("job.toml", own.replace("\"texture\"", "\"texture\"\nalbedo-value = 0.3").as_bytes());
    bench.run(["slice", "job.toml", "-o", "out"]).exits(0);
}

/// A PNG of grey texels with what is said of its numbers.
fn grey(size: [u32; 2], gamma: Option<u32>, srgb: bool, value: u8) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, size[0], size[1]);
    if let Some(gamma) = gamma {
        encoder.set_source_gamma(png::ScaledFloat::from_scaled(gamma));
    }
    if srgb {
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    }
    encoder.write_header().unwrap().write_image_data(&vec![value; (size[0] * size[1]) as usize]).unwrap();
    file
}

#[test]
fn images_of_another_space_or_size_are_told_of() {
    let bench = Bench::new();
    let target = "kind = \"texture\"\nprojection = \"triplanar\"\nalbedo = \"a.png\"\nmean-free-path = \"m.png\"";
    bench.job_with_all(&[
        ["kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"", target],
        ["core = \"black\"", "core = \"black\"\nmodel = \"km\"\nunits = 8\ndepth = 2"],
    ]);
    let told = |albedo: Vec<u8>, path: Vec<u8>| {
        bench.write("a.png", &albedo);
        bench.write("m.png", &path);
        bench.run(["slice", "job.toml", "--dry-run"]).exits(0).stderr
    };
    let sound = told(grey([4, 4], None, true, 99), grey([8, 8], Some(100_000), false, 99));
    assert!(!sound.contains("target."), "{sound}");
    let marked = told(grey([4, 4], Some(100_000), false, 99), grey([8, 4], None, true, 99));
    for word in [
        "target.albedo: a.png: found numbers that are marked as light to the power of 1,",
        "target.mean-free-path: m.png: found numbers that are marked as sRGB, expected linear factors",
        "target.mean-free-path: m.png: found 8 × 4 texels, expected the proportions of a.png, 4 × 4",
    ] {
        assert!(marked.contains(word), "{word}: {marked}");
    }
    let one = told(grey([1, 1], None, false, 99), grey([8, 4], None, false, 99));
    assert!(one.contains("target.albedo: a.png: found 1 × 1 texels") && !one.contains("proportions"), "{one}");
    bench.write("m.png", &grey([8, 4], None, false, 0));
    bench.run(["slice", "job.toml", "--dry-run"]).refuses(2, &["target.mean-free-path", "m.png of zeros"]);
    bench.write("m.png", b"glTF\x02\0\0\0");
    let told = ["job.toml:", "target.mean-free-path: found ", "m.png: something else", "expected a PNG or JPEG image"];
    bench.run(["slice", "job.toml"]).refuses(2, &told);
}
