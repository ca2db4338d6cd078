//! Where one triangle meets another: lines to cut it along.
//!
//! A corner nearer to the plane than the tolerance lies in it, so that faces which touch but for rounding are coplanar,
//! and faces that end at a plane end there. All lines are in the triangle's own plane.

use glam::{DVec2, DVec3};

/// A triangle's plane, with axes in it. The first corner is the origin, the second lies on the first axis.
#[derive(Debug, Clone, Copy)]
pub(in crate::mesh) struct Frame {
    origin: DVec3,
    axes: [DVec3; 2],
    /// Unit, outwards.
    pub(in crate::mesh) normal: DVec3,
    /// The triangle's corners, counter-clockwise.
    pub(in crate::mesh) corners: [DVec2; 3],
}

/// How near is near enough, mm.
#[derive(Debug, Clone, Copy)]
pub(in crate::mesh) struct Tolerance {
    /// Apart by less than this, things touch.
    pub(in crate::mesh) touch: f64,
    /// Shorter than this, lengths are rounding.
    pub(in crate::mesh) rounding: f64,
}

/// A piece of a line in a triangle's plane.
pub(in crate::mesh) type Line = [DVec2; 2];

impl Frame {
    /// `None` for a triangle without area.
    pub(in crate::mesh) fn new(&[a, b, c]: &[DVec3; 3]) -> Option<Self> {
        let normal = (b - a).cross(c - a).try_normalize()?;
        let first = (b - a).try_normalize()?;
        let axes = [first, normal.cross(first)];
        let mut frame = Self { origin: a, axes, normal, corners: [DVec2::ZERO; 3] };
        frame.corners = [a, b, c].map(|p| frame.flat(p));
        Some(frame)
    }

    fn flat(&self, p: DVec3) -> DVec2 {
        let p = p - self.origin;
        DVec2::new(p.dot(self.axes[0]), p.dot(self.axes[1]))
    }

    fn height(&self, p: DVec3) -> f64 {
        (p - self.origin).dot(self.normal)
    }

    /// The lines along which `other` meets the triangle; whether it touches it at all. `shared` tells which corners of
    /// `other` are corners of the triangle: meeting there alone is none.
    pub(in crate::mesh) fn meet(
        &self,
        other: &[DVec3; 3],
        shared: [bool; 3],
        tolerance: Tolerance,
        lines: &mut Vec<Line>,
    ) -> bool {
        let height: [f64; 3] = std::array::from_fn(|i| if shared[i] { 0.0 } else { self.height(other[i]) });
        let side = height.map(|h| i32::from(h > tolerance.touch) - i32::from(h < -tolerance.touch));
        if side == [1; 3] || side == [-1; 3] {
            return false;
        }
        let neighbours = shared.iter().filter(|shared| **shared).count();
        let in_plane = side.iter().filter(|side| **side == 0).count();
        if in_plane == 3 {
            let flat = other.map(|p| self.flat(p));
            if !overlap(&self.corners, &flat, tolerance.rounding) {
                return false;
            }
            lines.extend((0..3).map(|i| [flat[i], flat[(i + 1) % 3]]));
            return true;
        }
        if neighbours >= 2 {
            return false;
        }
        // Where the edges of `other` cross the plane, and its corners in the plane.
        let mut ends = [DVec2::ZERO; 2];
        let mut found = 0;
        for i in 0..3 {
            let j = (i + 1) % 3;
            let point = if side[i] == 0 {
                self.flat(other[i])
            } else if side[i] * side[j] < 0 {
                let share = height[i] / (height[i] - height[j]);
                self.flat(other[i]).lerp(self.flat(other[j]), share)
            } else {
                continue;
            };
            if found < 2 {
                ends[found] = point;
            }
            found += 1;
        }
        if found != 2 {
            return false;
        }
        // A stranger that passes along the outside of an edge touches the triangle there; a neighbour goes on from it.
        let margin = if neighbours > 0 { tolerance.rounding } else { tolerance.touch };
        match clipped(&self.corners, ends, margin) {
            Some(line) if line[0].distance(line[1]) > 4.0 * margin => {
                lines.push(line);
                true
            }
            _ => false,
        }
    }

    /// Whether `other` covers the triangle's point `at`, facing the same way, no farther than `touch`.
    pub(in crate::mesh) fn is_covered(&self, at: DVec3, other: &[DVec3; 3], touch: f64) -> bool {
        /// Cosine of the angle up to which faces look the same way: 1 degree.
        const ALIKE: f64 = 0.999_85;
        let Some(frame) = Self::new(other) else { return false };
        if frame.normal.dot(self.normal) < ALIKE || frame.height(at).abs() > touch {
            return false;
        }
        let p = frame.flat(at);
        (0..3).all(|i| (frame.corners[(i + 1) % 3] - frame.corners[i]).perp_dot(p - frame.corners[i]) > 0.0)
    }
}

/// Whether two triangles overlap by more than rounding: no line along an edge of either parts them.
fn overlap(a: &[DVec2; 3], b: &[DVec2; 3], rounding: f64) -> bool {
    let parts = |a: &[DVec2; 3], b: &[DVec2; 3]| {
        (0..3).any(|i| {
            let (from, to) = (a[i], a[(i + 1) % 3]);
            let Some(across) = (to - from).perp().try_normalize() else { return true };
            let inside = across.dot(a[(i + 2) % 3] - from).signum();
            b.iter().all(|p| across.dot(*p - from) * inside <= rounding)
        })
    };
    !parts(a, b) && !parts(b, a)
}

/// The part of a line within `margin` of a counter-clockwise triangle.
fn clipped(triangle: &[DVec2; 3], line: Line, margin: f64) -> Option<Line> {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for i in 0..3 {
        let edge = triangle[(i + 1) % 3] - triangle[i];
        let inwards = edge.perp().normalize_or_zero();
        let [a, b] = line.map(|p| inwards.dot(p - triangle[i]) + margin);
        match (a >= 0.0, b >= 0.0) {
            (true, true) => {}
            (false, false) => return None,
            (false, true) => from = from.max(a / (a - b)),
            (true, false) => to = to.min(a / (a - b)),
        }
    }
    (from < to).then(|| [line[0].lerp(line[1], from), line[0].lerp(line[1], to)])
}
