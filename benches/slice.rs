//! How fast slicing is, per inside voxel and against what the machine can do: `cargo bench --bench slice -- [MESH]
//! [JOB.toml]`.
//!
//! MESH (default: `../shared/meshes/bunny_60mm_watertight.ply`, else a sphere) gets a stacking of four layers, 5 mm
//! deep; JOB (default: `samples/rabbit-60mm.toml`) brings its own textured target; its first object is sliced with the
//! four layers too, so that what the shape costs and what the texture costs are told apart. All are sliced at four, two
//! and one times the pitch of a J750, every slice encoded and written. A machine that others use shows in the wall
//! time; the CPU time is the figure to compare.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

use std::{
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use glam::DVec3;
use lumislice::{
    appearance::{LayerField, LayerStack},
    job::{Job, Prepared, file::Scaling},
    mesh::{LoadOptions, Placement, Size, TriangleMesh, close, load, place},
    slice::{ObjectField, Palette, RowBuffers, Slicer, encode_rgba},
    voxel::{Lattice, MaterialId, Printer},
    watch::Unwatched,
};
use rayon::prelude::*;

/// Thicknesses of the four layers, mm.
const LAYERS: [f64; 4] = [0.5, 1.5, 1.0, 2.0];

/// CPU time of this process so far, user and system, seconds. The kernel counts hundredths.
fn cpu_seconds() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |n: usize| fields.get(n).and_then(|field| field.parse::<f64>().ok()).unwrap_or(f64::NAN);
    (ticks(11) + ticks(12)) / 100.0
}

/// Most memory this process has held since [`forget_peak`], MiB.
fn peak_mib() -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1024.0
}

fn forget_peak() {
    let _ = fs::write("/proc/self/clear_refs", "5"); // where that is not allowed, peaks are those of all rows so far
}

/// Seconds of wall and CPU time.
#[derive(Clone, Copy, Default)]
struct Cost {
    wall: f64,
    cpu: f64,
}

struct Clock(Instant, f64);

impl Clock {
    fn start() -> Self {
        Self(Instant::now(), cpu_seconds())
    }

    fn read(&self) -> Cost {
        Cost { wall: self.0.elapsed().as_secs_f64(), cpu: cpu_seconds() - self.1 }
    }
}

/// Slices everything and writes the images: inside voxels, cost of filling slabs, cost of encoding and writing.
fn slice(slicer: &Slicer, folder: &Path) -> (u64, Cost, Cost) {
    let mut palette: Palette = [[0; 4]; 256];
    for (id, colour) in palette.iter_mut().enumerate().skip(1) {
        *colour = [40 * id as u8, 255 - 40 * id as u8, 128, 255];
    }
    let dims = slicer.lattice().dims;
    let (mut inside, mut writing) = (0, Cost::default());
    let whole = Clock::start();
    slicer
        .for_each_slab(0..dims[2], |slab| {
            let clock = Clock::start();
            let counts = slab.slices().into_par_iter().map_init(
                || (RowBuffers::default(), Vec::new()),
                |(rows, file), k| {
                    let mut counts = [0_u64; 256];
                    file.clear();
                    encode_rgba(slab, k, &palette, rows, &mut counts, file)?;
                    fs::write(folder.join(format!("slice_{k}.png")), &file)?;
                    Ok(counts[1..].iter().sum::<u64>())
                },
            );
            inside += counts.sum::<std::io::Result<u64>>()?;
            let spent = clock.read();
            writing = Cost { wall: writing.wall + spent.wall, cpu: writing.cpu + spent.cpu };
            Ok::<_, std::io::Error>(())
        })
        .unwrap();
    let whole = whole.read();
    (inside, Cost { wall: whole.wall - writing.wall, cpu: whole.cpu - writing.cpu }, writing)
}

/// One object at four, two and one times the pitch; the CPU time per inside voxel at the last, ns.
fn rows(name: &str, slicer: &Slicer) -> f64 {
    println!("\n{name}");
    println!(
        "pitch   M voxels  M inside   wall s   CPU s  ns/inside (fill + PNG)  M inside/s a core  peak MiB  MiB of PNG"
    );
    let lattice = *slicer.lattice();
    let extent = DVec3::from(lattice.dims.map(f64::from)) * lattice.pitch;
    let mut last = f64::NAN;
    for factor in [4.0, 2.0, 1.0] {
        let coarse = if factor == 1.0 { lattice } else { Lattice::covering(extent, lattice.pitch * factor).unwrap() };
        let folder = tempfile::tempdir().unwrap();
        forget_peak();
        let (inside, filling, writing) = slice(&slicer.resampled(coarse), folder.path());
        let per_voxel = |cost: Cost| cost.cpu * 1e9 / inside as f64;
        last = per_voxel(filling) + per_voxel(writing);
        let bytes: u64 = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().metadata().unwrap().len()).sum();
        println!(
            "× {factor}   {:8.1}  {:8.1}  {:7.2}  {:6.2}  {last:9.1} ({:5.1} + {:5.1})  {:17.1}  {:8.0}  {:10.1}",
            coarse.voxels() as f64 / 1e6,
            inside as f64 / 1e6,
            filling.wall + writing.wall,
            filling.cpu + writing.cpu,
            per_voxel(filling),
            per_voxel(writing),
            1e3 / last,
            peak_mib(),
            bytes as f64 / f64::from(1 << 20),
        );
    }
    last
}

/// What no slicer of this lattice can beat: the same number of images of nothing, and memory written once.
fn limits(lattice: Lattice) {
    let folder = tempfile::tempdir().unwrap();
    let (_, filling, writing) = slice(&Slicer::new(lattice, Vec::new()), folder.path());
    println!(
        "\nimages of nothing on this lattice: {:.2} s wall, {:.2} s CPU, {:.2} G voxels/s a core",
        filling.wall + writing.wall,
        filling.cpu + writing.cpu,
        lattice.voxels() as f64 / 1e9 / (filling.cpu + writing.cpu)
    );
    let mut buffer = vec![0_u8; 1 << 26];
    let clock = Clock::start();
    let rounds = 32;
    for round in 0..rounds {
        buffer.fill(round as u8 + 1);
        std::hint::black_box(&mut buffer);
    }
    let bytes = f64::from(rounds) * buffer.len() as f64;
    println!("memory filled on one thread: {:.1} GB/s", bytes / 1e9 / clock.read().wall);
}

/// A sphere of radius 30 mm in facets of a millimetre, for where there is no mesh.
fn ball() -> TriangleMesh {
    let (rings, around) = (90, 180);
    let mut mesh = TriangleMesh::default();
    for i in 0..=rings {
        for j in 0..around {
            let (st, ct) = (std::f64::consts::PI * f64::from(i) / f64::from(rings)).sin_cos();
            let (sp, cp) = (std::f64::consts::TAU * f64::from(j) / f64::from(around)).sin_cos();
            mesh.positions.push(DVec3::new(st * cp, st * sp, ct) * 30.0 + 30.0);
        }
    }
    let at = |i: u32, j: u32| i * around as u32 + j % around as u32;
    for (i, j) in (0..rings as u32).flat_map(|i| (0..around as u32).map(move |j| (i, j))) {
        mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
        mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
    }
    mesh
}

fn layered(path: Option<PathBuf>) -> Slicer {
    let beside = || {
        let folder = std::env::var_os("LUMISLICE_SHARED")
            .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
        Some(folder.join("meshes/bunny_60mm_watertight.ply")).filter(|path| path.exists())
    };
    let mesh = match path.or_else(beside) {
        Some(path) => load(&path, &LoadOptions::default()).unwrap().mesh,
        None => {
            println!("NO MESH: the bunny is not there, a sphere stands in for it");
            ball()
        }
    };
    let pitch = Printer::by_name("j750-27um").unwrap().pitch_mm;
    in_layers(mesh, &Placement { size: Size::HeightMm(60.0), ..Placement::default() }, pitch)
}

/// The first object of a job with the four layers for a target.
fn object_in_layers(job: &Job) -> Slicer {
    let object = &job.objects[0];
    let mesh = load(object.mesh.as_ref(), &LoadOptions { unit: object.unit }).unwrap().mesh;
    let size = match object.scaling {
        Scaling::Scale(scale) => Size::Scale(scale),
        Scaling::HeightMm(height) => Size::HeightMm(height),
    };
    let placement = Placement { size, rotate_deg: object.rotate_deg.into(), position_mm: object.position_mm.into() };
    in_layers(mesh, &placement, job.printer.pitch_mm)
}

fn in_layers(mesh: TriangleMesh, placement: &Placement, pitch: DVec3) -> Slicer {
    let clock = Clock::start();
    let (mesh, _) = place(mesh, placement).unwrap();
    let solid = close(mesh).unwrap();
    let extent = solid.mesh.positions.iter().fold(DVec3::ZERO, |extent, p| extent.max(*p));
    let lattice = Lattice::covering(extent, pitch).unwrap();
    let layers = LAYERS.iter().zip(1..).map(|(&thickness, id)| (MaterialId(id), thickness));
    let layers = LayerField::Uniform(LayerStack::new(layers, MaterialId(5)));
    let slicer = Slicer::new(lattice, vec![ObjectField::new(&solid, lattice, layers).unwrap()]);
    println!("{} triangles, ready to slice after {:.2} s CPU", solid.mesh.triangles.len(), clock.read().cpu);
    slicer
}

fn textured(job: Job) -> Prepared {
    let clock = Clock::start();
    let prepared = Prepared::new(job, &Unwatched).unwrap();
    println!("\n{}: ready to slice after {:.2} s CPU", prepared.job.name, clock.read().cpu);
    prepared
}

fn main() {
    let mut paths =
        std::env::args_os().skip(1).filter(|arg| !arg.to_string_lossy().starts_with('-')).map(PathBuf::from);
    let mesh = paths.next();
    let job = paths.next().unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/rabbit-60mm.toml"));
    println!("{} threads", rayon::current_num_threads());
    let plain = {
        let slicer = layered(mesh);
        let plain = rows("four layers, 5 mm deep", &slicer);
        limits(*slicer.lattice());
        plain
    };
    if !job.exists() {
        println!("NO TEXTURED ROW: {} is not there", job.display());
        return;
    }
    let job = Job::load(&job).unwrap();
    // Before the texture is read, so that the peak is the shape's own.
    let same = rows("the textured job's first object, in the four layers", &object_in_layers(&job));
    let textured = rows("textured", textured(job).slicer());
    println!(
        "\nCPU time per inside voxel at the printer's pitch: textured over the first row {:.2}\n\
         = its shape in four layers over the first row {:.2} × texture over four layers on one shape {:.2}",
        textured / plain,
        same / plain,
        textured / same
    );
}
