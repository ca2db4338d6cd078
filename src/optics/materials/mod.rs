//! Resins and the sets they come in.
//!
//! A set is read from a TOML file (`file.rs`) or is built in (`builtin.rs`); either way every resin ends up with the
//! Kubelka–Munk parameters of each channel over the default [`FrequencyGrid`], read off a slab of representative
//! thickness (`spectra.rs`) that was measured or is simulated from volume coefficients (`simulate.rs`).

mod builtin;
mod file;
pub(crate) mod resin_table;
mod simulate;
mod slabs;
mod spectra;
pub(crate) mod toml_source;

use std::ops::Index;

use super::{
    ChannelId, CoefficientFit, FrequencyGrid, Grains, Interface, KubelkaMunk, Mixture, OpticsError, RadialProfile,
    ResinId, SlabSpectrum, Stack, VolumeCoefficients,
};
pub use builtin::{BUILTIN_PHOTONS, regenerate_builtin};
pub use file::MaterialFile;
pub use simulate::SimulatedProfile;
pub use slabs::SlabPlan;
#[cfg(any(test, feature = "measure"))]
pub(crate) use spectra::ResinSpectrum;
pub use spectra::SpectrumError;

/// The resins a job may use, in the order of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialSet {
    /// Name of the set.
    pub name: String,
    /// Names of the colour channels, at least one.
    pub channels: Vec<String>,
    /// The resins, at least one, names unique.
    pub resins: Vec<Resin>,
    /// Where the numbers come from, to be shown wherever the set is; built-in sets say that they are no measurement.
    pub provenance: String,
    /// Frequencies of all spectra.
    pub grid: FrequencyGrid,
    /// One line each: what was assumed, ignored or extrapolated. To be shown to the user.
    pub warnings: Vec<String>,
    /// The grains that mixtures of the resins are laid in; [`Grains::FINE`] where no printer is known.
    pub grains: Grains,
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
    /// What a kilogram of it costs, in whatever currency the file is written in; `None` where it does not say.
    pub price_per_kg: Option<f64>,
    /// Printed by leaving a hole, which the printer fills: background in the slices. At most one resin of a set is.
    pub print_as_background: bool,
    /// What light does in it, by the set's channels.
    pub channels: Vec<ResinChannel>,
    /// Refractive index, as in the coefficients. Kubelka–Munk parameters are those of the resin inside, without any
    /// surface.
    pub refractive_index: f64,
    /// Free text of the file.
    pub notes: String,
}

/// What is known of a resin in one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct ResinChannel {
    /// Volume coefficients, if known: in all channels of a resin or in none.
    pub volume: Option<VolumeCoefficients>,
    /// How they were fitted to the profiles, if they were.
    pub fit: Option<CoefficientFit>,
    /// Kubelka–Munk parameters, read from the slab below.
    pub kubelka_munk: KubelkaMunk,
    /// R̂(k) and T̂(k) of the representative slab.
    pub slab: SlabSpectrum,
    /// Its thickness, mm.
    pub slab_mm: f64,
    /// Its R(r).
    pub reflection: RadialProfile,
    /// Its T(r).
    pub transmission: RadialProfile,
}

impl Resin {
    /// The volume coefficients of all channels, if known.
    pub fn volumes(&self) -> Option<Vec<VolumeCoefficients>> {
        self.channels.iter().map(|channel| channel.volume).collect()
    }

    /// The volume coefficients of all channels.
    ///
    /// # Errors
    /// [`OpticsError::NoCoefficients`].
    pub(crate) fn needed_volumes(&self) -> Result<Vec<VolumeCoefficients>, OpticsError> {
        self.volumes().ok_or_else(|| OpticsError::NoCoefficients { resin: self.name.clone() })
    }

    /// How the coefficients of all channels were fitted, if they were.
    pub fn fits(&self) -> Option<Vec<CoefficientFit>> {
        self.channels.iter().map(|channel| channel.fit).collect()
    }

    /// The Kubelka–Munk parameters of all channels.
    pub(crate) fn kubelka_munk(&self) -> Vec<KubelkaMunk> {
        self.channels.iter().map(|channel| channel.kubelka_munk.clone()).collect()
    }
}

impl MaterialSet {
    /// The resin of this name, and which it is.
    pub fn resin(&self, name: &str) -> Option<(ResinId, &Resin)> {
        self.ids().zip(&self.resins).find(|(_, resin)| resin.name == name)
    }

    /// Whether the volume coefficients of all resins are known.
    pub fn has_coefficients(&self) -> bool {
        self.resins.iter().all(|resin| resin.volumes().is_some())
    }

    /// All resins.
    pub fn ids(&self) -> impl ExactSizeIterator<Item = ResinId> + use<> {
        (0..self.resins.len()).map(ResinId)
    }

    /// All channels.
    pub fn channel_ids(&self) -> impl ExactSizeIterator<Item = ChannelId> + use<> {
        (0..self.channels.len()).map(ChannelId)
    }

    /// The surface to air of a resin of the set: by the mean of their refractive indices.
    pub fn surface(&self) -> Interface {
        let indices = || self.resins.iter().map(|resin| resin.refractive_index);
        let first = indices().next().unwrap_or(1.0);
        // A mean of equals may round.
        let alike = indices().all(|index| index == first);
        let mean = if alike { first } else { indices().sum::<f64>() / self.resins.len() as f64 };
        Interface::between(1.0, mean)
    }

    /// A stack of named resins as one of the set's.
    ///
    /// # Errors
    /// [`OpticsError::UnknownResin`] with the nearest name.
    pub fn stack(&self, named: &Stack<String>) -> Result<Stack, OpticsError> {
        let id = |name: &String| match self.resin(name) {
            Some((id, _)) => Ok(id),
            None => Err(OpticsError::unknown_resin(name, &self.name, self.resins.iter().map(|resin| &*resin.name))),
        };
        named.try_map(id)
    }

    /// The stack with the names of its resins or mixtures, which must be the set's; [`Self::mixed_stack`] reads them.
    pub fn named<M: Clone + Into<Mixture>>(&self, stack: &Stack<M>) -> Stack<String> {
        stack.map(|medium| self.mixture_name(&medium.clone().into()))
    }
}

impl Index<ResinId> for MaterialSet {
    type Output = Resin;

    fn index(&self, resin: ResinId) -> &Resin {
        &self.resins[resin.0]
    }
}

impl Index<ChannelId> for Resin {
    type Output = ResinChannel;

    fn index(&self, channel: ChannelId) -> &ResinChannel {
        &self.channels[channel.0]
    }
}
