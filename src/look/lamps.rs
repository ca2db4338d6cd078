//! The lamps of a picture: a sky, and three that send parallel light.

use glam::DVec3;

use super::Camera;

/// Number of lamps: the sky and the parallel ones.
pub const LAMPS: usize = 4;

/// Parallel light of irradiance 1, perpendicular to it, on a part of space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    /// Unit vector to the lamp.
    pub toward: DVec3,
    /// What of space is lit.
    pub lit: Lit,
}

/// A part of space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lit {
    /// All of it.
    Everything,
    /// One side of a plane through a point, mm: that where the normal points to.
    Side {
        /// On the plane.
        point: DVec3,
        /// Unit vector, perpendicular to the beam.
        normal: DVec3,
    },
    /// A round beam.
    Round {
        /// On its axis, mm.
        point: DVec3,
        /// Its radius, mm.
        radius: f64,
    },
}

impl Beam {
    /// Whether a position (mm) lies in the beam, if nothing is in the way.
    #[inline]
    pub fn lights(&self, position: DVec3) -> bool {
        match self.lit {
            Lit::Everything => true,
            Lit::Side { point, normal } => (position - point).dot(normal) > 0.0,
            Lit::Round { point, radius } => {
                let away = position - point;
                let along = away.dot(self.toward);
                away.length_squared() - along * along < radius * radius
            }
        }
    }
}

/// All lamps of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lamps {
    /// A shadow edge, light from behind, a spot.
    pub beams: [Beam; LAMPS - 1],
}

/// Radius of the spot, part of the picture's height.
const SPOT: f64 = 0.055;

impl Lamps {
    /// Lamps around a camera; `aim` is what the shadow edge passes through and the spot falls onto, mm.
    pub fn around(camera: &Camera, aim: DVec3) -> Self {
        let [right, up, toward] = camera.axes;
        let from = |r: f64, u: f64, t: f64| (right * r + up * u + toward * t).normalize();
        let (edge, behind, spot) = (from(-0.45, 0.6, 0.8), from(0.55, 0.75, -0.85), from(0.1, 0.25, 1.0));
        let left = (-right - edge * (-right).dot(edge)).normalize();
        let radius = SPOT * camera.size[1] as f64 * camera.pixel_mm;
        Self {
            beams: [
                Beam { toward: edge, lit: Lit::Side { point: aim, normal: left } },
                Beam { toward: behind, lit: Lit::Everything },
                Beam { toward: spot, lit: Lit::Round { point: aim, radius } },
            ],
        }
    }

    /// Radiance of the sky from a direction above the ground: brighter above, and an irradiance of 1 on the ground.
    #[inline]
    pub fn sky(toward: DVec3) -> f64 {
        // ∫ (0.4 + 0.6 z) z dω = π (0.4 + 0.4)
        (0.4 + 0.6 * toward.z.max(0.0)) / (0.8 * std::f64::consts::PI)
    }
}

/// The ground that the print stands on: level, matt, grey.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    /// Its height, mm.
    pub z: f64,
    /// Its albedo.
    pub albedo: f64,
}
