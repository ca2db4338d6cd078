//! One object into one block of voxels: the leaves of the descent that are voxels, and their fractions where those are
//! asked for.

use std::iter;

use glam::DVec3;

use super::{
    depth::{Measure, MeasureScratch, SlabField},
    descent::{Bricks, Descent, DescentScratch, EMPTY, FULL, Leaves, Mask, is_set},
    field::ObjectField,
    fractions::{FractionBlock, Measured},
    joined::Whose,
};
use crate::{
    appearance::{BrickQuery, Filling},
    sdf::{BrickSurface, Face, Part, nearest_in_parts},
    voxel::{BRICK, BRICK_VOXELS, Block, BrickFractions, MaterialId, Tile},
};

/// Buffers of one worker.
#[derive(Default)]
pub struct FillScratch {
    descent: DescentScratch,
    leaf: LeafScratch,
}

/// Buffers of one worker for its leaves.
#[derive(Default)]
pub(super) struct LeafScratch {
    pub(super) measure: MeasureScratch,
    pub(super) surface: BrickSurface,
    /// What can be nearest in one part of a brick.
    part: Vec<u32>,
    /// Parts of the brick that are certain to have one filling.
    certain: Vec<(Part, Filling)>,
    /// Of the brick's candidates, as far as asked for.
    faces: Vec<Option<Face>>,
}

/// Where a block is: its first voxel, and what is known of its slab.
#[derive(Clone, Copy)]
pub(super) struct Site<'a> {
    pub(super) first: [u32; 3],
    pub(super) slab: &'a SlabField,
}

impl Site<'_> {
    /// Where a brick of the block is in the lattice, counted in bricks.
    fn brick(&self, at: [usize; 3]) -> [u32; 3] {
        std::array::from_fn(|axis| self.first[axis] / BRICK as u32 + at[axis] as u32)
    }

    /// Where a voxel of that brick is in the lattice.
    pub(super) fn voxel(&self, at: [usize; 3], voxel: usize) -> [u32; 3] {
        std::array::from_fn(|axis| self.first[axis] + (at[axis] * BRICK + (voxel >> (3 * axis) & 7)) as u32)
    }
}

/// An object's voxels in one block.
struct VoxelLeaves<'a> {
    field: &'a ObjectField,
    site: Site<'a>,
    block: &'a mut Block,
    fractions: Option<FractionBlock<'a>>,
    scratch: &'a mut LeafScratch,
}

impl ObjectField {
    /// Takes the voxels of a brick that are nearest to a face of another object from its mask.
    fn leave_own(&self, candidates: &[u32], surface: &BrickSurface, mask: &mut Mask) {
        let Some(joined) = self.joined() else { return };
        for voxel in 0..BRICK_VOXELS {
            let face = is_set(mask, voxel).then(|| candidates[surface.candidate[voxel] as usize]);
            if face.is_some_and(|face| !joined.own.contains(&face)) {
                mask[voxel / 8] &= !(1 << (voxel % 8));
            }
        }
    }

    /// Writes this object's voxels into the block whose first voxel is `first`, and their fractions where there are
    /// bricks for them; `slab` has been prepared for this object. Voxels that another object has taken stay.
    pub fn fill_block(
        &self,
        first: [u32; 3],
        slab: &SlabField,
        block: &mut Block,
        fractions: Option<&mut [BrickFractions]>,
        scratch: &mut FillScratch,
    ) {
        let FillScratch { descent, leaf } = scratch;
        let (site, fractions) = (Site { first, slab }, fractions.map(FractionBlock::new));
        let mut leaves = VoxelLeaves { field: self, site, block, fractions, scratch: leaf };
        self.descent(first).lay(&slab.runs, &mut leaves, descent);
    }

    /// The way down the block whose first voxel is `first`.
    fn descent(&self, first: [u32; 3]) -> Descent<'_> {
        Descent {
            surface: self.around(),
            joined: self.joined(),
            lattice: &self.lattice,
            shape: self.shape,
            first,
            slack: self.measure.slack(),
            core: self.layers().core(),
        }
    }

    /// Finds the nearest triangle of the masked voxels. Parts that are certain to have one filling get their ids, leave
    /// the mask and are added to `scratch.certain`; if that is all of them and one filling, it is returned.
    fn nearest(
        &self,
        candidates: &[u32],
        centre: DVec3,
        mask: &mut Mask,
        ids: &mut [u8; BRICK_VOXELS],
        ranks: &[u16; BRICK_VOXELS],
        scratch: &mut LeafScratch,
    ) -> Option<Filling> {
        let inside = *mask;
        let (mut only, mut alike) = (None, true);
        nearest_in_parts(
            self.around().triangles(),
            candidates,
            centre,
            &self.offsets,
            &mut scratch.surface,
            |part| part.bytes().any(|byte| inside[byte] != 0),
            |part, kept, range| {
                scratch.part.clear();
                scratch.part.extend(kept.iter().map(|&position| candidates[position as usize]));
                let whose = self.whose(&scratch.part);
                if whose == Whose::Others {
                    alike = false;
                    part.bytes().for_each(|byte| mask[byte] = 0);
                    return true;
                }
                let exact = matches!(self.measure, Measure::Exact) && whose == Whose::Own;
                let range = self.dither.as_ref().map_or(range, |dither| dither.moved(range, &scratch.part));
                let filling = exact.then(|| self.uniform_over(&scratch.part, range)).flatten();
                alike &= filling.is_some() && (only.is_none() || only == filling);
                only = filling;
                let Some(filling) = filling else { return false };
                scratch.certain.push((part, filling));
                for byte in part.bytes() {
                    mask[byte] = 0;
                    let row = byte * 8..byte * 8 + 8;
                    match filling {
                        Filling::Pure(id) => ids[row].fill(id.0),
                        Filling::Mixed(blend) => {
                            let blend = self.layers().blend(blend);
                            ids[row.clone()].iter_mut().zip(&ranks[row]).for_each(|(id, rank)| *id = blend.at(*rank).0);
                        }
                    }
                }
                true
            },
        );
        only.filter(|_| alike)
    }
}

impl Leaves for VoxelLeaves<'_> {
    fn measuring(&mut self) -> (&ObjectField, &mut MeasureScratch) {
        (self.field, &mut self.scratch.measure)
    }

    fn fill_uniform(&mut self, bricks: Bricks, filling: Filling, masks: &[Mask]) {
        let mut ids = [0; BRICK_VOXELS];
        if let Some(fractions) = &mut self.fractions {
            let bricks = bricks.indices(self.field.shape).map(|brick| (brick, &masks[brick]));
            fractions.fill(self.field, bricks, filling);
        }
        for at in bricks.places() {
            let brick = self.field.shape.brick_index(at);
            let mask = &masks[brick];
            if *mask == EMPTY {
                continue;
            }
            let free = self.block.tile(brick) == Tile::Uniform(MaterialId::BACKGROUND) && *mask == FULL;
            match filling {
                Filling::Pure(id) if free => self.block.set_uniform(brick, id),
                Filling::Pure(id) => merge(self.block.dense_mut(brick), mask, |_| id.0),
                Filling::Mixed(blend) => {
                    let ranks = self.field.ranks(self.site.brick(at));
                    self.field.layers().blend(blend).lay(ranks, &mut ids);
                    if free {
                        *self.block.dense_mut(brick) = ids;
                    } else {
                        merge(self.block.dense_mut(brick), mask, |voxel| ids[voxel]);
                    }
                }
            }
        }
    }

    fn fill_brick(&mut self, at: [usize; 3], centre: DVec3, candidates: &[u32], masks: &[Mask]) {
        let field = self.field;
        let brick = field.shape.brick_index(at);
        let mut mask = masks[brick];
        let mut ids = [0; BRICK_VOXELS];
        let ranks = field.ranks(self.site.brick(at));
        self.scratch.certain.clear();
        if !matches!(field.measure, Measure::Grid { .. }) {
            let settled = field.nearest(candidates, centre, &mut mask, &mut ids, ranks, self.scratch);
            if let Some(filling) = settled {
                return self.fill_uniform(Bricks::one(at), filling, masks);
            }
        }
        let (site, scratch) = (self.site, &mut *self.scratch);
        field.measure_brick(site, at, centre, masks, scratch);
        let by_grid = matches!(field.measure, Measure::Grid { .. });
        let LeafScratch { measure, surface, certain, faces, .. } = scratch;
        let candidates = if by_grid { &measure.triangles } else { candidates };
        field.leave_own(candidates, surface, &mut mask);
        let position = |voxel: usize| field.lattice.centre(site.voxel(at, voxel));
        let exact = |voxel: usize, measured: f32| field.exact_depth(position(voxel), candidates, measured);
        faces.clear();
        faces.resize(candidates.len(), None);
        let mut uv = |candidate: u32, voxel: usize| {
            if by_grid {
                return measure.uvs[voxel];
            }
            let (triangle, face) = (candidates[candidate as usize], &mut faces[candidate as usize]);
            field.uv_in_brick(triangle, face, centre, voxel, || position(voxel))
        };
        // Before thresholds move depths: shares are of all thresholds.
        if let Some(fractions) = &mut self.fractions {
            for (part, filling) in certain {
                fractions.fill(field, iter::once((brick, &part_of(&masks[brick], *part))), *filling);
            }
            let measured = Measured { surface, faces: candidates, mask: &mask };
            fractions.weigh(field, brick, &measured, |voxel| exact(voxel, surface.distance[voxel]), &mut uv);
        }
        if let Some(dither) = &field.dither {
            dither.apply(site.brick(at), candidates, surface);
        }
        let own = field.as_own(candidates);
        let query = BrickQuery { surface, candidates: &own, mask: &mask, ranks };
        field.layers().fill_brick(query, |voxel| exact(voxel, surface.distance[voxel]), uv, &mut ids);
        merge(self.block.dense_mut(brick), &masks[brick], |voxel| ids[voxel]);
    }
}

/// The voxels of a mask that lie in a part.
fn part_of(mask: &Mask, part: Part) -> Mask {
    let mut within = EMPTY;
    part.bytes().for_each(|byte| within[byte] = mask[byte]);
    within
}

/// Writes the masked voxels that are still background.
fn merge(voxels: &mut [u8; BRICK_VOXELS], mask: &Mask, id: impl Fn(usize) -> u8) {
    for (voxel, value) in voxels.iter_mut().enumerate() {
        if is_set(mask, voxel) && *value == 0 {
            *value = id(voxel);
        }
    }
}
