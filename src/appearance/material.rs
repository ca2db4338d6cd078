//! Targets in a designer's numbers: an albedo and a mean free path, one of each for all channels or one for each
//! channel.

use super::{DiffusionError, NormalizedDiffusion};
use crate::{
    colour::{Rgb, byte_to_linear, to_channels},
    optics::FrequencyGrid,
    search::SearchTarget,
};

/// Mean free paths that make sense, mm: from well below a voxel to well above a tray's depth.
const MEAN_FREE_PATH_MM: std::ops::RangeInclusive<f64> = 1e-4..=1000.0;

/// Why numbers are no target.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// Too few values or too many.
    #[error("{name}: found {found} values, expected 1 or {channels}, one for each channel")]
    Count {
        /// Of what.
        name: &'static str,
        /// How many there are.
        found: usize,
        /// Channels of the resins.
        channels: usize,
    },
    /// A value that no material has.
    #[error("{name}: found {found}, expected {expected}")]
    Value {
        /// Of what.
        name: &'static str,
        /// The value.
        found: f64,
        /// What it may be.
        expected: String,
    },
    /// The model of a material takes them for none; what was checked before is always one.
    #[error(transparent)]
    Diffusion(#[from] DiffusionError),
}

impl crate::blame::Blamed for MaterialError {}

/// The target of a material in each of `channels` channels: albedo 0 to 1, and mean free path 1/σt from 0.0001 to 1000
/// mm.
///
/// # Errors
/// [`MaterialError`].
pub fn material_target(
    albedo: &[f64],
    mean_free_path_mm: &[f64],
    channels: usize,
    grid: &FrequencyGrid,
) -> Result<SearchTarget, MaterialError> {
    const ALBEDO: &str = "albedo";
    const PATH: &str = "mean-free-path-mm";
    for (name, found) in [(ALBEDO, albedo.len()), (PATH, mean_free_path_mm.len())] {
        if found != 1 && found != channels {
            return Err(MaterialError::Count { name, found, channels });
        }
    }
    let ill = |name, found, expected| Err(MaterialError::Value { name, found, expected });
    if let Some(&found) = albedo.iter().find(|albedo| !(0.0..=1.0).contains(*albedo)) {
        return ill(ALBEDO, found, "0 to 1".to_owned());
    }
    let (least, most) = (MEAN_FREE_PATH_MM.start(), MEAN_FREE_PATH_MM.end());
    if let Some(&found) = mean_free_path_mm.iter().find(|mm| !MEAN_FREE_PATH_MM.contains(*mm)) {
        return ill(PATH, found, format!("{least} to {most} mm"));
    }
    let of = |values: &[f64], channel: usize| values[channel.min(values.len() - 1)];
    let spectrum = |channel: usize| -> Result<Vec<f64>, MaterialError> {
        Ok(NormalizedDiffusion::new(of(albedo, channel), of(mean_free_path_mm, channel))?.spectrum(grid))
    };
    Ok(SearchTarget { channels: (0..channels).map(spectrum).collect::<Result<_, _>>()? })
}

/// The albedo of an sRGB colour in each of `channels` channels: one is its luminance, three are its own; `None` for
/// other numbers.
pub fn srgb_albedo(srgb: Rgb, channels: usize) -> Option<Vec<f64>> {
    let mut linear = Vec::new();
    to_channels(srgb.map(byte_to_linear), channels, &mut linear);
    matches!(channels, 1 | 3).then(|| linear.into_iter().map(f64::from).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_value_serves_all_channels() {
        let grid = FrequencyGrid::default();
        let one = material_target(&[0.4], &[0.5], 3, &grid).unwrap();
        assert_eq!(one, material_target(&[0.4; 3], &[0.5; 3], 3, &grid).unwrap());
        assert_eq!(one.channels.len(), 3);
        assert!((one.channels[0][0] - 0.4).abs() < 1e-12);
    }

    #[test]
    fn numbers_that_are_no_material_are_named() {
        let message = |albedo: &[f64], path: &[f64]| {
            material_target(albedo, path, 3, &FrequencyGrid::default()).unwrap_err().to_string()
        };
        assert_eq!(message(&[0.4, 0.2], &[0.5]), "albedo: found 2 values, expected 1 or 3, one for each channel");
        assert_eq!(message(&[0.4], &[]), "mean-free-path-mm: found 0 values, expected 1 or 3, one for each channel");
        assert_eq!(message(&[1.4], &[0.5]), "albedo: found 1.4, expected 0 to 1");
        assert_eq!(message(&[0.4], &[5000.0]), "mean-free-path-mm: found 5000, expected 0.0001 to 1000 mm");
        assert_eq!(message(&[f64::NAN], &[0.5]), "albedo: found NaN, expected 0 to 1");
    }
}
