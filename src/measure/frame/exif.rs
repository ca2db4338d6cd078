//! Exposure times from EXIF, in PNG, TIFF and raw files that are TIFF.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ::exif::{In, Reader, Tag, Value};

/// The exposure time in s, if the file tells one that is positive.
pub(super) fn exposure_s(path: &Path) -> Option<f64> {
    let mut file = BufReader::new(File::open(path).ok()?);
    let exif = Reader::new().read_from_container(&mut file).ok()?;
    let field = exif.get_field(Tag::ExposureTime, In::PRIMARY)?;
    let seconds = match &field.value {
        Value::Rational(values) => values.first()?.to_f64(),
        _ => return None,
    };
    (seconds.is_finite() && seconds > 0.0).then_some(seconds)
}
