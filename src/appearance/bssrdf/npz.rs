//! A dataset in one `.npz`, as `numpy.savez` writes it: the arrays `responses` and, where known, `albedo` and `mask`;
//! the numbers `pitch_mm`, `noise_floor_per_mm2`, `noise_gain_per_mm2`.
//!
//! An archive cannot be read from the middle where it is compressed, so the responses are unpacked into a temporary
//! file once.

use std::{
    fs::File,
    io::{self, BufReader, Read, Write},
    path::Path,
};

use tempfile::NamedTempFile;
use zip::{ZipArchive, result::ZipError};

use super::{
    BssrdfError,
    dataset::{Array, Noise, Parts},
    header::{array_from, npy_fault, truncated},
    npy::NpyHeader,
    responses::Responses,
};

type Archive = ZipArchive<BufReader<File>>;

/// Reads an archive.
pub(super) fn read(file: &Path) -> Result<Parts, BssrdfError> {
    let opened =
        crate::regular_file::open(file).map_err(|source| BssrdfError::Read { file: file.to_path_buf(), source })?;
    let mut archive = ZipArchive::new(BufReader::new(opened)).map_err(|error| zip_fault(file, "archive", &error))?;
    let pitch_mm = number(&mut archive, file, "pitch_mm")?
        .ok_or_else(|| missing(file, "pitch_mm", "the distance of two texels in mm"))?;
    let floor = number(&mut archive, file, "noise_floor_per_mm2")?;
    let gain = number(&mut archive, file, "noise_gain_per_mm2")?;
    let noise = (floor.is_some() || gain.is_some())
        .then(|| Noise { floor_per_mm2: floor.unwrap_or(0.0), gain_per_mm2: gain.unwrap_or(0.0) });
    let albedo = array(&mut archive, file, "albedo")?;
    let mask = array(&mut archive, file, "mask")?;
    let (responses, header) = unpack(&mut archive, file)?;
    Ok(Parts { file: file.to_path_buf(), pitch_mm, channels: None, noise, responses, header, albedo, mask })
}

fn missing(file: &Path, name: &str, expected: &str) -> BssrdfError {
    let (place, found) = (name.to_owned(), "no such array".to_owned());
    BssrdfError::Entry { file: file.to_path_buf(), place, found, expected: expected.into() }
}

fn zip_fault(file: &Path, place: &str, error: &ZipError) -> BssrdfError {
    BssrdfError::Entry {
        file: file.to_path_buf(),
        place: place.into(),
        found: error.to_string(),
        expected: "an archive as numpy.savez writes it".into(),
    }
}

fn array(archive: &mut Archive, file: &Path, name: &str) -> Result<Option<Array>, BssrdfError> {
    match archive.by_name(&format!("{name}.npy")) {
        Ok(mut member) => array_from(&mut member, file, name).map(Some),
        Err(ZipError::FileNotFound) => Ok(None),
        Err(error) => Err(zip_fault(file, name, &error)),
    }
}

fn number(archive: &mut Archive, file: &Path, name: &str) -> Result<Option<f64>, BssrdfError> {
    let Some(array) = array(archive, file, name)? else { return Ok(None) };
    match array.values.as_slice() {
        // Stored as a double, read as a float: the shortest decimal of the float is what was meant.
        [value] => Ok(Some(value.to_string().parse().unwrap_or(f64::from(*value)))),
        _ => Err(BssrdfError::Entry {
            file: file.to_path_buf(),
            place: name.into(),
            found: format!("{} numbers", array.values.len()),
            expected: "one".into(),
        }),
    }
}

/// Largest array of responses that is unpacked, bytes: an archive of a few megabytes can hold terabytes of zeros.
const MAX_UNPACKED: u64 = 16 << 30;

/// Unpacks the responses.
fn unpack(archive: &mut Archive, file: &Path) -> Result<(Responses, NpyHeader), BssrdfError> {
    const NAME: &str = "responses";
    let mut member = match archive.by_name("responses.npy") {
        Ok(member) => member,
        Err(ZipError::FileNotFound) => return Err(missing(file, NAME, "the response windows")),
        Err(error) => return Err(zip_fault(file, NAME, &error)),
    };
    let mut header = NpyHeader::read(&mut member).map_err(|error| npy_fault(file, NAME, error))?;
    header.start = 0;
    let expected = header.value_bytes();
    if expected > MAX_UNPACKED {
        return Err(BssrdfError::Entry {
            file: file.to_path_buf(),
            place: NAME.into(),
            found: format!("an array of shape {:?}, {expected} bytes", header.shape),
            expected: format!("at most {MAX_UNPACKED} bytes; a .npy of its own may hold more"),
        });
    }
    let mut scratch = Scratch::new()?;
    let mut buffer = vec![0; 1 << 20];
    let mut done = 0;
    // What follows the values is not looked at, however much it is.
    let mut member = member.take(expected);
    loop {
        let count =
            member.read(&mut buffer).map_err(|source| BssrdfError::Read { file: file.to_path_buf(), source })?;
        if count == 0 {
            break;
        }
        scratch.write(&buffer[..count])?;
        done += count as u64;
    }
    if done < expected {
        return Err(truncated(file, NAME, done, expected));
    }
    Ok((scratch.responses(header.clone())?, header))
}

/// A temporary file being filled.
pub(super) struct Scratch(io::BufWriter<NamedTempFile>);

impl Scratch {
    pub(super) fn new() -> Result<Self, BssrdfError> {
        let file = NamedTempFile::with_prefix("lumislice-").map_err(Self::fault)?;
        Ok(Self(io::BufWriter::new(file)))
    }

    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<(), BssrdfError> {
        self.0.write_all(bytes).map_err(Self::fault)
    }

    pub(super) fn write_values(&mut self, values: &[f32]) -> Result<(), BssrdfError> {
        values.iter().try_for_each(|value| self.write(&value.to_le_bytes()))
    }

    pub(super) fn responses(self, header: NpyHeader) -> Result<Responses, BssrdfError> {
        let file = self.0.into_inner().map_err(|error| Self::fault(error.into_error()))?;
        Ok(Responses::new(file.path().to_path_buf(), header, Some(file)))
    }

    fn fault(source: io::Error) -> BssrdfError {
        BssrdfError::Scratch { folder: std::env::temp_dir(), source }
    }
}
