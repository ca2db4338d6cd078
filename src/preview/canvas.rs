//! An image to draw on.

use super::{PreviewError, PreviewFile, style::Rgb};
use crate::picture::{Pixels, png};

/// A rectangle of whole pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub height: usize,
}

/// Opaque sRGB pixels, row 0 on top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Canvas {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<Rgb>,
}

impl Canvas {
    /// A canvas of one colour.
    pub fn new(width: usize, height: usize, colour: Rgb) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    /// One pixel.
    #[cfg(test)]
    pub fn pixel(&self, x: usize, y: usize) -> Rgb {
        self.pixels[x + self.width * y]
    }

    /// Paints one pixel; outside of the canvas nothing happens.
    pub fn blend(&mut self, x: usize, y: usize, colour: Rgb, opacity: f32) {
        if x < self.width && y < self.height {
            let pixel = &mut self.pixels[x + self.width * y];
            for (below, above) in pixel.iter_mut().zip(colour) {
                let below_f = f32::from(*below);
                *below = (below_f + (f32::from(above) - below_f) * opacity).round() as u8;
            }
        }
    }

    /// Fills a rectangle, clipped to the canvas.
    pub fn fill(&mut self, rect: Rect, colour: Rgb) {
        for y in rect.y..(rect.y + rect.height).min(self.height) {
            for x in rect.x..(rect.x + rect.width).min(self.width) {
                self.pixels[x + self.width * y] = colour;
            }
        }
    }

    /// Draws a frame of one pixel around a rectangle.
    pub fn frame(&mut self, rect: Rect, colour: Rgb) {
        let (left, top) = (rect.x.saturating_sub(1), rect.y.saturating_sub(1));
        let (width, height) = (rect.width + 2, rect.height + 2);
        self.fill(Rect { x: left, y: top, width, height: 1 }, colour);
        self.fill(Rect { x: left, y: top + height - 1, width, height: 1 }, colour);
        self.fill(Rect { x: left, y: top, width: 1, height }, colour);
        self.fill(Rect { x: left + width - 1, y: top, width: 1, height }, colour);
    }

    /// Lays a picture of so many columns with its upper left corner at (x, y), all of it on the canvas.
    pub fn lay(&mut self, [x, y]: [usize; 2], columns: usize, pixels: &[Rgb]) {
        for (row, pixels) in pixels.chunks(columns).enumerate() {
            let start = x + self.width * (y + row);
            self.pixels[start..start + pixels.len()].copy_from_slice(pixels);
        }
    }

    /// The canvas as an 8-bit RGB PNG of this path.
    ///
    /// # Errors
    /// [`PreviewError::Encode`].
    pub fn file(&self, path: String) -> Result<PreviewFile, PreviewError> {
        match png(self.width, Pixels::Rgb8(&self.pixels)) {
            Ok(png) => Ok(PreviewFile { path, png }),
            Err(error) => Err(PreviewError::Encode { path, reason: error.to_string() }),
        }
    }
}
