//! Material files.
//!
//! ```toml
//! channels = ["R", "G", "B"]            # default ["Y"]
//! provenance = "measured on our printer, May 2010"
//! [[resin]]
//! name = "white"
//! rgba = [245, 245, 240, 255]
//! density-g-per-cm3 = 1.18
//! price-per-kg = 300         # in any currency; for the estimate of costs
//! scattering-per-mm = [5.9, 9.0, 24.0]  # one number, or one per channel
//! absorption-per-mm = 0.003
//! g = 0.4                               # default 0
//! thickness-mm = 3.0                    # of the slab that is simulated; left out: chosen by optical thickness
//! [[resin]]
//! name = "support"
//! rgba = [200, 190, 140, 255]
//! density-g-per-cm3 = 1.17
//! reflection = "support-r.csv"          # measured profiles, one file or one per channel
//! transmission = "support-t.csv"        # left out: the transmission column of the same files
//! thickness-mm = 5.6
//! print-as = "background"
//! [[resin.slab]]                        # more slabs of the resin, of other thicknesses
//! reflection = "support-thin-r.csv"
//! transmission = "support-thin-t.csv"
//! thickness-mm = 1.0
//! ```
//!
//! Coefficients and profiles may both be given: Kubelka–Munk parameters then come from the profiles, of the first slab
//! if there are several, and whoever needs coefficients has them. Where only profiles are given, [`MaterialFile::fit`]
//! finds coefficients for all slabs together.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::resin_table::{Draft, is_name};
use super::simulate::simulate_profile;
use super::spectra::ResinSpectrum;
use super::toml_source::{Folder, Keys};
use super::{MaterialSet, Resin, ResinChannel};
use crate::optics::{FrequencyGrid, Grains, Interface, Model, OpticsError, ResinId, Stack, VolumeCoefficients};
use crate::toml_reader::{Found, Source, Strings};
use crate::watch::{Thousandths, Unwatched, Watch};

const TOP_KEYS: [&str; 4] = ["name", "channels", "provenance", "resin"];
/// Slices name materials by one byte, of which 0 is the background.
const MAX_RESINS: usize = 255;
const MAX_CHANNELS: usize = 16;

/// A material file, read and checked, its slow simulations still to be done.
#[derive(Debug, Clone)]
pub struct MaterialFile {
    pub(super) name: String,
    path: PathBuf,
    pub(super) channels: Vec<String>,
    pub(super) provenance: String,
    pub(super) resins: Vec<Draft>,
    profile_files: Vec<PathBuf>,
    /// Seed of the first resin's first channel where slabs are simulated.
    pub(super) first_seed: u64,
    /// What fits had to say.
    remarks: Vec<String>,
}

impl MaterialSet {
    /// Reads a material file and simulates the resins that come without profiles, seconds each.
    ///
    /// # Errors
    /// As [`MaterialFile::read`] and [`MaterialFile::into_set`].
    pub fn load(path: &Path) -> Result<Self, OpticsError> {
        MaterialFile::read(path)?.into_set(&Unwatched)
    }
}

impl MaterialFile {
    /// What `name` stands for, and whether it is built in: a file if there is one of that name or it ends in `.toml`,
    /// else a built-in set.
    ///
    /// # Errors
    /// As [`Self::read`] and [`Self::builtin`].
    pub fn named(name: &Path) -> Result<(Self, bool), OpticsError> {
        let is_toml = |extension: &std::ffi::OsStr| extension.eq_ignore_ascii_case("toml");
        if name.is_file() || name.extension().is_some_and(is_toml) {
            return Ok((Self::read(name)?, false));
        }
        Ok((Self::builtin(&name.to_string_lossy())?, true))
    }

    /// Names of the resins, in the order of the file.
    pub fn resin_names(&self) -> impl Iterator<Item = &str> + Clone {
        self.resins.iter().map(|draft| draft.name.as_str())
    }

    /// Names of the resins in the order of the file, each with whether it is printed, as the background is not.
    pub fn resins_printed(&self) -> impl Iterator<Item = (&str, bool)> + Clone {
        self.resins.iter().map(|draft| (draft.name.as_str(), !draft.background))
    }

    /// Which resin has this name.
    ///
    /// # Errors
    /// [`OpticsError::UnknownResin`] with the nearest name.
    pub fn resin_id(&self, name: &str) -> Result<ResinId, OpticsError> {
        let place = self.resin_names().position(|known| known == name);
        place.map(ResinId).ok_or_else(|| OpticsError::unknown_resin(name, &self.name, self.resin_names()))
    }

    /// A stack of named resins as one of the file's.
    ///
    /// # Errors
    /// [`OpticsError::UnknownResin`] with the nearest name.
    pub fn stack(&self, named: &Stack<String>) -> Result<Stack, OpticsError> {
        named.try_map(|name| self.resin_id(name))
    }

    /// Reads and checks a file and the profiles it names; quick.
    ///
    /// # Errors
    /// [`OpticsError::File`] for a file that cannot be read, [`OpticsError::Entry`] for the first thing in it that is
    /// not acceptable.
    pub fn read(path: &Path) -> Result<Self, OpticsError> {
        let text = crate::regular_file::read_text(path)
            .map_err(|source| OpticsError::File { file: path.to_path_buf(), source })?;
        let folder = Folder::Disk(path.parent().unwrap_or(Path::new("")).to_path_buf(), RefCell::default());
        let mut file = Self::parse(&text, path, &folder)?;
        if let Folder::Disk(_, read) = folder {
            file.profile_files = read.into_inner();
        }
        Ok(file)
    }

    /// The files of profiles that it names, as often as they are named.
    pub fn profile_files(&self) -> &[PathBuf] {
        &self.profile_files
    }

    pub(super) fn parse(text: &str, path: &Path, folder: &Folder<'_>) -> Result<Self, OpticsError> {
        let source = Source::new(path, path.parent().unwrap_or(Path::new("")), text, Found::ByType);
        let document = source.parse()?;
        let top = Keys::root(&source, &document);
        top.allow_only(&TOP_KEYS)?;
        let stem = || path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let mut file = Self {
            name: top.string("name")?.map_or_else(stem, |name| name.value),
            path: path.to_path_buf(),
            channels: channels(&top)?,
            provenance: top.string("provenance")?.map_or("not stated".into(), |text| text.value),
            resins: Vec::new(),
            profile_files: Vec::new(),
            first_seed: Model::DEFAULT_SEED,
            remarks: Vec::new(),
        };
        let tables = top.require("resin", "at least one [[resin]] table")?;
        const TABLES: &str = "[[resin]] tables";
        for (index, item) in tables.list(TABLES)?.into_iter().enumerate() {
            let keys = item.table_as(format!("resin {}: ", index + 1), TABLES)?;
            let draft = Draft::read(keys, folder, &file.channels, &file.resins)?;
            file.resins.push(draft);
        }
        if file.resins.is_empty() || file.resins.len() > MAX_RESINS {
            let found = format!("{} resins", file.resins.len());
            return Err(tables.refuse_as(found, format!("1 to {MAX_RESINS}")));
        }
        Ok(file)
    }

    /// Fits coefficients to the resins that are given by profiles only: those in `names`, or all. Some seconds a resin.
    /// The answer is one line for each resin that stays without, because none fit; the set's warnings will have them
    /// too. `watch` hears the stage "coefficients".
    ///
    /// # Errors
    /// [`OpticsError::Stopped`].
    pub fn fit(&mut self, names: Option<&[&str]>, watch: &dyn Watch) -> Result<Vec<String>, OpticsError> {
        let channels = self.channels.clone();
        let wanted =
            |draft: &Draft| draft.volume.is_none() && names.is_none_or(|names| names.contains(&draft.name.as_str()));
        let mut drafts: Vec<&mut Draft> = self.resins.iter_mut().filter(|draft| wanted(draft)).collect();
        let stage = Thousandths::begin(watch, "coefficients", drafts.len() as u64);
        let mut refused = Vec::new();
        for draft in &mut drafts {
            stage.go_on()?;
            if let Err(reason) = draft.fit(&channels) {
                refused.push(format!("{reason}; only the model km knows this resin"));
            }
            stage.advance(1);
        }
        self.remarks.extend(refused.iter().cloned());
        Ok(refused)
    }

    /// Simulates what has no profiles and reads off all parameters. `watch` hears the stage "materials".
    ///
    /// # Errors
    /// [`OpticsError::Spectrum`] for profiles that are no slab's; [`OpticsError::Stopped`].
    pub fn into_set(self, watch: &dyn Watch) -> Result<MaterialSet, OpticsError> {
        let grid = FrequencyGrid::default();
        let mut warnings: Vec<String> = self.resins.iter().filter_map(Draft::warning).chain(self.remarks).collect();
        let simulated = self.resins.iter().filter(|draft| draft.profiles.is_none()).count() * self.channels.len();
        let stage = Thousandths::begin(watch, "materials", simulated as u64 * Model::DEFAULT_PHOTONS);
        let mut order: Vec<(usize, Draft)> = self.resins.into_iter().enumerate().collect();
        // What was measured can be refused before slow work starts.
        order.sort_by_key(|(_, draft)| draft.profiles.is_none());
        let mut resins = BTreeMap::new();
        for (index, draft) in order {
            let mut known = Vec::with_capacity(self.channels.len());
            for (channel, channel_name) in self.channels.iter().enumerate() {
                let thickness = draft.thickness_mm[channel];
                let (reflection, transmission) = match (&draft.profiles, &draft.volume) {
                    (Some(profiles), _) => profiles[channel].clone(),
                    (None, Some(volume)) => {
                        // Resins and channels get random numbers of their own.
                        let seed = self.first_seed + (index * self.channels.len() + channel) as u64;
                        let slab = simulate_profile(volume[channel], thickness, Model::DEFAULT_PHOTONS, seed, &stage)?;
                        (slab.result.reflection_profile, slab.result.transmission_profile)
                    }
                    (None, None) => continue, // refused when the file was read
                };
                // What was simulated, now or for the file, is index-matched.
                let measured = draft.profiles.is_some() && (draft.volume.is_none() || draft.fit.is_some());
                let index = if measured { draft.refractive_index } else { 1.0 };
                let surfaces = Interface::between(1.0, index);
                let spectrum = ResinSpectrum::from_profiles(&reflection, &transmission, thickness, surfaces, &grid);
                let spectrum = spectrum.map_err(|source| OpticsError::Spectrum {
                    file: self.path.clone(),
                    line: draft.line,
                    resin: draft.name.clone(),
                    channel: channel_name.clone(),
                    source,
                })?;
                let remarks = spectrum.remarks().into_iter();
                warnings
                    .extend(remarks.map(|remark| format!("resin {}, channel {channel_name}: {remark}", draft.name)));
                known.push(ResinChannel {
                    volume: draft.volume.as_ref().map(|volume| volume[channel]),
                    fit: draft.fit.as_ref().map(|fit| fit[channel]),
                    kubelka_munk: spectrum.kubelka_munk,
                    slab: spectrum.slab,
                    slab_mm: thickness,
                    reflection,
                    transmission,
                });
            }
            let resin = Resin {
                name: draft.name,
                rgba: draft.rgba,
                density_g_per_cm3: draft.density,
                price_per_kg: draft.price,
                print_as_background: draft.background,
                channels: known,
                refractive_index: draft.refractive_index,
                notes: draft.notes,
            };
            resins.insert(index, resin);
        }
        Ok(MaterialSet {
            name: self.name,
            channels: self.channels,
            resins: resins.into_values().collect(),
            provenance: self.provenance,
            grid,
            warnings,
            grains: Grains::FINE,
        })
    }

    /// Name of the set.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where the numbers come from.
    pub fn provenance(&self) -> &str {
        &self.provenance
    }

    /// Names of the channels.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    /// The coefficients of a resin per channel; `None` if it has none or does not exist.
    pub fn volume(&self, resin: &str) -> Option<&[VolumeCoefficients]> {
        self.resins.iter().find(|draft| draft.name == resin)?.volume.as_deref()
    }

    /// Colour in slices and density, g/cm³, of a resin.
    pub fn colour_and_density(&self, resin: &str) -> Option<([u8; 4], f64)> {
        self.resins.iter().find(|draft| draft.name == resin).map(|draft| (draft.rgba, draft.density))
    }

    /// The coefficients of one of its resins per channel.
    pub(in crate::optics) fn needed_volumes(&self, resin: ResinId) -> Result<&[VolumeCoefficients], OpticsError> {
        let draft = &self.resins[resin.0];
        draft.volume.as_deref().ok_or_else(|| OpticsError::NoCoefficients { resin: draft.name.clone() })
    }

    /// Names, coefficients and thickness per channel of the resins that have coefficients.
    #[cfg(test)]
    pub(in crate::optics) fn coefficients(&self) -> impl Iterator<Item = (&str, &[VolumeCoefficients], &[f64])> {
        self.resins.iter().filter_map(|draft| Some((&*draft.name, draft.volume.as_deref()?, &*draft.thickness_mm)))
    }
}

fn channels(top: &Keys<'_>) -> Result<Vec<String>, OpticsError> {
    let Some(Strings { items: names, .. }) = top.strings("channels")? else { return Ok(vec!["Y".into()]) };
    let at = top.get("channels").map_or(0, |value| value.start());
    if names.is_empty() || names.len() > MAX_CHANNELS {
        return Err(top.error(at, "channels", format!("{} channels", names.len()), format!("1 to {MAX_CHANNELS}")));
    }
    for (i, name) in names.iter().enumerate() {
        if !is_name(&name.value) || names[..i].iter().any(|other| other.value == name.value) {
            return Err(top.wrong("channels", name, "names, each once"));
        }
    }
    Ok(names.into_iter().map(|name| name.value).collect())
}
