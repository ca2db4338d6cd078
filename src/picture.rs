//! Pictures as PNG files in memory. Slices have an encoder of their own, which streams (`slice/png.rs`).

use png::{BitDepth, ColorType, Compression, Encoder, EncodingError};

use crate::colour::Rgb;

/// Pixels of a picture, row after row from the top.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Pixels<'a> {
    /// Grey of 8 bits.
    Grey8(&'a [u8]),
    /// Grey of 16 bits.
    Grey16(&'a [u16]),
    /// Red, green, blue of 8 bits.
    Rgb8(&'a [Rgb]),
}

impl Pixels<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Grey8(pixels) => pixels.len(),
            Self::Grey16(pixels) => pixels.len(),
            Self::Rgb8(pixels) => pixels.len(),
        }
    }
}

/// Rows of `columns` pixels as a PNG, well compressed.
///
/// # Errors
/// A picture without pixels, or one too large.
pub(crate) fn png(columns: usize, pixels: Pixels<'_>) -> Result<Vec<u8>, EncodingError> {
    encode(columns, pixels, Compression::Balanced)
}

/// [`png()`], but quickly made and larger.
#[cfg(any(test, feature = "measure"))]
pub(crate) fn fast_png(columns: usize, pixels: Pixels<'_>) -> Result<Vec<u8>, EncodingError> {
    encode(columns, pixels, Compression::Fast)
}

fn encode(columns: usize, pixels: Pixels<'_>, compression: Compression) -> Result<Vec<u8>, EncodingError> {
    let rows = pixels.len() / columns.max(1);
    let mut out = Vec::new();
    let mut encoder = Encoder::new(&mut out, columns as u32, rows as u32);
    encoder.set_compression(compression);
    let (colour, depth) = match pixels {
        Pixels::Grey8(_) => (ColorType::Grayscale, BitDepth::Eight),
        Pixels::Grey16(_) => (ColorType::Grayscale, BitDepth::Sixteen),
        Pixels::Rgb8(_) => (ColorType::Rgb, BitDepth::Eight),
    };
    encoder.set_color(colour);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header()?;
    let whole = columns * rows;
    match pixels {
        Pixels::Grey8(grey) => writer.write_image_data(&grey[..whole])?,
        Pixels::Grey16(grey) => {
            let bytes: Vec<u8> = grey[..whole].iter().flat_map(|value| value.to_be_bytes()).collect();
            writer.write_image_data(&bytes)?;
        }
        Pixels::Rgb8(colours) => writer.write_image_data(colours[..whole].as_flattened())?,
    }
    writer.finish()?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let read = |file: Vec<u8>| image::load_from_memory(&file).unwrap();
        let (grey, deep) = ([0, 1, 2, 253, 254, 255_u8], [0, 1, 256, 65_534, 65_535, 4_u16]);
        let colours: Vec<Rgb> = grey.map(|v| [v, 255 - v, 7]).to_vec();
        for encode in [png, fast_png] {
            assert_eq!(read(encode(3, Pixels::Grey8(&grey)).unwrap()).into_luma8().into_raw(), grey);
            assert_eq!(read(encode(2, Pixels::Grey16(&deep)).unwrap()).into_luma16().into_raw(), deep);
            let picture = read(encode(3, Pixels::Rgb8(&colours)).unwrap()).into_rgb8();
            assert_eq!((picture.dimensions(), picture.into_raw()), ((3, 2), colours.as_flattened().to_vec()));
        }
    }

    #[test]
    fn a_picture_has_pixels() {
        assert!(png(0, Pixels::Grey8(&[])).is_err() && png(3, Pixels::Grey8(&[1, 2])).is_err());
    }
}
