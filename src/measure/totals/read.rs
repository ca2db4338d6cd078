//! Reading sheets: a TOML file with the resin and the instrument, and a CSV table of the values. `docs/measure.md`
//! lists every key and column.

use std::path::Path;

use super::observer;
use crate::measure::MeasureError;
use crate::optics::resin_table::{DENSITY, MAX_THICKNESS_MM, background, name, rgba};
use crate::optics::{Light, MAX_REFRACTIVE_INDEX, OpticsError};
use crate::toml_reader::{Found, Source, Table};

type Result<T> = std::result::Result<T, MeasureError>;

const TOP_KEYS: [&str; 3] = ["resin", "instrument", "samples"];
const RESIN_KEYS: [&str; 7] = ["name", "rgba", "density-g-per-cm3", "refractive-index", "g", "print-as", "notes"];
const INSTRUMENT_KEYS: [&str; 6] =
    ["model", "light", "specular", "relative-error", "absolute-error", "calibration-error"];
const SAMPLES_KEYS: [&str; 2] = ["file", "channels"];
const COLUMNS: [&str; 6] = ["sample", "thickness_mm", "backing", "wavelength_nm", "reflectance", "transmittance"];
/// Repeatability of spectrophotometers.
const RELATIVE_ERROR: f64 = 0.005;
const ABSOLUTE_ERROR: f64 = 5e-4;
/// Of the standards that reflectance is calibrated with.
const CALIBRATION_ERROR: f64 = 0.005;
/// Spectra that are turned into colours reach at least so far, nm.
const SPECTRUM: [f64; 2] = [420.0, 680.0];
/// Widest gap in them, nm: what lies within is a straight line.
const MAX_GAP_NM: f64 = 25.0;
/// What values are.
const SHARE: &str = "a share of the light and not percent (or an empty cell)";
/// Largest table accepted, bytes.
const MAX_BYTES: u64 = 16 << 20;

/// What was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Totals {
    /// The resin.
    pub resin: SheetResin,
    /// What measured it.
    pub instrument: Instrument,
    /// Names of the channels.
    pub channels: Vec<String>,
    /// The sheets.
    pub sheets: Vec<Sheet>,
    /// What was noticed in the table.
    pub remarks: Vec<String>,
}

/// What is known of the resin beside its light.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetResin {
    /// Its name.
    pub name: String,
    /// Its colour in slices.
    pub rgba: [u8; 4],
    /// Density.
    pub density_g_per_cm3: f64,
    /// Refractive index, 1 or more.
    pub refractive_index: f64,
    /// Mean cosine of scattering, assumed.
    pub g: f64,
    /// Whether it prints as background.
    pub print_as_background: bool,
    /// Anything worth knowing.
    pub notes: String,
}

/// How values were measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Instrument {
    /// Its name.
    pub model: String,
    /// The light: a beam along the normal, or from all sides.
    pub light: Light,
    /// Whether reflectance includes what the surface mirrors.
    pub specular: bool,
    /// One standard deviation of a value as a share of it…
    pub relative_error: f64,
    /// …and as a share of the light.
    pub absolute_error: f64,
    /// One standard deviation of what all reflectances may be off by together, as a share of them.
    pub calibration_error: f64,
}

impl Instrument {
    /// One standard deviation of a value.
    pub fn error_of(&self, value: f64) -> f64 {
        libm::hypot(self.relative_error * value, self.absolute_error)
    }
}

/// One sheet as measured, one value per channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Its thickness.
    pub thickness_mm: f64,
    /// Reflectance of what lies below, under a film of air; nothing if `None`.
    pub backing: Option<Vec<f64>>,
    /// Share that comes back.
    pub reflectance: Option<Vec<f64>>,
    /// Share that comes through.
    pub transmittance: Option<Vec<f64>>,
}

/// How spectra become channels.
#[derive(Clone, Copy, PartialEq)]
enum Channels {
    Rgb,
    Wavelengths,
}

pub(super) fn totals(path: &Path) -> Result<Totals> {
    let text = text(path, 1 << 20)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let source = Source::new(path, folder, &text, Found::ByType);
    let document = source.parse()?;
    let top: Table<'_, MeasureError> = Table::root(&source, &document);
    top.allow_only(&TOP_KEYS)?;
    let table = |name: &str, known: &[&str]| {
        let expected = format!("a table [{name}]");
        let table = top.require(name, &expected)?.table_as(format!("{name}."), &expected)?;
        table.allow_only(known)?;
        Ok::<_, MeasureError>(table)
    };
    let resin = resin(&table("resin", &RESIN_KEYS)?)?;
    let instrument = instrument(&table("instrument", &INSTRUMENT_KEYS)?)?;
    let samples = table("samples", &SAMPLES_KEYS)?;
    let file = samples.string("file")?.ok_or_else(|| samples.missing("file", "a CSV table of the values"))?;
    let channels = match samples.string("channels")? {
        None => Channels::Rgb,
        Some(text) if text.value == "rgb" => Channels::Rgb,
        Some(text) if text.value == "wavelengths" => Channels::Wavelengths,
        Some(text) => return Err(samples.wrong("channels", &text, "\"rgb\" or \"wavelengths\"")),
    };
    let (channels, sheets, remarks) = read_table(&folder.join(file.value), channels)?;
    Ok(Totals { resin, instrument, channels, sheets, remarks })
}

fn text(path: &Path, most: u64) -> Result<String> {
    let disk = |source| OpticsError::File { file: path.to_path_buf(), source };
    let size = std::fs::metadata(path).map_err(disk)?.len();
    if size > most {
        return Err(MeasureError::frame(path, format!("{size} bytes"), format!("at most {most}")));
    }
    let text = crate::regular_file::read_text(path).map_err(disk)?;
    // Spreadsheets write a mark of byte order before UTF-8.
    Ok(match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    })
}

fn number(
    keys: &Table<'_, MeasureError>,
    key: &str,
    range: std::ops::RangeInclusive<f64>,
    default: Option<f64>,
) -> Result<f64> {
    let expected = format!("a number of {} to {}", range.start(), range.end());
    match (keys.number(key)?, default) {
        (Some(found), _) if !range.contains(&found.value) => Err(keys.wrong(key, &found, &expected)),
        (Some(found), _) => Ok(found.value),
        (None, Some(default)) => Ok(default),
        (None, None) => Err(keys.missing(key, &expected)),
    }
}

fn resin(keys: &Table<'_, MeasureError>) -> Result<SheetResin> {
    let name = name(keys)?.value;
    let print_as_background = background(keys)?.is_some();
    Ok(SheetResin {
        name,
        rgba: rgba(keys)?.value,
        density_g_per_cm3: number(keys, "density-g-per-cm3", DENSITY, None)?,
        // Sheets are seen in air: an index left out would be a mistake of 4% in reflectance alone.
        refractive_index: number(keys, "refractive-index", 1.0..=MAX_REFRACTIVE_INDEX, None)?,
        g: number(keys, "g", -0.5..=0.95, Some(0.5))?,
        print_as_background,
        notes: keys.string("notes")?.map(|notes| notes.value).unwrap_or_default(),
    })
}

fn instrument(keys: &Table<'_, MeasureError>) -> Result<Instrument> {
    let light = match keys.string("light")? {
        Some(text) if text.value == "normal" => Light::Normal,
        Some(text) if text.value == "diffuse" => Light::Diffuse,
        Some(text) => return Err(keys.wrong("light", &text, "\"normal\" (a beam) or \"diffuse\" (from all sides)")),
        None => return Err(keys.missing("light", "\"normal\" (a beam) or \"diffuse\" (from all sides)")),
    };
    let specular = match keys.string("specular")? {
        Some(text) if text.value == "included" => true,
        Some(text) if text.value == "excluded" => false,
        Some(text) => return Err(keys.wrong("specular", &text, "\"included\" or \"excluded\"")),
        None => return Err(keys.missing("specular", "\"included\" or \"excluded\"")),
    };
    Ok(Instrument {
        model: keys.string("model")?.map_or("not stated".into(), |model| model.value),
        light,
        specular,
        relative_error: number(keys, "relative-error", 1e-5..=0.5, Some(RELATIVE_ERROR))?,
        absolute_error: number(keys, "absolute-error", 1e-6..=0.5, Some(ABSOLUTE_ERROR))?,
        calibration_error: number(keys, "calibration-error", 0.0..=0.5, Some(CALIBRATION_ERROR))?,
    })
}

/// A cell without the quotation marks that spreadsheets put around it.
fn unquoted(cell: &str) -> &str {
    cell.trim().trim_matches('"').trim()
}

/// A line of the table.
struct Row {
    line: usize,
    sample: String,
    thickness_mm: f64,
    wavelength_nm: Option<f64>,
    /// Backing, reflectance, transmittance.
    values: [Option<f64>; 3],
}

fn read_table(path: &Path, channels: Channels) -> Result<(Vec<String>, Vec<Sheet>, Vec<String>)> {
    let fault = |line: usize, element: &str, found: String, expected: &str| -> MeasureError {
        let (element, expected) = (element.to_owned(), expected.to_owned());
        OpticsError::Entry { file: path.to_path_buf(), line: Some(line), element, found, expected }.into()
    };
    let text = text(path, MAX_BYTES)?;
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let Some((first, header)) = lines.next() else {
        return Err(fault(1, "header", "nothing".into(), "names of columns"));
    };
    let apart = [(';', "semicolons"), ('\t', "tabs")];
    if let Some((_, apart)) = apart.into_iter().find(|(sign, _)| header.contains(*sign)) {
        return Err(fault(first, "header", format!("columns apart by {apart}"), "commas, and numbers with a point"));
    }
    let header = header.to_ascii_lowercase();
    let header: Vec<&str> = header.split(',').map(unquoted).collect();
    if let Some(unknown) = header.iter().find(|name| !COLUMNS.contains(name)) {
        let expected = format!("one of: {}", COLUMNS.join(", "));
        return Err(fault(first, "header", crate::words::excerpt(unknown), &expected));
    }
    if let Some((_, twice)) = header.iter().enumerate().find(|(i, name)| header[..*i].contains(name)) {
        return Err(fault(first, "header", format!("{twice} twice"), "every column once"));
    }
    let column = |name: &str| header.iter().position(|column| *column == name);
    if column("thickness_mm").is_none() || column("reflectance").or(column("transmittance")).is_none() {
        let expected = "thickness_mm, and reflectance or transmittance or both";
        return Err(fault(first, "header", header.join(", "), expected));
    }
    if column("wavelength_nm").is_some() && column("sample").is_none() {
        return Err(fault(
            first,
            "header",
            "no sample".into(),
            "a column that names the sample a wavelength belongs to",
        ));
    }
    let mut rows = Vec::new();
    for (line, content) in lines {
        let cells: Vec<&str> = content.split(',').map(unquoted).collect();
        if cells.len() != header.len() {
            let expected = format!("{} cells as the header; numbers have a point, no comma", header.len());
            return Err(fault(line, "row", format!("{} cells", cells.len()), &expected));
        }
        let value = |name: &str, what: &str, range: std::ops::RangeInclusive<f64>| {
            let Some(cell) = column(name).map(|i| cells[i]).filter(|cell| !cell.is_empty()) else { return Ok(None) };
            let number = cell.parse::<f64>().ok().filter(|value| range.contains(value));
            let expected = format!("{what}, {} to {}", range.start(), range.end());
            number.map(Some).ok_or_else(|| fault(line, name, crate::words::excerpt(cell), &expected))
        };
        let missing = |name: &str| fault(line, name, "nothing".into(), "a number");
        let values = ["backing", "reflectance", "transmittance"];
        let [backing, reflectance, transmittance] = values.map(|name| value(name, SHARE, 0.0..=1.0));
        let (backing, reflectance, transmittance) = (backing?, reflectance?, transmittance?);
        let wavelength_nm = value("wavelength_nm", "nm", 200.0..=2500.0)?;
        if column("wavelength_nm").is_some() && wavelength_nm.is_none() {
            return Err(missing("wavelength_nm"));
        }
        let both = reflectance.unwrap_or(0.0) + transmittance.unwrap_or(0.0);
        if both > 1.0 + 0.02 && backing.is_none_or(|backing| backing == 0.0) {
            let found = format!("{both:.3} of the light");
            return Err(fault(line, "reflectance + transmittance", found, "at most 1: shares, not percent"));
        }
        rows.push(Row {
            line,
            sample: column("sample").map_or_else(|| line.to_string(), |i| cells[i].to_owned()),
            thickness_mm: value("thickness_mm", "mm", 1e-3..=MAX_THICKNESS_MM)?
                .ok_or_else(|| missing("thickness_mm"))?,
            wavelength_nm,
            values: [backing, reflectance, transmittance],
        });
    }
    if rows.is_empty() {
        return Err(fault(first, "table", "no row".into(), "one row for every sheet"));
    }
    // Rows of one sample are one sheet, in their order.
    let mut samples: Vec<Vec<Row>> = Vec::new();
    for row in rows {
        match samples.iter_mut().find(|sample| sample[0].sample == row.sample) {
            Some(sample) => sample.push(row),
            None => samples.push(vec![row]),
        }
    }
    let mut names: Option<Vec<String>> = None;
    let (mut sheets, mut remarks) = (Vec::new(), Vec::new());
    for sample in &mut samples {
        sample.sort_by(|a, b| a.wavelength_nm.unwrap_or(0.0).total_cmp(&b.wavelength_nm.unwrap_or(0.0)));
        let first = &sample[0];
        for pair in sample.windows(2) {
            if pair[0].wavelength_nm == pair[1].wavelength_nm {
                let found = format!("two rows of sample {}", crate::words::excerpt(&pair[1].sample));
                let expected = match pair[1].wavelength_nm {
                    Some(_) => "one for every wavelength",
                    None => "one: over another backing it is another sample",
                };
                return Err(fault(pair[1].line, "row", found, expected));
            }
            if pair[0].thickness_mm != pair[1].thickness_mm {
                let found = pair[1].thickness_mm.to_string();
                let expected = format!("{} as in the sample's other rows", pair[0].thickness_mm);
                return Err(fault(pair[1].line, "thickness_mm", found, &expected));
            }
        }
        let own: Vec<String> = match first.wavelength_nm {
            None => vec!["Y".into()],
            Some(_) if channels == Channels::Rgb => ["R", "G", "B"].map(String::from).to_vec(),
            Some(_) => sample.iter().filter_map(|row| row.wavelength_nm).map(|nm| format!("{nm}nm")).collect(),
        };
        if names.get_or_insert_with(|| own.clone()) != &own {
            return Err(fault(first.line, "wavelength_nm", own.join(", "), "the same wavelengths for every sample"));
        }
        let mut per_channel = [None, None, None];
        for (which, per_channel) in per_channel.iter_mut().enumerate() {
            let known = sample.iter().filter(|row| row.values[which].is_some()).count();
            if known == 0 {
                continue;
            }
            if known < sample.len() {
                let element = ["backing", "reflectance", "transmittance"][which];
                return Err(fault(first.line, element, "some wavelengths without a value".into(), "all, or none"));
            }
            let points: Vec<(f64, f64)> =
                sample.iter().filter_map(|row| Some((row.wavelength_nm.unwrap_or(0.0), row.values[which]?))).collect();
            *per_channel = Some(match (first.wavelength_nm, channels) {
                (Some(_), Channels::Rgb) => {
                    let ends = [points[0].0, points[points.len() - 1].0];
                    if ends[0] > SPECTRUM[0] || ends[1] < SPECTRUM[1] {
                        let found = format!("a spectrum of {} to {} nm", ends[0], ends[1]);
                        let expected = "420 to 680 nm at least, better 380 to 730";
                        return Err(fault(first.line, "wavelength_nm", found, expected));
                    }
                    let gap = points.windows(2).find(|pair| {
                        let seen = pair[1].0 > SPECTRUM[0] && pair[0].0 < SPECTRUM[1];
                        seen && pair[1].0 - pair[0].0 > MAX_GAP_NM
                    });
                    if let Some([(from, _), (to, _)]) = gap {
                        let found = format!("nothing between {from} and {to} nm");
                        let expected = "a value every 25 nm at least; or channels = \"wavelengths\"";
                        return Err(fault(first.line, "wavelength_nm", found, expected));
                    }
                    let rgb = observer::rgb(&points);
                    if let Some(outside) = rgb.iter().find(|value| !(0.0..=1.0).contains(*value)) {
                        let expected = "0 to 1: so pure a colour lies outside of sRGB; use channels = \"wavelengths\"";
                        return Err(fault(first.line, "rgb", format!("{outside:.3}"), expected));
                    }
                    rgb.to_vec()
                }
                _ => points.iter().map(|point| point.1).collect(),
            });
        }
        let [backing, reflectance, transmittance] = per_channel;
        if reflectance.is_none() && transmittance.is_none() {
            return Err(fault(first.line, "row", "neither".into(), "reflectance or transmittance"));
        }
        sheets.push(Sheet { thickness_mm: first.thickness_mm, backing, reflectance, transmittance });
    }
    let names = names.unwrap_or_default();
    if names.len() == 3 && names[0] == "R" {
        remarks.push(format!("spectra were integrated to red, green and blue by {}", observer::NAME));
    }
    Ok((names, sheets, remarks))
}
