//! Foot points on the face of a triangle, in single precision within one brick.
//!
//! Where a position projects into a triangle, the nearest point's weights are affine in the position, so that two dot
//! products replace [`closest_point`](super::closest_point). Where it does not for certain, or where rounding could
//! tell in the weights, there is no answer.

use glam::{DVec3, Vec3};

/// A triangle's weights as affine functions of the offset from a brick's centre.
#[derive(Debug, Clone, Copy)]
pub struct Face {
    /// Weights of the second and third corner at the centre.
    at_centre: [f32; 2],
    /// What they rise by per mm; not a number where [`Face::weights`] has no answers.
    gradient: [Vec3; 2],
}

impl Face {
    /// Weights nearer to the triangle's border than this have no answer. Rounding is below (1 + [`Self::STEEPEST`]) ·
    /// 2⁻²².
    const MARGIN: f32 = 1e-5;
    /// Most that a weight may change from the brick's centre to its corner.
    const STEEPEST: f64 = 16.0;

    /// The face of `triangle` as seen from a brick of half diagonal `radius` mm around `centre`.
    pub fn new(&[a, b, c]: &[DVec3; 3], centre: DVec3, radius: f64) -> Self {
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(ac);
        let scale = 1.0 / normal.length_squared();
        let gradient = [ac.cross(normal) * scale, normal.cross(ab) * scale];
        let steep = gradient.iter().any(|g| !(g.length() * radius <= Self::STEEPEST));
        Self {
            at_centre: gradient.map(|g| g.dot(centre - a) as f32),
            gradient: gradient.map(|g| if steep { Vec3::NAN } else { g.as_vec3() }),
        }
    }

    /// Weights of the second and third corner at the point nearest to `offset` from the brick's centre, if it lies on
    /// the face for certain.
    #[inline(always)]
    pub fn weights(&self, offset: Vec3) -> Option<[f32; 2]> {
        let [v, w]: [f32; 2] = std::array::from_fn(|i| self.at_centre[i] + self.gradient[i].dot(offset));
        (v > Self::MARGIN && w > Self::MARGIN && v + w < 1.0 - Self::MARGIN).then_some([v, w])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sdf::closest_point;
    use proptest::prelude::*;

    fn vector(size: f64) -> impl Strategy<Value = DVec3> {
        [-size..size, -size..size, -size..size].prop_map(DVec3::from)
    }

    proptest! {
        #[test]
        fn an_answer_is_the_closest_point(
            triangle in [vector(3.0), vector(3.0), vector(3.0)],
            centre in vector(3.0),
            offset in vector(0.5),
        ) {
            let radius = 0.5 * 3.0_f64.sqrt();
            let face = Face::new(&triangle, centre, radius);
            let exact = closest_point(centre + offset, &triangle).barycentric;
            match face.weights(offset.as_vec3()) {
                Some(weights) => {
                    for (found, exact) in weights.iter().zip(&exact[1..]) {
                        prop_assert!((f64::from(*found) - exact).abs() < 1e-5, "{found} instead of {exact}");
                    }
                }
                // Well inside there is an answer, unless the triangle is steep.
                None => {
                    let [a, b, c] = triangle;
                    let height = (b - a).cross(c - a).length() / (b - a).length().max((c - a).length());
                    prop_assert!(height < radius / 15.9 || exact.iter().any(|w| *w < 3e-5));
                }
            }
        }
    }
}
