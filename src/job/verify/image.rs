//! One image, row by row, in the memory of a row.

use std::{
    fs::File,
    io::{BufReader, Read},
};

use png::{BitDepth, ColorType, PixelDimensions, Reader, Unit};

use crate::job::manifest::LatticeRecord;

/// Bytes the decoder may take for chunks that are no image; ours have none.
const MAX_CHUNK_BYTES: usize = 1 << 20;
/// Bytes a row may take beyond which no lattice goes: 2²⁰ voxels of four bytes, and the decoder's own copies.
const MAX_ROW_BYTES: usize = 16 << 20;

/// What the pixels of an image are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// 32-bit RGBA.
    Slice,
    /// 1 bit.
    Mask,
}

impl Kind {
    fn format(self) -> (ColorType, BitDepth) {
        match self {
            Self::Slice => (ColorType::Rgba, BitDepth::Eight),
            Self::Mask => (ColorType::Grayscale, BitDepth::One),
        }
    }

    /// Bytes of a row of `width` pixels.
    fn row_bytes(self, width: u32) -> usize {
        match self {
            Self::Slice => width as usize * 4,
            Self::Mask => (width as usize).div_ceil(8),
        }
    }
}

/// An image being read.
pub(super) struct Image {
    reader: Reader<BufReader<File>>,
    row: Vec<u8>,
}

impl Image {
    /// Opens an image that must be of `kind` and of the size and resolution of `lattice`; otherwise says what it is.
    pub(super) fn open(file: File, kind: Kind, lattice: &LatticeRecord) -> Result<Self, String> {
        let undecodable = |error: png::DecodingError| format!("cannot be decoded: {error}");
        let limits = png::Limits { bytes: MAX_CHUNK_BYTES + MAX_ROW_BYTES };
        let mut decoder = png::Decoder::new_with_limits(BufReader::new(file), limits);
        let header = decoder.read_header_info().map_err(undecodable)?;
        let [width, height, _] = lattice.dims;
        if (header.width, header.height) != (width, height) {
            return Err(format!("found {} × {} pixels, expected {width} × {height}", header.width, header.height));
        }
        let (color, depth) = kind.format();
        if (header.color_type, header.bit_depth) != (color, depth) {
            let bits = |depth: BitDepth| depth as u8;
            return Err(format!(
                "found {:?} of {} bits a sample, expected {color:?} of {}",
                header.color_type,
                bits(header.bit_depth),
                bits(depth),
            ));
        }
        if header.interlaced {
            return Err("found an interlaced image, expected one that is not".to_owned());
        }
        let reader = decoder.read_info().map_err(undecodable)?;
        let info = reader.info();
        if info.animation_control.is_some() {
            return Err("found an animated image, expected a still one".to_owned());
        }
        let per_metre = |axis: usize| (1000.0 / lattice.pitch_mm[axis]).round() as u32;
        let expected = [per_metre(0), per_metre(1)];
        let found = match info.pixel_dims {
            Some(PixelDimensions { xppu, yppu, unit: Unit::Meter }) if [xppu, yppu] == expected => None,
            Some(PixelDimensions { xppu, yppu, unit: Unit::Meter }) => Some(format!("{xppu} × {yppu} pixels per m")),
            Some(PixelDimensions { xppu, yppu, .. }) => Some(format!("{xppu} × {yppu} pixels per unknown unit")),
            None => Some("no resolution".to_owned()),
        };
        if let Some(found) = found {
            return Err(format!("found {found}, expected {} × {} pixels per m", expected[0], expected[1]));
        }
        Ok(Self { row: vec![0; kind.row_bytes(width)], reader })
    }

    /// The next row.
    pub(super) fn next_row(&mut self) -> Result<&[u8], String> {
        match self.reader.read_row(&mut self.row) {
            Ok(Some(_)) => Ok(&self.row),
            Ok(None) => Err("found fewer rows than its header says".to_owned()),
            Err(error) => Err(format!("cannot be decoded: {error}")),
        }
    }

    /// Reads what follows the last row.
    pub(super) fn finish(mut self) -> Result<(), String> {
        self.reader.finish().map_err(|error| format!("cannot be decoded: {error}"))
    }
}

/// The whole of a small file.
pub(super) fn read_all(file: File, most: u64) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    file.take(most + 1).read_to_end(&mut bytes).map_err(|error| format!("cannot be read: {error}"))?;
    if bytes.len() as u64 > most { Err(format!("found more than {most} bytes")) } else { Ok(bytes) }
}
