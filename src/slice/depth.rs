//! The distances that layers can be laid by: exact, on the grid, Lp-averaged.
//!
//! Materials are decided on the measure alone; the surface point they come from is the one nearest to the voxel (exact,
//! Lp) or to the surface voxel nearest to it (grid). For a whole box the exact depth range is known (see
//! [`crate::sdf::cull`]); each measure says what follows for its own.

use std::{collections::HashMap, ops::Range, sync::Arc};

use glam::{DVec3, IVec3, Vec2};

use super::{
    descent::{DEPTH_MARGIN, EMPTY, Mask, is_set},
    dither::Dither,
    field::ObjectField,
    fill::{LeafScratch, Site},
    joined::runs_of,
};
use crate::{
    parallel,
    sdf::{
        BlockBox, Cells, DepthRange, FeatureWindow, LpField, LpOffsets, LpScratch, Reach, SLACK, SliceRuns, Surface,
        SurfaceVoxels, cell_centre, closest_point, for_cells,
    },
    voxel::{BRICK, BRICK_VOXELS, Lattice},
};

/// Positions that one thread looks at in one go.
const AT_ONCE: usize = 64;

/// Which distance layers are laid by.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum DistanceKind {
    /// To the triangles.
    #[default]
    Exact,
    /// From voxel centre to the centre of the nearest voxel that the surface passes through, as the paper does.
    Grid,
    /// Averaged over the surface with weight |x − y|^−p.
    Lp {
        /// p > 2.
        exponent: f64,
    },
}

/// A distance made ready for one object.
#[derive(Debug)]
pub(super) enum Measure {
    Exact,
    Grid {
        /// Half a voxel's diagonal, mm: the most it is off.
        bound: f64,
    },
    Lp {
        field: Arc<LpField>,
        offsets: Box<LpOffsets>,
    },
}

/// What an object knows of one slab. Buffers are kept from slab to slab.
#[derive(Debug, Default)]
pub struct SlabField {
    pub(super) runs: Vec<SliceRuns>,
    voxels: SurfaceVoxels,
}

/// Buffers of one worker for one measure.
#[derive(Default)]
pub(super) struct MeasureScratch {
    lp: LpScratch,
    window: FeatureWindow,
    /// What the window is to reach, mm, while it waits for the block's first voxel that needs it.
    unopened: Option<f64>,
    /// Nearest triangle and texture coordinates of surface voxels.
    points: HashMap<IVec3, (u32, Vec2)>,
    /// Triangle per voxel.
    pub(super) triangles: Vec<u32>,
    /// Texture coordinates of each voxel's surface point by the grid.
    pub(super) uvs: Vec<Vec2>,
}

impl Measure {
    pub(super) fn new(kind: DistanceKind, surface: &Surface, lattice: &Lattice) -> Self {
        match kind {
            DistanceKind::Exact => Self::Exact,
            DistanceKind::Grid => Self::grid(lattice),
            DistanceKind::Lp { exponent } => Self::Lp {
                field: Arc::new(LpField::new(surface.triangles(), exponent)),
                offsets: Box::new(LpOffsets::new(lattice)),
            },
        }
    }

    /// The same distance on another lattice; the grid's is measured on the new one.
    pub(super) fn resampled(&self, lattice: &Lattice) -> Self {
        match self {
            Self::Exact => Self::Exact,
            Self::Grid { .. } => Self::grid(lattice),
            Self::Lp { field, .. } => Self::Lp { field: Arc::clone(field), offsets: Box::new(LpOffsets::new(lattice)) },
        }
    }

    fn grid(lattice: &Lattice) -> Self {
        // The slack of a voxel's walls moves a surface point by as much.
        Self::Grid { bound: lattice.pitch.length() / 2.0 + SLACK }
    }

    /// By how much a triangle may be further than the nearest one and still lend a voxel its layers, mm: the surface
    /// voxel is at most `bound` further than the surface, and its nearest triangle at most `bound` from it.
    pub(super) fn slack(&self) -> f64 {
        if let Self::Grid { bound } = self { 2.0 * bound + SLACK } else { SLACK }
    }
}

impl SlabField {
    /// Prepares `object` for `slices`, those of one slab.
    pub fn prepare(&mut self, object: &ObjectField, slices: Range<u32>) {
        self.runs.resize(slices.len(), SliceRuns::default());
        object.fill_inside(slices.start, &mut self.runs);
        if let Measure::Grid { .. } = object.measure {
            let reach = object.layers().thickness();
            self.voxels.rebuild(object.surface().triangles(), &object.lattice, slices, reach);
        }
    }

    /// The same for those of `objects` that are one body; they are measured alike.
    pub(super) fn prepare_body(&mut self, objects: &[ObjectField], members: &[usize], slices: Range<u32>) {
        let all = members.iter().map(|&member| &objects[member]);
        self.runs = runs_of(all.clone().map(|object| {
            let mut runs = vec![SliceRuns::default(); slices.len()];
            object.fill_inside(slices.start, &mut runs);
            runs
        }));
        let first = &objects[members[0]];
        if let Measure::Grid { .. } = first.measure {
            let reach = all.map(|object| object.layers().thickness()).fold(0.0, f64::max);
            self.voxels.rebuild(first.around().triangles(), &first.lattice, slices, reach);
        }
    }
}

impl ObjectField {
    /// Unsigned distance of each of `positions` by the object's measure, mm; inside it is the depth.
    ///
    /// At voxel centres it is what slices are made of, up to rounding (Lp: up to [`crate::sdf::RELATIVE_ERROR`]).
    pub fn depth_over(&self, positions: &[DVec3], depths: &mut [f64]) {
        parallel::rows(depths, AT_ONCE, |n, depths| {
            let mut scratch = LpScratch::default();
            for (depth, p) in depths.iter_mut().zip(&positions[n * AT_ONCE..]) {
                *depth = self.depth_at(*p, &mut scratch);
            }
        });
    }

    /// See [`Self::depth_over`].
    pub fn depth_at(&self, p: DVec3, scratch: &mut LpScratch) -> f64 {
        let exact = self.around().closest(p).distance;
        match &self.measure {
            Measure::Exact => exact,
            Measure::Lp { field, .. } => field.distance(self.around().triangles(), p, exact, scratch),
            Measure::Grid { bound } => self.grid_depth(p, exact, *bound),
        }
    }

    /// Distance to the nearest centre of a surface voxel: it is within `exact` + `bound`, its triangles `bound`
    /// further.
    fn grid_depth(&self, p: DVec3, exact: f64, bound: f64) -> f64 {
        let reach = DVec3::splat(exact + bound);
        let within = Cells::around(&self.lattice, p - reach, p + reach);
        let best = std::cell::Cell::new(f64::INFINITY);
        let mut near = Vec::new();
        self.around().within(p, exact + self.measure.slack(), &mut near);
        for triangle in near {
            let nearer = |low: DVec3, high: DVec3| p.clamp(low, high).distance_squared(p) < best.get();
            for_cells(&self.lattice, &self.around().triangles()[triangle as usize], &within, nearer, |cell| {
                best.set(best.get().min(cell_centre(&self.lattice, cell).distance_squared(p)));
            });
        }
        best.get().sqrt()
    }

    /// Prepares the measure for a block with these bounds, `nearest` mm from the surface at its centre; false if all
    /// of it is certain to lie below the layers.
    pub(super) fn enter_block(&self, bounds: &BlockBox, nearest: f64, scratch: &mut MeasureScratch) -> bool {
        let thickness = self.layers().thickness();
        if let Measure::Grid { bound } = &self.measure {
            scratch.unopened = Some((nearest + bounds.radius() + bound).min(thickness));
        }
        let dithered = self.dither.as_ref().map_or(0.0, Dither::reach);
        self.shallowest(bounds, nearest, scratch) <= thickness + dithered + DEPTH_MARGIN
    }

    /// A lower bound of the measure in a box `nearest` mm from the surface at its centre, mm.
    pub(super) fn shallowest(&self, bounds: &BlockBox, nearest: f64, scratch: &mut MeasureScratch) -> f64 {
        let radius = bounds.radius();
        match &self.measure {
            Measure::Exact => nearest - radius,
            Measure::Grid { bound } => nearest - radius - bound,
            Measure::Lp { field, .. } => {
                let averaged = || field.distance(self.around().triangles(), bounds.centre, nearest, &mut scratch.lp);
                let range = (radius < nearest).then(averaged).and_then(|a| field.range_within(a, nearest, radius));
                range.map_or(0.0, |range| range.0)
            }
        }
    }

    /// What the measure can be where the exact distance is in `exact`; `None` if that takes too long to tell.
    /// `candidates` hold the nearest triangles.
    pub(super) fn measured(
        &self,
        exact: DepthRange,
        bounds: &BlockBox,
        candidates: &[u32],
        scratch: &mut MeasureScratch,
    ) -> Option<DepthRange> {
        match &self.measure {
            Measure::Exact => Some(self.dither.as_ref().map_or(exact, |dither| dither.moved(exact, candidates))),
            Measure::Grid { bound } => Some(DepthRange { min: (exact.min - bound).max(0.0), max: exact.max + bound }),
            Measure::Lp { field, .. } => {
                // Where the exact depth has several answers, this one, wider, is not worth its price.
                self.uniform_over(candidates, exact)?;
                let triangles = self.around().triangles();
                let squared = candidates.iter().map(|&t| closest_point(bounds.centre, &triangles[t as usize]));
                let nearest = squared.map(|found| found.distance_squared).fold(f64::INFINITY, f64::min).sqrt();
                if bounds.radius() >= nearest {
                    return None;
                }
                let averaged = field.distance(triangles, bounds.centre, nearest, &mut scratch.lp);
                let (min, max) = field.range_within(averaged, nearest, bounds.radius())?;
                Some(DepthRange { min, max })
            }
        }
    }

    /// Measures the masked voxels of the brick at `at`, around `centre`, where it is not by the exact distance: by the
    /// Lp-averaged one from exact ones.
    pub(super) fn measure_brick(
        &self,
        site: Site<'_>,
        at: [usize; 3],
        centre: DVec3,
        masks: &[Mask],
        scratch: &mut LeafScratch,
    ) {
        match &self.measure {
            Measure::Exact => {}
            Measure::Lp { .. } => self.measure_lp(centre, &masks[self.shape.brick_index(at)], scratch),
            Measure::Grid { .. } => self.measure_grid(site, at, masks, scratch),
        }
    }

    /// Measures the masked voxels of the brick at `brick` of a block with these masks by the grid; the triangle of each
    /// goes to `triangles`, at the voxel's place.
    fn measure_grid(&self, site: Site<'_>, brick: [usize; 3], masks: &[Mask], scratch: &mut LeafScratch) {
        let LeafScratch { measure, surface, .. } = scratch;
        if let Some(reach) = measure.unopened.take() {
            self.open_window(site, reach, masks, measure);
        }
        let (mask, thickness) = (&masks[self.shape.brick_index(brick)], self.layers().thickness());
        measure.triangles.clear();
        measure.triangles.resize(BRICK_VOXELS, 0);
        measure.uvs.resize(BRICK_VOXELS, Vec2::ZERO);
        for voxel in (0..BRICK_VOXELS).filter(|&voxel| is_set(mask, voxel)) {
            let at: [i32; 3] = std::array::from_fn(|axis| {
                site.first[axis] as i32 + (brick[axis] * BRICK + (voxel >> (3 * axis) & 7)) as i32
            });
            surface.candidate[voxel] = voxel as u32;
            // Out of reach is below all layers; the greatest number that is not infinite says so.
            surface.distance[voxel] = f32::MAX;
            let feature = measure.window.feature(IVec3::from(at));
            if self.members().is_some() {
                // Below all layers too it matters whose the nearest face is.
                let near = feature
                    .map_or_else(|| self.lattice.centre(at.map(|n| n as u32)), |cell| cell_centre(&self.lattice, cell));
                measure.triangles[voxel] = self.around().closest(near).triangle;
            }
            let Some(feature) = feature else { continue };
            let distance = ((feature - IVec3::from(at)).as_dvec3() * self.lattice.pitch).length();
            surface.distance[voxel] = distance as f32;
            if self.layers().needs_uv() && distance <= thickness {
                let (triangle, uv) = *measure.points.entry(feature).or_insert_with(|| self.point_of(feature));
                measure.triangles[voxel] = triangle;
                measure.uvs[voxel] = uv;
            }
        }
        surface.error = 0.0;
    }

    /// Computes the feature transform of all bricks of a block that hold inside voxels.
    fn open_window(&self, site: Site<'_>, reach: f64, masks: &[Mask], measure: &mut MeasureScratch) {
        let [width, height, _] = self.shape.0;
        let (mut low, mut high) = (IVec3::MAX, IVec3::MIN);
        for (n, _) in masks.iter().enumerate().filter(|(_, mask)| **mask != EMPTY) {
            let brick = IVec3::new((n % width) as i32, (n / width % height) as i32, (n / (width * height)) as i32);
            (low, high) = (low.min(brick), high.max(brick + 1));
        }
        let block = IVec3::from(site.first.map(|n| n as i32));
        let first = block + low * BRICK as i32;
        let end = (block + high * BRICK as i32).min(IVec3::from(self.lattice.dims.map(|n| n as i32)));
        let reach = Reach { columns: site.slab.voxels.bounds(), distance: reach };
        let nearest = |x, y, z| site.slab.voxels.nearest(x, y, z);
        let size = (end - first).to_array().map(|n| n as usize);
        measure.window.compute(self.lattice.pitch, first, size, reach, nearest);
        measure.points.clear();
    }

    /// Measures the masked voxels of the brick around `centre` by the Lp-averaged distance; needs their exact ones.
    fn measure_lp(&self, centre: DVec3, mask: &Mask, scratch: &mut LeafScratch) {
        let Measure::Lp { field, offsets } = &self.measure else { return };
        let LeafScratch { measure, surface, .. } = scratch;
        field.fill_brick(self.around().triangles(), centre, offsets, mask, surface, &mut measure.lp);
    }

    /// Triangle and texture coordinates of the surface point nearest to the centre of a surface voxel.
    fn point_of(&self, feature: IVec3) -> (u32, Vec2) {
        let centre = cell_centre(&self.lattice, feature);
        let found = self.around().closest(centre);
        let uv = self.own(found.triangle).map_or(Vec2::ZERO, |own| self.uv(own, centre));
        (found.triangle, uv)
    }
}
