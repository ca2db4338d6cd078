//! One object into one block of nodes: who owns a node, what it is made of, how deep it lies.
//!
//! The leaves of the descent that are nodes: boxes that are inside and of one material stay without records; a brick
//! that a boundary may pass gets, for every node inside or out, the nearest surface point. That is in single precision
//! (a few 10⁻⁶ mm), since a node's label and its depth come from the same number and so never contradict each other. By
//! the Lp-averaged distance every depth below the surface is averaged, as for voxels; the surface itself stays where
//! the exact distance is 0.

use std::sync::Arc;

use glam::DVec3;

use super::{
    PartOf,
    nodes::{NO_OBJECT, Nearest, Node, NodeBrick, NodeGrid, VOID},
    taper::{Tapers, is_thin},
};
use crate::{
    appearance::Filling,
    sdf::{
        BlockBox, BrickOffsets, BrickSurface, DepthRange, InsideRows, LpField, LpOffsets, LpScratch, SliceRuns,
        nearest_in_brick,
    },
    slice::{
        ObjectField,
        depth::{Measure, MeasureScratch},
        descent::{Bricks, DEPTH_MARGIN, Descent, DescentScratch, EMPTY, FULL, Leaves, Mask, is_set},
    },
    voxel::{BRICK, BlockShape, Lattice, MaterialId},
};

/// Bricks along each edge of a block. More make the descent from the root cheaper, and the slab that is held at a time
/// thicker; 4 is 32 layers of nodes.
pub const BLOCK: usize = 4;
/// Nodes along each edge of a block.
pub const BLOCK_NODES: usize = BLOCK * BRICK;
/// Bricks in a block; x runs fastest.
pub const BLOCK_BRICKS: usize = BLOCK * BLOCK * BLOCK;
const SHAPE: BlockShape = BlockShape([BLOCK; 3]);

/// An object on the node lattice.
#[derive(Debug)]
pub struct NodeObject<'a> {
    field: &'a ObjectField,
    /// Its number; the lower one owns what two share.
    number: u16,
    lattice: Lattice,
    inside: InsideRows,
    offsets: BrickOffsets,
    /// The averaged distance, if the object's layers are laid by it; the grid's has steps, and gives way to the exact
    /// one.
    averaged: Option<(Arc<LpField>, Box<LpOffsets>)>,
    /// Label of every slot of the layers, then of the core.
    labels: Vec<u8>,
    part_of: &'a PartOf,
    /// Layers thinner than this are rounded, and no thick one loses more on a side; 0 where all are thick, mm.
    rounding: f64,
    /// Depths of the boundaries that are level sets of the exact distance, from the outer surface on, mm.
    levels: Vec<f64>,
}

/// The bottoms of slots, and what it takes to make them.
#[derive(Debug, Default)]
pub struct Row {
    bottoms: Vec<f32>,
    tapers: Tapers,
}

/// How a position lies to a level set of the distance.
#[derive(Debug, Clone, Copy)]
pub struct AboveLevel {
    /// How far above it, by its tangent plane, mm.
    pub above: f64,
    /// How far from it, mm.
    pub off: f64,
    /// Unit normal of the level set through the position, towards less depth.
    pub normal: DVec3,
    /// The triangle nearest to the position.
    pub triangle: u32,
    /// The place on the level set next to the position, mm.
    pub onto: DVec3,
}

/// Buffers of one worker.
#[derive(Default)]
pub struct BlockScratch {
    descent: DescentScratch,
    leaf: LeafScratch,
}

/// Buffers of one worker for its leaves.
#[derive(Default)]
struct LeafScratch {
    surface: BrickSurface,
    row: Row,
    measure: MeasureScratch,
    lp: LpScratch,
}

/// An object's nodes in one block.
struct NodeLeaves<'a, 'b> {
    object: &'a NodeObject<'b>,
    /// The block's first node.
    first: [u32; 3],
    bricks: &'a mut [NodeBrick],
    scratch: &'a mut LeafScratch,
}

impl<'a> NodeObject<'a> {
    /// Lays object `number` onto `grid`; a material that is no part is a void.
    pub fn new(field: &'a ObjectField, number: u16, grid: &NodeGrid, part_of: &'a PartOf) -> Self {
        let pitch = grid.lattice.pitch.x;
        let averaged = match field.measure.resampled(&grid.lattice) {
            Measure::Lp { field, offsets } => Some((field, offsets)),
            Measure::Exact | Measure::Grid { .. } => None,
        };
        let mut row = Vec::new();
        if !field.layers().needs_uv() {
            field.layers().bottoms(0, glam::Vec2::ZERO, &mut row);
        }
        let tapered = field.layers().needs_uv() || is_thin(&row, pitch as f32);
        let mut levels = vec![0.0];
        if !tapered && averaged.is_none() {
            levels.extend(row.iter().copied().map(f64::from));
        }
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
            levels,
        }
    }

    /// How `p`, which is near boundary `boundary`, lies to it; `None` where that is no level set of the exact distance.
    /// Of the outer surface, which has no direction to the nearest point on it, it is the nearest triangle's plane that
    /// is held against `p`.
    /// `likely` are triangles that may be near.
    pub fn above_level(&self, boundary: u16, p: DVec3, likely: &[u32]) -> Option<AboveLevel> {
        let depth = *self.levels.get(usize::from(boundary))?;
        let found = self.field.around().closest_near(p, likely);
        let normal = if depth > 0.0 {
            (found.point - p) / found.distance
        } else {
            let [a, b, c] = self.field.around().triangles()[found.triangle as usize];
            (b - a).cross(c - a).normalize_or_zero()
        };
        let above = if depth > 0.0 { depth - found.distance } else { normal.dot(p - found.point) };
        let off = if depth > 0.0 { above.abs() } else { found.distance };
        (normal.is_finite() && normal != DVec3::ZERO).then_some(AboveLevel {
            above,
            off,
            normal,
            triangle: found.triangle,
            onto: if depth > 0.0 { p - above * normal } else { found.point },
        })
    }

    /// Whether a triangle is its own, not that of another object of its body.
    pub fn owns(&self, triangle: u32) -> bool {
        self.field.own(triangle).is_some()
    }

    /// The objects that it is one body with, itself among them; `None` where it is alone.
    pub fn members(&self) -> Option<&[usize]> {
        self.field.members().map(|members| &members[..])
    }

    /// Whether all these objects are of the body that it is part of.
    pub fn is_body_of(&self, objects: [u16; 2]) -> bool {
        let is_member = |members: &[usize], n: u16| members.binary_search(&usize::from(n)).is_ok();
        self.members().is_some_and(|members| objects.iter().all(|&n| is_member(members, n)))
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
        let surface = self.field.around();
        let found = surface.closest(p);
        let distance = match &self.averaged {
            None => found.distance,
            Some((field, _)) => field.distance(surface.triangles(), p, found.distance, scratch),
        };
        Nearest { distance: distance as f32, triangle: found.triangle }
    }

    /// The exact distance of `p`, where that is another one than [`Self::nearest`] gives.
    pub fn exact(&self, p: DVec3) -> Option<f64> {
        self.averaged.as_ref().map(|_| self.field.around().closest(p).distance)
    }

    /// The bottoms of the slots below the point of `triangle` nearest to `p`, as the pitch can show them; of another
    /// object's triangle those below the nearest point of this one's.
    pub fn bottoms<'r>(&self, triangle: u32, p: DVec3, row: &'r mut Row) -> &'r [f32] {
        let layers = self.field.layers();
        let triangle = self.field.own(triangle).unwrap_or_else(|| self.field.surface().closest(p).triangle);
        layers.bottoms(triangle, self.field.uv(triangle, p), &mut row.bottoms);
        if self.rounding > 0.0 {
            row.tapers.round(&self.labels, self.rounding as f32, &mut row.bottoms);
        }
        &row.bottoms
    }

    /// Writes this object's nodes into the `bricks` of the block whose first node is `first`; `slices` are the inside
    /// runs from its lowest nodes on. Nodes that another object owns stay.
    pub fn fill_block(
        &self,
        first: [u32; 3],
        slices: &[SliceRuns],
        bricks: &mut [NodeBrick],
        scratch: &mut BlockScratch,
    ) {
        let BlockScratch { descent, leaf } = scratch;
        let mut leaves = NodeLeaves { object: self, first, bricks, scratch: leaf };
        let whole = Descent {
            surface: self.field.around(),
            joined: self.field.joined(),
            lattice: &self.lattice,
            shape: SHAPE,
            first,
            slack: DEPTH_MARGIN,
            core: self.field.layers().core(),
        };
        whole.lay(slices, &mut leaves, descent);
    }
}

impl Leaves for NodeLeaves<'_, '_> {
    fn measuring(&mut self) -> (&ObjectField, &mut MeasureScratch) {
        (self.object.field, &mut self.scratch.measure)
    }

    fn enter(&mut self, bounds: &BlockBox, nearest: f64) -> bool {
        let NodeObject { field, averaged, rounding, .. } = self.object;
        let shallowest = match averaged {
            Some(_) => field.shallowest(bounds, nearest, &mut self.scratch.measure),
            None => nearest - bounds.radius(),
        };
        shallowest <= field.layers().thickness() + DEPTH_MARGIN + rounding
    }

    fn certain(
        &mut self,
        bricks: Bricks,
        bounds: &BlockBox,
        range: DepthRange,
        candidates: &[u32],
        masks: &[Mask],
    ) -> Option<Filling> {
        let NodeObject { field, averaged, rounding, .. } = self.object;
        if bricks.indices(SHAPE).any(|brick| masks[brick] != FULL) {
            return None;
        }
        let range = match averaged {
            Some(_) => field.measured(range, bounds, candidates, &mut self.scratch.measure)?,
            None => range,
        };
        let margin = DEPTH_MARGIN + rounding;
        let range = DepthRange { min: range.min - margin, max: range.max + margin };
        field.uniform_over(candidates, range)
    }

    fn fill_uniform(&mut self, bricks: Bricks, filling: Filling, masks: &[Mask]) {
        // Jobs with mixtures make no meshes: a mesh of grains would be all surface.
        let id = match filling {
            Filling::Pure(id) => id,
            Filling::Mixed(blend) => self.object.field.layers().blend(blend).mostly(),
        };
        let (label, owner) = (label(self.object.part_of, id), self.object.number);
        for index in bricks.indices(SHAPE) {
            let (mask, brick) = (&masks[index], &mut self.bricks[index]);
            if *mask == EMPTY {
                continue;
            }
            if *mask == FULL && matches!(brick, NodeBrick::Uniform { owner: NO_OBJECT, .. }) {
                *brick = NodeBrick::Uniform { label, owner };
                continue;
            }
            for (n, node) in brick.dense_mut().iter_mut().enumerate() {
                if is_set(mask, n) && node.owner == NO_OBJECT {
                    *node = Node { label, owner, ..Node::OUTSIDE };
                }
            }
        }
    }

    /// Measures the nodes of the brick that no object owns yet, and takes those inside.
    fn fill_brick(&mut self, at: [usize; 3], centre: DVec3, candidates: &[u32], masks: &[Mask]) {
        let object = self.object;
        let LeafScratch { surface, row, lp, .. } = &mut *self.scratch;
        let triangles = object.field.around().triangles();
        nearest_in_brick(triangles, candidates, centre, &object.offsets, surface);
        if let Some((field, offsets)) = &object.averaged {
            field.fill_brick(triangles, centre, offsets, &FULL, surface, lp);
        }
        let position = |node: usize| {
            let index = |axis: usize| self.first[axis] + (at[axis] * BRICK + (node >> (3 * axis) & 7)) as u32;
            object.lattice.centre(std::array::from_fn(index))
        };
        let index = SHAPE.brick_index(at);
        for (n, node) in self.bricks[index].dense_mut().iter_mut().enumerate() {
            if node.owner != NO_OBJECT {
                continue;
            }
            let triangle = candidates[surface.candidate[n] as usize];
            node.measured = object.number;
            node.nearest = Nearest { distance: surface.distance[n], triangle };
            if is_set(&masks[index], n) && object.field.own(triangle).is_some() {
                let bottoms = object.bottoms(triangle, position(n), row);
                node.owner = object.number;
                node.label = object.labels[slots_passed(bottoms, node.nearest.distance)];
            }
        }
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
