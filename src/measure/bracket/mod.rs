//! A bracket of exposures becomes one plane of radiance.
//!
//! **In:** pictures of one scene with their exposure times. **Out:** radiance in DN/s and its variance for every pixel,
//! with what was noticed. Every picture is decoded twice: [`survey`] looks at a window around the light to check
//! labels, alignment and noise, then [`merge`] adds all pixels up.

mod ceiling;
mod consistency;
mod merge;
mod noise;
mod own_light;
mod survey;

use self::consistency::{Link, Offset};
use self::own_light::OwnLight;
use super::capture::Exposure;
use super::frame::{self, ColourPlane, Plane};
use super::{Finding, MeasureError};
use crate::parallel;
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
        let decoded: Vec<_> = parallel::map_all(group, |exposure| frame::planes(&exposure.file, &[plane]));
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
    let bad = plane.values.iter().filter(|value| !value.is_finite()).count();
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
    /// What the exposures' times leave uncertain of the ratio of bright to faint light, as a share.
    pub time_share: f64,
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
    survey.require_order(what, &sensor)?;
    survey.require_light(what, &sensor)?;
    let mut links = consistency::links(&survey, &sensor);
    let count = survey.windows.len();
    let seconds = |offsets: &[Offset]| -> Vec<f64> {
        survey
            .windows
            .iter()
            .zip(offsets)
            .map(|(window, offset)| window.exposure.seconds * libm::exp(offset.log_time))
            .collect()
    };
    let mut offsets = consistency::solve(count, &links);
    // A shifted picture's links tell neither times nor constants: the worst goes first, and those left are judged anew.
    let mut shifted: Vec<usize> = Vec::new();
    let length = |offset: &Offset| libm::hypot(offset.shift_px[0], offset.shift_px[1]);
    while let Some(worst) = (0..count)
        .filter(|k| offsets[*k].misaligned() && links.iter().any(|link| link.joins(*k)))
        .max_by(|a, b| length(&offsets[*a]).total_cmp(&length(&offsets[*b])))
    {
        let file = survey.windows[worst].exposure.file.clone();
        findings.push(Finding::Misaligned { file, shift_px: offsets[worst].shift_px });
        shifted.push(worst);
        links.retain(|link| !link.joins(worst));
        offsets = consistency::solve(count, &links);
    }
    let own = OwnLight::of(&survey, &sensor, &links, &seconds(&offsets));
    for (lit, level) in &own.lit {
        let file = survey.windows[*lit].exposure.file.clone();
        findings.push(Finding::LitUp { file, level_dn: *level });
    }
    if !own.lit.is_empty() {
        links.retain(|link| own.lit.iter().all(|(lit, _)| !link.joins(*lit)));
        offsets = consistency::solve(count, &links);
    }
    require_proportion(what, &survey, &sensor, &links, &offsets, own.black_off)?;
    if let Some(level_dn) = own.black_off {
        findings.push(Finding::BlackOff { used_dn: sensor.black, seen_dn: sensor.black + level_dn });
    }
    let mut used = Vec::new();
    let mut squares = Vec::new();
    for (k, (window, offset)) in survey.windows.iter().zip(&offsets).enumerate() {
        let (file, label_s) = (window.exposure.file.clone(), window.exposure.seconds);
        let measured_s = label_s * libm::exp(offset.log_time);
        if shifted.contains(&k) || own.lit.iter().any(|(lit, _)| *lit == k) {
            continue;
        }
        if offset.mislabelled() {
            findings.push(Finding::MislabelledExposure { file, label_s, measured_s });
            continue;
        }
        let left = if offset.off_label() {
            findings.push(Finding::ExposureCorrected { file: file.clone(), label_s, measured_s });
            used.push(Exposure { file, seconds: measured_s });
            0.0
        } else {
            used.push(window.exposure.clone());
            offset.log_time
        };
        if offset.log_error.is_finite() {
            squares.push(left * left + offset.log_error * offset.log_error);
        }
    }
    if 2 * used.len() < count || used.is_empty() {
        let found = format!("{} of {count} exposures that do not fit the others", count - used.len());
        let expected = "a bracket of which most fit together; are times, black level and saturation level right, and \
             are the pictures linear and of one scene?";
        return Err(MeasureError::scene(format!("{what}: bracket"), found, expected));
    }
    let time_share = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
    let sensor = sensor.with_gain_from(&survey, &links, camera, &mut findings);
    Ok(Bracket { used, sensor, findings, brightest: survey.brightest, time_share })
}

/// Refuses numbers that were written through a curve: they grow like a power of the times.
fn require_proportion(
    what: &str,
    survey: &Survey,
    sensor: &Sensor,
    links: &[Link],
    offsets: &[Offset],
    black_off: Option<f64>,
) -> Result<(), MeasureError> {
    let labels: Vec<f64> = survey.windows.iter().map(|window| window.exposure.seconds).collect();
    let linked: Vec<bool> = (0..labels.len()).map(|k| links.iter().any(|link| link.joins(k))).collect();
    let log_times: Vec<f64> = offsets.iter().map(|offset| offset.log_time).collect();
    let Some(power) = own_light::power(&labels, &log_times, &linked) else { return Ok(()) };
    let foot = match black_off {
        Some(off) => format!(", over a black level {:+.0} from the {:.0} used", off, sensor.black),
        None => String::new(),
    };
    let found = format!("values that grow like the exposure time to the power of {power:.2}{foot}");
    let expected = "values proportional to light: were they written through a curve, such as sRGB's or a gamma (or are \
                    all times wrong alike)?";
    Err(MeasureError::scene(format!("{what}: exposure times"), found, expected))
}
