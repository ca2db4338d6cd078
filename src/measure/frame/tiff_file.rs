//! TIFF of 16 bits or floating point, strip by strip.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::SampleFormat;
use tiff::tags::Tag;

use super::{ColourPlane, Header, Plane};
use crate::measure::MeasureError;

const EXPECTED: &str = "a TIFF of 16 bits or 32-bit floating point, grey or RGB";

struct Opened {
    decoder: Decoder<BufReader<File>>,
    width: usize,
    height: usize,
    samples: usize,
    floating: bool,
}

fn open(path: &Path) -> Result<Opened, MeasureError> {
    let file =
        crate::regular_file::open(path).map_err(|source| MeasureError::Read { file: path.to_path_buf(), source })?;
    let damaged = |error| damaged(path, &error);
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(damaged)?;
    let (width, height) = decoder.dimensions().map_err(damaged)?;
    let (samples, bits) = match decoder.colortype().map_err(damaged)? {
        ColorType::Gray(bits) => (1, bits),
        ColorType::GrayA(bits) => (2, bits),
        ColorType::RGB(bits) => (3, bits),
        ColorType::RGBA(bits) => (4, bits),
        other => return Err(MeasureError::frame(path, format!("{other:?}"), EXPECTED)),
    };
    let format = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat).ok().flatten();
    let format = format.and_then(|formats| formats.first().copied());
    let floating = format == Some(SampleFormat::IEEEFP.to_u16());
    if bits != if floating { 32 } else { 16 } {
        return Err(MeasureError::frame(path, format!("{bits} bits per sample"), EXPECTED));
    }
    if decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).ok().flatten() == Some(2) {
        return Err(MeasureError::frame(path, "colours in separate planes", "interleaved colours"));
    }
    Ok(Opened { decoder, width: width as usize, height: height as usize, samples, floating })
}

fn damaged(path: &Path, error: &tiff::TiffError) -> MeasureError {
    MeasureError::frame(path, format!("a damaged TIFF ({error})"), "a whole one")
}

/// What the file says.
pub(super) fn header(path: &Path) -> Result<Header, MeasureError> {
    let opened = open(path)?;
    Ok(Header {
        width: opened.width,
        height: opened.height,
        colour: opened.samples >= 3,
        largest: if opened.floating { f64::INFINITY } else { 65535.0 },
        exposure_s: None,
        black_level: None,
        saturation_level: None,
        curve: None,
    })
}

/// The planes asked for.
pub(super) fn planes(path: &Path, wanted: &[ColourPlane]) -> Result<Vec<Plane>, MeasureError> {
    let Opened { mut decoder, width, height, samples, .. } = open(path)?;
    let mut planes: Vec<Plane> = wanted.iter().map(|_| Plane::new(width, height)).collect();
    let (chunk_width, chunk_height) = decoder.chunk_dimensions();
    let (across, down) = (width.div_ceil(chunk_width as usize), height.div_ceil(chunk_height as usize));
    for chunk in 0..across * down {
        let (left, top) = (chunk % across * chunk_width as usize, chunk / across * chunk_height as usize);
        let index = u32::try_from(chunk).unwrap_or(u32::MAX);
        let (cut_width, cut_height) = decoder.chunk_data_dimensions(index);
        let data = decoder.read_chunk(index).map_err(|error| damaged(path, &error))?;
        let value: Box<dyn Fn(usize) -> f32> = match &data {
            DecodingResult::U16(values) => Box::new(|i| f32::from(values[i])),
            DecodingResult::F32(values) => Box::new(|i| values[i]),
            _ => return Err(MeasureError::frame(path, "samples of another type", EXPECTED)),
        };
        let cut_width = cut_width as usize;
        for (plane, wanted) in planes.iter_mut().zip(wanted) {
            let offset = if samples >= 3 { wanted.index() } else { 0 };
            for y in 0..cut_height as usize {
                let row = &mut plane.values[(top + y) * width + left..][..cut_width];
                row.iter_mut()
                    .enumerate()
                    .for_each(|(x, target)| *target = value((y * cut_width + x) * samples + offset));
            }
        }
    }
    Ok(planes)
}
