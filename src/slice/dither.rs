//! Boundaries between layers that are no staircase of whole voxels, and that lie as deep below the print as they
//! should.
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
//!
//! # Where the print begins
//!
//! Voxels are whole, so the print does not end at the surface: along a face that runs with the lattice it ends up to
//! half a voxel before or behind it, the same everywhere, and on a gentle slope as far, in rings. Depths are counted
//! from where the print ends, else the first layer would be that much thicker or thinner. With the planes of voxels
//! that the surface runs along, g of them in a mm along its normal, voxels lie at depths (k + h) / g, where h tells how
//! the surface falls between the planes, and the print ends half a plane above the first:
//!
//! ```text
//!   depth + (sgn f / 2 − f) / g,   f = depth g − round(depth g)
//! ```
//!
//! That no position counts but the depth itself is because planes go through the centres of voxels. Where the surface
//! is inclined to the planes by t of them in a mm, they end in rings 1/t wide, and where the surface is half way
//! between two, the print has a step. Over the length of a voxel ρ to either side steps are averaged, so the sign gives
//! way to clamp(f / (t ρ), −1, 1); from t ρ = ½ on nothing is left. That is the sawtooth's mean over a box, exactly.

use std::sync::Arc;

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use crate::{
    sdf::{BrickSurface, DepthRange, Surface},
    voxel::{BRICK_VOXELS, ThresholdMask},
};

/// Dithered boundaries of one object on one lattice.
#[derive(Debug, Clone)]
pub(super) struct Dither {
    mask: Arc<ThresholdMask>,
    /// How voxels lie along each triangle's normal.
    grains: Arc<[Grain]>,
    /// The furthest that a depth is moved, mm.
    reach: f64,
}

/// How voxels lie along a normal.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Grain {
    /// Extent of a voxel, mm.
    width: f32,
    /// Planes of voxels that the surface runs along, in a mm; 0 where it runs along none.
    planes: f32,
    /// Half the width that a step between two of them is averaged over, as a share of their rings' width; 0 to ½.
    blur: f32,
}

/// Indices of planes that a surface may run along: those further up are too close together to count.
const HIGHEST_INDEX: i32 = 2;

impl Grain {
    /// Along a unit normal, for voxels of `pitch` mm.
    fn new(normal: DVec3, pitch: DVec3) -> Self {
        let width = normal.abs().dot(pitch) as f32;
        let none = Self { width, planes: 0.0, blur: 0.5 };
        let indices = || -HIGHEST_INDEX..=HIGHEST_INDEX;
        let all = indices().flat_map(|x| indices().flat_map(move |y| indices().map(move |z| IVec3::new(x, y, z))));
        let along = all.map(|index| Self::along(index.as_dvec3() / pitch, normal, pitch, width));
        // Multiples of a plane's indices come after it, and move depths less.
        along.flatten().fold(none, |best, next| if next.greatest() > best.greatest() { next } else { best })
    }

    /// Along planes of this reciprocal vector, 1/mm, if the surface runs along them.
    fn along(vector: DVec3, normal: DVec3, pitch: DVec3, width: f32) -> Option<Self> {
        let planes = vector.dot(normal);
        let blur = (vector - normal * planes).length() * pitch.max_element();
        (planes > 0.0 && blur < 0.5).then_some(Self { width, planes: planes as f32, blur: blur as f32 })
    }

    /// The furthest from the surface that the print ends, averaged, mm.
    fn greatest(&self) -> f32 {
        if self.planes > 0.0 { (0.5 - self.blur) / self.planes } else { 0.0 }
    }
}

impl Dither {
    pub fn new(mask: Arc<ThresholdMask>, surface: &Surface, pitch: DVec3) -> Self {
        let grain = |&[a, b, c]: &[DVec3; 3]| Grain::new((b - a).cross(c - a).normalize_or_zero(), pitch);
        Self::of(mask, surface.triangles().par_iter().map(grain).collect::<Vec<_>>().into())
    }

    fn of(mask: Arc<ThresholdMask>, grains: Arc<[Grain]>) -> Self {
        let reach = grains.iter().map(|grain| grain.width / 2.0 + grain.greatest()).fold(0.0, f32::max);
        Self { mask, grains, reach: f64::from(reach) }
    }

    /// The same by the same mask on a lattice of another pitch.
    pub fn resampled(&self, surface: &Surface, pitch: DVec3) -> Self {
        Self::new(Arc::clone(&self.mask), surface, pitch)
    }

    /// The furthest that a depth is moved, mm.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// What depths in `range` below `candidates` can be moved to.
    pub fn moved(&self, range: DepthRange, candidates: &[u32]) -> DepthRange {
        let grains = || candidates.iter().map(|&triangle| &self.grains[triangle as usize]);
        let width = f64::from(grains().map(|grain| grain.width).fold(0.0, f32::max));
        let end = f64::from(grains().map(Grain::greatest).fold(0.0, f32::max));
        let min = (range.min - end).max(0.0);
        let min = if min >= width { min - width / 2.0 } else { min / 2.0 };
        // Single precision rounds what is moved.
        let rounding = 4.0 * f64::from(f32::EPSILON) * range.max;
        DepthRange { min: (min - rounding).max(0.0), max: range.max + end + width / 2.0 + rounding }
    }

    /// What of a voxel at `depth` mm below `triangle` lies above a boundary at `bottom` mm, 0 to 1: the share of all
    /// thresholds that take it for above.
    pub fn above(&self, triangle: u32, depth: f32, bottom: f64) -> f64 {
        let grain = &self.grains[triangle as usize];
        share_above(f64::from(below_print(depth, grain)), bottom, f64::from(grain.width))
    }

    /// Moves the depths of the brick at `at`, counted in bricks.
    pub fn apply(&self, at: [u32; 3], candidates: &[u32], surface: &mut BrickSurface) {
        let mut grains = [Grain::default(); BRICK_VOXELS];
        for (to, &candidate) in grains.iter_mut().zip(&surface.candidate) {
            // Voxels that were not asked for have any candidate.
            let triangle = candidates.get(candidate as usize);
            *to = triangle.map_or_else(Grain::default, |&triangle| self.grains[triangle as usize]);
        }
        move_depths(self.mask.second(at), &grains, &mut surface.distance);
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn move_depths(ranks: &[u16; BRICK_VOXELS], grains: &[Grain; BRICK_VOXELS], depths: &mut [f32; BRICK_VOXELS]) {
    for ((depth, rank), grain) in depths.iter_mut().zip(ranks).zip(grains) {
        *depth = moved(below_print(*depth, grain), *rank, grain.width);
    }
}

/// How deep below the end of the print a depth below the surface is.
#[inline(always)]
fn below_print(depth: f32, grain: &Grain) -> f32 {
    let cycles = depth * grain.planes;
    let f = cycles - (cycles + 0.5).floor();
    let sign = (f / grain.blur.max(1e-6)).clamp(-1.0, 1.0);
    let end = (0.5 * sign - f) / grain.planes.max(1.0);
    // No print ends below a voxel's centre.
    (depth + end).max(0.0)
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

/// The share of thresholds by which [`moved`] takes a depth to above `bottom`, all in mm.
fn share_above(depth: f64, bottom: f64, width: f64) -> f64 {
    let below = if bottom >= width / 2.0 {
        (depth - bottom) / width + 0.5
    } else {
        depth / (2.0 * bottom.max(f64::MIN_POSITIVE))
    };
    // A layer of no thickness stays away from the surface too.
    if bottom > 0.0 { (1.0 - below).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEEP: Grain = Grain { width: 0.1, planes: 0.0, blur: 0.5 };

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
    fn fractions_are_the_shares_of_thresholds() {
        for width in [0.05, 0.1_f32] {
            for bottom in [0.0, 0.01, 0.049, 0.05, 0.051, 0.2_f32] {
                for depth in [0.0, 0.004, 0.01, 0.03, 0.05, 0.07, 0.1, 0.18, 0.2, 0.23, 0.4_f32] {
                    let ranks =
                        (0..ThresholdMask::LEVELS as u16).filter(|&rank| moved(depth, rank, width) < bottom).count();
                    let counted = ranks as f64 / ThresholdMask::LEVELS as f64;
                    let found = share_above(f64::from(depth), f64::from(bottom), f64::from(width));
                    assert!((found - counted).abs() < 1e-4, "{width} {bottom} {depth}: {found}, counted {counted}");
                }
            }
        }
    }

    /// Columns of voxels on a plane: what lies above a boundary in all of them is as thick as it should be, wherever
    /// the plane lies between the voxels, where it runs along them or is a little inclined.
    #[test]
    fn layers_are_as_thick_as_asked_wherever_the_surface_lies() {
        let pitch = DVec3::new(0.042, 0.085, 0.027);
        let boundary = 0.21;
        for (normal, columns) in [
            (DVec3::Y, 1),
            (-DVec3::Z, 1),
            (DVec3::new(0.0, 1.0, 0.004), 40),
            (DVec3::new(0.01, 1.0, 0.0), 40),
            (DVec3::new(0.003, -0.002, 1.0), 40),
        ] {
            let normal = normal.normalize();
            let grain = Grain::new(normal, pitch);
            let axis = (0..3).find(|&axis| normal[axis].abs() > 0.9).unwrap();
            let [across, along] = [(axis + 1) % 3, (axis + 2) % 3];
            for surface in [7.0, 7.011, 7.02, 7.0333, 7.05] {
                let mut mean = 0.0;
                for (i, j) in (0..columns).flat_map(|i| (0..columns).map(move |j| (i, j))) {
                    for k in -400..400 {
                        let mut index = DVec3::ZERO;
                        (index[axis], index[across], index[along]) = (f64::from(k), f64::from(i), f64::from(j));
                        let depth = surface - ((index + 0.5) * pitch).dot(normal);
                        if depth <= 0.0 || depth > 1.0 {
                            continue;
                        }
                        let depth = below_print(depth as f32, &grain);
                        let above = (boundary - f64::from(depth)) / f64::from(grain.width) + 0.5;
                        mean += above.clamp(0.0, 1.0) * pitch[axis] * normal[axis].abs();
                    }
                }
                mean /= f64::from(columns * columns);
                // A few columns see a few of a slope's rings.
                let least = if columns == 1 { 1e-4 } else { 0.03 * pitch.max_element() };
                assert!((mean - boundary).abs() < least, "{normal} {surface}: {mean}");
            }
        }
    }

    #[test]
    fn surfaces_that_run_along_no_planes_keep_their_depths() {
        let steep = Grain::new(DVec3::new(0.3, 0.7, 0.6).normalize(), DVec3::new(0.042, 0.085, 0.027));
        assert_eq!(steep.planes, 0.0);
        for depth in [0.0, 0.01, 0.123, 2.0] {
            assert_eq!(below_print(depth, &steep), depth);
        }
        let cubes = Grain::new(DVec3::ONE.normalize(), DVec3::splat(0.1));
        assert!((f64::from(cubes.planes) - 300_f64.sqrt()).abs() < 1e-5, "{cubes:?}");
    }

    #[test]
    fn depths_move_within_their_range() {
        let mask = ThresholdMask::shared(DVec3::splat(0.1));
        let even = Grain { width: 0.05, planes: 20.0, blur: 0.0 };
        let gentle = Grain { width: 0.05, planes: 20.0, blur: 0.2 };
        let dither = Dither::of(mask, Arc::new([STEEP, even, gentle]));
        for depth in [0.0, 0.001, 0.02, 0.05, 0.0999, 0.1, 0.3, 4.0_f32] {
            for triangle in 0..3_u32 {
                let exact = f64::from(depth);
                let range = dither.moved(DepthRange { min: exact, max: exact }, &[triangle]);
                for rank in 0..ThresholdMask::LEVELS as u16 {
                    let grain = &dither.grains[triangle as usize];
                    let found = f64::from(moved(below_print(depth, grain), rank, grain.width));
                    assert!(range.min <= found && found <= range.max, "{depth} {rank}: {found} {range:?}");
                    assert!((found - exact).abs() <= dither.reach() + 1e-6);
                }
            }
        }
    }
}
