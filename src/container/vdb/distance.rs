//! Signed distances from the boundary of what is printed, in a narrow band around it.
//!
//! The boundary is made of faces: those between a voxel of the object and one of nothing. So distances are known from
//! voxels alone, and a job and its folder have the same, but where support lies open; from the mesh's surface they are off by what its voxels are.
//! The distance of a voxel's centre from it is that from the nearest voxel of the other kind, a box:
//!
//! ```text
//!   d² = min over voxels of the other kind, δ indices away, of Σ ((|δ_a| − ½)⁺ p_a)²     a: x, y, z; p: pitch
//! ```
//!
//! A sum over axes, so minima are taken along one axis after the other, as Saito and Toriwaki (1994, *New algorithms
//! for Euclidean distance transformation*) do for squares of whole indices; exact but for single precision. Nothing
//! beyond the band is asked for, so a brick needs the bits of the bricks next to it and no more. Layers of bricks are
//! held until those above them are there.

use std::{collections::VecDeque, io};

use glam::DVec3;
use half::f16;

use super::{
    compressed,
    tree::{Inactive, Leaf, Tree},
    turned,
};
use crate::{
    parallel,
    voxel::{BRICK, BRICK_VOXELS, Lattice, MaterialId},
};

/// Half of the band's width, in edges of a cube that is as large as a voxel: what OpenVDB's level sets have.
const HALF_WIDTH: f64 = 3.0;
/// Half of the band's width at least, in the longest edges of a voxel, so that all voxels at the boundary are in it.
const LEAST_HALF_WIDTH: f64 = 1.5;
/// The furthest that a voxel of the band may be from the boundary, in voxels: a row of three bricks to either side.
const MAX_REACH: usize = 24;

/// What of a brick is inside.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell {
    Outside,
    Inside,
    /// Bit x of byte y + 8z.
    Both(Box<[u8; BRICK_VOXELS / 8]>),
}

impl Cell {
    /// Of a brick of one material.
    pub(super) fn uniform(id: MaterialId) -> Self {
        if id == MaterialId::BACKGROUND { Self::Outside } else { Self::Inside }
    }

    /// Of a brick of several, of which nothing may be one.
    pub(super) fn of(ids: &[u8; BRICK_VOXELS]) -> Self {
        if !ids.contains(&0) {
            return Self::Inside;
        }
        let mut bits = Box::new([0; BRICK_VOXELS / 8]);
        for (byte, row) in bits.iter_mut().zip(ids.as_chunks::<BRICK>().0) {
            *byte = (0..BRICK).fold(0, |bits, x| bits | u8::from(row[x] != 0) << x);
        }
        Self::Both(bits)
    }

    fn kinds(&self) -> u8 {
        match self {
            Self::Outside => OUTSIDE,
            Self::Inside => INSIDE,
            Self::Both(_) => OUTSIDE | INSIDE,
        }
    }

    fn row(&self, row: usize) -> u8 {
        match self {
            Self::Outside => 0,
            Self::Inside => u8::MAX,
            Self::Both(bits) => bits[row],
        }
    }
}

const OUTSIDE: u8 = 1;
const INSIDE: u8 = 2;

/// How far the band reaches.
#[derive(Debug, Clone)]
struct Band {
    /// mm, a number that 16 bits hold.
    half_width: f32,
    /// The most voxels from a voxel of the band to the nearest of the other kind.
    reach: [usize; 3],
    /// The same in bricks.
    halo: [usize; 3],
    /// What an index difference adds to the square of the distance, mm².
    squares: [Vec<f32>; 3],
}

impl Band {
    /// `None` where a voxel is so much longer than wide that the band would reach too far.
    fn new(pitch: DVec3) -> Option<Self> {
        let edge = libm::cbrt(pitch.element_product());
        let wide = (HALF_WIDTH * edge).max(LEAST_HALF_WIDTH * pitch.max_element());
        let half_width = f16::from_f64(wide).to_f32();
        let reach = pitch.to_array().map(|pitch| (f64::from(half_width) / pitch + 0.5).floor());
        if !(reach.iter().all(|reach| *reach <= MAX_REACH as f64)) {
            return None;
        }
        let reach = reach.map(|reach| reach as usize);
        let square = |axis: usize, n: usize| {
            let way = (n as f64 - 0.5).max(0.0) * pitch[axis];
            (way * way) as f32
        };
        Some(Self {
            half_width,
            reach,
            halo: reach.map(|reach| reach.div_ceil(BRICK)),
            squares: std::array::from_fn(|axis| (0..=reach[axis]).map(|n| square(axis, n)).collect()),
        })
    }
}

/// A layer of bricks.
#[derive(Debug)]
struct Layer {
    cells: Vec<Cell>,
    /// Which kinds there are within the halo along x and y, of the bricks and of the halo around them.
    around: Vec<u8>,
}

/// The grid being made, layer by layer from the lowest on.
#[derive(Debug)]
pub(super) struct Distances {
    band: Band,
    /// Bricks along x and y.
    bricks: [usize; 2],
    layers: VecDeque<Layer>,
    /// Number of the lowest layer held.
    lowest: i32,
    /// Number of the layer that comes next into the grid.
    next: i32,
    tree: Tree,
}

/// What a brick adds to the grid.
enum Piece {
    /// All of it is inside, further than the band.
    Inside,
    Leaf(Leaf),
}

/// Squares of distances from the nearest voxel of one kind, x by x.
type Row = [f32; BRICK];

/// Buffers of one worker.
#[derive(Default)]
struct Scratch {
    /// From the nearest outside and the nearest inside voxel of each row.
    rows: [Vec<Row>; 2],
    planes: Vec<Row>,
    squares: [Vec<Row>; 2],
    words: Vec<u64>,
}

impl Distances {
    /// None yet; `None` for lattices that have none, of voxels more than some 16 times as long as wide.
    pub(super) fn new(lattice: &Lattice) -> Option<Self> {
        let band = Band::new(lattice.pitch)?;
        Some(Self {
            bricks: [0, 1].map(|axis| (lattice.dims[axis] as usize).div_ceil(BRICK)),
            layers: VecDeque::new(),
            lowest: 0,
            next: -(band.halo[2] as i32),
            tree: Tree::signed(band.half_width),
            band,
        })
    }

    /// Half of the band's width, mm, which is the background.
    pub(super) fn half_width(&self) -> f32 {
        self.band.half_width
    }

    pub(super) fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Takes in the next layer of bricks, x fastest.
    pub(super) fn take(&mut self, cells: Vec<Cell>) -> io::Result<()> {
        let around = self.around(&cells);
        self.layers.push_back(Layer { cells, around });
        let known = self.lowest + self.layers.len() as i32;
        while self.next + (self.band.halo[2] as i32) < known {
            self.add_next()?;
        }
        Ok(())
    }

    /// Ends the grid: nothing lies above the layers that were taken in.
    pub(super) fn finish(&mut self) -> io::Result<()> {
        let end = self.lowest + self.layers.len() as i32 + self.band.halo[2] as i32;
        while self.next < end {
            self.add_next()?;
        }
        Ok(())
    }

    /// Kinds within the halo along x and y.
    fn around(&self, cells: &[Cell]) -> Vec<u8> {
        let [nx, ny] = self.bricks;
        let [hx, hy, _] = self.band.halo;
        let wide = nx + 2 * hx;
        let window = |n: usize, halo: usize, count: usize| {
            let (first, end) = (n.saturating_sub(2 * halo), (n + 1).min(count));
            (first..end, if n < 2 * halo || n >= count { OUTSIDE } else { 0 })
        };
        let mut along_x = vec![0; wide * ny];
        for (row, cells) in along_x.chunks_mut(wide).zip(cells.chunks(nx)) {
            for (x, kinds) in row.iter_mut().enumerate() {
                let (from, beyond) = window(x, hx, nx);
                *kinds = cells[from].iter().fold(beyond, |kinds, cell| kinds | cell.kinds());
            }
        }
        let mut around = vec![0; wide * (ny + 2 * hy)];
        for (y, row) in around.chunks_mut(wide).enumerate() {
            let (from, beyond) = window(y, hy, ny);
            for (x, kinds) in row.iter_mut().enumerate() {
                *kinds = from.clone().fold(beyond, |kinds, y| kinds | along_x[x + wide * y]);
            }
        }
        around
    }

    /// A layer that is held; all others that are asked for hold nothing.
    fn layer(&self, z: i32) -> Option<&Layer> {
        self.layers.get(usize::try_from(z - self.lowest).ok()?)
    }

    /// Adds the next layer to the grid, and drops what is needed no more.
    fn add_next(&mut self) -> io::Result<()> {
        let [wide, rows] = [0, 1].map(|axis| self.bricks[axis] + 2 * self.band.halo[axis]);
        let [hx, hy, hz] = self.band.halo.map(|halo| halo as i32);
        let z = self.next;
        let kinds = |at: usize| {
            let of = |z| self.layer(z).map_or(OUTSIDE, |layer| layer.around[at]);
            (z - hz..=z + hz).fold(0, |kinds, z| kinds | of(z))
        };
        let row = |scratch: &mut Scratch, y: usize| -> io::Result<Vec<([i32; 3], Piece)>> {
            let mut found = Vec::new();
            for x in 0..wide {
                let at = [x as i32 - hx, y as i32 - hy, z];
                match kinds(x + wide * y) {
                    OUTSIDE => {}
                    INSIDE => found.push((at, Piece::Inside)),
                    _ => {
                        self.measure(at, scratch);
                        found.extend(self.piece(at, scratch)?.map(|piece| (at, piece)));
                    }
                }
            }
            Ok(found)
        };
        let found: Vec<io::Result<_>> = parallel::map_in(rows, Scratch::default, row);
        for row in found {
            for (at, piece) in row? {
                match piece {
                    Piece::Inside => self.tree.set_tile(at, (-self.band.half_width).to_bits() as i32),
                    Piece::Leaf(leaf) => self.tree.set_leaf(at, leaf),
                }
            }
        }
        self.next += 1;
        while self.lowest < self.next - hz && self.layers.pop_front().is_some() {
            self.lowest += 1;
        }
        Ok(())
    }

    fn cell(&self, [x, y, z]: [i32; 3]) -> &Cell {
        let [nx, ny] = self.bricks;
        let within = |value: i32, count: usize| usize::try_from(value).ok().filter(|value| *value < count);
        match (self.layer(z), within(x, nx), within(y, ny)) {
            (Some(layer), Some(x), Some(y)) => &layer.cells[x + nx * y],
            _ => &Cell::Outside,
        }
    }

    /// Finds the squares of a brick's distances from both kinds, as far as they lie within the band.
    fn measure(&self, at: [i32; 3], scratch: &mut Scratch) {
        let Band { reach, halo, squares, .. } = &self.band;
        let [hx, hy, hz] = halo.map(|halo| halo as i32);
        let [rows_y, rows_z] = [1, 2].map(|axis| BRICK + 2 * reach[axis]);
        // Bits of whole rows, the brick's own from 8 hx on.
        let within_brick = |n: usize, axis: usize| (n + BRICK * halo[axis] - reach[axis]) % BRICK;
        scratch.words.clear();
        scratch.words.resize(rows_y * rows_z, 0);
        for (dz, dy, dx) in
            (-hz..=hz).flat_map(|dz| (-hy..=hy).flat_map(move |dy| (-hx..=hx).map(move |dx| (dz, dy, dx))))
        {
            let cell = self.cell([at[0] + dx, at[1] + dy, at[2] + dz]);
            if *cell == Cell::Outside {
                continue;
            }
            let within = |d: i32, axis: usize| {
                // Rows of the neighbour d bricks away.
                let first = BRICK as i32 * d + reach[axis] as i32;
                let count = (BRICK + 2 * reach[axis]) as i32;
                first.clamp(0, count) as usize..(first + BRICK as i32).clamp(0, count) as usize
            };
            for z in within(dz, 2) {
                for y in within(dy, 1) {
                    let bits = cell.row(within_brick(y, 1) + BRICK * within_brick(z, 2));
                    scratch.words[y + rows_y * z] |= u64::from(bits) << (BRICK as i32 * (dx + hx));
                }
            }
        }
        for rows in &mut scratch.rows {
            rows.clear();
            rows.resize(rows_y * rows_z, [0.0; BRICK]);
        }
        let bits = BRICK * (2 * halo[0] + 1);
        let all = u64::MAX >> (64 - bits);
        let [outside, inside] = &mut scratch.rows;
        for ((word, to_outside), to_inside) in scratch.words.iter().zip(outside).zip(inside) {
            nearest_bits(all & !word, BRICK * halo[0], &squares[0], to_outside);
            nearest_bits(*word, BRICK * halo[0], &squares[0], to_inside);
        }
        for (rows, found) in scratch.rows.iter().zip(&mut scratch.squares) {
            scratch.planes.clear();
            scratch.planes.resize(BRICK * rows_z, [0.0; BRICK]);
            found.clear();
            found.resize(BRICK * BRICK, [0.0; BRICK]);
            nearest_rows(rows, &squares[1], &squares[2], &mut scratch.planes, found);
        }
    }

    /// What a brick adds, its distances found; nothing where all of it is outside and further than the band.
    fn piece(&self, at: [i32; 3], scratch: &Scratch) -> io::Result<Option<Piece>> {
        let own = self.cell(at);
        let half_width = self.band.half_width;
        let (mut mask, mut outside) = ([0_u64; 8], [0_u64; 8]);
        let mut values = Vec::with_capacity(2 * BRICK_VOXELS);
        for x in 0..BRICK {
            for (y, z) in (0..BRICK).flat_map(|y| (0..BRICK).map(move |z| (y, z))) {
                let row = y + BRICK * z;
                let is_inside = own.row(row) >> x & 1 != 0;
                let n = turned(x + BRICK * row);
                let square = scratch.squares[usize::from(!is_inside)][row][x];
                if !is_inside {
                    outside[n / 64] |= 1 << (n % 64);
                }
                if square >= half_width * half_width {
                    continue;
                }
                let distance = f16::from_f32(square.sqrt());
                // 16 bits may round it up to what is not in the band.
                if distance.to_f32() < half_width {
                    mask[n / 64] |= 1 << (n % 64);
                    values.extend(if is_inside { -distance } else { distance }.to_le_bytes());
                }
            }
        }
        if values.is_empty() {
            // Voxels of the other kind next to one are in the band, so all are of one kind.
            return Ok((outside[0] == 0).then_some(Piece::Inside));
        }
        let beyond = |of: fn(u64) -> u64| mask.iter().zip(&outside).any(|(mask, outside)| !mask & of(*outside) != 0);
        let inactive = match (beyond(|outside| outside), beyond(|outside| !outside)) {
            (_, false) => Inactive::Background,
            (false, true) => Inactive::Negative,
            (true, true) => Inactive::Either(Box::new(outside)),
        };
        Ok(Some(Piece::Leaf(Leaf { mask, values: Some(compressed(&values)?), inactive })))
    }
}

/// Squares of the distances along x from the nearest set bit, from the bits `first` to `first` + 7; infinite beyond
/// the reach.
fn nearest_bits(word: u64, first: usize, squares: &[f32], row: &mut Row) {
    if word == 0 {
        return row.fill(f32::INFINITY);
    }
    if (word >> first) & 0xff == 0xff {
        return row.fill(0.0);
    }
    for (x, square) in row.iter_mut().enumerate() {
        let bit = first + x;
        let above = (word >> bit).trailing_zeros();
        let below = (word << (63 - bit)).leading_zeros();
        *square = squares.get(above.min(below) as usize).copied().unwrap_or(f32::INFINITY);
    }
}

/// Squares of distances from the nearest voxel of a kind, from those along x: along y into `planes`, along z into
/// `found`.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn nearest_rows(rows: &[Row], along_y: &[f32], along_z: &[f32], planes: &mut [Row], found: &mut [Row]) {
    let rows_y = BRICK + 2 * (along_y.len() - 1);
    for (rows, plane) in rows.chunks_exact(rows_y).zip(planes.chunks_exact_mut(BRICK)) {
        for (y, nearest) in plane.iter_mut().enumerate() {
            *nearest = least(rows[y..].iter().take(rows_y - BRICK + 1), along_y);
        }
    }
    let rows_z = 2 * (along_z.len() - 1) + 1;
    for (n, nearest) in found.iter_mut().enumerate() {
        *nearest = least(planes[n..].iter().step_by(BRICK).take(rows_z), along_z);
    }
}

/// The least of rows with the squares of their distances from the middle one.
#[inline(always)]
fn least<'a>(rows: impl Iterator<Item = &'a Row>, squares: &[f32]) -> Row {
    let mut least = [f32::INFINITY; BRICK];
    for (n, row) in rows.enumerate() {
        let square = squares[n.abs_diff(squares.len() - 1)];
        for (least, value) in least.iter_mut().zip(row) {
            let value = value + square;
            *least = if value < *least { value } else { *least };
        }
    }
    least
}
