//! Built-in sets: material files compiled in, with profiles simulated once and stored.
//!
//! None is a measurement of a printer's resin, and each says so in its provenance. `cargo run --release -p tools --bin
//! regenerate_builtin` writes the stored profiles anew; they depend on nothing but coefficients, thickness, photons and
//! seed.

use std::path::Path;

use super::file::MaterialFile;
use super::toml_source::Folder;
use super::{MaterialSet, SimulatedProfile};
use crate::optics::{Model, OpticsError};
use crate::watch::{StopOnly, Unwatched, Watch};
use crate::words::suggest;

/// Photons behind each stored profile: R̂(0) within 1.1e-4 (one σ).
pub const BUILTIN_PHOTONS: u64 = 20_000_000;

/// A set's TOML text.
const SETS: [(&str, &str); 4] = [
    ("synthetic", include_str!("../data/synthetic.toml")),
    ("inks-rgb", include_str!("../data/inks-rgb.toml")),
    ("inks-rgb-7", include_str!("../data/inks-rgb-7.toml")),
    ("vero-j850-provisional", include_str!("../data/vero-j850-provisional.toml")),
];

macro_rules! profiles {
    ($($name:literal),* $(,)?) => { [$(($name, include_str!(concat!("../data/", $name)))),*] };
}

/// The profiles the sets name, by file name; one named after another set is that set's, for a resin both have.
const PROFILES: [(&str, &str); 42] = profiles![
    "synthetic-white-y.csv",
    "synthetic-black-y.csv",
    "synthetic-support-y.csv",
    "inks-rgb-cyan-r.csv",
    "inks-rgb-cyan-g.csv",
    "inks-rgb-cyan-b.csv",
    "inks-rgb-magenta-r.csv",
    "inks-rgb-magenta-g.csv",
    "inks-rgb-magenta-b.csv",
    "inks-rgb-yellow-r.csv",
    "inks-rgb-yellow-g.csv",
    "inks-rgb-yellow-b.csv",
    "inks-rgb-black-r.csv",
    "inks-rgb-black-g.csv",
    "inks-rgb-black-b.csv",
    "inks-rgb-white-r.csv",
    "inks-rgb-white-g.csv",
    "inks-rgb-white-b.csv",
    "inks-rgb-7-clear-r.csv",
    "inks-rgb-7-clear-g.csv",
    "inks-rgb-7-clear-b.csv",
    "inks-rgb-7-support-r.csv",
    "inks-rgb-7-support-g.csv",
    "inks-rgb-7-support-b.csv",
    "vero-j850-provisional-white-r.csv",
    "vero-j850-provisional-white-g.csv",
    "vero-j850-provisional-white-b.csv",
    "vero-j850-provisional-black-r.csv",
    "vero-j850-provisional-black-g.csv",
    "vero-j850-provisional-black-b.csv",
    "vero-j850-provisional-clear-r.csv",
    "vero-j850-provisional-clear-g.csv",
    "vero-j850-provisional-clear-b.csv",
    "vero-j850-provisional-cyan-r.csv",
    "vero-j850-provisional-cyan-g.csv",
    "vero-j850-provisional-cyan-b.csv",
    "vero-j850-provisional-magenta-r.csv",
    "vero-j850-provisional-magenta-g.csv",
    "vero-j850-provisional-magenta-b.csv",
    "vero-j850-provisional-yellow-r.csv",
    "vero-j850-provisional-yellow-g.csv",
    "vero-j850-provisional-yellow-b.csv",
];

impl MaterialSet {
    /// Names of the built-in sets, the default first.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        SETS.iter().map(|(name, _)| *name)
    }

    /// A built-in set; takes a fraction of a second, as its profiles are stored.
    ///
    /// # Errors
    /// [`OpticsError::UnknownSet`] with the nearest name.
    pub fn builtin(name: &str) -> Result<Self, OpticsError> {
        MaterialFile::builtin(name)?.into_set(&Unwatched)
    }

    /// Whether a profile of this file name is built in.
    pub(super) fn stores(profile: &str) -> bool {
        PROFILES.iter().any(|(name, _)| *name == profile)
    }

    /// The TOML text of a built-in set, to start one's own from.
    pub fn builtin_toml(name: &str) -> Option<&'static str> {
        SETS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
    }
}

impl MaterialFile {
    /// A built-in set as the file it is.
    ///
    /// # Errors
    /// [`OpticsError::UnknownSet`] with the nearest name.
    pub fn builtin(name: &str) -> Result<Self, OpticsError> {
        let text = MaterialSet::builtin_toml(name).ok_or_else(|| OpticsError::UnknownSet {
            name: name.into(),
            suggestion: suggest(name, MaterialSet::builtin_names()).map(String::from),
            known: MaterialSet::builtin_names().collect::<Vec<_>>().join(", "),
        })?;
        let mut file = Self::parse(text, Path::new(&format!("{name}.toml")), &Folder::Embedded(&PROFILES))?;
        file.first_seed += PROFILES.iter().position(|(profile, _)| profile.starts_with(name)).unwrap_or(0) as u64;
        Ok(file)
    }
}

/// Simulates the slabs of all built-in resins with `photons` photons each and hands each over with its file name to
/// `each`, which may write or compare it. `watch` hears the stage "profiles".
///
/// # Errors
/// [`OpticsError::Stopped`], or whatever `each` returns.
pub fn regenerate_builtin(
    photons: u64,
    watch: &dyn Watch,
    mut each: impl FnMut(&str, &SimulatedProfile) -> Result<(), OpticsError>,
) -> Result<(), OpticsError> {
    watch.stage("profiles", PROFILES.len() as u64);
    let mut done = 0;
    for (set, text) in SETS {
        // Without its profiles, which may be stale or missing.
        let bare: String =
            text.lines().filter(|line| !line.starts_with("reflection")).fold(String::new(), |t, l| t + l + "\n");
        let file = MaterialFile::parse(&bare, Path::new(set), &Folder::Embedded(&[]))?;
        let plans = file.slab_plans(Some(Model::DEFAULT_SEED + done as u64)).into_iter();
        for plan in plans.filter(|plan| MaterialSet::stores(&plan.file)) {
            let profile = plan.simulate(photons, &StopOnly(watch))?;
            done += 1;
            each(&plan.file, &profile)?;
            watch.advance(1);
        }
    }
    Ok(())
}
