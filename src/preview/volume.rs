//! The whole job in a few million cells.
//!
//! Cells tile the lattice exactly and are nearly cubic in mm. Each is sampled at eight voxels and remembers the
//! material of the first solid one, so that a shell thinner than a cell survives, and how many of the samples are
//! solid, so that the surface can be placed within the cell.
//!
//! The eight lie on four rows along x, two on each. As on a rotated grid no two share a coordinate, and the pattern
//! shifts from cell to cell: a 2×2×2 grid tells only two heights of a surface across an axis, which shows as terraces.

use std::ops::Range;

use rayon::prelude::*;

use super::{Voxels, middles};
use crate::voxel::Lattice;

/// Most cells; two bytes each.
const MAX_CELLS: f64 = 12e6;
/// Most cells along an axis.
const MAX_SIDE: f64 = 384.0;
/// Cells along the longest axis that a lattice of a few voxels gets: interpolation rounds corners off over two of them.
const MIN_SIDE: f64 = 96.0;
/// Positions that are told apart within an eighth of a cell.
const FINE: usize = 4;

/// A downsampled lattice; x runs fastest, then y, then z.
#[derive(Debug, Clone)]
pub(super) struct Volume {
    /// Cells per axis.
    pub n: [usize; 3],
    /// Edges of a cell, mm.
    pub edge: [f64; 3],
    /// Material of a cell, 0 where no sample is solid.
    pub ids: Vec<u8>,
    /// Low four bits: solid samples. High four bits: how early in the pattern the one is that named the cell.
    votes: Vec<u8>,
    dims: [u32; 3],
    /// The slice to be sampled in place of each.
    snapped: Vec<u32>,
}

/// Rows of samples per cell.
const ROWS: usize = 4;
/// Samples on a row of a cell.
const ON_ROW: usize = 2;
/// Samples per cell.
const SAMPLES: usize = ROWS * ON_ROW;
/// Where the rows of a cell are, in quarters of it: y and z, and how far the samples on them are shifted in x.
const PATTERN: [[usize; 3]; ROWS] = [[1, 0, 2], [3, 1, 0], [0, 2, 3], [2, 3, 1]];
/// What the pattern shifts by from cell to cell, as part of a quarter: golden section, hence spread evenly.
const SHIFT: f64 = 0.618_033_988_749_894_9;

impl Volume {
    /// An empty volume. `snap` maps a slice to the one to be sampled in its place and must not decrease.
    pub fn new(lattice: &Lattice, snap: impl Fn(u32) -> u32) -> Self {
        let extent: [f64; 3] = std::array::from_fn(|axis| f64::from(lattice.dims[axis]) * lattice.pitch[axis]);
        let longest = extent.iter().copied().fold(0.0, f64::max);
        let edge = (longest / MAX_SIDE)
            .max(libm::cbrt(extent.iter().product::<f64>() / MAX_CELLS))
            .max(lattice.pitch.min_element().min(longest / MIN_SIDE));
        // A hair below a whole number of cells is that number.
        let n = extent.map(|length| ((length / edge + 1e-6).floor() as usize).clamp(1, MAX_SIDE as usize));
        let cells = n.iter().product();
        Self {
            n,
            edge: std::array::from_fn(|axis| extent[axis] / n[axis] as f64),
            ids: vec![0; cells],
            votes: vec![0; cells],
            dims: lattice.dims,
            snapped: (0..lattice.dims[2]).map(snap).collect(),
        }
    }

    /// The rows (j, k) that are sampled for the cells at (y, z), with the shift in x.
    fn rows(&self, y: usize, z: usize) -> [(u32, u32, f64); ROWS] {
        let shift = |a: usize, b: usize| (a as f64 * SHIFT + b as f64 * SHIFT * SHIFT).fract();
        let voxel = |axis: usize, cell: usize, quarter: f64| {
            let position = (cell as f64 + quarter / ROWS as f64) / self.n[axis] as f64;
            ((position * f64::from(self.dims[axis])) as u32).min(self.dims[axis].saturating_sub(1))
        };
        PATTERN.map(|[across, up, along]| {
            let j = voxel(1, y, across as f64 + shift(z, 0));
            let k = voxel(2, z, up as f64 + shift(y, 0));
            (j, self.snapped.get(k as usize).copied().unwrap_or(k), along as f64 + shift(y, z))
        })
    }

    /// Takes in the samples that lie in `slices`.
    pub fn observe(&mut self, source: &impl Voxels, slices: &Range<u32>, width: usize) {
        let [nx, ny, nz] = self.n;
        // A slice that stands for others may be as far from them as they are apart.
        let reach =
            self.snapped.partition_point(|&k| k < slices.start)..self.snapped.partition_point(|&k| k < slices.end);
        if reach.is_empty() {
            return;
        }
        let cell = |k: usize| k as f64 * nz as f64 / f64::from(self.dims[2]);
        // One more on both sides: rounding puts a sample on a cell's border into either slice.
        let layers = (cell(reach.start) as usize).saturating_sub(1)..(cell(reach.end).ceil() as usize + 1).min(nz);
        let cells = layers.start * nx * ny..layers.end * nx * ny;
        // A row of cells has eight strata a cell, of which a row of samples meets two.
        let voxels: Vec<u32> = middles(nx * SAMPLES * FINE, self.dims[0]).collect();
        let (mut ids, mut votes) = (std::mem::take(&mut self.ids), std::mem::take(&mut self.votes));
        let rows = ids[cells.clone()].par_chunks_mut(nx).zip(votes[cells].par_chunks_mut(nx));
        rows.enumerate().for_each_init(
            || vec![0; width],
            |row, (n, (ids, votes))| {
                let places = self.rows(n % ny, layers.start + n / ny);
                for (number, (j, k, along)) in places.into_iter().enumerate().filter(|(_, at)| slices.contains(&at.1)) {
                    source.row(j, k, row);
                    let first = (along * FINE as f64) as usize;
                    for (x, (id, votes)) in ids.iter_mut().zip(votes.iter_mut()).enumerate() {
                        let sample = |n: usize| row[voxels[first + FINE * ROWS * (ON_ROW * x + n)] as usize];
                        merge(id, votes, (0..ON_ROW).map(|n| (ON_ROW * number + n, sample(n))));
                    }
                }
            },
        );
        (self.ids, self.votes) = (ids, votes);
    }

    /// The slices that are sampled, ascending.
    pub fn slices(&self) -> Vec<u32> {
        let cells = (0..self.n[2]).flat_map(|z| (0..self.n[1]).map(move |y| (y, z)));
        let mut slices: Vec<u32> = cells.flat_map(|(y, z)| self.rows(y, z).map(|(_, k, _)| k)).collect();
        slices.sort_unstable();
        slices.dedup();
        slices
    }

    /// Index of a cell.
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.n[0] * (y + self.n[1] * z)
    }

    /// Which part of a cell is solid, 0 to 255.
    pub fn coverage(&self, cell: usize) -> u8 {
        (usize::from(self.votes[cell] & 15) * 255 / SAMPLES) as u8
    }

    /// Makes a cell background.
    pub fn clear(&mut self, cell: usize) {
        self.ids[cell] = 0;
        self.votes[cell] = 0;
    }

    /// Extent per axis, mm.
    pub fn extent(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.n[axis] as f64 * self.edge[axis])
    }

    /// Estimated volume of every id, mm³; entry 0 stays 0.
    pub fn volumes(&self) -> [f64; 256] {
        let mut samples = [0_u64; 256];
        for (&id, &votes) in self.ids.iter().zip(&self.votes) {
            samples[usize::from(id)] += u64::from(votes & 15);
        }
        samples[0] = 0;
        let each = self.edge.iter().product::<f64>() / SAMPLES as f64;
        samples.map(|count| count as f64 * each)
    }

    /// First and last solid cell of every row along x that has one, with its y and z.
    pub fn solid_rows(&self) -> impl Iterator<Item = ([usize; 2], [usize; 2])> {
        self.ids.chunks_exact(self.n[0]).enumerate().filter_map(|(row, ids)| {
            let first = ids.iter().position(|&id| id != 0)?;
            let last = ids.iter().rposition(|&id| id != 0)?;
            Some(([first, last], [row % self.n[1], row / self.n[1]]))
        })
    }
}

/// Adds samples, each with its place in the pattern, to a cell. The first solid one names the cell, so that the result
/// depends neither on the order of slabs nor on how many a cell is spread over.
fn merge(id: &mut u8, votes: &mut u8, samples: impl Iterator<Item = (usize, u8)>) {
    for (place, sample) in samples.filter(|&(_, sample)| sample != 0) {
        let rank = (SAMPLES - place) as u8;
        if rank > *votes >> 4 {
            *id = sample;
            *votes = *votes & 15 | rank << 4;
        }
        *votes += 1;
    }
}
