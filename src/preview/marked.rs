//! Objects from three sides, marked in colour where something is to be seen.

use glam::DVec3;

use super::{
    PreviewError, PreviewFile,
    canvas::{Canvas, Rect},
    sheet::{BLOCK_GAP, MARGIN},
    style::{INK, PAGE, PANEL, PANEL_EDGE, Rgb},
    text::Font,
};
use crate::colour::{byte_to_linear, linear_to_byte};
use crate::parallel;

/// Edge of a panel, pixels.
const SIZE: usize = 420;
/// Between panels.
const GAP: usize = 24;
/// Azimuth and elevation of the views, degrees, and their names.
const VIEWS: [([f64; 2], &str); 3] = [([-60.0, 20.0], "front"), ([120.0, 20.0], "back"), ([-60.0, -35.0], "below")];
/// Of an object without marks, linear.
const GREY: f32 = 0.55;

/// Draws triangles, each with the number of its object; `mark` says in which colour a point of an object's surface with
/// an outward normal is drawn, where it has one.
///
/// # Errors
/// [`PreviewError::Encode`].
pub(crate) fn marked_sheet(
    path: String,
    title: &str,
    triangles: &[(usize, [DVec3; 3])],
    legend: &[(Rgb, &str)],
    mark: &(dyn Fn(usize, DVec3, DVec3) -> Option<Rgb> + Sync),
) -> Result<PreviewFile, PreviewError> {
    let panels: Vec<Vec<Rgb>> = parallel::map_all(&VIEWS, |&(view, _)| panel(triangles, view, &[], mark));
    let top = MARGIN + Font::Title.height() + BLOCK_GAP;
    let foot = 10 + Font::Strong.height();
    let swatch = Font::Normal.height();
    let legend_top = top + SIZE + foot + BLOCK_GAP;
    let width = VIEWS.len() * (SIZE + GAP) - GAP + 2 * MARGIN;
    let mut canvas = Canvas::new(width, legend_top + legend.len() * (swatch + 8) + MARGIN, PAGE);
    Font::Title.draw(&mut canvas, [MARGIN, MARGIN], title, INK);
    for (n, (pixels, (_, name))) in panels.iter().zip(VIEWS).enumerate() {
        let left = MARGIN + n * (SIZE + GAP);
        canvas.frame(Rect { x: left, y: top, width: SIZE, height: SIZE }, PANEL_EDGE);
        canvas.lay([left, top], SIZE, pixels);
        Font::Strong.draw(&mut canvas, [left, top + SIZE + 10], name, INK);
    }
    for (n, (colour, words)) in legend.iter().enumerate() {
        let y = legend_top + n * (swatch + 8);
        canvas.fill(Rect { x: MARGIN, y, width: swatch, height: swatch }, *colour);
        Font::Normal.draw(&mut canvas, [MARGIN + swatch + 10, y], words, INK);
    }
    canvas.file(path)
}

/// The pixel's nearest triangle so far.
#[derive(Clone, Copy)]
struct Hit {
    depth: f64,
    triangle: u32,
}

/// Draws the tray from above, its objects in turns of two greys.
///
/// # Errors
/// [`PreviewError::Encode`].
pub(crate) fn tray_sheet(
    path: String,
    title: &str,
    triangles: &[(usize, [DVec3; 3])],
    tray: DVec3,
) -> Result<PreviewFile, PreviewError> {
    const GREYS: [Rgb; 2] = [[0x5b, 0x66, 0x74], [0x8f, 0x99, 0xa6]];
    let corners = [DVec3::ZERO, DVec3::new(tray.x, tray.y, 0.0)];
    let pixels = panel(triangles, [-90.0, 90.0], &corners, &|object, _, _| Some(GREYS[object % 2]));
    let top = MARGIN + Font::Title.height() + BLOCK_GAP;
    let mut canvas = Canvas::new(SIZE + 2 * MARGIN, top + SIZE + MARGIN, PAGE);
    Font::Title.draw(&mut canvas, [MARGIN, MARGIN], title, INK);
    canvas.lay([MARGIN, top], SIZE, &pixels);
    // The tray fills 0.94 of the panel along its longer side.
    let scale = 0.94 * SIZE as f64 / tray.x.max(tray.y);
    let [width, height] = [tray.x, tray.y].map(|side| (side * scale) as usize);
    let at = [MARGIN + (SIZE - width) / 2, top + (SIZE - height) / 2];
    canvas.frame(Rect { x: at[0], y: at[1], width, height }, INK);
    canvas.file(path)
}

/// One view, orthographic, row 0 on top, that shows all triangles and `others`.
fn panel(
    triangles: &[(usize, [DVec3; 3])],
    [azimuth, elevation]: [f64; 2],
    others: &[DVec3],
    mark: &(dyn Fn(usize, DVec3, DVec3) -> Option<Rgb> + Sync),
) -> Vec<Rgb> {
    let (sin_a, cos_a) = (libm::sin(azimuth.to_radians()), libm::cos(azimuth.to_radians()));
    let (sin_e, cos_e) = (libm::sin(elevation.to_radians()), libm::cos(elevation.to_radians()));
    let toward = DVec3::new(cos_a * cos_e, sin_a * cos_e, sin_e);
    let right = DVec3::new(-sin_a, cos_a, 0.0);
    let up = toward.cross(right);
    let corners = || triangles.iter().flat_map(|(_, corners)| corners);
    let flat = |p: &DVec3| [p.dot(right), p.dot(up)];
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for at in corners().chain(others).map(flat) {
        for axis in 0..2 {
            low[axis] = low[axis].min(at[axis]);
            high[axis] = high[axis].max(at[axis]);
        }
    }
    let extent = (high[0] - low[0]).max(high[1] - low[1]).max(1e-9);
    let scale = 0.94 * SIZE as f64 / extent;
    let middle = [0, 1].map(|axis| 0.5 * (low[axis] + high[axis]));
    let pixel = |p: DVec3| {
        let [x, y] = flat(&p);
        [(x - middle[0]) * scale + 0.5 * SIZE as f64, 0.5 * SIZE as f64 - (y - middle[1]) * scale]
    };
    let mut hits = vec![Hit { depth: f64::NEG_INFINITY, triangle: u32::MAX }; SIZE * SIZE];
    for (index, (_, corners)) in (0..).zip(triangles) {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        if normal.dot(toward) <= 0.0 {
            continue;
        }
        let [a, b, c] = corners.map(pixel);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        let span = |axis: usize| {
            let ends = [a[axis], b[axis], c[axis]];
            let least = ends.iter().copied().fold(f64::INFINITY, f64::min);
            let most = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            // A triangle smaller than a pixel still colours the one that it lies in.
            (least.floor().max(0.0) as usize)..((most.ceil().max(0.0) as usize).min(SIZE))
        };
        let depths = corners.map(|p| p.dot(toward));
        for (y, x) in span(1).flat_map(|y| span(0).map(move |x| (y, x))) {
            let at = [x as f64 + 0.5, y as f64 + 0.5];
            let weight =
                |p: [f64; 2], q: [f64; 2]| ((p[0] - at[0]) * (q[1] - at[1]) - (q[0] - at[0]) * (p[1] - at[1])) / area;
            let weights = [weight(b, c), weight(c, a), weight(a, b)];
            if weights.iter().all(|weight| *weight >= -1e-9) {
                let depth = weights.iter().zip(depths).map(|(weight, depth)| weight * depth).sum();
                let hit = &mut hits[x + SIZE * y];
                if depth > hit.depth {
                    *hit = Hit { depth, triangle: index };
                }
            }
        }
    }
    let light = (toward + 0.6 * up - 0.4 * right).normalize();
    let shade = |(place, hit): (usize, &Hit)| -> Rgb {
        let Some(&(object, corners)) = triangles.get(hit.triangle as usize) else { return PANEL };
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        let [x, y] = [place % SIZE, place / SIZE].map(|at| (at as f64 + 0.5 - 0.5 * SIZE as f64) / scale);
        let point = right * (middle[0] + x) + up * (middle[1] - y) + toward * hit.depth;
        let base = mark(object, point, normal).map_or([GREY; 3], |rgb| rgb.map(byte_to_linear));
        let lit = 0.35 + 0.65 * normal.dot(light).max(0.0) as f32;
        base.map(|value| linear_to_byte(f64::from(value * lit)))
    };
    hits.iter().enumerate().map(shade).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square that looks up at the front view, seen whole, marked on one half.
    #[test]
    fn marks_lie_where_they_are() {
        let [(view, _), ..] = VIEWS;
        let square = [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [-2.0, 1.0, 0.0], [-2.0, -1.0, 0.0]].map(DVec3::from);
        let triangles = [(0, [square[0], square[1], square[2]]), (0, [square[0], square[2], square[3]])];
        let red = [255, 0, 0];
        let pixels = panel(&triangles, view, &[], &|_, p, _| (p.x < -1.0).then_some(red));
        let is_red = |pixel: &&Rgb| pixel[0] > 60 && pixel[1] == 0;
        let (marked, all) =
            (pixels.iter().filter(is_red).count(), pixels.iter().filter(|pixel| **pixel != PANEL).count());
        assert!(all > SIZE * SIZE / 8 && marked.abs_diff(all / 2) < all / 50, "{marked} of {all}");
        // From below it is not seen at all.
        let [.., (below, _)] = VIEWS;
        assert!(panel(&triangles, below, &[], &|_, _, _| None).iter().all(|pixel| *pixel == PANEL));
    }
}
