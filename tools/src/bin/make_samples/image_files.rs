//! 8-bit images: encoding, shrinking, PNG.

use lumislice::colour::{linear_to_srgb, srgb_to_linear_f64};
use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, Filter, SrgbRenderingIntent};

/// Whether values are light (sRGB-encoded) or plain numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Meaning {
    SrgbLight,
    Number,
}

/// 0…1 as 0…255, rounded.
pub fn to_byte(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// A square sRGB image at `1 / factor` of its side, averaged as light.
pub fn shrink_srgb(texels: &[u8], size: usize, factor: usize) -> Vec<u8> {
    let light: Vec<f64> = (0..=255).map(|v| srgb_to_linear_f64(f64::from(v) / 255.0)).collect();
    let small = size / factor;
    (0..small * small)
        .map(|at| {
            let (x, y) = (at % small * factor, at / small * factor);
            let sum: f64 = (0..factor * factor)
                .map(|i| light[usize::from(texels[(y + i / factor) * size + x + i % factor])])
                .sum();
            to_byte(linear_to_srgb(sum / (factor * factor) as f64))
        })
        .collect()
}

/// A square grey image as a PNG file.
pub fn grey_png(texels: &[u8], size: usize, meaning: Meaning) -> Result<Vec<u8>, EncodingError> {
    png(texels, size, ColorType::Grayscale, meaning)
}

/// A square sRGB image as a PNG file, from a plane per channel.
pub fn rgb_png(planes: [&[u8]; 3], size: usize) -> Result<Vec<u8>, EncodingError> {
    let texels: Vec<u8> = (0..size * size).flat_map(|at| planes.map(|plane| plane[at])).collect();
    png(&texels, size, ColorType::Rgb, Meaning::SrgbLight)
}

fn png(texels: &[u8], size: usize, colour: ColorType, meaning: Meaning) -> Result<Vec<u8>, EncodingError> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, size as u32, size as u32);
    encoder.set_color(colour);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::High);
    encoder.set_filter(Filter::Adaptive);
    if meaning == Meaning::SrgbLight {
        encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(texels)?;
    writer.finish()?;
    Ok(file)
}
