//! The surface voxels near a slab, column by column, ready for the distance transform.
//!
//! Within the slab one bit per voxel; above and below only the nearest surface voxel of each column counts. So the
//! memory is that of the slab's bits, whatever the depth that is asked for and the height of the object.

use std::ops::Range;

use glam::{DVec3, IVec2, IVec3};
use rayon::prelude::*;

use super::voxelize::{Cells, for_cells};
use crate::voxel::Lattice;

/// The voxels of a slab that the surface passes through, and the nearest ones above and below.
#[derive(Debug, Clone, Default)]
pub struct SurfaceVoxels {
    /// Columns, x and y, that the surface reaches.
    low: IVec2,
    size: [usize; 2],
    slices: Range<i32>,
    columns: Vec<Column>,
    /// Bit k of a column's `words` words: slice `slices.start + k`.
    bits: Vec<u64>,
    words: usize,
}

/// The nearest surface voxels of a column outside the slab.
#[derive(Debug, Clone, Copy)]
struct Column {
    below: i32,
    above: i32,
}

const NO_COLUMN: Column = Column { below: i32::MIN, above: i32::MAX };

/// Rows that one task rasterises.
const BAND: usize = 64;

impl SurfaceVoxels {
    /// Finds the voxels of `slices` that the triangles pass through, and those within `reach` mm above and below.
    pub fn rebuild(&mut self, triangles: &[[DVec3; 3]], lattice: &Lattice, slices: Range<u32>, reach: f64) {
        let slices = slices.start as i32..slices.end as i32;
        let margin = (reach / lattice.pitch.z).ceil() as i32 + 1;
        let window = slices.start.saturating_sub(margin)..slices.end.saturating_add(margin);
        let boxes = triangles.iter().map(|[a, b, c]| Cells::around(lattice, a.min(*b).min(*c), a.max(*b).max(*c)));
        let near: Vec<(u32, Cells)> =
            (0..).zip(boxes).filter(|(_, cells)| cells.low.z < window.end && cells.high.z > window.start).collect();
        let low = near.iter().fold(IVec3::MAX, |low, (_, cells)| low.min(cells.low));
        let high = near.iter().fold(IVec3::MIN, |high, (_, cells)| high.max(cells.high));
        self.low = low.truncate();
        self.size = if near.is_empty() { [0; 2] } else { [high.x - low.x, high.y - low.y].map(|n| n as usize) };
        self.words = (slices.len()).div_ceil(64).max(1);
        self.slices = slices.clone();
        let columns = self.size[0] * self.size[1];
        self.columns.clear();
        self.columns.resize(columns, NO_COLUMN);
        self.bits.clear();
        self.bits.resize(columns * self.words, 0);
        if columns == 0 {
            return;
        }
        let band = BAND * self.size[0];
        let bands = self.columns.par_chunks_mut(band).zip(self.bits.par_chunks_mut(band * self.words));
        let (width, words, origin) = (self.size[0], self.words, self.low);
        bands.enumerate().for_each(|(n, (columns, bits))| {
            let first_row = origin.y + (n * BAND) as i32;
            let within = Cells {
                low: IVec3::new(i32::MIN, first_row, window.start),
                high: IVec3::new(i32::MAX, first_row + BAND as i32, window.end),
            };
            for (index, _) in near.iter().filter(|(_, cells)| !cells.intersection(&within).is_empty()) {
                for_cells(
                    lattice,
                    &triangles[*index as usize],
                    &within,
                    |_, _| true,
                    |cell| {
                        let column = (cell.x - origin.x) as usize + width * (cell.y - first_row) as usize;
                        if cell.z < slices.start {
                            columns[column].below = columns[column].below.max(cell.z);
                        } else if cell.z >= slices.end {
                            columns[column].above = columns[column].above.min(cell.z);
                        } else {
                            let bit = (cell.z - slices.start) as usize;
                            bits[column * words + bit / 64] |= 1 << (bit % 64);
                        }
                    },
                );
            }
        });
    }

    /// Columns that may hold surface voxels: first (x, y), and one past the last.
    pub fn bounds(&self) -> [IVec2; 2] {
        [self.low, self.low + IVec2::new(self.size[0] as i32, self.size[1] as i32)]
    }

    /// The slice of the surface voxel of column (x, y), within [`Self::bounds`], that is nearest to slice `z` of the
    /// slab.
    #[inline]
    pub fn nearest(&self, x: i32, y: i32, z: i32) -> Option<i32> {
        let column = (x - self.low.x) as usize + self.size[0] * (y - self.low.y) as usize;
        let bits = &self.bits[column * self.words..(column + 1) * self.words];
        let (word, bit) = ((z - self.slices.start) as usize / 64, (z - self.slices.start) as u32 % 64);
        let slice = |word: usize, bit: u32| self.slices.start + (word * 64) as i32 + bit as i32;
        let mut below = self.columns[column].below;
        let mut above = self.columns[column].above;
        let here = bits[word] & (u64::MAX >> (63 - bit));
        if here != 0 {
            below = slice(word, 63 - here.leading_zeros());
        } else if let Some(word) = (0..word).rev().find(|&word| bits[word] != 0) {
            below = slice(word, 63 - bits[word].leading_zeros());
        }
        let here = bits[word] & (u64::MAX << bit);
        if here != 0 {
            above = slice(word, here.trailing_zeros());
        } else if let Some(word) = (word + 1..self.words).find(|&word| bits[word] != 0) {
            above = slice(word, bits[word].trailing_zeros());
        }
        match (below != NO_COLUMN.below, above != NO_COLUMN.above) {
            (false, false) => None,
            (true, false) => Some(below),
            (false, true) => Some(above),
            (true, true) => Some(if z - below <= above - z { below } else { above }),
        }
    }
}
