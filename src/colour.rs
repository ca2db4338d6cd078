//! Colour: sRGB as files and screens hold it (IEC 61966-2-1), and the light it stands for.
//!
//! Encoded values are bytes ([`Rgb`]) or numbers from 0 to 1 as a file stores them; light is linear, 1 is white. What
//! is mixed, averaged or scattered is light.

use std::sync::LazyLock;

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
    decoded!(encoded, libm::powf)
}

/// The light of an encoded value in double precision, the same on every system.
pub fn srgb_to_linear_f64(encoded: f64) -> f64 {
    decoded!(encoded, libm::pow)
}

/// The light of an encoded byte.
pub(crate) fn byte_to_linear(encoded: u8) -> f32 {
    static LIGHT: LazyLock<[f32; 256]> =
        LazyLock::new(|| std::array::from_fn(|encoded| srgb_to_linear(encoded as f32 / 255.0)));
    LIGHT[usize::from(encoded)]
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

/// Luminance up to which CIE's lightness is a line, (6/29)³.
const LINE_END: f64 = 216.0 / 24_389.0;
/// Slope of that line for L*/100, 24389/2700.
const LINE_SLOPE: f64 = 24_389.0 / 2700.0;

/// CIE 1976 lightness L*, 0 to 100, of a luminance from 0 to 1.
pub fn lightness(luminance: f64) -> f64 {
    if luminance <= LINE_END { 100.0 * LINE_SLOPE * luminance } else { 116.0 * libm::cbrt(luminance) - 16.0 }
}

/// d(L*/100)/dY at a luminance Y; below 0 that of 0.
pub(crate) fn lightness_slope(luminance: f64) -> f64 {
    if luminance <= LINE_END { LINE_SLOPE } else { 1.16 / 3.0 * libm::pow(luminance, -2.0 / 3.0) }
}

/// CIE 1976 L*a*b* of linear sRGB light under D65.
pub fn lab([r, g, b]: [f64; 3]) -> [f64; 3] {
    // Of white, so that r = g = b is grey to the last digit.
    let x = (0.412_456_4 * r + 0.357_576_1 * g + 0.180_437_5 * b) / 0.950_470;
    let y = (0.212_672_9 * r + 0.715_152_2 * g + 0.072_175_0 * b) / 1.000_000_1;
    let z = (0.019_333_9 * r + 0.119_192_0 * g + 0.950_304_1 * b) / 1.088_830;
    let [fx, fy, fz] = [x, y, z].map(|value| (lightness(value) + 16.0) / 116.0);
    [116.0 * fy - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)]
}

/// The colour difference CIEDE2000 of two colours in L*a*b*, after Sharma, Wu and Dalal 2005; 1 is just visible side by
/// side.
pub fn delta_e_2000([l1, a1, b1]: [f64; 3], [l2, a2, b2]: [f64; 3]) -> f64 {
    let seventh = |c: f64| (c.powi(7) / (c.powi(7) + 25.0_f64.powi(7))).sqrt();
    let g = 0.5 * (1.0 - seventh(0.5 * (libm::hypot(a1, b1) + libm::hypot(a2, b2))));
    let polar = |a: f64, b: f64| {
        let a = (1.0 + g) * a;
        let hue = if a == 0.0 && b == 0.0 { 0.0 } else { libm::atan2(b, a).to_degrees().rem_euclid(360.0) };
        (libm::hypot(a, b), hue)
    };
    let ((c1, h1), (c2, h2)) = (polar(a1, b1), polar(a2, b2));
    let colourless = c1 * c2 == 0.0;
    let turn = match h2 - h1 {
        _ if colourless => 0.0,
        turn if turn > 180.0 => turn - 360.0,
        turn if turn < -180.0 => turn + 360.0,
        turn => turn,
    };
    let hue = match h1 + h2 {
        sum if colourless => sum,
        sum if (h1 - h2).abs() <= 180.0 => 0.5 * sum,
        sum if sum < 360.0 => 0.5 * sum + 180.0,
        sum => 0.5 * sum - 180.0,
    };
    let sin = |degrees: f64| libm::sin(degrees.to_radians());
    let cos = |degrees: f64| libm::cos(degrees.to_radians());
    let (l, c) = (0.5 * (l1 + l2) - 50.0, 0.5 * (c1 + c2));
    let t = 1.0 - 0.17 * cos(hue - 30.0) + 0.24 * cos(2.0 * hue) + 0.32 * cos(3.0 * hue + 6.0)
        - 0.20 * cos(4.0 * hue - 63.0);
    let dl = (l2 - l1) / (1.0 + 0.015 * l * l / (20.0 + l * l).sqrt());
    let dc = (c2 - c1) / (1.0 + 0.045 * c);
    let dh = 2.0 * (c1 * c2).sqrt() * sin(0.5 * turn) / (1.0 + 0.015 * c * t);
    let rotation = -2.0 * seventh(c) * sin(60.0 * libm::exp(-((hue - 275.0) / 25.0).powi(2)));
    (dl * dl + dc * dc + dh * dh + rotation * dc * dh).max(0.0).sqrt()
}

/// Three numbers whose squares sum to that of CIEDE2000, but that lightness, chroma and hue are told apart along the
/// hue of the mean of both colours instead of along the mean of their hues: no jump at grey or at opposite hues, and
/// the same to first order for colours of like hue.
pub(crate) fn difference_parts([l1, a1, b1]: [f64; 3], [l2, a2, b2]: [f64; 3]) -> [f64; 3] {
    let seventh = |c: f64| (c.powi(7) / (c.powi(7) + 25.0_f64.powi(7))).sqrt();
    let g = 0.5 * (1.0 - seventh(0.5 * (libm::hypot(a1, b1) + libm::hypot(a2, b2))));
    let (a1, a2) = ((1.0 + g) * a1, (1.0 + g) * a2);
    let c = 0.5 * (libm::hypot(a1, b1) + libm::hypot(a2, b2));
    let mean = [0.5 * (a1 + a2), 0.5 * (b1 + b2)];
    let length = libm::hypot(mean[0], mean[1]);
    let along = if length > 0.0 { mean.map(|x| x / length) } else { [1.0, 0.0] };
    let hue = libm::atan2(along[1], along[0]).to_degrees().rem_euclid(360.0);
    let cos = |degrees: f64| libm::cos(degrees.to_radians());
    let t = 1.0 - 0.17 * cos(hue - 30.0) + 0.24 * cos(2.0 * hue) + 0.32 * cos(3.0 * hue + 6.0)
        - 0.20 * cos(4.0 * hue - 63.0);
    let l = 0.5 * (l1 + l2) - 50.0;
    let [da, db] = [a2 - a1, b2 - b1];
    let dl = (l2 - l1) / (1.0 + 0.015 * l * l / (20.0 + l * l).sqrt());
    let dc = (da * along[0] + db * along[1]) / (1.0 + 0.045 * c);
    let dh = (db * along[0] - da * along[1]) / (1.0 + 0.015 * c * t);
    // dc² + dh² + r dc dh as two squares.
    let turned = 60.0 * libm::exp(-((hue - 275.0) / 25.0).powi(2));
    let half = -seventh(c) * libm::sin(turned.to_radians());
    [dl, dc + half * dh, (1.0 - half * half).max(0.0).sqrt() * dh]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of Sharma, Wu and Dalal 2005, table 1: 1, 7, 17, 20, 25, 31, 34.
    #[test]
    fn colour_differences_are_the_published_ones() {
        for (one, other, expected) in [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([50.0, 2.5, 0.0], [58.0, 24.0, 15.0], 19.4535),
            ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
            ([35.0831, -44.1164, 3.7933], [35.0232, -40.0716, 1.5901], 1.8645),
            ([2.0776, 0.0795, -1.1350], [0.9033, -0.0636, -0.5514], 0.9082),
        ] {
            for found in [delta_e_2000(one, other), delta_e_2000(other, one)] {
                assert!((found - expected).abs() < 1e-4, "{found} for {expected}");
            }
        }
        assert_eq!(delta_e_2000([50.0, 0.0, 0.0], [50.0, 0.0, 0.0]), 0.0);
    }

    #[test]
    fn parts_of_a_difference_are_ciede2000_for_like_hues() {
        for (one, other) in [
            ([50.0, 2.5, 0.0], [56.0, 2.0, -0.4]),
            ([33.0, 56.0, 47.0], [31.0, 36.0, 27.0]),
            ([30.0, 20.0, -60.0], [36.0, 12.0, -35.0]),
            ([60.0, -40.0, 35.0], [55.0, -20.0, 22.0]),
        ] {
            let parts = difference_parts(one, other);
            let found = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
            let expected = delta_e_2000(one, other);
            assert!((found / expected - 1.0).abs() < 0.02, "{found} for {expected}: {one:?}, {other:?}");
        }
        // Across grey it is steep, but nothing jumps.
        let across = |a: f64| difference_parts([50.0, 10.0, 0.0], [50.0, a, 0.1]);
        let size = |parts: [f64; 3]| parts.iter().map(|part| part * part).sum::<f64>();
        for at in [-10.0, 0.0] {
            let [before, after] = [-1e-8, 1e-8].map(|by| size(across(at + by)));
            assert!((before - after).abs() < 1e-3, "{before}, {after}");
        }
    }

    #[test]
    fn lightness_and_its_slope() {
        assert_eq!(lightness(1.0), 100.0);
        assert!((lightness(0.184_186_5) - 50.0).abs() < 1e-4);
        for y in [0.0, 0.004, 0.01, 0.2, 1.0] {
            let slope = (lightness(y + 1e-7) - lightness(y)) / 1e-5;
            assert!((lightness_slope(y) / slope - 1.0).abs() < 1e-4, "{y}");
        }
        let white = lab([1.0; 3]);
        assert!((white[0] - 100.0).abs() < 1e-9 && white[1].abs() < 0.01 && white[2].abs() < 0.01, "{white:?}");
        let red = lab([1.0, 0.0, 0.0]);
        assert!(red.iter().zip([53.24, 80.09, 67.20]).all(|(found, known)| (found - known).abs() < 0.02), "{red:?}");
    }

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
