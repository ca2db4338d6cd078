//! A capture: which pictures show what, taken how.
//!
//! **In:** `CAPTURE.toml`. **Out:** a [`Capture`] with every key known and in its range, every picture found, of one
//! size, linear, and with an exposure time; or one line that says where it is wrong. Only headers are read here.

mod albedo_table;
mod files;
mod read;
mod reader;

use std::path::{Path, PathBuf};

use super::MeasureError;
use super::frame::ColourPlane;

/// A resin's photographs, described.
#[derive(Debug, Clone, PartialEq)]
pub struct Capture {
    /// The capture file.
    pub path: PathBuf,
    /// What was photographed.
    pub resin: ResinFacts,
    /// When, in the user's words.
    pub date: String,
    /// Planes of the camera that are measured, at least one.
    pub planes: Vec<ColourPlane>,
    /// How it records.
    pub camera: Camera,
    /// Spacing of the profile, mm.
    pub bin_mm: f64,
    /// Light coming back.
    pub reflection: Series,
    /// Light coming through.
    pub transmission: Series,
}

/// What a material file says about a resin besides light.
#[derive(Debug, Clone, PartialEq)]
pub struct ResinFacts {
    /// Its name.
    pub name: String,
    /// Colour that stands for it in slices.
    pub rgba: [u8; 4],
    /// Density, g/cm³.
    pub density_g_per_cm3: f64,
    /// Whether it is printed by leaving a hole.
    pub print_as_background: bool,
    /// Thickness of the sample, mm.
    pub thickness_mm: f64,
    /// Refractive index, which photographs do not tell; 1 for index-matched.
    pub refractive_index: f64,
    /// Free text.
    pub notes: String,
}

/// How the camera turns light into numbers. What is `None` is estimated from the pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Model, in the user's words.
    pub model: String,
    /// Value of no light, in the numbers of the file (DN).
    pub black_level: Option<f64>,
    /// Value at which the sensor is full, DN.
    pub saturation_level: Option<f64>,
    /// Electrons per DN.
    pub gain_e_per_dn: Option<f64>,
    /// Standard deviation of reading, electrons.
    pub read_noise_e: Option<f64>,
    /// The user vouches that values are proportional to light, whatever the file says of its encoding.
    pub linear: bool,
}

/// A bracket of exposures under a point of light, and the dark one.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Projector pixel or pinhole on.
    pub frames: Vec<Exposure>,
    /// All projector pixels off; may be empty.
    pub dark: Vec<Exposure>,
    /// An even surface under even light, through the same lens: what its shading is told from.
    pub flat: Option<Exposure>,
    /// Shape of the light on the sample; `None` if it is not known.
    pub aperture: Option<Aperture>,
    /// Scale in the plane of the sample.
    pub mm_per_pixel: f64,
    /// From the lens to the sample, mm; tilt is told by perspective.
    pub camera_distance_mm: Option<f64>,
    /// What the profile integrates to.
    pub albedo: Albedo,
}

/// One picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposure {
    /// The file.
    pub file: PathBuf,
    /// Exposure time, s.
    pub seconds: f64,
}

/// The spot of light, of even brightness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aperture {
    /// A projector's pixel, its sides along the camera's rows and columns. Turned by an angle, its mean over rings is
    /// the same.
    Square {
        /// Length of a side, mm.
        side_mm: f64,
    },
    /// A pinhole.
    Disc {
        /// Diameter, mm.
        diameter_mm: f64,
    },
}

/// Where the albedo comes from, per plane where a picture says it.
#[derive(Debug, Clone, PartialEq)]
pub enum Albedo {
    /// Measured elsewhere: one value per plane.
    Given {
        /// Share of the light, 0 to 1.
        value: Vec<f64>,
        /// One standard deviation.
        error: f64,
    },
    /// Sample and a card of known albedo under even light, in one picture.
    GreyCard {
        /// The picture, if black is not told by the camera alone a dark one of the same exposure.
        picture: Exposure,
        /// A picture of the same exposure without light.
        dark: Option<Exposure>,
        /// Where the card is.
        card: Rect,
        /// Where the sample is.
        sample: Rect,
        /// Albedo of the card.
        card_albedo: f64,
        /// One standard deviation of it.
        card_error: f64,
    },
    /// A bright screen, seen with and without the sample.
    Screen {
        /// With the sample.
        with: Exposure,
        /// Without.
        without: Exposure,
        /// The spot that is compared.
        region: Rect,
    },
}

/// A part of a picture in pixels, left and top edges included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rect {
    /// Left edge.
    pub x: usize,
    /// Top edge.
    pub y: usize,
    /// Width.
    pub width: usize,
    /// Height.
    pub height: usize,
}

impl Capture {
    /// Reads and checks a capture file, and the headers of all pictures it names.
    ///
    /// # Errors
    /// [`MeasureError`]: the first thing that is wrong.
    pub fn read(path: &Path) -> Result<Self, MeasureError> {
        read::capture(path)
    }

    /// Names of the material file's channels: a single plane stands for luminance, as in the built-in sets.
    pub fn channels(&self) -> Vec<String> {
        match self.planes.as_slice() {
            [_] => vec!["Y".into()],
            planes => planes.iter().map(|plane| plane.letter().to_string()).collect(),
        }
    }
}
