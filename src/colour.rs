//! Colour: sRGB as files and screens hold it (IEC 61966-2-1), and the light it stands for.
//!
//! Encoded values are bytes ([`Rgb`]) or numbers from 0 to 1 as a file stores them; light is linear, 1 is white. What
//! is mixed, averaged or scattered is light.

/// A colour encoded as sRGB.
pub type Rgb = [u8; 3];
/// A colour in linear light, 0 to 1.
pub(crate) type LinearRgb = [f32; 3];

/// Weights of red, green and blue light in the luminance (Rec. 709).
pub const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// The curve in the precision of its argument, with that precision's power.
macro_rules! decoded {
    ($encoded:expr, $power:expr) => {
        if $encoded <= 0.04045 { $encoded / 12.92 } else { $power(($encoded + 0.055) / 1.055, 2.4) }
    };
}

/// The light of an encoded value, 0 to 1.
pub fn srgb_to_linear(encoded: f32) -> f32 {
    decoded!(encoded, f32::powf)
}

/// The light of an encoded value in double precision, the same on every system.
pub fn srgb_to_linear_f64(encoded: f64) -> f64 {
    decoded!(encoded, libm::pow)
}

/// The light of an encoded byte.
pub(crate) fn byte_to_linear(encoded: u8) -> f32 {
    srgb_to_linear(f32::from(encoded) / 255.0)
}

/// Light from 0 to 1, encoded; the same on every system.
pub fn linear_to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

/// Light encoded as a byte; what lies beyond 0 and 1 gets the ends.
pub fn linear_to_byte(linear: f64) -> u8 {
    (255.0 * linear_to_srgb(linear.clamp(0.0, 1.0))).round() as u8
}

/// The albedo a set of `channels` sees in a linear colour: itself for three, the [`LUMINANCE`] for one.
pub fn to_channels(rgb: [f32; 3], channels: usize, out: &mut Vec<f32>) {
    if channels == 3 {
        out.extend(rgb);
    } else {
        let [r, g, b] = LUMINANCE.map(|weight| weight as f32);
        let luminance = r * rgb[0] + g * rgb[1] + b * rgb[2];
        out.extend(std::iter::repeat_n(luminance, channels));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_survives_decoding_and_encoding() {
        for byte in 0..=255 {
            assert_eq!(linear_to_byte(f64::from(byte_to_linear(byte))), byte);
            assert_eq!(linear_to_byte(srgb_to_linear_f64(f64::from(byte) / 255.0)), byte);
        }
    }

    #[test]
    fn the_ends_and_the_middle_are_the_standard_s() {
        assert_eq!([linear_to_byte(-1.0), linear_to_byte(2.0), linear_to_byte(0.5)], [0, 255, 188]);
        assert!((srgb_to_linear(0.5) - 0.214_041).abs() < 1e-6);
        assert!((LUMINANCE.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }
}
