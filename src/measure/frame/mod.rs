//! Pictures as planes of numbers proportional to light.
//!
//! **In:** a file: 16-bit PNG or TIFF, EXR and, with the feature `raw`, a camera's raw file. **Out:** its [`Header`]
//! without decoding it, or the planes asked for. Eight bits and JPEG are refused: their values are coarse, curved and
//! lossy.

mod container;
mod exif;
mod exr_file;
mod png_file;
#[cfg(feature = "raw")]
mod raw_file;
mod tiff_file;

use std::path::Path;

use super::MeasureError;
use crate::machine::{self, Shortage};
use container::Container;

/// A plane of a picture. A grey picture has one plane, whatever it is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColourPlane {
    /// Red.
    Red,
    /// Green; of a raw mosaic the mean of its two greens.
    Green,
    /// Blue.
    Blue,
}

impl ColourPlane {
    /// R, G or B.
    pub fn letter(self) -> char {
        ['R', 'G', 'B'][self.index()]
    }

    /// The plane of this letter.
    pub fn from_letter(letter: &str) -> Option<Self> {
        [Self::Red, Self::Green, Self::Blue].into_iter().find(|plane| letter == plane.letter().to_string())
    }

    fn index(self) -> usize {
        self as usize
    }
}

/// What a file says about its picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// Columns of a plane.
    pub width: usize,
    /// Rows of a plane.
    pub height: usize,
    /// Whether it has colours.
    pub colour: bool,
    /// Largest value the file can hold; infinite for floating point.
    pub largest: f64,
    /// Exposure time, s, where the file tells.
    pub exposure_s: Option<f64>,
    /// Value of no light, where the file tells.
    pub black_level: Option<f64>,
    /// Value at which the sensor is full, where the file tells.
    pub saturation_level: Option<f64>,
    /// Words for an encoding that is not linear, where the file claims one.
    pub curve: Option<String>,
}

/// Numbers of one colour, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width · height` values in the file's numbers.
    pub values: Vec<f32>,
}

impl Plane {
    /// A plane of zeros.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, values: vec![0.0; width * height] }
    }

    /// The value at a column and row.
    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// The part that starts at (x, y), cut off at the border.
    pub fn crop(&self, x: usize, y: usize, width: usize, height: usize) -> Self {
        let (width, height) = (width.min(self.width - x), height.min(self.height - y));
        let rows = (y..y + height).flat_map(|row| &self.values[row * self.width + x..][..width]);
        Self { width, height, values: rows.copied().collect() }
    }
}

/// Most pixels of a picture: the largest sensors of cameras have 151 million. A plane of so many takes 1 GiB.
const MAX_PIXELS: usize = 1 << 28;

/// Reads what the file says about its picture.
///
/// # Errors
/// [`MeasureError::Read`], or [`MeasureError::Frame`] for a file of another kind, a damaged one, one of eight bits, or
/// more pixels than any camera has.
pub fn header(path: &Path) -> Result<Header, MeasureError> {
    let mut header = Container::of(path)?.header(path)?;
    if header.exposure_s.is_none() {
        header.exposure_s = exif::exposure_s(path);
    }
    Ok(header)
}

/// Decodes the planes asked for, in their order.
///
/// # Errors
/// As [`header`]; colours asked of a grey picture; more pixels of these planes than the machine has memory for
/// (decoding may take more).
pub fn planes(path: &Path, wanted: &[ColourPlane]) -> Result<Vec<Plane>, MeasureError> {
    let container = Container::of(path)?;
    // Before room is made for any pixel.
    let Header { width, height, .. } = container.header(path)?;
    if let Some(Shortage { needs, expected }) = machine::short_of((4 * wanted.len() * width * height) as u64) {
        return Err(MeasureError::frame(path, format!("{width} × {height} pixels, {needs}"), expected));
    }
    match container {
        Container::Png => png_file::planes(path, wanted),
        Container::Tiff => tiff_file::planes(path, wanted),
        Container::Exr => exr_file::planes(path, wanted),
        #[cfg(feature = "raw")]
        Container::Raw => raw_file::planes(path, wanted),
    }
}

impl Container {
    /// What the file says itself.
    fn header(&self, path: &Path) -> Result<Header, MeasureError> {
        let header = match self {
            Self::Png => png_file::header(path),
            Self::Tiff => tiff_file::header(path),
            Self::Exr => exr_file::header(path),
            #[cfg(feature = "raw")]
            Self::Raw => raw_file::header(path),
        }?;
        let Header { width, height, .. } = header;
        if width.saturating_mul(height) > MAX_PIXELS {
            let expected = format!("at most {} million", MAX_PIXELS / 1_000_000);
            return Err(MeasureError::frame(path, format!("{width} × {height} pixels"), expected));
        }
        Ok(header)
    }
}

/// Spreads rows of interleaved samples over planes.
struct Unweaver<'a> {
    planes: Vec<Plane>,
    wanted: &'a [ColourPlane],
    samples: usize,
}

impl<'a> Unweaver<'a> {
    /// For pictures of `samples` numbers a pixel, of which the first three are colours if there are three.
    fn new(width: usize, height: usize, samples: usize, wanted: &'a [ColourPlane]) -> Self {
        Self { planes: wanted.iter().map(|_| Plane::new(width, height)).collect(), wanted, samples }
    }

    /// One row; `value` reads the sample of an index.
    fn row(&mut self, y: usize, value: impl Fn(usize) -> f32) {
        for (plane, wanted) in self.planes.iter_mut().zip(self.wanted) {
            let offset = if self.samples >= 3 { wanted.index() } else { 0 };
            let row = &mut plane.values[y * plane.width..][..plane.width];
            row.iter_mut().enumerate().for_each(|(x, target)| *target = value(x * self.samples + offset));
        }
    }
}

#[cfg(test)]
mod tests;
