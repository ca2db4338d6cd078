//! Files that hold a whole job: made with it or from its folder, the same bytes; read back by another reader here; and
//! what they cannot hold.

use std::{
    collections::BTreeMap,
    fs,
    io::{Cursor, Read},
};

use serde_json::Value;

use crate::support::{Bench, JOB, sphere, stl};

/// A ball of 4 mm in 25 × 20 × 40 voxels, on a lattice of whole dots per inch.
fn bench(formats: &str) -> Bench {
    let bench = Bench::new();
    bench.write("ball.stl", &stl(&sphere(2.0, 24)));
    let job = JOB.replace("cube.stl", "ball.stl").replace("[0.2, 0.2, 0.2]", "[0.16, 0.2, 0.1]");
    // 25.4 / 0.16 is no whole number, 25.4 / 0.15875 is 160.
    let job = job.replace("[0.16,", "[0.15875,").replace("[\"png\", \"masks\"]", formats);
    bench.write("job.toml", job.as_bytes());
    bench
}

/// Voxels by resin as the manifest has them.
fn counts(manifest: &Value) -> BTreeMap<String, u64> {
    let materials = manifest["materials"].as_array().unwrap();
    let count =
        |material: &Value| (material["name"].as_str().unwrap().to_owned(), material["voxels"].as_u64().unwrap());
    materials.iter().map(count).collect()
}

fn part(archive: &[u8], name: &str) -> Vec<u8> {
    let mut zip = zip::ZipArchive::new(Cursor::new(archive)).unwrap();
    let mut bytes = Vec::new();
    zip.by_name(name).unwrap().read_to_end(&mut bytes).unwrap();
    bytes
}

#[test]
fn a_job_and_its_folder_make_the_same_containers() {
    let bench = bench("[\"png\", \"gcvf\", \"bmp\", \"vti\", \"nrrd\", \"vdb\"]");
    bench.slice("job");
    bench.run(["verify", "job"]).exits(0);
    bench.run(["verify", "job", "--job", "job.toml", "--deep"]).exits(0);
    let whole = bench.files("job");
    let png = fs::read_to_string(bench.path("job.toml")).unwrap();
    let all = "[\"png\", \"gcvf\", \"bmp\", \"vti\", \"nrrd\", \"vdb\"]";
    bench.write("job.toml", png.replace(all, "[\"png\"]").as_bytes());
    bench.slice("folder");
    for format in ["gcvf", "bmp", "vti", "nrrd", "vdb"] {
        let ran = bench.run(["convert", "folder", "--to", format]).exits(0);
        assert!(!ran.stderr.contains("support"), "{}", ran.stderr);
    }
    // Once more, all at a time, replaces the same.
    let ran = bench.run(["convert", "folder", "--to", "gcvf,bmp,vti,nrrd,vdb"]).exits(0);
    assert_eq!(ran.stdout.lines().count(), 6, "five files and mapping.txt, once: {}", ran.stdout);
    bench.run(["convert", "folder", "--to", "vti,png"]).refuses(2, &["--to: found png"]);
    bench.run(["verify", "folder"]).exits(0);
    bench.run(["verify", "folder", "--job", "job.toml", "--deep"]).exits(0);
    let converted = bench.files("folder");
    let made = |path: &String| path.starts_with("exports/") || path.starts_with("bmp/") || path == "mapping.txt";
    let names: Vec<_> = whole.keys().filter(|path| made(path)).collect();
    assert_eq!(names, converted.keys().filter(|path| made(path)).collect::<Vec<_>>());
    assert!(names.len() > 80, "{names:?}");
    for name in names {
        assert!(whole[name] == converted[name], "{name} differs");
    }
}

#[test]
fn a_gcvf_holds_its_slices_and_says_what_they_are() {
    let bench = bench("[\"png\", \"gcvf\"]");
    let ran = bench.slice("out");
    assert!(ran.stderr.contains("GrabCAD Voxel Print is known to take 600 × 300 dpi"), "{}", ran.stderr);
    let archive = fs::read(bench.path("out/exports/job.gcvf")).unwrap();
    let config = String::from_utf8(part(&archive, "ConfigFile.xml")).unwrap();
    let counts = counts(&bench.manifest("out"));
    for line in [
        "<XDpi>160</XDpi>",
        "<YDpi>127</YDpi>",
        "<SliceThicknessNanoMeter>100000</SliceThicknessNanoMeter>",
        "<SliceWidth>26</SliceWidth>",
        "<SliceHeight>20</SliceHeight>",
        "<NumberOfSlices>40</NumberOfSlices>",
        "<BackGroundMaterialRGBA>0 0 0 0</BackGroundMaterialRGBA>",
        &format!("<VoxelCount>{}</VoxelCount>", counts["white"]),
        &format!("<VoxelCount>{}</VoxelCount>", counts["black"]),
    ] {
        assert!(config.contains(line), "{config}\nlacks {line}");
    }
    for k in 0..40 {
        let slice = fs::read(bench.path(format!("out/slices/slice_{k}.png"))).unwrap();
        assert!(part(&archive, &format!("slice_{k}.png")) == slice);
    }
    let numbers = part(&archive, "MeshBbx.ktn");
    let numbers: Vec<f32> = numbers.chunks(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
    // The ball of 4 mm, but for the voxels whose centres it misses.
    assert!(numbers[..3].iter().all(|low| (0.0..0.35).contains(low)), "{numbers:?}");
    assert!(numbers[3..].iter().all(|high| (3.65..4.2).contains(high)), "{numbers:?}");
    let heights = part(&archive, "Zbuffer.png");
    let heights = image::load_from_memory(&heights).unwrap().into_luma16();
    assert_eq!(heights.dimensions(), (26, 20));
    assert_eq!(heights.get_pixel(12, 10).0[0], 40);
    assert_eq!(heights.get_pixel(0, 0).0[0], 0);
    let mapping = fs::read_to_string(bench.path("out/mapping.txt")).unwrap();
    assert!(mapping.contains(&format!("{:>14}", counts["white"])), "{mapping}");
}

/// What the metadata of a VDB's grid says of its active voxels: how many, least and greatest index.
fn active_of(vdb: &[u8], grid: &str) -> (u64, [[i32; 3]; 2]) {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let find = |from: usize, what: &[u8]| from + vdb[from..].windows(what.len()).position(|at| at == what).unwrap();
    // The name stands before the type of its tree.
    let grid = ["Tree_float_5_4_3", "Tree_int32_5_4_3"].iter().find_map(|kind| {
        let heading = [text(grid), text(kind)].concat();
        vdb.windows(heading.len()).position(|at| at == heading)
    });
    let grid = grid.unwrap();
    let value = |key: &str, kind: &str| {
        let entry = [text(key), text(kind)].concat();
        &vdb[find(grid, &entry) + entry.len() + 4..]
    };
    let index = |key| std::array::from_fn(|axis| value(key, "vec3i")[4 * axis..][..4].try_into().unwrap());
    let count = u64::from_le_bytes(value("file_voxel_count", "int64")[..8].try_into().unwrap());
    (count, ["file_bbox_min", "file_bbox_max"].map(|key| index(key).map(i32::from_le_bytes)))
}

#[test]
fn a_vdb_says_where_its_active_voxels_are() {
    let bench = bench("[\"png\", \"vdb\"]");
    bench.slice("out");
    let vdb = fs::read(bench.path("out/exports/job.vdb")).unwrap();
    let manifest = bench.manifest("out");
    let mut all = (0, [[i32::MAX; 3], [0; 3]]);
    for material in manifest["materials"].as_array().unwrap().iter().filter(|material| material["voxels"] != 0) {
        let rgba: Vec<u8> = serde_json::from_value(material["rgba"].clone()).unwrap();
        if rgba[3] == 0 {
            // Support, of which slices show nothing: its voxels lie within the black and white ones' box.
            all.0 += material["voxels"].as_u64().unwrap();
            continue;
        }
        let mut there = (0, [[i32::MAX; 3], [0; 3]]);
        for k in 0..40 {
            let slice = image::open(bench.path(format!("out/slices/slice_{k}.png"))).unwrap().into_rgba8();
            for (x, y, _) in slice.enumerate_pixels().filter(|(_, _, pixel)| pixel.0 == rgba[..]) {
                let at = [x as i32, slice.height() as i32 - 1 - y as i32, k];
                for found in [&mut there, &mut all] {
                    found.0 += 1;
                    found.1[0] = std::array::from_fn(|axis| found.1[0][axis].min(at[axis]));
                    found.1[1] = std::array::from_fn(|axis| found.1[1][axis].max(at[axis]));
                }
            }
        }
        let name = material["name"].as_str().unwrap();
        assert_eq!(active_of(&vdb, name), there, "{name}");
        // No whole bricks: the ball of 26 × 20 × 40 voxels ends within them.
        assert!(there.1[0].iter().chain(&there.1[1]).any(|index| index % 8 != 0 && index % 8 != 7), "{there:?}");
    }
    assert_eq!(active_of(&vdb, "material"), all);
}

#[test]
fn damage_to_a_container_is_found_even_where_the_manifest_agrees() {
    let bench = bench("[\"gcvf\", \"bmp\", \"vti\", \"nrrd\"]");
    bench.slice("out");
    let relist = |path: &str, bytes: &[u8]| {
        use sha2::{Digest, Sha256};
        fs::write(bench.path(format!("out/{path}")), bytes).unwrap();
        let mut manifest = bench.manifest("out");
        let files = manifest["files"].as_array_mut().unwrap();
        let entry = files.iter_mut().find(|file| file["path"] == path).unwrap();
        entry["bytes"] = bytes.len().into();
        let hex: String = Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect();
        entry["sha256"] = hex.into();
        fs::write(bench.path("out/manifest.json"), manifest.to_string()).unwrap();
    };
    let finds = |path: &str, words: &str| {
        let ran = bench.run(["verify", "out"]).exits(1);
        assert!(ran.stdout.contains(path) && ran.stdout.contains(words), "{}", ran.stdout);
    };
    // A voxel of the first material less.
    let bitmap = "bmp/Mat1_0020.bmp";
    let sound = fs::read(bench.path(format!("out/{bitmap}"))).unwrap();
    let mut bytes = sound.clone();
    let at = 62 + bytes[62..].iter().position(|byte| *byte != 0).unwrap();
    bytes[at] &= bytes[at] - 1;
    relist(bitmap, &bytes);
    finds("bmp: ", "the manifest has");
    relist(bitmap, &sound);
    // A container of another job.
    let other = self::bench("[\"gcvf\", \"vti\", \"nrrd\"]");
    other.edit_stack();
    other.slice("out");
    for format in ["gcvf", "vti", "nrrd"] {
        let path = format!("exports/job.{format}");
        let sound = fs::read(bench.path(format!("out/{path}"))).unwrap();
        relist(&path, &fs::read(other.path(format!("out/{path}"))).unwrap());
        finds(&path, "manifest");
        relist(&path, &sound);
    }
    bench.run(["verify", "out"]).exits(0);
}

impl Bench {
    fn edit_stack(&self) {
        let job = fs::read_to_string(self.path("job.toml")).unwrap();
        self.write("job.toml", job.replace("white:0.5,support:0.6", "white:0.8,support:0.3").as_bytes());
    }
}

#[test]
fn containers_are_the_same_for_any_number_of_threads_and_never_of_a_part() {
    let bench = bench("[\"gcvf\", \"vti\", \"nrrd\", \"vdb\"]");
    for (threads, out) in [("1", "one"), ("4", "four")] {
        let mut command = bench.command(["slice", "job.toml", "-o", out]);
        crate::support::Ran::from(command.env("RAYON_NUM_THREADS", threads).output().unwrap()).exits(0);
    }
    assert!(bench.files("one") == bench.files("four"));
    bench
        .run(["slice", "job.toml", "-o", "part", "--slices", "3..9"])
        .refuses(2, &["output.formats: found \"gcvf\" of slices 3..9, expected all 40 slices"]);
}

#[test]
fn what_a_format_cannot_hold_is_refused_before_work_starts() {
    let bench = bench("[\"gcvf\"]");
    let good = fs::read_to_string(bench.path("job.toml")).unwrap();
    let refuses = |from: &str, to: &str, parts: &[&str]| {
        bench.write("job.toml", good.replace(from, to).as_bytes());
        bench.run(["slice", "job.toml", "-o", "never"]).refuses(2, parts);
        assert!(!bench.path("never").exists());
    };
    refuses("0.1]", "0.2]", &["output.formats: found \"gcvf\" of 20 slices", "at least 30", "6.00 mm"]);
    refuses("0.15875", "0.16", &["output.formats: found \"gcvf\" of voxels of 0.16", "whole dots per inch"]);
    let seven = "\"white:0.2,cyan:0.2,magenta:0.2,yellow:0.2,black:0.2\"";
    let inks = good.replace("set = \"synthetic\"", "set = \"inks-rgb-7\"").replace("\"white:0.5,support:0.6\"", seven);
    bench.write("job.toml", inks.replace("gcvf", "bmp").as_bytes());
    bench
        .run(["slice", "job.toml", "-o", "never"])
        .refuses(2, &["output.formats: found \"bmp\" of 5 resins", "at most 3"]);
    bench.write("job.toml", inks.replace("gcvf", "png").as_bytes());
    bench.slice("inks");
    bench.run(["convert", "inks", "--to", "bmp"]).refuses(2, &["found 5 resins", "at most 3 for bmp"]);
    for (format, words) in [
        ("png", "which OUT is read from"),
        ("preview", "lumislice preview inks"),
        ("3mf", "lumislice slice JOB.toml -o OTHER, with formats = [\"3mf\"]"),
        ("stl", "slices no longer have them"),
        ("heights", "formats = [\"heights\"]"),
        ("masks", "slice by slice"),
    ] {
        bench.run(["convert", "inks", "--to", format]).refuses(2, &["--to: found", format, words]);
    }
    bench.run(["convert", "inks", "--to", "svx"]).exits(2);
    bench.write("job.toml", good.replace("gcvf", "masks").as_bytes());
    bench.slice("masks");
    bench.run(["convert", "masks", "--to", "vti"]).refuses(2, &["without images of all its slices", "\"png\""]);
    bench.write("job.toml", good.replace("gcvf", "png").as_bytes());
    bench.run(["slice", "job.toml", "-o", "part", "--slices", "3..9"]).exits(0);
    bench.run(["convert", "part", "--to", "vti"]).refuses(2, &["found slices 3..9", "all 40 of the job"]);
}

/// What a search may lay is known before it: nothing is searched to be refused afterwards.
#[test]
fn more_resins_than_a_printer_or_a_format_holds_are_refused_before_the_search() {
    let bench = bench("[\"bmp\"]");
    let good = fs::read_to_string(bench.path("job.toml")).unwrap();
    let searched = good
        .replace("set = \"synthetic\"", "set = \"inks-rgb-7\"")
        .replace("kind = \"stacking\"", "kind = \"texture\"")
        .replace("stack = \"white:0.5,support:0.6\"", "albedo-colour = [0.5, 0.3, 0.2]\nmean-free-path-mm = 0.5");
    // The mesh is read after the resins: what is refused for its resins has not come to it.
    let ball = fs::read(bench.path("ball.stl")).unwrap();
    bench.write("ball.stl", b"solid of no triangles");
    let refuses = |job: &str, parts: &[&str]| {
        bench.write("job.toml", job.as_bytes());
        bench.run(["slice", "job.toml", "-o", "never"]).refuses(2, parts);
        bench.run(["slice", "job.toml", "--dry-run"]).refuses(2, parts);
    };
    let cure = "at most 3: a material file without the others, or for each that is to be left out a [[stacking.limit]]";
    refuses(&searched, &["output.formats: found \"bmp\" of 6 resins: ", "clear", cure, "min-depth-mm = 5"]);
    let three = searched.replace("bmp", "png").replace("[materials]", "max-colors = 3\n[materials]");
    refuses(&three, &["printer: found custom of 6 resins: ", cure]);
    // With all but three of them left out the mesh is next.
    let limit = |name: &str| format!("\n[[stacking.limit]]\nresin = \"{name}\"\nmin-depth-mm = 5\n");
    let few = three.clone() + &["cyan", "yellow", "clear"].map(limit).concat();
    refuses(&few, &["ball.stl"]);
    // And what is left out is in nothing that is found.
    bench.write("ball.stl", &ball);
    bench.run(["slice", "job.toml", "-o", "few"]).exits(0);
    let counts = counts(&bench.manifest("few"));
    assert!(["cyan", "yellow", "clear"].iter().all(|name| counts[*name] == 0), "{counts:?}");
}
