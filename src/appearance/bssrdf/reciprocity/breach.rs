//! What breaks the symmetry of light, in numbers and words.

/// What breaks the symmetry, with its size.
#[derive(Debug, Clone, PartialEq)]
pub enum Breach {
    /// Windows are another way round.
    Turned {
        /// How.
        how: &'static str,
        /// What they leave as they are, and turned back: root mean square differences as shares.
        leaves: [f64; 2],
    },
    /// Windows are shifted against their texels.
    Shifted {
        /// By how much, pixels to the right and down.
        pixels: [f64; 2],
    },
    /// A column or row of the windows is brighter than its mirror image.
    HotLine {
        /// "column" or "row".
        what: &'static str,
        /// Its place from the lit texel, pixels.
        at: isize,
        /// By this share.
        share: f64,
    },
    /// Rows or columns of lit texels have gains of their own.
    Gains {
        /// "row" or "column".
        what: &'static str,
        /// The worst one.
        at: usize,
        /// Its gain less 1.
        share: f64,
        /// Root mean square over all.
        rms: f64,
    },
    /// Light grows or fades from texel to texel.
    Drift {
        /// ln of the change over the whole patch, to the right and down.
        across: [f64; 2],
    },
    /// Windows of single texels are brighter than their neighbours say, or belong elsewhere.
    Texels {
        /// Root mean square of what pairs differ by as a share, and of the part that is noise.
        differ: [f64; 2],
        /// The worst texel, row and column.
        at: [usize; 2],
        /// By what share it is brighter.
        share: f64,
        /// Root mean square over all texels.
        rms: f64,
    },
    /// Single values that are far from what is seen the other way.
    Outliers {
        /// How many pairs.
        count: u64,
        /// Of so many.
        of: u64,
        /// One of them: row and column of a lit texel.
        at: [usize; 2],
    },
    /// Zeros where the other way there is light.
    Zeros {
        /// How many.
        count: u64,
        /// Of so many pairs that have light.
        of: u64,
        /// One of them: row and column of the lit texel.
        at: [usize; 2],
    },
}

impl Breach {
    /// Whether no surface can have such windows, so that nothing should be made of them.
    pub fn is_no_data(&self) -> bool {
        match self {
            Self::Turned { .. } => true,
            Self::Zeros { count, of, .. } => *count as f64 > MOST_ZEROS * *of as f64,
            Self::Shifted { pixels: [x, y] } => libm::hypot(*x, *y) > MOST_SHIFT,
            _ => false,
        }
    }
}

/// More zeros than this share of what has light the other way are no dead pixels.
const MOST_ZEROS: f64 = 1e-3;
/// A shift from here on puts the light into another texel.
const MOST_SHIFT: f64 = 0.75;

impl std::fmt::Display for Breach {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Turned { how, leaves: [as_is, back] } => write!(
                f,
                "windows that look {how}: both ways differ by {:.1}% as they are, by {:.1}% if that is undone",
                100.0 * as_is,
                100.0 * back
            ),
            Self::Shifted { pixels: [x, y] } => write!(
                f,
                "windows are shifted by about {x:+.2}, {y:+.2} pixels against their lit texels (right, down): is the \
                 lit texel the middle pixel's centre?"
            ),
            Self::HotLine { what, at, share } => write!(
                f,
                "{what} {at:+} of the windows, from the lit texel, is {:.1}% brighter than its mirror image: a hot \
                 {what} of the sensor, or another background there",
                100.0 * share
            ),
            Self::Gains { what, at, share, rms } => write!(
                f,
                "lit {what}s have gains of their own, {what} {at} {:+.1}%, {:.1}% rms over all: light or exposure that \
                 changed while they were measured, or {what}s in another order",
                100.0 * share,
                100.0 * rms
            ),
            Self::Drift { across: [x, y] } => write!(
                f,
                "light changes steadily from texel to texel, by {:+.1}% over the columns and {:+.1}% over the rows: \
                 a lamp or an exposure that drifted while they were measured",
                100.0 * libm::expm1(*x),
                100.0 * libm::expm1(*y)
            ),
            Self::Texels { differ: [all, noise], at: [row, column], share, rms } => write!(
                f,
                "light both ways differs by {:.1}% where noise explains {:.1}%, and by the same at all pixels of a \
                 window: {:.1}% rms over texels, row {row}, column {column} {:+.1}%. Are texels in another order \
                 (every second row the other way, or off by one), or has each a gain of its own?",
                100.0 * all,
                100.0 * noise,
                100.0 * rms,
                100.0 * share
            ),
            Self::Outliers { count, of, at: [row, column] } => write!(
                f,
                "{count} of {of} pairs differ by over ten times their noise from what the other way says, one at row \
                 {row}, column {column}: dead or hot pixels, cosmic rays?"
            ),
            Self::Zeros { count, of, at: [row, column] } => write!(
                f,
                "{count} zeros in {of} pairs that have light the other way, one in the window of row {row}, column \
                 {column}"
            ),
        }
    }
}
