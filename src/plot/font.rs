//! Text as outlines of the bundled fonts: subsets of Noto Sans (SIL Open Font License, `font/OFL.txt`) with Latin,
//! Greek, superscripts and a few signs.

use std::sync::LazyLock;

use ttf_parser::{Face, GlyphId, OutlineBuilder};

use super::drawing::{Point, Step};

/// Weight of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Weight {
    Regular,
    Bold,
}

/// A glyph of a line: its outline's identity and where it stands, in units of the page from the line's start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Glyph {
    pub id: u16,
    pub at: Point,
}

/// A line of text, laid out.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Line {
    pub text: String,
    pub weight: Weight,
    /// Units of the page per em.
    pub size: f64,
    pub glyphs: Vec<Glyph>,
    /// Advance of the whole line, units of the page.
    pub width: f64,
}

/// Height of capitals, ems.
pub(super) const CAPITALS: f64 = 0.714;
/// Where marks over small letters stand, ems.
const SMALL_LETTERS: f64 = 0.536;

fn face(weight: Weight) -> &'static Face<'static> {
    static FACES: LazyLock<[Face<'static>; 2]> = LazyLock::new(|| {
        let parse = |bytes| Face::parse(bytes, 0).expect("the bundled fonts are whole: a test reads them");
        [parse(include_bytes!("font/NotoSans-Regular.ttf")), parse(include_bytes!("font/NotoSans-Bold.ttf"))]
    });
    &FACES[weight as usize]
}

impl Line {
    /// Lays out a text. A combining mark is set over the letter before it; a character that the font lacks becomes `?`.
    pub fn new(text: &str, size: f64, weight: Weight) -> Self {
        let face = face(weight);
        let em = size / f64::from(face.units_per_em());
        let mut glyphs: Vec<Glyph> = Vec::new();
        let mut width = 0.0;
        let mut letter: Option<(f64, GlyphId)> = None;
        for c in text.chars().filter(|c| !c.is_control()) {
            let Some(id) = face.glyph_index(c).or_else(|| face.glyph_index('?')) else { continue };
            let mut at = [width, 0.0];
            if ('\u{300}'..='\u{36f}').contains(&c) {
                let boxes = letter.and_then(|(x, id)| Some((x, face.glyph_bounding_box(id)?)));
                if let (Some((x, letter)), Some(mark)) = (boxes, face.glyph_bounding_box(id)) {
                    let middle = |bounds: ttf_parser::Rect| 0.5 * f64::from(bounds.x_min + bounds.x_max) * em;
                    let raise = (f64::from(letter.y_max) * em - SMALL_LETTERS * size).max(0.0);
                    at = [x + middle(letter) - middle(mark), -raise];
                }
            } else {
                letter = Some((width, id));
                width += f64::from(face.glyph_hor_advance(id).unwrap_or(0)) * em;
            }
            glyphs.push(Glyph { id: id.0, at });
        }
        Self { text: text.to_owned(), weight, size, glyphs, width }
    }

    /// The line, or as much of a text as fits `room` with an ellipsis.
    pub fn fitting(text: &str, size: f64, weight: Weight, room: f64) -> Self {
        let whole = Self::new(text, size, weight);
        if whole.width <= room {
            return whole;
        }
        let kept = (0..text.chars().count()).rev().map(|n| text.chars().take(n).collect::<String>() + "…");
        kept.map(|text| Self::new(&text, size, weight)).find(|line| line.width <= room).unwrap_or(whole)
    }
}

/// A text in as many lines as it needs to fit `room`; a word that is too long alone ends in an ellipsis.
pub(super) fn wrapped(text: &str, size: f64, weight: Weight, room: f64) -> Vec<Line> {
    let mut lines = Vec::new();
    let mut current = String::new();
    for word in text.split_whitespace() {
        let longer = if current.is_empty() { word.to_owned() } else { format!("{current} {word}") };
        if current.is_empty() || Line::new(&longer, size, weight).width <= room {
            current = longer;
        } else {
            lines.push(Line::fitting(&current, size, weight, room));
            current = word.to_owned();
        }
    }
    if !current.is_empty() {
        lines.push(Line::fitting(&current, size, weight, room));
    }
    lines
}

/// The outline of a glyph, one unit per em, y downwards.
pub(super) fn outline(weight: Weight, id: u16) -> Vec<Step> {
    let face = face(weight);
    let mut pen = Pen { scale: 1.0 / f64::from(face.units_per_em()), steps: Vec::new() };
    face.outline_glyph(GlyphId(id), &mut pen);
    pen.steps
}

struct Pen {
    scale: f64,
    steps: Vec<Step>,
}

impl Pen {
    fn point(&self, x: f32, y: f32) -> Point {
        [f64::from(x) * self.scale, -f64::from(y) * self.scale]
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.steps.push(Step::Move(self.point(x, y)));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.steps.push(Step::Line(self.point(x, y)));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.steps.push(Step::Quad(self.point(x1, y1), self.point(x, y)));
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.steps.push(Step::Cubic(self.point(x1, y1), self.point(x2, y2), self.point(x, y)));
    }

    fn close(&mut self) {
        self.steps.push(Step::Close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_signs_of_our_labels_have_outlines() {
        for weight in [Weight::Regular, Weight::Bold] {
            let unknown = Line::new("?", 10.0, weight).glyphs[0].id;
            for c in "aZ09äé[]()·×–—−µμ°±≤≥≈→∞√⁰¹²³⁴⁵⁶⁷⁸⁹⁻αβγλπσΣΔ∂∫…′̂".chars()
            {
                let id = Line::new(&c.to_string(), 10.0, weight).glyphs[0].id;
                assert_ne!(id, unknown, "{c}");
                assert!(!outline(weight, id).is_empty(), "{c}");
            }
            assert_eq!(Line::new("漢", 10.0, weight).glyphs[0].id, unknown);
        }
    }

    #[test]
    fn a_hat_stands_over_its_letter_and_takes_no_room() {
        let (plain, hat) = (Line::new("R", 20.0, Weight::Regular), Line::new("R̂", 20.0, Weight::Regular));
        assert_eq!(plain.width, hat.width);
        assert!(hat.glyphs[1].at[1] < -2.0, "{:?}", hat.glyphs);
    }

    #[test]
    fn wrapping_keeps_every_word() {
        let text = "not a measurement of any printer's resins, whatever it may look like";
        let lines = wrapped(text, 12.0, Weight::Regular, 120.0);
        assert!(lines.len() > 2 && lines.iter().all(|line| line.width <= 120.0));
        assert_eq!(lines.iter().map(|line| line.text.as_str()).collect::<Vec<_>>().join(" "), text);
        assert!(wrapped(" ", 12.0, Weight::Regular, 120.0).is_empty());
    }

    #[test]
    fn what_does_not_fit_ends_in_an_ellipsis() {
        let line = Line::fitting("a long line of words", 12.0, Weight::Bold, 60.0);
        assert!(line.width <= 60.0 && line.text.ends_with('…') && line.text.len() > 6, "{}", line.text);
    }
}
