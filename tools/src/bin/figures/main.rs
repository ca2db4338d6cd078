//! The figures of Hašan et al. 2010 that say how well light is predicted, made anew: pictures, and tables for
//! `docs/accuracy.md`.
//!
//! ```sh
//! cargo run --release -p tools --bin figures -- stacking # figure 5: three stackings against photons cargo run
//! --release -p tools --bin figures -- slabs # figure 6: five slabs of one albedo and falling translucency cargo run
//! --release -p tools --bin figures -- thin # thin layers: Kubelka–Munk and transport against photons cargo run
//! --release -p tools --bin figures -- gamut-map # targets out of reach: clipped, and brought into the gamut
//! ```
//!
//! Options: `-o FOLDER` (default `./figures-out`), `--photons N` per simulation (default 4000000).

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program")]

mod gamut_map;
mod models;
mod slabs;
mod stacking;
mod thin;

use std::{fs, path::PathBuf, process::ExitCode};

/// What the command line says.
struct Options {
    folder: PathBuf,
    photons: u64,
}

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run() -> Outcome {
    let mut options = Options { folder: PathBuf::from("figures-out"), photons: 4_000_000 };
    let mut wanted = Vec::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "-o" => options.folder = arguments.next().ok_or("-o: expected a folder after it")?.into(),
            "--photons" => {
                let number = arguments.next().and_then(|text| text.parse().ok()).filter(|n| *n >= 2);
                options.photons = number.ok_or("--photons: expected a number, at least 2, after it")?;
            }
            _ => wanted.push(argument),
        }
    }
    if wanted.is_empty() {
        return Err("found no figure, expected stacking, slabs, thin or gamut-map".into());
    }
    fs::create_dir_all(&options.folder).map_err(|error| format!("{}: {error}", options.folder.display()))?;
    for figure in &wanted {
        match figure.as_str() {
            "stacking" => stacking::run(&options)?,
            "slabs" => slabs::run(&options)?,
            "thin" => thin::run(&options)?,
            "gamut-map" => gamut_map::run(&options)?,
            other => return Err(format!("found figure {other}, expected stacking, slabs, thin or gamut-map").into()),
        }
    }
    Ok(())
}
