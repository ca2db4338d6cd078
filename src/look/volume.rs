//! What is printed, for light to go through: every voxel of a job as sparse bricks.
//!
//! ```text
//!   brick  8 × 8 × 8 voxels    one word: an id for all of them, or where its 512 ids lie
//! ```
//!
//! Filled from slabs as the slicer streams them, or from rows of a finished folder's slices; the same voxels either
//! way. Memory is 4 bytes a brick and 128 to 512 bytes for each that is not of one material, as its ids need.

use std::ops::Range;

use super::packed::PackedBricks;
use crate::voxel::{BRICK, BRICK_VOXELS, Lattice, MaterialId, Slab, Tile};

/// Marks a brick of one material.
const UNIFORM: u32 = 1 << 31;
/// Most bricks: 2 GB of words for them, 260 G voxels' worth of which most must be uniform.
const MAX_BRICKS: usize = 1 << 29;

/// The voxels of a job.
#[derive(Debug, Clone)]
pub struct Volume {
    lattice: Lattice,
    bricks: [usize; 3],
    tiles: Vec<u32>,
    pool: PackedBricks,
}

/// A lattice of more voxels than can be held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "lattice: found {} × {} × {} voxels, expected at most {} G to send light through", dims[0], dims[1], dims[2],
    MAX_BRICKS * BRICK_VOXELS / 1_000_000_000
)]
pub struct VolumeTooLarge {
    /// Voxels per axis.
    pub dims: [u32; 3],
}

impl crate::blame::Blamed for VolumeTooLarge {}

impl Volume {
    /// Slices that make a layer of bricks.
    pub const LAYER: u32 = BRICK as u32;

    /// A volume of nothing.
    ///
    /// # Errors
    /// [`VolumeTooLarge`].
    pub fn new(lattice: Lattice) -> Result<Self, VolumeTooLarge> {
        let bricks = lattice.dims.map(|dim| (dim as usize).div_ceil(BRICK));
        let count = bricks.iter().try_fold(1_usize, |product, &n| product.checked_mul(n));
        let count = count.filter(|count| *count <= MAX_BRICKS).ok_or(VolumeTooLarge { dims: lattice.dims })?;
        Ok(Self { lattice, bricks, tiles: vec![UNIFORM; count], pool: PackedBricks::new(count) })
    }

    /// Takes in a slab of the same lattice.
    pub fn add(&mut self, slab: &Slab) {
        let layers = slab.slices().start as usize / BRICK..(slab.slices().end as usize).div_ceil(BRICK);
        let first = layers.start;
        for z in layers {
            for y in 0..self.bricks[1] {
                for x in 0..self.bricks[0] {
                    match slab.tile([x, y, z - first]) {
                        Tile::Uniform(id) => self.set_uniform([x, y, z], id),
                        Tile::Dense(ids) => self.set(ids, [x, y, z]),
                    }
                }
            }
        }
    }

    /// Takes in up to eight slices that make a layer of bricks: `rows(j, k, row)` copies the ids of row (j, k) into
    /// `row`.
    pub fn add_slices(&mut self, slices: Range<u32>, mut rows: impl FnMut(u32, u32, &mut [u8])) {
        let [nx, ny, _] = self.lattice.dims.map(|dim| dim as usize);
        let z = slices.start as usize / BRICK;
        let mut row = vec![0; nx];
        let mut bricks = vec![[0_u8; BRICK_VOXELS]; self.bricks[0]];
        for y in 0..self.bricks[1] {
            bricks.iter_mut().for_each(|brick| brick.fill(0));
            for k in slices.clone() {
                for j in y * BRICK..ny.min((y + 1) * BRICK) {
                    rows(j as u32, k, &mut row);
                    let at = BRICK * (j % BRICK + BRICK * (k as usize % BRICK));
                    for (brick, ids) in bricks.iter_mut().zip(row.chunks(BRICK)) {
                        brick[at..at + ids.len()].copy_from_slice(ids);
                    }
                }
            }
            for (x, brick) in bricks.iter().enumerate() {
                self.set(brick, [x, y, z]);
            }
        }
    }

    fn set_uniform(&mut self, at: [usize; 3], id: MaterialId) {
        let brick = self.brick(at);
        self.tiles[brick] = UNIFORM | u32::from(id.0);
    }

    fn set(&mut self, ids: &[u8; BRICK_VOXELS], at: [usize; 3]) {
        if ids.iter().all(|id| *id == ids[0]) {
            return self.set_uniform(at, MaterialId(ids[0]));
        }
        let brick = self.brick(at);
        self.tiles[brick] = self.pool.len() as u32;
        self.pool.push(ids);
    }

    fn brick(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.bricks[0] * (y + self.bricks[1] * z)
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Bricks per axis.
    pub(super) fn bricks(&self) -> [usize; 3] {
        self.bricks
    }

    /// The content of a brick, x fastest, unpacked into `ids` if it is not of one material.
    #[inline]
    pub(super) fn tile<'a>(&self, brick: usize, ids: &'a mut [u8; BRICK_VOXELS]) -> Tile<'a> {
        let tile = self.tiles[brick];
        if tile & UNIFORM != 0 {
            return Tile::Uniform(MaterialId(tile as u8));
        }
        *ids = self.pool.ids(tile as usize);
        Tile::Dense(ids)
    }

    /// The content of the brick at `[x, y, z]`, as [`Self::tile`] has it.
    pub(crate) fn tile_at<'a>(&self, at: [usize; 3], ids: &'a mut [u8; BRICK_VOXELS]) -> Tile<'a> {
        self.tile(self.brick(at), ids)
    }

    /// Whether nothing is printed in a brick.
    pub(super) fn is_void(&self, brick: usize) -> bool {
        self.tiles[brick] == VOID
    }

    /// The id of voxel `[x, y, z]` of a brick.
    #[inline(always)]
    pub(super) fn id_in(&self, brick: usize, [x, y, z]: [usize; 3]) -> u8 {
        let tile = self.tiles[brick];
        if tile & UNIFORM != 0 {
            return tile as u8;
        }
        self.pool.id(tile as usize, (x & 7) | (y & 7) << 3 | (z & 7) << 6)
    }

    /// The material of a voxel; the background beyond the lattice.
    pub fn voxel(&self, [i, j, k]: [i64; 3]) -> MaterialId {
        let within = |at: i64, axis: usize| (0..i64::from(self.lattice.dims[axis])).contains(&at);
        if !(within(i, 0) && within(j, 1) && within(k, 2)) {
            return MaterialId::BACKGROUND;
        }
        let at = [i, j, k].map(|at| at as usize);
        MaterialId(self.id_in(self.brick(at.map(|at| at / BRICK)), at))
    }

    /// Which ids occur.
    pub fn present(&self) -> [bool; 256] {
        let mut present = [false; 256];
        self.tiles.iter().filter(|tile| *tile & UNIFORM != 0).for_each(|tile| present[usize::from(*tile as u8)] = true);
        (0..self.pool.len()).flat_map(|brick| self.pool.ids(brick)).for_each(|id| present[usize::from(id)] = true);
        present
    }

    /// Voxels of an id within the lattice.
    pub fn count(&self, id: MaterialId) -> u64 {
        let [across, up, _] = self.bricks;
        let within = |(brick, tile): (usize, &u32)| {
            if tile & UNIFORM == 0 {
                return self.pool.ids(*tile as usize).iter().filter(|other| **other == id.0).count() as u64;
            }
            let at = [brick % across, brick / across % up, brick / (across * up)];
            let inside = |axis: usize| BRICK.min(self.lattice.dims[axis] as usize - at[axis] * BRICK) as u64;
            if *tile as u8 == id.0 { inside(0) * inside(1) * inside(2) } else { 0 }
        };
        self.tiles.iter().enumerate().map(within).sum()
    }

    /// Memory in use, bytes.
    pub fn bytes(&self) -> usize {
        4 * self.tiles.len() + self.pool.bytes()
    }

    /// Fills background that no path over voxel faces joins to the outside with `id`: what a printer fills with
    /// support and nobody can wash away. Slices show support as background too, so this finds the support of a finished
    /// folder again, unless it reaches the surface.
    pub fn fill_enclosed(&mut self, id: MaterialId) {
        let outside = Outside::new(self);
        for brick in 0..self.tiles.len() {
            let reached = outside.masks(self.tiles[brick], brick);
            match self.tiles[brick] {
                tile if tile & UNIFORM == 0 => {
                    let (mut ids, mut filled) = (self.pool.ids(tile as usize), false);
                    for (voxel, value) in ids.iter_mut().enumerate().filter(|(_, value)| **value == 0) {
                        if reached[voxel / 64] >> (voxel % 64) & 1 == 0 {
                            *value = id.0;
                            filled = true;
                        }
                    }
                    if filled {
                        self.pool.replace(tile as usize, &ids);
                    }
                }
                VOID if reached[0] == 0 => self.tiles[brick] = UNIFORM | u32::from(id.0),
                _ => {}
            }
        }
    }
}

/// A brick of background.
const VOID: u32 = UNIFORM;

/// A brick's voxels as bits: one word for each z, bit x + 8y.
type Bits = [u64; BRICK];

/// The background that is joined to the outside.
struct Outside {
    /// Of bricks that are not of one material, by their place in the pool.
    dense: Vec<Bits>,
    /// Of those of background only: all or nothing.
    uniform: Vec<bool>,
}

impl Outside {
    fn new(volume: &Volume) -> Self {
        let mut found = Self { dense: vec![[0; BRICK]; volume.pool.len()], uniform: vec![false; volume.tiles.len()] };
        let void: Vec<Bits> = (0..volume.pool.len()).map(|brick| background(&volume.pool.ids(brick))).collect();
        let n = volume.bricks;
        // Bricks to look at again, each with what comes in from outside of it.
        let mut work: Vec<(usize, Bits)> = Vec::new();
        for brick in 0..volume.tiles.len() {
            let at = [brick % n[0], brick / n[0] % n[1], brick / (n[0] * n[1])];
            let mut entering = [0; BRICK];
            for axis in 0..3 {
                for up in [false, true] {
                    if at[axis] == if up { n[axis] - 1 } else { 0 } {
                        // From beyond the lattice; voxels that only fill up a brick are background.
                        let face = FACES[axis][usize::from(up)];
                        entering.iter_mut().zip(face).for_each(|(bits, face)| *bits |= face);
                    }
                }
            }
            if entering != [0; BRICK] {
                work.push((brick, entering));
            }
        }
        while let Some((brick, entering)) = work.pop() {
            let tile = volume.tiles[brick];
            let new = if tile & UNIFORM == 0 {
                let (void, reached) = (&void[tile as usize], &mut found.dense[tile as usize]);
                let before = *reached;
                for z in 0..BRICK {
                    reached[z] |= entering[z] & void[z];
                }
                if *reached == before {
                    continue;
                }
                spread(reached, void);
                *reached
            } else if tile == VOID && !found.uniform[brick] {
                found.uniform[brick] = true;
                [u64::MAX; BRICK]
            } else {
                continue;
            };
            let at = [brick % n[0], brick / n[0] % n[1], brick / (n[0] * n[1])];
            let stride = [1, n[0], n[0] * n[1]];
            for axis in 0..3 {
                if at[axis] > 0 {
                    work.extend(through(&new, axis, false).map(|bits| (brick - stride[axis], bits)));
                }
                if at[axis] + 1 < n[axis] {
                    work.extend(through(&new, axis, true).map(|bits| (brick + stride[axis], bits)));
                }
            }
        }
        found
    }

    fn masks(&self, tile: u32, brick: usize) -> Bits {
        match tile {
            tile if tile & UNIFORM == 0 => self.dense[tile as usize],
            _ => [if self.uniform[brick] { u64::MAX } else { 0 }; BRICK],
        }
    }
}

/// Bits of the column x = 0, and of the row y = 0.
const X0: u64 = 0x0101_0101_0101_0101;
const Y0: u64 = 0xff;
/// The lower and the upper face of a brick for each axis.
const FACES: [[Bits; 2]; 3] = {
    const ALL: u64 = u64::MAX;
    [[[X0; 8], [X0 << 7; 8]], [[Y0; 8], [Y0 << 56; 8]], [[ALL, 0, 0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 0, ALL]]]
};

fn background(ids: &[u8; BRICK_VOXELS]) -> Bits {
    let mut bits = [0; BRICK];
    for (voxel, _) in ids.iter().enumerate().filter(|(_, id)| **id == 0) {
        bits[voxel / 64] |= 1 << (voxel % 64);
    }
    bits
}

/// Grows `reached` over faces within `void` until nothing is added.
fn spread(reached: &mut Bits, void: &Bits) {
    loop {
        let before = *reached;
        for z in 0..BRICK {
            let here = reached[z];
            let beside = (here & !(X0 << 7)) << 1 | (here & !X0) >> 1 | here << 8 | here >> 8;
            let below = if z > 0 { reached[z - 1] } else { 0 };
            let above = if z + 1 < BRICK { reached[z + 1] } else { 0 };
            reached[z] |= (beside | below | above) & void[z];
        }
        if *reached == before {
            return;
        }
    }
}

/// What of `bits` touches the brick beyond a face, as bits of that brick.
fn through(bits: &Bits, axis: usize, up: bool) -> Option<Bits> {
    let mut beyond = [0; BRICK];
    match (axis, up) {
        (2, false) => beyond[BRICK - 1] = bits[0],
        (2, true) => beyond[0] = bits[BRICK - 1],
        _ => {
            for (beyond, &here) in beyond.iter_mut().zip(bits) {
                *beyond = match (axis, up) {
                    (0, false) => (here & X0) << 7,
                    (0, true) => here >> 7 & X0,
                    (_, false) => (here & Y0) << 56,
                    (_, true) => here >> 56,
                };
            }
        }
    }
    (beyond != [0; BRICK]).then_some(beyond)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// A volume of the ids that `id` gives.
    fn volume(dims: [u32; 3], id: impl Fn(u32, u32, u32) -> u8) -> Volume {
        let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::splat(0.1), dims };
        let mut volume = Volume::new(lattice).unwrap();
        for start in (0..dims[2]).step_by(BRICK) {
            volume.add_slices(start..dims[2].min(start + BRICK as u32), |j, k, row| {
                (0..).zip(row).for_each(|(i, voxel)| *voxel = id(i, j, k));
            });
        }
        volume
    }

    #[test]
    fn voxels_read_back_what_rows_were_given() {
        let id = |i, j, k| if k < 8 { 3 } else { ((i * 7 + j * 3 + k * 5) % 251) as u8 };
        let volume = volume([21, 18, 19], id);
        for (i, j, k) in (0..21).flat_map(|i| (0..18).flat_map(move |j| (0..19).map(move |k| (i, j, k)))) {
            assert_eq!(volume.voxel([i, j, k].map(i64::from)).0, id(i, j, k));
        }
        assert_eq!(volume.voxel([21, 0, 0]), MaterialId::BACKGROUND);
        assert_eq!(volume.voxel([0, -1, 0]), MaterialId::BACKGROUND);
        assert!(volume.bytes() < 27 * 4 + 27 * 512);
    }

    /// Every voxel by brute force: a walk over faces from beyond the lattice.
    #[test]
    fn enclosed_background_is_what_no_path_reaches() {
        // Random walls thick enough to enclose many pockets across bricks.
        let noise = |i: u32, j: u32, k: u32| {
            let mut x = u64::from(i) << 40 ^ u64::from(j) << 20 ^ u64::from(k);
            x = (x ^ x >> 31).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            x = (x ^ x >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            x ^ x >> 32
        };
        let id = |i, j, k| u8::from(noise(i, j, k) % 100 < 62);
        let dims = [29_u32, 26, 33];
        let mut found = volume(dims, id);
        let index = |[i, j, k]: [i64; 3]| (i + 29 * (j + 26 * k)) as usize;
        let inside = |at: [i64; 3]| (0..3).all(|axis| (0..i64::from(dims[axis])).contains(&at[axis]));
        let mut outside = vec![false; 29 * 26 * 33];
        let mut work: Vec<[i64; 3]> = Vec::new();
        let all = || (0..29).flat_map(|i| (0..26).flat_map(move |j| (0..33).map(move |k| [i, j, k])));
        work.extend(all().filter(|at| (0..3).any(|axis| at[axis] == 0 || at[axis] + 1 == i64::from(dims[axis]))));
        while let Some(at) = work.pop() {
            let [i, j, k] = at.map(|at| at as u32);
            if id(i, j, k) != 0 || outside[index(at)] {
                continue;
            }
            outside[index(at)] = true;
            for (axis, step) in (0..3).flat_map(|axis| [(axis, -1), (axis, 1)]) {
                let mut next = at;
                next[axis] += step;
                work.extend(Some(next).filter(|next| inside(*next)));
            }
        }
        found.fill_enclosed(MaterialId(7));
        let mut pockets = 0;
        for at in all() {
            let [i, j, k] = at.map(|at| at as u32);
            let expected = if id(i, j, k) != 0 { 1 } else { if outside[index(at)] { 0 } else { 7 } };
            pockets += usize::from(expected == 7);
            assert_eq!(found.voxel(at).0, expected, "{at:?}");
        }
        assert!(pockets > 100, "{pockets} enclosed voxels test nothing");
        // A closed box of nothing but background within, wider than a brick.
        let shell = |at: u32| !(1..39).contains(&at);
        let mut hollow = volume([40; 3], |i, j, k| u8::from(shell(i) || shell(j) || shell(k)));
        hollow.fill_enclosed(MaterialId(9));
        assert_eq!(hollow.voxel([20; 3]).0, 9);
    }
}
