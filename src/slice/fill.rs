//! One object into one block of voxels: the leaves of the descent that are voxels, and their fractions where those are
//! asked for.

use std::{borrow::Cow, iter, sync::Arc};

use glam::{DVec3, Vec2};

use super::{
    depth::{DistanceKind, Measure, MeasureScratch, SlabField},
    descent::{Bricks, DEPTH_MARGIN, Descent, DescentScratch, EMPTY, FULL, Leaves, Mask, is_set},
    dither::Dither,
    fractions::{FractionBlock, Measured},
    joined::{Joined, Whose},
};
use crate::{
    appearance::{BrickQuery, Filling, LayerField, SurfaceShare},
    mesh::Solid,
    sdf::{
        BlockBox, BrickOffsets, BrickSurface, DepthRange, Face, InsideRows, Part, SliceRuns, Surface, closest_point,
        nearest_in_parts,
    },
    voxel::{BRICK, BRICK_VOXELS, Block, BlockShape, BrickFractions, Lattice, MaterialId, ThresholdMask, Tile},
};

/// An object on the lattice: where it is, how deep, and what its layers are.
#[derive(Debug)]
pub struct ObjectField {
    /// Its own faces.
    surface: Arc<Surface>,
    /// The body it is part of, if it touches other objects.
    joined: Option<Joined>,
    inside: InsideRows,
    layers: Arc<LayerField>,
    pub(super) offsets: BrickOffsets,
    pub(super) uvs: Arc<[[Vec2; 3]]>,
    pub(super) lattice: Lattice,
    pub(super) shape: BlockShape,
    pub(super) measure: Measure,
    /// What mixtures are laid by; `None` without any.
    mask: Option<Arc<ThresholdMask>>,
    pub(super) dither: Option<Dither>,
}

/// Buffers of one worker.
#[derive(Default)]
pub struct FillScratch {
    pub(super) descent: DescentScratch,
    pub(super) leaf: LeafScratch,
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

/// Ranks where nothing is mixed.
const ALIKE: [u16; BRICK_VOXELS] = [0; BRICK_VOXELS];

/// An object's voxels in one block.
struct VoxelLeaves<'a> {
    field: &'a ObjectField,
    site: Site<'a>,
    block: &'a mut Block,
    fractions: Option<FractionBlock<'a>>,
    scratch: &'a mut LeafScratch,
}

impl ObjectField {
    /// Prepares an object, its layers laid by the exact distance, its boundaries at whole voxels; `None` for a mesh
    /// without triangles.
    pub fn new(solid: &Solid, lattice: Lattice, layers: LayerField) -> Option<Self> {
        let shape = BlockShape::for_lattice(&lattice);
        Some(Self {
            surface: Arc::new(Surface::new(&solid.mesh)?),
            joined: None,
            inside: InsideRows::new(solid, lattice, shape.voxels()[2]),
            uvs: if layers.needs_uv() { solid.mesh.uvs.clone().into() } else { Arc::default() },
            mask: layers.is_mixed().then(|| ThresholdMask::shared(lattice.pitch)),
            dither: None,
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
            joined: self.joined.clone(),
            inside: self.inside.resampled(lattice, shape.voxels()[2]),
            uvs: Arc::clone(&self.uvs),
            layers: Arc::clone(&self.layers),
            lattice,
            shape,
            offsets: BrickOffsets::new(&lattice),
            measure: self.measure.resampled(&lattice),
            mask: self.mask.clone(),
            dither: self.dither.as_ref().map(|dither| dither.resampled(self.around(), lattice.pitch)),
        }
    }

    /// The same object with other layers; `uvs` are the texture coordinates of its triangles, for layers that need
    /// them.
    pub fn with_layers(mut self, layers: LayerField, uvs: &[[Vec2; 3]]) -> Self {
        self.uvs = if layers.needs_uv() { uvs.into() } else { Arc::default() };
        self.layers = Arc::new(layers);
        self
    }

    /// Lays the layers by another distance, their boundaries at whole voxels: what dithers them was made for the distance
    /// before, so [`Self::with_dithered_boundaries`] comes after it.
    pub fn with_distance(mut self, kind: DistanceKind) -> Self {
        self.measure = Measure::new(kind, self.around(), &self.lattice);
        self.dither = None;
        self
    }

    /// Dithers the boundaries between layers, so that on average they lie at their depths and not at whole voxels. Only
    /// by the exact distance: others have steps or a width of their own.
    pub fn with_dithered_boundaries(mut self) -> Self {
        if matches!(self.measure, Measure::Exact) {
            let mask = ThresholdMask::shared(self.lattice.pitch);
            self.dither = Some(Dither::new(mask, self.around(), self.lattice.pitch));
        }
        self
    }

    /// Makes it part of a body; by the exact distance at whole voxels, as a new field is, for what other distances and
    /// dithered boundaries know of faces is by their numbers [around](Self::around) it, which change here.
    pub(super) fn set_joined(&mut self, joined: Joined) {
        self.joined = Some(joined);
        (self.measure, self.dither) = (Measure::Exact, None);
    }

    /// The objects that it is one body with, itself among them, by their places; `None` where it is alone.
    pub(super) fn members(&self) -> Option<&Arc<[usize]>> {
        self.joined.as_ref().map(|joined| &joined.members)
    }

    /// The closest-point structure of its own faces.
    pub fn surface(&self) -> &Arc<Surface> {
        &self.surface
    }

    /// The closest-point structure of all faces of the body that it is part of, which depth is measured from.
    pub fn around(&self) -> &Arc<Surface> {
        self.joined.as_ref().map_or(&self.surface, |joined| &joined.surface)
    }

    /// The body that it is part of, if it is of several objects.
    pub(super) fn joined(&self) -> Option<&Joined> {
        self.joined.as_ref()
    }

    /// The object's own number of a face [`around`](Self::around) it; `None` of another object's.
    pub fn own(&self, face: u32) -> Option<u32> {
        match &self.joined {
            None => Some(face),
            Some(Joined { own, .. }) => own.contains(&face).then(|| face - own.start),
        }
    }

    /// Whose some faces [`around`](Self::around) it are.
    pub(super) fn whose(&self, faces: &[u32]) -> Whose {
        self.joined.as_ref().map_or(Whose::Own, |joined| joined.whose(faces))
    }

    /// Takes the voxels of a brick that are nearest to a face of another object from its mask.
    fn leave_own(&self, candidates: &[u32], surface: &BrickSurface, mask: &mut Mask) {
        let Some(joined) = &self.joined else { return };
        for voxel in 0..BRICK_VOXELS {
            let face = is_set(mask, voxel).then(|| candidates[surface.candidate[voxel] as usize]);
            if face.is_some_and(|face| !joined.own.contains(&face)) {
                mask[voxel / 8] &= !(1 << (voxel % 8));
            }
        }
    }

    /// Faces around it by its own numbers; others' are given as some of its own.
    fn as_own<'a>(&self, faces: &'a [u32]) -> Cow<'a, [u32]> {
        match &self.joined {
            Some(joined) if self.layers.needs_uv() => joined.as_own(faces).into(),
            _ => faces.into(),
        }
    }

    /// The one filling of all depths in `range` under all of `faces`, all of them its own, if there is one for certain.
    pub(super) fn uniform_over(&self, faces: &[u32], range: DepthRange) -> Option<Filling> {
        self.layers.uniform_over(&self.as_own(faces), range)
    }

    /// The layers.
    pub fn layers(&self) -> &LayerField {
        &self.layers
    }

    /// Who shares in the layers below the point of a triangle nearest to `p`.
    pub fn shares(&self, triangle: u32, p: DVec3) -> [SurfaceShare; 4] {
        self.layers.shares(triangle, self.uv(triangle, p))
    }

    /// Texture coordinates of the point of a triangle nearest to `p`; 0 where the layers need none.
    pub(super) fn uv(&self, triangle: u32, p: DVec3) -> Vec2 {
        let [_, v, w] = closest_point(p, &self.surface.triangles()[triangle as usize]).barycentric;
        self.uv_at(triangle, [v as f32, w as f32])
    }

    /// Texture coordinates where the second and third corner of a triangle weigh `v` and `w`; 0 where the layers need
    /// none.
    #[inline(always)]
    fn uv_at(&self, triangle: u32, [v, w]: [f32; 2]) -> Vec2 {
        let Some(&[a, b, c]) = self.uvs.get(triangle as usize) else { return Vec2::ZERO };
        a + (b - a) * v + (c - a) * w
    }

    /// Texture coordinates for a voxel of the brick around `centre`, whose own centre is at `position`, by the nearest
    /// face around it; `face` keeps what is known of that one.
    #[inline(always)]
    pub(super) fn uv_in_brick(
        &self,
        triangle: u32,
        face: &mut Option<Face>,
        centre: DVec3,
        voxel: usize,
        position: impl FnOnce() -> DVec3,
    ) -> Vec2 {
        let radius = || f64::from(self.offsets.of(0).length());
        let face =
            face.get_or_insert_with(|| Face::new(&self.around().triangles()[triangle as usize], centre, radius()));
        let own = self.own(triangle).unwrap_or(0);
        match face.weights(self.offsets.of(voxel)) {
            Some(weights) => self.uv_at(own, weights),
            None => self.uv(own, position()),
        }
    }

    /// The depth of a voxel centred at `p` that lies on a boundary but for the rounding of `measured`: for the exact
    /// distance that to the nearest of the candidates in double precision, else `measured`.
    pub(super) fn exact_depth(&self, p: DVec3, candidates: &[u32], measured: f32) -> f64 {
        if self.dither.is_some() || !matches!(self.measure, Measure::Exact) {
            return f64::from(measured);
        }
        let triangles = self.around().triangles();
        let squared = |&t: &u32| closest_point(p, &triangles[t as usize]).distance_squared;
        candidates.iter().map(squared).fold(f64::INFINITY, f64::min).sqrt()
    }

    /// The closed surface that tells inside from outside.
    pub(crate) fn inside(&self) -> &InsideRows {
        &self.inside
    }

    /// Which voxels of the slices from `first` on are inside.
    pub fn fill_inside(&self, first: u32, slices: &mut [SliceRuns]) {
        self.inside.fill(first, slices);
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
    pub(super) fn descent(&self, first: [u32; 3]) -> Descent<'_> {
        Descent {
            surface: self.around(),
            joined: self.joined(),
            lattice: &self.lattice,
            shape: self.shape,
            first,
            slack: self.measure.slack(),
            core: self.layers.core(),
        }
    }

    /// Whether its voxels are drawn by lot: of mixtures, or at boundaries that are dithered.
    pub fn is_drawn_by_lot(&self) -> bool {
        self.layers.is_mixed() || self.dither.is_some()
    }

    /// The one filling of a box whose exact depths are in `range`, under `candidates`, if that is certain.
    pub(super) fn certain(
        &self,
        bounds: &BlockBox,
        range: DepthRange,
        candidates: &[u32],
        scratch: &mut MeasureScratch,
    ) -> Option<Filling> {
        let range = DepthRange { min: range.min - DEPTH_MARGIN, max: range.max + DEPTH_MARGIN };
        let range = self.measured(range, bounds, candidates, scratch)?;
        self.uniform_over(candidates, range)
    }

    /// Ranks of a brick's voxels, by the brick's place in the lattice.
    fn ranks(&self, brick: [u32; 3]) -> &[u16; BRICK_VOXELS] {
        self.mask.as_ref().map_or(&ALIKE, |mask| mask.brick(brick))
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
                            let blend = self.layers.blend(blend);
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
                    self.field.layers.blend(blend).lay(ranks, &mut ids);
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
        field.layers.fill_brick(query, |voxel| exact(voxel, surface.distance[voxel]), uv, &mut ids);
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
