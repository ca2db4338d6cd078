//! Shapes of triangles, for the test programs and for the tests within the crate.
#![allow(dead_code)] // no program needs all of them

use std::collections::HashMap;

use glam::DVec3;

pub type Triangles = Vec<[DVec3; 3]>;

/// A box of 12 triangles that faces outwards.
pub fn box_triangles(low: DVec3, high: DVec3) -> Triangles {
    // Corner i has bit 0 for x, bit 1 for y, bit 2 for z.
    let corner = |i: u32| DVec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|t| t.map(corner)).collect()
}

/// A sphere by latitude and longitude that faces outwards.
pub fn sphere(center: DVec3, radius: f64, rings: usize) -> Triangles {
    let around = 2 * rings;
    let at = |i: usize, j: usize| {
        if i == 0 || i == rings {
            return center + DVec3::new(0.0, 0.0, if i == 0 { radius } else { -radius });
        }
        let (st, ct) = (std::f64::consts::PI * i as f64 / rings as f64).sin_cos();
        let (sp, cp) = (std::f64::consts::TAU * (j % around) as f64 / around as f64).sin_cos();
        center + radius * DVec3::new(st * cp, st * sp, ct)
    };
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..around {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if i + 1 < rings {
                triangles.push([a, b, c]);
            }
            if i > 0 {
                triangles.push([a, c, d]);
            }
        }
    }
    triangles
}

/// The same surface seen from the other side.
pub fn reversed(triangles: &[[DVec3; 3]]) -> Triangles {
    triangles.iter().map(|&[a, b, c]| [a, c, b]).collect()
}

/// Positions without repeats, in the order of first use, and the triangles between them.
pub fn indexed(triangles: &[[DVec3; 3]]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut positions, mut known) = (Vec::new(), HashMap::new());
    let mut index = |p: DVec3| {
        // −0 and 0 are one place.
        *known.entry((p + DVec3::ZERO).to_array().map(f64::to_bits)).or_insert_with(|| {
            positions.push(p);
            positions.len() as u32 - 1
        })
    };
    let triangles = triangles.iter().map(|t| t.map(&mut index)).collect();
    (positions, triangles)
}
