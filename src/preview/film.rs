//! Many small slices in one picture, for a page to leaf through.

use super::{
    canvas::Canvas,
    style::{PANEL, Palette, encoded},
    volume::Volume,
};
use crate::voxel::Lattice;

/// Its name in the output folder.
pub const FILM_STRIP: &str = "preview/film.png";
/// Most frames.
const FRAMES: usize = 96;
/// Frames in a row.
const COLUMNS: usize = 8;

/// How the frames lie in the picture: rows of eight, from the lowest slice up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilmStrip {
    /// Frames.
    pub frames: usize,
    /// Frames in a row.
    pub columns: usize,
    /// Rows of frames.
    pub rows: usize,
    /// Pixels of a frame.
    pub pixels: [usize; 2],
    /// Width and height of what a frame shows, mm.
    pub size_mm: [f64; 2],
    /// Height of what all frames show, mm.
    pub height_mm: f64,
}

impl FilmStrip {
    /// The layout for a job on `lattice`.
    pub fn of(lattice: &Lattice) -> Self {
        Self::of_volume(&Volume::new(lattice, |k| k))
    }

    fn of_volume(volume: &Volume) -> Self {
        let [x, y, z] = volume.extent();
        let frames = volume.n[2].min(FRAMES);
        let (columns, pixels) = (COLUMNS.min(frames), [volume.n[0], volume.n[1]]);
        Self { frames, columns, rows: frames.div_ceil(columns), pixels, size_mm: [x, y], height_mm: z }
    }
}

/// Draws all frames.
pub(super) fn film(volume: &Volume, palette: &Palette) -> Canvas {
    let strip = FilmStrip::of_volume(volume);
    let [width, height] = strip.pixels;
    let mut canvas = Canvas::new(strip.columns * width, strip.rows * height, PANEL);
    for frame in 0..strip.frames {
        let z = (2 * frame + 1) * volume.n[2] / (2 * strip.frames);
        let [left, top] = [frame % strip.columns * width, frame / strip.columns * height];
        for (row, y) in (0..height).rev().enumerate() {
            for x in 0..width {
                if let Some(colour) = palette.flat(volume.ids[volume.index([x, y, z])]) {
                    canvas.pixels[left + x + canvas.width * (top + row)] = encoded(colour);
                }
            }
        }
    }
    canvas
}
