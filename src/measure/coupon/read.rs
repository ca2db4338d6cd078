//! Photographs of a coupon into the light that the middle of every field returns.
//!
//! Two photographs from the same place under the same light: the coupon, and a matt card of known albedo that covers
//! where the coupon was. Pixel by pixel their ratio is the coupon's, whatever the lamps and the lens do.

use std::path::{Path, PathBuf};

use super::{Coupon, READ_SHARE, find};
use crate::measure::MeasureError;
use crate::measure::frame::{self, ColourPlane, Plane};

/// Photographs of one coupon. Values are proportional to light once black is taken off.
#[derive(Debug, Clone, PartialEq)]
pub struct Photographs {
    /// The coupon; several are averaged, however it was turned between them.
    pub coupon: Vec<PathBuf>,
    /// The card, at the exposure of the coupon.
    pub card: PathBuf,
    /// The same with the lens covered.
    pub dark: Option<PathBuf>,
    /// Albedo of the card, 0 to 1.
    pub card_albedo: f64,
    /// Whether the camera sees what the surface mirrors of the tent.
    pub specular: bool,
    /// One standard deviation of it as a share of it: all fields are off by it together.
    pub card_error: f64,
    /// One standard deviation of a field's value as a share of it: light and print, beside the pixels' noise.
    pub relative_error: f64,
}

/// What photographs say of a coupon's fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// By channel and field.
    pub values: Vec<Vec<Value>>,
    /// One standard deviation of what all values may be off by together, as a share of them.
    pub card_error: f64,
    /// Whether they hold what the surface mirrors.
    pub specular: bool,
    /// Pixels of a millimetre, of the coarsest photograph.
    pub pixels_per_mm: f64,
    /// How far marks are from where they should be, mm, root mean square, of the worst photograph.
    pub marks_off_mm: f64,
    /// What to know.
    pub notes: Vec<String>,
}

/// A share of the light, with one standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Value {
    /// The share.
    pub value: f64,
    /// Its error.
    pub error: f64,
}

/// Below this share of the light no photograph tells dark from darker, whatever its noise: veiling glare.
const ABSOLUTE_ERROR: f64 = 2e-4;
/// A field is the mean of so many pixels at least.
const MIN_PIXELS: usize = 100;
/// The card is lit if it is so much above black, as a share of the brightest.
const MIN_CARD: f64 = 0.05;
/// Pixels of a field that are full.
const MOST_FULL: f64 = 0.001;

impl Reading {
    /// Finds the marks in every photograph and reads the fields.
    ///
    /// # Errors
    /// [`MeasureError`]: pictures of different size or of eight bits, marks that are not found, fields that are full.
    pub fn of(coupon: &Coupon, photographs: &Photographs) -> Result<Self, MeasureError> {
        let wanted = match coupon.channels.as_slice() {
            [_] => vec![ColourPlane::Green],
            names => {
                let planes: Option<Vec<_>> = names.iter().map(|name| ColourPlane::from_letter(name)).collect();
                planes.ok_or_else(|| {
                    MeasureError::scene("channels", names.join(", "), "one, or R, G and B: what photographs have")
                })?
            }
        };
        let card = Picture::read(&photographs.card, &wanted, None)?;
        let dark = photographs.dark.as_ref().map(|dark| Picture::read(dark, &wanted, Some(&card))).transpose()?;
        let mut notes = Vec::new();
        if dark.is_none() && card.black == 0.0 {
            notes.push("no dark picture: value 0 is taken for no light".to_owned());
        }
        let mut readings: Vec<Vec<Vec<Value>>> = Vec::new();
        let (mut pixels_per_mm, mut marks_off_mm) = (f64::INFINITY, 0.0_f64);
        for file in &photographs.coupon {
            let picture = Picture::read(file, &wanted, Some(&card))?;
            let ratio = Ratio { picture: &picture, card: &card, dark: dark.as_ref() };
            // Green, or the one there is: the marks are dark in every channel.
            let guide = ratio.plane(wanted.iter().position(|plane| *plane == ColourPlane::Green).unwrap_or(0));
            let seen = find::marks(&guide, coupon).map_err(|found| {
                let expected =
                    format!("the {} marks of the coupon, each whole and seen from above", coupon.marks.len());
                MeasureError::frame(file, found, expected)
            })?;
            pixels_per_mm = pixels_per_mm.min(seen.pixels_per_mm);
            marks_off_mm = marks_off_mm.max(seen.off_mm);
            let channels = 0..wanted.len();
            readings.push(
                channels
                    .map(|channel| ratio.fields(channel, coupon, &seen.view, photographs))
                    .collect::<Result<_, _>>()?,
            );
        }
        let count = readings.len() as f64;
        let mean = |channel: usize, field: usize| {
            let of = |reading: &Vec<Vec<Value>>| reading[channel][field];
            let value = readings.iter().map(|reading| of(reading).value).sum::<f64>() / count;
            let noise = readings.iter().map(|reading| of(reading).error.powi(2)).sum::<f64>().sqrt() / count;
            // Light and print are not known to differ between them.
            let error = libm::hypot(noise, photographs.relative_error * value);
            Value { value, error: libm::hypot(error, ABSOLUTE_ERROR) }
        };
        let fields = |channel| (0..coupon.fields.len()).map(|field| mean(channel, field)).collect();
        Ok(Self {
            values: (0..wanted.len()).map(fields).collect(),
            card_error: photographs.card_error,
            specular: photographs.specular,
            pixels_per_mm,
            marks_off_mm,
            notes,
        })
    }
}

/// A decoded photograph.
struct Picture {
    file: PathBuf,
    planes: Vec<Plane>,
    black: f64,
    full: f64,
}

impl Picture {
    fn read(file: &Path, wanted: &[ColourPlane], like: Option<&Self>) -> Result<Self, MeasureError> {
        let header = frame::header(file)?;
        if let Some(curve) = &header.curve {
            return Err(MeasureError::frame(file, curve.clone(), "values proportional to light"));
        }
        let colour = wanted.len() > 1;
        if colour && !header.colour {
            return Err(MeasureError::frame(
                file,
                "a grey picture",
                "one in colour, as the coupon has channels R, G and B",
            ));
        }
        if let Some((card, like)) = like.map(|card| (card, &card.planes[0]))
            && (like.width, like.height) != (header.width, header.height)
        {
            let found = format!("{} × {} pixels", header.width, header.height);
            let expected = format!("{} × {} as the card, {}", like.width, like.height, card.file.display());
            return Err(MeasureError::frame(file, found, expected));
        }
        Ok(Self {
            planes: frame::planes(file, wanted)?,
            black: header.black_level.unwrap_or(0.0),
            full: header.saturation_level.unwrap_or(header.largest),
            file: file.to_path_buf(),
        })
    }
}

/// The coupon by the card.
struct Ratio<'a> {
    picture: &'a Picture,
    card: &'a Picture,
    dark: Option<&'a Picture>,
}

impl Ratio<'_> {
    /// Light of a pixel above black, of coupon and card.
    fn light(&self, channel: usize, pixel: usize) -> [f64; 2] {
        let black = self.dark.map(|dark| f64::from(dark.planes[channel].values[pixel]));
        [self.picture, self.card]
            .map(|picture| f64::from(picture.planes[channel].values[pixel]) - black.unwrap_or(picture.black))
    }

    /// A plane of shares of the card's light; 0 where the card is not lit.
    fn plane(&self, channel: usize) -> Plane {
        let like = &self.card.planes[channel];
        let brightest =
            (0..like.values.len()).step_by(7).map(|pixel| self.light(channel, pixel)[1]).fold(0.0, f64::max);
        let share = |pixel: usize| {
            let [light, card] = self.light(channel, pixel);
            if card > MIN_CARD * brightest { (light / card) as f32 } else { 0.0 }
        };
        Plane { width: like.width, height: like.height, values: (0..like.values.len()).map(share).collect() }
    }

    /// Means over the middles of all fields, with the noise of their pixels.
    fn fields(
        &self,
        channel: usize,
        coupon: &Coupon,
        view: &find::View,
        photographs: &Photographs,
    ) -> Result<Vec<Value>, MeasureError> {
        let half = 0.5 * READ_SHARE * coupon.spacing_mm;
        let field = |number: usize| {
            let [x, y] = coupon.fields[number].middle_mm;
            let (mut sums, mut n) = ([0.0; 2], 0);
            let (mut full, mut no_number, mut dark) = ([0; 2], [0; 2], 0);
            let pictures = [self.picture, self.card];
            let mut shares = Vec::new();
            for pixel in view.pixels_within([x - half, y - half], [x + half, y + half], &self.card.planes[channel]) {
                let light = self.light(channel, pixel);
                sums.iter_mut().zip(light).for_each(|(sum, light)| *sum += light);
                n += 1;
                for (at, picture) in pictures.into_iter().enumerate() {
                    full[at] += usize::from(!(f64::from(picture.planes[channel].values[pixel]) < picture.full));
                    no_number[at] += usize::from(!picture.planes[channel].values[pixel].is_finite());
                }
                dark += usize::from(self.dark.is_some_and(|dark| !dark.planes[channel].values[pixel].is_finite()));
                shares.push(light);
            }
            let name = || format!("field {} of {}", number + 1, coupon.fields.len());
            let wrong =
                |picture: &Picture, found: String, expected| MeasureError::frame(&picture.file, found, expected);
            if n < MIN_PIXELS {
                let found = format!("{} of {n} pixels", name());
                return Err(wrong(self.picture, found, "100 pixels in the middle of each: go nearer"));
            }
            let mut counts = pictures.into_iter().zip(no_number).chain(self.dark.map(|picture| (picture, dark)));
            if let Some((picture, no_number)) = counts.find(|(_, no_number)| *no_number > 0) {
                let found = format!("{} with {no_number} of {n} pixels that are no number", name());
                return Err(wrong(picture, found, "a number in every pixel"));
            }
            for (picture, full) in pictures.into_iter().zip(full) {
                if full as f64 > MOST_FULL * n as f64 {
                    let found = format!("{} with {full} of {n} pixels full", name());
                    return Err(wrong(picture, found, "a shorter exposure"));
                }
            }
            if !(sums[1] > 0.0) {
                let found = format!("the card dark where {} was", name());
                return Err(wrong(self.card, found, "a lit card that covers the coupon's place"));
            }
            let ratio = sums[0] / sums[1];
            let scatter: f64 = shares.iter().map(|[light, card]| (light - ratio * card).powi(2)).sum::<f64>().sqrt();
            let [value, error] = [ratio, scatter / sums[1]].map(|share| share * photographs.card_albedo);
            Ok(Value { value, error })
        };
        (0..coupon.fields.len()).map(field).collect()
    }
}
