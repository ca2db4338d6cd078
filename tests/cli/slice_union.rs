//! What is surface: bodies and objects that overlap or touch, and what shares weigh.

use std::fs;

use serde_json::Value;

use crate::support::{Bench, JOB, cube, stl};

/// Voxels of a slice that are of this colour.
fn pixels(bench: &Bench, out: &str, slice: u32) -> Vec<Vec<[u8; 4]>> {
    let file = fs::File::open(bench.path(format!("{out}/slices/slice_{slice}.png"))).unwrap();
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let pixels: Vec<[u8; 4]> = bytes.chunks(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
    pixels.chunks(info.width as usize).map(<[_]>::to_vec).collect()
}

/// A job of two cubes, the second with these keys; `root` comes before all tables.
fn two(second: &str, root: &str) -> String {
    let rest = &JOB[JOB.find("[printer]").unwrap()..];
    format!("{root}\n[[object]]\nmesh = \"cube.stl\"\n[[object]]\nmesh = \"cube.stl\"\n{second}\n{rest}")
}

#[test]
fn objects_that_touch_have_no_surface_between_them() {
    let bench = Bench::new();
    bench.write("job.toml", two("position-mm = [4.0, 0.0, 0.0]", "").as_bytes());
    let ran = bench.slice("out");
    let said = "object 1 (cube.stl) and object 2 (cube.stl) touch: they are one body";
    assert!(ran.stderr.contains(said) && !ran.stderr.contains("nearer together"), "{}", ran.stderr);
    let rows = pixels(&bench, "out", 10);
    assert_eq!((rows.len(), rows[0].len()), (20, 40));
    let core = rows[10][10];
    // From the core of one to the core of the other there is nothing else.
    assert!(rows[10][10..30].iter().all(|p| *p == core), "{:?}", rows[10]);
    assert_ne!(rows[10][0], core);
    assert_eq!(rows[10][0], rows[10][39]);
}

/// Objects that do not touch, with no voxel's centre between them: in a row, across rows, across slices.
#[test]
fn objects_that_print_glued_are_named() {
    let bench = Bench::new();
    let said = "object 1 (cube.stl) and object 2 (cube.stl) lie nearer together than voxels tell: they print as one";
    for (axis, apart, glued) in
        [(0, 4.02, true), (1, 4.02, true), (2, 4.05, true), (0, 4.3, false), (1, 4.3, false), (2, 4.3, false)]
    {
        let mut at = [1.0, 1.0, 0.0];
        at[axis] = apart;
        bench.write("job.toml", two(&format!("position-mm = {at:?}"), "").as_bytes());
        let ran = bench.run(["slice", "job.toml", "--dry-run"]).exits(0);
        assert_eq!(ran.stderr.contains(said), glued, "{at:?}: {}", ran.stderr);
        assert!(!ran.stderr.contains("one body"), "{at:?}: {}", ran.stderr);
    }
    bench.write("job.toml", two("position-mm = [4.02, 0.0, 0.0]", "").as_bytes());
    assert!(bench.slice("out").stderr.contains(said));
    let json = bench.run(["slice", "job.toml", "--dry-run", "--json"]).exits(0).json();
    assert_eq!(json["printable"]["pieces"]["glued"], serde_json::json!([[0, 1]]));
}

/// Below a plate of 0.4 mm the block has the plate's layers, by their depth below the plate's top; in a material mesh
/// too.
#[test]
fn below_a_thin_plate_a_block_is_layered_as_the_plate_asks() {
    let bench = Bench::new();
    let plate: Vec<_> = cube(2.0).into_iter().map(|t| t.map(|[x, y, z]| [x, y, 0.2 * z])).collect();
    bench.write("plate.stl", &stl(&plate));
    let rest = JOB[JOB.find("[printer]").unwrap()..].replace("\"masks\"", "\"stl\"").replace("white:0.5", "white:0.6");
    let target = "[object.target]\nkind = \"stacking\"\nstack = \"black:0.2,white:0.8\"";
    let second = format!("[[object]]\nmesh = \"plate.stl\"\nposition-mm = [1.0, 1.0, 4.0]\n{target}");
    bench.write("job.toml", format!("[[object]]\nmesh = \"cube.stl\"\n{second}\n{rest}").as_bytes());
    bench.slice("out");
    // White where the first cube begins, at half of its height.
    let white = pixels(&bench, "out", 10)[10][0];
    let column = |slice: u32| pixels(&bench, "out", slice)[10][10] == white;
    assert_eq!([21, 20, 19, 18, 17, 16, 15].map(column), [false, true, true, true, true, false, false]);
    let manifest: Value = serde_json::from_slice(&fs::read(bench.path("out/manifest.json")).unwrap()).unwrap();
    let volume = |list: &str, key: &str, name: &str| {
        let entries = manifest[list].as_array().unwrap();
        entries.iter().find(|entry| entry[key] == name).unwrap()["volume_mm3"].as_f64().unwrap()
    };
    let [voxels, mesh] = [volume("materials", "name", "white"), volume("meshes", "material", "white")];
    assert!((mesh / voxels - 1.0).abs() < 0.05, "{mesh} {voxels}");
}

#[test]
fn objects_that_share_space_are_refused_unless_the_job_joins_them() {
    let bench = Bench::new();
    bench.write("job.toml", two("position-mm = [2.0, 1.0, 1.0]", "").as_bytes());
    let parts = ["object 1 (cube.stl) and object 2 (cube.stl) at the same place", "overlap = \"union\""];
    bench.run(["slice", "job.toml", "-o", "out"]).refuses(2, &parts);
    bench.write("job.toml", two("position-mm = [2.0, 1.0, 1.0]", "overlap = \"union\"").as_bytes());
    let ran = bench.slice("out");
    assert!(ran.stderr.contains("share space"), "{}", ran.stderr);
    let rows = pixels(&bench, "out", 12);
    // Through the middle of what they share: layers at both ends, the core between.
    let row = &rows[rows.len() / 2];
    let core = row[10];
    assert!(row[8..22].iter().all(|p| *p == core), "{row:?}");
    assert_ne!(row[0], core);
    bench.write("job.toml", two("scale = 0.5\nposition-mm = [1.0, 1.0, 1.0]", "overlap = \"union\"").as_bytes());
    bench.run(["slice", "job.toml", "-o", "within"]).refuses(2, &["object 2", "wholly within others"]);
}

#[test]
fn a_wall_thinner_than_a_voxel_is_named_with_its_loss() {
    let bench = Bench::new();
    let wall: Vec<_> = cube(4.0).into_iter().map(|t| t.map(|[x, y, z]| [x, y, z * 0.3])).collect();
    bench.write("cube.stl", &stl(&wall));
    bench.job_with("[0.2, 0.2, 0.2]", "[0.2, 0.2, 0.8]");
    let ran = bench.slice("out");
    assert!(ran.stderr.contains("cube.stl: 25.60 mm³ are printed of 19.20 mm³ of the mesh (+33.3%)"), "{}", ran.stderr);
}

/// A cube with one red face, as two materials without a texture.
#[test]
fn shares_are_of_area() {
    let bench = Bench::new();
    let corners = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 0 0 4\nv 4 0 4\nv 4 4 4\nv 0 4 4\n";
    let faces =
        "mtllib m.mtl\nusemtl red\nf 5 6 7 8\nusemtl grey\nf 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    bench.write("box.obj", format!("{corners}{faces}").as_bytes());
    bench.write("m.mtl", b"newmtl red\nKd 0.8 0.8 0.8\nnewmtl grey\nKd 0.3 0.3 0.3\n");
    for (k, shares) in [(2, vec![1.0 / 6.0, 5.0 / 6.0]), (1, vec![1.0])] {
        let job = JOB
            .replace("cube.stl", "box.obj")
            .replace(
                "kind = \"stacking\"\nstack = \"white:0.5,support:0.6\"",
                "kind = \"texture\"\nmean-free-path-mm = 0.5",
            )
            .replace(
                "[stacking]",
                &format!(
                    "[clusters]\nk = {k}\n[stacking]\nobjective = \"l2\"\ndepth = 3\nunits = 16\n\
                     max-thickness-mm = 2.0"
                ),
            );
        bench.write("job.toml", job.as_bytes());
        let out = format!("out-{k}");
        bench.slice(&out);
        let json: Value = serde_json::from_slice(&fs::read(bench.path(&out).join("stackings.json")).unwrap()).unwrap();
        let stackings = json["objects"][0]["stackings"].as_array().unwrap();
        let mut found: Vec<f64> = stackings.iter().map(|entry| entry["share"].as_f64().unwrap()).collect();
        found.sort_by(f64::total_cmp);
        assert_eq!(found.len(), shares.len());
        assert!(found.iter().zip(&shares).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        if k == 1 {
            // The mean over the surface, not over the two colours; other objectives than l2 weigh the darker one more.
            let albedo = stackings[0]["target_albedo"][0].as_f64().unwrap();
            assert!((albedo - (0.8 + 5.0 * 0.3) / 6.0).abs() < 1e-3, "{albedo}");
        }
    }
}
