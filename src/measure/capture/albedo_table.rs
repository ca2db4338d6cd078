//! The `[….albedo]` table of a capture file: a number, a grey card, or a screen with and without the sample.

use std::path::PathBuf;

use super::reader::{Headers, Reader, Result, bounds};
use super::{Albedo, Exposure, Rect};
use crate::measure::MeasureError;
use crate::measure::albedo::CARD_ERROR;
use crate::measure::frame::Header;
use crate::toml_reader::At;

/// Its keys.
pub(super) const ALBEDO_KEYS: [&str; 13] = [
    "value",
    "error",
    "picture",
    "dark",
    "card",
    "sample",
    "card-albedo",
    "card-error",
    "with",
    "without",
    "region",
    "with-exposure-s",
    "without-exposure-s",
];

impl Reader<'_> {
    /// A single picture and its exposure, 1 s where none is given, for pictures that are compared within themselves.
    fn picture(&self, key: &str, time_key: Option<&str>, all: &Headers<'_>) -> Result<Option<(Exposure, Header)>> {
        let Some(name) = self.keys.string(key)? else { return Ok(None) };
        let file: PathBuf = self.folder.join(name.value);
        let header = Headers { first: None, ..*all }.check(&file)?;
        let seconds = match time_key {
            None => 1.0,
            Some(time_key) => match self.number(time_key, bounds::SECONDS)?.or(header.exposure_s) {
                Some(seconds) => seconds,
                None => {
                    let expected = format!("one in EXIF, or `{time_key}` in the capture file");
                    return Err(MeasureError::frame(&file, "no exposure time", expected));
                }
            },
        };
        Ok(Some((Exposure { file, seconds }, header)))
    }

    fn require_picture(&self, key: &str, time: Option<&str>, all: &Headers<'_>) -> Result<(Exposure, Header)> {
        self.picture(key, time, all)?.ok_or_else(|| self.keys.missing(key, "the name of a picture"))
    }

    /// Where the albedo comes from.
    pub(super) fn albedo(&self, series: &str, all: &Headers<'_>) -> Result<Albedo> {
        if let Some(values) = self.keys.per_channel("value", all.planes.len())? {
            if let Some(out) = values.iter().find(|v| !(v.value > 0.0 && v.value <= 1.0)) {
                return Err(self.keys.wrong("value", out, "a share of the light, above 0 and at most 1"));
            }
            let value = values.into_iter().map(|value| value.value).collect();
            return Ok(Albedo::Given { value, error: self.number("error", bounds::SHARE)?.unwrap_or(0.0) });
        }
        if self.keys.get("picture").is_some() {
            let (picture, header) = self.require_picture("picture", None, all)?;
            let dark = self.picture("dark", None, all)?.map(|(dark, _)| dark);
            let card_albedo = self.require_number("card-albedo", 0.001..=1.0)?;
            return Ok(Albedo::GreyCard {
                picture,
                dark,
                card: self.rect("card", &header)?,
                sample: self.rect("sample", &header)?,
                card_albedo,
                card_error: self.number("card-error", bounds::SHARE)?.unwrap_or(CARD_ERROR * card_albedo),
            });
        }
        if self.keys.get("with").is_some() {
            let (with, header) = self.require_picture("with", Some("with-exposure-s"), all)?;
            let (without, other) = self.require_picture("without", Some("without-exposure-s"), all)?;
            if (header.width, header.height) != (other.width, other.height) {
                let expected = format!("{} × {} as {}", header.width, header.height, with.file.display());
                return Err(MeasureError::frame(
                    &without.file,
                    format!("{} × {}", other.width, other.height),
                    expected,
                ));
            }
            return Ok(Albedo::Screen { with, without, region: self.rect("region", &header)? });
        }
        let expected = format!(
            "`value`, {}",
            if series == "reflection" { "or `picture` with a grey card" } else { "or `with` and `without` the sample" }
        );
        Err(self.keys.error(self.keys.start, "keys", "none that says it", expected))
    }

    fn rect(&self, key: &str, header: &Header) -> Result<Rect> {
        let expected = "[left, top, width, height] in pixels";
        let numbers = self.keys.numbers(key)?.ok_or_else(|| self.keys.missing(key, expected))?;
        let whole = |number: &At<f64>| {
            (number.value.fract() == 0.0 && (0.0..=1e6).contains(&number.value)).then_some(number.value as usize)
        };
        let values: Option<Vec<usize>> = numbers.value.iter().map(whole).collect();
        let Some(&[x, y, width, height]) = values.as_deref() else {
            let found: Vec<String> = numbers.value.iter().map(|number| number.value.to_string()).collect();
            return self.refuse(key, format!("[{}]", found.join(", ")), expected);
        };
        if width == 0 || height == 0 || x + width > header.width || y + height > header.height {
            let found = format!("columns {x} to {}, rows {y} to {}", x + width, y + height);
            let expected = format!("a part of the picture, which is {} × {}", header.width, header.height);
            return self.refuse(key, found, expected);
        }
        Ok(Rect { x, y, width, height })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Capture;
    use crate::picture::{Pixels, fast_png};

    /// Where a card's error is not said, it is not none.
    #[test]
    fn a_card_is_uncertain() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["r-0.png", "r-1.png", "t.png", "card.png"] {
            std::fs::write(folder.path().join(name), fast_png(64, Pixels::Grey16(&[600; 64 * 64])).unwrap()).unwrap();
        }
        let text = "[resin]\nname = \"a\"\nrgba = [1, 1, 1]\ndensity-g-per-cm3 = 1.2\nthickness-mm = 3\ndate = \"2010\"\n\
                    [camera]\nmm-per-pixel = 0.044\n[transmission]\nframes = [\"t.png\"]\nexposures-s = [1]\n\
                    [transmission.albedo]\nvalue = 0.01\n[reflection]\nframes = [\"r-*.png\"]\nexposures-s = [1, 2]\n\
                    [reflection.albedo]\npicture = \"card.png\"\ncard = [4, 4, 10, 10]\nsample = [20, 4, 10, 10]\n\
                    card-albedo = 0.18\n";
        for (more, expected) in [("", 0.0018), ("card-error = 0.0003\n", 0.0003)] {
            let file = folder.path().join("capture.toml");
            std::fs::write(&file, format!("{text}{more}")).unwrap();
            let capture = Capture::read(&file).unwrap();
            let Albedo::GreyCard { card_error, .. } = capture.reflection.albedo else { panic!("no card") };
            assert!((card_error - expected).abs() < 1e-12, "{card_error}");
        }
    }
}
