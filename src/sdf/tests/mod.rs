//! Laws of the grid and Lp distances, and of what the kernel leaves out.

mod grid;
mod lp;
mod parts;

use glam::DVec3;

/// A sphere of 20 · 4ⁿ triangles with corners on the sphere.
fn icosphere(centre: DVec3, radius: f64, subdivisions: usize) -> Vec<[DVec3; 3]> {
    let t = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let corners: Vec<DVec3> = (0..12)
        .map(|n| {
            let (a, b) = (if n & 1 == 0 { 1.0 } else { -1.0 }, if n & 2 == 0 { t } else { -t });
            [DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)][n / 4].normalize()
        })
        .collect();
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let near = |a: usize, b: usize| corners[a].distance(corners[b]) < 1.1;
                if near(i, j) && near(j, k) && near(k, i) {
                    let [a, b, c] = [corners[i], corners[j], corners[k]];
                    let outward = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..subdivisions {
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [a + b, b + c, c + a].map(|m| m.normalize());
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    triangles.iter().map(|t| t.map(|c| centre + radius * c)).collect()
}

/// Numbers from 0 to 1, the same every time.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn point(&mut self, low: DVec3, high: DVec3) -> DVec3 {
        low + (high - low) * DVec3::new(self.next(), self.next(), self.next())
    }
}
