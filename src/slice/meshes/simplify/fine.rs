//! Distance to the fine triangles, and to what they stand for.

use glam::DVec3;

use super::super::{
    exact::Exact,
    interfaces::{Facet, Interfaces},
};
use super::groups::Groups;
use crate::sdf::closest_point;

/// The triangles that simplification starts from.
#[derive(Debug)]
pub struct Fine<'a> {
    /// Vertices, mm.
    pub positions: Vec<[f32; 3]>,
    /// Triangles.
    pub facets: Vec<Facet>,
    /// Lowest and highest corner of a box around all, mm.
    pub bounds: [DVec3; 2],
    /// The triangles around every vertex.
    around: Groups,
    /// The boundaries that they stand for.
    pub exact: Exact<'a>,
}

impl<'a> Fine<'a> {
    /// Gathers the triangles around every vertex.
    pub fn new(Interfaces { positions, facets }: Interfaces, exact: Exact<'a>) -> Self {
        let corners = || (0..).zip(&facets).flat_map(|(n, facet): (u32, _)| facet.corners.map(|corner| (corner, n)));
        let around = Groups::new(positions.len(), corners);
        let all = positions.iter().map(|p| DVec3::from(p.map(f64::from)));
        let [low, high] = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let bounds = all.fold([low, high], |[low, high], p| [low.min(p), high.max(p)]);
        Self { positions, facets, bounds, around, exact }
    }

    /// A vertex, mm.
    #[inline]
    pub fn at(&self, vertex: u32) -> DVec3 {
        DVec3::from(self.positions[vertex as usize].map(f64::from))
    }

    /// The other ends of the edges at a vertex.
    pub fn ends(&self, vertex: u32) -> impl Iterator<Item = u32> {
        self.around.of(vertex).iter().map(move |&facet| {
            let [a, b, c] = self.facets[facet as usize].corners;
            if a == vertex {
                b
            } else if b == vertex {
                c
            } else {
                a
            }
        })
    }

    /// Whether `p` is certainly within √`limit` of a fine triangle, one of those around `vertex` or around these.
    pub fn is_near(&self, p: DVec3, vertex: u32, limit: f64) -> bool {
        let near = |vertex: u32| {
            self.around.of(vertex).iter().any(|&facet| {
                let corners = self.facets[facet as usize].corners.map(|corner| self.at(corner));
                closest_point(p, &corners).distance_squared <= limit
            })
        };
        near(vertex)
            || self.around.of(vertex).iter().any(|&facet| {
                self.facets[facet as usize].corners.iter().any(|&corner| corner != vertex && near(corner))
            })
    }
}
