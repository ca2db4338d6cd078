//! Surface nets: a closed mesh of an implicit solid (Gibson 1998, *Constrained Elastic Surface Nets*), with one
//! vertex per sheet of surface in a grid cell instead of one per cell (Nielson 2004, *Dual Marching Cubes*).
//!
//! Every grid edge that the surface crosses becomes a quad, so the result is closed by construction. It is manifold
//! unless two sheets touch within a cell; [`crate::audit`] looks for that.

use glam::{DVec3, USizeVec3};
use rayon::prelude::*;

use crate::shape::Figure;

/// Triangles, counter-clockwise seen from outside.
pub struct Mesh {
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Corner positions of a triangle.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }

    /// Outward normal of a triangle, as long as its area.
    pub fn area_vector(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a) / 2.0
    }
}

/// The field's values at the nodes of a cubic grid.
struct Samples {
    origin: DVec3,
    step: f64,
    nodes: USizeVec3,
    values: Vec<f64>,
}

impl Samples {
    fn take(figure: &Figure, step: f64) -> Self {
        let (low, high) = figure.bounds;
        // Half a step off the origin in y: no node lies in the base plane, so no value is 0 there.
        let origin = ((low / step).floor() + 0.5) * step;
        let nodes = ((high - origin) / step).ceil().as_usizevec3() + 1;
        let values = (0..nodes.x * nodes.y * nodes.z)
            .into_par_iter()
            .map(|at| {
                let (x, y, z) = (at % nodes.x, at / nodes.x % nodes.y, at / (nodes.x * nodes.y));
                figure.value(origin + USizeVec3::new(x, y, z).as_dvec3() * step)
            })
            .collect();
        Self { origin, step, nodes, values }
    }

    fn at(&self, node: USizeVec3) -> usize {
        node.x + self.nodes.x * (node.y + self.nodes.y * node.z)
    }

    fn position(&self, node: USizeVec3) -> DVec3 {
        self.origin + node.as_dvec3() * self.step
    }

    /// Bit `n` says that corner `n` of the cell is inside.
    fn corner_mask(&self, cell: USizeVec3) -> u8 {
        (0..8)
            .fold(0, |mask, corner| mask | u8::from(self.values[self.at(cell + corner_offset(corner))] < 0.0) << corner)
    }

    /// Where the surface crosses the edge between two nodes, linearly interpolated.
    fn crossing(&self, from: USizeVec3, to: USizeVec3) -> DVec3 {
        let (a, b) = (self.values[self.at(from)], self.values[self.at(to)]);
        self.position(from).lerp(self.position(to), a / (a - b))
    }
}

fn corner_offset(corner: usize) -> USizeVec3 {
    USizeVec3::new(corner & 1, corner >> 1 & 1, corner >> 2)
}

/// The sheet that crosses each edge of a cell, by the edge's two corners; sheets count from 0.
///
/// Inside corners that meet only across a face's diagonal are kept apart, outside corners joined. Neighbouring cells
/// decide alike about the face they share, hence their sheets fit together.
fn sheets(mask: u8) -> (usize, [[u8; 8]; 8]) {
    let inside = |corner: usize| mask >> corner & 1 == 1;
    let joined = |a: usize, b: usize| {
        inside(a) == inside(b) && ((a ^ b).count_ones() == 1 || (!inside(a) && (a ^ b).count_ones() == 2))
    };
    let mut region = [0, 1, 2, 3, 4, 5, 6, 7];
    // The lowest corner of a region names it; seven passes reach round any chain of eight.
    for _ in 0..7 {
        for a in 0..8 {
            for b in (0..8).filter(|&b| joined(a, b)) {
                region[a] = region[a].min(region[b]);
            }
        }
    }
    let mut names: Vec<(usize, usize)> = Vec::new();
    let mut sheet_of = [[u8::MAX; 8]; 8];
    for a in (0..8).filter(|&a| inside(a)) {
        for b in (0..8).filter(|&b| !inside(b) && (a ^ b).count_ones() == 1) {
            let name = (region[a], region[b]);
            let sheet = names.iter().position(|n| *n == name).unwrap_or(names.len());
            if sheet == names.len() {
                names.push(name);
            }
            sheet_of[a][b] = sheet as u8;
            sheet_of[b][a] = sheet as u8;
        }
    }
    (names.len(), sheet_of)
}

/// Meshes `figure` on a grid of `step`; the vertices lie near the surface, not yet on it.
pub fn surface_nets(figure: &Figure, step: f64) -> Mesh {
    let samples = Samples::take(figure, step);
    let tables: Vec<_> = (0..=u8::MAX).map(sheets).collect();
    let cells = samples.nodes - 1;
    let mut mesh = Mesh { positions: Vec::new(), triangles: Vec::new() };
    let mut first_vertex = vec![u32::MAX; samples.values.len()];
    for at in 0..cells.x * cells.y * cells.z {
        let cell = USizeVec3::new(at % cells.x, at / cells.x % cells.y, at / (cells.x * cells.y));
        let (count, sheet_of) = &tables[usize::from(samples.corner_mask(cell))];
        first_vertex[samples.at(cell)] = mesh.positions.len() as u32;
        for sheet in 0..*count {
            let crossings: Vec<DVec3> = (0..8)
                .flat_map(|a| (0..a).map(move |b| (a, b)))
                .filter(|&(a, b)| usize::from(sheet_of[a][b]) == sheet)
                .map(|(a, b)| samples.crossing(cell + corner_offset(a), cell + corner_offset(b)))
                .collect();
            mesh.positions.push(crossings.iter().sum::<DVec3>() / crossings.len() as f64);
        }
        // All four cells round an edge that starts at this cell's lowest node exist by now.
        for axis in 0..3 {
            if let Some([a, b, c, d]) = quad_around(&samples, &tables, &first_vertex, cell, axis) {
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    mesh
}

/// The four vertices round the edge from `node` along `axis`, counter-clockwise seen from outside.
fn quad_around(
    samples: &Samples,
    tables: &[(usize, [[u8; 8]; 8])],
    first_vertex: &[u32],
    node: USizeVec3,
    axis: usize,
) -> Option<[u32; 4]> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    if node[u] == 0 || node[v] == 0 {
        return None;
    }
    let mut end = node;
    end[axis] += 1;
    let starts_inside = samples.values[samples.at(node)] < 0.0;
    if starts_inside == (samples.values[samples.at(end)] < 0.0) {
        return None;
    }
    let vertex = |back_u: usize, back_v: usize| {
        let mut cell = node;
        cell[u] -= back_u;
        cell[v] -= back_v;
        let corner = back_u << u | back_v << v;
        let (_, sheet_of) = &tables[usize::from(samples.corner_mask(cell))];
        first_vertex[samples.at(cell)] + u32::from(sheet_of[corner][corner | 1 << axis])
    };
    let quad = [vertex(1, 1), vertex(0, 1), vertex(0, 0), vertex(1, 0)];
    Some(if starts_inside { quad } else { [quad[3], quad[2], quad[1], quad[0]] })
}
