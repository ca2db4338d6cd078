//! The printer's lattice, and sparse bricks of material ids on it.
//!
//! **In:** an extent in mm and a pitch per axis, often a [`Printer`]'s. **Out:** a [`Lattice`] that places voxel
//! centres, and a [`Slab`] that holds the material of every voxel between two heights as 8×8×8 bricks, most of them one
//! uniform tile; a [`ThresholdMask`] that shares voxels out among resins; and a
//! [`FractionSlab`] of their fractions before it does.

mod fractions;
mod lattice;
mod mask;
mod printer;
mod slab;

pub use fractions::{BrickFractions, Composition, FractionSlab, WHOLE, Weights};
pub use lattice::{Lattice, LatticeError};
pub use mask::ThresholdMask;
pub use printer::{MM_PER_INCH, Printer, UnknownPrinter};
pub use slab::{BRICK, BRICK_VOXELS, Block, BlockShape, MaterialId, Slab, Tile};
