//! Sharing of bit-identical positions.
//!
//! Only equal positions merge (−0 counts as +0): a tolerance would have to guess which gaps are meant. Vertices are
//! renumbered in order of first use by a triangle, those no triangle uses vanish, so bounding boxes are of the surface.

use glam::DVec3;

const EMPTY: u32 = u32::MAX;

/// Rewrites both lists in place. Every index must be in range.
pub(in crate::mesh) fn weld(positions: &mut Vec<DVec3>, triangles: &mut [[u32; 3]]) {
    let mut table = Table::new(positions.len());
    let mut renumbered = vec![EMPTY; positions.len()];
    let mut welded = Vec::new();
    for corner in triangles.iter_mut().flatten() {
        let slot = &mut renumbered[*corner as usize];
        if *slot == EMPTY {
            // Adding 0 turns −0 into +0.
            *slot = table.index_of(positions[*corner as usize] + DVec3::ZERO, &mut welded);
        }
        *corner = *slot;
    }
    *positions = welded;
}

/// Open-addressing hash table of indices into the welded positions, at most half full.
struct Table {
    slots: Vec<u32>,
}

impl Table {
    fn new(entries: usize) -> Self {
        Self { slots: vec![EMPTY; (2 * entries).next_power_of_two()] }
    }

    fn index_of(&mut self, p: DVec3, welded: &mut Vec<DVec3>) -> u32 {
        let mask = self.slots.len() - 1;
        let mut at = hash(p) as usize & mask;
        loop {
            match self.slots[at] {
                EMPTY => {
                    let index = welded.len() as u32;
                    self.slots[at] = index;
                    welded.push(p);
                    return index;
                }
                index if welded[index as usize] == p => return index,
                _ => at = (at + 1) & mask,
            }
        }
    }
}

/// Mixes the coordinates' bits as splitmix64 does (Steele, Lea, Flood 2014), one round a coordinate: grids, whose low
/// bits are all zero, must spread over the low bits of the result.
fn hash(p: DVec3) -> u64 {
    let mut h = 0u64;
    for c in p.to_array() {
        h = h.wrapping_add(c.to_bits()).wrapping_add(0x9e37_79b9_7f4a_7c15);
        h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        h ^= h >> 31;
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_positions_merge_and_unused_ones_vanish() {
        let mut positions =
            vec![DVec3::splat(9.0), DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(-0.0, 0.0, -0.0), DVec3::X, DVec3::Z];
        let mut triangles = [[1, 2, 3], [4, 6, 5]];
        weld(&mut positions, &mut triangles);
        assert_eq!(positions, [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        assert_eq!(triangles, [[0, 1, 2], [0, 3, 1]]);
    }

    #[test]
    fn neighbouring_floats_stay_apart() {
        let mut positions = vec![DVec3::X, DVec3::new(1.0f64.next_up(), 0.0, 0.0), DVec3::Y];
        let mut triangles = [[0, 1, 2]];
        weld(&mut positions, &mut triangles);
        assert_eq!(positions.len(), 3);
    }
}
