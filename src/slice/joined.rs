//! Objects that touch or overlap are one body: depth is measured from the surface of them all.
//!
//! What one of them hides of another is no surface, so each has lost faces ([`crate::mesh::unite`]), and the nearest
//! surface point of a voxel may be on a face of another object than the voxel's own.
//!
//! ```text
//!     ┌──────B──────┐        A voxel gets the layers of the object whose face is nearest, at its depth below that
//!     │  · · · · ·  │        face, whichever object it lies in: below the plate B the block A is laid as B asks,
//!   ┌─┴ ─ ─ ─ ─ ─ ─ ┴─┐      as deep as B's layers go.
//!   A                 │
//! ```
//!
//! So every object of a body is laid into the inside of the whole body, with the faces of all at hand, and leaves alone
//! what is nearest to a face of another. All of them come to the same nearest face for a voxel, since they walk the
//! same boxes with the same triangles; so each voxel is laid by one of them.

use std::{ops::Range, sync::Arc};

use super::field::ObjectField;
use crate::sdf::{SliceRuns, Surface};

/// The body that an object is part of.
#[derive(Debug, Clone)]
pub(super) struct Joined {
    /// The faces of all its objects, one object's after the other's.
    pub surface: Arc<Surface>,
    /// Which of them are the object's own.
    pub own: Range<u32>,
    /// Its objects, ascending, by their places among all.
    pub members: Arc<[usize]>,
}

/// Whose some triangles are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Whose {
    Own,
    Others,
    Both,
}

impl Joined {
    /// Whose `triangles` are, of which there is one at least.
    pub fn whose(&self, triangles: &[u32]) -> Whose {
        let own = triangles.iter().filter(|triangle| self.own.contains(triangle)).count();
        match own {
            0 => Whose::Others,
            own if own == triangles.len() => Whose::Own,
            _ => Whose::Both,
        }
    }

    /// `triangles` as their object numbers them; those of others are given as one of its own.
    pub fn as_own(&self, triangles: &[u32]) -> Vec<u32> {
        let any = triangles.iter().find(|triangle| self.own.contains(triangle)).unwrap_or(&self.own.start);
        let own = |triangle: &u32| if self.own.contains(triangle) { *triangle } else { *any };
        triangles.iter().map(|triangle| own(triangle) - self.own.start).collect()
    }
}

/// Makes one body of the objects of every group; groups have no object in common. Those that are joined lay their
/// layers by the exact distance, boundaries at whole voxels: other distances and dither are asked for after it.
pub fn join(fields: &mut [ObjectField], groups: &[Vec<usize>]) {
    for group in groups.iter().filter(|group| group.len() > 1) {
        let members: Arc<[usize]> = group.clone().into();
        let triangles: Vec<_> = group.iter().flat_map(|&n| fields[n].surface().triangles()).copied().collect();
        let Some(surface) = Surface::of_triangles(triangles).map(Arc::new) else { continue };
        let mut first = 0;
        for &object in group {
            let end = first + fields[object].surface().triangles().len() as u32;
            let joined = Joined { surface: Arc::clone(&surface), own: first..end, members: Arc::clone(&members) };
            fields[object].set_joined(joined);
            first = end;
        }
    }
}

/// Inside runs of a body from those of its objects, slice by slice.
pub(super) fn runs_of(objects: impl Iterator<Item = Vec<SliceRuns>>) -> Vec<SliceRuns> {
    let mut whole: Vec<SliceRuns> = Vec::new();
    for slices in objects {
        if whole.is_empty() {
            whole = slices;
        } else {
            whole.iter_mut().zip(&slices).for_each(|(whole, slice)| whole.add(slice));
        }
    }
    whole
}
