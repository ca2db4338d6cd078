//! An image to draw on.

use png::EncodingError;

use super::style::Rgb;
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

    /// The canvas as an 8-bit RGB PNG.
    pub fn png(&self) -> Result<Vec<u8>, EncodingError> {
        png(self.width, Pixels::Rgb8(&self.pixels))
    }
}
