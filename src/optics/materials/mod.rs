//! Resins and the sets they come in.
//!
//! A set is read from a TOML file (`file.rs`) or is built in (`builtin.rs`); either way every resin ends up with the
//! Kubelka–Munk parameters of each channel over the default [`FrequencyGrid`], read off a slab of representative thickness
//! (`spectra.rs`) that was measured or is simulated from volume coefficients (`simulate.rs`).

mod builtin;
mod file;
pub(crate) mod resin_table;
mod simulate;
mod slabs;
mod spectra;
pub(crate) mod toml_source;

use super::{CoefficientFit, FrequencyGrid, KubelkaMunk, RadialProfile, SlabSpectrum, VolumeCoefficients};
pub use builtin::{BUILTIN_PHOTONS, regenerate_builtin};
pub use file::MaterialFile;
pub use simulate::{DEFAULT_PHOTONS, DEFAULT_SEED, SimulatedProfile, simulate_profile};
pub use slabs::SlabPlan;
pub use spectra::{MEASURED_EXCESS, ResinSpectrum, SpectrumError};

/// The resins a job may use, in the order of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialSet {
    /// Name of the set.
    pub name: String,
    /// Names of the colour channels, at least one; every per-channel vector has their length and order.
    pub channels: Vec<String>,
    /// The resins, at least one, names unique.
    pub resins: Vec<Resin>,
    /// Where the numbers come from, to be shown wherever the set is; built-in sets say that they are no measurement.
    pub provenance: String,
    /// Frequencies of all spectra.
    pub grid: FrequencyGrid,
    /// One line each: what was assumed, ignored or extrapolated. To be shown to the user.
    pub warnings: Vec<String>,
}

/// One resin.
#[derive(Debug, Clone, PartialEq)]
pub struct Resin {
    /// Unique in its set, regardless of case; safe as a file name.
    pub name: String,
    /// Colour that stands for the resin in slice images, unique in its set; nothing to do with how it looks.
    pub rgba: [u8; 4],
    /// Density in g/cm³.
    pub density_g_per_cm3: f64,
    /// Printed by leaving a hole, which the printer fills: background in the slices. At most one resin of a set is.
    pub print_as_background: bool,
    /// Volume coefficients per channel, if known.
    pub volume: Option<Vec<VolumeCoefficients>>,
    /// How they were fitted to the profiles, if they were; per channel.
    pub fit: Option<Vec<CoefficientFit>>,
    /// Kubelka–Munk parameters per channel.
    pub kubelka_munk: Vec<KubelkaMunk>,
    /// Spectra of the representative slab per channel, as the parameters were read from.
    pub slab: Vec<SlabSpectrum>,
    /// Profiles of the representative slab per channel: R(r), T(r).
    pub profiles: Vec<(RadialProfile, RadialProfile)>,
    /// Thickness of the representative slab per channel, mm.
    pub representative_thickness_mm: Vec<f64>,
    /// Refractive index, as in the coefficients. The Kubelka–Munk parameters of simulated slabs are index-matched whatever it is; those of
    /// measured ones have the surfaces of the measured slab in them.
    pub refractive_index: f64,
    /// Free text of the file.
    pub notes: String,
}

impl MaterialSet {
    /// The resin of this name, and its index.
    pub fn resin(&self, name: &str) -> Option<(usize, &Resin)> {
        self.resins.iter().enumerate().find(|(_, resin)| resin.name == name)
    }

    /// The resin name nearest to `name`, if one is near enough to be meant.
    pub fn suggest(&self, name: &str) -> Option<&str> {
        crate::words::suggest(name, self.resins.iter().map(|resin| resin.name.as_str()))
    }
}
