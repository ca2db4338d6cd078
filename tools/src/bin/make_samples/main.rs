//! Makes the sample files: a marble rabbit and a slab.
//!
//! ```text
//! cargo run --release -p tools --bin make_samples [-- [--check] [FOLDER]]
//! ```
//!
//! Writes into FOLDER, `samples` if left out. With `--check` it writes nothing and exits 1 unless the folder's files
//! are what it would write, byte for byte (a new version of the PNG encoder may change bytes without changing texels).
//! The pipeline, one step a file:
//!
//! ```text
//! rabbit ─► shape ─► meshing ─► relax ─► audit ─► charts ─► packing ─► paint ─► glb, image_files
//! strokes   field    surface    remesh   closed?  flat      atlas      marble
//!                    nets       crease            pieces               at every texel
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program")]

mod audit;
mod charts;
mod crease;
mod glb;
mod image_files;
mod marble;
mod meshing;
mod packing;
mod paint;
mod rabbit;
mod relax;
mod remesh;
mod shape;
mod slab;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Parser;
use glam::Vec3;
use lumislice::colour::linear_to_srgb;

use image_files::Meaning;

/// Grid step in mm before edges collapse: half the radius of an ear's rim.
const GRID_STEP: f64 = 0.6;
/// Texels per side of the job's textures, and how much smaller the one inside the GLB is.
const TEXTURE_SIZE: usize = 2048;
const GLB_TEXTURE_FACTOR: usize = 4;
const COLOUR_TEXTURE_FACTOR: usize = 2;
const SLAB_MM: Vec3 = Vec3::new(20.0, 20.0, 6.0);

/// Makes the sample files.
#[derive(Parser)]
struct Arguments {
    /// Compare with the files in FOLDER instead of writing them
    #[arg(long)]
    check: bool,
    /// Where the files are
    #[arg(default_value = "samples")]
    folder: PathBuf,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("make_samples: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let mut files = rabbit_files()?;
    files.push(("slab.stl", slab::slab_stl(SLAB_MM)));
    if !arguments.check {
        std::fs::create_dir_all(&arguments.folder)
            .with_context(|| format!("cannot make {}", arguments.folder.display()))?;
    }
    let mut differing = 0;
    for (name, bytes) in &files {
        let path = arguments.folder.join(name);
        if arguments.check {
            let found = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
            let same = found == *bytes;
            differing += usize::from(!same);
            println!("{}: {}", path.display(), if same { "same" } else { "differs" });
        } else {
            std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
            println!("{}: {} bytes", path.display(), bytes.len());
        }
    }
    Ok(if differing == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The rabbit's mesh and its textures, by file name.
fn rabbit_files() -> anyhow::Result<Vec<(&'static str, Vec<u8>)>> {
    let figure = rabbit::rabbit();
    let mut mesh = meshing::surface_nets(&figure, GRID_STEP);
    relax::relax(&figure, &mut mesh, GRID_STEP);
    audit::audit(&mesh).context("the rabbit's mesh")?;
    let charts = charts::charts(&mesh);
    let atlas = packing::pack(&charts, TEXTURE_SIZE).context("the charts do not fit the texture")?;
    let canvas = paint::Canvas::new(&mesh, &atlas).context("the atlas")?;
    println!(
        "rabbit: {} triangles, {} charts, {:.1} texels per mm, {:.0}% of the texture used",
        mesh.triangles.len(),
        charts.len(),
        atlas.scale,
        100.0 * canvas.coverage()
    );

    let clear = marble::Stone { albedo: marble::CLEAR_ALBEDO, mean_free_path: 1.0 };
    let stones = canvas.paint(clear, marble::marble);
    let albedo: Vec<u8> = stones.iter().map(|s| image_files::to_byte(linear_to_srgb(s.albedo))).collect();
    let path: Vec<u8> = stones.iter().map(|s| image_files::to_byte(s.mean_free_path)).collect();
    let small = image_files::shrink_srgb(&albedo, TEXTURE_SIZE, GLB_TEXTURE_FACTOR);
    let texture = image_files::grey_png(&small, TEXTURE_SIZE / GLB_TEXTURE_FACTOR, Meaning::SrgbLight)?;
    let rosy = [0, 1, 2].map(|channel| {
        let light = stones.iter().map(|stone| linear_to_srgb(stone.rosy()[channel]));
        let plane: Vec<u8> = light.map(image_files::to_byte).collect();
        image_files::shrink_srgb(&plane, TEXTURE_SIZE, COLOUR_TEXTURE_FACTOR)
    });
    let rosy = image_files::rgb_png([&rosy[0], &rosy[1], &rosy[2]], TEXTURE_SIZE / COLOUR_TEXTURE_FACTOR)?;
    Ok(vec![
        ("rabbit.glb", glb::glb("rabbit", &mesh, &atlas, &figure, &texture)?),
        ("marble-albedo.png", image_files::grey_png(&albedo, TEXTURE_SIZE, Meaning::SrgbLight)?),
        ("marble-mfp.png", image_files::grey_png(&path, TEXTURE_SIZE, Meaning::Number)?),
        ("rose-albedo.png", rosy),
    ])
}
