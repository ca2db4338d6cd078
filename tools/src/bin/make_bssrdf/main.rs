//! Makes BSSRDF datasets that `lumislice factor` reads: two that are exactly of the form of equation 7, one smooth and
//! one of squares with sharp borders, and three by Monte Carlo through a volume that varies, standing for a chess
//! board, marble and artificial stone.
//!
//! ```text
//! cargo run --release -p tools --bin make_bssrdf -- KIND FOLDER [--texels N] [--window N] [--pitch-mm MM]
//!                                              [--photons N] [--noise SHARE] [--floor PER_MM2] [--seed N]
//! ```

#![allow(clippy::print_stderr)] // a program, if a small one

mod exact;
mod files;
mod volume;

use std::{fs, path::PathBuf, process::ExitCode};

/// What to make.
struct Request {
    kind: String,
    folder: PathBuf,
    texels: [usize; 2],
    window: usize,
    pitch_mm: f64,
    photons: u64,
    noise: f64,
    floor_per_mm2: f64,
    seed: u64,
}

const USAGE: &str = "make_bssrdf exact|squares|chess|marble|stone FOLDER [--texels COLUMNS[xROWS]] [--window N] \
     [--pitch-mm MM] [--photons N] [--noise SHARE] [--floor PER_MM2] [--seed N]";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run() -> Result<(), String> {
    let request = parse()?;
    fs::create_dir_all(&request.folder).map_err(|error| format!("{}: {error}", request.folder.display()))?;
    match request.kind.as_str() {
        "exact" | "squares" => exact::make(&request),
        "chess" | "marble" | "stone" => volume::make(&request),
        other => Err(format!("found kind {other}, expected exact, squares, chess, marble or stone")),
    }
}

fn parse() -> Result<Request, String> {
    let mut arguments = std::env::args().skip(1);
    let (Some(kind), Some(folder)) = (arguments.next(), arguments.next()) else { return Err(USAGE.to_owned()) };
    let mut request = Request {
        kind,
        folder: folder.into(),
        texels: [24, 24],
        window: 19,
        pitch_mm: 0.2,
        photons: 20_000,
        noise: 0.01,
        floor_per_mm2: 0.0,
        seed: 1,
    };
    while let Some(flag) = arguments.next() {
        let value = arguments.next().ok_or_else(|| format!("{flag}: found no value, expected one"))?;
        let fault = |_| format!("{flag}: found {value}, expected a number");
        let whole = |text: &str| text.parse::<usize>().map_err(|_| format!("{flag}: found {text}, expected a number"));
        match flag.as_str() {
            "--texels" => {
                let (columns, rows) = value.split_once('x').unwrap_or((&value, &value));
                request.texels = [whole(columns)?, whole(rows)?];
            }
            "--window" => request.window = whole(&value)? | 1,
            "--pitch-mm" => request.pitch_mm = value.parse().map_err(fault)?,
            "--photons" => request.photons = whole(&value)? as u64,
            "--noise" => request.noise = value.parse().map_err(fault)?,
            "--floor" => request.floor_per_mm2 = value.parse().map_err(fault)?,
            "--seed" => request.seed = whole(&value)? as u64,
            _ => return Err(format!("found {flag}, expected one of: {USAGE}")),
        }
    }
    Ok(request)
}
