//! Where in a photograph a coupon lies: its five marks, and the perspective that takes them there.
//!
//! A mark is a dark square alone in white. Patches darker than a threshold are found at several thresholds; those whose
//! area and second moments are those of a parallelogram may be marks. Any three of them tell where the others would be;
//! the set that fits best, not mirrored, is the coupon. Middles are then taken from the grey values of the whole
//! picture, whose blur by the light in the white is the same on all sides of a mark.

use super::Coupon;
use crate::measure::frame::Plane;
use crate::numeric::positive_definite::NormalEquations;

/// The longer side of the picture that patches are looked for in, pixels.
const SMALL: usize = 1000;
/// Thresholds, as shares of what the brightest hundredth of the picture returns.
const THRESHOLDS: [f32; 5] = [0.5, 0.35, 0.25, 0.65, 0.15];
/// Area over 12 √det of the second moments: 1 for a parallelogram, 1.05 for an ellipse.
const SQUARE: std::ops::RangeInclusive<f64> = 0.9..=1.12;
/// Least pixels of a patch.
const MIN_AREA: usize = 16;
/// Most patches that are tried; the largest.
const MOST: usize = 40;
/// Areas of marks are alike within this factor.
const ALIKE: f64 = 1.7;
/// How far the fourth corner may be from where three have it, and the fifth mark from where four have it, as shares of
/// the spacing: perspective, and error.
const FOURTH: f64 = 1.0;
const FIFTH: f64 = 0.15;
/// Windows around a mark whose grey values tell its middle, as shares of its side.
const WINDOW: f64 = 1.6;
const REFINEMENTS: usize = 4;

/// A coupon in a photograph.
pub(super) struct Seen {
    pub view: View,
    pub pixels_per_mm: f64,
    /// Root mean square of what the marks are off by, mm.
    pub off_mm: f64,
}

/// From millimetres of the coupon to pixels: [u v w] = m [x y 1], the pixel at [u/w v/w]; the middle of pixel (0, 0) is
/// at (0.5, 0.5).
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    m: [[f64; 3]; 3],
}

impl View {
    pub fn pixel(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [u, v, w] = self.m.map(|row| row[0] * x + row[1] * y + row[2]);
        [u / w, v / w]
    }

    /// Millimetres of a pixel; `None` beyond the horizon.
    fn mm(&self, at: [f64; 2]) -> Option<[f64; 2]> {
        // (m₀ − u m₂) [x y 1] = 0 and (m₁ − v m₂) [x y 1] = 0.
        let row = |i: usize| -> [f64; 3] { std::array::from_fn(|k| self.m[i][k] - at[i] * self.m[2][k]) };
        let (a, b) = (row(0), row(1));
        let determinant = a[0] * b[1] - a[1] * b[0];
        let solved = [(a[1] * b[2] - a[2] * b[1]) / determinant, (a[2] * b[0] - a[0] * b[2]) / determinant];
        solved.iter().all(|at| at.is_finite()).then_some(solved)
    }

    /// Indices of the pixels of a picture whose middles lie in a rectangle of the coupon.
    pub fn pixels_within(&self, low: [f64; 2], high: [f64; 2], plane: &Plane) -> Vec<usize> {
        let corners = [low, [high[0], low[1]], high, [low[0], high[1]]].map(|corner| self.pixel(corner));
        let range = |axis: usize, end: usize| {
            let all = corners.map(|corner| corner[axis]);
            let (from, to) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
            (from.floor().max(0.0) as usize).min(end)..(to.ceil().max(0.0) as usize).min(end)
        };
        let mut found = Vec::new();
        for row in range(1, plane.height) {
            for column in range(0, plane.width) {
                let at = self.mm([column as f64 + 0.5, row as f64 + 0.5]);
                if at.is_some_and(|at| (0..2).all(|axis| low[axis] <= at[axis] && at[axis] < high[axis])) {
                    found.push(column + plane.width * row);
                }
            }
        }
        found
    }

    /// Through four points or more, by least squares in the pixels.
    fn through(points: &[([f64; 2], [f64; 2])]) -> Option<Self> {
        // All scaled to about 1, m₂₂ = 1: 8 unknowns.
        let greatest = |values: [f64; 2], most: f64| values.iter().fold(most, |most, value| most.max(value.abs()));
        let of_both = |(scale, size), &(place, pixel)| (greatest(place, scale), greatest(pixel, size));
        let (scale, size) = points.iter().fold((1e-9, 1e-9), of_both);
        let mut equations = NormalEquations::new(8);
        for &([x, y], [u, v]) in points {
            let ([x, y], [u, v]) = ([x / scale, y / scale], [u / size, v / size]);
            equations.add(&[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], u, 1.0);
            equations.add(&[0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y], v, 1.0);
        }
        // Points on a line tell of it to rounding only.
        let s = equations.solve_above(1e-12, |_| 0.0)?;
        let row = |a: f64, b: f64, c: f64, size: f64| [size * a / scale, size * b / scale, size * c];
        Some(Self { m: [row(s[0], s[1], s[2], size), row(s[3], s[4], s[5], size), row(s[6], s[7], 1.0, 1.0)] })
    }

    /// Of the area: pixels per mm², negative where the picture is right side round, as rows count downwards.
    fn area(&self, [x, y]: [f64; 2]) -> f64 {
        let step = 0.01;
        let [at, right, up] = [[x, y], [x + step, y], [x, y + step]].map(|at| self.pixel(at));
        ((right[0] - at[0]) * (up[1] - at[1]) - (right[1] - at[1]) * (up[0] - at[0])) / (step * step)
    }
}

/// A patch that may be a mark, in pixels of the whole picture.
#[derive(Debug, Clone, Copy)]
struct Patch {
    middle: [f64; 2],
    area: f64,
}

/// The coupon's place in a picture of shares of the light; else what was found in place of it.
pub(super) fn marks(plane: &Plane, coupon: &Coupon) -> Result<Seen, String> {
    let factor = plane.width.max(plane.height).div_ceil(SMALL);
    let small = shrunk(plane, factor);
    let mut sorted: Vec<f32> = small.values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f32::total_cmp);
    let Some(&bright) = sorted.get(sorted.len() * 99 / 100) else { return Err("no pixel".to_owned()) };
    let (mut best, mut most, mut mirrored): (Option<(f64, View)>, usize, bool) = (None, 0, false);
    for threshold in THRESHOLDS {
        let patches = patches(&small, threshold * bright, factor as f64);
        most = most.max(patches.len());
        let (found, turned) = arranged(&patches, coupon);
        mirrored |= turned;
        if let Some(found) = found
            && best.is_none_or(|best| found.0 < best.0)
        {
            best = Some(found);
        }
    }
    let Some((_, mut view)) = best else {
        return Err(match mirrored {
            true => "a coupon in a mirror: was the picture flipped?".to_owned(),
            false => format!("{most} dark squares, none of which lie as the marks do"),
        });
    };
    let mut middles = coupon.marks;
    for _ in 0..REFINEMENTS {
        let refined: Option<Vec<[f64; 2]>> =
            coupon.marks.iter().map(|&mark| middle_of(plane, &view, mark, coupon.mark_mm)).collect();
        let refined = refined.ok_or("a mark that the border cuts off")?;
        middles.copy_from_slice(&refined);
        let points: Vec<_> = coupon.marks.into_iter().zip(refined).collect();
        view = View::through(&points).ok_or("marks in a line")?;
    }
    let middle = [0.5 * coupon.size_mm[0], 0.5 * coupon.size_mm[1]];
    let pixels_per_mm = view.area(middle).abs().sqrt();
    let off = |(mark, middle): (&[f64; 2], &[f64; 2])| {
        let [u, v] = view.pixel(*mark);
        (u - middle[0]).powi(2) + (v - middle[1]).powi(2)
    };
    let squares: f64 = coupon.marks.iter().zip(&middles).map(off).sum();
    let off_mm = (squares / middles.len() as f64).sqrt() / pixels_per_mm;
    if off_mm > 0.05 * coupon.spacing_mm {
        return Err(format!("marks {off_mm:.2} mm from where they should be"));
    }
    Ok(Seen { view, pixels_per_mm, off_mm })
}

/// Means of squares of `factor` pixels.
fn shrunk(plane: &Plane, factor: usize) -> Plane {
    let (width, height) = (plane.width / factor, plane.height / factor);
    let mut small = Plane::new(width, height);
    for (place, value) in small.values.iter_mut().enumerate() {
        let (x, y) = (place % width * factor, place / width * factor);
        let square = (0..factor * factor).map(|k| plane.at(x + k % factor, y + k / factor));
        *value = square.sum::<f32>() / (factor * factor) as f32;
    }
    small
}

/// Connected pixels below a threshold that have the shape of a parallelogram and touch no border.
fn patches(plane: &Plane, threshold: f32, factor: f64) -> Vec<Patch> {
    let (width, height) = (plane.width, plane.height);
    let mut open: Vec<bool> = plane.values.iter().map(|value| *value < threshold).collect();
    let mut found = Vec::new();
    let mut heap = Vec::new();
    for start in 0..open.len() {
        if !std::mem::take(&mut open[start]) {
            continue;
        }
        let (mut n, mut sum, mut squares, mut whole) = (0_usize, [0.0; 2], [0.0; 3], true);
        heap.push(start);
        while let Some(place) = heap.pop() {
            let (x, y) = (place % width, place / width);
            let at = [x as f64 + 0.5, y as f64 + 0.5];
            n += 1;
            (0..2).for_each(|axis| sum[axis] += at[axis]);
            squares[0] += at[0] * at[0];
            squares[1] += at[0] * at[1];
            squares[2] += at[1] * at[1];
            whole &= x > 0 && y > 0 && x + 1 < width && y + 1 < height;
            let beside = [
                (x > 0).then(|| place - 1),
                (x + 1 < width).then(|| place + 1),
                (y > 0).then(|| place - width),
                (y + 1 < height).then(|| place + width),
            ];
            for next in beside.into_iter().flatten() {
                if std::mem::take(&mut open[next]) {
                    heap.push(next);
                }
            }
        }
        let area = n as f64;
        let mean = sum.map(|sum| sum / area);
        let moment = |square: f64, a: usize, b: usize| square / area - mean[a] * mean[b];
        // A pixel is a square itself.
        let (xx, yy) = (moment(squares[0], 0, 0) + 1.0 / 12.0, moment(squares[2], 1, 1) + 1.0 / 12.0);
        let determinant = xx * yy - moment(squares[1], 0, 1).powi(2);
        if whole && n >= MIN_AREA && SQUARE.contains(&(area / (12.0 * determinant.sqrt()))) {
            found.push(Patch { middle: mean.map(|mean| mean * factor), area: area * factor * factor });
        }
    }
    found.sort_by(|a, b| b.area.total_cmp(&a.area));
    found.truncate(MOST);
    found
}

/// The five patches that lie most nearly as the marks do, with how far the fifth is off as a share of the spacing; and
/// whether some lie as in a mirror.
fn arranged(patches: &[Patch], coupon: &Coupon) -> (Option<(f64, View)>, bool) {
    let [first, second, third, fourth, fifth] = coupon.marks;
    let alike = |a: &Patch, b: &Patch| a.area < ALIKE * b.area && b.area < ALIKE * a.area;
    let (mut best, mut mirrored): (Option<(f64, View)>, bool) = (None, false);
    let nearest = |at: [f64; 2], of: &Patch| {
        let away = |patch: &Patch| libm::hypot(patch.middle[0] - at[0], patch.middle[1] - at[1]);
        let near = patches.iter().filter(|patch| alike(patch, of)).min_by(|a, b| away(a).total_cmp(&away(b)))?;
        Some((away(near), *near))
    };
    for a in patches {
        for b in patches.iter().filter(|b| alike(a, b)) {
            for d in patches.iter().filter(|d| alike(a, d)) {
                // a is the first, b the second, d the fourth: the third where a parallelogram has it, about.
                let across = [b.middle[0] - a.middle[0], b.middle[1] - a.middle[1]];
                let down = [d.middle[0] - a.middle[0], d.middle[1] - a.middle[1]];
                let turn = across[0] * down[1] - across[1] * down[0];
                let area = (second[0] - first[0]) * (first[1] - fourth[1]);
                let expected = a.area / (coupon.mark_mm * coupon.mark_mm) * area;
                if !(0.3..3.0).contains(&(turn.abs() / expected)) {
                    continue;
                }
                let per_mm = (turn.abs() / area).sqrt();
                let corner = [b.middle[0] + down[0], b.middle[1] + down[1]];
                let Some((away, c)) = nearest(corner, a) else { continue };
                if away > FOURTH * coupon.spacing_mm * per_mm {
                    continue;
                }
                let points = [(first, a.middle), (second, b.middle), (third, c.middle), (fourth, d.middle)];
                let Some(view) = View::through(&points) else { continue };
                let Some((away, _)) = nearest(view.pixel(fifth), a) else { continue };
                let off = away / (coupon.spacing_mm * per_mm);
                if off > FIFTH {
                    continue;
                }
                if turn < 0.0 {
                    mirrored = true;
                } else if best.is_none_or(|best| off < best.0) {
                    best = Some((off, view));
                }
            }
        }
    }
    (best, mirrored)
}

/// The middle of what is dark around where a mark should be.
fn middle_of(plane: &Plane, view: &View, mark: [f64; 2], side_mm: f64) -> Option<[f64; 2]> {
    let half = 0.5 * WINDOW * side_mm;
    let corners = [[-half, -half], [half, half]].map(|by| [mark[0] + by[0], mark[1] + by[1]]);
    let corner = |at: [f64; 2]| {
        let [u, v] = view.pixel(at);
        u > 0.0 && v > 0.0 && u < plane.width as f64 && v < plane.height as f64
    };
    let within = view.pixels_within(corners[0], corners[1], plane);
    if within.is_empty() || !corners.iter().all(|at| corner(*at)) {
        return None;
    }
    let mut sorted: Vec<f32> = within.iter().map(|&pixel| plane.values[pixel]).collect();
    sorted.sort_by(f32::total_cmp);
    // Not the brightest: a hot pixel is no paper.
    let white = sorted[sorted.len() * 9 / 10];
    // What is white by the blur of the light counts for nothing, so that a window a little aside does not matter.
    let dark = |pixel: usize| f64::from((0.5 * white - plane.values[pixel]).max(0.0));
    let mut sums = [0.0; 3];
    for pixel in within {
        let (x, y, dark) = (pixel % plane.width, pixel / plane.width, dark(pixel));
        sums = [sums[0] + dark * (x as f64 + 0.5), sums[1] + dark * (y as f64 + 0.5), sums[2] + dark];
    }
    (sums[2] > 0.0).then(|| [sums[0] / sums[2], sums[1] / sums[2]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_on_a_line_tell_no_place() {
        let square = [[0.0, 0.0], [40.0, 0.0], [0.0, 30.0], [40.0, 30.0]];
        let line = [0.0, 13.0, 27.0, 41.0].map(|x| [x, 0.3 * x]);
        let seen =
            |places: [[f64; 2]; 4]| View::through(&places.map(|[x, y]| ([x, y], [10.0 * x + 100.0, 900.0 - 10.0 * y])));
        assert!(seen(square).is_some());
        assert!(seen(line).is_none());
    }
}
