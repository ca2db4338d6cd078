//! Text as coverage, for pictures that are painted pixel by pixel.

use tiny_skia::{FillRule, Mask, Transform};

use super::font::{Line, Weight, outline};
use super::pixels::path;

/// How far letters reach below the base line, ems; capitals with marks reach 0.95 above it.
const BELOW: f64 = 0.25;

/// A line of text in the plots' font.
pub(crate) struct Label {
    line: Line,
}

impl Label {
    /// Lays a text out; `em` is its size in pixels.
    pub fn new(text: &str, em: f64, bold: bool) -> Self {
        Self { line: Line::new(text, em, if bold { Weight::Bold } else { Weight::Regular }) }
    }

    /// Its width, pixels.
    pub fn width(&self) -> f64 {
        self.line.width
    }

    /// Calls `paint` with column, row and coverage (0 to 255) of every pixel that the text touches. Column 0 is where
    /// it starts; `height` rows hold all of it if they are 1.2 ems.
    pub fn paint(&self, height: usize, mut paint: impl FnMut(usize, usize, u8)) {
        // Glyphs may reach a little beyond their advance.
        let (columns, rows) = ((self.line.width + self.line.size).ceil() as u32, height as u32);
        let Some(mut mask) = Mask::new(columns, rows) else { return };
        let base = (height as f64 - BELOW * self.line.size).floor() as f32;
        for glyph in &self.line.glyphs {
            let [x, y] = glyph.at.map(|along| along as f32);
            let size = self.line.size as f32;
            let place = Transform::from_translate(x, base + y).pre_scale(size, size);
            if let Some(path) = path(&outline(self.line.weight, glyph.id)) {
                mask.fill_path(&path, FillRule::Winding, true, place);
            }
        }
        for (at, &coverage) in mask.data().iter().enumerate().filter(|(_, coverage)| **coverage > 0) {
            paint(at % columns as usize, at / columns as usize, coverage);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_as_wide_as_it_says_and_within_its_line() {
        for text in ["Cut-away", "support (printer fills it)", "~557 mm³", "µ", "Ågç", ""] {
            let label = Label::new(text, 20.0, false);
            let ink = |height| {
                let (mut touched, mut ink) = (0, 0);
                label.paint(height, |x, _, coverage| {
                    touched = touched.max(x + 1);
                    ink += usize::from(coverage);
                });
                assert!(touched as f64 <= label.width() + 1.0, "{text}: {touched}");
                ink
            };
            // More room shows no more of it.
            assert_eq!(ink(24), ink(40), "{text}");
            assert_eq!(ink(24) > 0, !text.is_empty(), "{text}");
        }
    }

    #[test]
    fn bold_is_bolder() {
        let ink = |bold| {
            let mut ink = 0_usize;
            Label::new("white", 20.0, bold).paint(24, |_, _, coverage| ink += usize::from(coverage));
            ink
        };
        assert!(ink(true) > ink(false) * 5 / 4);
    }
}
