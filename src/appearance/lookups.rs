//! Texel lookups of many voxels, [`LANES`] at a time.
//!
//! The same answers as [`TexturedLayers::material`], bit for bit. What is arithmetic runs over all lanes at once; only
//! texels and rows are fetched one by one. Points whose texels wrap around or belong to several charts, and depths at
//! which limits act, go the plain way.

use glam::Vec2;
use multiversion::multiversion;

use super::{
    charts::Place,
    textured::{Footprint, Page, TexturedLayers},
};
use crate::voxel::BRICK_VOXELS;

/// Points worked on together.
const LANES: usize = 16;

/// A voxel that looks up texels: where its nearest surface point is.
#[derive(Debug, Clone, Copy, Default)]
pub struct SurfaceTexel {
    /// Place in the brick.
    pub voxel: u32,
    /// The triangle of the nearest point.
    pub triangle: u32,
    /// Its texture coordinates.
    pub uv: Vec2,
    /// Distance from it, mm.
    pub depth: f32,
    /// The voxel's rank among those that share in a mixture.
    pub rank: u16,
}

/// Footprints of [`LANES`] points.
#[derive(Clone, Copy, Default)]
struct Footprints {
    labels: [[u32; LANES]; 4],
    weights: [[f32; LANES]; 4],
}

/// Looks up the materials of some voxels; a function of its own so that it is built for several instruction sets.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
pub fn resolve(layers: &TexturedLayers, points: &[SurfaceTexel], out: &mut [u8; BRICK_VOXELS]) {
    let mut footprints = Footprints::default();
    let (mut u, mut v) = ([0.0; LANES], [0.0; LANES]);
    let (mut width, mut height, mut chart, mut start) = ([1; LANES], [1; LANES], [0; LANES], [0; LANES]);
    let (mut left, mut top, mut near) = ([0; LANES], [0; LANES], [false; LANES]);
    for points in points.chunks(LANES) {
        for (lane, point) in points.iter().enumerate() {
            let place: Place = layers.places[point.triangle as usize];
            let page: Page = layers.pages[usize::from(place.page)];
            (u[lane], v[lane]) = (point.uv.x, point.uv.y);
            (width[lane], height[lane], start[lane]) = (page.width, page.height, page.start);
            chart[lane] = place.chart;
        }
        let [w0, w1, w2, w3] = &mut footprints.weights;
        for lane in 0..LANES {
            let (x, y) = (u[lane] * width[lane] as f32 - 0.5, v[lane] * height[lane] as f32 - 0.5);
            let (x0, y0) = (x.floor(), y.floor());
            let (fx, fy) = (x - x0, y - y0);
            w0[lane] = (1.0 - fx) * (1.0 - fy);
            w1[lane] = fx * (1.0 - fy);
            w2[lane] = (1.0 - fx) * fy;
            w3[lane] = fx * fy;
            (left[lane], top[lane]) = (x0 as u32, y0 as u32);
            let inside = [left[lane] < width[lane] - 1, top[lane] < height[lane] - 1];
            near[lane] = (x0 >= 0.0) & (y0 >= 0.0) & inside[0] & inside[1];
        }
        for (lane, point) in points.iter().enumerate() {
            let row = start[lane] + top[lane] as usize * width[lane] as usize + left[lane] as usize;
            let below = row + width[lane] as usize;
            let texels = &layers.texels;
            if near[lane]
                && let (Some([a, b]), Some([c, d])) = (texels.get(row..row + 2), texels.get(below..below + 2))
                && (a.chart == chart[lane])
                    & (b.chart == chart[lane])
                    & (c.chart == chart[lane])
                    & (d.chart == chart[lane])
            {
                for (labels, texel) in footprints.labels.iter_mut().zip([a, b, c, d]) {
                    labels[lane] = u32::from(texel.label);
                }
            } else {
                let Footprint { labels, weights } = layers.footprint(point.triangle, point.uv.x, point.uv.y);
                for texel in 0..4 {
                    footprints.labels[texel][lane] = u32::from(labels[texel]);
                    footprints.weights[texel][lane] = weights[texel];
                }
            }
        }
        condense(&mut footprints);
        for (lane, point) in points.iter().enumerate() {
            let (id, footprint) = (&mut out[point.voxel as usize], footprints.at(lane));
            *id = match layers.slots.slot_below_limits(&footprint, point.depth) {
                Some(slot) => layers.slots.material_in(slot, &footprint, point.rank).0,
                None => layers.material(point.triangle, point.uv, point.depth, point.rank).0,
            };
        }
    }
}

impl Footprints {
    #[inline(always)]
    fn at(&self, lane: usize) -> Footprint {
        let ([a, b, c, d], [e, f, g, h]) = (&self.labels, &self.weights);
        Footprint {
            labels: [a[lane] as u16, b[lane] as u16, c[lane] as u16, d[lane] as u16],
            weights: [e[lane], f[lane], g[lane], h[lane]],
        }
    }
}

/// Where one stacking has all the weight of a footprint, lays it on one texel and gives it 1: the mean is then its row,
/// bit for bit.
#[inline(always)]
fn condense(footprints: &mut Footprints) {
    let ([a, b, c, d], [e, f, g, h]) = (&mut footprints.labels, &mut footprints.weights);
    for lane in 0..LANES {
        let counts = [e[lane] > 0.0, f[lane] > 0.0, g[lane] > 0.0, h[lane] > 0.0];
        let label = if counts[2] { c[lane] } else { d[lane] };
        let label = if counts[1] { b[lane] } else { label };
        let label = if counts[0] { a[lane] } else { label };
        let differs = (counts[0] & (a[lane] != label))
            | (counts[1] & (b[lane] != label))
            | (counts[2] & (c[lane] != label))
            | (counts[3] & (d[lane] != label));
        let single = (counts[0] | counts[1] | counts[2] | counts[3]) & !differs;
        a[lane] = if single { label } else { a[lane] };
        b[lane] = if single { label } else { b[lane] };
        c[lane] = if single { label } else { c[lane] };
        d[lane] = if single { label } else { d[lane] };
        e[lane] = if single { 1.0 } else { e[lane] };
        f[lane] = if single { 0.0 } else { f[lane] };
        g[lane] = if single { 0.0 } else { g[lane] };
        h[lane] = if single { 0.0 } else { h[lane] };
    }
}
