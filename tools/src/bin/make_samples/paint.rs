//! From an atlas to texels: which triangle a texel shows, and where on the surface it lies.

use glam::{DVec2, DVec3, dvec2};
use rayon::prelude::*;

use crate::meshing::Mesh;
use crate::packing::Atlas;

/// Rings of texels painted round every chart: half the gutter, plus one that bilinear lookups never reach.
const RINGS: usize = 5;
/// A texel that no chart reaches.
const NO_OWNER: u32 = u32::MAX;

/// Two triangles of one chart, or of two, that claim the same texel.
#[derive(Debug, thiserror::Error)]
#[error(
    "texel ({x}, {y}) lies in triangles {first} (chart {first_chart}) and {second} (chart {second_chart}), expected one"
)]
pub struct Overlap {
    x: usize,
    y: usize,
    first: u32,
    first_chart: usize,
    second: u32,
    second_chart: usize,
}

/// The triangle that every texel shows.
pub struct Canvas<'a> {
    mesh: &'a Mesh,
    atlas: &'a Atlas,
    owners: Vec<u32>,
}

impl<'a> Canvas<'a> {
    /// Assigns texels by their centres, then paints on into the gutters.
    pub fn new(mesh: &'a Mesh, atlas: &'a Atlas) -> Result<Self, Overlap> {
        let size = atlas.size;
        let mut owners = vec![NO_OWNER; size * size];
        for (t, corners) in atlas.corners.iter().enumerate() {
            let low = corners[0].min(corners[1]).min(corners[2]).max(DVec2::ZERO).as_usizevec2();
            let high = corners[0].max(corners[1]).max(corners[2]).as_usizevec2();
            for y in low.y..=high.y.min(size - 1) {
                for x in low.x..=high.x.min(size - 1) {
                    let weights = weights(corners, x, y);
                    if weights.min_element() < 0.0 {
                        continue;
                    }
                    let owner = &mut owners[y * size + x];
                    if *owner == NO_OWNER {
                        *owner = t as u32;
                    } else if weights.min_element() > 1e-9 {
                        let (first, second) = (*owner, t as u32);
                        let [first_chart, second_chart] = [first, second].map(|t| atlas.chart_of[t as usize]);
                        return Err(Overlap { x, y, first, first_chart, second, second_chart });
                    }
                }
            }
        }
        let mut canvas = Self { mesh, atlas, owners };
        (0..RINGS).for_each(|_| canvas.grow());
        Ok(canvas)
    }

    /// Lets unowned texels take the owner of a neighbour: the surface goes on in that triangle's plane.
    fn grow(&mut self) {
        let size = self.atlas.size;
        let before = &self.owners;
        let owner = |x: usize, y: usize| {
            let own = before[y * size + x];
            let beside = [(0, 1), (2, 1), (1, 0), (1, 2), (0, 0), (2, 0), (0, 2), (2, 2)];
            let mut candidates = beside.iter().filter_map(|&(dx, dy)| {
                let (u, v) = ((x + dx).checked_sub(1)?, (y + dy).checked_sub(1)?);
                (u < size && v < size).then(|| before[v * size + u]).filter(|&t| t != NO_OWNER)
            });
            if own == NO_OWNER { candidates.next().unwrap_or(NO_OWNER) } else { own }
        };
        self.owners = (0..size * size).into_par_iter().map(|at| owner(at % size, at / size)).collect();
    }

    /// Part of the texture that shows some surface, gutters included.
    pub fn coverage(&self) -> f64 {
        self.owners.iter().filter(|&&t| t != NO_OWNER).count() as f64 / self.owners.len() as f64
    }

    /// `shade` at the surface point of every texel, `background` where there is none; row 0 is on top.
    pub fn paint<T: Copy + Send + Sync>(&self, background: T, shade: impl Fn(DVec3) -> T + Sync) -> Vec<T> {
        let size = self.atlas.size;
        (0..size * size)
            .into_par_iter()
            .map(|at| match self.owners[at] {
                NO_OWNER => background,
                t => {
                    let w = weights(&self.atlas.corners[t as usize], at % size, at / size);
                    let [a, b, c] = self.mesh.corners(t as usize);
                    shade(a * w.x + b * w.y + c * w.z)
                }
            })
            .collect()
    }
}

/// Barycentric weights of a texel's centre.
fn weights([a, b, c]: &[DVec2; 3], x: usize, y: usize) -> DVec3 {
    let p = dvec2(x as f64 + 0.5, y as f64 + 0.5);
    let double_area = (*b - *a).perp_dot(*c - *a);
    let v = (p - *a).perp_dot(*c - *a) / double_area;
    let w = (*b - *a).perp_dot(p - *a) / double_area;
    DVec3::new(1.0 - v - w, v, w)
}
