//! One object into one block of voxels.
//!
//! A block is halved along its longest edge until it is one brick. On the way down the list of triangles that can be nearest
//! shrinks ([`cull`]), and a box whose depths and triangles leave one answer is filled without visiting its voxels.

use std::sync::Arc;

use glam::{DVec3, Vec2};

use super::depth::{DistanceKind, Measure, MeasureScratch, SlabField};
use crate::{
    appearance::{BrickQuery, LayerField},
    mesh::Solid,
    sdf::{
        BlockBox, BrickOffsets, BrickSurface, CullScratch, DepthRange, Face, InsideRows, SliceRuns, Surface,
        closest_point, cull, nearest_in_parts,
    },
    voxel::{BRICK, BRICK_VOXELS, Block, BlockShape, Lattice, MaterialId},
};

/// Rounding margin when a depth range decides for a whole box, mm.
pub(super) const DEPTH_MARGIN: f64 = 1e-7;

/// An object on the lattice: where it is, how deep, and what its layers are.
#[derive(Debug)]
pub struct ObjectField {
    surface: Arc<Surface>,
    inside: InsideRows,
    layers: Arc<LayerField>,
    offsets: BrickOffsets,
    pub(super) uvs: Arc<[[Vec2; 3]]>,
    pub(super) lattice: Lattice,
    pub(super) shape: BlockShape,
    pub(super) measure: Measure,
}

/// Buffers of one worker.
#[derive(Default)]
pub struct FillScratch {
    candidates: Vec<u32>,
    cull: CullScratch,
    pub(super) measure: MeasureScratch,
    pub(super) masks: Vec<[u8; BRICK_VOXELS / 8]>,
    pub(super) surface: BrickSurface,
    /// What can be nearest in one part of a brick.
    part: Vec<u32>,
    /// Of the brick's candidates, as far as asked for.
    faces: Vec<Option<Face>>,
}

/// Where a block is: its first voxel, and what is known of its slab.
#[derive(Clone, Copy)]
pub(super) struct Site<'a> {
    pub(super) first: [u32; 3],
    pub(super) slab: &'a SlabField,
}

/// A box of bricks within a block: first brick and number of bricks per axis.
#[derive(Clone, Copy)]
struct Bricks {
    first: [usize; 3],
    count: [usize; 3],
}

impl ObjectField {
    /// Prepares an object, its layers laid by the exact distance; `None` for a mesh without triangles.
    pub fn new(solid: &Solid, lattice: Lattice, layers: LayerField) -> Option<Self> {
        let shape = BlockShape::for_lattice(&lattice);
        Some(Self {
            surface: Arc::new(Surface::new(&solid.mesh)?),
            inside: InsideRows::new(solid, lattice, shape.voxels()[2]),
            uvs: if layers.needs_uv() { solid.mesh.uvs.clone().into() } else { Arc::default() },
            layers: Arc::new(layers),
            lattice,
            shape,
            offsets: BrickOffsets::new(&lattice),
            measure: Measure::Exact,
        })
    }

    /// The same object on another lattice of the same frame.
    pub fn resampled(&self, lattice: Lattice) -> Self {
        let shape = BlockShape::for_lattice(&lattice);
        Self {
            surface: Arc::clone(&self.surface),
            inside: self.inside.resampled(lattice, shape.voxels()[2]),
            uvs: Arc::clone(&self.uvs),
            layers: Arc::clone(&self.layers),
            lattice,
            shape,
            offsets: BrickOffsets::new(&lattice),
            measure: self.measure.resampled(&lattice),
        }
    }

    /// Lays the layers by another distance.
    pub fn with_distance(mut self, kind: DistanceKind) -> Self {
        self.measure = Measure::new(kind, &self.surface, &self.lattice);
        self
    }

    /// The closest-point structure.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// The layers.
    pub fn layers(&self) -> &LayerField {
        &self.layers
    }

    /// Texture coordinates of the point of a triangle nearest to `p`; 0 where the layers need none.
    pub(super) fn uv(&self, triangle: u32, p: DVec3) -> Vec2 {
        let [_, v, w] = closest_point(p, &self.surface.triangles()[triangle as usize]).barycentric;
        self.uv_at(triangle, [v as f32, w as f32])
    }

    /// Texture coordinates where the second and third corner of a triangle weigh `v` and `w`; 0 where the layers need none.
    #[inline(always)]
    fn uv_at(&self, triangle: u32, [v, w]: [f32; 2]) -> Vec2 {
        let Some(&[a, b, c]) = self.uvs.get(triangle as usize) else { return Vec2::ZERO };
        a + (b - a) * v + (c - a) * w
    }

    /// The closed surface that tells inside from outside.
    pub(super) fn inside(&self) -> &InsideRows {
        &self.inside
    }

    /// Which voxels of the slices from `first` on are inside.
    pub fn fill_inside(&self, first: u32, slices: &mut [SliceRuns]) {
        self.inside.fill(first, slices);
    }

    /// Writes this object's voxels into the block whose first voxel is `first`; `slab` has been prepared for this object.
    /// Voxels that another object has taken stay.
    pub fn fill_block(&self, first: [u32; 3], slab: &SlabField, block: &mut Block, scratch: &mut FillScratch) {
        if !self.fill_masks(first, &slab.runs, &mut scratch.masks) {
            return;
        }
        let all = Bricks { first: [0; 3], count: self.shape.0 };
        let bounds = self.bounds(first, all);
        let nearest = self.surface.closest(bounds.centre).distance;
        let radius = bounds.radius();
        if !self.enter_block(&bounds, nearest, &mut scratch.measure) {
            return self.fill_uniform(all, self.layers.core(), block, scratch);
        }
        let mut candidates = std::mem::take(&mut scratch.candidates);
        self.surface.within(bounds.centre, nearest + 2.0 * radius + self.measure.slack(), &mut candidates);
        let whole = 0..candidates.len();
        self.descend(Site { first, slab }, all, whole, &mut candidates, block, scratch);
        scratch.candidates = candidates;
    }

    /// Spreads the inside runs over the bricks of a block; false if the block is all outside.
    fn fill_masks(&self, first: [u32; 3], slices: &[SliceRuns], masks: &mut Vec<[u8; BRICK_VOXELS / 8]>) -> bool {
        masks.clear();
        masks.resize(self.shape.bricks(), [0; BRICK_VOXELS / 8]);
        let [width, rows, _] = self.shape.voxels();
        let (low, high) = (first[0], first[0] + width);
        let mut any = false;
        for (z, slice) in slices.iter().enumerate() {
            for y in 0..rows as usize {
                for &[start, end] in slice.row(first[1] + y as u32) {
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

    /// The box around the voxel centres of some bricks.
    fn bounds(&self, first: [u32; 3], bricks: Bricks) -> BlockBox {
        let ends = [0, 1].map(|end| {
            DVec3::from(std::array::from_fn(|axis| {
                let voxel = (bricks.first[axis] + end * bricks.count[axis]) * BRICK - end;
                self.lattice.coordinate(axis, first[axis] + voxel as u32)
            }))
        });
        BlockBox { centre: (ends[0] + ends[1]) / 2.0, half: (ends[1] - ends[0]) / 2.0 }
    }

    fn descend(
        &self,
        site: Site<'_>,
        bricks: Bricks,
        candidates: std::ops::Range<usize>,
        list: &mut Vec<u32>,
        block: &mut Block,
        scratch: &mut FillScratch,
    ) {
        if self.all_outside(bricks, &scratch.masks) {
            return;
        }
        let bounds = self.bounds(site.first, bricks);
        let start = list.len();
        let range = cull(self.surface.triangles(), &bounds, candidates, self.measure.slack(), list, &mut scratch.cull);
        let range = DepthRange { min: range.min - DEPTH_MARGIN, max: range.max + DEPTH_MARGIN };
        let kept = start..list.len();
        let measured = self.measured(range, &bounds, &list[kept.clone()], &mut scratch.measure);
        if let Some(id) = measured.and_then(|range| self.layers.uniform_over(&list[kept.clone()], range)) {
            self.fill_uniform(bricks, id, block, scratch);
        } else if bricks.count == [1; 3] {
            self.fill_brick(site, bounds.centre, bricks.first, &list[kept], block, scratch);
        } else {
            let longest = (0..3)
                .filter(|&axis| bricks.count[axis] > 1)
                .max_by(|&a, &b| bounds.half[a].total_cmp(&bounds.half[b]))
                .unwrap_or(0);
            let mut halves = [bricks; 2];
            halves[0].count[longest] /= 2;
            halves[1].first[longest] += halves[0].count[longest];
            halves[1].count[longest] -= halves[0].count[longest];
            for half in halves {
                self.descend(site, half, kept.clone(), list, block, scratch);
            }
        }
        list.truncate(start);
    }

    fn all_outside(&self, bricks: Bricks, masks: &[[u8; BRICK_VOXELS / 8]]) -> bool {
        self.indices(bricks).all(|brick| masks[brick] == [0; BRICK_VOXELS / 8])
    }

    fn indices(&self, bricks: Bricks) -> impl Iterator<Item = usize> {
        let Bricks { first, count } = bricks;
        let shape = self.shape;
        (first[2]..first[2] + count[2]).flat_map(move |z| {
            (first[1]..first[1] + count[1])
                .flat_map(move |y| (first[0]..first[0] + count[0]).map(move |x| shape.brick_index([x, y, z])))
        })
    }

    /// Gives the inside voxels of some bricks one material.
    fn fill_uniform(&self, bricks: Bricks, id: MaterialId, block: &mut Block, scratch: &FillScratch) {
        for brick in self.indices(bricks) {
            let mask = &scratch.masks[brick];
            if *mask == [0; BRICK_VOXELS / 8] {
                continue;
            }
            let free = block.tile(brick) == crate::voxel::Tile::Uniform(MaterialId::BACKGROUND);
            if free && *mask == [0xff; BRICK_VOXELS / 8] {
                block.set_uniform(brick, id);
            } else {
                merge(block.dense_mut(brick), mask, |_| id.0);
            }
        }
    }

    /// Gives the inside voxels of one brick their materials one by one.
    fn fill_brick(
        &self,
        site: Site<'_>,
        centre: DVec3,
        at: [usize; 3],
        candidates: &[u32],
        block: &mut Block,
        scratch: &mut FillScratch,
    ) {
        let triangles = self.surface.triangles();
        let brick = self.shape.brick_index(at);
        let mut mask = scratch.masks[brick];
        let mut ids = [0; BRICK_VOXELS];
        if !matches!(self.measure, Measure::Grid { .. }) {
            let settled = self.nearest(candidates, centre, &mut mask, &mut ids, scratch);
            if let Some(id) = settled {
                let bricks = Bricks { first: at, count: [1; 3] };
                return self.fill_uniform(bricks, id, block, scratch);
            }
        }
        let candidates = match &self.measure {
            Measure::Exact => candidates,
            Measure::Lp { .. } => {
                self.measure_lp(centre, brick, scratch);
                candidates
            }
            Measure::Grid { .. } => {
                self.measure_grid(site, at, brick, scratch);
                &scratch.measure.triangles
            }
        };
        let position = |voxel: usize| {
            let index = |axis: usize| site.first[axis] + (at[axis] * BRICK + (voxel >> (3 * axis) & 7)) as u32;
            self.lattice.centre(std::array::from_fn(index))
        };
        let exact = |voxel: usize| {
            if !matches!(self.measure, Measure::Exact) {
                return f64::from(scratch.surface.distance[voxel]);
            }
            let p = position(voxel);
            let squared = |&t: &u32| closest_point(p, &triangles[t as usize]).distance_squared;
            candidates.iter().map(squared).fold(f64::INFINITY, f64::min).sqrt()
        };
        let mut faces = std::mem::take(&mut scratch.faces);
        faces.clear();
        faces.resize(candidates.len(), None);
        let radius = self.offsets.of(0).length();
        let uv = |candidate: u32, voxel: usize| {
            if matches!(self.measure, Measure::Grid { .. }) {
                return scratch.measure.uvs[voxel];
            }
            let triangle = candidates[candidate as usize];
            let face = faces[candidate as usize]
                .get_or_insert_with(|| Face::new(&triangles[triangle as usize], centre, f64::from(radius)));
            match face.weights(self.offsets.of(voxel)) {
                Some(weights) => self.uv_at(triangle, weights),
                None => self.uv(triangle, position(voxel)),
            }
        };
        let query = BrickQuery { surface: &scratch.surface, candidates, mask: &mask };
        self.layers.fill_brick(query, exact, uv, &mut ids);
        merge(block.dense_mut(brick), &scratch.masks[brick], |voxel| ids[voxel]);
        scratch.faces = faces;
    }

    /// Finds the nearest triangle of the masked voxels. Parts that are certain to be one material get their ids and leave the mask;
    /// if that is all of them and one id, it is returned.
    fn nearest(
        &self,
        candidates: &[u32],
        centre: DVec3,
        mask: &mut [u8; BRICK_VOXELS / 8],
        ids: &mut [u8; BRICK_VOXELS],
        scratch: &mut FillScratch,
    ) -> Option<MaterialId> {
        let inside = *mask;
        let (mut only, mut alike) = (None, true);
        nearest_in_parts(
            self.surface.triangles(),
            candidates,
            centre,
            &self.offsets,
            &mut scratch.surface,
            |part| part.bytes().any(|byte| inside[byte] != 0),
            |part, kept, range| {
                scratch.part.clear();
                scratch.part.extend(kept.iter().map(|&position| candidates[position as usize]));
                let exact = matches!(self.measure, Measure::Exact);
                let id = exact.then(|| self.layers.uniform_over(&scratch.part, range)).flatten();
                alike &= id.is_some() && (only.is_none() || only == id);
                only = id;
                let Some(id) = id else { return false };
                for byte in part.bytes() {
                    mask[byte] = 0;
                    ids[byte * 8..byte * 8 + 8].fill(id.0);
                }
                true
            },
        );
        only.filter(|_| alike)
    }
}

/// Writes the masked voxels that are still background.
fn merge(voxels: &mut [u8; BRICK_VOXELS], mask: &[u8; BRICK_VOXELS / 8], id: impl Fn(usize) -> u8) {
    for (voxel, value) in voxels.iter_mut().enumerate() {
        if mask[voxel / 8] >> (voxel % 8) & 1 != 0 && *value == 0 {
            *value = id(voxel);
        }
    }
}
