//! Soft light from a pyramid of ever coarser coverage.
//!
//! Darkening and shadow are cone-traced: coverage is looked up at growing distances in levels whose cells are as large
//! as the cone is wide there. It is not a light simulation: nothing here predicts how the print will look.

use glam::DVec3;

use super::{march::Scene, sampling::trilinear};

/// Levels of the pyramid above the cells themselves.
const LEVELS: usize = 6;
/// What each level weighs in the darkening of a point: near folds a little more than far walls.
const DARKENING: [f32; LEVELS] = [0.30, 0.28, 0.26, 0.22, 0.18, 0.12];

/// Tangent of the half angle that the lamp spans: a large one, hence soft shadows.
const LAMP_SPREAD: f64 = 0.22;
/// How far a shadow reaches, volume cells.
const SHADOW: f64 = 128.0;
/// Part of the light that full coverage along one step takes away.
const BLOCKED: f32 = 0.8;

/// Coverage at cells of 2, 4, 8 … of the volume's, the quarter taken out.
#[derive(Debug)]
pub(super) struct Pyramid {
    levels: Vec<Level>,
    /// Mean edge of a volume cell, mm.
    cell: f64,
    edge: DVec3,
    /// Distances along a ray to the lamp, mm, with the level to look up there.
    cone: Vec<(f64, usize)>,
}

#[derive(Debug)]
struct Level {
    n: [usize; 3],
    coverage: Vec<u8>,
}

impl Level {
    /// Half as many cells per axis, each the mean of eight; what lies beyond the end is empty.
    fn halved(n: [usize; 3], coverage: impl Fn([usize; 3]) -> u32) -> Self {
        let half = n.map(|n| n.div_ceil(2));
        let mut out = Vec::with_capacity(half.iter().product());
        for z in 0..half[2] {
            for y in 0..half[1] {
                for x in 0..half[0] {
                    let mut sum = 0;
                    for corner in 0..8 {
                        let at = [2 * x + (corner & 1), 2 * y + (corner >> 1 & 1), 2 * z + (corner >> 2)];
                        if at[0] < n[0] && at[1] < n[1] && at[2] < n[2] {
                            sum += coverage(at);
                        }
                    }
                    out.push((sum / 8) as u8);
                }
            }
        }
        Self { n: half, coverage: out }
    }
}

impl Pyramid {
    /// The pyramid of a scene.
    pub fn new(scene: &Scene<'_>) -> Self {
        let volume = scene.volume;
        let edge = DVec3::from(volume.edge);
        // First cell right of the x face, and one past the last in front of the y face.
        let limit = [0, 1].map(|axis| (scene.focus[axis] / edge[axis]).round() as usize);
        let mut levels = vec![Level::halved(volume.n, |at| {
            let taken = at[0] >= limit[0] && at[1] < limit[1];
            if taken { 0 } else { u32::from(volume.coverage(volume.index(at))) }
        })];
        while levels.len() < LEVELS {
            let Some(last) = levels.last() else { break };
            let next = Level::halved(last.n, |[x, y, z]| u32::from(last.coverage[x + last.n[0] * (y + last.n[1] * z)]));
            levels.push(next);
        }
        let cell = edge.element_sum() / 3.0;
        let mut cone = Vec::new();
        let mut distance = 2.0;
        while distance < SHADOW {
            // The level whose cells are about as wide as the cone.
            let level =
                (1..LEVELS).rev().find(|&level| f64::from(2_u32 << level) <= LAMP_SPREAD * distance).unwrap_or(0);
            cone.push((distance * cell, level));
            distance += f64::from(2_u32 << level);
        }
        Self { levels, cell, edge, cone }
    }

    /// Coverage of level `level` (0: two cells) at a position, 0 to 1.
    fn at(&self, level: usize, place: DVec3) -> f32 {
        let Some(found) = self.levels.get(level) else { return 0.0 };
        let position = place / (self.edge * f64::from(2_u32 << level));
        trilinear(found.n, position.as_vec3(), |cell| f32::from(found.coverage[cell])) / 255.0
    }

    /// How open the half-space above a point is, 0 to 1.
    pub fn openness(&self, place: DVec3, normal: DVec3) -> f32 {
        let dark: f32 = (0..LEVELS)
            .map(|level| {
                // At one and a half cells of the level a plane's own coverage is out of reach.
                let distance = 1.5 * f64::from(2_u32 << level) * self.cell;
                DARKENING[level] * self.at(level, place + normal * distance)
            })
            .sum();
        (1.0 - dark).max(0.0)
    }

    /// Which part of a broad light in direction `light` reaches a point, 0 to 1.
    pub fn lit(&self, place: DVec3, normal: DVec3, light: DVec3) -> f32 {
        let origin = place + normal * (2.0 * self.cell);
        let mut through = 1.0_f32;
        for &(distance, level) in &self.cone {
            through *= 1.0 - BLOCKED * self.at(level, origin + light * distance);
            if through < 0.02 {
                return 0.0;
            }
        }
        through
    }
}
