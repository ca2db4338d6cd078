//! How thick a solid is at a point of its surface: the radius of the largest ball inside that touches the surface
//! there, half the thickness of a plate.
//!
//! The shrinking ball of Ma, Bae and Choi (2012), *3D medial axis point approximation using nearest neighbors and the
//! normal field*: a ball that touches the surface at p, its centre c on the normal, shrinks until no surface is inside;
//! each time to the ball through p and the point q that is nearest to c.
//!
//! ```text
//!        n                r' = |p − q|² / (2 n·(p − q))
//!    ────p────
//!        c·               A ball that a facet's neighbour limits, seen from c under a small angle from p, is no news
//!    ────q────            of how thick the solid is, but of how finely it was cut into facets: it stays as it was.
//! ```
//!
//! Where two faces meet at an angle a ball that touches one near the edge is small, down to nothing at the edge itself.

use glam::DVec3;

use super::Surface;

/// Sine of half the angle, seen from a ball's centre, between where it touches and what limits it, below which that is
/// a neighbouring facet: 40°, edges of more than 140° within. Facets of a ball in 24 meridians meet at 165°.
const FACET: f64 = 0.342;
/// A ball that would shrink by less than this share of its radius touches. Facets of a ball in 24 meridians lie 1% of
/// its radius below it.
const TOUCHES: f64 = 0.02;
/// Balls that are tried; five is much.
const TRIES: usize = 24;

/// A ball inside of a solid that touches its surface at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallInside {
    /// Its radius, mm.
    pub radius: f64,
    /// Cosine between the normal at the point and the way from where the ball is limited: 1 where that is right
    /// opposite, 0 where nothing limits it.
    pub cosine: f64,
}

/// Radius in mm, at most `most`, of the largest ball inside of `surface` that touches it at `point`, whose outward unit
/// normal is `normal`.
pub fn half_thickness(surface: &Surface, point: DVec3, normal: DVec3, most: f64) -> f64 {
    ball_inside(surface, point, normal, most).radius
}

/// The largest ball inside of `surface`, at most of radius `most` mm, that touches it at `point`, whose outward unit
/// normal is `normal`.
pub fn ball_inside(surface: &Surface, point: DVec3, normal: DVec3, most: f64) -> BallInside {
    let (mut radius, mut cosine) = (most, 0.0);
    for _ in 0..TRIES {
        let centre = point - normal * radius;
        let nearest = surface.closest(centre);
        if nearest.distance >= radius * (1.0 - TOUCHES) {
            break;
        }
        let chord = point - nearest.point;
        let along = chord.dot(normal);
        if along < FACET * chord.length() {
            break;
        }
        let smaller = chord.length_squared() / (2.0 * along);
        if !(along > 0.0 && smaller < radius) {
            break;
        }
        radius = smaller;
        cosine = along / chord.length();
    }
    BallInside { radius, cosine }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriangleMesh;

    fn box_of(size: DVec3) -> Surface {
        let corner = |n: u32| DVec3::new(f64::from(n & 1), f64::from(n >> 1 & 1), f64::from(n >> 2)) * size;
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Surface::new(&TriangleMesh { positions: (0..8).map(corner).collect(), triangles, ..Default::default() })
            .unwrap()
    }

    fn ball(radius: f64, meridians: u32) -> Surface {
        let (n, rows) = (meridians, meridians / 2);
        let point = |row: u32, column: u32| {
            let (polar, turn) = (
                std::f64::consts::PI * f64::from(row) / f64::from(rows),
                std::f64::consts::TAU * f64::from(column % n) / f64::from(n),
            );
            DVec3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos()) * radius
        };
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (row, column) in (0..rows).flat_map(|row| (0..n).map(move |column| (row, column))) {
            let [a, b, c, d] = [(row, column), (row + 1, column), (row + 1, column + 1), (row, column + 1)]
                .map(|(row, column)| point(row, column));
            for corners in [[a, b, c], [a, c, d]] {
                if (corners[1] - corners[0]).cross(corners[2] - corners[0]).length() > 1e-9 {
                    let first = positions.len() as u32;
                    positions.extend(corners);
                    triangles.push([first, first + 1, first + 2]);
                }
            }
        }
        Surface::new(&TriangleMesh { positions, triangles, ..Default::default() }).unwrap()
    }

    #[test]
    fn a_plate_is_half_as_thick_as_it_is() {
        let plate = box_of(DVec3::new(20.0, 20.0, 1.5));
        for at in [DVec3::new(10.0, 10.0, 1.5), DVec3::new(3.3, 7.1, 1.5)] {
            assert!((half_thickness(&plate, at, DVec3::Z, 5.0) - 0.75).abs() < 1e-12);
        }
        assert!((half_thickness(&plate, DVec3::new(3.0, 3.0, 0.0), -DVec3::Z, 5.0) - 0.75).abs() < 1e-12);
        assert_eq!(half_thickness(&plate, DVec3::new(10.0, 10.0, 1.5), DVec3::Z, 0.5), 0.5);
    }

    #[test]
    fn near_an_edge_it_is_the_way_to_the_edge() {
        let cube = box_of(DVec3::splat(12.0));
        for way in [0.05, 0.4, 2.0, 5.9] {
            let found = half_thickness(&cube, DVec3::new(way, 6.0, 12.0), DVec3::Z, 8.0);
            assert!((found - way).abs() < 0.03 * way, "{found} {way} mm from the edge");
        }
    }

    /// At half of all places within 15%, near the edges of facets too; where slivers meet, by the poles, it can be half
    /// as much. That facets make a ball thinner by a tenth is known and left.
    #[test]
    fn a_ball_is_as_thick_as_its_radius_but_for_its_facets() {
        let ball = ball(2.5, 64);
        let mut all = Vec::new();
        for (t, &[a, b, c]) in ball.triangles().iter().enumerate().step_by(7) {
            let normal = (b - a).cross(c - a).normalize();
            for n in 0..3 {
                let mut weights = [0.01; 3];
                weights[n] = 0.5;
                weights[(n + t) % 3] += 0.48;
                let weights = weights.map(|w| w / weights.iter().sum::<f64>());
                all.push(half_thickness(&ball, a * weights[0] + b * weights[1] + c * weights[2], normal, 6.0));
            }
        }
        all.sort_by(f64::total_cmp);
        let middle = all[all.len() / 2];
        assert!((2.125..2.7).contains(&middle), "{middle}");
    }
}
