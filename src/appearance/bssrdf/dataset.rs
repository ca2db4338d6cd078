//! A measured BSSRDF: what light comes out around every texel when that texel alone is lit.
//!
//! A dataset is a folder with `dataset.toml` beside its arrays, or one `.npz`; `docs/formats.md` has both forms. Images
//! are oriented as pictures are: row 0 on top, and the same in a response window, whose middle pixel is the lit texel
//! itself. Values are per mm² for unit flux into the lit texel, so the sum over a window times the area of a pixel is a
//! part of the albedo. NaN is a value that is missing. What is negative stays: it is noise about zero, and cutting it
//! off would add light.

use std::path::{Path, PathBuf};

use super::{BssrdfError, header, npy::NpyHeader, npz, responses::Responses, rings::Rings};
use crate::colour::LUMINANCE;

/// Least and largest pitch accepted, mm.
pub const PITCH_MM: [f64; 2] = [1e-4, 100.0];
/// Most columns or rows of a window: rings are found by going over them all.
pub const MAX_WINDOW: usize = 1023;
/// Most texels per side: a label image of 16k × 16k is what the rest of the program takes.
pub const MAX_SIDE: usize = 1 << 14;

/// The variance of a value R: floor² + gain·R.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation where there is no light, per mm².
    pub floor_per_mm2: f64,
    /// Variance per value, as of counted photons, per mm².
    pub gain_per_mm2: f64,
}

/// A dataset whose numbers are on disk.
#[derive(Debug)]
pub struct Dataset {
    /// What to call it in errors: the header or the archive.
    pub file: PathBuf,
    /// Distance between texels, and between pixels of a window, mm.
    pub pitch_mm: f64,
    /// Texels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Columns and rows of a window, both odd.
    pub window: [usize; 2],
    /// Names of the channels, in the order of the array.
    pub channels: Vec<String>,
    /// Total albedo, `[texel][channel]`, if measured; NaN where it is not.
    pub albedo: Option<Vec<f32>>,
    /// Which texels were measured; `None`: all.
    pub present: Option<Vec<bool>>,
    /// What is known of the noise.
    pub noise: Option<Noise>,
    /// The windows.
    pub responses: Responses,
    /// Three channels are read as one.
    pub luminance: bool,
}

/// The arrays and numbers of a dataset before they are held against each other.
pub(super) struct Parts {
    pub file: PathBuf,
    pub pitch_mm: f64,
    pub channels: Option<Vec<String>>,
    pub noise: Option<Noise>,
    pub responses: Responses,
    pub header: NpyHeader,
    pub albedo: Option<Array>,
    pub mask: Option<Array>,
}

/// A small array in memory, and what to call it.
pub(super) struct Array {
    pub file: PathBuf,
    pub name: String,
    pub shape: Vec<usize>,
    pub values: Vec<f32>,
}

impl Dataset {
    /// Opens the folder, header or archive at `path`; `luminance` turns three channels into one.
    ///
    /// # Errors
    /// [`BssrdfError`] with the file and what it should say.
    pub fn open(path: &Path, luminance: bool) -> Result<Self, BssrdfError> {
        let is = |extension: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension));
        let parts = if path.is_dir() {
            header::read(&path.join(header::NAME))?
        } else if is("npz") {
            npz::read(path)?
        } else if is("toml") {
            header::read(path)?
        } else {
            // A file that is not there is said to be missing, whatever its name.
            crate::regular_file::open(path).map_err(|source| BssrdfError::Read { file: path.to_path_buf(), source })?;
            return Err(BssrdfError::Entry {
                file: path.to_path_buf(),
                place: "dataset".into(),
                found: "a file of another kind".into(),
                expected: format!("a folder with {}, its path, or a .npz", header::NAME),
            });
        };
        Self::check(parts, luminance)
    }

    fn check(parts: Parts, luminance: bool) -> Result<Self, BssrdfError> {
        let Parts { file, pitch_mm, channels, noise, responses, header, albedo, mask } = parts;
        let fault = |place: &str, found: String, expected: &str| BssrdfError::Entry {
            file: file.clone(),
            place: place.into(),
            found,
            expected: expected.into(),
        };
        if !(PITCH_MM[0]..=PITCH_MM[1]).contains(&pitch_mm) {
            let expected = format!("{} to {} mm", PITCH_MM[0], PITCH_MM[1]);
            return Err(fault("pitch", format!("{} mm", crate::words::short(pitch_mm)), &expected));
        }
        let shape = &header.shape;
        if !(4..=5).contains(&shape.len()) {
            let expected = "(rows, columns, window rows, window columns), with channels as a third axis if any";
            return Err(fault("responses", format!("an array of shape {shape:?}"), expected));
        }
        if let [.., rows, columns, last @ (1 | 3)] = shape[..]
            && shape.len() == 5
            && rows == columns
            && rows > last
        {
            let expected = "channels as the third axis: numpy.moveaxis(responses, -1, 2)";
            return Err(fault("responses", format!("an array of shape {shape:?}, channels last"), expected));
        }
        let (height, width, stored) = (shape[0], shape[1], if shape.len() == 5 { shape[2] } else { 1 });
        let window = [shape[shape.len() - 1], shape[shape.len() - 2]];
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(fault("responses", format!("{width} × {height} texels"), "1 to 16384 per side"));
        }
        if window.iter().any(|side| side % 2 == 0 || *side > MAX_WINDOW) {
            let found = format!("windows of {} × {} pixels", window[0], window[1]);
            return Err(fault("responses", found, "odd numbers up to 1023, with the lit texel in the middle"));
        }
        let names = channels.unwrap_or_else(|| default_names(stored));
        if stored == 0 || names.len() != stored {
            return Err(fault("channels", format!("{} names for {stored} channels", names.len()), "one per channel"));
        }
        if let Some(Noise { floor_per_mm2: floor, gain_per_mm2: gain }) = noise
            && !(floor >= 0.0 && gain >= 0.0 && floor.is_finite() && gain.is_finite() && floor + gain > 0.0)
        {
            return Err(fault("noise", format!("floor {floor}, gain {gain}"), "finite numbers from 0 on, not both 0"));
        }
        let luminance = luminance && stored > 1;
        if luminance && stored != 3 {
            return Err(BssrdfError::NotThree { file: file.clone(), found: stored });
        }
        let texels = width * height;
        let sized = |array: &Array, axes: &[&[usize]]| {
            let expected = || axes.iter().map(|axes| format!("{axes:?}")).collect::<Vec<_>>().join(" or ");
            axes.iter().any(|axes| *axes == array.shape).then_some(()).ok_or_else(|| BssrdfError::Entry {
                file: array.file.clone(),
                place: array.name.clone(),
                found: format!("an array of shape {:?}", array.shape),
                expected: format!("{}, as the responses have it", expected()),
            })
        };
        let with_channels = [height, width, stored];
        let plain: &[usize] = if stored == 1 { &with_channels[..2] } else { &with_channels };
        if let Some(albedo) = &albedo {
            sized(albedo, &[plain, &with_channels])?;
            if let Some(bad) = albedo.values.iter().position(|v| !(v.is_nan() || (0.0..=1.0).contains(v))) {
                let place = format!("{}, row {}, column {}", albedo.name, bad / stored / width, bad / stored % width);
                let (file, found) = (albedo.file.clone(), albedo.values[bad].to_string());
                let expected = "0 to 1, or NaN where it was not measured".into();
                return Err(BssrdfError::Entry { file, place, found, expected });
            }
        }
        if let Some(mask) = &mask {
            sized(mask, &[&with_channels[..2]])?;
        }
        let present: Option<Vec<bool>> = mask.map(|mask| mask.values.iter().map(|value| *value > 0.0).collect());
        if present.as_ref().is_some_and(|present| present.iter().all(|present| !present)) {
            return Err(fault("mask", format!("0 for all {texels} texels"), "some that were measured"));
        }
        let albedo = albedo.map(|albedo| match luminance {
            true => {
                albedo.values.chunks(3).map(|rgb| rgb.iter().zip(LUMINANCE).map(|(v, w)| v * w as f32).sum()).collect()
            }
            false => albedo.values,
        });
        let channels = if luminance { vec!["Y".to_owned()] } else { names };
        Ok(Self { pitch_mm, width, height, window, channels, albedo, present, noise, responses, luminance, file })
    }

    /// The window's pixels in rings.
    pub fn rings(&self) -> Rings {
        Rings::new(self.window[0], self.window[1], self.pitch_mm)
    }

    /// Number of texels.
    pub fn texels(&self) -> usize {
        self.width * self.height
    }

    /// Whether a texel was measured at all.
    pub fn is_present(&self, texel: usize) -> bool {
        self.present.as_ref().is_none_or(|present| present[texel])
    }
}

fn default_names(channels: usize) -> Vec<String> {
    match channels {
        1 => vec!["Y".into()],
        3 => ["R", "G", "B"].map(String::from).to_vec(),
        _ => (1..=channels).map(|channel| format!("channel {channel}")).collect(),
    }
}
