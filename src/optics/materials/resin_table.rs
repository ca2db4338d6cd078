//! One `[[resin]]` table of a material file, read and checked.

use std::path::PathBuf;

use super::toml_source::{Folder, Keys};
use crate::optics::{
    CoefficientFit, MAX_REFRACTIVE_INDEX, MeasuredSlab, OpticsError, ProfileFile, RadialProfile, VolumeCoefficients,
    fit_coefficients,
};
use crate::toml_reader::{At, Fault, Strings, Table, Value};
use crate::words::{MAX_FILE_NAME, is_device_name};

const RESIN_KEYS: [&str; 14] = [
    "name",
    "rgba",
    "density-g-per-cm3",
    "price-per-kg",
    "scattering-per-mm",
    "absorption-per-mm",
    "g",
    "refractive-index",
    "reflection",
    "transmission",
    "thickness-mm",
    "slab",
    "print-as",
    "notes",
];
const SLAB_KEYS: [&str; 3] = ["reflection", "transmission", "thickness-mm"];
/// Thickest slab accepted, mm.
pub(crate) const MAX_THICKNESS_MM: f64 = 100.0;
/// Densities from foam to tungsten-filled; a value outside is in other units.
pub(crate) const DENSITY: std::ops::RangeInclusive<f64> = 0.1..=25.0;

/// Prices of a kilogram, from nothing to beyond any resin, in any currency.
pub(crate) const PRICE: std::ops::RangeInclusive<f64> = 0.0..=1e6;

/// A resin as the file has it.
#[derive(Debug, Clone)]
pub(super) struct Draft {
    pub(super) name: String,
    pub(super) rgba: [u8; 4],
    pub(super) density: f64,
    pub(super) price: Option<f64>,
    pub(super) background: bool,
    pub(super) volume: Option<Vec<VolumeCoefficients>>,
    /// What the coefficients were fitted to the profiles with, if they were; per channel.
    pub(super) fit: Option<Vec<CoefficientFit>>,
    /// R and T per channel of the slab that Kubelka–Munk parameters are read from.
    pub(super) profiles: Option<Vec<(RadialProfile, RadialProfile)>>,
    pub(super) thickness_mm: Vec<f64>,
    /// Slabs of other thicknesses.
    pub(super) further: Vec<Slab>,
    pub(super) refractive_index: f64,
    pub(super) notes: String,
    pub(super) line: usize,
}

/// A measured slab: profiles and thickness per channel.
#[derive(Debug, Clone)]
pub(super) struct Slab {
    pub(super) profiles: Vec<(RadialProfile, RadialProfile)>,
    pub(super) thickness_mm: Vec<f64>,
}

impl Draft {
    /// Reads the table of a resin that comes after those in `earlier`.
    pub(super) fn read(
        mut keys: Keys<'_>,
        folder: &Folder<'_>,
        channels: &[String],
        earlier: &[Self],
    ) -> Result<Self, OpticsError> {
        if let Ok(Some(name)) = keys.string("name") {
            keys.prefix = format!("resin {}: ", name.value);
        }
        keys.allow_only(&RESIN_KEYS)?;
        let name = name(&keys)?;
        if earlier.iter().any(|other| other.name.to_lowercase() == name.value.to_lowercase()) {
            return Err(keys.wrong("name", &name, "a name no other resin has"));
        }
        let rgba = rgba(&keys)?;
        if let Some(other) = earlier.iter().find(|other| other.rgba == rgba.value) {
            let expected = format!("a colour other than that of {}", other.name);
            return Err(keys.error(rgba.at, "rgba", format!("{:?}", rgba.value), expected));
        }
        let density = keys.number("density-g-per-cm3")?;
        let density = density.ok_or_else(|| keys.missing("density-g-per-cm3", "a number"))?;
        if !DENSITY.contains(&density.value) {
            return Err(keys.wrong("density-g-per-cm3", &density, "0.1 to 25"));
        }
        let price = keys.number("price-per-kg")?;
        if let Some(price) = price.as_ref().filter(|price| !PRICE.contains(&price.value)) {
            return Err(keys.wrong("price-per-kg", price, "0 to 1000000"));
        }
        let background = background(&keys)?;
        if let (Some(text), Some(other)) = (&background, earlier.iter().find(|other| other.background)) {
            let expected = format!("one background resin at most, which {} is", other.name);
            return Err(keys.error(text.at, "print-as", "background", expected));
        }
        let background = background.is_some();
        if !background && rgba.value[3] != 255 {
            // Printers blend or reject what is not opaque.
            let expected = "alpha 255, or none, for a resin that is printed";
            return Err(keys.error(rgba.at, "rgba", format!("{:?}", rgba.value), expected));
        }
        let refractive_index = match keys.number("refractive-index")? {
            None => 1.0,
            Some(index) if (1.0..=MAX_REFRACTIVE_INDEX).contains(&index.value) => index.value,
            Some(index) => return Err(keys.wrong("refractive-index", &index, "1 to 3")),
        };
        let volume = volume(&keys, channels.len(), refractive_index)?;
        let mut further = slabs(&keys, folder, channels)?.into_iter();
        let own = profiles(&keys, folder, channels)?;
        let (profiles, own_thickness) = match own {
            Some(_) => (own, None),
            None => further.next().map(|first| (first.profiles, first.thickness_mm)).unzip(),
        };
        let further = further.collect();
        if volume.is_none() && profiles.is_none() {
            return Err(keys.missing(
                "scattering-per-mm",
                "coefficients, or measured profiles under `reflection` or [[resin.slab]]",
            ));
        }
        let given = thickness(&keys, channels.len())?;
        if given.is_some() && own_thickness.is_some() {
            return Err(keys.missing("reflection", "profiles of the slab whose thickness-mm is given"));
        }
        let thickness_mm = match (given.or(own_thickness), &volume) {
            (Some(given), _) => given,
            (None, Some(volume)) if profiles.is_none() => {
                volume.iter().map(VolumeCoefficients::representative_thickness_mm).collect()
            }
            (None, _) => return Err(keys.missing("thickness-mm", "the thickness of the slab whose profiles these are")),
        };
        let notes = keys.string("notes")?.map(|notes| notes.value).unwrap_or_default();
        let line = keys.line();
        let (name, rgba, density) = (name.value, rgba.value, density.value);
        Ok(Self {
            name,
            rgba,
            density,
            price: price.map(|price| price.value),
            background,
            volume,
            fit: None,
            profiles,
            thickness_mm,
            further,
            refractive_index,
            notes,
            line,
        })
    }

    /// What the user should know of that not every model takes into account.
    pub(super) fn warning(&self) -> Option<String> {
        (self.refractive_index != 1.0 && self.profiles.is_none()).then(|| {
            format!(
                "resin {}: refractive index {} counts in the models transport and monte-carlo; km assumes matched \
                    indices",
                self.name, self.refractive_index
            )
        })
    }

    /// Fits coefficients to the profiles of every channel, if there are none and each channel's are good enough; else
    /// says why not.
    pub(super) fn fit(&mut self, channels: &[String]) -> Result<(), String> {
        let (None, Some(profiles)) = (&self.volume, &self.profiles) else { return Ok(()) };
        let mut fits = Vec::with_capacity(channels.len());
        for (channel, name) in channels.iter().enumerate() {
            let first = (self.thickness_mm[channel], &profiles[channel]);
            let further = self.further.iter().map(|slab| (slab.thickness_mm[channel], &slab.profiles[channel]));
            let slabs: Vec<_> = std::iter::once(first)
                .chain(further)
                .map(|(thickness_mm, (reflection, transmission))| MeasuredSlab {
                    thickness_mm,
                    reflection,
                    transmission,
                })
                .collect();
            let fit = fit_coefficients(&slabs, self.refractive_index);
            fits.push(fit.map_err(|refusal| format!("resin {}, channel {name}: {refusal}", self.name))?);
        }
        self.volume = Some(fits.iter().map(|fit| fit.coefficients).collect());
        self.fit = Some(fits);
        Ok(())
    }
}

/// Names go into stackings (`white:2.0,…`) and file names.
pub(crate) fn is_name(name: &str) -> bool {
    name.starts_with(char::is_alphanumeric)
        && name.ends_with(|c: char| c.is_alphanumeric() || "-_+".contains(c))
        && name.chars().all(|c| c.is_alphanumeric() || " -_+.".contains(c))
        && name.len() <= MAX_FILE_NAME
        && !is_device_name(name)
}

/// A resin's name.
pub(crate) fn name<E: From<Fault>>(keys: &Table<'_, E>) -> Result<At<String>, E> {
    let name = keys.string("name")?.ok_or_else(|| keys.missing("name", "a name"))?;
    if !is_name(&name.value) {
        let expected = match name.value.as_str() {
            long if long.len() > MAX_FILE_NAME => format!("at most {MAX_FILE_NAME} bytes"),
            device if is_device_name(device) => "a name that Windows does not keep for a device".to_owned(),
            _ => "letters, digits, spaces, `-`, `_`, `+` or `.`, a letter or digit first, none of ` .` last".to_owned(),
        };
        return Err(keys.wrong("name", &name, &expected));
    }
    Ok(name)
}

/// Where `print-as` says background, if it does.
pub(crate) fn background<E: From<Fault>>(keys: &Table<'_, E>) -> Result<Option<At<String>>, E> {
    match keys.string("print-as")? {
        None => Ok(None),
        Some(text) if text.value == "resin" => Ok(None),
        Some(text) if text.value == "background" => Ok(Some(text)),
        Some(text) => Err(keys.wrong("print-as", &text, "\"background\" or \"resin\"")),
    }
}

pub(crate) fn rgba<E: From<Fault>>(keys: &Table<'_, E>) -> Result<At<[u8; 4]>, E> {
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
            return Err(keys.error(numbers.at, "rgba", format!("[{}]", found.join(", ")), expected));
        }
    };
    if value == [0; 4] {
        let expected = "any other colour: slices use this one for background";
        return Err(keys.error(numbers.at, "rgba", "[0, 0, 0, 0]", expected));
    }
    Ok(At { value, at: numbers.at })
}

fn volume(
    keys: &Keys<'_>,
    channels: usize,
    refractive_index: f64,
) -> Result<Option<Vec<VolumeCoefficients>>, OpticsError> {
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
        let matched = VolumeCoefficients::new(sigma_s.value, sigma_a.value, g.value);
        matched.map(|matched| matched.with_refractive_index(refractive_index)).map_err(|error| match error {
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
        let expected = "a resin that scatters or absorbs";
        return Err(keys.error(scattering[i].at, "scattering-per-mm", "0, and no absorption", expected));
    }
    Ok(Some(coefficients))
}

/// Thickness of a slab per channel.
fn thickness(keys: &Keys<'_>, channels: usize) -> Result<Option<Vec<f64>>, OpticsError> {
    let Some(given) = keys.per_channel("thickness-mm", channels)? else { return Ok(None) };
    if let Some(wrong) = given.iter().find(|t| !(t.value > 0.0 && t.value <= MAX_THICKNESS_MM)) {
        return Err(keys.wrong("thickness-mm", wrong, "more than 0, at most 100"));
    }
    Ok(Some(given.iter().map(|thickness| thickness.value).collect()))
}

/// The [[resin.slab]] tables.
fn slabs(keys: &Keys<'_>, folder: &Folder<'_>, channels: &[String]) -> Result<Vec<Slab>, OpticsError> {
    const TABLES: &str = "[[resin.slab]] tables";
    let Some(value) = keys.get("slab") else { return Ok(Vec::new()) };
    let one = |(index, item): (usize, Value<'_, OpticsError>)| {
        let keys = item.table_as(format!("{}slab {}: ", keys.prefix, index + 1), TABLES)?;
        keys.allow_only(&SLAB_KEYS)?;
        let profiles = profiles(&keys, folder, channels)?;
        let profiles = profiles.ok_or_else(|| keys.missing("reflection", "the slab's profiles"))?;
        let thickness_mm = thickness(&keys, channels.len())?;
        let thickness_mm = thickness_mm.ok_or_else(|| keys.missing("thickness-mm", "the slab's thickness"))?;
        Ok(Slab { profiles, thickness_mm })
    };
    value.list(TABLES)?.into_iter().enumerate().map(one).collect()
}

fn profiles(
    keys: &Keys<'_>,
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
