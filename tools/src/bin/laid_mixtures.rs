//! How far mixtures, as they are laid voxel by voxel, are from the one resin that they are taken for: photons through
//! slabs of 5 mm over black, against the transport model's prediction.
//!
//! A row for every mixture, printer and face: the albedo promised and seen, and the root mean square difference of R̂
//! over the default frequencies, of which the photons' own noise is told too.

#![allow(clippy::print_stdout)] // it prints a table

use anyhow::Context as _;
use clap::Parser;
use lumislice::{
    look::{Photons, Sides, VoxelGrid, VoxelScene},
    optics::{FrequencyGrid, Grains, Light, MaterialSet, Mixture, Model, Stack, predict},
    voxel::{Printer, ThresholdMask},
    watch::Unwatched,
};

const MIXTURES: [&str; 4] =
    ["98% white + 2% black", "95% white + 5% black", "90% white + 10% black", "70% white + 30% black"];

#[derive(Parser)]
struct Args {
    /// A built-in set.
    #[arg(long, default_value = "synthetic")]
    materials: String,
    /// Mixtures.
    #[arg(default_values_t = MIXTURES.map(String::from))]
    mixtures: Vec<String>,
    /// Printers.
    #[arg(long, default_values_t = ["j750-14um", "j750-27um", "connex500-30um"].map(String::from))]
    printer: Vec<String>,
    /// Faces that are lit: those across z, x, y.
    #[arg(long, default_value = "z")]
    faces: String,
    /// Thickness of the slab, mm.
    #[arg(long, default_value_t = 5.0)]
    thickness_mm: f64,
    #[arg(long, default_value_t = 2_000_000)]
    photons: u64,
    /// White noise in place of the mask.
    #[arg(long)]
    white_noise: bool,
}

/// A slab of a mixture, over periods of the mask, lit through the face across `axis`.
fn laid(args: &Args, mixture: &Mixture, printer: &Printer, axis: usize) -> anyhow::Result<VoxelGrid> {
    let mask = ThresholdMask::shared(printer.pitch_mm);
    let axes = [(axis + 1) % 3, (axis + 2) % 3, axis];
    let pitch = axes.map(|axis| printer.pitch_mm[axis]);
    let period = axes.map(|axis| mask.period()[axis]);
    let dims = [period[0], period[1], (args.thickness_mm / pitch[2]).round() as u32];
    let mut levels = Vec::new();
    let mut sum = 0.0;
    for (resin, share) in mixture.parts() {
        sum += share;
        levels.push((ThresholdMask::level(sum), resin.0 as u8 + 1));
    }
    let mut state = 1_u64;
    let mut ids = Vec::new();
    for (k, j, i) in (0..dims[2]).flat_map(|k| (0..dims[1]).flat_map(move |j| (0..dims[0]).map(move |i| (k, j, i)))) {
        let mut at = [0; 3];
        (0..3).for_each(|n| at[axes[n]] = [i, j, k][n]);
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let rank = if args.white_noise { (state >> 49) as u16 } else { mask.rank(at) };
        ids.push(levels.iter().find(|level| rank < level.0).or(levels.last()).context("no resin")?.1);
    }
    Ok(VoxelGrid::new(dims.map(|dim| dim as usize), pitch, ids)?)
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let mut set = MaterialSet::builtin(&args.materials)?;
    let grid = FrequencyGrid::default();
    let (core, _) = set.resin("black").context("a set without black")?;
    println!(
        "{:32} {:16} face  channel  by volume  promised      seen  off %    (± %)  by volume %  R̂ rms (noise) e-4",
        "mixture", "printer"
    );
    for name in &args.mixtures {
        let mixture = set.mixture(name)?;
        let stack = Stack::new([(mixture.clone(), args.thickness_mm)]).over(Mixture::from(core));
        set.grains = Grains::FINE;
        let fine = predict(&set, &stack, &Model::REFLECTION, &Unwatched)?.reflection();
        for printer in &args.printer {
            let printer = Printer::by_name(printer)?;
            set.grains = Grains::of_voxels(printer.pitch_mm.to_array());
            let promised = predict(&set, &stack, &Model::REFLECTION, &Unwatched)?.reflection();
            for face in args.faces.chars() {
                let axis = "xyz".find(face).context("a face is x, y or z")?;
                let voxels = laid(&args, &mixture, &printer, axis)?;
                for channel in 0..set.channels.len() {
                    let volume = |resin| Ok::<_, anyhow::Error>(set.mixed_volumes(&Mixture::from(resin))?[channel]);
                    let mut media = vec![volume(core)?];
                    media.extend(set.ids().map(volume).collect::<anyhow::Result<Vec<_>>>()?);
                    let scene = VoxelScene::new(&voxels, &media, Sides::Periodic, Some(volume(core)?))?;
                    let photons = Photons { light: Light::Diffuse, count: args.photons, seed: 7 };
                    let seen = scene.spectrum(&grid, photons, &Unwatched)?;
                    let promised = &promised[channel];
                    let rms = |values: &mut dyn Iterator<Item = f64>| {
                        (values.map(|value| value * value).sum::<f64>() / grid.len() as f64).sqrt() * 1e4
                    };
                    let differ = rms(&mut seen.reflection.iter().zip(promised).map(|(a, b)| a - b));
                    let noise = rms(&mut seen.standard_error.iter().copied());
                    println!(
                        "{name:32} {:16} {face:>4} {:>8} {:10.5} {:9.5} {:9.5} {:6.2} {:8.2} {:12.2} {differ:7.2} \
                         ({noise:.2})",
                        printer.name,
                        set.channels[channel],
                        fine[channel][0],
                        promised[0],
                        seen.reflection[0],
                        100.0 * (seen.reflection[0] / promised[0] - 1.0),
                        100.0 * seen.standard_error[0] / promised[0],
                        100.0 * (seen.reflection[0] / fine[channel][0] - 1.0),
                    );
                }
            }
        }
    }
    Ok(())
}
