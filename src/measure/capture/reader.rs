//! A table of a capture file, its numbers' bounds, and the headers of the pictures it names.

use std::path::{Path, PathBuf};

use super::Camera;
use crate::measure::MeasureError;
use crate::measure::frame::{self, ColourPlane, Header};
use crate::toml_reader::Table;

pub(super) type Result<T> = std::result::Result<T, MeasureError>;

/// Bounds that catch slips of unit.
pub(super) mod bounds {
    use std::ops::RangeInclusive;
    pub(in super::super) const LEVEL: RangeInclusive<f64> = -1e6..=1e9;
    pub(in super::super) const GAIN: RangeInclusive<f64> = 1e-4..=1e7;
    pub(in super::super) const READ_NOISE: RangeInclusive<f64> = 0.0..=1e4;
    pub(in super::super) const MM_PER_PIXEL: RangeInclusive<f64> = 1e-4..=5.0;
    pub(in super::super) const DISTANCE: RangeInclusive<f64> = 5.0..=1e4;
    pub(in super::super) const BIN: RangeInclusive<f64> = 1e-3..=5.0;
    pub(in super::super) const APERTURE: RangeInclusive<f64> = 1e-4..=10.0;
    pub(in super::super) const SECONDS: RangeInclusive<f64> = 1e-6..=1e5;
    pub(in super::super) const SHARE: RangeInclusive<f64> = 0.0..=1.0;
    pub(in super::super) const RULER: RangeInclusive<f64> = 0.1..=1e4;
    pub(in super::super) const PIXEL: RangeInclusive<f64> = 0.0..=1e6;
}

/// A table of the file and where its pictures are.
pub(super) struct Reader<'a> {
    pub(super) keys: Table<'a, MeasureError>,
    pub(super) folder: &'a Path,
}

impl<'a> Reader<'a> {
    /// The table under `name`, none of whose keys is unknown.
    pub(super) fn table(&self, name: &str, known: &[&str]) -> Result<Option<Reader<'a>>> {
        let Some(value) = self.keys.get(name) else { return Ok(None) };
        let keys = value.table_as(format!("{}{name}.", self.keys.prefix), &format!("a table [{name}]"))?;
        keys.allow_only(known)?;
        Ok(Some(Reader { keys, folder: self.folder }))
    }

    pub(super) fn require(&self, name: &str, known: &[&str]) -> Result<Reader<'a>> {
        let missing = || self.keys.missing(name, &format!("a table [{name}]"));
        self.table(name, known)?.ok_or_else(missing)
    }

    pub(super) fn number(&self, key: &str, range: std::ops::RangeInclusive<f64>) -> Result<Option<f64>> {
        match self.keys.number(key)? {
            Some(number) if !range.contains(&number.value) => {
                let expected = format!("a number of {} to {}", range.start(), range.end());
                Err(self.keys.wrong(key, &number, &expected))
            }
            number => Ok(number.map(|number| number.value)),
        }
    }

    pub(super) fn require_number(&self, key: &str, range: std::ops::RangeInclusive<f64>) -> Result<f64> {
        let expected = format!("a number of {} to {}", range.start(), range.end());
        self.number(key, range)?.ok_or_else(|| self.keys.missing(key, &expected))
    }

    /// Where `key` stands, for complaints about its value.
    fn at(&self, key: &str) -> usize {
        self.keys.get(key).map_or(self.keys.start, |value| value.start())
    }

    pub(super) fn refuse<T>(&self, key: &str, found: impl Into<String>, expected: impl Into<String>) -> Result<T> {
        Err(self.keys.error(self.at(key), key, found, expected))
    }
}

/// What the pictures of a series have in common.
pub(super) struct Headers<'a> {
    pub(super) first: Option<(PathBuf, usize, usize)>,
    pub(super) planes: &'a [ColourPlane],
    pub(super) camera: &'a Camera,
}

impl Headers<'_> {
    /// The header of a picture that fits those before it.
    pub(super) fn check(&mut self, file: &Path) -> Result<Header> {
        let header = frame::header(file)?;
        if let Some(curve) = header.curve.as_ref().filter(|_| !self.camera.linear) {
            let expected = "values proportional to light (`linear = true` under [camera] vouches for them)";
            return Err(MeasureError::frame(file, curve.clone(), expected));
        }
        if !header.colour && self.planes.len() > 1 {
            return Err(MeasureError::frame(file, "a grey picture", "colours, as [camera] `channels` asks for"));
        }
        let (name, width, height) = self.first.get_or_insert_with(|| (file.to_path_buf(), header.width, header.height));
        if (*width, *height) != (header.width, header.height) {
            let found = format!("{} × {} pixels", header.width, header.height);
            return Err(MeasureError::frame(file, found, format!("{width} × {height} as {}", name.display())));
        }
        Ok(header)
    }
}
