//! The exact boundaries behind a marched mesh.
//!
//! Marched triangles end on the boundaries that they stand for, and between their corners they are chords: next to two
//! edges of the surface in one cell they are off by more than a mesh of fewer triangles need be.

use glam::DVec3;

use super::{
    crossing::Tangent,
    object::{AboveLevel, NodeObject},
};

/// Level sets of exact distances, by the vertices of a marched mesh that lie on them.
#[derive(Debug)]
pub struct Exact<'a> {
    /// The objects.
    pub objects: &'a [NodeObject<'a>],
    /// Of every vertex, the boundary that it is on.
    pub tangents: Vec<Tangent>,
}

impl Exact<'_> {
    /// How `p`, which is near two vertices, lies to the boundary that both are on; `None` where that is no level set of
    /// an exact distance, or where `p` is nearer to another object, whose layers have levels of their own.
    pub fn above_level(&self, p: DVec3, [a, b]: [u32; 2]) -> Option<AboveLevel> {
        let [a, b] = [a, b].map(|vertex| &self.tangents[vertex as usize]);
        if !a.is_known() || a.level != b.level {
            return None;
        }
        let object = &self.objects[usize::from(a.level.object)];
        let found = object.above_level(a.level.boundary, p, &[a.triangle, b.triangle])?;
        (a.level.boundary == 0 || object.owns(found.triangle)).then_some(found)
    }
}
