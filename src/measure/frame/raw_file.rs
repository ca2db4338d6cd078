//! Camera raw files through rawler. A pixel of a plane is a cell of 2 × 2 sensor pixels: half the sensor's columns and
//! rows, no colour guessed from neighbours.

use std::path::Path;

use rawler::decoders::RawDecodeParams;
use rawler::rawimage::{RawImage, RawPhotometricInterpretation};
use rawler::rawsource::RawSource;

use super::{ColourPlane, Header, Plane, Unweaver};
use crate::measure::MeasureError;

/// The raw image, without its pixels if `dummy`, and the exposure time.
fn decode(path: &Path, dummy: bool) -> Result<(RawImage, Option<f64>), MeasureError> {
    let source = RawSource::new(path).map_err(|source| MeasureError::Read { file: path.to_path_buf(), source })?;
    // The decoders panic at some damage.
    std::panic::catch_unwind(|| decode_source(path, &source, dummy))
        .unwrap_or_else(|_| Err(MeasureError::frame(path, "a raw file that its decoder fails on", "a whole one")))
}

fn decode_source(path: &Path, source: &RawSource, dummy: bool) -> Result<(RawImage, Option<f64>), MeasureError> {
    let unreadable = |error: rawler::RawlerError| {
        let words = error.to_string().lines().next().unwrap_or("no reason").to_owned();
        MeasureError::frame(path, format!("a raw file that cannot be read ({words})"), "one of a camera rawler knows")
    };
    let decoder = rawler::get_decoder(source).map_err(unreadable)?;
    let params = RawDecodeParams::default();
    let image = decoder.raw_image(source, &params, dummy).map_err(unreadable)?;
    let exposure = decoder.raw_metadata(source, &params).ok().and_then(|metadata| metadata.exif.exposure_time);
    let seconds = exposure.map(|time| f64::from(time.n) / f64::from(time.d));
    Ok((image, seconds.filter(|seconds| seconds.is_finite() && *seconds > 0.0)))
}

/// Left, top, columns and rows of the lit part, in sensor pixels, even.
fn lit(image: &RawImage) -> [usize; 4] {
    let (left, top, width, height) = match image.active_area {
        Some(area) => (area.p.x, area.p.y, area.d.w, area.d.h),
        None => (0, 0, image.width, image.height),
    };
    // A cell starts at an even pixel, so that its colours lie as the pattern has them.
    let (left, top) = (left.next_multiple_of(2), top.next_multiple_of(2));
    [left, top, (width.min(image.width - left)) & !1, (height.min(image.height - top)) & !1]
}

/// What the file says.
pub(super) fn header(path: &Path) -> Result<Header, MeasureError> {
    let (image, exposure_s) = decode(path, true)?;
    let [_, _, width, height] = lit(&image);
    let mosaic = matches!(image.photometric, RawPhotometricInterpretation::Cfa(_));
    let cell = if mosaic { 2 } else { 1 };
    let black = image.blacklevel.as_vec();
    let mean_black = black.iter().map(|level| f64::from(*level)).sum::<f64>() / black.len().max(1) as f64;
    Ok(Header {
        width: width / cell,
        height: height / cell,
        colour: mosaic || image.cpp >= 3,
        largest: f64::from(u16::MAX),
        exposure_s,
        black_level: (!black.is_empty()).then_some(mean_black),
        saturation_level: image.whitelevel.0.first().map(|level| f64::from(*level)),
        curve: None,
    })
}

/// The planes asked for.
pub(super) fn planes(path: &Path, wanted: &[ColourPlane]) -> Result<Vec<Plane>, MeasureError> {
    let (image, _) = decode(path, false)?;
    let [left, top, width, height] = lit(&image);
    let data = image.data.as_f32();
    let stride = image.width * image.cpp;
    let RawPhotometricInterpretation::Cfa(config) = &image.photometric else {
        let mut unweaver = Unweaver::new(width, height, image.cpp, wanted);
        for y in 0..height {
            unweaver.row(y, |i| data[(top + y) * stride + left * image.cpp + i]);
        }
        return Ok(unweaver.planes);
    };
    if (config.cfa.width, config.cfa.height) != (2, 2) {
        let found = format!("a mosaic of {} × {} pixels", config.cfa.width, config.cfa.height);
        return Err(MeasureError::frame(path, found, "a Bayer mosaic of 2 × 2, or a developed 16-bit TIFF"));
    }
    let plane = |wanted: &ColourPlane| {
        let cell: Vec<usize> =
            (0..4).filter(|i| config.cfa.color_at(top + i / 2, left + i % 2) == wanted.index()).collect();
        let mut plane = Plane::new(width / 2, height / 2);
        for (i, target) in plane.values.iter_mut().enumerate() {
            let corner = (top + i / (width / 2) * 2) * stride + left + i % (width / 2) * 2;
            let sum: f32 = cell.iter().map(|at| data[corner + at / 2 * stride + at % 2]).sum();
            *target = sum / cell.len() as f32;
        }
        plane
    };
    Ok(wanted.iter().map(plane).collect())
}
