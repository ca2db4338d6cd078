//! What both file formats can draw.

use super::{Rgb, font::Line};

/// A position: x to the right, y downwards, in units of the page.
pub(super) type Point = [f64; 2];

/// A step of an outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Step {
    Move(Point),
    Line(Point),
    Quad(Point, Point),
    Cubic(Point, Point, Point),
    Close,
}

/// A piece of the picture.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Item {
    Fill {
        outline: Vec<Step>,
        colour: Rgb,
        opacity: f64,
    },
    Stroke {
        outline: Vec<Step>,
        colour: Rgb,
        opacity: f64,
        width: f64,
        dash: Option<[f64; 2]>,
    },
    /// `at` is the start of the base line; upright text runs upwards.
    Text {
        line: Line,
        at: Point,
        upright: bool,
        colour: Rgb,
    },
    /// Cells row by row from the top, in the rectangle from `at` of `size`.
    Image {
        columns: usize,
        pixels: Vec<Rgb>,
        at: Point,
        size: Point,
    },
}

/// A page, painted from the first item to the last.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Drawing {
    pub width: f64,
    pub height: f64,
    pub items: Vec<Item>,
}

/// A rectangle from its upper left corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

impl Frame {
    pub fn right(&self) -> f64 {
        self.x + self.width
    }

    pub fn bottom(&self) -> f64 {
        self.y + self.height
    }

    pub fn contains(&self, [x, y]: Point) -> bool {
        (self.x..=self.right()).contains(&x) && (self.y..=self.bottom()).contains(&y)
    }

    pub fn outline(&self) -> Vec<Step> {
        let Self { x, y, .. } = *self;
        polygon(&[[x, y], [self.right(), y], [self.right(), self.bottom()], [x, self.bottom()]])
    }

    /// The part of the way from `a` to `b` that lies inside: Liang and Barsky 1984.
    pub fn clip(&self, a: Point, b: Point) -> Option<(Point, Point)> {
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        let d = [b[0] - a[0], b[1] - a[1]];
        let sides =
            [(-d[0], a[0] - self.x), (d[0], self.right() - a[0]), (-d[1], a[1] - self.y), (d[1], self.bottom() - a[1])];
        for (towards, room) in sides {
            if towards == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if towards < 0.0 {
                enter = enter.max(room / towards);
            } else {
                leave = leave.min(room / towards);
            }
        }
        let at = |part: f64| [a[0] + part * d[0], a[1] + part * d[1]];
        // An end inside is itself to the last bit, so that the next stretch joins it.
        (enter <= leave).then(|| (at(enter), if leave < 1.0 { at(leave) } else { b }))
    }
}

/// A closed outline.
pub(super) fn polygon(corners: &[Point]) -> Vec<Step> {
    let mut outline: Vec<Step> = corners.iter().skip(1).map(|corner| Step::Line(*corner)).collect();
    if let Some(first) = corners.first() {
        outline.insert(0, Step::Move(*first));
        outline.push(Step::Close);
    }
    outline
}

/// A circle of four Bézier curves, within 0.03% of its radius.
pub(super) fn circle([x, y]: Point, radius: f64) -> Vec<Step> {
    let r = radius;
    let c = 0.552_284_749_8 * r;
    vec![
        Step::Move([x + r, y]),
        Step::Cubic([x + r, y + c], [x + c, y + r], [x, y + r]),
        Step::Cubic([x - c, y + r], [x - r, y + c], [x - r, y]),
        Step::Cubic([x - r, y - c], [x - c, y - r], [x, y - r]),
        Step::Cubic([x + c, y - r], [x + r, y - c], [x + r, y]),
        Step::Close,
    ]
}
