//! One object into one block of nodes: who owns a node, what it is made of, how deep it lies.
//!
//! The descent of `slice::fill` with another leaf: boxes that are inside and of one material stay without records; a brick that a boundary may
//! pass gets, for every node inside or out, the nearest surface point. That is in single precision (a few 10⁻⁶ mm), since
//! a node's label and its depth come from the same number and so never contradict each other. By the Lp-averaged distance every
//! depth below the surface is averaged, as for voxels; the surface itself stays where the exact distance is 0.

use std::{ops::Range, sync::Arc};

use glam::DVec3;

use super::{
    PartOf,
    nodes::{NOBODY, Nearest, Node, NodeBrick, NodeGrid, VOID},
    taper::{Tapers, is_thin},
};
use crate::{
    sdf::{
        BlockBox, BrickOffsets, BrickSurface, CullScratch, DepthRange, InsideRows, LpField, LpOffsets, LpScratch,
        SliceRuns, cull, nearest_in_brick,
    },
    slice::{
        ObjectField,
        depth::{Measure, MeasureScratch},
    },
    voxel::{BRICK, BRICK_VOXELS, Lattice, MaterialId},
};

/// Bricks along each edge of a block. More make the descent from the root cheaper, and the slab that is held at a time thicker;
/// 4 is 32 layers of nodes.
pub const BLOCK: usize = 4;
/// Nodes along each edge of a block.
pub const BLOCK_NODES: usize = BLOCK * BRICK;
/// Bricks in a block; x runs fastest.
pub const BLOCK_BRICKS: usize = BLOCK * BLOCK * BLOCK;

/// Rounding margin when a depth range decides for a whole box, mm.
const DEPTH_MARGIN: f64 = 1e-7;

/// A bit per node of a brick: bit x of byte y + 8z.
type Mask = [u8; BRICK_VOXELS / 8];

/// An object on the node lattice.
#[derive(Debug)]
pub struct NodeObject<'a> {
    field: &'a ObjectField,
    /// Its number; the lower one owns what two share.
    number: u16,
    lattice: Lattice,
    inside: InsideRows,
    offsets: BrickOffsets,
    /// The averaged distance, if the object's layers are laid by it; the grid's has steps, and gives way to the exact one.
    averaged: Option<(Arc<LpField>, Box<LpOffsets>)>,
    /// Label of every slot of the layers, then of the core.
    labels: Vec<u8>,
    part_of: &'a PartOf,
    /// Layers thinner than this are rounded, and no thick one loses more on a side; 0 where all are thick, mm.
    rounding: f64,
}

/// The bottoms of slots, and what it takes to make them.
#[derive(Debug, Default)]
pub struct Row {
    bottoms: Vec<f32>,
    tapers: Tapers,
}

/// Buffers of one worker.
#[derive(Default)]
pub struct BlockScratch {
    candidates: Vec<u32>,
    cull: CullScratch,
    masks: Vec<Mask>,
    surface: BrickSurface,
    row: Row,
    measure: MeasureScratch,
    lp: LpScratch,
}

/// The bricks of a block, and the index of its first node.
struct Block<'b> {
    first: [u32; 3],
    bricks: &'b mut [NodeBrick],
}

/// A box of bricks within a block.
#[derive(Clone, Copy)]
struct Bricks {
    first: [usize; 3],
    count: [usize; 3],
}

impl Bricks {
    fn indices(self) -> impl Iterator<Item = usize> {
        let Self { first, count } = self;
        let axis = move |axis: usize| first[axis]..first[axis] + count[axis];
        axis(2).flat_map(move |z| axis(1).flat_map(move |y| axis(0).map(move |x| brick_index([x, y, z]))))
    }

    /// Two halves, cut across the longest edge.
    fn halves(self) -> [Self; 2] {
        let longest = (0..3).max_by_key(|&axis| self.count[axis]).unwrap_or(0);
        let mut halves = [self; 2];
        halves[0].count[longest] /= 2;
        halves[1].first[longest] += halves[0].count[longest];
        halves[1].count[longest] -= halves[0].count[longest];
        halves
    }
}

impl<'a> NodeObject<'a> {
    /// Lays object `number` onto `grid`; a material that is no part is a void.
    pub fn new(field: &'a ObjectField, number: u16, grid: &NodeGrid, part_of: &'a PartOf) -> Self {
        let pitch = grid.lattice.pitch.x;
        let averaged = match field.measure.resampled(&grid.lattice) {
            Measure::Lp { field, offsets } => Some((field, offsets)),
            Measure::Exact | Measure::Grid { .. } => None,
        };
        let tapered = field.layers().needs_uv() || {
            let mut row = Vec::new();
            field.layers().bottoms(0, glam::Vec2::ZERO, &mut row);
            is_thin(&row, pitch as f32)
        };
        Self {
            field,
            number,
            lattice: grid.lattice,
            inside: field.inside().resampled(grid.lattice, BLOCK_NODES as u32),
            offsets: BrickOffsets::new(&grid.lattice),
            averaged,
            labels: field.layers().slot_ids().into_iter().map(|id| label(part_of, id)).collect(),
            part_of,
            rounding: if tapered { pitch } else { 0.0 },
        }
    }

    /// Label of every slot of the layers, then of the core.
    pub fn labels(&self) -> &[u8] {
        &self.labels
    }

    /// Which nodes of the slices from `first` on are inside.
    pub fn fill_inside(&self, first: u32, slices: &mut [SliceRuns]) {
        self.inside.fill(first, slices);
    }

    /// The surface point nearest to `p`, and how far it is by the object's measure.
    pub fn nearest(&self, p: DVec3, scratch: &mut LpScratch) -> Nearest {
        let surface = self.field.surface();
        let found = surface.closest(p);
        let distance = match &self.averaged {
            None => found.distance,
            Some((field, _)) => field.distance(surface.triangles(), p, found.distance, scratch),
        };
        Nearest { distance: distance as f32, triangle: found.triangle }
    }

    /// The exact distance of `p`, where that is another one than [`Self::nearest`] gives.
    pub fn exact(&self, p: DVec3) -> Option<f64> {
        self.averaged.as_ref().map(|_| self.field.surface().closest(p).distance)
    }

    /// The bottoms of the slots below the point of `triangle` nearest to `p`, as the pitch can show them.
    pub fn bottoms<'r>(&self, triangle: u32, p: DVec3, row: &'r mut Row) -> &'r [f32] {
        let layers = self.field.layers();
        layers.bottoms(triangle, self.field.uv(triangle, p), &mut row.bottoms);
        if self.rounding > 0.0 {
            row.tapers.round(&self.labels, self.rounding as f32, &mut row.bottoms);
        }
        &row.bottoms
    }

    /// Writes this object's nodes into the `bricks` of the block whose first node is `first`; `slices` are the inside runs from
    /// its lowest nodes on. Nodes that another object owns stay.
    pub fn fill_block(
        &self,
        first: [u32; 3],
        slices: &[SliceRuns],
        bricks: &mut [NodeBrick],
        scratch: &mut BlockScratch,
    ) {
        if !fill_masks(first, slices, &mut scratch.masks) {
            return;
        }
        let (surface, layers) = (self.field.surface(), self.field.layers());
        let all = Bricks { first: [0; 3], count: [BLOCK; 3] };
        let mut block = Block { first, bricks };
        let bounds = self.bounds(first, all);
        let (nearest, radius) = (surface.closest(bounds.centre).distance, bounds.radius());
        let shallowest = match self.averaged {
            Some(_) => self.field.shallowest(&bounds, nearest, &mut scratch.measure),
            None => nearest - radius,
        };
        if shallowest > layers.thickness() + DEPTH_MARGIN + self.rounding {
            return self.fill_uniform(all, label(self.part_of, layers.core()), &mut block, scratch);
        }
        let mut candidates = std::mem::take(&mut scratch.candidates);
        surface.within(bounds.centre, nearest + 2.0 * radius + DEPTH_MARGIN, &mut candidates);
        let whole = 0..candidates.len();
        self.descend(all, whole, &mut candidates, &mut block, scratch);
        scratch.candidates = candidates;
    }

    fn descend(
        &self,
        bricks: Bricks,
        candidates: Range<usize>,
        list: &mut Vec<u32>,
        block: &mut Block,
        scratch: &mut BlockScratch,
    ) {
        if bricks.indices().all(|brick| scratch.masks[brick] == [0; BRICK_VOXELS / 8]) {
            return;
        }
        let bounds = self.bounds(block.first, bricks);
        let start = list.len();
        let range = cull(self.field.surface().triangles(), &bounds, candidates, DEPTH_MARGIN, list, &mut scratch.cull);
        let kept = start..list.len();
        let solid = bricks.indices().all(|brick| scratch.masks[brick] == [0xff; BRICK_VOXELS / 8]);
        let range = match self.averaged {
            _ if !solid => None,
            Some(_) => self.field.measured(range, &bounds, &list[kept.clone()], &mut scratch.measure),
            None => Some(range),
        };
        let margin = DEPTH_MARGIN + self.rounding;
        let uniform = range.and_then(|range| {
            let range = DepthRange { min: range.min - margin, max: range.max + margin };
            self.field.layers().uniform_over(&list[kept.clone()], range)
        });
        if let Some(id) = uniform {
            self.fill_uniform(bricks, label(self.part_of, id), block, scratch);
        } else if bricks.count == [1; 3] {
            self.fill_brick(bricks.first, bounds.centre, &list[kept], block, scratch);
        } else {
            for half in bricks.halves() {
                self.descend(half, kept.clone(), list, block, scratch);
            }
        }
        list.truncate(start);
    }

    /// Gives the inside nodes of some bricks one label.
    fn fill_uniform(&self, bricks: Bricks, label: u8, block: &mut Block, scratch: &BlockScratch) {
        for index in bricks.indices() {
            let (mask, brick) = (&scratch.masks[index], &mut block.bricks[index]);
            if *mask == [0; BRICK_VOXELS / 8] {
                continue;
            }
            if *mask == [0xff; BRICK_VOXELS / 8] && matches!(brick, NodeBrick::Uniform { owner: NOBODY, .. }) {
                *brick = NodeBrick::Uniform { label, owner: self.number };
                continue;
            }
            for (n, node) in brick.dense_mut().iter_mut().enumerate() {
                if is_set(mask, n) && node.owner == NOBODY {
                    *node = Node { label, owner: self.number, ..Node::OUTSIDE };
                }
            }
        }
    }

    /// Measures the nodes of the brick at `at` that nobody owns yet, and takes those inside.
    fn fill_brick(
        &self,
        at: [usize; 3],
        centre: DVec3,
        candidates: &[u32],
        block: &mut Block,
        scratch: &mut BlockScratch,
    ) {
        let BlockScratch { masks, surface, row, lp, .. } = scratch;
        let triangles = self.field.surface().triangles();
        nearest_in_brick(triangles, candidates, centre, &self.offsets, surface);
        if let Some((field, offsets)) = &self.averaged {
            field.fill_brick(triangles, centre, offsets, &[0xff; BRICK_VOXELS / 8], surface, lp);
        }
        let position = |node: usize| {
            let index = |axis: usize| block.first[axis] + (at[axis] * BRICK + (node >> (3 * axis) & 7)) as u32;
            self.lattice.centre(std::array::from_fn(index))
        };
        let index = brick_index(at);
        for (n, node) in block.bricks[index].dense_mut().iter_mut().enumerate() {
            if node.owner != NOBODY {
                continue;
            }
            let triangle = candidates[surface.candidate[n] as usize];
            node.measured = self.number;
            node.nearest = Nearest { distance: surface.distance[n], triangle };
            if is_set(&masks[index], n) {
                let bottoms = self.bottoms(triangle, position(n), row);
                node.owner = self.number;
                node.label = self.labels[slots_passed(bottoms, node.nearest.distance)];
            }
        }
    }

    /// The box around the nodes of some bricks.
    fn bounds(&self, first: [u32; 3], bricks: Bricks) -> BlockBox {
        let ends = [0, 1].map(|end| {
            DVec3::from(std::array::from_fn(|axis| {
                let node = (bricks.first[axis] + end * bricks.count[axis]) * BRICK - end;
                self.lattice.coordinate(axis, first[axis] + node as u32)
            }))
        });
        BlockBox { centre: (ends[0] + ends[1]) / 2.0, half: (ends[1] - ends[0]) / 2.0 }
    }
}

fn label(part_of: &PartOf, id: MaterialId) -> u8 {
    if part_of[usize::from(id.0)].is_some() { id.0 } else { VOID }
}

/// Number of slots that end at or above `depth`.
#[inline]
pub fn slots_passed(bottoms: &[f32], depth: f32) -> usize {
    bottoms.iter().filter(|&&bottom| depth >= bottom).count()
}

/// Index of the brick at (x, y, z) within its block.
#[inline]
fn brick_index([x, y, z]: [usize; 3]) -> usize {
    x + BLOCK * (y + BLOCK * z)
}

#[inline]
fn is_set(mask: &Mask, node: usize) -> bool {
    mask[node / 8] >> (node % 8) & 1 != 0
}

/// Spreads the inside runs over the bricks of a block; false if the block is all outside.
fn fill_masks(first: [u32; 3], slices: &[SliceRuns], masks: &mut Vec<Mask>) -> bool {
    masks.clear();
    masks.resize(BLOCK_BRICKS, [0; BRICK_VOXELS / 8]);
    let (low, high) = (first[0], first[0] + BLOCK_NODES as u32);
    let mut any = false;
    for (z, slice) in slices.iter().enumerate() {
        for y in 0..BLOCK_NODES {
            for &[start, end] in slice.row(first[1] + y as u32) {
                for node in start.max(low)..end.min(high) {
                    any = true;
                    let x = (node - low) as usize;
                    let brick = brick_index([x / BRICK, y / BRICK, z / BRICK]);
                    masks[brick][y % BRICK + BRICK * (z % BRICK)] |= 1 << (x % BRICK);
                }
            }
        }
    }
    any
}
