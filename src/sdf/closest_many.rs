//! [`closest_point`](super::closest_point) for eight positions, or eight triangles, at once.
//!
//! The same products in the same order, all regions worked out and one chosen, so that the compiler turns it into
//! vector code and every bit is that of the one by one. Thin triangles, which are few, are asked one by one.

use glam::DVec3;
use multiversion::multiversion;

use super::triangle::{THIN, closest_point};

/// Pairs that are worked on together.
pub const LANES: usize = 8;

/// One number of each pair.
type Lanes = [f64; LANES];

/// Positions and triangles, pair by pair.
#[derive(Debug, Clone, Copy)]
pub struct Pairs {
    position: [Lanes; 3],
    corners: [[Lanes; 3]; 3],
}

/// What is found for each pair.
#[derive(Debug, Clone, Copy, Default)]
pub struct Found {
    /// Unsigned distance, mm.
    pub distance: Lanes,
    /// Where the distance rises: the unit vector from the nearest point to the position, per axis; 0 on the triangle
    /// itself, where that is a subgradient.
    pub gradient: [Lanes; 3],
    thin: [bool; LANES],
}

impl Pairs {
    /// Pairs of nothing.
    pub const EMPTY: Self = Self { position: [[0.0; LANES]; 3], corners: [[[0.0; LANES]; 3]; 3] };

    /// Writes a position.
    #[inline(always)]
    pub fn set_position(&mut self, lane: usize, position: DVec3) {
        for (axis, value) in position.to_array().into_iter().enumerate() {
            self.position[axis][lane] = value;
        }
    }

    /// Writes a triangle.
    #[inline(always)]
    pub fn set_triangle(&mut self, lane: usize, triangle: &[DVec3; 3]) {
        for (corner, rows) in triangle.iter().zip(&mut self.corners) {
            for (axis, value) in corner.to_array().into_iter().enumerate() {
                rows[axis][lane] = value;
            }
        }
    }

    /// The nearest points of all pairs.
    pub fn closest(&self) -> Found {
        let mut found = Found::default();
        closest(self, &mut found);
        for lane in (0..LANES).filter(|lane| found.thin[*lane]) {
            let at = |rows: &[Lanes; 3]| DVec3::new(rows[0][lane], rows[1][lane], rows[2][lane]);
            let (p, corners) = (at(&self.position), [0, 1, 2].map(|corner| at(&self.corners[corner])));
            let one = closest_point(p, &corners);
            let distance = one.distance_squared.sqrt();
            let gradient = if distance > 0.0 { (p - one.point) / distance } else { DVec3::ZERO };
            for (axis, value) in gradient.to_array().into_iter().enumerate() {
                found.gradient[axis][lane] = value;
            }
            found.distance[lane] = distance;
        }
        found
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn closest(pairs: &Pairs, found: &mut Found) {
    for lane in 0..LANES {
        let at = |rows: &[Lanes; 3]| [rows[0][lane], rows[1][lane], rows[2][lane]];
        let (p, [a, b, c]) =
            (at(&pairs.position), [at(&pairs.corners[0]), at(&pairs.corners[1]), at(&pairs.corners[2])]);
        let (ab, ac, bc) = (minus(b, a), minus(c, a), minus(c, b));
        let (ap, bp, cp) = (minus(p, a), minus(p, b), minus(p, c));
        let (d1, d2, d3, d4, d5, d6) = (dot(ab, ap), dot(ac, ap), dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp));
        let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
        // From the last region to the first: which of them is asked first decides.
        let normal_squared = va + vb + vc;
        let scale = 1.0 / normal_squared;
        let (mut v, mut w) = (vb * scale, vc * scale);
        let longest = greater(greater(dot(ab, ab), dot(ac, ac)), dot(bc, bc));
        let mut thin = normal_squared < (THIN * longest) * (THIN * longest);
        let mut choose = |region: bool, weights: [f64; 2]| {
            v = if region { weights[0] } else { v };
            w = if region { weights[1] } else { w };
            thin &= !region;
        };
        let along_bc = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        choose((va <= 0.0) & (d4 >= d3) & (d5 >= d6), [1.0 - along_bc, along_bc]);
        choose((vb <= 0.0) & (d2 >= 0.0) & (d6 <= 0.0), [0.0, d2 / (d2 - d6)]);
        choose((d6 >= 0.0) & (d5 <= d6), [0.0, 1.0]);
        choose((vc <= 0.0) & (d1 >= 0.0) & (d3 <= 0.0), [d1 / (d1 - d3), 0.0]);
        choose((d3 >= 0.0) & (d4 <= d3), [1.0, 0.0]);
        choose((d1 <= 0.0) & (d2 <= 0.0), [0.0, 0.0]);
        let offset = [
            p[0] - (a[0] + ab[0] * v + ac[0] * w),
            p[1] - (a[1] + ab[1] * v + ac[1] * w),
            p[2] - (a[2] + ab[2] * v + ac[2] * w),
        ];
        let distance = dot(offset, offset).sqrt();
        let away = distance > 0.0;
        found.distance[lane] = distance;
        found.gradient[0][lane] = if away { offset[0] / distance } else { 0.0 };
        found.gradient[1][lane] = if away { offset[1] / distance } else { 0.0 };
        found.gradient[2][lane] = if away { offset[2] / distance } else { 0.0 };
        found.thin[lane] = thin;
    }
}

#[inline(always)]
fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
