//! PNG of 16 bits, row by row.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use png::{BitDepth, ColorType, Decoder, Reader};

use super::{ColourPlane, Header, Plane, Unweaver};
use crate::measure::MeasureError;

const EXPECTED: &str = "a PNG of 16 bits, grey or RGB";

fn open(path: &Path) -> Result<Reader<BufReader<File>>, MeasureError> {
    let file =
        crate::regular_file::open(path).map_err(|source| MeasureError::Read { file: path.to_path_buf(), source })?;
    let reader = Decoder::new(BufReader::new(file)).read_info().map_err(|error| damaged(path, &error))?;
    let (colour, depth) = reader.output_color_type();
    if depth != BitDepth::Sixteen {
        return Err(MeasureError::frame(path, format!("{} bits per sample", depth as u8), EXPECTED));
    }
    if colour == ColorType::Indexed {
        return Err(MeasureError::frame(path, "a palette", EXPECTED));
    }
    Ok(reader)
}

fn damaged(path: &Path, error: &png::DecodingError) -> MeasureError {
    MeasureError::frame(path, format!("a damaged PNG ({error})"), "a whole one")
}

/// What the file says.
pub(super) fn header(path: &Path) -> Result<Header, MeasureError> {
    let reader = open(path)?;
    let info = reader.info();
    let gamma = info.gama_chunk.map(|gamma| gamma.into_value()).filter(|gamma| (gamma - 1.0).abs() > 1e-3);
    let curve = match (info.srgb, gamma) {
        (Some(_), _) => Some("values encoded as sRGB".to_owned()),
        (None, Some(gamma)) => Some(format!("values encoded with a gamma of {gamma}")),
        (None, None) => None,
    };
    Ok(Header {
        width: info.width as usize,
        height: info.height as usize,
        colour: samples(reader.output_color_type().0) >= 3,
        largest: 65535.0,
        exposure_s: None,
        black_level: None,
        saturation_level: None,
        curve,
    })
}

/// The planes asked for.
pub(super) fn planes(path: &Path, wanted: &[ColourPlane]) -> Result<Vec<Plane>, MeasureError> {
    let mut reader = open(path)?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    if reader.info().interlaced {
        return Err(MeasureError::frame(path, "an interlaced PNG", "one written row by row"));
    }
    let mut unweaver = Unweaver::new(width, height, samples(reader.output_color_type().0), wanted);
    for y in 0..height {
        let row = reader.next_row().map_err(|error| damaged(path, &error))?;
        let Some(row) = row else { return Err(MeasureError::frame(path, format!("{y} rows"), format!("{height}"))) };
        let data = row.data();
        unweaver.row(y, |i| f32::from(u16::from_be_bytes([data[2 * i], data[2 * i + 1]])));
    }
    Ok(unweaver.planes)
}

fn samples(colour: ColorType) -> usize {
    colour.samples()
}
