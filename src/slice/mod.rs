//! From the field to files: bricks of material ids, slab after slab, streamed into sinks.
//!
//! **In:** objects on a lattice. **Out:** slices, masks and meshes.
//!
//! | file | what it does |
//! | --- | --- |
//! | `field`  | an object on the lattice: its surface, its layers, what it is joined to |
//! | `depth`  | the distances that layers can be laid by |
//! | `dither` | boundaries between layers that fall between voxels |
//! | `descent` | one object into one block: by halves, to uniform boxes and single bricks |
//! | `fill`   | the leaves of that descent that are voxels |
//! | `fractions` | volume fractions beside them, where voxels are drawn by lot |
//! | `joined` | objects that touch or overlap are one body |
//! | `engine` | slab after slab, blocks in parallel |
//! | `meshes` | material meshes from the same field |

mod depth;
mod descent;
mod dither;
mod engine;
mod field;
mod fill;
mod fractions;
mod joined;
pub mod meshes;
mod png;
#[cfg(test)]
mod tests;

pub use depth::{DistanceKind, SlabField};
pub use engine::Slicer;
pub use field::ObjectField;
pub use joined::join;
pub(crate) use png::encoder;
pub use png::{Palette, RowBuffers, encode_mask, encode_rgba};
