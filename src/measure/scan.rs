//! One series of pictures becomes one profile, not yet scaled.

use super::aperture::{Centre, deblur};
use super::background::{self, Level};
use super::bracket::{self, Radiance, Sensor};
use super::capture::{Exposure, Series};
use super::centre::{self, Asymmetry, filled};
use super::evenness::{self, Band};
use super::frame::{self, ColourPlane, Plane};
use super::outliers::Outliers;
use super::rings::{Grid, Model, Rings};
use super::{Camera, Finding, MeasureError};
use crate::optics::{MIN_SAMPLES, ProfileError, RadialProfile};
use crate::watch::Watch;

/// Fewest whole rings a centre must have about it.
pub(super) const MIN_RINGS: usize = 16;
/// Stray light is subtracted from this many standard errors on; without a dark series, whatever it is.
const LEVEL_SIGMAS: f64 = 4.0;
/// A level below the dark is named from this share of the light on.
const NAMED_BELOW: f64 = 1e-3;
/// Asymmetries are named from this many standard errors on…
const NAMED_SIGMAS: f64 = 4.0;
/// …tilts from a few more: of 118 sound series at random three were seen at 4.0 to 4.5, where chance alone would be
/// 0.01…
const TILT_SIGMAS: f64 = 5.5;
/// …a tilt from this angle on, degrees: of 60 sound series by another generator, of resins whose light goes far, two
/// were seen at 0.21 ± 0.03 and 0.41 ± 0.05, and half a degree moves a ring at 2.7 mm by 6e-4…
const NAMED_TILT: f64 = 0.5;
/// …an ellipticity from this share on: the profile then is off by 1% where it falls like r⁻⁴…
const NAMED_ELLIPTICITY: f64 = 0.005;
/// …a gradient if it changes the outermost ring by this many of its standard errors.
const NAMED_GRADIENT: f64 = 3.0;
/// Octants scatter by this share (and so many times their noise) before a ring is called uneven…
const NAMED_UNEVEN: f64 = 0.03;
const UNEVEN_NOISE: f64 = 5.0;
/// …and no profile is made of rings of which a band with light scatters by this one.
const REFUSED_UNEVEN: f64 = 0.35;
/// A tilt from this angle on foreshortens enough to be checked, degrees: 1 − cos is 1%.
const CHECKED_TILT: f64 = 8.0;
/// Foreshortening seen and expected agree to this share.
const SAME_FORESHORTENING: f64 = 0.5;
/// A harmonic counts from so many of its standard errors on.
const LOPSIDED_SIGMAS: f64 = 6.0;
/// A spot is near the border where whole rings reach less than this share of the way to the farthest border…
const NEAR_BORDER: f64 = 0.6;
/// …and end at more than this share of the brightest, or above noise: few rings leave blur and stray light open.
const LIGHT_AT_BORDER: f64 = 1e-3;
/// …or in so much of it where it is nowhere lost in noise.
const LEAST_AT_BORDER: f64 = 1e-5;
/// More masked pixels than this share are no outliers but another scene.
const MAX_MASKED: f64 = 0.05;

/// A profile as the camera has it.
#[derive(Debug, Clone)]
pub struct ScannedProfile {
    /// Edges of the rings, mm, one more than values.
    pub edges_mm: Vec<f64>,
    /// Ring means in DN/s, deblurred, without stray light.
    pub value: Vec<f64>,
    /// Standard error of each.
    pub error: Vec<f64>,
    /// Ring means as the camera saw them, dark subtracted, and nothing else done.
    pub seen: Vec<f64>,
    /// First ring that is extrapolated.
    pub extrapolated_from: Option<usize>,
    /// Column and row of the centre, from the centre of the first pixel.
    pub centre_px: [f64; 2],
    /// Its standard error, pixels.
    pub centre_error_px: f64,
    /// Tilt of the sample against the camera, seen or not; `None` where the lens' distance is not known.
    pub tilt: Option<SeenTilt>,
    /// First and second harmonics of the rings over their means: amplitudes.
    pub harmonics: Vec<[f64; 2]>,
    /// Largest share by which blur changes the rings that were not deblurred.
    pub blur_bound: f64,
    /// Electrons per DN.
    pub gain_e_per_dn: f64,
    /// Exposures that were merged, s, the shortest first.
    pub exposures_s: Vec<f64>,
    /// What exposure times leave uncertain of all values, as a share of each.
    pub time_share: f64,
    /// What stray light leaves uncertain, DN/s: of the level that was subtracted it is in the errors already.
    pub level_error: f64,
    /// What was noticed.
    pub findings: Vec<Finding>,
    /// The picture about the centre.
    pub preview: Preview,
    pub(super) sensor: Sensor,
}

/// What the rings' perspective says of a tilt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenTilt {
    /// Angle in degrees, noise included.
    pub degrees: f64,
    /// One standard deviation in each direction.
    pub error: f64,
}

impl SeenTilt {
    /// Smallest tilt that would be named, degrees.
    pub fn least(&self) -> f64 {
        (TILT_SIGMAS * self.error).max(NAMED_TILT)
    }

    /// Whether it is named.
    pub fn is_seen(&self) -> bool {
        self.degrees > self.least()
    }
}

/// A small picture for human eyes.
#[derive(Debug, Clone, PartialEq)]
pub struct Preview {
    /// Pixels a side.
    pub side: usize,
    /// log₁₀ of radiance over the largest, rows from the top; NaN where masked or dark.
    pub log10: Vec<f32>,
    /// mm per pixel.
    pub mm_per_pixel: f64,
}

/// Measures one plane of a series.
///
/// # Errors
/// [`MeasureError`]: a picture that cannot be read, or pictures that show no measurement.
pub(super) fn scan(
    series: &Series,
    camera: &Camera,
    plane: ColourPlane,
    bin_mm: f64,
    centre_kind: Centre,
    what: &str,
    watch: &dyn Watch,
) -> Result<ScannedProfile, MeasureError> {
    let checked = bracket::check(what, &series.frames, &series.dark, plane, camera, watch)?;
    let mut findings = checked.findings;
    let mut picture = bracket::merge(&checked.used, plane, &checked.sensor, watch)?;
    let mut outliers = Outliers::default();
    if series.dark.is_empty() {
        findings.push(Finding::NoDarkSeries);
    } else {
        let dark = bracket::merge(&series.dark, plane, &checked.sensor, watch)?;
        outliers.add_hot(&dark);
        picture.subtract(&dark);
    }
    match &series.flat {
        None => findings.push(Finding::NoFlatField),
        Some(flat) => picture.divide(&flat_field(flat, plane, checked.sensor.black)?),
    }
    outliers.mask(&mut picture);
    let coarse = centre::coarse(&picture, checked.brightest);
    let grid = Grid::whole(coarse, picture.width, picture.height, series.mm_per_pixel, bin_mm);
    let (grid, _) = centre::refine(&picture, grid, what)?;
    outliers.add_odd(&picture, &grid);
    let masked = outliers.len() as f64 / picture.value.len() as f64;
    if masked > MAX_MASKED {
        let found = format!("{:.1}% of the pixels off their rings", 100.0 * masked);
        let expected = "one spot of light with falling light around it; crop what else is in the picture";
        return Err(MeasureError::scene(format!("{what}: symmetry"), found, expected));
    }
    outliers.mask(&mut picture);
    findings.extend(outliers.findings(picture.width));
    let (grid, centre_error_px) = centre::refine(&picture, grid, what)?;
    let first = Rings::of(&picture, grid, None);
    let rings = Rings::of(&picture, grid, Some(&Model::through(&grid, &filled(&first.mean))));
    let mut profile = ProfileEstimate { grid, mean: filled(&rings.mean), error: filled(&rings.error) };
    let seen = profile.mean.clone();
    let level_error = profile.subtract_level(series.dark.is_empty(), &mut findings);
    let tilt = name_asymmetry(&rings, &profile, series.camera_distance_mm, &mut findings);
    require_even(&rings, &mut findings, what)?;
    name_border(&profile, picture.width, picture.height, &mut findings);
    let mut blur_bound = 0.0;
    if let Some(sharp) = deblur(&picture, &grid, series.aperture, centre_kind, &profile.mean, &profile.error) {
        profile.mean[..sharp.mean.len()].copy_from_slice(&sharp.mean);
        profile.error[..sharp.error.len()].copy_from_slice(&sharp.error);
        blur_bound = sharp.bound;
    }
    if series.aperture.is_none() {
        findings.push(Finding::Remark(format!(
            "{what}: the size of the spot is not given (aperture-mm): its blur is left in the profile"
        )));
    }
    let extrapolated_from = profile.extrapolate(&mut findings);
    if profile.mean.len() < MIN_SAMPLES {
        let found = format!("{} rings whose light is above noise, stray light taken off", profile.mean.len());
        let expected = format!("at least {MIN_SAMPLES}: a brighter spot, or exposures that fit together");
        return Err(MeasureError::scene(format!("{what}: light"), found, expected));
    }
    let relative = rings.harmonics.iter().zip(&rings.mean);
    let harmonics =
        relative.map(|([a, b, c, d], mean)| [libm::hypot(*a, *b) / mean, libm::hypot(*c, *d) / mean]).collect();
    let mut exposures_s: Vec<f64> = checked.used.iter().map(|exposure| exposure.seconds).collect();
    exposures_s.sort_by(f64::total_cmp);
    Ok(ScannedProfile {
        edges_mm: (0..=profile.mean.len()).map(|bin| bin as f64 * bin_mm).collect(),
        value: profile.mean,
        error: profile.error,
        seen,
        extrapolated_from,
        centre_px: grid.centre,
        centre_error_px,
        tilt,
        harmonics,
        blur_bound,
        gain_e_per_dn: checked.sensor.gain_e_per_dn,
        exposures_s,
        time_share: checked.time_share,
        level_error,
        findings,
        preview: preview(&picture, &grid),
        sensor: checked.sensor,
    })
}

impl ScannedProfile {
    /// As a profile, still in DN/s; its errors cover the rings' own, exposure times, stray light, and that of the
    /// albedo it will be scaled to, a share of each value.
    pub(super) fn profile(&self, albedo_share: f64) -> Result<RadialProfile, ProfileError> {
        let common = libm::hypot(self.time_share, albedo_share);
        let all = self.value.iter().zip(&self.error);
        let errors =
            all.map(|(value, error)| libm::hypot(libm::hypot(*error, self.level_error), common * value)).collect();
        RadialProfile::from_rings(self.edges_mm.clone(), self.value.clone(), Some(errors))
    }
}

/// A profile under work.
struct ProfileEstimate {
    grid: Grid,
    mean: Vec<f64>,
    error: Vec<f64>,
}

impl ProfileEstimate {
    fn peak(&self) -> f64 {
        self.mean.iter().copied().fold(0.0, f64::max)
    }

    /// Takes stray light off; returns what it leaves uncertain beyond the rings' own errors.
    fn subtract_level(&mut self, whatever: bool, findings: &mut Vec<Finding>) -> f64 {
        let Some(Level { value, error }) = background::level(&self.grid, &self.mean, &self.error) else { return 0.0 };
        if value.abs() < LEVEL_SIGMAS * error && !whatever {
            return libm::hypot(value, error);
        }
        if value < 0.0 && !whatever {
            let share = self.share_of_light();
            if value.abs() * share > NAMED_BELOW {
                findings.push(Finding::BelowDark { share: value * share, error: error * share });
            }
            return libm::hypot(value, error);
        }
        self.mean.iter_mut().for_each(|mean| *mean -= value);
        // All rings are off together by the level's error; each carries it.
        self.error.iter_mut().for_each(|own| *own = libm::hypot(*own, error));
        let share = self.share_of_light();
        findings.push(Finding::StrayLight { share: value * share, error: error * share });
        0.0
    }

    /// What a level of 1 is of the light in the largest full ring.
    fn share_of_light(&self) -> f64 {
        let light: f64 = self.mean.iter().enumerate().map(|(bin, mean)| mean * self.grid.area(bin)).sum();
        let area: f64 = (0..self.grid.bins).map(|bin| self.grid.area(bin)).sum();
        area / light
    }

    /// Puts the diffuse tail in place of rings lost in noise; says from where.
    fn extrapolate(&mut self, findings: &mut Vec<Finding>) -> Option<usize> {
        let lost = background::first_lost(&self.mean, &self.error)?;
        let tail = background::tail(&self.grid, &self.mean, &self.error, lost);
        self.mean.truncate(lost);
        self.error.truncate(lost);
        let tail = tail?;
        for bin in lost..background::tail_end(&self.grid, &tail, self.peak(), lost) {
            let r = self.grid.radius(bin);
            self.mean.push(tail.at(r));
            self.error.push(tail.error_at(r));
        }
        let energy = |bins: std::ops::Range<usize>| bins.map(|bin| self.mean[bin] * self.grid.area(bin)).sum::<f64>();
        let share = energy(lost..self.mean.len()) / energy(0..self.mean.len());
        findings.push(Finding::Extrapolated { from_mm: lost as f64 * self.grid.bin_mm, share });
        Some(lost)
    }
}

/// Names what is lopsided; the answer is the tilt, named or not.
fn name_asymmetry(
    rings: &Rings,
    profile: &ProfileEstimate,
    distance_mm: Option<f64>,
    findings: &mut Vec<Finding>,
) -> Option<SeenTilt> {
    let asymmetry = Asymmetry::of(rings);
    let tilt = distance_mm.filter(|_| asymmetry.perspective.error > 0.0).map(|distance| {
        let degrees = |sine: f64| libm::asin((sine * distance).min(1.0)).to_degrees();
        SeenTilt { degrees: degrees(asymmetry.perspective.length()), error: degrees(asymmetry.perspective.error) }
    });
    if let Some(SeenTilt { degrees, error }) = tilt.filter(SeenTilt::is_seen) {
        let foreshortened = 1.0 - libm::cos(degrees.to_radians());
        let seen = asymmetry.ellipticity.length();
        if degrees > CHECKED_TILT && (seen / foreshortened - 1.0).abs() > SAME_FORESHORTENING {
            if let Some((bin, share)) = largest_first_harmonic(rings) {
                findings.push(Finding::Lopsided { share, at_mm: profile.grid.radius(bin) });
            }
        } else {
            findings.push(Finding::Tilt { degrees, error });
        }
    }
    let gradient = asymmetry.gradient;
    let edge = profile.grid.bins.saturating_sub(1);
    let change = gradient.length() * profile.grid.radius(edge);
    if gradient.significance() > NAMED_SIGMAS && change > NAMED_GRADIENT * rings.error[edge] {
        let per_mm = gradient.length() / profile.peak();
        findings.push(Finding::Gradient { per_mm, significance: gradient.significance() });
    }
    let ellipticity = asymmetry.ellipticity;
    if ellipticity.significance() > NAMED_SIGMAS && ellipticity.length() > NAMED_ELLIPTICITY {
        findings.push(Finding::Ellipticity { share: ellipticity.length(), error: ellipticity.error });
    }
    tilt
}

/// The ring of the largest first harmonic over its mean, of those that are well above the harmonic's own noise.
fn largest_first_harmonic(rings: &Rings) -> Option<(usize, f64)> {
    let size = |bin: usize| libm::hypot(rings.harmonics[bin][0], rings.harmonics[bin][1]);
    let clear = (1..rings.mean.len()).filter(|&bin| {
        let error = rings.error[bin];
        rings.mean[bin] > 20.0 * error && size(bin) > LOPSIDED_SIGMAS * std::f64::consts::SQRT_2 * error
    });
    clear.map(|bin| (bin, size(bin) / rings.mean[bin])).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Names rings that differ from direction to direction, and refuses those of which nothing can be told.
fn require_even(rings: &Rings, findings: &mut Vec<Finding>, what: &str) -> Result<(), MeasureError> {
    let uneven = |band: &Band| band.share > NAMED_UNEVEN.max(UNEVEN_NOISE * band.noise);
    let worst = evenness::bands(rings).into_iter().filter(uneven).max_by(|a, b| a.share.total_cmp(&b.share));
    let Some(Band { from_mm, to_mm, share, .. }) = worst else { return Ok(()) };
    let uneven = Finding::Uneven { from_mm, to_mm, share };
    if share > REFUSED_UNEVEN {
        let expected = "a clean sample under one round spot";
        return Err(MeasureError::scene(format!("{what}: symmetry"), uneven.to_string(), expected));
    }
    findings.push(uneven);
    Ok(())
}

/// Names a spot so near the border that whole rings end in its light.
fn name_border(profile: &ProfileEstimate, width: usize, height: usize, findings: &mut Vec<Finding>) {
    let grid = &profile.grid;
    let far = |at: f64, length: usize| (at + 0.5).max(length as f64 - 0.5 - at);
    let farthest_mm = far(grid.centre[0], width).max(far(grid.centre[1], height)) * grid.mm_per_pixel;
    let reach_mm = grid.bins as f64 * grid.bin_mm;
    let last = &profile.mean[grid.bins.saturating_sub(5)..];
    let share = last.iter().sum::<f64>() / last.len().max(1) as f64 / profile.peak();
    let unlost = || background::first_lost(&profile.mean, &profile.error).is_none();
    let in_light = share > LIGHT_AT_BORDER || (share > LEAST_AT_BORDER && unlost());
    if reach_mm < NEAR_BORDER * farthest_mm && in_light {
        findings.push(Finding::NearBorder { reach_mm, farthest_mm, share });
    }
}

/// The lens' shading by a picture of an even surface: 1 in the mean.
fn flat_field(flat: &Exposure, plane: ColourPlane, black: f64) -> Result<Plane, MeasureError> {
    let mut planes = frame::planes(&flat.file, &[plane])?;
    let Some(mut picture) = planes.pop() else { return Err(MeasureError::frame(&flat.file, "no plane", "one")) };
    // Means over small blocks: shading is smooth, and a pixel's noise is no shading.
    smooth(&mut picture);
    let mean = picture.values.iter().map(|value| f64::from(*value) - black).sum::<f64>() / picture.values.len() as f64;
    let least = picture.values.iter().map(|value| f64::from(*value) - black).fold(f64::INFINITY, f64::min);
    if !(mean > 0.0 && least > LEAST_FLAT * mean) {
        let found = format!("a flat field whose darkest part is {least:.0} and whose mean {mean:.0} above black");
        return Err(MeasureError::frame(&flat.file, found, "an even surface under even light that fills the picture"));
    }
    picture.values.iter_mut().for_each(|value| *value = ((f64::from(*value) - black) / mean) as f32);
    Ok(picture)
}

/// A flat field darker than this share of its mean anywhere is none.
const LEAST_FLAT: f64 = 0.1;
/// Pixels about a pixel, in each direction, that a flat field is averaged over.
const FLAT_REACH: usize = 4;

/// Running means along rows, then columns.
fn smooth(picture: &mut Plane) {
    let means = |values: &[f32]| -> Vec<f32> {
        let mean = |i: usize| {
            let near = &values[i.saturating_sub(FLAT_REACH)..(i + FLAT_REACH + 1).min(values.len())];
            near.iter().sum::<f32>() / near.len() as f32
        };
        (0..values.len()).map(mean).collect()
    };
    for row in picture.values.chunks_mut(picture.width) {
        let smoothed = means(row);
        row.copy_from_slice(&smoothed);
    }
    for x in 0..picture.width {
        let column: Vec<f32> = (0..picture.height).map(|y| picture.at(x, y)).collect();
        means(&column).into_iter().enumerate().for_each(|(y, mean)| picture.values[y * picture.width + x] = mean);
    }
}

/// The whole rings, brought down to a small picture by averaging blocks.
fn preview(picture: &Radiance, grid: &Grid) -> Preview {
    const SIDE: usize = 256;
    let radius_px = grid.bins as f64 * grid.bin_mm / grid.mm_per_pixel;
    let block = ((2.0 * radius_px / SIDE as f64).ceil() as usize).max(1);
    let side = ((2.0 * radius_px) as usize / block).max(1);
    let corner = grid.centre.map(|at| (at - radius_px).max(0.0).round() as usize);
    let mean = |i: usize| {
        let (left, top) = (corner[0] + i % side * block, corner[1] + i / side * block);
        let (mut sum, mut count) = (0.0_f32, 0.0_f32);
        for y in top..(top + block).min(picture.height) {
            for x in left..(left + block).min(picture.width) {
                let value = picture.at(x, y);
                if !value.is_nan() {
                    (sum, count) = (sum + value, count + 1.0);
                }
            }
        }
        sum / count
    };
    let means: Vec<f32> = (0..side * side).map(mean).collect();
    let largest = means.iter().copied().filter(|mean| !mean.is_nan()).fold(f32::MIN, f32::max);
    let log10 = means.iter().map(|mean| libm::log10f(mean / largest)).collect();
    Preview { side, log10, mm_per_pixel: grid.mm_per_pixel * block as f64 }
}
