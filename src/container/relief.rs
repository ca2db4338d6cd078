//! What is printed, seen from afar: the height of every column, the box around all voxels, and a coarse closed surface.
//!
//! The surface is that of dual cells (naive surface nets, after Gibson 1998) over the share of each cell of voxels that
//! is printed: a vertex in every cube of eight cells that are not all alike, where the surface crosses its edges on
//! average. It is for looking at: its cells are a 64th of the longest edge or eight voxels.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::Vec3;
use png::{BitDepth, ColorType, Filter};

use super::{Content, Voxels};
use crate::{
    parallel,
    slice::encoder,
    voxel::{BRICK, BRICK_VOXELS, Lattice},
};

/// Cells along the longest edge.
const CELLS: f64 = 64.0;

/// Gathers heights and the surface from voxels, bottom up.
pub(super) struct Relief {
    lattice: Lattice,
    printed: [bool; 256],
    /// One more than the highest printed slice of each column, row by row from j = 0; 0 where there is none.
    heights: Vec<u32>,
    /// Bricks along the edges of a cell.
    step: [u32; 3],
    cells: [usize; 3],
    /// Printed voxels of each cell, x running fastest.
    filled: Vec<AtomicU32>,
    /// Least and one past the greatest printed voxel.
    bounds: Bounds,
}

type Bounds = ([u32; 3], [u32; 3]);

const NOWHERE: Bounds = ([u32::MAX; 3], [0; 3]);

fn around(a: Bounds, b: Bounds) -> Bounds {
    let each = |a: [u32; 3], b: [u32; 3], pick: fn(u32, u32) -> u32| std::array::from_fn(|axis| pick(a[axis], b[axis]));
    (each(a.0, b.0, u32::min), each(a.1, b.1, u32::max))
}

impl Relief {
    pub(super) fn new(content: &Content) -> Self {
        let lattice = content.lattice;
        let [width, height, _] = lattice.dims;
        let extent = (0..3).map(|axis| f64::from(lattice.dims[axis]) * lattice.pitch[axis]).fold(0.0, f64::max);
        let step: [u32; 3] = std::array::from_fn(|axis| {
            let bricks = extent / CELLS / (lattice.pitch[axis] * BRICK as f64);
            (bricks.ceil() as u32).clamp(1, u32::from(u16::MAX))
        });
        let cells = std::array::from_fn(|axis| lattice.dims[axis].div_ceil(step[axis] * BRICK as u32) as usize);
        Self {
            lattice,
            printed: content.printed_ids(),
            heights: vec![0; width as usize * height as usize],
            step,
            cells,
            filled: (0..cells.iter().product()).map(|_| AtomicU32::new(0)).collect(),
            bounds: NOWHERE,
        }
    }

    pub(super) fn take(&mut self, voxels: &dyn Voxels) {
        let width = self.lattice.dims[0] as usize;
        let [across, _, layers] = voxels.bricks();
        let (printed, step, cells, filled) = (&self.printed, self.step, self.cells, &self.filled);
        let found = parallel::map_rows(&mut self.heights, width * BRICK, |y, heights| {
            let mut ids = [0; BRICK_VOXELS];
            let mut bounds = NOWHERE;
            for z in layers.clone() {
                for x in across.clone() {
                    let at = [x, y as u32, z];
                    let uniform = voxels.brick(at, &mut ids);
                    if uniform.is_some_and(|id| !printed[usize::from(id.0)]) {
                        continue;
                    }
                    let corner = at.map(|index| index * BRICK as u32);
                    // Which x, y and z of the brick have a printed voxel, a bit each.
                    let (mut seen, mut count) = ([0_u8; 3], 0);
                    for (n, row) in ids.chunks_exact(BRICK).enumerate() {
                        let set = |(bit, id): (usize, &u8)| u8::from(printed[usize::from(*id)]) << bit;
                        let bits = if uniform.is_some() {
                            0xff
                        } else {
                            row.iter().enumerate().map(set).fold(0, |a, b| a | b)
                        };
                        if bits == 0 {
                            continue;
                        }
                        let (j, k) = (n % BRICK, n / BRICK);
                        let first = j * width + corner[0] as usize;
                        for (bit, height) in heights[first..].iter_mut().take(BRICK).enumerate() {
                            if bits >> bit & 1 != 0 {
                                *height = corner[2] + k as u32 + 1;
                            }
                        }
                        seen = [seen[0] | bits, seen[1] | 1 << j, seen[2] | 1 << k];
                        count += bits.count_ones();
                    }
                    if count == 0 {
                        continue;
                    }
                    let low = std::array::from_fn(|axis| corner[axis] + seen[axis].trailing_zeros());
                    let high = std::array::from_fn(|axis| corner[axis] + 8 - seen[axis].leading_zeros());
                    bounds = around(bounds, (low, high));
                    let [cx, cy, cz]: [usize; 3] = std::array::from_fn(|axis| (at[axis] / step[axis]) as usize);
                    filled[cx + cells[0] * (cy + cells[1] * cz)].fetch_add(count, Ordering::Relaxed);
                }
            }
            bounds
        });
        self.bounds = around(self.bounds, found.into_iter().fold(NOWHERE, around));
    }

    /// Least and greatest corner of what is printed, mm; of the lattice where nothing is.
    pub(super) fn bounds_mm(&self) -> [[f64; 3]; 2] {
        let (low, high) = if self.bounds == NOWHERE { ([0; 3], self.lattice.dims) } else { self.bounds };
        let place = |index: [u32; 3]| {
            std::array::from_fn(|axis| self.lattice.origin[axis] + f64::from(index[axis]) * self.lattice.pitch[axis])
        };
        [place(low), place(high)]
    }

    /// Heights as a picture: 16-bit grey, the number of slices up to the highest printed voxel.
    pub(super) fn heights_png(&self) -> std::io::Result<Vec<u8>> {
        let mut out = Vec::new();
        let mut encoder = encoder(&mut out, &self.lattice, ColorType::Grayscale, BitDepth::Sixteen);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_filter(Filter::Up);
        let mut writer = encoder.write_header()?;
        let mut stream = writer.stream_writer()?;
        for row in self.heights.chunks(self.lattice.dims[0] as usize).rev() {
            let grey: Vec<u8> =
                row.iter().flat_map(|&height| (height.min(u32::from(u16::MAX)) as u16).to_be_bytes()).collect();
            std::io::Write::write_all(&mut stream, &grey)?;
        }
        stream.finish()?;
        writer.finish()?;
        Ok(out)
    }

    /// Printed share of a cell; 0 beyond the lattice.
    fn share(&self, cell: [i64; 3]) -> f32 {
        if (0..3).any(|axis| cell[axis] < 0 || cell[axis] >= self.cells[axis] as i64) {
            return 0.0;
        }
        let [x, y, z] = cell.map(|index| index as usize);
        let capacity: f32 = (0..3).map(|axis| (self.step[axis] * BRICK as u32) as f32).product();
        self.filled[x + self.cells[0] * (y + self.cells[1] * z)].load(Ordering::Relaxed) as f32 / capacity
    }

    /// The coarse surface as binary STL, mm; the box of what is printed where no cell is half full.
    pub(super) fn surface_stl(&self) -> Vec<u8> {
        let mut triangles = self.surface();
        if triangles.is_empty() {
            triangles = box_triangles(self.bounds_mm().map(|corner| Vec3::from(corner.map(|value| value as f32))));
        }
        let mut out = vec![b' '; 80];
        let title = b"lumislice outline; unit mm";
        out[..title.len()].copy_from_slice(title);
        out.extend((triangles.len() as u32).to_le_bytes());
        for [a, b, c] in triangles {
            let normal = (b - a).cross(c - a).normalize_or_zero();
            for vector in [normal, a, b, c] {
                out.extend(vector.to_array().iter().flat_map(|value| value.to_le_bytes()));
            }
            out.extend([0, 0]);
        }
        out
    }

    fn surface(&self) -> Vec<[Vec3; 3]> {
        let [nx, ny, nz] = self.cells.map(|n| n as i64);
        let inside = |cell: [i64; 3]| self.share(cell) >= HALF;
        let mut triangles = Vec::new();
        // Every pair of neighbouring cells of which one is inside has a quad between them, its corners in the four
        // cubes around the pair's edge. A cube bears the index of its least cell.
        for z in -1..nz {
            for y in -1..ny {
                for x in -1..nx {
                    let cell = [x, y, z];
                    for axis in 0..3 {
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        let next = moved(cell, axis, 1);
                        let (here, there) = (inside(cell), inside(next));
                        if here == there {
                            continue;
                        }
                        let cubes = [cell, moved(cell, u, -1), moved(moved(cell, u, -1), v, -1), moved(cell, v, -1)];
                        let [a, b, c, d] = cubes.map(|cube| self.vertex(cube));
                        // Around the axis that way, seen from where the axis points to.
                        let quad = if here { [a, b, c, d] } else { [a, d, c, b] };
                        triangles.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
                    }
                }
            }
        }
        triangles
    }

    /// The vertex of the cube between eight cells, mm: the mean of where its edges are crossed.
    fn vertex(&self, cube: [i64; 3]) -> Vec3 {
        let (mut sum, mut count) = (Vec3::ZERO, 0.0);
        for corner in 0..8 {
            let from: [i64; 3] = std::array::from_fn(|axis| cube[axis] + (corner >> axis & 1));
            for axis in (0..3).filter(|axis| corner >> axis & 1 == 0) {
                let (a, b) = (self.share(from), self.share(moved(from, axis, 1)));
                if (a >= HALF) != (b >= HALF) {
                    let mut place = Vec3::from(from.map(|index| index as f32 + 0.5));
                    place[axis] += (HALF - a) / (b - a);
                    sum += place;
                    count += 1.0;
                }
            }
        }
        let cells = sum / count;
        let mm = |axis: usize| {
            let edge = f64::from(self.step[axis] * BRICK as u32) * self.lattice.pitch[axis];
            // Cells may reach beyond the lattice.
            let far = f64::from(self.lattice.dims[axis]) * self.lattice.pitch[axis];
            (self.lattice.origin[axis] + (f64::from(cells[axis]) * edge).clamp(0.0, far)) as f32
        };
        Vec3::new(mm(0), mm(1), mm(2))
    }
}

/// Share of a cell from which it is inside.
const HALF: f32 = 0.5;

fn moved(mut cell: [i64; 3], axis: usize, by: i64) -> [i64; 3] {
    cell[axis] += by;
    cell
}

fn box_triangles([low, high]: [Vec3; 2]) -> Vec<[Vec3; 3]> {
    // Corner i has bit 0 for x, bit 1 for y, bit 2 for z.
    let corner = |i: u32| Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|t| t.map(corner)).collect()
}
