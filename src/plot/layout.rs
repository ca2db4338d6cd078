//! Where everything stands: panels in a grid, frames, ticks and labels, the data clipped to their frames.
//!
//! ```text
//!   title
//!   ┌ panel title ───────┐   ┌──────
//!   │ y label │ frame    │   │           frames of one column are aligned: all have the
//!   │ y ticks │     │bar │   │           widest tick labels' room at their left
//!   │          x ticks   │
//!   │          x label   │
//!   └────────────────────┘
//!   caption
//! ```

use super::{
    Figure, INK, Panel,
    axis::{Axis, Placed, Tick},
    colour::{FAINT, GRID, viridis},
    drawing::{Drawing, Frame, Item, Point, Step, polygon},
    font::{CAPITALS, Line, Weight, wrapped},
    legend::{Legend, mark},
    series::{ColourBar, Mark, Series},
};

const PAGE_MARGIN: f64 = 16.0;
const TITLE: f64 = 20.0;
const PANEL_TITLE: f64 = 16.0;
const LABEL: f64 = 15.0;
const TICK: f64 = 13.0;
const CAPTION: f64 = 12.0;
/// From base line to base line, in sizes of the text.
const LEADING: f64 = 1.35;
/// Length of a labelled tick; minor ones have half.
const TICK_LENGTH: f64 = 6.0;
/// Least distance of labelled ticks along x and along y.
const TICK_ROOM: [f64; 2] = [85.0, 48.0];
const BAR_WIDTH: f64 = 16.0;
/// Steps of colour in a bar.
const BAR_CELLS: usize = 128;
/// Between labels and frames, and between panels.
const GAP: f64 = 8.0;
const PANEL_GAP: f64 = 22.0;

/// A panel's axes on a frame.
struct Axes {
    frame: Frame,
    x: Placed,
    y: Placed,
}

impl Axes {
    fn new(panel: &Panel, frame: Frame) -> Self {
        let raster = |of: fn(&super::Raster) -> [f64; 2]| panel.raster.iter().flat_map(of);
        let x = panel.series.iter().flat_map(|series| series.points.iter().map(|point| point[0]));
        let y = panel
            .series
            .iter()
            .flat_map(|series| series.points.iter().map(|point| point[1]).chain(series.low.iter().copied()));
        let edges = |axis: &Axis, edges: Option<[f64; 2]>| Axis { range: axis.range.or(edges), ..axis.clone() };
        let (of_x, of_y) = (panel.raster.as_ref().map(|raster| raster.x), panel.raster.as_ref().map(|raster| raster.y));
        Self {
            frame,
            x: edges(&panel.x, of_x).placed(x.chain(raster(|raster| raster.x)), [frame.x, frame.right()]),
            y: edges(&panel.y, of_y).placed(y.chain(raster(|raster| raster.y)), [frame.bottom(), frame.y]),
        }
    }

    fn point(&self, [x, y]: [f64; 2]) -> Point {
        [self.x.at(x), self.y.at(y)]
    }

    fn x_ticks(&self) -> Vec<Tick> {
        self.x.ticks((self.frame.width / TICK_ROOM[0]) as usize)
    }

    fn y_ticks(&self) -> Vec<Tick> {
        self.y.ticks((self.frame.height / TICK_ROOM[1]) as usize)
    }
}

/// Room beside a frame.
#[derive(Debug, Clone, Copy)]
struct Room {
    left: f64,
    right: f64,
    above: f64,
    below: f64,
}

impl Room {
    /// What every panel of `figure` can do with.
    fn of(figure: &Figure) -> Self {
        let [width, height] = figure.panel_size;
        let widest = |ticks: Vec<Tick>| {
            let labels = ticks.into_iter().filter_map(|tick| tick.label);
            labels.map(|label| Line::new(&label, TICK, Weight::Regular).width).fold(0.0, f64::max)
        };
        let mut room = Self { left: 0.0, right: 14.0, above: 10.0, below: TICK_LENGTH + GAP + TICK };
        for panel in figure.panels.iter().filter(|panel| !panel.is_gap()) {
            let axes = Axes::new(panel, Frame { x: 0.0, y: 0.0, width, height });
            let label = if panel.y.label.is_empty() { 0.0 } else { LABEL + GAP };
            room.left = room.left.max(widest(axes.y_ticks()) + TICK_LENGTH + GAP + label);
            if !panel.x.label.is_empty() {
                room.below = room.below.max(TICK_LENGTH + TICK + LABEL + 2.5 * GAP);
            }
            if !panel.title.is_empty() {
                room.above = room.above.max(PANEL_TITLE + 1.5 * GAP);
            }
            if let Some(bar) = panel.raster.as_ref().and_then(|raster| raster.bar.as_ref()) {
                let ticks = bar_axis(bar, 0.0, height).ticks((height / TICK_ROOM[1]) as usize);
                room.right = room.right.max(BAR_WIDTH + widest(ticks) + TICK_LENGTH + LABEL + 4.0 * GAP);
            }
        }
        room
    }
}

/// The drawing of a figure.
pub(super) fn lay_out(figure: &Figure) -> Drawing {
    let room = Room::of(figure);
    let [width, height] = figure.panel_size;
    let columns = figure.columns.clamp(1, figure.panels.len().max(1));
    let rows = figure.panels.len().div_ceil(columns).max(1);
    let [cell_width, cell_height] = [room.left + width + room.right, room.above + height + room.below];
    let inner = columns as f64 * (cell_width + PANEL_GAP) - PANEL_GAP;
    let title = wrapped(&figure.title, TITLE, Weight::Bold, inner);
    let caption = wrapped(&figure.caption, CAPTION, Weight::Regular, inner);
    let block = |lines: &[Line]| lines.iter().map(|line| LEADING * line.size).sum::<f64>();
    let gap = |lines: &[Line]| if lines.is_empty() { 0.0 } else { GAP };
    let top = PAGE_MARGIN + block(&title) + gap(&title);
    let bottom = top + rows as f64 * (cell_height + GAP) - GAP + gap(&caption);
    let beside =
        |panel: &'_ Panel| Legend::of(panel, width).filter(|_| panel.legend_beside).map(|legend| legend.size[0]);
    let beside = figure.panels.iter().filter_map(beside).fold(0.0, f64::max);
    let mut drawing = Drawing {
        width: (inner + beside + 2.0 * PAGE_MARGIN).ceil(),
        height: (bottom + block(&caption) + PAGE_MARGIN).ceil(),
        items: Vec::new(),
    };
    let items = &mut drawing.items;
    for (lines, top, colour) in [(title, PAGE_MARGIN, INK), (caption, bottom, FAINT)] {
        for (n, line) in lines.into_iter().enumerate() {
            let at = [PAGE_MARGIN, top + (n as f64 * LEADING + 0.85) * line.size];
            items.push(Item::Text { line, at, upright: false, colour });
        }
    }
    for (index, panel) in figure.panels.iter().enumerate().filter(|(_, panel)| !panel.is_gap()) {
        let (column, row) = ((index % columns) as f64, (index / columns) as f64);
        let frame = Frame {
            x: PAGE_MARGIN + column * (cell_width + PANEL_GAP) + room.left,
            y: top + row * (cell_height + GAP) + room.above,
            width,
            height,
        };
        draw_panel(items, panel, &Axes::new(panel, frame), room);
        if let Some(legend) = Legend::of(panel, width).filter(|_| panel.legend_beside) {
            items.extend(legend.at([PAGE_MARGIN + inner, frame.y]));
        }
    }
    drawing
}

fn draw_panel(items: &mut Vec<Item>, panel: &Panel, axes: &Axes, room: Room) {
    let frame = axes.frame;
    if !panel.title.is_empty() {
        let line = Line::fitting(&panel.title, PANEL_TITLE, Weight::Bold, frame.width);
        let at = [frame.x + 0.5 * (frame.width - line.width), frame.y - 1.2 * GAP];
        items.push(Item::Text { line, at, upright: false, colour: INK });
    }
    if panel.raster.is_none() {
        grid(items, axes);
    }
    if let Some(raster) = &panel.raster {
        let ([left, right], [bottom, top]) = (raster.x.map(|x| axes.x.at(x)), raster.y.map(|y| axes.y.at(y)));
        let (columns, pixels) = (raster.columns, raster.pixels.clone());
        if [left, right, bottom, top].iter().all(|at| at.is_finite()) && !pixels.is_empty() {
            items.push(Item::Image { columns, pixels, at: [left, top], size: [right - left, bottom - top] });
        }
    }
    let mut seen = Vec::new();
    for (index, series) in panel.series.iter().enumerate() {
        draw_series(items, series, index, axes, &mut seen);
    }
    items.push(Item::Stroke { outline: frame.outline(), colour: FAINT, opacity: 1.0, width: 1.0, dash: None });
    ticks_and_labels(items, panel, axes, room);
    for note in &panel.notes {
        let [x, y] = axes.point(note.at);
        if frame.contains([x, y]) {
            let line = Line::new(&note.text, TICK, Weight::Regular);
            // Words that would leave the frame end at their place instead.
            let x = if x + line.width > frame.right() { (x - line.width).max(frame.x) } else { x };
            items.push(Item::Text { line, at: [x, y], upright: false, colour: note.colour });
        }
    }
    if let Some(legend) = Legend::of(panel, frame.width).filter(|_| !panel.legend_beside) {
        items.extend(legend.within(frame, &seen));
    }
    if let Some(bar) = panel.raster.as_ref().and_then(|raster| raster.bar.as_ref()) {
        draw_bar(items, bar, frame);
    }
}

fn grid(items: &mut Vec<Item>, axes: &Axes) {
    let frame = axes.frame;
    let mut outline = Vec::new();
    for tick in axes.x_ticks().iter().filter(|tick| tick.label.is_some()) {
        outline.extend([Step::Move([tick.at, frame.y]), Step::Line([tick.at, frame.bottom()])]);
    }
    for tick in axes.y_ticks().iter().filter(|tick| tick.label.is_some()) {
        outline.extend([Step::Move([frame.x, tick.at]), Step::Line([frame.right(), tick.at])]);
    }
    items.push(Item::Stroke { outline, colour: GRID, opacity: 1.0, width: 1.0, dash: None });
}

fn ticks_and_labels(items: &mut Vec<Item>, panel: &Panel, axes: &Axes, room: Room) {
    let frame = axes.frame;
    let mut outline = Vec::new();
    let length = |tick: &Tick| if tick.label.is_some() { TICK_LENGTH } else { 0.5 * TICK_LENGTH };
    for tick in axes.x_ticks() {
        let bottom = frame.bottom();
        outline.extend([Step::Move([tick.at, bottom]), Step::Line([tick.at, bottom + length(&tick)])]);
        if let Some(label) = &tick.label {
            let line = Line::new(label, TICK, Weight::Regular);
            let at = [tick.at - 0.5 * line.width, bottom + TICK_LENGTH + TICK];
            items.push(Item::Text { line, at, upright: false, colour: INK });
        }
    }
    for tick in axes.y_ticks() {
        outline.extend([Step::Move([frame.x, tick.at]), Step::Line([frame.x - length(&tick), tick.at])]);
        if let Some(label) = &tick.label {
            let line = Line::new(label, TICK, Weight::Regular);
            let at = [frame.x - TICK_LENGTH - 0.5 * GAP - line.width, tick.at + 0.5 * CAPITALS * TICK];
            items.push(Item::Text { line, at, upright: false, colour: INK });
        }
    }
    items.push(Item::Stroke { outline, colour: FAINT, opacity: 1.0, width: 1.0, dash: None });
    if !panel.x.label.is_empty() {
        let line = Line::fitting(&panel.x.label, LABEL, Weight::Regular, frame.width);
        let at =
            [frame.x + 0.5 * (frame.width - line.width), frame.bottom() + TICK_LENGTH + TICK + 1.2 * GAP + 0.8 * LABEL];
        items.push(Item::Text { line, at, upright: false, colour: INK });
    }
    if !panel.y.label.is_empty() {
        let line = Line::fitting(&panel.y.label, LABEL, Weight::Regular, frame.height);
        let at = [frame.x - room.left + 0.8 * LABEL, frame.y + 0.5 * (frame.height + line.width)];
        items.push(Item::Text { line, at, upright: true, colour: INK });
    }
}

/// Draws a series and adds to `seen` where it can be seen.
fn draw_series(items: &mut Vec<Item>, series: &Series, index: usize, axes: &Axes, seen: &mut Vec<Point>) {
    let (colour, opacity, frame) = (series.colour_at(index), series.opacity, axes.frame);
    match series.mark {
        Mark::Line { width, dash } => {
            let places: Vec<Point> = series.points.iter().map(|point| axes.point(*point)).collect();
            let outline = clipped_line(&places, frame);
            mark_seen(&outline, seen);
            items.push(Item::Stroke { outline, colour, opacity, width, dash });
        }
        Mark::Points { shape, size } => {
            let places = series.points.iter().map(|point| axes.point(*point)).filter(|at| frame.contains(*at));
            for at in places {
                seen.push(at);
                items.push(mark(shape, at, size, colour, opacity));
            }
        }
        Mark::Band => {
            // What lies below the axis, or at 0 on a logarithmic one, is cut at the frame.
            let level = |y: f64| if y.is_finite() { y.clamp(frame.y, frame.bottom()) } else { frame.bottom() };
            let upper = series.points.iter().map(|point| axes.point(*point));
            let lower = series.points.iter().zip(&series.low).map(|([x, _], low)| axes.point([*x, *low]));
            let inside = |[x, _]: &Point| (frame.x..=frame.right()).contains(x);
            let mut corners: Vec<Point> = upper.filter(inside).map(|[x, y]| [x, level(y)]).collect();
            seen.extend(&corners);
            let lower: Vec<Point> = lower.filter(inside).map(|[x, y]| [x, level(y)]).collect();
            corners.extend(lower.into_iter().rev());
            items.push(Item::Fill { outline: polygon(&corners), colour, opacity });
        }
        Mark::Area => {
            let inside = |[x, y]: Point| [x.clamp(frame.x, frame.right()), y.clamp(frame.y, frame.bottom())];
            let places = series.points.iter().map(|point| axes.point(*point));
            let corners: Vec<Point> = places.filter(|[x, y]| x.is_finite() && y.is_finite()).map(inside).collect();
            items.push(Item::Fill { outline: polygon(&corners), colour, opacity });
        }
    }
}

/// A line through `places` as far as it lies in `frame`.
fn clipped_line(places: &[Point], frame: Frame) -> Vec<Step> {
    let mut outline = Vec::new();
    let mut pen: Option<Point> = None;
    for pair in places.windows(2) {
        let finite = pair.iter().flatten().all(|along| along.is_finite());
        let Some((from, to)) = finite.then(|| frame.clip(pair[0], pair[1])).flatten() else {
            pen = None;
            continue;
        };
        if pen != Some(from) {
            outline.push(Step::Move(from));
        }
        outline.push(Step::Line(to));
        pen = Some(to);
    }
    outline
}

/// Places every few units along an outline of lines.
fn mark_seen(outline: &[Step], seen: &mut Vec<Point>) {
    const APART: f64 = 6.0;
    let mut pen: Option<Point> = None;
    for step in outline {
        match (*step, pen) {
            (Step::Line(to), Some(from)) => {
                let parts = (libm::hypot(to[0] - from[0], to[1] - from[1]) / APART).ceil().max(1.0);
                let part = |n: usize, axis: usize| from[axis] + (to[axis] - from[axis]) * n as f64 / parts;
                seen.extend((0..parts as usize).map(|n| [part(n, 0), part(n, 1)]));
                pen = Some(to);
            }
            (Step::Move(to), _) => pen = Some(to),
            _ => {}
        }
    }
}

fn bar_axis(bar: &ColourBar, top: f64, bottom: f64) -> Placed {
    Axis { label: String::new(), scale: bar.scale, range: Some(bar.range) }.placed(bar.range.into_iter(), [bottom, top])
}

fn draw_bar(items: &mut Vec<Item>, bar: &ColourBar, frame: Frame) {
    let strip = Frame { x: frame.right() + 1.5 * GAP, width: BAR_WIDTH, ..frame };
    let pixels = (0..BAR_CELLS).rev().map(|cell| viridis((cell as f64 + 0.5) / BAR_CELLS as f64)).collect();
    items.push(Item::Image { columns: 1, pixels, at: [strip.x, strip.y], size: [strip.width, strip.height] });
    items.push(Item::Stroke { outline: strip.outline(), colour: FAINT, opacity: 1.0, width: 1.0, dash: None });
    let mut outline = Vec::new();
    let mut widest = 0.0_f64;
    for tick in bar_axis(bar, frame.y, frame.bottom()).ticks((frame.height / TICK_ROOM[1]) as usize) {
        let length = if tick.label.is_some() { TICK_LENGTH } else { 0.5 * TICK_LENGTH };
        outline.extend([Step::Move([strip.right(), tick.at]), Step::Line([strip.right() + length, tick.at])]);
        if let Some(label) = &tick.label {
            let line = Line::new(label, TICK, Weight::Regular);
            widest = widest.max(line.width);
            let at = [strip.right() + TICK_LENGTH + 0.5 * GAP, tick.at + 0.5 * CAPITALS * TICK];
            items.push(Item::Text { line, at, upright: false, colour: INK });
        }
    }
    items.push(Item::Stroke { outline, colour: FAINT, opacity: 1.0, width: 1.0, dash: None });
    let line = Line::fitting(&bar.label, LABEL, Weight::Regular, frame.height);
    let x = strip.right() + TICK_LENGTH + widest + 1.5 * GAP + 0.8 * LABEL;
    items.push(Item::Text { at: [x, frame.y + 0.5 * (frame.height + line.width)], line, upright: true, colour: INK });
}
