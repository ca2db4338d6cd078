//! Photographs of a built-in resin by a camera that does not exist, to try `lumislice material measure` on:
//!
//! ```text
//! cargo run --release -p tools --bin simulate_capture -- white capture [--defects]
//! lumislice material measure capture/capture.toml -o white.toml
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program")]

use std::path::Path;
use std::process::ExitCode;

use lumislice::measure::simulate::{Defects, Laboratory, Scene, Truth, write_capture};
use lumislice::measure::{Aperture, ResinFacts};
use lumislice::optics::MaterialSet;

/// Half of the field at most, mm: 1000 × 1000 pixels.
const FARTHEST_MM: f64 = 22.0;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (flags, names): (Vec<&String>, Vec<&String>) = arguments.iter().partition(|word| word.starts_with("--"));
    let known = flags.iter().all(|flag| *flag == "--defects");
    let ([resin, folder], true) = (names.as_slice(), known) else {
        eprintln!("expected: simulate_capture RESIN FOLDER [--defects]");
        return ExitCode::from(2);
    };
    match run(resin, Path::new(folder), !flags.is_empty()) {
        Ok(path) => {
            println!("{path}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(name: &str, folder: &Path, defects: bool) -> Result<String, String> {
    let set = MaterialSet::builtin("synthetic").map_err(|error| error.to_string())?;
    let known: Vec<&str> = set.resins.iter().map(|resin| resin.name.as_str()).collect();
    let expected = || format!("resin `{name}`: found none of that name, expected one of {}", known.join(", "));
    let (_, resin) = set.resin(name).ok_or_else(expected)?;
    let light = &resin.channels[0];
    let (r, t) = (Truth::new(&light.reflection, true), Truth::new(&light.transmission, false));
    let facts = ResinFacts {
        name: resin.name.clone(),
        rgba: resin.rgba,
        density_g_per_cm3: resin.density_g_per_cm3,
        print_as_background: resin.print_as_background,
        thickness_mm: light.slab_mm,
        refractive_index: 1.0,
        notes: String::new(),
    };
    let defects = if defects { Defects::together() } else { Defects::default() };
    let laboratory = Laboratory { defects, ..Laboratory::default() };
    let spot = Scene::around(&r, Aperture::Square { side_mm: 0.1 }, FARTHEST_MM);
    let pinhole = Scene::around(&t, Aperture::Disc { diameter_mm: 0.5 }, FARTHEST_MM);
    let path = write_capture(&laboratory, &facts, (&spot, &r), (&pinhole, &t), folder)
        .map_err(|error| format!("{}: writing failed: {error}", folder.display()))?;
    Ok(path.display().to_string())
}
