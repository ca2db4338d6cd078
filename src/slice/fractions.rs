//! The same objects once more, as volume fractions: the leaves of the descent that hold shares where [`super::fill`]
//! draws lots.
//!
//! A voxel's depth, triangle and texture coordinates are those that its printed resin comes from. Where its layer is a
//! mixture, it has of each resin the share that the mixture has there; where boundaries are dithered, of each layer
//! the share of thresholds that would put it there. Masks are not looked at, so a printed voxel's resin is one with a
//! fraction above 0, and over many voxels the two agree.

use glam::{DVec3, Vec2};

use super::{
    depth::{Measure, SlabField},
    descent::{Bricks, EMPTY, FULL, Leaves, Mask, is_set},
    fill::{FillScratch, LeafScratch, ObjectField, Site},
};
use crate::{
    appearance::Filling,
    sdf::{BlockBox, DepthRange, closest_point, nearest_in_brick},
    voxel::{BRICK, BRICK_VOXELS, BrickFractions, Composition, Weights},
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

impl FractionLeaves<'_> {
    /// Measures the voxels of the brick at `at`, around `centre`.
    fn measure(&mut self, at: [usize; 3], centre: DVec3, candidates: &[u32], masks: &[Mask]) {
        let field = self.field;
        match field.measure {
            Measure::Grid { .. } => return field.measure_grid(self.site, at, masks, self.scratch),
            Measure::Exact | Measure::Lp { .. } => {}
        }
        let triangles = field.around().triangles();
        nearest_in_brick(triangles, candidates, centre, &field.offsets, &mut self.scratch.surface);
        if let Measure::Lp { .. } = field.measure {
            field.measure_lp(centre, &masks[field.shape.brick_index(at)], self.scratch);
        }
    }
}

impl Leaves for FractionLeaves<'_> {
    fn enter(&mut self, bounds: &BlockBox, nearest: f64) -> bool {
        self.field.enter_block(bounds, nearest, &mut self.scratch.measure)
    }

    fn certain(
        &mut self,
        _: Bricks,
        bounds: &BlockBox,
        range: DepthRange,
        candidates: &[u32],
        _: &[Mask],
    ) -> Option<Filling> {
        self.field.certain(bounds, range, candidates, &mut self.scratch.measure)
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
        self.measure(at, centre, candidates, masks);
        let field = self.field;
        let by_grid = matches!(field.measure, Measure::Grid { .. });
        let in_steps = matches!(field.measure, Measure::Exact) && field.dither.is_none();
        let triangles = field.around().triangles();
        let index = field.shape.brick_index(at);
        let (surface, measure) = (&self.scratch.surface, &self.scratch.measure);
        for voxel in (0..BRICK_VOXELS).filter(|&voxel| is_set(&masks[index], voxel)) {
            let candidate = surface.candidate[voxel] as usize;
            let face = if by_grid { measure.triangles[candidate] } else { candidates[candidate] };
            let Some(triangle) = field.own(face) else { continue };
            if !self.bricks[index].is_free(voxel) {
                continue;
            }
            let centre = || {
                let within = |axis: usize| (at[axis] * BRICK + (voxel >> (3 * axis) & 7)) as u32;
                field.lattice.centre(std::array::from_fn(|axis| self.site.first[axis] + within(axis)))
            };
            let uv = match by_grid {
                true => measure.uvs[voxel],
                false if field.layers().needs_uv() => field.uv(triangle, centre()),
                false => Vec2::ZERO,
            };
            let depth = if in_steps && !field.layers().needs_uv() {
                // Single precision is not enough where a voxel's centre lies on a boundary.
                closest_point(centre(), &triangles[face as usize]).distance_squared.sqrt()
            } else {
                f64::from(surface.distance[voxel])
            };
            let above = |bottom: f64| match &field.dither {
                Some(dither) => dither.above(face, depth as f32, bottom),
                None => f64::from(u8::from(depth < bottom)),
            };
            self.weights.clear();
            field.layers().weigh(triangle, uv, above, &mut self.weights);
            self.weights.round(&mut self.parts);
            self.bricks[index].set(voxel, &self.parts);
        }
        self.bricks[index].settle();
    }
}
