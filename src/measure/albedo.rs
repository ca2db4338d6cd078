//! Albedos from a grey card or a screen: Hašan et al. 2010, section 4.

use super::bracket::Sensor;
use super::capture::{Albedo, Rect};
use super::frame::{self, ColourPlane, Plane};
use super::{Finding, MeasureError, Series};

/// A sample or card of fewer pixels, or darker than so many standard errors, says nothing.
const MIN_PIXELS: usize = 64;
const MIN_SIGNAL: f64 = 20.0;
/// What a card's albedo is uncertain by where that is not said, as a share of it.
pub const CARD_ERROR: f64 = 0.01;
/// A region brighter by this share on one side than on the other is lit unevenly; this much of it goes into the error.
const UNEVEN_SHARE: f64 = 0.1;

/// Light that differs between card and sample by this share, as their own slopes tell, is named.
const NAMED_UNEVEN: f64 = 0.005;

/// Share of the light, and its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredAlbedo {
    /// 0 to 1.
    pub value: f64,
    /// One standard deviation.
    pub error: f64,
}

/// The albedo of one plane of a series; `index` is the plane's place in the capture.
pub(super) fn albedo(
    series: &Series,
    plane: ColourPlane,
    index: usize,
    sensor: &Sensor,
    what: &str,
    findings: &mut Vec<Finding>,
) -> Result<MeasuredAlbedo, MeasureError> {
    let read = |file: &std::path::Path| {
        let planes = frame::planes(file, &[plane])?;
        planes.into_iter().next().ok_or_else(|| MeasureError::frame(file, "no plane", "one"))
    };
    let measured = match &series.albedo {
        Albedo::Given { value, error } => MeasuredAlbedo { value: value[index], error: *error },
        Albedo::GreyCard { picture, dark, card, sample, card_albedo, card_error } => {
            let lit = read(&picture.file)?;
            let dark = dark.as_ref().map(|dark| read(&dark.file)).transpose()?;
            let mean = |rect: &Rect, name: &str| {
                let lit = patch(&lit, *rect, sensor, &picture.file, name)?;
                let black = dark.as_ref().map_or(sensor.black, |dark| average(dark, *rect).0);
                lit.above(black, &picture.file, name)
            };
            let (card_rect, sample_rect) = (card, sample);
            let (card, sample) = (mean(card, "card")?, mean(sample, "sample")?);
            let value = card_albedo * sample.value / card.value;
            let uneven = uneven_light(&lit, *card_rect, *sample_rect, sensor.black);
            if uneven > NAMED_UNEVEN {
                findings.push(Finding::UnevenCard { share: uneven });
            }
            let relative = libm::hypot(
                libm::hypot(libm::hypot(card_error / card_albedo, card.relative()), sample.relative()),
                uneven,
            );
            MeasuredAlbedo { value, error: value * relative }
        }
        Albedo::Screen { with, without, region } => {
            let mean = |exposure: &super::Exposure, name: &str| {
                patch(&read(&exposure.file)?, *region, sensor, &exposure.file, name)?.above(
                    sensor.black,
                    &exposure.file,
                    name,
                )
            };
            let (lit, bare) = (mean(with, "region")?, mean(without, "region")?);
            let value = lit.value / with.seconds / (bare.value / without.seconds);
            MeasuredAlbedo { value, error: value * libm::hypot(lit.relative(), bare.relative()) }
        }
    };
    if !(measured.value > 0.0 && measured.value <= 1.0) {
        let expected = match &series.albedo {
            Albedo::Screen { .. } if measured.value > 1.0 => {
                "a share of the light, above 0 and at most 1; are `with` and `without`, or their times, exchanged?"
            }
            Albedo::GreyCard { .. } if measured.value > 1.0 => {
                "a share of the light, above 0 and at most 1; are `card` and `sample` exchanged, and is \
                 `card-albedo` right?"
            }
            _ => "a share of the light, above 0 and at most 1",
        };
        return Err(MeasureError::scene(format!("{what}: albedo"), format!("{:.4}", measured.value), expected));
    }
    Ok(measured)
}

struct Patch {
    value: f64,
    error: f64,
}

impl Patch {
    fn relative(&self) -> f64 {
        self.error / self.value
    }

    fn above(mut self, black: f64, file: &std::path::Path, name: &str) -> Result<Self, MeasureError> {
        self.value -= black;
        if self.value > MIN_SIGNAL * self.error {
            return Ok(self);
        }
        let found = format!("a {name} {:.1} ± {:.1} above black", self.value, self.error);
        Err(MeasureError::frame(file, found, "one that is lit"))
    }
}

fn patch(
    plane: &Plane,
    rect: Rect,
    sensor: &Sensor,
    file: &std::path::Path,
    name: &str,
) -> Result<Patch, MeasureError> {
    if rect.width * rect.height < MIN_PIXELS {
        let found = format!("a {name} of {} × {} pixels", rect.width, rect.height);
        return Err(MeasureError::frame(file, found, format!("at least {MIN_PIXELS} in all")));
    }
    let values = plane.crop(rect.x, rect.y, rect.width, rect.height).values;
    let saturated = values.iter().filter(|value| !(f64::from(**value) < sensor.clipped)).count();
    if saturated > values.len() / 1000 {
        let found = format!("a {name} with {saturated} of {} pixels saturated or no number", values.len());
        return Err(MeasureError::frame(file, found, "a shorter exposure"));
    }
    let (value, error, _) = average(plane, rect);
    Ok(Patch { value, error })
}

/// Mean of a region, its standard error (noise, and a share of the difference between its halves), and noise alone.
fn average(plane: &Plane, rect: Rect) -> (f64, f64, f64) {
    let mean = |part: Rect| {
        let values = plane.crop(part.x, part.y, part.width, part.height).values;
        let (sum, squares) = values
            .iter()
            .fold((0.0, 0.0), |(sum, squares), value| (sum + f64::from(*value), squares + f64::from(*value).powi(2)));
        let n = values.len() as f64;
        (sum / n, (squares / n - (sum / n).powi(2)).max(0.0) / n)
    };
    let (value, variance) = mean(rect);
    let halves = |second: bool| {
        let across =
            Rect { width: (rect.width / 2).max(1), x: rect.x + if second { rect.width / 2 } else { 0 }, ..rect };
        let down =
            Rect { height: (rect.height / 2).max(1), y: rect.y + if second { rect.height / 2 } else { 0 }, ..rect };
        [mean(across).0, mean(down).0]
    };
    let (first, second) = (halves(false), halves(true));
    let uneven = libm::hypot(first[0] - second[0], first[1] - second[1]);
    (value, libm::hypot(variance.sqrt(), UNEVEN_SHARE * uneven), variance.sqrt())
}

/// Difference of the light between two regions as a share of it, by the slopes of both along the line between them;
/// 0 where it is no more than their noise.
fn uneven_light(plane: &Plane, a: Rect, b: Rect, black: f64) -> f64 {
    let centre = |rect: Rect| [rect.x as f64 + 0.5 * rect.width as f64, rect.y as f64 + 0.5 * rect.height as f64];
    let (from, to) = (centre(a), centre(b));
    let step = [to[0] - from[0], to[1] - from[1]];
    let along = |rect: Rect| {
        let (half_width, half_height) = ((rect.width / 2).max(1), (rect.height / 2).max(1));
        let left = average(plane, Rect { width: half_width, ..rect });
        let right = average(plane, Rect { x: rect.x + rect.width - half_width, width: half_width, ..rect });
        let upper = average(plane, Rect { height: half_height, ..rect });
        let lower = average(plane, Rect { y: rect.y + rect.height - half_height, height: half_height, ..rect });
        let level = average(plane, rect).0 - black;
        let across = step[0] / (rect.width - half_width).max(1) as f64 / level;
        let down = step[1] / (rect.height - half_height).max(1) as f64 / level;
        let value = (right.0 - left.0) * across + (lower.0 - upper.0) * down;
        let noise = libm::hypot(libm::hypot(right.2, left.2) * across, libm::hypot(lower.2, upper.2) * down);
        (value, noise)
    };
    let ((first, first_noise), (second, second_noise)) = (along(a), along(b));
    let (mean, noise) = (0.5 * (first + second), 0.5 * libm::hypot(first_noise, second_noise));
    if mean.abs() > 4.0 * noise { mean.abs() } else { 0.0 }
}
