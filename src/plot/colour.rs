//! Colours of plots.

pub use crate::colour::Rgb;

/// Text and axes.
pub const INK: Rgb = [0x1f, 0x26, 0x30];
/// Text of less weight, ticks.
pub(super) const FAINT: Rgb = [0x5b, 0x66, 0x74];
/// Lines across the frame.
pub(super) const GRID: Rgb = [0xe3, 0xe6, 0xea];
/// The page.
pub(super) const PAPER: Rgb = [0xff, 0xff, 0xff];

// Okabe and Ito's set, told apart with all common kinds of colour vision; yellow is left out, too light for a line on
// white.
/// A series' colour.
pub const BLUE: Rgb = [0x00, 0x72, 0xb2];
/// A series' colour.
pub const VERMILION: Rgb = [0xd5, 0x5e, 0x00];
/// A series' colour.
pub const GREEN: Rgb = [0x00, 0x9e, 0x73];
/// A series' colour.
pub const PINK: Rgb = [0xcc, 0x79, 0xa7];
/// A series' colour.
pub const ORANGE: Rgb = [0xe6, 0x9f, 0x00];
/// A series' colour.
pub const SKY: Rgb = [0x56, 0xb4, 0xe9];
/// A series' colour.
pub const BLACK: Rgb = [0x14, 0x18, 0x1e];
/// What stands back: references, samples.
pub const GREY: Rgb = [0x9a, 0xa4, 0xb0];
/// What must be seen: the house's accent.
pub const RED: Rgb = [0xc2, 0x41, 0x2d];

/// Colours for series in their order; more than these cannot be told apart.
pub const SERIES: [Rgb; 7] = [BLUE, VERMILION, GREEN, PINK, ORANGE, SKY, BLACK];

/// The colour map viridis (Smith and van der Walt 2015, CC0) at `part` of its length, 0 to 1; what lies beyond gets the
/// ends.
pub fn viridis(part: f64) -> Rgb {
    // Every fifteenth of its length; lines in between are within 3 of 255 of the original.
    const MAP: [Rgb; 16] = [
        [68, 1, 84],
        [72, 26, 108],
        [71, 47, 125],
        [65, 68, 135],
        [57, 86, 140],
        [49, 104, 142],
        [42, 120, 142],
        [35, 136, 142],
        [31, 152, 139],
        [34, 168, 132],
        [53, 183, 121],
        [84, 197, 104],
        [122, 209, 81],
        [165, 219, 54],
        [210, 226, 27],
        [253, 231, 37],
    ];
    let along = part.clamp(0.0, 1.0) * (MAP.len() - 1) as f64;
    let i = (along as usize).min(MAP.len() - 2);
    std::array::from_fn(|c| {
        let (from, to) = (f64::from(MAP[i][c]), f64::from(MAP[i + 1][c]));
        (from + (to - from) * (along - i as f64)).round() as u8
    })
}
