//! `dataset.toml`: where the arrays are and what their numbers mean.

use std::{
    io::{BufReader, Read},
    path::{Path, PathBuf},
};

use super::{
    BssrdfError,
    dataset::{Array, Noise, Parts},
    exr_rows, images,
    npy::{NpyError, NpyHeader},
    responses::Responses,
};
use crate::{
    toml_reader::{Fault, Found, IntRange, Problem, Source, Table, Value},
    words::{excerpt, one_line, suggest},
};

/// Name of the header in a dataset's folder.
pub const NAME: &str = "dataset.toml";
/// Version of the format.
pub const VERSION: u64 = 1;
/// Largest array read at once: an albedo of the largest dataset in double precision.
const MAX_ARRAY: u64 = 1 << 33;

const KEYS: [&str; 10] = [
    "version",
    "pitch-mm",
    "responses",
    "albedo",
    "mask",
    "channels",
    "noise-floor-per-mm2",
    "noise-gain-per-mm2",
    "window",
    "full-scale-per-mm2",
];
const VERSIONS: IntRange = IntRange { noun: "a version", min: 0, max: u32::MAX as u64 };
/// What is too large for us is refused once the responses are known.
const SIDE: IntRange = IntRange { noun: "a number of pixels", min: 0, max: u32::MAX as u64 };

struct Header {
    version: u64,
    pitch_mm: f64,
    responses: PathBuf,
    albedo: Option<PathBuf>,
    mask: Option<PathBuf>,
    channels: Option<Vec<String>>,
    noise_floor_per_mm2: Option<f64>,
    noise_gain_per_mm2: Option<f64>,
    window: Option<[usize; 2]>,
    full_scale_per_mm2: Option<f64>,
}

impl Header {
    fn parse(text: &str, file: &Path) -> Result<Self, BssrdfError> {
        let source = Source::new(file, file.parent().unwrap_or(Path::new("")), text, Found::AsWritten);
        let document = source.parse()?;
        let top = Table::<BssrdfError>::root(&source, &document);
        top.allow_only(&KEYS)?;
        let number = |key: &str| top.number(key).map(|found| found.map(|number| number.value));
        let path = |key: &str| top.string(key).map(|found| found.map(|path| PathBuf::from(path.value)));
        Ok(Self {
            version: top.require("version", "a version")?.integer(VERSIONS)?,
            pitch_mm: top.require("pitch-mm", "a distance in mm")?.placed_number("a distance in mm")?.value,
            responses: top.require("responses", "a path")?.text("a path")?.into(),
            albedo: path("albedo")?,
            mask: path("mask")?,
            channels: top.get("channels").map(names).transpose()?,
            noise_floor_per_mm2: number("noise-floor-per-mm2")?,
            noise_gain_per_mm2: number("noise-gain-per-mm2")?,
            window: top.get("window").map(window).transpose()?,
            full_scale_per_mm2: number("full-scale-per-mm2")?,
        })
    }
}

fn names(value: Value<'_, BssrdfError>) -> Result<Vec<String>, BssrdfError> {
    let expected = "an array of names";
    value.list(expected)?.iter().map(|name| Ok(name.text(expected)?.to_owned())).collect()
}

fn window(value: Value<'_, BssrdfError>) -> Result<[usize; 2], BssrdfError> {
    let expected = "[columns, rows]";
    let sides = value.list(expected)?;
    let [columns, rows] = sides.as_slice() else { return Err(value.refuse(expected)) };
    Ok([columns.integer(SIDE)? as usize, rows.integer(SIDE)? as usize])
}

impl From<Fault> for BssrdfError {
    fn from(Fault { path, place, key, problem }: Fault) -> Self {
        let line = format!("line {}", place.line);
        let header = "a header as docs/formats.md describes it".to_owned();
        let (place, found, expected) = match problem {
            Problem::Syntax(message) => (line, one_line(message), header),
            Problem::UnknownKey { name, known, .. } => {
                let hint = match suggest(&name, known.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("expected one of `{}`", known.join("`, `")),
                };
                (line, format!("unknown field `{}`, {hint}", excerpt(&name)), header)
            }
            Problem::Missing { .. } => (line, format!("missing field `{key}`"), header),
            Problem::Conflict { other } => (line, format!("`{key}` together with `{other}`"), header),
            Problem::Value { found, expected } => (format!("{line}: {key}"), found, expected),
        };
        Self::Entry { file: path, place, found, expected }
    }
}

/// Reads a header and the small arrays it names.
pub(super) fn read(file: &Path) -> Result<Parts, BssrdfError> {
    let text = crate::regular_file::read_text(file)
        .map_err(|source| BssrdfError::Read { file: file.to_path_buf(), source })?;
    let header = Header::parse(&text, file)?;
    if header.version != VERSION {
        return Err(BssrdfError::Entry {
            file: file.to_path_buf(),
            place: "version".into(),
            found: header.version.to_string(),
            expected: format!("{VERSION}"),
        });
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    let path = folder.join(&header.responses);
    let is_exr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    let (responses, found) = if path.is_dir() {
        images::unpack(&path, header.window, header.full_scale_per_mm2)?
    } else if is_exr {
        exr_rows::unpack(&path, header.window)?
    } else {
        let found = open_responses(&path)?;
        (Responses::new(path, found.clone(), None), found)
    };
    let array = |name: &str, path: Option<PathBuf>| path.map(|path| read_array(&folder.join(path), name)).transpose();
    let noise = match (header.noise_floor_per_mm2, header.noise_gain_per_mm2) {
        (None, None) => None,
        (floor, gain) => Some(Noise { floor_per_mm2: floor.unwrap_or(0.0), gain_per_mm2: gain.unwrap_or(0.0) }),
    };
    Ok(Parts {
        pitch_mm: header.pitch_mm,
        channels: header.channels,
        noise,
        responses,
        header: found,
        albedo: array("albedo", header.albedo)?,
        mask: array("mask", header.mask)?,
        file: file.to_path_buf(),
    })
}

/// The header of an array whose values are all there.
fn open_responses(path: &Path) -> Result<NpyHeader, BssrdfError> {
    let fault = |source| BssrdfError::Read { file: path.to_path_buf(), source };
    let file = crate::regular_file::open(path).map_err(fault)?;
    let size = file.metadata().map_err(fault)?.len();
    let header = NpyHeader::read(&mut BufReader::new(file)).map_err(|error| npy_fault(path, "header", error))?;
    if size < header.start + header.value_bytes() {
        return Err(truncated(path, "values", size, header.start + header.value_bytes()));
    }
    Ok(header)
}

pub(super) fn truncated(path: &Path, place: &str, found: u64, expected: u64) -> BssrdfError {
    BssrdfError::Entry {
        file: path.to_path_buf(),
        place: place.into(),
        found: format!("{found} bytes"),
        expected: format!("{expected}: the file is cut short"),
    }
}

/// Reads an array whole.
fn read_array(path: &Path, name: &str) -> Result<Array, BssrdfError> {
    let fault = |source| BssrdfError::Read { file: path.to_path_buf(), source };
    let file = crate::regular_file::open(path).map_err(fault)?;
    array_from(&mut BufReader::new(file), path, name)
}

/// Reads an array whole from an open file.
pub(super) fn array_from(input: &mut impl Read, file: &Path, name: &str) -> Result<Array, BssrdfError> {
    let header = NpyHeader::read(input).map_err(|error| npy_fault(file, name, error))?;
    let expected = header.value_bytes();
    let mut bytes = Vec::new();
    let read = input.take(expected.min(MAX_ARRAY)).read_to_end(&mut bytes);
    let found = read.map_err(|source| BssrdfError::Read { file: file.to_path_buf(), source })? as u64;
    if found < expected {
        return Err(truncated(file, name, found, expected));
    }
    let mut values = vec![0.0; bytes.len() / header.element.bytes()];
    header.decode(&bytes, &mut values);
    Ok(Array { file: file.to_path_buf(), name: name.into(), shape: header.shape, values })
}

pub(super) fn npy_fault(file: &Path, place: &str, error: NpyError) -> BssrdfError {
    match error {
        NpyError::Io(source) => BssrdfError::Read { file: file.to_path_buf(), source },
        NpyError::Format { found, expected } => {
            BssrdfError::Entry { file: file.to_path_buf(), place: place.into(), found, expected: expected.into() }
        }
    }
}
