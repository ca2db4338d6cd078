//! A plane of voxels, near the lattice's own resolution.

use std::ops::Range;

use super::{Voxels, middles};
use crate::parallel;
use crate::voxel::Lattice;

/// Material ids on a plane across one axis, in square pixels; row 0 is the row of the largest coordinate.
#[derive(Debug, Clone)]
pub(super) struct Section {
    /// The axis the plane is perpendicular to.
    pub normal: usize,
    /// Its index along that axis.
    pub index: u32,
    /// Extent, mm: horizontal, vertical.
    pub size_mm: [f64; 2],
    /// Pixels: horizontal, vertical.
    pub pixels: [usize; 2],
    /// One id per pixel.
    pub ids: Vec<u8>,
    columns: Vec<u32>,
    rows: Vec<u32>,
}

/// The axes that run right and up on a plane perpendicular to `normal`.
pub(super) fn plane_axes(normal: usize) -> [usize; 2] {
    [[1, 2], [0, 2], [0, 1]][normal]
}

impl Section {
    /// An empty section with at most `max_pixels` a side. `snap` maps a slice that an upright section crosses to the
    /// one sampled in its place and must not decrease.
    pub fn new(lattice: &Lattice, normal: usize, index: u32, max_pixels: usize, snap: impl Fn(u32) -> u32) -> Self {
        let [right, up] = plane_axes(normal);
        let size_mm = [right, up].map(|axis| f64::from(lattice.dims[axis]) * lattice.pitch[axis]);
        let finest = lattice.pitch[right].min(lattice.pitch[up]);
        let pixel = finest.max(size_mm[0].max(size_mm[1]) / max_pixels as f64);
        let pixels = size_mm.map(|length| ((length / pixel).round() as usize).clamp(1, max_pixels));
        let columns = middles(pixels[0], lattice.dims[right]).collect();
        let mut rows: Vec<u32> = middles(pixels[1], lattice.dims[up]).rev().collect();
        if up == 2 {
            for k in &mut rows {
                *k = snap(*k);
            }
        }
        Self { normal, index, size_mm, pixels, ids: vec![0; pixels[0] * pixels[1]], columns, rows }
    }

    /// Takes in the part that lies in `slices`.
    pub fn observe(&mut self, source: &impl Voxels, slices: &Range<u32>, width: usize) {
        let rows = if self.normal == 2 {
            if slices.contains(&self.index) { 0..self.rows.len() } else { 0..0 }
        } else {
            // Rows run from the top slice down.
            self.rows.partition_point(|&k| k >= slices.end)..self.rows.partition_point(|&k| k >= slices.start)
        };
        let Self { normal, index, ref columns, rows: ref voxels, .. } = *self;
        let pixels = &mut self.ids[rows.start * columns.len()..rows.end * columns.len()];
        parallel::rows(pixels, columns.len(), |n, ids| {
            let row = voxels[rows.start + n];
            if normal == 0 {
                for (id, &j) in ids.iter_mut().zip(columns) {
                    *id = source.voxel([index, j, row]);
                }
                return;
            }
            let (j, k) = if normal == 1 { (index, row) } else { (row, index) };
            let mut buffer = vec![0; width];
            source.row(j, k, &mut buffer);
            for (id, &i) in ids.iter_mut().zip(columns) {
                *id = buffer[i as usize];
            }
        });
    }

    /// The id at `right`, `up` mm from the lower left corner; 0 outside.
    pub fn at(&self, right: f64, up: f64) -> u8 {
        let x = (right / self.size_mm[0] * self.pixels[0] as f64).floor();
        let y = ((1.0 - up / self.size_mm[1]) * self.pixels[1] as f64).floor();
        if x < 0.0 || y < 0.0 || x >= self.pixels[0] as f64 || y >= self.pixels[1] as f64 {
            return 0;
        }
        self.ids[x as usize + self.pixels[0] * y as usize]
    }

    /// The slices this section reads.
    pub fn slices(&self) -> &[u32] {
        if self.normal == 2 { std::slice::from_ref(&self.index) } else { &self.rows }
    }
}
