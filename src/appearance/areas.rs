//! How much surface every texel covers, in mm²: what shares, clusters and all warnings in percent weigh by.
//!
//! A triangle's area is spread over the texels by the part of its picture in the texture that falls on each (the
//! texel's square clipped to the triangle, exactly). Triangles over the same texel add up; a texel that no triangle
//! covers weighs nothing. What falls on a texel whose centre no triangle covers counts for the one that stands in for
//! it.

use glam::{DVec2, Vec2};

use super::charts::{Atlas, ChartMap, for_covered_texels, visits_all, wrap};
use crate::mesh::TriangleMesh;

/// Half a texel's diagonal: beyond it a square is wholly on one side of an edge.
const HALF_DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// A picture smaller than this, in texels², is a point or a line.
const FLAT: f64 = 1e-9;

impl Atlas {
    /// The area of `mesh`, which the atlas was laid over, by page and texel, mm². Texels that are covered have some.
    pub fn areas(&self, mesh: &TriangleMesh) -> Vec<Vec<f64>> {
        let mut areas: Vec<Vec<f64>> = self.pages().iter().map(|page| vec![0.0; page.source.len()]).collect();
        let mut shares = Vec::new();
        for ((corners, uvs), place) in mesh.corners().zip(&mesh.uvs).zip(self.places()) {
            let page = &self.pages()[usize::from(place.page)];
            let area = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            page.shares(uvs, &mut shares);
            let whole: f64 = shares.iter().map(|(_, share)| share).sum();
            for (texel, share) in &shares {
                areas[usize::from(place.page)][page.source[*texel] as usize] += area * (share / whole);
            }
        }
        // A triangle may be as good as nothing; a covered texel is not.
        let least = 1e-12 * areas.iter().flatten().sum::<f64>();
        for (page, areas) in self.pages().iter().zip(&mut areas) {
            page.covered().for_each(|texel| areas[texel] = areas[texel].max(least));
        }
        areas
    }
}

impl ChartMap {
    /// Replaces `shares` by the texels under a triangle and the part of each that is; at least one.
    fn shares(&self, uvs: &[Vec2; 3], shares: &mut Vec<(usize, f64)>) {
        shares.clear();
        let size = Vec2::new(self.width as f32, self.height as f32);
        let flat = uvs.map(|uv| uv * size - Vec2::splat(0.5));
        let texel = |x: i32, y: i32| (wrap(x, self.width) + self.width * wrap(y, self.height)) as usize;
        let corners = flat.map(Vec2::as_dvec2);
        let turn = (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]);
        if visits_all(&flat, size) {
            shares.extend((0..self.source.len()).map(|texel| (texel, 1.0)));
        } else if turn.abs() > FLAT {
            let edges: [(DVec2, DVec2); 3] = std::array::from_fn(|i| {
                let edge = corners[(i + 1) % 3] - corners[i];
                (corners[i], edge.perp().normalize() * turn.signum())
            });
            for_covered_texels(flat, HALF_DIAGONAL as f32 + 1e-3, size, |x, y| {
                let share = overlap(&edges, DVec2::new(x.into(), y.into()));
                if share > 0.0 {
                    shares.push((texel(x, y), share));
                }
            });
        }
        if shares.is_empty() {
            let middle = (flat[0] + flat[1] + flat[2]) / 3.0;
            shares.push((texel(middle.x.round() as i32, middle.y.round() as i32), 1.0));
        }
    }
}

/// Part of the texel around `centre` that lies inwards of all edges, each a point and a unit vector inwards.
fn overlap(edges: &[(DVec2, DVec2); 3], centre: DVec2) -> f64 {
    let depth = edges.map(|(from, inwards)| inwards.dot(centre - from));
    if depth.iter().any(|depth| *depth <= -HALF_DIAGONAL) {
        return 0.0;
    }
    if depth.iter().all(|depth| *depth >= HALF_DIAGONAL) {
        return 1.0;
    }
    // Sutherland and Hodgman's clipping; three cuts leave at most seven corners.
    let mut polygon = [DVec2::ZERO; 8];
    let mut corners = 4;
    for (corner, [x, y]) in polygon.iter_mut().zip([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) {
        *corner = DVec2::new(x, y);
    }
    for ((_, inwards), depth) in edges.iter().zip(depth) {
        let (before, mut kept) = (polygon, 0);
        for i in 0..corners {
            let (a, b) = (before[i], before[(i + 1) % corners]);
            let [inside_a, inside_b] = [a, b].map(|p| inwards.dot(p) + depth);
            if inside_a >= 0.0 {
                polygon[kept] = a;
                kept += 1;
            }
            if (inside_a >= 0.0) != (inside_b >= 0.0) {
                polygon[kept] = a.lerp(b, inside_a / (inside_a - inside_b));
                kept += 1;
            }
        }
        corners = kept;
        if corners < 3 {
            return 0.0;
        }
    }
    let twice: f64 = (0..corners).map(|i| polygon[i].perp_dot(polygon[(i + 1) % corners])).sum();
    0.5 * twice.abs()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;

    /// Two right triangles on a page of 4 × 4: one as large as half the page, one over a part of it, and how large.
    fn mesh(uvs: [[Vec2; 3]; 2], sizes: [f64; 2]) -> TriangleMesh {
        let positions = sizes.iter().flat_map(|size| [DVec3::ZERO, DVec3::X * *size, DVec3::Y]).collect();
        TriangleMesh { positions, triangles: vec![[0, 1, 2], [3, 4, 5]], uvs: uvs.to_vec(), ..TriangleMesh::default() }
    }

    #[test]
    fn texels_cover_what_lies_under_them() {
        let half = [Vec2::ZERO, Vec2::X, Vec2::Y];
        let quad = half.map(|uv| uv * 0.25);
        let mesh = mesh([half, quad], [32.0, 2.0]);
        let atlas = Atlas::new(&mesh, &[(4, 4)], &[]);
        let areas = atlas.areas(&mesh)[0].clone();
        assert!((areas.iter().sum::<f64>() - 17.0).abs() < 1e-12);
        // A whole texel has 2 of the first triangle's 16 mm², the first all of the second's too.
        assert!((areas[0] - 3.0).abs() < 1e-9 && (areas[1] - 2.0).abs() < 1e-9, "{areas:?}");
        assert_eq!(areas[15], 0.0);
    }

    #[test]
    fn a_point_or_a_line_has_its_area_all_the_same() {
        for uvs in [[Vec2::splat(0.1); 3], [Vec2::ZERO, Vec2::splat(0.3), Vec2::splat(0.1)], [Vec2::NAN; 3]] {
            let mesh = mesh([uvs, [Vec2::splat(0.9); 3]], [2.0, 4.0]);
            let areas = Atlas::new(&mesh, &[(4, 4)], &[]).areas(&mesh)[0].clone();
            // Each of 16 texels has at least 1e-12 of the whole.
            assert!((areas.iter().sum::<f64>() / 3.0 - 1.0).abs() < 17e-12, "{areas:?}");
        }
        let mesh = mesh([[Vec2::ZERO, Vec2::X * 1e3, Vec2::Y * 1e3]; 2], [2.0, 4.0]);
        let areas = Atlas::new(&mesh, &[(4, 4)], &[]).areas(&mesh)[0].clone();
        assert!(areas.iter().all(|area| (area - 3.0 / 16.0).abs() < 1e-12), "{areas:?}");
    }

    proptest! {
        /// The parts that texels cut from a triangle make it up.
        #[test]
        fn nothing_is_lost_and_nothing_counts_twice(
            corners in [[-1.5f32..1.5, -1.5f32..1.5], [-1.5f32..1.5, -1.5f32..1.5], [-1.5f32..1.5, -1.5f32..1.5]],
        ) {
            let uvs = corners.map(Vec2::from);
            let map = ChartMap::new(&TriangleMesh::default(), &[], |_| false, 7, 5);
            let mut shares = Vec::new();
            map.shares(&uvs, &mut shares);
            let [a, b, c] = uvs.map(|uv| uv.as_dvec2() * DVec2::new(7.0, 5.0));
            let area = 0.5 * (b - a).perp_dot(c - a).abs();
            let sum: f64 = shares.iter().map(|(_, share)| share).sum();
            prop_assume!(area > 1e-3);
            prop_assert!((sum / area - 1.0).abs() < 1e-3 / area.min(1.0), "{sum} of {area}");
        }
    }
}
