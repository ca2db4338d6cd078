//! The boundaries between materials, every triangle once.

/// Triangles between materials, over one pool of vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Interfaces {
    /// Vertices, mm.
    pub positions: Vec<[f32; 3]>,
    /// Triangles.
    pub facets: Vec<Facet>,
}

/// A triangle between two materials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Facet {
    /// Indices of its vertices; its normal, by the right hand, points from `behind` to `front`.
    pub corners: [u32; 3],
    /// Material id, or 0 for a void.
    pub behind: u8,
    /// Material id, or 0 for a void.
    pub front: u8,
}

impl Facet {
    /// The two materials.
    pub fn sides(&self) -> [u8; 2] {
        [self.behind, self.front]
    }
}
