//! Words on a canvas, in the font of the plots.

use super::{canvas::Canvas, style::Rgb};
use crate::plot::Label;

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
    /// Pixels per em, and whether it is bold.
    fn style(self) -> (f64, bool) {
        match self {
            Self::Small => (16.5, false),
            Self::Normal => (20.0, false),
            Self::Strong => (20.0, true),
            Self::Title => (26.5, true),
        }
    }

    fn label(self, text: &str) -> Label {
        let (em, bold) = self.style();
        Label::new(text, em, bold)
    }

    /// Height of a line, pixels.
    pub fn height(self) -> usize {
        match self {
            Self::Small => 20,
            Self::Normal | Self::Strong => 24,
            Self::Title => 32,
        }
    }

    /// Width of a text, pixels.
    pub fn width(self, text: &str) -> usize {
        self.label(text).width().ceil() as usize
    }

    /// The text, cut short with an ellipsis if it is wider than `pixels`; nothing where not even that has room.
    pub fn fit(self, text: &str, pixels: usize) -> String {
        if self.width(text) <= pixels {
            return text.to_owned();
        }
        let mut fitting = String::new();
        for (end, _) in text.char_indices() {
            let longer = format!("{}…", &text[..end]);
            if self.width(&longer) > pixels {
                break;
            }
            fitting = longer;
        }
        fitting
    }

    /// Draws a text with its upper left corner at (x, y). Characters that the font lacks become question marks.
    pub fn draw(self, canvas: &mut Canvas, [x, y]: [usize; 2], text: &str, colour: Rgb) {
        self.label(text).paint(self.height(), |dx, dy, coverage| {
            canvas.blend(x + dx, y + dy, colour, f32::from(coverage) / 255.0);
        });
    }
}
