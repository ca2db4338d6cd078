//! Polygons of more than three corners: a fan where that is right, ears where it is not.
//!
//! A parser lays a fan around the first corner. It covers the polygon once if all its triangles turn the polygon's way
//! round (seen along the normal of Newell's method), as in every convex polygon. Otherwise ears are cut off the
//! polygon's projection (Meisters, *Polygons have ears*, Amer. Math. Monthly 82, 1975): every simple polygon has one. A
//! polygon that crosses itself may have none; what is left of it stays a fan.

use glam::DVec3;

use super::raw::RawMesh;

/// Turns below this, relative to the whole polygon's area, are straight on: rounding of coordinates.
const STRAIGHT: f64 = 1e-12;
/// Longest polygon that is cut ear by ear: about a square of steps, as corners are remembered that are none.
const MAX_EARS: usize = 20_000;

/// Replaces the fans that fold over themselves. Every index must be in range.
pub(super) fn settle(raw: &mut RawMesh) {
    for [first, corners] in std::mem::take(&mut raw.fans) {
        let (first, corners) = (first as usize, corners as usize);
        let triangles = first..first + corners - 2;
        let rim = |t: usize| if t == 0 { 0..3 } else { 2..3 };
        // The polygon's corners, as triangle and corner of the fan.
        let at: Vec<(usize, usize)> = (0..corners - 2).flat_map(|t| rim(t).map(move |c| (first + t, c))).collect();
        let points: Vec<DVec3> = at.iter().map(|&(t, c)| raw.positions[raw.triangles[t][c] as usize]).collect();
        let Some(cut) = triangulated(&points) else { continue };
        replace(&mut raw.triangles, triangles.clone(), &at, &cut);
        replace(&mut raw.uvs, triangles.clone(), &at, &cut);
        replace(&mut raw.corner_colors, triangles, &at, &cut);
    }
}

/// Rewrites an attribute of the fan's corners for the triangles that replace it.
fn replace<T: Copy>(list: &mut [[T; 3]], fan: std::ops::Range<usize>, at: &[(usize, usize)], cut: &[[usize; 3]]) {
    let Some(fan_values) = list.get(fan.clone()).map(<[_]>::to_vec) else { return };
    for (triangle, corners) in list[fan.clone()].iter_mut().zip(cut) {
        *triangle = corners.map(|corner| {
            let (t, c) = at[corner];
            fan_values[t - fan.start][c]
        });
    }
}

/// Triangles of a polygon for which the fan will not do.
fn triangulated(points: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    let origin = points[0];
    let normal: DVec3 = points.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin)).sum();
    let area = normal.length();
    let turn = |a: usize, b: usize, c: usize| (points[b] - points[a]).cross(points[c] - points[a]).dot(normal);
    let straight = STRAIGHT * area * area;
    if (1..points.len() - 1).all(|i| turn(0, i, i + 1) >= -straight) || points.len() > MAX_EARS || !(area > 0.0) {
        return None;
    }
    let mut left: Vec<usize> = (0..points.len()).collect();
    let mut cut = Vec::with_capacity(points.len() - 2);
    // What is known of a corner holds until a neighbour goes, or the point that lies in its way.
    let mut known = vec![Corner::Unknown; points.len()];
    let mut is_left = vec![true; points.len()];
    while left.len() > 3 {
        let n = left.len();
        let corners = |i: usize| [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
        let look = |i: usize| {
            let [a, b, c] = corners(i);
            let holds = |&p: &usize| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
            let same_place = |p: usize| [a, b, c].iter().any(|&q| points[p] == points[q]);
            if turn(a, b, c) <= straight {
                return Corner::Turns;
            }
            let in_the_way = left.iter().find(|&p| ![a, b, c].contains(p) && !same_place(*p) && holds(p));
            in_the_way.map_or(Corner::Ear, |&point| Corner::Holds(point))
        };
        // Without an ear a straight corner goes, and failing that any.
        let ear = (0..n).find(|&i| {
            let corner = &mut known[left[i]];
            let stands = match *corner {
                Corner::Holds(point) => is_left[point],
                Corner::Ear | Corner::Turns => true,
                Corner::Unknown => false,
            };
            if !stands {
                *corner = look(i);
            }
            *corner == Corner::Ear
        });
        let ear = ear.or_else(|| (0..n).find(|&i| turn(corners(i)[0], corners(i)[1], corners(i)[2]).abs() <= straight));
        let ear = ear.unwrap_or(1);
        let [before, gone, after] = corners(ear);
        cut.push([before, gone, after]);
        (known[before], known[after], is_left[gone]) = (Corner::Unknown, Corner::Unknown, false);
        left.remove(ear);
    }
    cut.push([left[0], left[1], left[2]]);
    Some(cut)
}

/// What is known of a corner that is left.
#[derive(Clone, Copy, PartialEq)]
enum Corner {
    Unknown,
    Ear,
    /// Straight, or to the outside.
    Turns,
    /// This point lies in its triangle.
    Holds(usize),
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    fn area(points: &[DVec3], triangles: &[[usize; 3]]) -> f64 {
        triangles.iter().map(|t| 0.5 * (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]).length()).sum()
    }

    fn flat(points: &[(i32, i32)]) -> Vec<DVec3> {
        points.iter().map(|&(x, y)| DVec3::new(x.into(), y.into(), 0.25 * f64::from(x))).collect()
    }

    #[test]
    fn convex_polygons_stay_fans() {
        assert_eq!(triangulated(&flat(&[(0, 0), (1, 0), (2, 0), (2, 2), (0, 2)])), None);
        assert_eq!(triangulated(&[DVec3::ZERO; 5]), None);
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        let slope = (1.0f64 + 0.0625).sqrt();
        for (points, expected) in [
            (&[(0, 0), (4, 0), (4, 4), (3, 1)][..], 4.0),
            (&[(3, 1), (0, 0), (4, 0), (4, 4)], 4.0),
            (&[(2, 2), (1, 2), (1, 1), (0, 1), (0, 0), (2, 0)], 3.0),
            (&[(0, 0), (5, 0), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], 11.0),
        ] {
            for turned in 0..points.len() {
                let mut points = flat(points);
                points.rotate_left(turned);
                let fan: Vec<_> = (1..points.len() - 1).map(|i| [0, i, i + 1]).collect();
                let found = area(&points, &triangulated(&points).unwrap_or(fan));
                assert!((found - expected * slope).abs() < 1e-12, "{found} for {points:?}");
            }
        }
    }

    /// A comb of 300 teeth, and a zigzag ring like a gear.
    #[test]
    fn long_polygons_are_covered_once_too() {
        let mut comb = vec![(0, -1), (600, -1)];
        comb.extend((0..600).rev().map(|x| (x, if x % 2 == 0 { 0 } else { 5 })));
        let comb = flat(&comb);
        // Under the zigzag from (599, 5) to (0, 0), and the corner at (600, −1).
        let below = |points: &[DVec3]| {
            let shoelace: f64 = (0..points.len())
                .map(|i| points[i].truncate().perp_dot(points[(i + 1) % points.len()].truncate()))
                .sum();
            0.5 * shoelace * (1.0f64 + 0.0625).sqrt()
        };
        let gear: Vec<DVec3> = (0..2000)
            .map(|i| {
                let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 2000.0).sin_cos();
                let radius = if i % 2 == 0 { 10.0 } else { 6.0 };
                DVec3::new(radius * cos, radius * sin, 0.25 * radius * cos)
            })
            .collect();
        for points in [comb, gear] {
            let found = area(&points, &triangulated(&points).unwrap());
            assert!((found / below(&points) - 1.0).abs() < 1e-9, "{found} for {}", below(&points));
        }
    }

    #[test]
    fn attributes_follow_their_corners() {
        let mut raw = RawMesh::new(1.0);
        raw.positions = flat(&[(0, 0), (4, 0), (4, 4), (3, 1)]);
        let uv = |p: u32| Vec2::new(p as f32, -(p as f32));
        for corners in [[0, 1, 2], [0, 2, 3]] {
            raw.push(String::new, corners, Some(corners.map(uv))).unwrap();
        }
        raw.end_polygon(0, 4);
        settle(&mut raw);
        assert_ne!(raw.triangles[0], [0, 1, 2]);
        for (triangle, uvs) in raw.triangles.iter().zip(&raw.uvs) {
            assert_eq!(triangle.map(uv), *uvs);
        }
    }
}
