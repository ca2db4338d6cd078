//! Material files.
//!
//! ```toml
//! channels = ["R", "G", "B"]            # default ["Y"]
//! provenance = "measured on our printer, May 2010"
//! [[resin]]
//! name = "white"
//! rgba = [245, 245, 240, 255]
//! density-g-per-cm3 = 1.18
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
//! ```
//!
//! Coefficients and profiles may both be given: Kubelka–Munk parameters then come from the profiles, and whoever needs
//! coefficients has them.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use super::simulate::{DEFAULT_PHOTONS, DEFAULT_SEED, simulate_profile};
use super::spectra::ResinSpectrum;
use super::toml_source::{At, Folder, Keys, Source, Strings, kind};
use super::{MaterialSet, Resin};
use crate::optics::{FrequencyGrid, OpticsError, ProfileFile, RadialProfile, VolumeCoefficients};

const TOP_KEYS: [&str; 4] = ["name", "channels", "provenance", "resin"];
const RESIN_KEYS: [&str; 12] = [
    "name",
    "rgba",
    "density-g-per-cm3",
    "scattering-per-mm",
    "absorption-per-mm",
    "g",
    "refractive-index",
    "reflection",
    "transmission",
    "thickness-mm",
    "print-as",
    "notes",
];
/// Slices name materials by one byte, of which 0 is the background.
const MAX_RESINS: usize = 255;
const MAX_CHANNELS: usize = 16;
/// Thickest slab accepted, mm.
const MAX_THICKNESS_MM: f64 = 100.0;
/// Densities from foam to tungsten-filled; a value outside is in other units.
const DENSITY: std::ops::RangeInclusive<f64> = 0.1..=25.0;

/// A material file, read and checked, its slow simulations still to be done.
#[derive(Debug, Clone)]
pub struct MaterialFile {
    name: String,
    path: PathBuf,
    channels: Vec<String>,
    provenance: String,
    resins: Vec<Draft>,
    warnings: Vec<String>,
}

/// A resin as the file has it.
#[derive(Debug, Clone)]
struct Draft {
    name: String,
    rgba: [u8; 4],
    density: f64,
    background: bool,
    volume: Option<Vec<VolumeCoefficients>>,
    /// R and T per channel.
    profiles: Option<Vec<(RadialProfile, RadialProfile)>>,
    thickness_mm: Vec<f64>,
    refractive_index: f64,
    notes: String,
    line: usize,
}

impl MaterialSet {
    /// Reads a material file and simulates the resins that come without profiles, seconds each.
    ///
    /// # Errors
    /// As [`MaterialFile::read`] and [`MaterialFile::into_set`].
    pub fn load(path: &Path) -> Result<Self, OpticsError> {
        MaterialFile::read(path)?.into_set(|_, _| ControlFlow::Continue(()))
    }
}

impl MaterialFile {
    /// Reads and checks a file and the profiles it names; quick.
    ///
    /// # Errors
    /// [`OpticsError::File`] for a file that cannot be read, [`OpticsError::Entry`] for the first thing in it that is not acceptable.
    pub fn read(path: &Path) -> Result<Self, OpticsError> {
        let text =
            std::fs::read_to_string(path).map_err(|source| OpticsError::File { file: path.to_path_buf(), source })?;
        let folder = Folder::Disk(path.parent().unwrap_or(Path::new("")).to_path_buf());
        Self::parse(&text, path, &folder)
    }

    pub(super) fn parse(text: &str, path: &Path, folder: &Folder<'_>) -> Result<Self, OpticsError> {
        let source = Source { text, path };
        let document = source.parse()?;
        let top = Keys { source, table: document.get_ref(), start: 0, prefix: String::new() };
        top.reject_unknown(&TOP_KEYS)?;
        let stem = || path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let mut file = Self {
            name: top.string("name")?.map_or_else(stem, |name| name.value),
            path: path.to_path_buf(),
            channels: channels(&top)?,
            provenance: top.string("provenance")?.map_or("not stated".into(), |text| text.value),
            resins: Vec::new(),
            warnings: Vec::new(),
        };
        let tables = top.get("resin").ok_or_else(|| top.missing("resin", "at least one [[resin]] table"))?;
        let (at, not_tables) = (tables.span().start, "[[resin]] tables".to_string());
        let Some(array) = tables.get_ref().as_array() else {
            return Err(top.error(at, "resin", kind(tables.get_ref()), not_tables));
        };
        for (index, item) in array.iter().enumerate() {
            let Some(table) = item.get_ref().as_table() else {
                return Err(top.error(item.span().start, "resin", kind(item.get_ref()), not_tables));
            };
            let keys = Keys { source, table, start: item.span().start, prefix: format!("resin {}: ", index + 1) };
            file.read_resin(keys, folder)?;
        }
        if file.resins.is_empty() || file.resins.len() > MAX_RESINS {
            let found = format!("{} resins", file.resins.len());
            return Err(top.error(at, "resin", found, format!("1 to {MAX_RESINS}")));
        }
        Ok(file)
    }

    /// Simulates what has no profiles and reads off all parameters. `progress` hears what is being done and how much of the whole
    /// is, 0 to 1, and may break off.
    ///
    /// # Errors
    /// [`OpticsError::Spectrum`] for profiles that are no slab's; [`OpticsError::Cancelled`].
    pub fn into_set(self, mut progress: impl FnMut(&str, f64) -> ControlFlow<()>) -> Result<MaterialSet, OpticsError> {
        let grid = FrequencyGrid::default();
        let mut warnings = self.warnings;
        let simulated = self.resins.iter().filter(|draft| draft.profiles.is_none()).count() * self.channels.len();
        let mut done = 0;
        let mut order: Vec<(usize, Draft)> = self.resins.into_iter().enumerate().collect();
        order.sort_by_key(|(_, draft)| draft.profiles.is_none()); // what was measured can be refused before slow work starts
        let mut resins = BTreeMap::new();
        for (index, draft) in order {
            let mut profiles = Vec::new();
            let mut spectra = Vec::new();
            for (channel, channel_name) in self.channels.iter().enumerate() {
                let thickness = draft.thickness_mm[channel];
                let pair = match (&draft.profiles, &draft.volume) {
                    (Some(profiles), _) => profiles[channel].clone(),
                    (None, Some(volume)) => {
                        let what = format!("simulating {} ({channel_name})", draft.name);
                        let share =
                            |photons: u64| (done as f64 + photons as f64 / DEFAULT_PHOTONS as f64) / simulated as f64;
                        // Resins and channels get random numbers of their own.
                        let seed = DEFAULT_SEED + (index * self.channels.len() + channel) as u64;
                        let slab = simulate_profile(volume[channel], thickness, DEFAULT_PHOTONS, seed, |photons| {
                            progress(&what, share(photons))
                        })?;
                        done += 1;
                        (slab.result.reflection_profile, slab.result.transmission_profile)
                    }
                    (None, None) => continue, // refused when the file was read
                };
                let spectrum = ResinSpectrum::from_profiles(&pair.0, &pair.1, thickness, &grid).map_err(|source| {
                    OpticsError::Spectrum {
                        file: self.path.clone(),
                        line: draft.line,
                        resin: draft.name.clone(),
                        channel: channel_name.clone(),
                        source,
                    }
                })?;
                let remarks = spectrum.remarks().into_iter();
                warnings
                    .extend(remarks.map(|remark| format!("resin {}, channel {channel_name}: {remark}", draft.name)));
                profiles.push(pair);
                spectra.push(spectrum);
            }
            let (slab, kubelka_munk) =
                spectra.into_iter().map(|spectrum| (spectrum.slab, spectrum.kubelka_munk)).unzip();
            let resin = Resin {
                name: draft.name,
                rgba: draft.rgba,
                density_g_per_cm3: draft.density,
                print_as_background: draft.background,
                volume: draft.volume,
                kubelka_munk,
                slab,
                profiles,
                representative_thickness_mm: draft.thickness_mm,
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
        })
    }

    /// Names, coefficients and thickness per channel of the resins that have coefficients.
    pub(in crate::optics) fn coefficients(&self) -> impl Iterator<Item = (&str, &[VolumeCoefficients], &[f64])> {
        self.resins.iter().filter_map(|draft| Some((&*draft.name, draft.volume.as_deref()?, &*draft.thickness_mm)))
    }

    pub(super) fn channels(&self) -> &[String] {
        &self.channels
    }

    fn read_resin(&mut self, mut keys: Keys<'_, '_>, folder: &Folder<'_>) -> Result<(), OpticsError> {
        if let Ok(Some(name)) = keys.string("name") {
            keys.prefix = format!("resin {}: ", name.value);
        }
        keys.reject_unknown(&RESIN_KEYS)?;
        let name = keys.string("name")?.ok_or_else(|| keys.missing("name", "a name"))?;
        if !is_name(&name.value) {
            return Err(keys.wrong(
                "name",
                &name,
                "letters, digits, spaces, `-`, `_`, `+` or `.`, a letter or digit first",
            ));
        }
        if self.resins.iter().any(|other| other.name.to_lowercase() == name.value.to_lowercase()) {
            return Err(keys.wrong("name", &name, "a name no other resin has"));
        }
        let rgba = rgba(&keys)?;
        if let Some(other) = self.resins.iter().find(|other| other.rgba == rgba.value) {
            let expected = format!("a colour other than that of {}", other.name);
            return Err(keys.error(rgba.at, "rgba", format!("{:?}", rgba.value), expected));
        }
        let density = keys.number("density-g-per-cm3")?;
        let density = density.ok_or_else(|| keys.missing("density-g-per-cm3", "a number"))?;
        if !DENSITY.contains(&density.value) {
            return Err(keys.wrong("density-g-per-cm3", &density, "0.1 to 25"));
        }
        let background = match keys.string("print-as")? {
            None => false,
            Some(text) if text.value == "resin" => false,
            Some(text) if text.value == "background" => {
                if let Some(other) = self.resins.iter().find(|other| other.background) {
                    let expected = format!("one background resin at most, which {} is", other.name);
                    return Err(keys.error(text.at, "print-as", "background".into(), expected));
                }
                true
            }
            Some(text) => return Err(keys.wrong("print-as", &text, "\"background\" or \"resin\"")),
        };
        let refractive_index = match keys.number("refractive-index")? {
            None => 1.0,
            Some(index) if (1.0..=3.0).contains(&index.value) => index.value,
            Some(index) => return Err(keys.wrong("refractive-index", &index, "1 to 3")),
        };
        if refractive_index != 1.0 {
            self.warnings.push(format!(
                "resin {}: refractive index {refractive_index} is noted, but light is reckoned index-matched, without Fresnel \
                 reflection",
                name.value
            ));
        }
        let volume = volume(&keys, self.channels.len())?;
        let profiles = profiles(&keys, folder, &self.channels)?;
        if volume.is_none() && profiles.is_none() {
            return Err(keys.missing("scattering-per-mm", "coefficients, or measured profiles under `reflection`"));
        }
        let thickness_mm = match (keys.per_channel("thickness-mm", self.channels.len())?, &volume) {
            (Some(given), _) => {
                if let Some(wrong) = given.iter().find(|t| !(t.value > 0.0 && t.value <= MAX_THICKNESS_MM)) {
                    return Err(keys.wrong("thickness-mm", wrong, "more than 0, at most 100"));
                }
                given.iter().map(|thickness| thickness.value).collect()
            }
            (None, Some(volume)) if profiles.is_none() => {
                volume.iter().map(VolumeCoefficients::representative_thickness_mm).collect()
            }
            (None, _) => return Err(keys.missing("thickness-mm", "the thickness of the slab whose profiles these are")),
        };
        let notes = keys.string("notes")?.map(|notes| notes.value).unwrap_or_default();
        let line = 1 + keys.source.text[..keys.start].matches('\n').count();
        let (name, rgba, density) = (name.value, rgba.value, density.value);
        self.resins.push(Draft {
            name,
            rgba,
            density,
            background,
            volume,
            profiles,
            thickness_mm,
            refractive_index,
            notes,
            line,
        });
        Ok(())
    }
}

fn channels(top: &Keys<'_, '_>) -> Result<Vec<String>, OpticsError> {
    let Some(Strings { items: names, .. }) = top.strings("channels")? else { return Ok(vec!["Y".into()]) };
    let at = top.get("channels").map_or(0, |value| value.span().start);
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

/// Names go into stackings (`white:2.0,…`) and file names.
fn is_name(name: &str) -> bool {
    name.starts_with(char::is_alphanumeric)
        && name.ends_with(|c: char| c.is_alphanumeric() || "-_+".contains(c))
        && name.chars().all(|c| c.is_alphanumeric() || " -_+.".contains(c))
}

fn rgba(keys: &Keys<'_, '_>) -> Result<At<[u8; 4]>, OpticsError> {
    let expected = "[red, green, blue] or [red, green, blue, alpha], integers of 0 to 255";
    let numbers = keys.numbers("rgba")?.ok_or_else(|| keys.missing("rgba", expected))?;
    let byte = |number: &At<f64>| {
        (number.value.fract() == 0.0 && (0.0..=255.0).contains(&number.value)).then_some(number.value as u8)
    };
    let bytes: Option<Vec<u8>> = numbers.value.iter().map(byte).collect();
    let value = match bytes.as_deref() {
        Some(&[r, g, b]) => [r, g, b, 255],
        Some(&[r, g, b, a]) => [r, g, b, a],
        _ => {
            let found: Vec<String> = numbers.value.iter().map(|number| number.value.to_string()).collect();
            return Err(keys.error(numbers.at, "rgba", format!("[{}]", found.join(", ")), expected.into()));
        }
    };
    if value == [0; 4] {
        let expected = "any other colour: slices use this one for background";
        return Err(keys.error(numbers.at, "rgba", "[0, 0, 0, 0]".into(), expected.into()));
    }
    Ok(At { value, at: numbers.at })
}

fn volume(keys: &Keys<'_, '_>, channels: usize) -> Result<Option<Vec<VolumeCoefficients>>, OpticsError> {
    let [scattering, absorption, g] =
        ["scattering-per-mm", "absorption-per-mm", "g"].map(|key| keys.per_channel(key, channels));
    let (scattering, absorption) = match (scattering?, absorption?) {
        (Some(scattering), Some(absorption)) => (scattering, absorption),
        (None, None) => return Ok(None),
        (Some(_), None) => return Err(keys.missing("absorption-per-mm", "a number beside scattering-per-mm")),
        (None, Some(_)) => return Err(keys.missing("scattering-per-mm", "a number beside absorption-per-mm")),
    };
    let g = g?.unwrap_or_else(|| (0..channels).map(|_| At { value: 0.0, at: keys.start }).collect());
    let coefficients = scattering.iter().zip(&absorption).zip(&g).map(|((sigma_s, sigma_a), g)| {
        VolumeCoefficients::new(sigma_s.value, sigma_a.value, g.value).map_err(|error| match error {
            OpticsError::Parameter { name, found, expected } => {
                let at = match name.as_str() {
                    "g" => g.at,
                    "absorption-per-mm" => absorption.first().map_or(keys.start, |_| sigma_a.at),
                    _ => sigma_s.at,
                };
                keys.error(at, &name, found, expected)
            }
            other => other,
        })
    });
    let coefficients: Vec<_> = coefficients.collect::<Result<_, _>>()?;
    if let Some(i) = coefficients.iter().position(|c| c.sigma_t() == 0.0) {
        let expected = "a resin that scatters or absorbs".into();
        return Err(keys.error(scattering[i].at, "scattering-per-mm", "0, and no absorption".into(), expected));
    }
    Ok(Some(coefficients))
}

fn profiles(
    keys: &Keys<'_, '_>,
    folder: &Folder<'_>,
    channels: &[String],
) -> Result<Option<Vec<(RadialProfile, RadialProfile)>>, OpticsError> {
    let per_channel = |key: &str| -> Result<Option<Vec<At<String>>>, OpticsError> {
        let Some(Strings { items: names, is_array }) = keys.strings(key)? else { return Ok(None) };
        let wanted = if is_array { channels.len() } else { 1 };
        if names.len() != wanted || (!is_array && channels.len() != 1) {
            let at = names.first().map_or(keys.start, |name| name.at);
            let expected = format!("{}: one per channel", channels.len());
            return Err(keys.error(at, key, format!("{} files", names.len()), expected));
        }
        Ok(Some(names))
    };
    let reflection = per_channel("reflection")?;
    let transmission = per_channel("transmission")?;
    let Some(reflection) = reflection else {
        return match transmission {
            None => Ok(None),
            Some(_) => Err(keys.missing("reflection", "a file beside transmission")),
        };
    };
    let lacks = |file: PathBuf, column: &str| OpticsError::Entry {
        file,
        line: None,
        element: "header".into(),
        found: format!("no {column} column"),
        expected: format!("one, since {} names the file", keys.prefix.trim_end_matches([':', ' '])),
    };
    let mut pairs = Vec::with_capacity(channels.len());
    for channel in 0..channels.len() {
        let (r_path, text) = folder.read(&reflection[channel].value)?;
        let r_file = ProfileFile::parse(&text, &r_path)?;
        let (t_path, t_file) = match &transmission {
            Some(names) => {
                let (path, text) = folder.read(&names[channel].value)?;
                let file = ProfileFile::parse(&text, &path)?;
                (path, file)
            }
            None => (r_path.clone(), r_file.clone()),
        };
        let r = r_file.reflection.ok_or_else(|| lacks(r_path, "reflection_per_mm2"))?;
        let t = t_file.transmission.ok_or_else(|| lacks(t_path, "transmission_per_mm2"))?;
        pairs.push((r, t));
    }
    Ok(Some(pairs))
}
