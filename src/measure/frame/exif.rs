//! Exposure times from EXIF, in PNG, TIFF and raw files that are TIFF.

use std::io::BufReader;
use std::path::Path;

use ::exif::{Context, In, Reader, Tag, Value};

/// TIFF files may also tell it in the directory of the picture itself, as DNG and TIFF/EP have it.
const OF_THE_PICTURE: Tag = Tag(Context::Tiff, 0x829a);

/// The exposure time in s, if the file tells one that is positive.
pub(super) fn exposure_s(path: &Path) -> Option<f64> {
    let mut file = BufReader::new(crate::regular_file::open(path).ok()?);
    let exif = Reader::new().read_from_container(&mut file).ok()?;
    let field = [Tag::ExposureTime, OF_THE_PICTURE].iter().find_map(|tag| exif.get_field(*tag, In::PRIMARY))?;
    let seconds = match &field.value {
        Value::Rational(values) => values.first()?.to_f64(),
        _ => return None,
    };
    (seconds.is_finite() && seconds > 0.0).then_some(seconds)
}
