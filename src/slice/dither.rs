//! Boundaries between layers that are no staircase of whole voxels.
//!
//! A voxel is asked for the layer at a depth that is moved by up to half a voxel up or down, by a mask of thresholds:
//!
//! ```text
//!   depth + m w,   m in (−½, ½),   w = |nx| px + |ny| py + |nz| pz
//! ```
//!
//! w is the extent of a voxel of pitch p along the surface's normal n. So the share of voxels that lie above a boundary
//! falls from 1 to 0 over w as a ramp, and whatever the boundary's place between the voxels, the shares of all planes
//! of voxels sum up to its depth: a lattice repeats along a normal, if at all, every w over a whole number, over which
//! a ramp of width w averages to nothing. That is exact for planes at any angle, those along the axes included, as far
//! as the mask shares out planes evenly.
//!
//! Nearer to the surface than w/2 there is no room for the ramp. There it has the width that there is, twice the
//! boundary's depth: still right on average, and a layer of no thickness stays away.

use std::sync::Arc;

use glam::DVec3;

use crate::{
    sdf::{BrickSurface, DepthRange, Surface},
    voxel::{BRICK_VOXELS, ThresholdMask},
};

/// Dithered boundaries of one object on one lattice.
#[derive(Debug, Clone)]
pub(super) struct Dither {
    mask: Arc<ThresholdMask>,
    /// Extent of a voxel along each triangle's normal, mm.
    widths: Arc<[f32]>,
    /// The greatest of them.
    widest: f64,
}

impl Dither {
    pub fn new(mask: Arc<ThresholdMask>, surface: &Surface, pitch: DVec3) -> Self {
        let width = |&[a, b, c]: &[DVec3; 3]| (b - a).cross(c - a).normalize_or_zero().abs().dot(pitch) as f32;
        let widths: Arc<[f32]> = surface.triangles().iter().map(width).collect();
        let widest = f64::from(widths.iter().copied().fold(0.0, f32::max));
        Self { mask, widths, widest }
    }

    /// The same by the same mask on a lattice of another pitch.
    pub fn resampled(&self, surface: &Surface, pitch: DVec3) -> Self {
        Self::new(Arc::clone(&self.mask), surface, pitch)
    }

    /// The furthest that a depth is moved, mm.
    pub fn reach(&self) -> f64 {
        self.widest / 2.0
    }

    /// What depths in `range` below `candidates` can be moved to.
    pub fn moved(&self, range: DepthRange, candidates: &[u32]) -> DepthRange {
        let widths = candidates.iter().map(|&triangle| self.widths[triangle as usize]);
        let width = f64::from(widths.fold(0.0, f32::max));
        let min = range.min.max(0.0);
        let min = if min >= width { min - width / 2.0 } else { min / 2.0 };
        // Single precision rounds what is moved.
        let rounding = 4.0 * f64::from(f32::EPSILON) * range.max;
        DepthRange { min: (min - rounding).max(0.0), max: range.max + width / 2.0 + rounding }
    }

    /// Moves the depths of the brick at `at`, counted in bricks.
    pub fn apply(&self, at: [u32; 3], candidates: &[u32], surface: &mut BrickSurface, widths: &mut Vec<f32>) {
        widths.clear();
        widths.extend(candidates.iter().map(|&triangle| self.widths[triangle as usize]));
        let mut width = [0.0; BRICK_VOXELS];
        for (to, &candidate) in width.iter_mut().zip(&surface.candidate) {
            // Voxels that were not asked for have any candidate.
            *to = widths.get(candidate as usize).copied().unwrap_or_default();
        }
        move_depths(self.mask.second(at), &width, &mut surface.distance);
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn move_depths(ranks: &[u16; BRICK_VOXELS], widths: &[f32; BRICK_VOXELS], depths: &mut [f32; BRICK_VOXELS]) {
    for ((depth, rank), width) in depths.iter_mut().zip(ranks).zip(widths) {
        *depth = moved(*depth, *rank, *width);
    }
}

/// A depth moved by a mask's rank.
#[inline(always)]
fn moved(depth: f32, rank: u16, width: f32) -> f32 {
    let m = (f32::from(rank) + 0.5) / ThresholdMask::LEVELS as f32 - 0.5;
    let full = depth + m * width;
    // Both are the same where full is half the width: there the ramp has just its room.
    let narrow = depth / (1.0 - 2.0 * m);
    if full >= width / 2.0 { full } else { narrow }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of ranks above a boundary, summed over planes of voxels `step` apart, is the boundary's depth.
    #[test]
    fn ramps_sum_up_to_the_depth() {
        let share = |depth: f32, bottom: f32, width: f32| {
            let ranks = (0..ThresholdMask::LEVELS as u16).filter(|&rank| moved(depth, rank, width) < bottom);
            ranks.count() as f32 / ThresholdMask::LEVELS as f32
        };
        for (step, planes) in [(0.1_f32, 1_u16), (0.05, 2), (0.04, 3)] {
            let width = step * f32::from(planes);
            for bottom in [0.5 * width, 0.777 * width, 0.3, 0.4567] {
                for phase in [0.01, 0.3, 0.5, 0.99] {
                    // Planes outside of the object are none; those nearer than the ramp count in full.
                    let sum: f32 = (0..60).map(|n| step * share((n as f32 + phase) * step, bottom, width)).sum();
                    // What is printed begins half a plane above the first.
                    let error = sum + (phase - 0.5) * step - bottom;
                    assert!(error.abs() < 1e-4 || bottom < width, "{step} {planes} {bottom} {phase}: {error}");
                }
                // On average over all phases also where the ramp has little room.
                let mean = |bottom: f32| {
                    let phases = (0..64).map(|phase| (phase as f32 + 0.5) / 64.0);
                    let sums = phases.map(|phase| {
                        // A plane of which nothing lies above ends the sum; the sums above go through all.
                        let planes = (0..60).map(|n| share((n as f32 + phase) * step, bottom, width));
                        step * planes.take_while(|share| *share > 0.0).sum::<f32>()
                    });
                    sums.sum::<f32>() / 64.0
                };
                for bottom in [0.0, 0.1 * width, 0.3 * width, bottom] {
                    assert!((mean(bottom) - bottom).abs() < 0.01 * step, "{step} {planes} {bottom}: {}", mean(bottom));
                }
            }
        }
    }

    #[test]
    fn depths_move_within_their_range() {
        let mask = ThresholdMask::shared(DVec3::splat(0.1));
        let dither = Dither { mask, widths: Arc::new([0.1, 0.05]), widest: f64::from(0.1_f32) };
        for depth in [0.0, 0.001, 0.02, 0.05, 0.0999, 0.1, 0.3, 4.0_f32] {
            for (candidates, width) in [(&[0_u32][..], 0.1), (&[1], 0.05)] {
                let exact = f64::from(depth);
                let range = dither.moved(DepthRange { min: exact, max: exact }, candidates);
                for rank in 0..ThresholdMask::LEVELS as u16 {
                    let found = f64::from(moved(depth, rank, width));
                    assert!(range.min <= found && found <= range.max, "{depth} {rank}: {found} {range:?}");
                }
            }
        }
    }
}
