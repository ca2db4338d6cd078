//! One object into one block: the descent by halves that voxels and nodes share.
//!
//! A block is halved along its longest edge until it is one brick. On the way down the list of triangles that can be
//! nearest shrinks ([`cull`]), and a box whose depths and triangles leave one answer is filled without visiting its
//! voxels. What is laid where the descent ends is the business of its [`Leaves`].

use std::ops::Range;

use glam::DVec3;

use super::{
    depth::MeasureScratch,
    field::ObjectField,
    joined::{Joined, Whose},
};
use crate::{
    appearance::Filling,
    sdf::{BlockBox, CullScratch, DepthRange, SliceRuns, Surface, cull},
    voxel::{BRICK, BRICK_VOXELS, BlockShape, Lattice, MaterialId},
};

/// Rounding margin when a depth range decides for a whole box, mm.
pub(super) const DEPTH_MARGIN: f64 = 1e-7;

/// A bit per voxel of a brick, set inside: bit x of byte y + 8z.
pub(super) type Mask = [u8; BRICK_VOXELS / 8];

pub(super) const EMPTY: Mask = [0; BRICK_VOXELS / 8];
pub(super) const FULL: Mask = [0xff; BRICK_VOXELS / 8];

#[inline]
pub(super) fn is_set(mask: &Mask, voxel: usize) -> bool {
    mask[voxel / 8] >> (voxel % 8) & 1 != 0
}

/// A box of bricks within a block: first brick and number of bricks per axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bricks {
    pub first: [usize; 3],
    pub count: [usize; 3],
}

impl Bricks {
    /// One brick.
    pub fn one(first: [usize; 3]) -> Self {
        Self { first, count: [1; 3] }
    }

    /// Where its bricks are in the block.
    pub fn places(self) -> impl Iterator<Item = [usize; 3]> {
        let Self { first, count } = self;
        let axis = move |axis: usize| first[axis]..first[axis] + count[axis];
        axis(2).flat_map(move |z| axis(1).flat_map(move |y| axis(0).map(move |x| [x, y, z])))
    }

    /// The indices of its bricks in a block of that shape.
    pub fn indices(self, shape: BlockShape) -> impl Iterator<Item = usize> {
        self.places().map(move |at| shape.brick_index(at))
    }

    /// Two halves, cut across the longest of the edges, whose half lengths are `half` mm, that is more than a brick.
    fn halves(self, half: DVec3) -> [Self; 2] {
        let longest =
            (0..3).filter(|&axis| self.count[axis] > 1).max_by(|&a, &b| half[a].total_cmp(&half[b])).unwrap_or(0);
        let mut halves = [self; 2];
        halves[0].count[longest] /= 2;
        halves[1].first[longest] += halves[0].count[longest];
        halves[1].count[longest] -= halves[0].count[longest];
        halves
    }
}

/// What is laid where a descent ends. Masks are those of the whole block, one per brick.
pub(super) trait Leaves {
    /// The object, and what it is measured with.
    fn measuring(&mut self) -> (&ObjectField, &mut MeasureScratch);

    /// Prepares for a block with these bounds, `nearest` mm from the surface at its centre; false if all of it is
    /// certain to lie below the layers.
    fn enter(&mut self, bounds: &BlockBox, nearest: f64) -> bool {
        let (field, scratch) = self.measuring();
        field.enter_block(bounds, nearest, scratch)
    }

    /// The one filling of some bricks, if that is certain: their exact depths are in `range`, and `candidates` hold
    /// every triangle that can be nearest.
    fn certain(
        &mut self,
        _bricks: Bricks,
        bounds: &BlockBox,
        range: DepthRange,
        candidates: &[u32],
        _masks: &[Mask],
    ) -> Option<Filling> {
        let (field, scratch) = self.measuring();
        field.certain(bounds, range, candidates, scratch)
    }

    /// Gives what is inside of some bricks one filling.
    fn fill_uniform(&mut self, bricks: Bricks, filling: Filling, masks: &[Mask]);

    /// Gives what is inside of the brick at `at`, around `centre`, its materials one by one.
    fn fill_brick(&mut self, at: [usize; 3], centre: DVec3, candidates: &[u32], masks: &[Mask]);
}

/// An object's surface and the block that it is laid into.
#[derive(Clone, Copy)]
pub(super) struct Descent<'a> {
    pub surface: &'a Surface,
    /// Where it is part of a body whose surface that is.
    pub joined: Option<&'a Joined>,
    pub lattice: &'a Lattice,
    pub shape: BlockShape,
    /// The block's first voxel.
    pub first: [u32; 3],
    /// By how much a triangle may be further than the nearest one and still count, mm.
    pub slack: f64,
    /// What lies below all layers.
    pub core: MaterialId,
}

/// Buffers of one worker.
#[derive(Default)]
pub(super) struct DescentScratch {
    candidates: Vec<u32>,
    cull: CullScratch,
    masks: Vec<Mask>,
}

impl Descent<'_> {
    /// Lays the block; `slices` are the inside runs from its lowest voxels on.
    pub fn lay(&self, slices: &[SliceRuns], leaves: &mut impl Leaves, scratch: &mut DescentScratch) {
        let all = Bricks { first: [0; 3], count: self.shape.0 };
        let bounds = self.bounds(all);
        let within = |nearest: f64| nearest + 2.0 * bounds.radius() + self.slack;
        let DescentScratch { candidates: list, cull, masks } = scratch;
        let mut whose = Whose::Own;
        if let Some(joined) = self.joined {
            let nearest = self.surface.closest(bounds.centre).distance;
            self.surface.within(bounds.centre, within(nearest), list);
            whose = joined.whose(list);
        }
        if whose == Whose::Others || !self.spread(slices, masks) {
            return;
        }
        let nearest = self.surface.closest(bounds.centre).distance;
        if !leaves.enter(&bounds, nearest) && whose == Whose::Own {
            return leaves.fill_uniform(all, Filling::Pure(self.core), masks);
        }
        self.surface.within(bounds.centre, within(nearest), list);
        let whole = 0..list.len();
        self.descend(all, whole, list, masks, leaves, cull);
    }

    fn descend(
        &self,
        bricks: Bricks,
        candidates: Range<usize>,
        list: &mut Vec<u32>,
        masks: &[Mask],
        leaves: &mut impl Leaves,
        scratch: &mut CullScratch,
    ) {
        if bricks.indices(self.shape).all(|brick| masks[brick] == EMPTY) {
            return;
        }
        let bounds = self.bounds(bricks);
        let start = list.len();
        let range = cull(self.surface.triangles(), &bounds, candidates, self.slack, list, scratch);
        let kept = start..list.len();
        let whose = self.joined.map_or(Whose::Own, |joined| joined.whose(&list[kept.clone()]));
        if whose == Whose::Others {
            list.truncate(start);
            return;
        }
        if whose == Whose::Own
            && let Some(filling) = leaves.certain(bricks, &bounds, range, &list[kept.clone()], masks)
        {
            leaves.fill_uniform(bricks, filling, masks);
        } else if bricks.count == [1; 3] {
            leaves.fill_brick(bricks.first, bounds.centre, &list[kept], masks);
        } else {
            for half in bricks.halves(bounds.half) {
                self.descend(half, kept.clone(), list, masks, leaves, scratch);
            }
        }
        list.truncate(start);
    }

    /// The box around the voxel centres of some bricks.
    fn bounds(&self, bricks: Bricks) -> BlockBox {
        let ends = [0, 1].map(|end| {
            DVec3::from(std::array::from_fn(|axis| {
                let voxel = (bricks.first[axis] + end * bricks.count[axis]) * BRICK - end;
                self.lattice.coordinate(axis, self.first[axis] + voxel as u32)
            }))
        });
        BlockBox { centre: (ends[0] + ends[1]) / 2.0, half: (ends[1] - ends[0]) / 2.0 }
    }

    /// Spreads the inside runs over the bricks of the block; false if the block is all outside.
    fn spread(&self, slices: &[SliceRuns], masks: &mut Vec<Mask>) -> bool {
        masks.clear();
        masks.resize(self.shape.bricks(), EMPTY);
        let [width, rows, _] = self.shape.voxels();
        let (low, high) = (self.first[0], self.first[0] + width);
        let mut any = false;
        for (z, slice) in slices.iter().enumerate() {
            for y in 0..rows as usize {
                for &[start, end] in slice.row(self.first[1] + y as u32) {
                    let (start, end) = (start.max(low), end.min(high));
                    if start >= end {
                        continue;
                    }
                    any = true;
                    let (mut x, end) = ((start - low) as usize, (end - low) as usize);
                    while x < end {
                        let (brick, bit) = (x / BRICK, x % BRICK);
                        let take = (BRICK - bit).min(end - x);
                        let index = self.shape.brick_index([brick, y / BRICK, z / BRICK]);
                        masks[index][y % BRICK + BRICK * (z % BRICK)] |= ((((1_u32 << take) - 1) << bit) & 0xff) as u8;
                        x += take;
                    }
                }
            }
        }
        any
    }
}
