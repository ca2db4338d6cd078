//! The same objects once more, as volume fractions: the leaves of the descent that hold shares where [`super::fill`]
//! draws lots.
//!
//! A voxel's depth, triangle and texture coordinates are those that its printed resin comes from. Where its layer is a
//! mixture, it has of each resin the share that the mixture has there; where boundaries are dithered, of each layer
//! the share of thresholds that would put it there. Masks are not looked at, and over many voxels the two agree.
//!
//! A printed voxel's resin is one with a fraction above 0, for depths and texture coordinates are those that
//! [`super::fill`] has and no share that a mask may draw is lost ([`Weights::round`]). **But for** dithered boundaries:
//! voxels there are laid by a depth moved in single precision, and one whose depth lies at the end of the ramp, to that
//! rounding, may be laid in the layer that has no share of it.

use glam::{DVec3, Vec2};

use super::{
    depth::{Measure, MeasureScratch, SlabField},
    descent::{Bricks, EMPTY, FULL, Leaves, Mask, is_set},
    fill::{FillScratch, LeafScratch, ObjectField, Site},
};
use crate::{
    appearance::Filling,
    sdf::nearest_in_brick,
    voxel::{BRICK_VOXELS, BrickFractions, Composition, Weights},
};

/// An object's fractions in one block.
struct FractionLeaves<'a> {
    field: &'a ObjectField,
    site: Site<'a>,
    bricks: &'a mut [BrickFractions],
    scratch: &'a mut LeafScratch,
    weights: Weights,
    parts: Composition,
}

impl ObjectField {
    /// Writes this object's fractions into the bricks of the block whose first voxel is `first`, as
    /// [`Self::fill_block`] does its voxels.
    pub fn fill_fractions(
        &self,
        first: [u32; 3],
        slab: &SlabField,
        bricks: &mut [BrickFractions],
        scratch: &mut FillScratch,
    ) {
        let FillScratch { descent, leaf } = scratch;
        let (weights, parts) = (Weights::default(), Vec::new());
        let site = Site { first, slab };
        let mut leaves = FractionLeaves { field: self, site, bricks, scratch: leaf, weights, parts };
        self.descent(first).lay(&slab.runs, &mut leaves, descent);
    }
}

impl Leaves for FractionLeaves<'_> {
    fn measuring(&mut self) -> (&ObjectField, &mut MeasureScratch) {
        (self.field, &mut self.scratch.measure)
    }

    fn fill_uniform(&mut self, bricks: Bricks, filling: Filling, masks: &[Mask]) {
        self.weights.clear();
        self.field.layers().weigh_filling(filling, &mut self.weights);
        self.weights.round(&mut self.parts);
        for index in bricks.indices(self.field.shape) {
            let (mask, brick) = (&masks[index], &mut self.bricks[index]);
            if *mask == EMPTY {
                continue;
            }
            if *mask == FULL && *brick == BrickFractions::Empty {
                *brick = BrickFractions::Uniform(self.parts.clone());
                continue;
            }
            for voxel in (0..BRICK_VOXELS).filter(|&voxel| is_set(mask, voxel)) {
                if brick.is_free(voxel) {
                    brick.set(voxel, &self.parts);
                }
            }
        }
    }

    fn fill_brick(&mut self, at: [usize; 3], centre: DVec3, candidates: &[u32], masks: &[Mask]) {
        let (field, site) = (self.field, self.site);
        let by_grid = matches!(field.measure, Measure::Grid { .. });
        if !by_grid {
            let surface = &mut self.scratch.surface;
            nearest_in_brick(field.around().triangles(), candidates, centre, &field.offsets, surface);
        }
        field.measure_brick(site, at, centre, masks, self.scratch);
        let index = field.shape.brick_index(at);
        let LeafScratch { surface, measure, faces: texels, .. } = &mut *self.scratch;
        let faces = if by_grid { &measure.triangles } else { candidates };
        texels.clear();
        texels.resize(faces.len(), None);
        for voxel in (0..BRICK_VOXELS).filter(|&voxel| is_set(&masks[index], voxel)) {
            let candidate = surface.candidate[voxel] as usize;
            let (face, depth) = (faces[candidate], surface.distance[voxel]);
            let Some(triangle) = field.own(face) else { continue };
            if !self.bricks[index].is_free(voxel) {
                continue;
            }
            let position = || field.lattice.centre(site.voxel(at, voxel));
            let uv = match by_grid {
                true => measure.uvs[voxel],
                false if field.layers().needs_uv() => {
                    field.uv_in_brick(face, &mut texels[candidate], centre, voxel, position)
                }
                false => Vec2::ZERO,
            };
            let above = |bottom: f64| match &field.dither {
                Some(dither) => dither.above(face, depth, bottom),
                None if field.layers().needs_uv() => f64::from(u8::from(f64::from(depth) < bottom)),
                None => {
                    // As voxels are laid: single precision is not enough where a centre lies on a boundary.
                    let error = f64::from(surface.error);
                    let is_sure = depth < (bottom - error) as f32 || depth > (bottom + error) as f32;
                    let depth = f64::from(depth);
                    let depth = if is_sure { depth } else { field.exact_depth(position(), faces, depth as f32) };
                    f64::from(u8::from(depth < bottom))
                }
            };
            self.weights.clear();
            field.layers().weigh(triangle, uv, above, &mut self.weights);
            self.weights.round(&mut self.parts);
            self.bricks[index].set(voxel, &self.parts);
        }
        self.bricks[index].settle();
    }
}
