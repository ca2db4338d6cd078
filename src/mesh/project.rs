//! Images without texture coordinates: projected along the axes, blended by where the surface faces.
//!
//! Three images hang in the axes' planes, upright as one sees them from the side that a surface faces. A point sees
//! each by the fourth power of its normal's component along that axis, so that flat sides show one image and rounded
//! edges change from one to the next over some 20°. Normals are those of the facets around a corner that are within 45°
//! of the one at hand: creases stay creases.

use glam::{DVec3, Vec2, Vec3};

use super::{Projected, TriangleMesh, bounds};

/// Cosine of the angle within which facets share a normal.
const CREASE: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Projects images onto a mesh.
pub(super) struct Projector {
    low: DVec3,
    tile_mm: f64,
    texels_per_mm: f64,
    /// Normals at each triangle's corners, of length 1.
    normals: Vec<[Vec3; 3]>,
}

impl Projector {
    pub(super) fn new(mesh: &TriangleMesh, tile_mm: f64, texels_per_mm: f64) -> Self {
        // Twice the area long.
        let facet = |t: usize| {
            let [a, b, c] = mesh.triangles[t].map(|v| mesh.positions[v as usize]);
            (b - a).cross(c - a).as_vec3()
        };
        let facets: Vec<Vec3> = (0..mesh.triangles.len()).map(facet).collect();
        let mut first = vec![0_u32; mesh.positions.len() + 1];
        mesh.triangles.iter().flatten().for_each(|&v| first[v as usize + 1] += 1);
        (1..first.len()).for_each(|v| first[v] += first[v - 1]);
        let mut around = vec![0_u32; mesh.triangles.len() * 3];
        let mut next = first.clone();
        for (t, &v) in (0..).zip(&mesh.triangles).flat_map(|(t, corners)| corners.iter().map(move |v| (t, v))) {
            around[next[v as usize] as usize] = t;
            next[v as usize] += 1;
        }
        let normal = |t: usize, v: u32| {
            let own = facets[t].normalize_or_zero();
            let range = first[v as usize] as usize..first[v as usize + 1] as usize;
            let near = around[range].iter().map(|&other| facets[other as usize]);
            let sum: Vec3 = near.filter(|other| other.dot(own) >= CREASE * other.length()).sum();
            let sum = sum.normalize_or_zero();
            if sum == Vec3::ZERO { own } else { sum }
        };
        let normals = (0..mesh.triangles.len()).map(|t| mesh.triangles[t].map(|v| normal(t, v))).collect();
        Self { low: bounds(&mesh.positions).0, tile_mm, texels_per_mm, normals }
    }

    /// How many texels of the finest image lie along a side of a triangle.
    pub(super) fn texels(&self, mesh: &TriangleMesh, t: usize, side: [usize; 2]) -> f32 {
        let [a, b] = side.map(|corner| mesh.positions[mesh.triangles[t][corner] as usize]);
        (a.distance(b) * self.texels_per_mm) as f32
    }

    /// Where the images lie at a point of a triangle, given by the shares of its corners.
    pub(super) fn at(&self, mesh: &TriangleMesh, t: usize, corners: [f32; 3]) -> Projected {
        let positions = mesh.triangles[t].map(|v| mesh.positions[v as usize] - self.low);
        let point: DVec3 = positions.iter().zip(corners).map(|(p, share)| *p * f64::from(share)).sum();
        let normal: Vec3 = self.normals[t].iter().zip(corners).map(|(normal, share)| *normal * share).sum();
        let [x, y, z] = (point / self.tile_mm).to_array();
        let side = |component: f32| if component < 0.0 { -1.0 } else { 1.0 };
        let uv = |u: f64, v: f64| Vec2::new(u as f32, v as f32);
        let powers = normal.to_array().map(|component| (component * component) * (component * component));
        let sum: f32 = powers.iter().sum();
        let shares = if sum > 0.0 { powers.map(|power| power / sum) } else { [0.0, 0.0, 1.0] };
        Projected { uvs: [uv(side(normal.x) * y, -z), uv(-side(normal.y) * x, -z), uv(side(normal.z) * x, -y)], shares }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of 2 mm that faces along an axis, and one beside it that is turned from it.
    fn square(corners: [[f64; 3]; 4]) -> TriangleMesh {
        TriangleMesh {
            positions: corners.map(DVec3::from).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..TriangleMesh::default()
        }
    }

    #[test]
    fn a_flat_side_shows_one_image_upright() {
        let up = square([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0]]);
        let at = Projector::new(&up, 4.0, 1.0).at(&up, 0, [0.0, 1.0, 0.0]);
        assert_eq!((at.shares, at.uvs[2]), ([0.0, 0.0, 1.0], Vec2::new(0.5, 0.0)));
        let front = square([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 0.0, 2.0], [0.0, 0.0, 2.0]]);
        let at = Projector::new(&front, 4.0, 1.0).at(&front, 0, [0.0, 0.0, 1.0]);
        // Seen from -y: x runs to the right, z up.
        assert_eq!((at.shares, at.uvs[1]), ([0.0, 1.0, 0.0], Vec2::new(0.5, -0.5)));
        let projector = Projector::new(&front, 4.0, 8.0);
        assert_eq!(projector.texels(&front, 0, [0, 1]), 16.0);
    }

    #[test]
    fn shares_sum_to_one_and_creases_stay() {
        let mut roof = square([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0]]);
        roof.positions.extend([DVec3::new(3.0, 0.0, -1.7), DVec3::new(3.0, 2.0, -1.7)]);
        roof.triangles.extend([[1, 4, 5], [1, 5, 2]]);
        let projector = Projector::new(&roof, 1.0, 1.0);
        assert_eq!(projector.at(&roof, 0, [0.0, 1.0, 0.0]).shares, [0.0, 0.0, 1.0]);
        let shares = projector.at(&roof, 2, [0.3, 0.3, 0.4]).shares;
        assert!((shares.iter().sum::<f32>() - 1.0).abs() < 1e-6 && shares[0] > shares[2] && shares[2] > 0.0);
    }
}
