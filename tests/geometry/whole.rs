//! The same bytes whatever the threads and the slices asked for; the same memory whatever the height.

use std::{collections::BTreeMap, fs, path::Path, process::Command};

use super::support::*;
use glam::DVec3;
use lumislice::{
    slice::{RowBuffers, Slicer, encode_rgba},
    voxel::Lattice,
};

fn blob() -> Slicer {
    // Two crossing spheres and a cavity, at a pitch that leaves ragged bricks everywhere.
    let mut triangles = sphere(DVec3::new(3.0, 3.0, 3.0), 2.9, 30);
    triangles.extend(sphere(DVec3::new(5.5, 4.2, 3.9), 2.4, 24));
    triangles.extend(reversed(&sphere(DVec3::new(3.0, 3.0, 3.0), 1.1, 16)));
    let lattice = Lattice::covering(DVec3::new(8.0, 6.7, 6.4), j750()).unwrap();
    slicer_of(&solid_of(&triangles), lattice, stack(&[0.3, 0.078125, 0.5, 0.25]))
}

/// All images of some slices, encoded.
fn images(slicer: &Slicer, slices: std::ops::Range<u32>) -> Vec<Vec<u8>> {
    let mut palette = [[0; 4]; 256];
    (1..6).for_each(|id| palette[id] = [50 * id as u8, 10, 200, 255]);
    let mut found = Vec::new();
    let done: std::io::Result<()> = slicer.for_each_slab(slices.clone(), |slab| {
        for k in slab.slices().filter(|k| slices.contains(k)) {
            let mut file = Vec::new();
            encode_rgba(slab, k, &palette, &mut RowBuffers::default(), &mut [0; 256], &mut file)?;
            found.push(file);
        }
        Ok(())
    });
    done.unwrap();
    found
}

#[test]
fn threads_change_no_byte() {
    let slicer = blob();
    let all = 0..slicer.lattice().dims[2];
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| images(&blob(), all.clone()))
    };
    let one = on(1);
    assert_eq!(one.len(), all.len());
    for threads in [1, 2, 5] {
        assert!(on(threads) == one, "{threads} threads");
    }
}

#[test]
fn a_part_is_the_same_part_of_the_whole() {
    let slicer = blob();
    let dims = slicer.lattice().dims[2];
    let whole = images(&slicer, 0..dims);
    let mut random = Random::new(40);
    for _ in 0..6 {
        let start = random.below(dims as usize - 1) as u32;
        let end = start + 1 + random.below((dims - start) as usize) as u32;
        let end = end.min(start + 40).min(dims);
        assert!(images(&slicer, start..end) == whole[start as usize..end as usize], "{start}..{end}");
    }
    assert_eq!(images(&slicer, dims..dims + 5).len(), 0);
}

fn write_stl(path: &Path, triangles: &[[DVec3; 3]]) {
    let mut bytes = vec![0; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        for corner in triangle {
            corner.to_array().iter().for_each(|v| bytes.extend((*v as f32).to_le_bytes()));
        }
        bytes.extend([0; 2]);
    }
    fs::write(path, bytes).unwrap();
}

const JOB: &str = r#"
[[object]]
mesh = "shape.stl"
[printer]
pitch-mm = [PITCH]
[materials]
set = "synthetic"
[target]
kind = "stacking"
stack = "white:0.4,support:1.0,white:0.6"
"#;

/// A folder with a job for `triangles`.
fn job(triangles: &[[DVec3; 3]], pitch: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_stl(&folder.path().join("shape.stl"), triangles);
    fs::write(folder.path().join("job.toml"), JOB.replace("PITCH", pitch)).unwrap();
    folder
}

/// The program, without a cache: every run searches.
fn binary() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lumislice"));
    command.env("LUMISLICE_CACHE", "");
    command
}

/// Every file under a folder with its content, but for the timings.
fn content(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(root).unwrap().display().to_string();
            if path.is_dir() {
                folders.push(path);
            } else if name != "timings.json" {
                found.insert(name, fs::read(path).unwrap());
            }
        }
    }
    found
}

#[test]
fn runs_and_threads_change_no_byte_of_the_output() {
    let folder = job(&sphere(DVec3::splat(3.0), 3.0, 20), "0.1, 0.12, 0.08");
    let run = |name: &str, threads: &str| {
        let out = folder.path().join(name);
        let job = folder.path().join("job.toml");
        let mut command = binary();
        command.args(["slice".as_ref(), job.as_os_str(), "-o".as_ref(), out.as_os_str()]);
        assert!(command.env("RAYON_NUM_THREADS", threads).output().unwrap().status.success());
        content(&out)
    };
    let first = run("a", "1");
    assert!(first.len() > 70);
    // Another run, and on more threads: what either changes shows.
    assert!(run("b", "4") == first);
}

/// Most memory a run holds, KiB: the kernel's own record of it, read until the process is gone.
fn peak_kib(job: &Path, out: &Path) -> u64 {
    let mut child = binary()
        .args(["slice".as_ref(), job.as_os_str(), "-o".as_ref(), out.as_os_str()])
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        peak = line.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or(peak);
        if let Some(done) = child.try_wait().unwrap() {
            assert!(done.success());
            return peak;
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
}

/// A fluted column: the same triangles for every height.
fn column(height: f64) -> Triangles {
    let sides = 720;
    let at = |side: usize, z: f64| {
        let angle = std::f64::consts::TAU * (side % sides) as f64 / sides as f64;
        let radius = 9.0 + 0.8 * (24.0 * angle).cos();
        DVec3::new(10.0 + radius * angle.cos(), 10.0 + radius * angle.sin(), z)
    };
    let mut triangles = Vec::new();
    for side in 0..sides {
        let [a, b, c, d] = [at(side, 0.0), at(side + 1, 0.0), at(side + 1, height), at(side, height)];
        triangles.extend([[a, b, c], [a, c, d]]);
        triangles.extend([[DVec3::new(10.0, 10.0, 0.0), b, a], [DVec3::new(10.0, 10.0, height), d, c]]);
    }
    triangles
}

#[test]
#[ignore = "slow: 700 million voxels through the binary"]
fn a_tall_object_takes_the_memory_of_a_low_one() {
    if !Path::new("/proc/self/status").exists() {
        println!("skipped: no /proc to read peak memory from");
        return;
    }
    let peak = |height: f64, formats: &str| {
        let folder = job(&column(height), "0.0423, 0.0847, 0.08");
        let path = folder.path().join("job.toml");
        let job = fs::read_to_string(&path).unwrap() + &format!("[output]\nformats = [{formats}]\n");
        fs::write(&path, job).unwrap();
        peak_kib(&path, &folder.path().join("out"))
    };
    let peaks = |formats: &str| {
        let [low, tall] = [60.0, 240.0].map(|height| peak(height, formats));
        println!("{formats}: 60 mm {:.1} MiB, 240 mm {:.1} MiB", low as f64 / 1024.0, tall as f64 / 1024.0);
        assert!(low > 4096);
        [low, tall]
    };
    let [low, tall] = peaks("\"png\"");
    assert!(tall * 10 <= low * 11 && low * 10 <= tall * 11);
    assert!(tall <= 40 << 10, "{tall} KiB");
    // The page's look holds the print, of three resins in at most two bits a voxel.
    let [low, tall] = peaks("\"png\", \"preview\"");
    let voxels = (19.6 / 0.0423) * (19.6 / 0.0847) * (180.0 / 0.08);
    let held = (voxels / 4.0 / 1024.0) as u64;
    assert!(tall <= low + held, "{tall} KiB against {low} and {held} for the print");
}
