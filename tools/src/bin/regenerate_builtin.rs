//! Writes the stored profiles of the built-in material sets anew: `cargo run --release -p tools --bin
//! regenerate_builtin`.
//!
//! Takes some minutes. The first argument replaces the number of photons per profile.

use std::path::Path;

use lumislice::optics::{BUILTIN_PHOTONS, regenerate_builtin};
use lumislice::watch::Unwatched;

#[allow(clippy::print_stderr)] // a program's words go to stderr
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let photons = std::env::args().nth(1).map_or(Ok(BUILTIN_PHOTONS), |photons| photons.parse())?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../src/optics/data");
    regenerate_builtin(photons, &Unwatched, |name, profile| {
        profile.write(&folder.join(name))?;
        eprintln!("{name}");
        Ok(())
    })?;
    Ok(())
}
