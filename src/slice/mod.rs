//! From the field to files: bricks of material ids, slab after slab, streamed into sinks.
//!
//! **In:** objects on a lattice. **Out:** slices, masks, meshes, previews and the manifest that lists them.
//!
//! | file | what it does |
//! | --- | --- |
//! | `depth`  | the distances that layers can be laid by |
//! | `fill`   | one object into one block: descent by halves, uniform tiles, bricks |
//! | `engine` | slab after slab, blocks in parallel |
//! | `output`, `journal` | the folder: whole files only, nothing of anybody else's; how far an interrupted run came |
//! | `meshes` | material meshes from the same field |
//! | `preview` | pictures of the result, and a page to read |

mod depth;
mod engine;
mod fill;
mod journal;
pub mod meshes;
mod output;
mod png;
pub mod preview;
#[cfg(test)]
mod tests;

pub use depth::{DistanceKind, SlabField};
pub use engine::Slicer;
pub use fill::ObjectField;
pub use journal::{JOURNAL, SliceCounts, Task};
pub use output::{Existing, FileEntry, MANIFEST, OutputError, OutputFolder, TIMINGS};
pub(crate) use output::{hex, is_plain};
pub use png::{Palette, RowBuffers, encode_mask, encode_rgba};
