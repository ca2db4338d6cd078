//! Three orthogonal cuts on one sheet, at one scale, so that edges line up:
//!
//! ```text
//!   xz   yz      z is shared along the row
//!   xy           x is shared along the column
//! ```

use super::{
    canvas::{Canvas, Rect},
    legend::{Legend, millimetres},
    section::{Section, plane_axes},
    sheet::{BLOCK_GAP, MARGIN, PICTURE, draw_section, pixels, side_note},
    style::{ACCENT, INK, PAGE, Palette},
    text::Font,
};
use crate::voxel::Lattice;

/// Between panels, across and down.
const GAP: usize = 60;
/// Room left of a panel for its axis.
const AXIS: usize = 40;
/// Length of the marks that show where the other cuts pass.
const MARK: usize = 12;
const NAMES: [&str; 3] = ["x", "y", "z"];

/// Draws the cuts; `cuts[axis]` is perpendicular to that axis.
pub(super) fn cuts(lattice: &Lattice, cuts: &[Section; 3], palette: &Palette, legend: &Legend) -> Canvas {
    let extent: [f64; 3] = std::array::from_fn(|axis| f64::from(lattice.dims[axis]) * lattice.pitch[axis]);
    let titles: [String; 3] = std::array::from_fn(|axis| {
        let [right, up] = plane_axes(axis).map(|axis| NAMES[axis]);
        let position = millimetres(lattice.coordinate(axis, cuts[axis].index));
        format!("{right}{up} at {} {position}", NAMES[axis])
    });
    let label = Font::Strong.height() + MARK + 6;
    let top = MARGIN + Font::Title.height() + BLOCK_GAP;
    let title_width = titles.iter().map(|title| Font::Strong.width(title)).max().unwrap_or(0);

    // Panels beside each other unless that makes them smaller than below each other.
    let foot_guess = legend.layout(PICTURE[0] - 2 * MARGIN, 1.0).height;
    let room = [PICTURE[0] - 2 * MARGIN, PICTURE[1].saturating_sub(top + MARGIN + BLOCK_GAP + foot_guess).max(500)];
    let largest = |beside: bool| {
        // Whether everything fits does not depend on scale alone: titles keep their width.
        let fits = |scale: f64| {
            let [x, y, z] = extent.map(|length| length * scale);
            let column = |width: f64| AXIS as f64 + width.max(title_width as f64);
            let two = [GAP as f64 + column(x) + column(y), label as f64 + AXIS as f64];
            let size = if beside {
                [two[0] + GAP as f64 + column(x), two[1] + z.max(y)]
            } else {
                [two[0], 2.0 * two[1] + GAP as f64 + z + y]
            };
            size[0] <= room[0] as f64 && size[1] <= room[1] as f64
        };
        // Bisection of the logarithm between scales that surely fit and surely do not.
        let longest = extent.into_iter().fold(0.0, f64::max);
        let (mut low, mut high) = (1.0 / longest, 2.0 * PICTURE[0] as f64 / longest);
        for _ in 0..40 {
            let middle = (low * high).sqrt();
            *(if fits(middle) { &mut low } else { &mut high }) = middle;
        }
        low
    };
    let (one_row, two_rows) = (largest(true), largest(false));
    let beside = one_row > two_rows;
    let scale = one_row.max(two_rows);
    let size = |axis: usize| pixels(plane_axes(axis).map(|axis| extent[axis]), scale);
    let column = |axis: usize| size(axis)[0].max(title_width) + AXIS;

    // Upper left corners of the panels' images.
    let (xz, yz, xy, right, bottom);
    xz = [MARGIN + AXIS, top + label];
    yz = [xz[0] + column(1) + GAP, xz[1]];
    if beside {
        xy = [yz[0] + column(0) + GAP, xz[1]];
        right = xy[0] + column(2) - AXIS;
        bottom = xz[1] + size(1)[1].max(size(2)[1]) + AXIS;
    } else {
        xy = [xz[0], xz[1] + size(1)[1] + AXIS + GAP / 2 + label];
        right = yz[0] + column(0) - AXIS;
        bottom = xy[1] + size(2)[1] + AXIS;
    }
    let title = "Cuts";
    let content = (right - MARGIN).max(legend.min_width());
    // With two rows the lower right is free: the foot goes there if it fits.
    let corner = [yz[0], yz[1] + size(0)[1] + AXIS + GAP / 2 + label];
    let corner_width = (MARGIN + content).saturating_sub(corner[0]);
    let corner_foot = legend.layout(corner_width, scale);
    let in_corner = !beside && corner_width >= legend.min_width() && corner[1] + corner_foot.height <= bottom;
    let (foot, place, end) = if in_corner {
        (corner_foot, corner, bottom)
    } else {
        let foot = legend.layout(content, scale);
        let end = bottom + BLOCK_GAP + foot.height;
        (foot, [MARGIN, bottom + BLOCK_GAP], end)
    };

    let mut canvas = Canvas::new(content + 2 * MARGIN, end + MARGIN, PAGE);
    Font::Title.draw(&mut canvas, [MARGIN, MARGIN], title, INK);
    side_note(&mut canvas, title, "red marks: where the other two cuts pass");
    for (axis, [x, y]) in [(1, xz), (0, yz), (2, xy)] {
        let [width, height] = size(axis);
        let rect = Rect { x, y, width, height };
        Font::Strong.draw(&mut canvas, [x, y - label], &titles[axis], INK);
        draw_section(&mut canvas, rect, &cuts[axis], palette);
        let [right, up] = plane_axes(axis);
        let part = |axis: usize| (f64::from(cuts[axis].index) + 0.5) / f64::from(lattice.dims[axis].max(1));
        draw_marks(&mut canvas, rect, [part(right), 1.0 - part(up)]);
        draw_axes(&mut canvas, rect, NAMES[right], NAMES[up]);
    }
    legend.draw(&mut canvas, place, &foot, palette);
    canvas
}

/// Marks above and to the right at these parts of the width and height.
fn draw_marks(canvas: &mut Canvas, rect: Rect, part: [f64; 2]) {
    let x = rect.x + ((part[0] * rect.width as f64) as usize).min(rect.width - 1);
    let y = rect.y + ((part[1] * rect.height as f64) as usize).min(rect.height - 1);
    canvas.fill(Rect { x: x.saturating_sub(1), y: rect.y - 2 - MARK, width: 2, height: MARK }, ACCENT);
    canvas.fill(Rect { x: rect.x + rect.width + 2, y: y.saturating_sub(1), width: MARK, height: 2 }, ACCENT);
}

/// The two axes' names beside arrows along the lower left corner.
fn draw_axes(canvas: &mut Canvas, rect: Rect, right: &str, up: &str) {
    const LENGTH: usize = 44;
    let (x, y) = (rect.x - 16, rect.y + rect.height + 16);
    canvas.fill(Rect { x, y: y - 1, width: LENGTH, height: 2 }, INK);
    canvas.fill(Rect { x: x - 1, y: y - LENGTH, width: 2, height: LENGTH + 1 }, INK);
    for n in 0..8 {
        let half = n / 2;
        // Tips of the arrows: lines that widen away from the tip.
        canvas.fill(Rect { x: x + LENGTH + 4 - n, y: y - 1 - half, width: 1, height: 2 + 2 * half }, INK);
        canvas.fill(Rect { x: x - 1 - half, y: y - LENGTH - 4 + n, width: 2 + 2 * half, height: 1 }, INK);
    }
    Font::Strong.draw(canvas, [x + LENGTH + 10, y - Font::Strong.height() / 2], right, INK);
    Font::Strong.draw(canvas, [x - Font::Strong.width(up) / 2, y - LENGTH - 6 - Font::Strong.height()], up, INK);
}
