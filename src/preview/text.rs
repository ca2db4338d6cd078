//! Words on a canvas, in an antialiased bitmap font.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use super::{canvas::Canvas, style::Rgb};

/// A size and weight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Font {
    /// Notes.
    Small,
    /// Labels.
    Normal,
    /// Labels that matter.
    Strong,
    /// Headings.
    Title,
}

impl Font {
    fn style(self) -> (FontWeight, RasterHeight) {
        match self {
            Self::Small => (FontWeight::Regular, RasterHeight::Size20),
            Self::Normal => (FontWeight::Regular, RasterHeight::Size24),
            Self::Strong => (FontWeight::Bold, RasterHeight::Size24),
            Self::Title => (FontWeight::Bold, RasterHeight::Size32),
        }
    }

    /// Height of a line, pixels.
    pub fn height(self) -> usize {
        self.style().1.val()
    }

    /// Width of a text, pixels.
    pub fn width(self, text: &str) -> usize {
        let (weight, height) = self.style();
        text.chars().count() * get_raster_width(weight, height)
    }

    /// The text, cut short with two dots if it is wider than `pixels`.
    pub fn fit(self, text: &str, pixels: usize) -> String {
        if self.width(text) <= pixels {
            return text.to_owned();
        }
        let room = pixels / self.width("x");
        let kept = text.chars().take(room.saturating_sub(2));
        kept.chain("..".chars()).take(room).collect()
    }

    /// Draws a text with its upper left corner at (x, y). Characters that the font lacks become question marks.
    pub fn draw(self, canvas: &mut Canvas, [x, y]: [usize; 2], text: &str, colour: Rgb) {
        let (weight, height) = self.style();
        let mut left = x;
        for c in text.chars() {
            let glyph = get_raster(c, weight, height).or_else(|| get_raster('?', weight, height));
            let Some(glyph) = glyph else { continue };
            for (dy, row) in glyph.rows().enumerate() {
                for (dx, &ink) in row.iter().enumerate().filter(|(_, ink)| **ink > 0) {
                    canvas.blend(left + dx, y + dy, colour, f32::from(ink) / 255.0);
                }
            }
            left += glyph.width();
        }
    }
}
