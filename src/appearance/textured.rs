//! Layers that vary over the surface: thicknesses interpolated between texels.
//!
//! Every texel names one of a table of stackings that are aligned to one sequence of slots (Hašan et al. 2010, section
//! 7.1), so that interpolating depths of the slots' bottoms interpolates thicknesses, never materials. A position takes
//! the four texels around its nearest surface point, bilinearly, leaving out texels of other charts; limits are imposed
//! again afterwards. Across a border of materials ([`TexturedLayers::parted`]) nothing is interpolated.
//!
//! For every triangle the range of each bottom under it is kept. A box of voxels whose depths fall between the ranges
//! of all its candidates has one material, whatever the texels in detail. The shares of a mixture are interpolated
//! likewise, and of them, too, the ranges are kept: most ranks are one resin anywhere under a triangle.

use glam::Vec2;
use multiversion::multiversion;

use super::{
    ClusterId,
    blends::Shares,
    borders::{BORDER, Borders},
    charts::{Atlas, Place, for_covered_texels, wrap},
    filling::{Blend, Filling},
    layers::BrickQuery,
    lookups::{SurfaceTexel, resolve},
    slots::{SlotFilling, SlotRanges, SlotTable},
};
use crate::{
    mesh::TriangleMesh,
    parallel,
    sdf::{DepthRange, PART_COLUMNS, PART_SLICES, Part},
    voxel::{BRICK_VOXELS, MaterialId},
};

/// Which stacking every texel of a page has: that of its cluster; row 0 on top. Texels that no triangle covers do not
/// matter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelMap(pub Vec<ClusterId>);

/// A texel: whose stacking, and whose chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Texel {
    pub(super) label: u16,
    pub(super) chart: u16,
}

/// One texture among the texels of all.
#[derive(Debug, Clone, Copy)]
pub(super) struct Page {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) start: usize,
}

/// The layers of a textured object.
#[derive(Debug, Clone)]
pub struct TexturedLayers {
    pub(super) slots: SlotTable,
    pub(super) pages: Vec<Page>,
    pub(super) texels: Vec<Texel>,
    /// Where materials end.
    pub(super) borders: Borders,
    /// Page and chart of every triangle.
    pub(super) places: Vec<Place>,
    /// Per triangle the least and then the greatest bottom of every slot, mm.
    ranges: Vec<f32>,
    /// The certain stretches under triangle t: `stretches[starts[t]..starts[t + 1]]`.
    stretches: Vec<Stretch>,
    starts: Vec<u32>,
    /// What is known of the shares in the mixtures under every triangle, one for each slot of them.
    shares: Vec<Shares>,
    /// The levels that go with them, see [`super::blends::BlendTable::levels`]; all slots of a triangle together.
    levels: Vec<[u16; 2]>,
    /// Where each slot's levels begin among those of a triangle, and where they end.
    level_starts: Vec<usize>,
    /// Distinct shares of all slots, and where those of each slot begin.
    blends: Vec<Blend>,
    blend_starts: Vec<u16>,
}

/// Depths, from one (mm) to below another, that are one material for certain.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    from: f32,
    to: f32,
    /// Or the mark of a mixture.
    id: MaterialId,
}

/// Marks voxels whose texels decide; the background's id, which no slot has.
const UNCERTAIN: u8 = MaterialId::BACKGROUND.0;

/// How far outside its triangle, in texels, a point may take a texel from: the diagonal of the bilinear footprint and
/// rounding.
const FOOTPRINT: f32 = 1.5;
/// How far outside its triangle, in texels, the middle of the square of four texels may lie that a point is in: half
/// the diagonal, and rounding.
const HALF_CELL: f32 = 0.75;

impl TexturedLayers {
    /// Most candidates of a brick that are looked at one by one; there are rarely more.
    const CANDIDATES: usize = 64;

    /// Lays one label map per page over an atlas of `mesh`; every label is a row of `slots`.
    pub fn new(mesh: &TriangleMesh, atlas: &Atlas, labels: &[LabelMap], slots: SlotTable) -> Self {
        let mut layers = Self {
            slots,
            pages: Vec::new(),
            texels: Vec::new(),
            borders: Borders::default(),
            places: atlas.places().to_vec(),
            ranges: Vec::new(),
            stretches: Vec::new(),
            starts: vec![0],
            shares: Vec::new(),
            levels: Vec::new(),
            level_starts: vec![0],
            blends: Vec::new(),
            blend_starts: Vec::new(),
        };
        for mixed in layers.slots.mixed() {
            layers.level_starts.push(layers.level_starts.last().copied().unwrap_or_default() + mixed.ids().len() - 1);
            layers.blend_starts.push(layers.blends.len() as u16);
            layers.blends.extend_from_slice(mixed.blends());
        }
        for (page, labels) in atlas.pages().iter().zip(labels) {
            layers.pages.push(Page { width: page.width, height: page.height, start: layers.texels.len() });
            let texels = page.source.iter().zip(&page.chart);
            layers.texels.extend(texels.map(|(&source, &chart)| Texel { label: labels.0[source as usize].0, chart }));
        }
        (layers.ranges, layers.shares, layers.levels) = layers.under_triangles(mesh);
        for triangle in 0..mesh.triangles.len() as u32 {
            let ranges = layers.ranges_over(&[triangle]);
            let (slots, stretches) = (&layers.slots, &mut layers.stretches);
            slots.for_certain_depths(&ranges, |from, to, filling| {
                let id = match filling {
                    SlotFilling::Pure(id) => id,
                    SlotFilling::Mixed(place) => slots.mixed()[place].mark(),
                };
                stretches.push(Stretch { from, to, id });
            });
            layers.starts.push(layers.stretches.len() as u32);
        }
        layers
    }

    /// The chart of a texel, counted through all pages.
    #[inline(always)]
    fn chart(&self, texel: usize) -> u16 {
        match self.texels[texel].chart {
            // What a page of nodes leaves empty has that number too.
            BORDER => self.borders.charts.get(texel).copied().unwrap_or(BORDER),
            chart => chart,
        }
    }

    /// Depth below which every stacking has ended, mm.
    pub fn thickness(&self) -> f64 {
        self.slots.thickness()
    }

    /// What fills the inside below all layers.
    pub fn core(&self) -> MaterialId {
        self.slots.core()
    }

    /// What is known under every triangle: ranges of bottoms, shares of mixtures, and their levels.
    fn under_triangles(&self, mesh: &TriangleMesh) -> (Vec<f32>, Vec<Shares>, Vec<[u16; 2]>) {
        let stride = self.slots.stride();
        let mixed = self.slots.mixed();
        let mut ranges = vec![0.0; mesh.triangles.len() * 2 * stride];
        let of_triangle = |triangle: usize, range: &mut [f32]| {
            let labels = &mut Vec::new();
            self.labels_under(self.places[triangle], &mesh.uvs[triangle], labels);
            let (low, high) = range.split_at_mut(stride);
            low.fill(f32::INFINITY);
            high.fill(f32::NEG_INFINITY);
            for &label in labels.iter() {
                for (slot, &bottom) in self.slots.bottoms(label).iter().enumerate() {
                    low[slot] = low[slot].min(bottom);
                    high[slot] = high[slot].max(bottom);
                }
            }
            let mut levels = Vec::new();
            if labels.is_empty() {
                // Texture coordinates that are not numbers: nothing can be said.
                low.fill(f32::NEG_INFINITY);
                high.fill(f32::INFINITY);
                levels.resize(self.level_starts[mixed.len()], [0, u16::MAX]);
                return (vec![Shares::Vary; mixed.len()], levels);
            }
            mixed.iter().for_each(|slot| slot.levels(labels, &mut levels));
            (mixed.iter().map(|slot| slot.shares(labels)).collect(), levels)
        };
        let mut known: Vec<(Vec<Shares>, Vec<[u16; 2]>)> = Vec::new();
        if mixed.is_empty() {
            parallel::rows(&mut ranges, 2 * stride, |triangle, range| drop(of_triangle(triangle, range)));
        } else {
            known = parallel::map_rows(&mut ranges, 2 * stride, of_triangle);
        }
        let (shares, levels): (Vec<_>, Vec<_>) = known.into_iter().unzip();
        (ranges, shares.concat(), levels.concat())
    }

    /// Replaces `labels` by those of all texels that count under a triangle, each once.
    fn labels_under(&self, Place { page, chart }: Place, uvs: &[Vec2; 3], labels: &mut Vec<u16>) {
        labels.clear();
        let page = self.pages[usize::from(page)];
        let scale = Vec2::new(page.width as f32, page.height as f32);
        let texel = |x: i32, y: i32| {
            let (x, y) = (wrap(x, page.width) as usize, wrap(y, page.height) as usize);
            self.texels[page.start + x + page.width as usize * y]
        };
        let corners = uvs.map(|uv| uv * scale - Vec2::splat(0.5));
        for_covered_texels(corners, FOOTPRINT, scale, |x, y| {
            let here = texel(x, y);
            if here.chart == chart {
                labels.push(here.label);
            }
        });
        // Where none of the four texels around a point is of the chart, all count (see `Footprint`).
        for_covered_texels(corners.map(|c| c - Vec2::splat(0.5)), HALF_CELL, scale, |x, y| {
            let four = [texel(x, y), texel(x + 1, y), texel(x, y + 1), texel(x + 1, y + 1)];
            if four.iter().all(|t| t.chart != chart) {
                labels.extend(four.map(|t| t.label));
            }
        });
        labels.sort_unstable();
        labels.dedup();
    }

    /// See [`super::LayerField::uniform_over`].
    pub fn uniform_over(&self, triangles: &[u32], range: DepthRange) -> Option<Filling> {
        // What is certain under all is certain under each; that is quick to ask, and mostly ends it.
        let [min, max] = SlotTable::rounded_out(range);
        let certain = |&triangle: &u32| self.stretches_under(triangle).iter().any(|s| s.from <= min && max < s.to);
        if !triangles.iter().all(certain) {
            return None;
        }
        match self.slots.certain(&self.ranges_over(triangles), range)? {
            SlotFilling::Pure(id) => Some(Filling::Pure(id)),
            SlotFilling::Mixed(place) => {
                let count = self.slots.mixed().len();
                let shares = triangles.iter().map(|&triangle| self.shares[triangle as usize * count + place]);
                match shares.fold(Shares::Absent, Shares::and) {
                    Shares::Fixed(blend) => Some(Filling::Mixed(self.blend_starts[place] + blend)),
                    Shares::Absent | Shares::Vary => None,
                }
            }
        }
    }

    /// See [`super::LayerField::blend`].
    pub fn blend(&self, blend: u16) -> &Blend {
        &self.blends[usize::from(blend)]
    }

    /// See [`super::LayerField::is_mixed`].
    pub fn is_mixed(&self) -> bool {
        !self.slots.mixed().is_empty()
    }

    /// The resin that voxels of a rank have in a mixture everywhere under a triangle; [`UNCERTAIN`] if there is none.
    #[inline(always)]
    fn resin_under(&self, triangle: u32, place: usize, rank: u16) -> MaterialId {
        let all = self.level_starts[self.slots.mixed().len()];
        let [start, end] = [0, 1].map(|end| triangle as usize * all + self.level_starts[place + end]);
        let levels = &self.levels[start..end];
        let ids = self.slots.mixed()[place].ids();
        let passed = levels.iter().map(|level| usize::from(rank >= level[1])).sum::<usize>();
        match levels.get(passed) {
            Some(level) if rank >= level[0] => MaterialId(UNCERTAIN),
            _ => ids[passed],
        }
    }

    #[inline(always)]
    fn stretches_under(&self, triangle: u32) -> &[Stretch] {
        let [start, end] = [0, 1].map(|end| self.starts[triangle as usize + end] as usize);
        &self.stretches[start..end]
    }

    /// Least and greatest bottom of every slot under any of `triangles`.
    fn ranges_over(&self, triangles: &[u32]) -> SlotRanges {
        let stride = self.slots.stride();
        let mut low = [f32::INFINITY; SlotTable::MAX_STRIDE];
        let mut high = [f32::NEG_INFINITY; SlotTable::MAX_STRIDE];
        for &triangle in triangles {
            let start = triangle as usize * 2 * stride;
            let (lows, highs) = self.ranges[start..start + 2 * stride].split_at(stride);
            for slot in 0..stride {
                low[slot] = low[slot].min(lows[slot]);
                high[slot] = high[slot].max(highs[slot]);
            }
        }
        SlotRanges { low, high }
    }

    /// The material at texture coordinates `uv` of triangle `triangle`, `depth` mm below the surface, where a mixture
    /// is asked by a voxel of rank `rank` of its [mask](crate::voxel::ThresholdMask).
    pub fn material(&self, triangle: u32, uv: Vec2, depth: f32, rank: u16) -> MaterialId {
        let footprint = self.footprint(triangle, uv.x, uv.y);
        let slot = self.slots.slot(&mut [0.0; SlotTable::MAX_STRIDE], &footprint, depth);
        self.slots.material_in(slot, &footprint, rank)
    }

    /// See [`super::LayerField::slot_ids`].
    pub fn slot_ids(&self) -> &[MaterialId] {
        self.slots.ids()
    }

    /// See [`super::LayerField::bottoms`].
    pub fn bottoms(&self, triangle: u32, uv: Vec2, row: &mut Vec<f32>) {
        let mut scratch = [0.0; SlotTable::MAX_STRIDE];
        let slots = self.slots.ids().len() - 1;
        row.clear();
        row.extend_from_slice(&self.slots.row(&mut scratch, &self.footprint(triangle, uv.x, uv.y), 0.0)[..slots]);
    }

    /// See [`super::LayerField::fill_brick`].
    ///
    /// Most voxels lie in a stretch of depth that is one material under their triangle; only the others look up texels.
    pub fn fill_brick(
        &self,
        query: BrickQuery<'_>,
        mut uv: impl FnMut(u32, usize) -> Vec2,
        out: &mut [u8; BRICK_VOXELS],
    ) {
        let surface = query.surface;
        let mut ids = [UNCERTAIN; BRICK_VOXELS];
        if query.candidates.len() <= Self::CANDIDATES {
            for part in Part::all().filter(|part| part.bytes().any(|byte| query.mask[byte] != 0)) {
                paint_part(self, query, part, &mut ids);
            }
        } else {
            self.slots.for_certain_depths(&self.ranges_over(query.candidates), |from, to, filling| {
                if let SlotFilling::Pure(id) = filling {
                    paint(&surface.distance, from + surface.error, to - surface.error, id.0, &mut ids);
                }
            });
        }
        let mut points = [SurfaceTexel::default(); BRICK_VOXELS];
        let mut count = 0;
        for (row, &mask) in query.mask.iter().enumerate() {
            let mut rest = mask;
            while rest != 0 {
                let voxel = row * 8 + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                out[voxel] = ids[voxel];
                if ids[voxel] == UNCERTAIN {
                    let candidate = surface.candidate[voxel];
                    let triangle = query.candidates[candidate as usize];
                    let (uv, depth) = (uv(candidate, voxel), surface.distance[voxel]);
                    let rank = query.ranks[voxel];
                    points[count] = SurfaceTexel { voxel: voxel as u32, triangle, uv, depth, rank };
                    count += 1;
                }
            }
        }
        resolve(self, &points[..count], out);
    }

    /// The stackings of the four texels around a point and their weights; see [`Self::texels_around`].
    #[inline(always)]
    pub(super) fn footprint(&self, triangle: u32, u: f32, v: f32) -> Footprint {
        let (texels, weights) = self.texels_around(triangle, u, v);
        Footprint { labels: texels.map(|texel| self.texels[texel].label), weights }
    }

    /// The four texels around a point, counted through all pages, and their weights; texels of other charts weigh
    /// nothing, unless all four are, and so do those beyond a border.
    #[inline(always)]
    pub(super) fn texels_around(&self, triangle: u32, u: f32, v: f32) -> ([usize; 4], [f32; 4]) {
        let Place { page, chart } = self.places[triangle as usize];
        let Page { width, height, start } = self.pages[usize::from(page)];
        let (x, y) = (u * width as f32 - 0.5, v * height as f32 - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let (x0, y0) = (x0 as i32, y0 as i32);
        let (left, right) = (wrap_near(x0, width), wrap_near(x0.wrapping_add(1), width));
        let (top, bottom) = (wrap_near(y0, height), wrap_near(y0.wrapping_add(1), height));
        let row = |y: u32| start + y as usize * width as usize;
        let texel = |x: u32, row: usize| x as usize + row;
        let texels =
            [texel(left, row(top)), texel(right, row(top)), texel(left, row(bottom)), texel(right, row(bottom))];
        let mut weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
        let mut own = texels.map(|texel| self.chart(texel) == chart);
        if !self.borders.are_none() {
            // What differs much from the nearest is another material.
            let mine = (0..4).filter(|&n| own[n]).reduce(|best, n| if weights[n] > weights[best] { n } else { best });
            if let Some(nearest) = mine.map(|n| self.texels[texels[n]].label) {
                (0..4).for_each(|n| own[n] &= !self.borders.part(nearest, self.texels[texels[n]].label));
            }
        }
        if own != [true; 4] && own.contains(&true) {
            let owned: f32 = weights.iter().zip(own).filter(|(_, own)| *own).map(|(w, _)| w).sum();
            let count = own.iter().filter(|own| **own).count() as f32;
            for (weight, own) in weights.iter_mut().zip(own) {
                let share = if owned > 0.0 { *weight / owned } else { 1.0 / count };
                *weight = if own { share } else { 0.0 };
            }
        }
        (texels, weights)
    }

    /// The stacking of a texel, counted through all pages.
    pub(super) fn label(&self, texel: usize) -> u16 {
        self.texels[texel].label
    }
}

/// Texels that share in a point's layers; the weights sum to 1.
#[derive(Debug, Clone, Copy)]
pub struct Footprint {
    /// Stackings of the texels.
    pub labels: [u16; 4],
    /// Their shares.
    pub weights: [f32; 4],
}

impl Footprint {
    /// The weighted mean of a value of each texel.
    #[inline(always)]
    pub fn mean(&self, values: [f32; 4]) -> f32 {
        let [a, b, c, d] = self.weights;
        a * values[0] + b * values[1] + c * values[2] + d * values[3]
    }

    /// The one stacking of all texels that count, if there is only one.
    #[inline(always)]
    pub fn single(&self) -> Option<u16> {
        let mut label = None;
        for (&candidate, &weight) in self.labels.iter().zip(&self.weights) {
            if weight > 0.0 {
                match label {
                    None => label = Some(candidate),
                    Some(label) if label != candidate => return None,
                    Some(_) => {}
                }
            }
        }
        label
    }
}

/// [`wrap`] for indices that mostly need none.
#[inline(always)]
fn wrap_near(index: i32, size: u32) -> u32 {
    if (index as u32) < size { index as u32 } else { wrap(index, size) }
}

/// Gives the voxels whose depth is from `from` to below `to` an id.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn paint(depths: &[f32; BRICK_VOXELS], from: f32, to: f32, id: u8, out: &mut [u8; BRICK_VOXELS]) {
    for (out, &depth) in out.iter_mut().zip(depths) {
        *out = if (depth >= from) & (depth < to) { id } else { *out };
    }
}

/// Gives the voxels of a part that lie in a certain stretch under their own triangle its id. At most
/// [`TexturedLayers::CANDIDATES`] are candidates.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn paint_part(layers: &TexturedLayers, query: BrickQuery<'_>, part: Part, out: &mut [u8; BRICK_VOXELS]) {
    const LANES: usize = PART_COLUMNS * PART_SLICES;
    let surface = query.surface;
    let (mut depth, mut nearest, mut ids) = ([0.0; LANES], [0; LANES], [u32::from(UNCERTAIN); LANES]);
    for (n, row) in part.rows().enumerate() {
        let lanes = n * PART_COLUMNS..(n + 1) * PART_COLUMNS;
        depth[lanes.clone()].copy_from_slice(&surface.distance[row.clone()]);
        nearest[lanes].copy_from_slice(&surface.candidate[row]);
    }
    // The candidates that are nearest somewhere, a bit each.
    let mut rest = 0_u64;
    for candidate in &nearest {
        rest |= 1 << (candidate & 63);
    }
    while rest != 0 {
        let candidate = rest.trailing_zeros();
        rest &= rest - 1;
        let Some(&triangle) = query.candidates.get(candidate as usize) else { continue };
        for &Stretch { from, to, id } in layers.stretches_under(triangle) {
            let (from, to, id) = (from + surface.error, to - surface.error, u32::from(id.0));
            for lane in 0..LANES {
                let certain = (depth[lane] >= from) & (depth[lane] < to) & (nearest[lane] == candidate);
                ids[lane] = if certain { id } else { ids[lane] };
            }
        }
    }
    for (n, row) in part.rows().enumerate() {
        for (out, id) in out[row].iter_mut().zip(&ids[n * PART_COLUMNS..]) {
            *out = *id as u8;
        }
    }
    for (place, mixed) in layers.slots.mixed().iter().enumerate() {
        let mark = mixed.mark().0;
        for voxel in part.rows().flatten() {
            if out[voxel] == mark {
                let triangle = query.candidates[surface.candidate[voxel] as usize];
                out[voxel] = layers.resin_under(triangle, place, query.ranks[voxel]).0;
            }
        }
    }
}
