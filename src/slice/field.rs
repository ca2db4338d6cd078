//! An object on the lattice, and what any way of laying it asks: whose a face is, where on a texture a point is, how
//! deep a voxel lies.

use std::{borrow::Cow, sync::Arc};

use glam::{DVec3, Vec2};

use super::{
    depth::{DistanceKind, Measure, MeasureScratch},
    descent::DEPTH_MARGIN,
    dither::Dither,
    joined::{Joined, Whose},
};
use crate::{
    appearance::{Filling, LayerField, SurfaceShare},
    mesh::Solid,
    sdf::{BlockBox, BrickOffsets, DepthRange, Face, InsideRows, SliceRuns, Surface, closest_point},
    voxel::{BRICK_VOXELS, BlockShape, Lattice, ThresholdMask},
};

/// Ranks where nothing is mixed.
const ALIKE: [u16; BRICK_VOXELS] = [0; BRICK_VOXELS];

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
    uvs: Arc<[[Vec2; 3]]>,
    pub(super) lattice: Lattice,
    pub(super) shape: BlockShape,
    pub(super) measure: Measure,
    /// What mixtures are laid by; `None` without any.
    mask: Option<Arc<ThresholdMask>>,
    pub(super) dither: Option<Dither>,
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

    /// Lays the layers by another distance, their boundaries at whole voxels: what dithers them was made for the
    /// distance before, so [`Self::with_dithered_boundaries`] comes after it.
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

    /// Faces around it by its own numbers; others' are given as some of its own.
    pub(super) fn as_own<'a>(&self, faces: &'a [u32]) -> Cow<'a, [u32]> {
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
    pub(super) fn ranks(&self, brick: [u32; 3]) -> &[u16; BRICK_VOXELS] {
        self.mask.as_ref().map_or(&ALIKE, |mask| mask.brick(brick))
    }
}
