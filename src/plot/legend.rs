//! The legend of a panel, in the corner where it hides least, or beside all panels.

use super::{
    INK, Panel, Shape,
    colour::PAPER,
    drawing::{Frame, Item, Point, Step, circle, polygon},
    font::{CAPITALS, Line, Weight},
    series::{Mark, Series},
};

const SIZE: f64 = 14.0;
const ROW: f64 = 20.0;
const SAMPLE: f64 = 28.0;
const PADDING: f64 = 8.0;
/// From the frame.
const GAP: f64 = 8.0;
/// Names are cut to this share of the frame's width.
const WIDEST: f64 = 0.6;

/// A legend, as large as it is, and not anywhere yet.
pub(super) struct Legend<'a> {
    /// Width and height.
    pub size: [f64; 2],
    rows: Vec<(usize, &'a Series, Line)>,
}

impl<'a> Legend<'a> {
    /// The legend of a panel whose frame is `frame_width` wide; `None` where no series has a name.
    pub fn of(panel: &'a Panel, frame_width: f64) -> Option<Self> {
        let named = panel.series.iter().enumerate().filter(|(_, series)| !series.name.is_empty());
        let name = |series: &Series| Line::fitting(&series.name, SIZE, Weight::Regular, WIDEST * frame_width);
        let rows: Vec<_> = named.map(|(index, series)| (index, series, name(series))).collect();
        let widest = rows.iter().map(|row| row.2.width).fold(0.0, f64::max);
        let size = [widest + SAMPLE + 3.0 * PADDING, rows.len() as f64 * ROW + 2.0 * PADDING - 4.0];
        (!rows.is_empty()).then_some(Self { size, rows })
    }

    /// Its items in the corner of `frame` where it hides the fewest of the places `seen`.
    pub fn within(self, frame: Frame, seen: &[Point]) -> Vec<Item> {
        let [width, height] = self.size;
        let left = frame.x + GAP;
        let right = frame.right() - GAP - width;
        let (top, bottom) = (frame.y + GAP, frame.bottom() - GAP - height);
        let corners = [[right, top], [left, bottom], [right, bottom], [left, top]];
        let places = corners.map(|[x, y]| Frame { x, y, width, height });
        let hidden = |place: &Frame| seen.iter().filter(|point| place.contains(**point)).count();
        // The first of equals.
        let Some(place) = places.into_iter().min_by_key(hidden) else { return Vec::new() };
        let mut items = vec![Item::Fill { outline: place.outline(), colour: PAPER, opacity: 0.85 }];
        items.extend(self.at([place.x, place.y]));
        items
    }

    /// Its items, the upper left corner at a place.
    pub fn at(self, [left, top]: Point) -> Vec<Item> {
        let mut items = Vec::new();
        for (row, (index, series, line)) in self.rows.into_iter().enumerate() {
            let y = top + PADDING + (row as f64 + 0.5) * ROW - 2.0;
            let x = left + PADDING;
            sample(&mut items, series, index, [x, y]);
            let at = [x + SAMPLE + PADDING, y + 0.5 * CAPITALS * SIZE];
            items.push(Item::Text { line, at, upright: false, colour: INK });
        }
        items
    }
}

fn sample(items: &mut Vec<Item>, series: &Series, index: usize, [x, y]: Point) {
    let (colour, opacity) = (series.colour_at(index), series.opacity);
    match series.mark {
        Mark::Line { width, dash } => {
            let outline = vec![Step::Move([x, y]), Step::Line([x + SAMPLE, y])];
            items.push(Item::Stroke { outline, colour, opacity, width, dash });
        }
        Mark::Points { shape, size } => {
            items.push(mark(shape, [x + 0.5 * SAMPLE, y], size.max(6.0), colour, opacity));
        }
        Mark::Band | Mark::Area => {
            let outline = Frame { x, y: y - 5.0, width: SAMPLE, height: 10.0 }.outline();
            items.push(Item::Fill { outline, colour, opacity });
        }
    }
}

/// A mark of a series of points.
pub(super) fn mark(shape: Shape, [x, y]: Point, size: f64, colour: [u8; 3], opacity: f64) -> Item {
    let r = 0.5 * size;
    let fill = |outline| Item::Fill { outline, colour, opacity };
    let stroke = |outline| Item::Stroke { outline, colour, opacity, width: 1.6, dash: None };
    match shape {
        Shape::Disc => fill(circle([x, y], r)),
        Shape::Ring => stroke(circle([x, y], r)),
        Shape::Square => fill(Frame { x: x - r, y: y - r, width: size, height: size }.outline()),
        Shape::Triangle => fill(polygon(&[[x, y - 1.2 * r], [x + 1.1 * r, y + 0.8 * r], [x - 1.1 * r, y + 0.8 * r]])),
        Shape::Cross => stroke(vec![
            Step::Move([x - r, y - r]),
            Step::Line([x + r, y + r]),
            Step::Move([x - r, y + r]),
            Step::Line([x + r, y - r]),
        ]),
    }
}
