//! Depth and nearest surface point at any position.
//!
//! **In:** a [`crate::mesh::Solid`]. **Out:** the nearest triangle point (exact with respect to the triangles, at any
//! depth) and the sign (inside or outside, by integer winding numbers along voxel rows).
//!
//! | file | what it does |
//! | --- | --- |
//! | `triangle` | closest point of one triangle |
//! | `closest_many` | the same for eight at once, in SIMD |
//! | `surface`  | bounding volume hierarchy over all triangles: the closest point of a position |
//! | `inside`   | runs of inside voxels per row, by signed crossings |
//! | `cull`     | which triangles can be nearest somewhere in a block |
//! | `parts`    | the same for the parts of a brick |
//! | `kernel`   | nearest of a few triangles for the 512 voxels of a brick, in SIMD |
//! | `voxelize`, `surface_voxels` | which voxels the surface passes through |
//! | `thickness` | the largest ball inside at a surface point |
//! | `grid`     | distance from voxel to surface voxel, as the paper has it |
//! | `moments`, `lp_kernel`, `lp` | the Lp-averaged distance |

mod closest_many;
mod cull;
mod face;
mod grid;
mod inside;
mod kernel;
mod lp;
mod lp_kernel;
mod moments;
mod parts;
mod surface;
mod surface_voxels;
#[cfg(test)]
mod tests;
mod thickness;
mod triangle;
mod voxelize;

pub use cull::{BlockBox, CullScratch, DepthRange, SLACK, cull};
pub use face::Face;
pub use grid::{FeatureWindow, Reach};
pub(crate) use inside::merge_runs;
pub use inside::{InsideRows, SliceRuns};
pub use kernel::{BrickOffsets, BrickSurface, nearest_in_brick, nearest_in_parts};
pub use lp::{LpField, LpOffsets, LpScratch, RELATIVE_ERROR};
pub use parts::{PART_COLUMNS, PART_SLICES, Part};
pub use surface::{Surface, SurfacePoint};
pub use surface_voxels::SurfaceVoxels;
pub use thickness::{BallInside, ball_inside, half_thickness};
pub use triangle::{ClosestPoint, closest_point};
pub use voxelize::{Cells, cell_centre, for_cells};
