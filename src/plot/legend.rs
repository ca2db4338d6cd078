//! The legend of a panel, in the corner where it hides least.

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

/// Items of the legend; `seen` are places of the data on the page, which it should not hide.
pub(super) fn legend(panel: &Panel, frame: Frame, seen: &[Point]) -> Vec<Item> {
    let named: Vec<_> = panel.series.iter().enumerate().filter(|(_, series)| !series.name.is_empty()).collect();
    if named.is_empty() {
        return Vec::new();
    }
    let name = |series: &Series| Line::fitting(&series.name, SIZE, Weight::Regular, WIDEST * frame.width);
    let names: Vec<_> = named.iter().map(|(_, series)| name(series)).collect();
    let widest = names.iter().map(|line| line.width).fold(0.0, f64::max);
    let width = widest + SAMPLE + 3.0 * PADDING;
    let height = named.len() as f64 * ROW + 2.0 * PADDING - 4.0;
    let left = frame.x + GAP;
    let right = frame.right() - GAP - width;
    let (top, bottom) = (frame.y + GAP, frame.bottom() - GAP - height);
    let corners = [[right, top], [left, bottom], [right, bottom], [left, top]];
    let places = corners.map(|[x, y]| Frame { x, y, width, height });
    let hidden = |place: &Frame| seen.iter().filter(|point| place.contains(**point)).count();
    // The first of equals.
    let Some(place) = places.into_iter().min_by_key(hidden) else { return Vec::new() };
    let mut items = vec![Item::Fill { outline: place.outline(), colour: PAPER, opacity: 0.85 }];
    for (row, ((index, series), line)) in named.iter().zip(names).enumerate() {
        let y = place.y + PADDING + (row as f64 + 0.5) * ROW - 2.0;
        let x = place.x + PADDING;
        sample(&mut items, series, *index, [x, y]);
        let at = [x + SAMPLE + PADDING, y + 0.5 * CAPITALS * SIZE];
        items.push(Item::Text { line, at, upright: false, colour: INK });
    }
    items
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
