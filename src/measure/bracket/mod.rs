//! A bracket of exposures becomes one plane of radiance.
//!
//! **In:** pictures of one scene with their exposure times. **Out:** radiance in DN/s and its variance for every pixel,
//! with what was noticed. Every picture is decoded twice: [`survey`] looks at a window around the light to check
//! labels, alignment and noise, then [`merge`] adds all pixels up.

mod consistency;
mod merge;
mod noise;
mod survey;

use rayon::prelude::*;

use super::capture::Exposure;
use super::frame::{self, ColourPlane, Plane};
use super::{Finding, MeasureError};
use crate::watch::Watch;

pub(super) use merge::{Radiance, merge};
pub(super) use noise::Sensor;
pub(super) use survey::Survey;

/// Pictures decoded at the same time: each holds 4 bytes a pixel.
const IN_FLIGHT: usize = 2;
/// More pixels without a number than this share are no defects of a sensor.
const MAX_NO_NUMBERS: f64 = 0.05;

/// Decodes one plane of every picture, a few at a time, and hands them over in the order given.
fn for_each(
    exposures: &[&Exposure],
    plane: ColourPlane,
    watch: &dyn Watch,
    mut each: impl FnMut(usize, Plane) -> Result<(), MeasureError>,
) -> Result<(), MeasureError> {
    for (chunk, group) in exposures.chunks(IN_FLIGHT).enumerate() {
        watch.go_on()?;
        let decoded: Vec<_> = group.par_iter().map(|exposure| frame::planes(&exposure.file, &[plane])).collect();
        for (i, planes) in decoded.into_iter().enumerate() {
            if let Some(plane) = planes?.pop() {
                require_numbers(&group[i].file, &plane)?;
                each(chunk * IN_FLIGHT + i, plane)?;
            }
        }
    }
    Ok(())
}

/// Refuses a picture of which a good part is not numbers, as floating-point files can have it; a few such pixels are
/// only not used.
fn require_numbers(file: &std::path::Path, plane: &Plane) -> Result<(), MeasureError> {
    let bad = plane.values.par_iter().filter(|value| !value.is_finite()).count();
    if bad as f64 > MAX_NO_NUMBERS * plane.values.len() as f64 {
        let found = format!("{bad} of {} pixels that are infinite or not a number", plane.values.len());
        return Err(MeasureError::frame(file, found, "at most 5% of such"));
    }
    Ok(())
}

/// A bracket whose exposures agree.
pub(super) struct Bracket {
    /// Pictures that are used, at the time they were exposed for by their own light.
    pub used: Vec<Exposure>,
    /// How the sensor turns light into numbers.
    pub sensor: Sensor,
    /// What was noticed.
    pub findings: Vec<Finding>,
    /// Column and row of the brightest spot.
    pub brightest: [usize; 2],
}

/// Checks a bracket: which exposures fit the others, and what the sensor's noise is.
///
/// # Errors
/// [`MeasureError::Scene`] for a picture without light, or with too much of it.
pub(super) fn check(
    what: &str,
    frames: &[Exposure],
    dark: &[Exposure],
    plane: ColourPlane,
    camera: &super::Camera,
    watch: &dyn Watch,
) -> Result<Bracket, MeasureError> {
    let survey = Survey::take(frames, dark, plane, watch)?;
    let mut findings = Vec::new();
    let sensor = Sensor::of(&survey, camera, what, &mut findings)?;
    survey.require_light(what, &sensor)?;
    let links = consistency::links(&survey, &sensor);
    let offsets = consistency::solve(survey.windows.len(), &links);
    let mut used = Vec::new();
    for (window, offset) in survey.windows.iter().zip(&offsets) {
        let (file, label_s) = (window.exposure.file.clone(), window.exposure.seconds);
        let measured_s = label_s * offset.log_time.exp();
        if offset.mislabelled() {
            findings.push(Finding::MislabelledExposure { file, label_s, measured_s });
        } else if offset.misaligned() {
            findings.push(Finding::Misaligned { file, shift_px: offset.shift_px });
        } else if offset.off_label() {
            findings.push(Finding::ExposureCorrected { file: file.clone(), label_s, measured_s });
            used.push(Exposure { file, seconds: measured_s });
        } else {
            used.push(window.exposure.clone());
        }
    }
    if used.is_empty() {
        return Err(MeasureError::scene(what, "no two exposures that agree", "a bracket whose exposures fit together"));
    }
    let sensor = sensor.with_gain_from(&survey, &links, camera, &mut findings);
    Ok(Bracket { used, sensor, findings, brightest: survey.brightest })
}
