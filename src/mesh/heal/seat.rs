//! Whether an open patch sits on a body: its rim in or on it, and some of it outside.

use glam::DVec3;

use super::nesting::winding;
use crate::mesh::bounds;
use crate::parallel;

/// Corners of a patch that are asked, of its rim and of all of it.
const SAMPLES: usize = 24;
/// Solid angles that all patches together may compute: about a second on two cores.
const BUDGET: usize = 50_000_000;
/// Triangles that one thread looks at in one go.
const CHUNK: usize = 1 << 12;
/// A rim lies on a body at this distance, in diagonals of the box around it.
const TOUCH: f64 = 5e-3;

/// The closed surface of bodies.
pub(super) struct Ground {
    surface: Vec<[DVec3; 3]>,
    /// Corners of the box around it.
    low: DVec3,
    high: DVec3,
    spent: usize,
}

impl Ground {
    pub(super) fn new(surface: Vec<[DVec3; 3]>) -> Self {
        let (low, high) = bounds(surface.as_flattened());
        Self { surface, low, high, spent: 0 }
    }

    /// Adds a closed body.
    pub(super) fn add(&mut self, body: impl Iterator<Item = [DVec3; 3]>, is_inwards: bool) {
        for [a, b, c] in body {
            self.surface.push(if is_inwards { [a, c, b] } else { [a, b, c] });
            self.low = self.low.min(a).min(b).min(c);
            self.high = self.high.max(a).max(b).max(c);
        }
    }

    /// Whether all of a rim lies in or on the bodies, and some corner of the patch is outside.
    pub(super) fn holds(&mut self, rim: &[DVec3], corners: &[DVec3]) -> bool {
        let (low, high) = bounds(rim);
        let touch = TOUCH * (high - low).length();
        let near = low.cmpge(self.low - touch).all() && high.cmple(self.high + touch).all();
        if rim.is_empty() || !near {
            return false;
        }
        self.spent += 2 * SAMPLES * self.surface.len();
        if self.spent > BUDGET {
            return false;
        }
        let place = |p: &DVec3| self.place(*p, touch);
        let is_outside = |p: &DVec3| place(p) == Place::Outside;
        !some_of(rim).any(&is_outside) && some_of(corners).any(is_outside)
    }

    fn place(&self, p: DVec3, touch: f64) -> Place {
        let chunks: Vec<_> = self.surface.chunks(CHUNK).collect();
        let touches = |chunk: &&[[DVec3; 3]]| chunk.iter().any(|&t| distance_squared(t, p) <= touch * touch);
        if parallel::map_all(&chunks, touches).contains(&true) {
            return Place::On;
        }
        if winding(&self.surface, p) == 0 { Place::Outside } else { Place::Inside }
    }
}

#[derive(PartialEq, Eq)]
enum Place {
    Inside,
    On,
    Outside,
}

/// Up to [`SAMPLES`] of them, evenly spread.
fn some_of(points: &[DVec3]) -> impl Iterator<Item = &DVec3> {
    let count = points.len().min(SAMPLES);
    (0..count).map(move |i| &points[i * points.len() / count])
}

/// Squared distance of a point from a triangle (Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5).
fn distance_squared([a, b, c]: [DVec3; 3], p: DVec3) -> f64 {
    let (ab, ac, normal) = (b - a, c - a, (b - a).cross(c - a));
    let area = normal.length_squared();
    if area > 0.0 {
        let v = normal.dot((p - a).cross(ac)) / area;
        let w = normal.dot(ab.cross(p - a)) / area;
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return (p - a).dot(normal).powi(2) / area;
        }
    }
    let to_edge = |from: DVec3, to: DVec3| {
        let along = to - from;
        let at = ((p - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        p.distance_squared(from + at * along)
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_to_face_edge_and_corner() {
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for (p, expected) in [
            (DVec3::new(0.25, 0.25, 3.0), 9.0),
            (DVec3::new(0.5, -2.0, 0.0), 4.0),
            (DVec3::new(1.0, 1.0, 0.0), 0.5),
            (DVec3::new(3.0, 0.0, 0.0), 4.0),
        ] {
            assert!((distance_squared(triangle, p) - expected).abs() < 1e-12, "{p}");
        }
    }
}
