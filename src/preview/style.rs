//! Colours: of the page, and of materials on it.
//!
//! Mixing is done in linear light; colours are sRGB at the edges.

use std::sync::LazyLock;

use super::PreviewMaterial;
pub(super) use crate::colour::{LinearRgb as Linear, Rgb};
use crate::colour::{byte_to_linear, linear_to_byte};

/// The page: light, yet dark enough for white resin to stand out.
pub(super) const PAGE: Rgb = [0xe9, 0xeb, 0xee];
/// Behind a slice or cut.
pub(super) const PANEL: Rgb = [0xcf, 0xd4, 0xda];
/// The edge of a panel.
pub(super) const PANEL_EDGE: Rgb = [0xb9, 0xc0, 0xc9];
/// Text and scale bars.
pub(super) const INK: Rgb = [0x1f, 0x26, 0x30];
/// Text of less weight.
pub(super) const FAINT: Rgb = [0x5b, 0x66, 0x74];
/// Where cuts pass.
pub(super) const ACCENT: Rgb = [0xc2, 0x41, 0x2d];
/// The support: its tint, and the hatch on it.
pub(super) const SUPPORT: Rgb = [0xf1, 0xdf, 0xb6];
const SUPPORT_HATCH: Rgb = [0xcf, 0xa8, 0x5c];
/// What no material was given for.
const UNKNOWN: Rgb = [0xb0, 0x3a, 0x9e];
/// Distance between hatch lines along a row, pixels.
pub(super) const HATCH_PERIOD: f32 = 10.0;
/// Which part of the period is line.
const HATCH_DUTY: f32 = 0.22;

/// What an id is drawn with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Paint {
    /// Nothing is there.
    Empty,
    /// One colour.
    Plain(Linear),
    /// Support: a tint and diagonal lines.
    Hatched,
}

/// Paint by id.
#[derive(Debug, Clone)]
pub(super) struct Palette {
    paints: [Paint; 256],
    support: Linear,
    hatch: Linear,
}

impl Palette {
    pub fn new(materials: &[PreviewMaterial]) -> Self {
        let mut paints = [Paint::Plain(linear(UNKNOWN)); 256];
        for material in materials {
            let [r, g, b, _] = material.rgba;
            paints[usize::from(material.id.0)] =
                if material.is_void() { Paint::Hatched } else { Paint::Plain(linear([r, g, b])) };
        }
        paints[0] = Paint::Empty;
        Self { paints, support: linear(SUPPORT), hatch: linear(SUPPORT_HATCH) }
    }

    /// The paint of an id.
    pub fn paint(&self, id: u8) -> Paint {
        self.paints[usize::from(id)]
    }

    /// The colour of an id without its hatch; `None` for the background.
    pub fn flat(&self, id: u8) -> Option<Linear> {
        match self.paint(id) {
            Paint::Empty => None,
            Paint::Plain(colour) => Some(colour),
            Paint::Hatched => Some(self.support),
        }
    }

    /// The colour of an id at `along`, a position across the hatch in pixels; `None` for the background.
    pub fn at(&self, id: u8, along: f32) -> Option<Linear> {
        match self.paint(id) {
            Paint::Hatched => Some(mix(self.support, self.hatch, hatch(along))),
            _ => self.flat(id),
        }
    }
}

/// How much of a pixel at `along` pixels across the hatch is line, smoothed over one pixel.
fn hatch(along: f32) -> f32 {
    let phase = along.rem_euclid(HATCH_PERIOD) - 0.5 * HATCH_PERIOD;
    (0.5 * HATCH_DUTY * HATCH_PERIOD + 0.5 - phase.abs()).clamp(0.0, 1.0)
}

/// `a` at 0, `b` at 1.
pub(super) fn mix(a: Linear, b: Linear, part: f32) -> Linear {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * part)
}

/// Decodes sRGB.
pub(super) fn linear(colour: Rgb) -> Linear {
    colour.map(byte_to_linear)
}

/// Encodes sRGB.
pub(super) fn encoded(colour: Linear) -> Rgb {
    // Fine enough that every 8-bit value has entries of its own, even at the steep dark end.
    const STEPS: usize = 1 << 13;
    static TABLE: LazyLock<Vec<u8>> =
        LazyLock::new(|| (0..=STEPS).map(|n| linear_to_byte(n as f64 / STEPS as f64)).collect());
    let table = &TABLE[..];
    colour.map(|v| table[(v.clamp(0.0, 1.0) * STEPS as f32 + 0.5) as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_survives_decoding_and_encoding() {
        for v in 0..=255 {
            assert_eq!(encoded(linear([v; 3])), [v; 3]);
        }
    }

    #[test]
    fn support_is_hatched_and_the_background_is_nothing() {
        let support = PreviewMaterial { id: crate::voxel::MaterialId(2), name: "s".into(), rgba: [255, 255, 255, 0] };
        let palette = Palette::new(&[support]);
        let shades: Vec<_> = (0..10).map(|n| encoded(palette.at(2, n as f32).unwrap())).collect();
        assert!(shades.contains(&SUPPORT) && shades.contains(&SUPPORT_HATCH));
        assert_eq!(palette.at(0, 0.0), None);
        assert_eq!(palette.paint(9), Paint::Plain(linear(UNKNOWN)));
    }
}
