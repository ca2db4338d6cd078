//! How the sensor turns light into numbers: black level, full well, gain, read noise.

use super::Survey;
use super::ceiling::{Ceiling, ceiling};
use super::consistency::Link;
use crate::measure::frame::Plane;
use crate::measure::{Camera, Finding, MeasureError};

/// Values from this share of the range on are taken for saturated: sensors bend before they clip.
const CLIPPED_SHARE: f64 = 0.95;
/// Variance of rounding to whole numbers, DN².
const ROUNDING: f64 = 1.0 / 12.0;
/// Without any statement and without pairs of exposures: a photographic sensor at base ISO in 14 bits…
const TYPICAL_GAIN: f64 = 2.5;
/// …or, where files are of floating point and their numbers of any size, this many electrons in the largest.
const TYPICAL_WELL_E: f64 = 40_000.0;
/// Numbers of floating point are no better than this share of the largest.
const FLOAT_STEP: f64 = 1e-6;

/// The sensor, in the numbers of the file (DN).
#[derive(Debug, Clone, Copy)]
pub(in crate::measure) struct Sensor {
    /// Value of no light.
    pub black: f64,
    /// Values from here on are not used.
    pub clipped: f64,
    /// Electrons per DN.
    pub gain_e_per_dn: f64,
    /// Standard deviation of a value without light, DN.
    pub read_noise_dn: f64,
    /// Variance of rounding, DN².
    pub rounding: f64,
}

impl Sensor {
    /// From what the capture file says, or else from the pictures; the gain is provisional.
    pub fn of(survey: &Survey, camera: &Camera, what: &str, findings: &mut Vec<Finding>) -> Result<Self, MeasureError> {
        let border = survey.windows.first().map(|window| border(&window.plane));
        let quiet = survey.dark.as_ref().map(|plane| plane.values.as_slice()).or(border.as_deref()).unwrap_or(&[]);
        let rounding = if survey.whole_numbers() { ROUNDING } else { (FLOAT_STEP * f64::from(survey.top())).powi(2) };
        let (level, noise) = level_and_noise(quiet, survey.dark.as_ref().map_or(0, |plane| plane.width), rounding);
        let black = camera.black_level.unwrap_or_else(|| estimated(findings, "black level (DN)", level));
        let full = full_at(survey, camera, black, what, findings)?;
        if !(full > black) {
            let expected = format!("more than the black level, {black}");
            return Err(MeasureError::scene(format!("{what}: saturation level"), full.to_string(), expected));
        }
        let range = full.min(f64::from(survey.top())) - black;
        let typical = if survey.whole_numbers() || !(range > 0.0) { TYPICAL_GAIN } else { TYPICAL_WELL_E / range };
        let gain = camera.gain_e_per_dn.unwrap_or(typical);
        let read_noise_dn = match camera.read_noise_e {
            Some(electrons) => electrons / gain,
            None => estimated(findings, "read noise (DN)", noise),
        };
        let clipped = black + CLIPPED_SHARE * (full - black);
        Ok(Self { black, clipped, gain_e_per_dn: gain, read_noise_dn, rounding })
    }

    /// The same with the gain read off the scatter between exposures, where the capture file does not say it.
    pub fn with_gain_from(
        mut self,
        survey: &Survey,
        links: &[Link],
        camera: &Camera,
        findings: &mut Vec<Finding>,
    ) -> Self {
        if camera.gain_e_per_dn.is_some() {
            return self;
        }
        let mut gains: Vec<f64> = links.iter().filter_map(|link| link.gain(survey, &self)).collect();
        gains.sort_by(f64::total_cmp);
        if let Some(gain) = gains.get(gains.len() / 2) {
            self.gain_e_per_dn = *gain;
        }
        findings.push(Finding::Estimated { what: "gain (electrons per DN)", value: self.gain_e_per_dn });
        self
    }

    /// Variance of a value `signal` DN above black, DN².
    pub fn variance(&self, signal: f64) -> f64 {
        signal.max(0.0) / self.gain_e_per_dn + self.read_noise_dn * self.read_noise_dn + self.rounding
    }
}

fn estimated(findings: &mut Vec<Finding>, what: &'static str, value: f64) -> f64 {
    findings.push(Finding::Estimated { what, value });
    value
}

/// Value at which the sensor is full: as stated, or where the pictures end if that is below.
fn full_at(
    survey: &Survey,
    camera: &Camera,
    black: f64,
    what: &str,
    findings: &mut Vec<Finding>,
) -> Result<f64, MeasureError> {
    match (camera.saturation_level, ceiling(survey, black)) {
        (Some(stated), Ceiling::At(seen)) if seen < CLIPPED_SHARE * (stated - black) => {
            findings.push(Finding::SaturationBelow { stated, seen: black + seen });
            Ok(black + seen)
        }
        (Some(stated), _) => Ok(stated),
        (None, Ceiling::At(seen)) => Ok(estimated(findings, "saturation level (DN)", black + seen)),
        (None, Ceiling::None) => Ok(f64::INFINITY),
        (None, Ceiling::Contradicted { seconds, share }) => {
            let found = format!(
                "none in the capture file, and brightest pixels at {seconds} s of {:.0}% of what the shorter exposure \
                 and its time let expect",
                100.0 * share
            );
            let expected = "`saturation-level` under [camera], and exposure times as they were";
            Err(MeasureError::scene(format!("{what}: saturation level"), found, expected))
        }
    }
}

/// Values of the outermost pixels of a window, where the shortest exposure is darkest.
fn border(plane: &Plane) -> Vec<f32> {
    let margin = (plane.width.min(plane.height) / 16).max(1);
    let inside = |x: usize, y: usize| {
        (margin..plane.width - margin).contains(&x) && (margin..plane.height - margin).contains(&y)
    };
    let all = (0..plane.height).flat_map(|y| (0..plane.width).map(move |x| (x, y)));
    all.filter(|(x, y)| !inside(*x, *y)).map(|(x, y)| plane.at(x, y)).collect()
}

/// Mean, and standard deviation by differences of neighbours in a row, both without outliers; the latter at least that
/// of rounding.
fn level_and_noise(values: &[f32], width: usize, rounding: f64) -> (f64, f64) {
    let step = (rounding / ROUNDING).sqrt();
    let mut sorted: Vec<f64> = values.iter().map(|value| f64::from(*value)).filter(|value| value.is_finite()).collect();
    if sorted.len() < 4 {
        return (0.0, step);
    }
    sorted.sort_by(f64::total_cmp);
    let quantile = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
    // Whole numbers have coarse quartiles: two steps more are no outlier.
    let reach = 3.0 * (quantile(0.75) - quantile(0.25)) + 2.0 * step;
    let core = sorted.iter().filter(|value| (**value - quantile(0.5)).abs() <= reach);
    let (sum, count) = core.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    let neighbours = values.windows(2).enumerate().filter(|(i, _)| width == 0 || (i + 1) % width != 0);
    let squares = neighbours.map(|(_, pair)| f64::from(pair[1] - pair[0]).powi(2)).filter(|d| d.sqrt() <= 2.0 * reach);
    let (squared, pairs) = squares.fold((0.0, 0.0), |(sum, count), d| (sum + d, count + 1.0));
    (sum / count, (squared / f64::max(pairs, 1.0) / 2.0).sqrt().max(rounding.sqrt()))
}
