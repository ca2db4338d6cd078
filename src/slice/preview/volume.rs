//! The whole job in a few million cells.
//!
//! Cells tile the lattice exactly and are nearly cubic in mm. Each is sampled at up to 2×2×2 voxels and remembers the material
//! most of the solid samples agree on, so that a shell thinner than a cell survives, and how many of the samples are solid,
//! so that the surface can be placed within the cell.

use std::ops::Range;

use rayon::prelude::*;

use super::{Voxels, middles};
use crate::voxel::Lattice;

/// Most cells; two bytes each.
const MAX_CELLS: f64 = 12e6;
/// Most cells along an axis.
const MAX_SIDE: f64 = 384.0;

/// A downsampled lattice; x runs fastest, then y, then z.
#[derive(Debug, Clone)]
pub(super) struct Volume {
    /// Cells per axis.
    pub n: [usize; 3],
    /// Edges of a cell, mm.
    pub edge: [f64; 3],
    /// Material of a cell, 0 where no sample is solid.
    pub ids: Vec<u8>,
    /// Low four bits: solid samples. High four bits: those that agree with the id.
    votes: Vec<u8>,
    /// Samples per cell and axis.
    samples: [usize; 3],
    /// The voxels to sample, per axis, `n · samples` of them.
    voxels: [Vec<u32>; 3],
}

impl Volume {
    /// An empty volume. `snap` maps a slice to the one to be sampled in its place and must not decrease.
    pub fn new(lattice: &Lattice, snap: impl Fn(u32) -> u32) -> Self {
        let extent: [f64; 3] = std::array::from_fn(|axis| f64::from(lattice.dims[axis]) * lattice.pitch[axis]);
        let longest = extent.iter().copied().fold(0.0, f64::max);
        let edge = (longest / MAX_SIDE)
            .max((extent.iter().product::<f64>() / MAX_CELLS).cbrt())
            .max(lattice.pitch.min_element());
        // A hair above a whole number of cells is that number.
        let n = extent.map(|length| ((length / edge + 1e-6).floor() as usize).clamp(1, MAX_SIDE as usize));
        let samples = std::array::from_fn(|axis| if lattice.dims[axis] as usize >= 2 * n[axis] { 2 } else { 1 });
        let mut voxels: [Vec<u32>; 3] =
            std::array::from_fn(|axis| middles(n[axis] * samples[axis], lattice.dims[axis]).collect());
        for k in &mut voxels[2] {
            *k = snap(*k);
        }
        let cells = n.iter().product();
        Self {
            n,
            edge: std::array::from_fn(|axis| extent[axis] / n[axis] as f64),
            ids: vec![0; cells],
            votes: vec![0; cells],
            samples,
            voxels,
        }
    }

    /// Takes in the samples that lie in `slices`.
    pub fn observe(&mut self, source: &impl Voxels, slices: &Range<u32>, width: usize) {
        let [nx, ny, _] = self.n;
        let [sx, sy, sz] = self.samples;
        let [xs, ys, zs] = &self.voxels;
        let taken = zs.partition_point(|&k| k < slices.start)..zs.partition_point(|&k| k < slices.end);
        if taken.is_empty() {
            return;
        }
        let layers = taken.start / sz..taken.end.div_ceil(sz);
        let cells = layers.start * nx * ny..layers.end * nx * ny;
        let rows = self.ids[cells.clone()].par_chunks_mut(nx).zip(self.votes[cells].par_chunks_mut(nx));
        rows.enumerate().for_each_init(
            || (vec![0; width], Vec::new()),
            |(row, gathered), (n, (ids, votes))| {
                let (y, z) = (n % ny, layers.start + n / ny);
                let inner = (z * sz).max(taken.start)..((z + 1) * sz).min(taken.end);
                let per_cell = sx * sy * inner.len();
                gathered.clear();
                gathered.resize(nx * per_cell, 0_u8);
                let mut at = 0;
                for &k in &zs[inner] {
                    for &j in &ys[y * sy..(y + 1) * sy] {
                        source.row(j, k, row);
                        for (cell, xs) in gathered.chunks_exact_mut(per_cell).zip(xs.chunks_exact(sx)) {
                            for (sample, &i) in cell[at..at + sx].iter_mut().zip(xs) {
                                *sample = row[i as usize];
                            }
                        }
                        at += sx;
                    }
                }
                for ((id, votes), samples) in ids.iter_mut().zip(votes).zip(gathered.chunks_exact(per_cell)) {
                    merge(id, votes, samples);
                }
            },
        );
    }

    /// The slices that are sampled.
    pub fn slices(&self) -> &[u32] {
        &self.voxels[2]
    }

    /// Index of a cell.
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.n[0] * (y + self.n[1] * z)
    }

    /// Which part of a cell is solid, 0 to 255.
    pub fn coverage(&self, cell: usize) -> u8 {
        (usize::from(self.votes[cell] & 15) * 255 / self.samples.iter().product::<usize>()) as u8
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
        let each = self.edge.iter().product::<f64>() / self.samples.iter().product::<usize>() as f64;
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

/// Adds samples to a cell. The result does not depend on the order: most votes win, and of equals the lower id.
fn merge(id: &mut u8, votes: &mut u8, samples: &[u8]) {
    let first = samples[0];
    let (winner, count, solid) = if samples.iter().all(|&sample| sample == first) {
        (first, samples.len() as u8, if first == 0 { 0 } else { samples.len() as u8 })
    } else {
        let mut best = (0, 0);
        for &sample in samples.iter().filter(|&&sample| sample != 0) {
            let count = samples.iter().filter(|&&other| other == sample).count() as u8;
            if count > best.1 || count == best.1 && sample < best.0 {
                best = (sample, count);
            }
        }
        (best.0, best.1, samples.iter().filter(|&&sample| sample != 0).count() as u8)
    };
    if winner == 0 {
        return;
    }
    let (known, agreed) = (*votes & 15, *votes >> 4);
    let agreed = match winner == *id {
        true => agreed + count,
        false if count > agreed || count == agreed && winner < *id => {
            *id = winner;
            count
        }
        false => agreed,
    };
    *votes = (known + solid) | agreed << 4;
}
