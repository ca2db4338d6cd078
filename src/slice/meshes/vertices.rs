//! The vertices that the nodes of one brick own: one on every edge between different labels, one on every face where
//! three materials or more meet.
//!
//! An edge or face belongs to its node of lowest index, so each has one vertex however many cells and materials use it.

use glam::DVec3;

use super::{
    cell::{FacePattern, face_pattern},
    crossing::{Crossing, Crossings, Tangent},
    nodes::{Labels, TwoLayers},
};
use crate::voxel::{BRICK, BRICK_VOXELS};

/// Marks an edge without a vertex.
const NONE: u16 = u16::MAX;

/// The vertices that one brick owns.
#[derive(Debug)]
pub struct BrickVertices {
    /// Number of the first one among all vertices.
    pub first: u32,
    /// Their positions, until they are handed over.
    pub positions: Vec<[f32; 3]>,
    /// The surface at each of them, until they are handed over.
    pub tangents: Vec<Tangent>,
    /// Per node and axis: which of them is on the edge, or [`NONE`].
    edges: [u16; 3 * BRICK_VOXELS],
    /// (node · 3 + normal's axis, which), ascending.
    faces: Vec<(u16, u16)>,
}

/// Index of an edge or face of node (x, y, z) of a brick.
#[inline]
fn key([x, y, z]: [usize; 3], axis: usize) -> usize {
    3 * (x + BRICK * (y + BRICK * z)) + axis
}

/// `at`, one further along `axis`.
#[inline]
pub fn step(mut at: [usize; 3], axis: usize) -> [usize; 3] {
    at[axis] += 1;
    at
}

/// The four nodes of the face of `at` whose normal is `axis`, in turn.
fn face(at: [usize; 3], axis: usize) -> [[usize; 3]; 4] {
    let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
    [at, step(at, b), step(step(at, b), c), step(at, c)]
}

impl BrickVertices {
    /// The vertices of brick `column` of the lower layer, whose cells see `labels`.
    pub fn new(layers: &TwoLayers, column: [usize; 2], labels: &Labels, crossings: &mut Crossings) -> Box<Self> {
        let mut vertices = Box::new(Self {
            first: 0,
            positions: Vec::new(),
            tangents: Vec::new(),
            edges: [NONE; 3 * BRICK_VOXELS],
            faces: Vec::new(),
        });
        let junctions = labels.more_than_two();
        let base = [column[0] * BRICK, column[1] * BRICK, 0];
        let global = |at: [usize; 3]| std::array::from_fn(|axis| base[axis] + at[axis]);
        for n in 0..BRICK_VOXELS {
            let at = [n % BRICK, n / BRICK % BRICK, n / (BRICK * BRICK)];
            for axis in 0..3 {
                let next = step(at, axis);
                if labels.at(at) != labels.at(next) {
                    let vertex = crossings.vertex(axis, layers.node(global(at)), layers.node(global(next)));
                    vertices.edges[key(at, axis)] = vertices.push(vertex);
                }
                if junctions && face_pattern(face(at, axis).map(|node| labels.at(node))) == FacePattern::Star {
                    let centre = face_centre(layers, face(global(at), axis), crossings);
                    let vertex = vertices.push(Crossing { position: centre, tangent: Tangent::UNKNOWN });
                    vertices.faces.push((key(at, axis) as u16, vertex));
                }
            }
        }
        vertices
    }

    fn push(&mut self, vertex: Crossing) -> u16 {
        self.positions.push(vertex.position.as_vec3().to_array());
        self.tangents.push(vertex.tangent);
        (self.positions.len() - 1) as u16
    }

    /// Number of the vertex on the edge along `axis` from node `at` of the brick.
    #[inline]
    pub fn edge(&self, at: [usize; 3], axis: usize) -> u32 {
        let vertex = self.edges[key(at, axis)];
        debug_assert!(vertex != NONE);
        self.first + u32::from(vertex)
    }

    /// Number of the vertex on the face of node `at` whose normal is `axis`.
    pub fn face(&self, at: [usize; 3], axis: usize) -> Option<u32> {
        let key = key(at, axis) as u16;
        let found = self.faces.binary_search_by_key(&key, |face| face.0).ok()?;
        Some(self.first + u32::from(self.faces[found].1))
    }
}

/// The mean of the vertices on a face's edges.
fn face_centre(layers: &TwoLayers, corners: [[usize; 3]; 4], crossings: &mut Crossings) -> DVec3 {
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for side in 0..4 {
        let (a, b) = (corners[side].min(corners[(side + 1) % 4]), corners[side].max(corners[(side + 1) % 4]));
        let (p, q) = (layers.node(a), layers.node(b));
        if p.0.label != q.0.label {
            let axis = (0..3).find(|&axis| a[axis] != b[axis]).unwrap_or(0);
            sum += crossings.vertex(axis, p, q).position;
            count += 1.0;
        }
    }
    sum / count
}
