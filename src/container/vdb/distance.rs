//! Signed distances from the boundary of what is printed, in a narrow band around it.
//!
//! The boundary is made of faces: those between a voxel of the object and one of nothing. So distances are known from
//! voxels alone, and a job and its finished folder give the same distances, except where support lies open; from the
//! mesh's surface they are off by what its voxels are. The distance of a voxel's centre from it is that from the
//! nearest voxel of the other kind, a box:
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
use half::{f16, slice::HalfFloatSliceExt};

use super::{
    compressed, in_leaf_order, mask_of,
    tree::{Inactive, Leaf, Tree},
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
// A word holds a row of a brick and of all bricks within reach to either side.
const _: () = assert!(BRICK * (1 + 2 * MAX_REACH.div_ceil(BRICK)) < u64::BITS as usize);

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

    /// The bits of a word within reach of a brick's own.
    fn window(&self) -> u64 {
        ((1 << (BRICK + 2 * self.reach[0])) - 1) << (BRICK * self.halo[0] - self.reach[0])
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

/// A number for each voxel of a row along x.
type Row = [f32; BRICK];

/// Rows of a brick.
const ROWS: usize = BRICK * BRICK;

/// Buffers of one worker.
#[derive(Default)]
struct Scratch {
    /// Bits of whole rows of the brick and of what lies within reach, a byte for each brick along x.
    words: Vec<u64>,
    /// Squares of distances along x from the nearest voxel of one kind.
    rows: Vec<Row>,
    /// The same along x and y, from the nearest outside and from the nearest inside voxel.
    planes: [Vec<Row>; 2],
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

    /// The tree, to be sorted.
    pub(super) fn tree_mut(&mut self) -> &mut Tree {
        &mut self.tree
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
                    _ => found.extend(self.piece(at, scratch)?.map(|piece| (at, piece))),
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

    /// What a brick adds; nothing where all of it is outside and further than the band.
    fn piece(&self, at: [i32; 3], scratch: &mut Scratch) -> io::Result<Option<Piece>> {
        self.gather(at, &mut scratch.words);
        let window = self.band.window();
        let (some, every) = scratch.words.iter().fold((0, window), |(some, every), word| (some | word, every & word));
        if some & window == 0 {
            return Ok(None);
        }
        if every == window {
            return Ok(Some(Piece::Inside));
        }
        let own = self.cell(at);
        let rows = self.measure(&std::array::from_fn(|row| own.row(row)), scratch);
        let mut halves = [f16::ZERO; BRICK_VOXELS];
        halves.convert_from_f32_slice(rows.as_flattened());
        self.leaf(&in_leaf_order(&halves))
    }

    /// Gathers the bits of the rows within reach of a brick, along y and then z; its own voxels are those from 8 times
    /// the halo on.
    fn gather(&self, at: [i32; 3], words: &mut Vec<u64>) {
        let Band { reach, halo, .. } = &self.band;
        let [hx, hy, hz] = halo.map(|halo| halo as i32);
        let [rows_y, rows_z] = [1, 2].map(|axis| BRICK + 2 * reach[axis]);
        let within_brick = |n: usize, axis: usize| (n + BRICK * halo[axis] - reach[axis]) % BRICK;
        words.clear();
        words.resize(rows_y * rows_z, 0);
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
                    words[y + rows_y * z] |= u64::from(bits) << (BRICK as i32 * (dx + hx));
                }
            }
        }
    }

    /// Signed distances of a brick's voxels from the words around it, right as far as they lie within the band; `own`
    /// are its own rows.
    fn measure(&self, own: &[u8; ROWS], scratch: &mut Scratch) -> [Row; ROWS] {
        let Band { halo, squares, .. } = &self.band;
        let window = self.band.window();
        let Scratch { words, rows, planes } = scratch;
        // What is outside is measured from what is inside, and the other way round.
        let is_asked = [own.iter().any(|row| *row != 0), own.iter().any(|row| *row != u8::MAX)];
        for (kind, planes) in planes.iter_mut().enumerate().filter(|(kind, _)| is_asked[*kind]) {
            let flip = if kind == 0 { u64::MAX } else { 0 };
            rows.clear();
            rows.extend(words.iter().map(|word| nearest_bits((word ^ flip) & window, BRICK * halo[0], &squares[0])));
            planes.clear();
            planes.resize(rows.len() / (BRICK + 2 * self.band.reach[1]) * BRICK, [0.0; BRICK]);
            along_y(rows, &squares[1], planes);
        }
        along_z(own, [&planes[0], &planes[1]], &squares[2])
    }

    /// The leaf of such distances; nothing or a tile where none is within the band.
    fn leaf(&self, distances: &[f16; BRICK_VOXELS]) -> io::Result<Option<Piece>> {
        // Of positive numbers, the bits are in the order of the numbers.
        let half_width = f16::from_f32(self.band.half_width).to_bits();
        let is_active = |distance: f16| distance.to_bits() & !SIGN < half_width;
        let mask = mask_of(distances, is_active);
        let outside = mask_of(distances, |distance| distance.to_bits() & SIGN == 0);
        let mut values = Vec::with_capacity(BRICK_VOXELS);
        values.extend(distances.iter().filter(|distance| is_active(**distance)).map(|distance| distance.to_le_bytes()));
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
        Ok(Some(Piece::Leaf(Leaf { mask, values: Some(compressed(values.as_flattened())?), inactive })))
    }
}

/// The bit of a number's sign in 16 bits.
const SIGN: u16 = 1 << 15;

/// Squares of the distances along x from the nearest set bit, from the bits `first` to `first` + 7; infinite beyond
/// the reach.
fn nearest_bits(word: u64, first: usize, squares: &[f32]) -> Row {
    if word == 0 {
        return [f32::INFINITY; BRICK];
    }
    if (word >> first) & 0xff == 0xff {
        return [0.0; BRICK];
    }
    std::array::from_fn(|x| {
        let bit = first + x;
        let above = (word >> bit).trailing_zeros();
        let below = (word << (63 - bit)).leading_zeros();
        squares.get(above.min(below) as usize).copied().unwrap_or(f32::INFINITY)
    })
}

/// Squares of distances along x and y from those along x.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn along_y(rows: &[Row], squares: &[f32], planes: &mut [Row]) {
    let rows_y = BRICK + 2 * (squares.len() - 1);
    for (rows, plane) in rows.chunks_exact(rows_y).zip(planes.chunks_exact_mut(BRICK)) {
        for (y, nearest) in plane.iter_mut().enumerate() {
            *nearest = least(rows[y..].iter().take(rows_y - BRICK + 1), squares);
        }
    }
}

/// Signed distances from the squares of those along x and y from both kinds; `planes[kind]` may be stale where no voxel
/// of the brick is of the other kind.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn along_z(own: &[u8; ROWS], planes: [&[Row]; 2], squares: &[f32]) -> [Row; ROWS] {
    let rows_z = 2 * (squares.len() - 1) + 1;
    std::array::from_fn(|n| {
        let from = |kind: usize| least(planes[kind][n..].iter().step_by(BRICK).take(rows_z), squares);
        let to_outside = if own[n] == 0 { [0.0; BRICK] } else { from(0) };
        let to_inside = if own[n] == u8::MAX { [0.0; BRICK] } else { from(1) };
        std::array::from_fn(|x| match own[n] >> x & 1 {
            0 => to_inside[x].sqrt(),
            _ => -to_outside[x].sqrt(),
        })
    })
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
