//! Bricks of several materials in as few bits as their ids need.
//!
//! A print has a handful of resins. Two bits a voxel are a quarter of a byte's memory, and what a walk sees of it fits
//! into a processor's own cache, where it is looked up at every collision. Four and eight bits where ids need them: all
//! bricks have the width of the largest id that was ever put in.
//!
//! ```text
//!   row of 8 voxels   x = 0 in the lowest bits     2, 4 or 8 bytes, little end first
//!   brick             64 rows, y before z          128, 256 or 512 bytes
//! ```

use crate::voxel::{BRICK, BRICK_VOXELS};

/// Bricks that room is set aside for at once, as address space that costs nothing until it is used.
const RESERVED: usize = 4 << 20;
/// Rows of voxels in a brick.
const ROWS: usize = BRICK_VOXELS / BRICK;

/// Bricks by number, in the order that they were put in.
#[derive(Debug, Clone)]
pub(super) struct PackedBricks {
    bytes: Vec<u8>,
    /// Bits of a voxel are 1 << this: 1, 2 or 3.
    width: u32,
    /// Most bricks that are expected.
    expected: usize,
}

impl PackedBricks {
    /// No bricks; not many more than `expected` will come.
    pub fn new(expected: usize) -> Self {
        let expected = expected.min(RESERVED);
        Self { bytes: Vec::with_capacity(expected * (ROWS << 1)), width: 1, expected }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.bytes.len() / self.brick_bytes()
    }

    /// Memory of the bricks, bytes.
    pub fn bytes(&self) -> usize {
        self.bytes.len()
    }

    /// Bytes of a brick.
    fn brick_bytes(&self) -> usize {
        ROWS << self.width
    }

    /// Adds a brick of these ids, x fastest.
    pub fn push(&mut self, ids: &[u8; BRICK_VOXELS]) {
        self.make_room_for(ids);
        let start = self.bytes.len();
        self.bytes.resize(start + self.brick_bytes(), 0);
        self.write(start, ids);
    }

    /// Replaces a brick's ids.
    pub fn replace(&mut self, brick: usize, ids: &[u8; BRICK_VOXELS]) {
        self.make_room_for(ids);
        self.write(brick * self.brick_bytes(), ids);
    }

    /// The ids of a brick, x fastest.
    pub fn ids(&self, brick: usize) -> [u8; BRICK_VOXELS] {
        let mut ids = [0; BRICK_VOXELS];
        let bytes = &self.bytes[brick * self.brick_bytes()..][..self.brick_bytes()];
        for (row, packed) in ids.chunks_exact_mut(BRICK).zip(bytes.chunks_exact(1 << self.width)) {
            row.copy_from_slice(&unpack(packed, self.width));
        }
        ids
    }

    /// The id of one voxel, x + 8 y + 64 z, of a brick.
    #[inline(always)]
    pub fn id(&self, brick: usize, voxel: usize) -> u8 {
        // In bits from the first brick.
        let at = (brick * BRICK_VOXELS + voxel) << self.width;
        let mask = ((1_u32 << (1 << self.width)) - 1) as u8;
        self.bytes[at >> 3] >> (at & 7) & mask
    }

    fn write(&mut self, start: usize, ids: &[u8; BRICK_VOXELS]) {
        let width = self.width;
        let bytes = &mut self.bytes[start..start + (ROWS << width)];
        for (row, packed) in ids.chunks_exact(BRICK).zip(bytes.chunks_exact_mut(1 << width)) {
            packed.copy_from_slice(&pack(row, width)[..1 << width]);
        }
    }

    /// Widens all bricks where these ids need more bits.
    fn make_room_for(&mut self, ids: &[u8; BRICK_VOXELS]) {
        let used = ids.iter().fold(0, |used, id| used | id);
        let needed = if used < 4 { 1 } else { if used < 16 { 2 } else { 3 } };
        if needed <= self.width {
            return;
        }
        let mut wider = Self { bytes: Vec::with_capacity(self.expected * (ROWS << needed)), width: needed, ..*self };
        wider.bytes.resize(self.len() * wider.brick_bytes(), 0);
        for brick in 0..self.len() {
            wider.write(brick * wider.brick_bytes(), &self.ids(brick));
        }
        *self = wider;
    }
}

/// Eight ids in the lowest bytes.
#[inline]
fn pack(row: &[u8], width: u32) -> [u8; BRICK] {
    let mut bytes = [0; BRICK];
    bytes.copy_from_slice(row);
    let mut bits = u64::from_le_bytes(bytes);
    // Neighbours move together, then pairs, then fours.
    if width < 3 {
        bits = (bits | bits >> 4) & 0x00ff_00ff_00ff_00ff;
        if width < 2 {
            bits = (bits & 0x0003_0003_0003_0003) | (bits >> 2 & 0x000c_000c_000c_000c);
            bits = (bits | bits >> 12) & 0x0000_00ff_0000_00ff;
            bits |= bits >> 24;
        } else {
            bits = (bits | bits >> 8) & 0x0000_ffff_0000_ffff;
            bits |= bits >> 16;
        }
    }
    bits.to_le_bytes()
}

/// Eight ids from 1 << width bytes.
#[inline]
fn unpack(packed: &[u8], width: u32) -> [u8; BRICK] {
    let mask = ((1_u32 << (1 << width)) - 1) as u8;
    std::array::from_fn(|x| {
        let at = x << width;
        packed[at >> 3] >> (at & 7) & mask
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ids of as many bits as there may be, and wider ones later.
    #[test]
    fn ids_come_back_at_every_width() {
        let brick = |seed: usize, most: usize| -> [u8; BRICK_VOXELS] {
            std::array::from_fn(|voxel| ((voxel * 7919 + seed * 104_729) >> 3) as u8 % most as u8)
        };
        let mut packed = PackedBricks::new(10);
        let mut put = Vec::new();
        for (n, most) in [4, 3, 4, 16, 2, 9, 255, 4, 16].into_iter().enumerate() {
            packed.push(&brick(n, most));
            put.push(brick(n, most));
            assert_eq!(packed.len(), n + 1);
            for (n, ids) in put.iter().enumerate() {
                assert_eq!(packed.ids(n), *ids);
                assert!((0..BRICK_VOXELS).all(|voxel| packed.id(n, voxel) == ids[voxel]));
            }
            assert_eq!(packed.bytes(), put.len() * if n < 3 { 128 } else { if n < 6 { 256 } else { 512 } });
        }
        packed.replace(2, &brick(5, 251));
        assert_eq!([packed.ids(1), packed.ids(2), packed.ids(3)], [put[1], brick(5, 251), put[3]]);
    }

    #[test]
    fn a_replaced_brick_may_need_more_bits() {
        let mut packed = PackedBricks::new(2);
        packed.push(&[3; BRICK_VOXELS]);
        packed.push(&[1; BRICK_VOXELS]);
        packed.replace(0, &[7; BRICK_VOXELS]);
        assert_eq!([packed.ids(0), packed.ids(1)], [[7; BRICK_VOXELS], [1; BRICK_VOXELS]]);
    }
}
