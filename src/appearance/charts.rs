//! UV charts: which texels belong together on the surface.
//!
//! A chart is a set of triangles joined by edges with the same texture coordinates on both sides. Texels of different
//! charts may lie side by side in the image and far apart on the object, so nothing may be interpolated between them.

use std::collections::HashMap;

use glam::Vec2;

use crate::{disjoint_sets::DisjointSets, mesh::TriangleMesh};

/// Most charts told apart; the rest share the last number. An atlas of 65,535 charts has a texel or two for each.
const MAX_CHARTS: u32 = u16::MAX as u32;

/// The chart of every triangle, numbered by first triangle; charts end where the page changes.
fn charts(mesh: &TriangleMesh, page_of: &[u16]) -> Vec<u16> {
    let mut sets = DisjointSets::new(mesh.triangles.len());
    /// Position and texture coordinates, bit for bit.
    type End = (u32, [u32; 2]);
    let mut edges: HashMap<([End; 2], u16), u32> = HashMap::with_capacity(mesh.triangles.len() * 2);
    for (index, (corners, uvs)) in (0..).zip(mesh.triangles.iter().zip(&mesh.uvs)) {
        // Position and texture coordinate together name one end of an edge.
        let ends: [_; 3] = std::array::from_fn(|i| (corners[i], [uvs[i].x.to_bits(), uvs[i].y.to_bits()]));
        for side in 0..3 {
            let (a, b) = (ends[side], ends[(side + 1) % 3]);
            let page = page_of.get(index as usize).copied().unwrap_or(0);
            let other = *edges.entry(([a.min(b), a.max(b)], page)).or_insert(index);
            sets.join(index, other);
        }
    }
    // What only a cut parts lies together.
    let mut patches = HashMap::new();
    for (index, &patch) in (0..).zip(&mesh.patch_of) {
        let page = page_of.get(index as usize).copied().unwrap_or(0);
        sets.join(index, *patches.entry((patch, page)).or_insert(index));
    }
    let mut numbers = HashMap::new();
    (0..mesh.triangles.len() as u32)
        .map(|triangle| {
            let next = (numbers.len() as u32).min(MAX_CHARTS - 1) as u16;
            *numbers.entry(sets.root(triangle)).or_insert(next)
        })
        .collect()
}

/// Where a triangle finds its texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Index of the page.
    pub page: u16,
    /// Number of the chart.
    pub chart: u16,
}

/// How the triangles of a mesh lie on the textures (pages) they use.
#[derive(Debug, Clone)]
pub struct Atlas {
    places: Vec<Place>,
    pages: Vec<ChartMap>,
}

impl Atlas {
    /// Lays the triangles of `mesh`, which must have texture coordinates, onto pages of the given (width, height).
    /// Triangle t uses page `page_of[t]`; an empty `page_of` means page 0 for all.
    pub fn new(mesh: &TriangleMesh, page_sizes: &[(u32, u32)], page_of: &[u16]) -> Self {
        let charts = charts(mesh, page_of);
        let page_of = |triangle: usize| page_of.get(triangle).copied().unwrap_or(0);
        let place = |(triangle, &chart)| Place { page: page_of(triangle), chart };
        let places = charts.iter().enumerate().map(place).collect();
        let draw = |(page, &(width, height))| ChartMap::new(mesh, &charts, |t| page_of(t) == page, width, height);
        Self { places, pages: (0..).zip(page_sizes).map(draw).collect() }
    }

    /// Page and chart of every triangle.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Owners of the texels of every page.
    pub fn pages(&self) -> &[ChartMap] {
        &self.pages
    }

    /// Where each page begins when the texels of all are counted, and then their number.
    pub fn starts(&self) -> Vec<usize> {
        let mut starts = vec![0];
        starts.extend(self.pages.iter().scan(0, |sum, page| {
            *sum += page.source.len();
            Some(*sum)
        }));
        starts
    }

    /// Adds pages, with the triangles that lie on them now.
    pub(super) fn add_pages(&mut self, pages: Vec<ChartMap>, places: Vec<(usize, Place)>) {
        self.pages.extend(pages);
        places.into_iter().for_each(|(triangle, place)| self.places[triangle] = place);
    }
}

/// Who owns a texel: the chart that covers its centre, or failing that the nearest one that covers a texel.
#[derive(Debug, Clone)]
pub struct ChartMap {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Chart of every texel, row 0 on top.
    pub chart: Vec<u16>,
    /// For every texel the texel whose content stands in for it: itself where a chart covers it.
    pub source: Vec<u32>,
}

/// Unowned so far.
const UNSET: u32 = u32::MAX;

impl ChartMap {
    /// Draws those triangles of `mesh` that are `on_page`, with their `charts`, into an image of `width` × `height`
    /// texels.
    ///
    /// Texture coordinates outside [0, 1] wrap around. Where charts overlap, the triangle drawn first keeps the texel.
    pub fn new(mesh: &TriangleMesh, charts: &[u16], on_page: impl Fn(usize) -> bool, width: u32, height: u32) -> Self {
        let texels = width as usize * height as usize;
        let mut map = Self { width, height, chart: vec![0; texels], source: vec![UNSET; texels] };
        for (triangle, (uvs, &chart)) in mesh.uvs.iter().zip(charts).enumerate() {
            if on_page(triangle) {
                map.draw(uvs, chart);
            }
        }
        map.spread();
        map
    }

    /// Texels that triangles cover, in order; without any, all.
    pub fn covered(&self) -> impl Iterator<Item = usize> {
        (0..).zip(&self.source).filter(|(texel, source)| *texel == **source).map(|(texel, _)| texel as usize)
    }

    /// The texel whose content stands at texture coordinates `uv`, wherever they are.
    pub fn texel_at(&self, uv: Vec2) -> usize {
        let texel = |at: f32, size: u32| {
            let within = if at.is_finite() { at.rem_euclid(1.0) } else { 0.0 };
            ((within * size as f32) as u32).min(size - 1)
        };
        let texel = texel(uv.x, self.width) + self.width * texel(uv.y, self.height);
        self.source[texel as usize] as usize
    }

    fn draw(&mut self, uvs: &[Vec2; 3], chart: u16) {
        let size = Vec2::new(self.width as f32, self.height as f32);
        let [a, b, c] = uvs.map(|uv| uv * size - Vec2::splat(0.5));
        for_covered_texels([a, b, c], 0.0, size, |x, y| {
            let texel = wrap(x, self.width) + self.width * wrap(y, self.height);
            if self.source[texel as usize] == UNSET {
                self.source[texel as usize] = texel;
                self.chart[texel as usize] = chart;
            }
        });
    }

    /// Gives unowned texels to the nearest owned one (in steps over edges, ties by order of visit).
    fn spread(&mut self) {
        let mut front: Vec<u32> = (0..).zip(&self.source).filter(|(t, s)| *t == **s).map(|(t, _)| t).collect();
        if front.is_empty() {
            // No triangle covers a texel centre: every texel speaks for itself.
            self.source = (0..self.source.len() as u32).collect();
            return;
        }
        let mut next = Vec::new();
        while !front.is_empty() {
            for &texel in &front {
                let (x, y) = (texel % self.width, texel / self.width);
                let (left, right) = ((x + self.width - 1) % self.width, (x + 1) % self.width);
                let (up, down) = ((y + self.height - 1) % self.height, (y + 1) % self.height);
                for neighbour in
                    [left + self.width * y, right + self.width * y, x + self.width * up, x + self.width * down]
                {
                    if self.source[neighbour as usize] == UNSET {
                        self.source[neighbour as usize] = self.source[texel as usize];
                        self.chart[neighbour as usize] = self.chart[texel as usize];
                        next.push(neighbour);
                    }
                }
            }
            front.clear();
            std::mem::swap(&mut front, &mut next);
        }
    }
}

/// Repetitions of the image within one triangle up to which only texels under it are visited.
const MAX_REPEATS: f32 = 8.0;
/// Texels from the origin up to which coordinates are within 1/32 of a texel.
const RESOLVED_TEXELS: f32 = (1 << 18) as f32;

/// Index of a texel after wrapping around.
#[inline]
pub fn wrap(index: i32, size: u32) -> u32 {
    index.rem_euclid(size as i32) as u32
}

/// Whether [`for_covered_texels`] visits every texel once, whatever lies under the triangle.
pub fn visits_all(corners: &[Vec2; 3], size: Vec2) -> bool {
    let low = corners[0].min(corners[1]).min(corners[2]);
    let high = corners[0].max(corners[1]).max(corners[2]);
    low.is_finite() && high.is_finite() && is_coarse(low - 1.0, high + 1.0, size)
}

fn is_coarse(low: Vec2, high: Vec2, size: Vec2) -> bool {
    let far = low.abs().max(high.abs()).max_element() > RESOLVED_TEXELS;
    far || (high - low).cmpgt(size * MAX_REPEATS).any()
}

/// Calls `visit` for the texels (x, y), not yet wrapped, whose centres lie in the triangle grown by about `margin`
/// texels. `corners` are in texels, with centres at whole numbers; a triangle wider than an image visits some texels
/// again in each repetition. One that repeats more than [`MAX_REPEATS`] times, or lies where single precision no longer
/// resolves texels, visits all.
pub fn for_covered_texels(corners: [Vec2; 3], margin: f32, size: Vec2, mut visit: impl FnMut(i32, i32)) {
    let low = corners[0].min(corners[1]).min(corners[2]) - margin;
    let high = corners[0].max(corners[1]).max(corners[2]) + margin;
    if !(low.is_finite() && high.is_finite()) {
        return;
    }
    if is_coarse(low, high, size) {
        for y in 0..size.y as i32 {
            (0..size.x as i32).for_each(|x| visit(x, y));
        }
        return;
    }
    let edges: [(Vec2, Vec2); 3] = std::array::from_fn(|i| {
        let edge = corners[(i + 1) % 3] - corners[i];
        (corners[i], Vec2::new(-edge.y, edge.x).normalize_or_zero())
    });
    let turn = (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]).signum();
    for y in low.y.ceil() as i32..=high.y.floor() as i32 {
        for x in low.x.ceil() as i32..=high.x.floor() as i32 {
            let p = Vec2::new(x as f32, y as f32);
            if edges.iter().all(|(corner, inward)| inward.dot(p - *corner) * turn >= -margin) {
                visit(x, y);
            }
        }
    }
}
