//! Volume fractions beside voxels: in the same leaves of the descent, shares where [`super::fill`] draws lots.
//!
//! A voxel's depth, triangle and texture coordinates are those that its printed resin comes from. Where its layer is a
//! mixture, it has of each resin the share that the mixture has there; where boundaries are dithered, of each layer
//! the share of thresholds that would put it there. Masks are not looked at, and over many voxels the two agree.
//!
//! A printed voxel's resin is one with a fraction above 0, for no share that a mask may draw is lost
//! ([`Weights::round`]). **But for** dithered boundaries: voxels there are laid by a depth moved in single precision,
//! and one whose depth lies at the end of the ramp, to that rounding, may be laid in the layer that has no share of it.

use glam::Vec2;

use super::{
    descent::{EMPTY, FULL, Mask, is_set},
    field::ObjectField,
};
use crate::{
    appearance::Filling,
    sdf::BrickSurface,
    voxel::{BRICK_VOXELS, BrickFractions, Composition, Weights},
};

/// An object's fractions in one block.
pub(super) struct FractionBlock<'a> {
    bricks: &'a mut [BrickFractions],
    weights: Weights,
    parts: Composition,
}

/// Voxels of a brick whose depths are known.
pub(super) struct Measured<'a> {
    pub surface: &'a BrickSurface,
    /// What the surface's candidates are, by the numbers of all faces around the object.
    pub faces: &'a [u32],
    pub mask: &'a Mask,
}

impl<'a> FractionBlock<'a> {
    pub fn new(bricks: &'a mut [BrickFractions]) -> Self {
        Self { bricks, weights: Weights::default(), parts: Vec::new() }
    }

    /// Gives the masked voxels of bricks, as far as they are free, one filling, which is weighed once for all of them.
    pub fn fill<'m>(&mut self, field: &ObjectField, bricks: impl Iterator<Item = (usize, &'m Mask)>, filling: Filling) {
        self.weights.clear();
        field.layers().weigh_filling(filling, &mut self.weights);
        self.weights.round(&mut self.parts);
        for (brick, mask) in bricks.filter(|(_, mask)| **mask != EMPTY) {
            let fractions = &mut self.bricks[brick];
            if *mask == FULL && *fractions == BrickFractions::Empty {
                *fractions = BrickFractions::Uniform(self.parts.clone());
                continue;
            }
            let is_first = *fractions == BrickFractions::Empty;
            for voxel in (0..BRICK_VOXELS).filter(|&voxel| is_set(mask, voxel)) {
                if fractions.is_free(voxel) {
                    fractions.set(voxel, &self.parts);
                }
            }
            // What is filled for the first time and not whole has voxels without anything.
            if !is_first {
                fractions.settle();
            }
        }
    }

    /// Gives the measured voxels of a brick, as far as they are free, their shares; `exact` tells a depth that lies
    /// on a boundary, `uv` the texture coordinates under a candidate.
    pub fn weigh(
        &mut self,
        field: &ObjectField,
        brick: usize,
        measured: &Measured<'_>,
        exact: impl Fn(usize) -> f64,
        mut uv: impl FnMut(u32, usize) -> Vec2,
    ) {
        let Measured { surface, faces, mask } = *measured;
        let needs_uv = field.layers().needs_uv();
        for voxel in (0..BRICK_VOXELS).filter(|&voxel| is_set(mask, voxel)) {
            let (candidate, depth) = (surface.candidate[voxel], surface.distance[voxel]);
            let face = faces[candidate as usize];
            let Some(triangle) = field.own(face).filter(|_| self.bricks[brick].is_free(voxel)) else { continue };
            let above = |bottom: f64| match &field.dither {
                Some(dither) => dither.above(face, depth, bottom),
                None if needs_uv => f64::from(u8::from(f64::from(depth) < bottom)),
                None => {
                    // As voxels are laid: single precision is not enough where a centre lies on a boundary.
                    let error = f64::from(surface.error);
                    let is_sure = depth < (bottom - error) as f32 || depth > (bottom + error) as f32;
                    f64::from(u8::from(if is_sure { f64::from(depth) } else { exact(voxel) } < bottom))
                }
            };
            self.weights.clear();
            let uv = if needs_uv { uv(candidate, voxel) } else { Vec2::ZERO };
            field.layers().weigh(triangle, uv, above, &mut self.weights);
            self.weights.round(&mut self.parts);
            self.bricks[brick].set(voxel, &self.parts);
        }
        self.bricks[brick].settle();
    }
}
