//! Albedos from a grey card or a screen: Hašan et al. 2010, section 4.

use super::bracket::Sensor;
use super::capture::{Albedo, Rect};
use super::frame::{self, ColourPlane, Plane};
use super::{MeasureError, Series};

/// A sample or card of fewer pixels, or darker than so many standard errors, says nothing.
const MIN_PIXELS: usize = 64;
const MIN_SIGNAL: f64 = 20.0;
/// A region brighter by this share on one side than on the other is lit unevenly; this much of it goes into the error.
const UNEVEN_SHARE: f64 = 0.1;

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
            let (card, sample) = (mean(card, "card")?, mean(sample, "sample")?);
            let value = card_albedo * sample.value / card.value;
            let relative = (card_error / card_albedo).hypot(card.relative()).hypot(sample.relative());
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
            MeasuredAlbedo { value, error: value * lit.relative().hypot(bare.relative()) }
        }
    };
    if !(measured.value > 0.0 && measured.value <= 1.0) {
        let expected = "a share of the light, above 0 and at most 1";
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
    let (value, error) = average(plane, rect);
    Ok(Patch { value, error })
}

/// Mean of a region and its standard error: noise, and a share of the difference between its halves.
fn average(plane: &Plane, rect: Rect) -> (f64, f64) {
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
    let uneven = (first[0] - second[0]).hypot(first[1] - second[1]);
    (value, variance.sqrt().hypot(UNEVEN_SHARE * uneven))
}
