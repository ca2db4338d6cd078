//! Volumes that hold what of every resin is in a voxel, where slices hold the one that is printed.

use std::{fs, io::Read};

use crate::support::{Bench, JOB, Ran};

const LAYERS: &str = "90% white + 10% black:0.7,support:0.5";
const DIMS: [usize; 3] = [20; 3];
const VOXELS: usize = DIMS[0] * DIMS[1] * DIMS[2];

/// A cube of 4 mm in 20³ voxels.
fn bench(layers: &str, formats: &str) -> Bench {
    let bench = Bench::new();
    let job = JOB.replace("white:0.5,support:0.6", layers);
    let job = job.replace("formats = [\"png\", \"masks\"]", &format!("formats = {formats}\nvolumes = \"fractions\""));
    bench.write("job.toml", job.as_bytes());
    bench
}

/// The header of a NRRD, and what it holds.
fn read_nrrd(bench: &Bench, path: &str) -> (String, Vec<u8>) {
    let file = fs::read(bench.path(path)).unwrap();
    let end = file.windows(2).position(|pair| pair == b"\n\n").unwrap() + 2;
    let mut data = Vec::new();
    flate2::read::GzDecoder::new(&file[end..]).read_to_end(&mut data).unwrap();
    (String::from_utf8(file[..end].to_vec()).unwrap(), data)
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect()
}

/// Ids of all voxels, and the fractions of all resins in each.
fn volumes(bench: &Bench, out: &str) -> (Vec<u8>, Vec<Vec<f32>>) {
    let (_, ids) = read_nrrd(bench, &format!("{out}/exports/job.nrrd"));
    let (header, data) = read_nrrd(bench, &format!("{out}/exports/job-fractions.nrrd"));
    for line in [
        "type: float",
        "dimension: 4",
        "sizes: 3 20 20 20",
        "kinds: list domain domain domain",
        "space directions: none (0.2,0,0) (0,0.2,0) (0,0,0.2)",
        "resin 0:=white",
        "resin 1:=black",
        "resin 2:=support",
    ] {
        assert!(header.lines().any(|found| found == line), "{header}\nlacks {line}");
    }
    let fractions: Vec<Vec<f32>> = floats(&data).chunks(3).map(<[f32]>::to_vec).collect();
    assert_eq!((ids.len(), fractions.len()), (VOXELS, VOXELS));
    (ids, fractions)
}

/// The arrays of a VTI by their order: bytes of all voxels.
fn read_vti(bench: &Bench, path: &str) -> Vec<Vec<u8>> {
    let file = fs::read(bench.path(path)).unwrap();
    let start = file.windows(14).position(|at| at == b"encoding=\"raw\"").unwrap();
    let data = start + file[start..].iter().position(|byte| *byte == b'_').unwrap() + 1;
    let header = String::from_utf8(file[..start].to_vec()).unwrap();
    let number = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap()) as usize;
    let array = |offset: usize| {
        let mut at = data + offset;
        let blocks = number(at);
        let sizes: Vec<usize> = (0..blocks).map(|n| number(at + 24 + 8 * n)).collect();
        at += 24 + 8 * blocks;
        let mut plain = Vec::new();
        for size in sizes {
            flate2::read::ZlibDecoder::new(&file[at..at + size]).read_to_end(&mut plain).unwrap();
            at += size;
        }
        plain
    };
    let offsets = header.split("offset=\"").skip(1).map(|rest| rest.split('"').next().unwrap().parse().unwrap());
    offsets.map(array).collect()
}

#[test]
fn a_mixture_is_its_shares_and_a_boundary_the_share_of_each_layer() {
    let bench = bench(LAYERS, "[\"png\", \"vti\", \"nrrd\", \"vdb\"]");
    bench.slice("out");
    bench.run(["verify", "out"]).exits(0);
    bench.run(["verify", "out", "--job", "job.toml", "--deep"]).exits(0);
    let (ids, fractions) = volumes(&bench, "out");
    let at = |depth: usize| &fractions[depth + DIMS[0] * (10 + DIMS[1] * 10)];
    // Depths are 0.1, 0.3 … mm; boundaries at 0.7 and 1.2 are moved by up to 0.1.
    for (depth, expected) in
        [(0, [0.9, 0.1, 0.0]), (2, [0.9, 0.1, 0.0]), (3, [0.45, 0.05, 0.5]), (4, [0.0, 0.0, 1.0]), (7, [0.0, 1.0, 0.0])]
    {
        assert!(at(depth).iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-4), "{depth}: {:?}", at(depth));
    }
    let mut drawn = 0;
    for (id, fractions) in ids.iter().zip(&fractions) {
        assert!((fractions.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        drawn += usize::from(fractions[usize::from(*id) - 1] == 0.0);
    }
    assert_eq!(drawn, 0, "voxels of a resin that is not there");
    for resin in 0..3 {
        let printed = ids.iter().filter(|id| usize::from(**id) == resin + 1).count() as f64;
        let expected: f64 = fractions.iter().map(|fractions| f64::from(fractions[resin])).sum();
        assert!((printed / expected - 1.0).abs() < 0.02, "{resin}: {printed} printed of {expected}");
    }
    let arrays = read_vti(&bench, "out/exports/job.vti");
    assert_eq!(arrays.len(), 4);
    assert!(arrays[0] == ids);
    for (resin, array) in arrays[1..].iter().enumerate() {
        assert!(floats(array).iter().zip(&fractions).all(|(found, all)| *found == all[resin]), "{resin}");
    }
    // Whole bricks of one mixture are tiles, whose value stands in the file as it is.
    let vdb = fs::read(bench.path("out/exports/job.vdb")).unwrap();
    let holds = |text: &[u8]| vdb.windows(text.len()).any(|at| at == text);
    assert!(holds(b"volume fraction of the resin, 0 to 1"));
}

#[test]
fn fractions_are_the_same_for_any_number_of_threads() {
    let bench = bench(LAYERS, "[\"vti\", \"nrrd\", \"vdb\"]");
    for (threads, out) in [("1", "one"), ("4", "four")] {
        let mut command = bench.command(["slice", "job.toml", "-o", out]);
        Ran::from(command.env("RAYON_NUM_THREADS", threads).output().unwrap()).exits(0);
    }
    assert!(bench.files("one") == bench.files("four"));
    let job = fs::read_to_string(bench.path("job.toml")).unwrap();
    bench.write("job.toml", job.replace("\"fractions\"", "\"voxels\"").as_bytes());
    bench.slice("voxels");
    let [ids, same] = ["one", "voxels"].map(|out| fs::read(bench.path(format!("{out}/exports/job.nrrd"))).unwrap());
    assert!(ids == same, "the volume of ids is the same with and without fractions");
}

#[test]
fn without_mixtures_fractions_are_all_or_nothing_and_that_is_said() {
    let bench = bench("white:0.7,support:0.5", "[\"vti\", \"nrrd\", \"vdb\"]");
    let ran = bench.slice("out");
    assert!(ran.stderr.contains("all fractions are 0 or 1"), "{}", ran.stderr);
    bench.run(["verify", "out"]).exits(0);
    let (ids, fractions) = volumes(&bench, "out");
    for (id, fractions) in ids.iter().zip(&fractions) {
        assert!((1..=3).all(|resin| fractions[resin - 1] == f32::from(u8::from(usize::from(*id) == resin))));
    }
}

#[test]
fn fractions_that_nothing_holds_are_refused() {
    let bench = bench(LAYERS, "[\"png\"]");
    let parts = ["job.toml:", "output.volumes: found values of volumes that are not written", "\"nrrd\"", "formats"];
    bench.run(["slice", "job.toml", "-o", "no"]).refuses(2, &parts);
    assert!(!bench.path("no").exists());
    let job = fs::read_to_string(bench.path("job.toml")).unwrap();
    let with_vti = job.replace("[\"png\"]", "[\"png\", \"vti\"]");
    bench.write("job.toml", with_vti.replace("\"fractions\"", "\"percent\"").as_bytes());
    bench.run(["slice", "job.toml", "-o", "no"]).refuses(2, &["output.volumes: found \"percent\"", "\"fractions\""]);
    // Slices have lost what they were drawn by.
    bench.write("job.toml", with_vti.as_bytes());
    bench.slice("out");
    let before = bench.files("out");
    for format in ["vti", "nrrd", "vdb"] {
        bench
            .run(["convert", "out", "--to", format])
            .refuses(2, &["out: found a job of volumes = \"fractions\"", format]);
    }
    assert!(bench.files("out") == before);
    bench.run(["convert", "out", "--to", "bmp"]).exits(0);
    bench.run(["verify", "out"]).exits(0);
}

/// Writes a file anew, as the manifest has it too, and expects `verify` to say so and no more of it.
fn finds(bench: &Bench, path: &str, bytes: &[u8], words: &str) {
    use sha2::{Digest, Sha256};

    fs::write(bench.path(format!("out/{path}")), bytes).unwrap();
    let mut manifest = bench.manifest("out");
    let entry = manifest["files"].as_array_mut().unwrap().iter_mut().find(|file| file["path"] == path).unwrap();
    entry["bytes"] = bytes.len().into();
    entry["sha256"] = Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect::<String>().into();
    fs::write(bench.path("out/manifest.json"), manifest.to_string()).unwrap();
    let ran = bench.run(["verify", "out"]);
    if words.is_empty() {
        ran.exits(0);
        return;
    }
    let ran = ran.exits(1);
    assert!(ran.stdout.contains(path) && ran.stdout.contains(words), "expected {words}\n{}", ran.stdout);
}

fn put(data: &mut [u8], at: usize, number: f32) {
    data[4 * at..4 * at + 4].copy_from_slice(&number.to_le_bytes());
}

#[test]
fn damaged_fractions_of_a_nrrd_are_found_even_where_the_manifest_agrees() {
    let bench = bench(LAYERS, "[\"nrrd\"]");
    bench.slice("out");
    let path = "exports/job-fractions.nrrd";
    let (header, sound) = read_nrrd(&bench, &format!("out/{path}"));
    let finds = |data: &[u8], words: &str| {
        let mut gzip = flate2::write::GzEncoder::new(header.as_bytes().to_vec(), flate2::Compression::fast());
        std::io::Write::write_all(&mut gzip, data).unwrap();
        finds(&bench, path, &gzip.finish().unwrap(), words);
    };
    let with = |at: usize, number: f32| {
        let mut data = sound.clone();
        put(&mut data, at, number);
        data
    };
    finds(&sound, "");
    finds(&with(0, 0.5), "fractions of a voxel that sum to 0.6, expected 1 or 0");
    finds(&with(0, f32::NAN), "found the fraction NaN");
    finds(&with(1, -0.5), "found the fraction -0.5");
    finds(&sound[12..], "found fewer voxels than 8000");
    let mut empty = sound.clone();
    empty[..12].fill(0);
    finds(&empty, "found fractions that fill 7999 voxels, the manifest has 8000");
    // White and black in each other's place.
    let swapped: Vec<u8> =
        sound.chunks(12).flat_map(|voxel| [&voxel[4..8], &voxel[..4], &voxel[8..]].concat()).collect();
    finds(&swapped, "found fractions of white that fill");
}

/// A VTI with other arrays in place of its own.
fn with_arrays(file: &[u8], arrays: &[Vec<u8>]) -> Vec<u8> {
    let start = file.windows(15).position(|at| at == b"encoding=\"raw\">").unwrap();
    let start = start + file[start..].iter().position(|byte| *byte == b'_').unwrap() + 1;
    let (mut data, mut offsets) = (Vec::new(), Vec::new());
    for array in arrays {
        offsets.push(data.len());
        let slice = array.len() / DIMS[2];
        let blocks = array.chunks(slice).map(|slice| {
            let mut zlib = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
            std::io::Write::write_all(&mut zlib, slice).unwrap();
            zlib.finish().unwrap()
        });
        let blocks: Vec<Vec<u8>> = blocks.collect();
        let numbers = [DIMS[2], slice, 0].into_iter().chain(blocks.iter().map(Vec::len));
        data.extend(numbers.flat_map(|number| (number as u64).to_le_bytes()));
        data.extend(blocks.concat());
    }
    // All offsets but the first's, 0, are twenty digits.
    let header = String::from_utf8(file[..start].to_vec()).unwrap();
    let mut parts = header.split("offset=\"");
    let mut header = format!("{}offset=\"{}", parts.next().unwrap(), parts.next().unwrap());
    for (offset, rest) in offsets[1..].iter().zip(parts) {
        header += &format!("offset=\"{offset:020}{}", &rest[20..]);
    }
    [header.as_bytes(), &data, b"\n</AppendedData>\n</VTKFile>\n"].concat()
}

#[test]
fn damaged_fractions_of_a_vti_are_found_even_where_the_manifest_agrees() {
    let bench = bench(LAYERS, "[\"vti\"]");
    bench.slice("out");
    let path = "exports/job.vti";
    let file = fs::read(bench.path(format!("out/{path}"))).unwrap();
    let sound = read_vti(&bench, &format!("out/{path}"));
    let damaged = |change: &dyn Fn(&mut Vec<Vec<u8>>)| {
        let mut arrays = sound.clone();
        change(&mut arrays);
        with_arrays(&file, &arrays)
    };
    let finds = |change: &dyn Fn(&mut Vec<Vec<u8>>), words: &str| finds(&bench, path, &damaged(change), words);
    finds(&|_| {}, "");
    finds(&|arrays| put(&mut arrays[1], 0, 0.5), "fractions of a voxel that sum to 0.6, expected 1");
    finds(&|arrays| put(&mut arrays[2], 7, f32::INFINITY), "found the fraction inf");
    // As much of each resin as before, in other voxels.
    finds(
        &|arrays| {
            put(&mut arrays[1], 0, 0.8);
            put(&mut arrays[1], 1, 1.0);
        },
        "fractions of a voxel that sum to 0.9, expected 1",
    );
    finds(&|arrays| arrays.swap(1, 2), "found fractions of white that fill");
    finds(&|arrays| arrays.swap(1, 3), "voxels of support where its fraction is 0");
    finds(&|arrays| arrays[3].truncate(4 * (VOXELS - DIMS[2])), "found another header");
    // Full where nothing is, and a hole elsewhere.
    finds(&|arrays| arrays[0][0] = 0, "fractions of a voxel that sum to 1, expected 0");
}
