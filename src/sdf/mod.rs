//! Depth and nearest surface point at any position.
//!
//! **In:** a [`crate::mesh::Solid`]. **Out:** the nearest triangle point (exact with respect to the triangles, at any depth) and the
//! sign (inside or outside, by integer winding numbers along voxel rows).
//!
//! | file | what it does |
//! | --- | --- |
//! | `triangle` | closest point of one triangle |
//! | `surface`  | bounding volume hierarchy over all triangles: the closest point of a position |
//! | `inside`   | runs of inside voxels per row, by signed crossings |
//! | `cull`     | which triangles can be nearest somewhere in a block |
//! | `kernel`   | nearest of a few triangles for the 512 voxels of a brick, in SIMD |

mod cull;
mod inside;
mod kernel;
mod surface;
mod triangle;

pub use cull::{BlockBox, CullScratch, DepthRange, cull};
pub use inside::{InsideRows, SliceRuns};
pub use kernel::{BrickOffsets, BrickSurface, nearest_in_brick};
pub use surface::{Surface, SurfacePoint};
pub use triangle::{ClosestPoint, closest_point};
