//! A sparse tree of OpenVDB's usual shape: a root, nodes of 32³ nodes, nodes of 16³ leaves, leaves of 8³ voxels.
//!
//! ```text
//!   brick (x, y, z)   a leaf, or an active tile of its node
//!   node              16³ bricks; where all are tiles of one value, an active tile of the node above
//!   upper node        32³ nodes
//! ```
//!
//! Within nodes and leaves z runs fastest. Values are 32-bit words, of integers or of floats, and the background is 0,
//! but in signed trees: there they are 16-bit floats, the background is a length, tiles are not active, and what is not
//! active is the length or its negative.

use std::{
    collections::BTreeMap,
    io::{self, Write},
};

use super::values;
use crate::{voxel::BRICK, watch::Watch};

/// Leaves along the edge of a node, as a power of two.
const NODE: u32 = 4;
/// Nodes along the edge of an upper node, as a power of two.
const UPPER: u32 = 5;
/// Leaves in a node.
const LEAVES: usize = 1 << (3 * NODE);
/// Nodes in an upper node.
const NODES: usize = 1 << (3 * UPPER);
/// Values that are not active are the background.
const ALL_BACKGROUND: u8 = 0;
/// They are the background's negative.
const ALL_NEGATIVE: u8 = 1;
/// They are the background where a bit is set, its negative elsewhere.
const EITHER: u8 = 3;

/// Voxels of a leaf.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Leaf {
    /// Which are active, z fastest.
    pub(super) mask: [u64; 8],
    /// Values of the active ones, compressed; `None`: all are 1.
    pub(super) values: Option<Vec<u8>>,
    /// What the others are.
    pub(super) inactive: Inactive,
}

/// Values that are not active.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Inactive {
    Background,
    Negative,
    /// The background where a bit is set, its negative elsewhere.
    Either(Box<[u64; 8]>),
}

impl Leaf {
    /// Active voxels.
    fn count(&self) -> u32 {
        self.mask.iter().map(|word| word.count_ones()).sum()
    }

    /// Least and greatest index of an active voxel within the leaf; `None` where there is none.
    fn extent(&self) -> Option<[[u32; 3]; 2]> {
        // A word for each x, in it a byte for each y, in it a bit for each z.
        let along_x = (0..8).filter(|x| self.mask[*x as usize] != 0).fold(0_u8, |bits, x| bits | 1 << x);
        let rows = self.mask.iter().fold(0, |all, word| all | word).to_le_bytes();
        let along_y = (0..8).filter(|y| rows[*y as usize] != 0).fold(0_u8, |bits, y| bits | 1 << y);
        let bits = [along_x, along_y, rows.iter().fold(0, |all, row| all | row)];
        (along_x != 0).then(|| [bits.map(u8::trailing_zeros), bits.map(|bits| 7 - bits.leading_zeros())])
    }
}

/// Least and greatest index within a brick.
const WHOLE: [[u32; 3]; 2] = [[0; 3], [BRICK as u32 - 1; 3]];

/// 16³ bricks.
///
/// Those that are not nothing, by their index, in its order once the tree is sorted.
#[derive(Debug, Clone, Default)]
struct Node {
    tiles: Vec<(u16, i32)>,
    leaves: Vec<(u16, Leaf)>,
}

/// A tree. Bricks are added in any order, each once; it is sorted before it is written.
#[derive(Debug, Clone, Default)]
pub(super) struct Tree {
    nodes: BTreeMap<[i32; 3], Node>,
    /// The background of a signed tree.
    length: Option<f32>,
}

/// How many voxels are active, and least and greatest index of them.
pub(super) type Active = (u64, [[i32; 3]; 2]);

/// Index of a child among 2^log along each axis, z fastest.
fn index(at: [i32; 3], log: u32) -> usize {
    let [x, y, z] = at.map(|value| (value & ((1 << log) - 1)) as usize);
    (x << (2 * log)) | (y << log) | z
}

impl Node {
    /// Whether its bricks are in the order that they are written in, each there once.
    fn is_sorted(&self) -> bool {
        let is_tile = |n: u16| self.tiles.binary_search_by_key(&n, |tile| tile.0).is_ok();
        self.tiles.is_sorted_by(|a, b| a.0 < b.0)
            && self.leaves.is_sorted_by(|a, b| a.0 < b.0)
            && !self.leaves.iter().any(|leaf| is_tile(leaf.0))
    }

    /// The value of all bricks, where they are tiles of one.
    fn uniform(&self) -> Option<i32> {
        let (_, first) = *self.tiles.first()?;
        (self.tiles.len() == LEAVES && self.tiles.iter().all(|(_, value)| *value == first)).then_some(first)
    }

    fn write_topology(&self, out: &mut dyn Write, signed: bool) -> io::Result<()> {
        let leaves = self.leaves.iter().map(|(n, _)| usize::from(*n));
        let mut tiles = self.tiles.iter().map(|(n, value)| (usize::from(*n), *value));
        write_node(out, LEAVES, leaves, &mut tiles, signed)?;
        self.leaves.iter().try_for_each(|(_, leaf)| write_mask(out, &leaf.mask))
    }
}

impl Tree {
    /// A signed tree, whose background is `length`.
    pub(super) fn signed(length: f32) -> Self {
        Self { length: Some(length), ..Self::default() }
    }

    pub(super) fn is_signed(&self) -> bool {
        self.length.is_some()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    fn node(&mut self, brick: [i32; 3]) -> (&mut Node, u16) {
        let node = self.nodes.entry(brick.map(|value| value >> NODE)).or_default();
        (node, index(brick, NODE) as u16)
    }

    /// Gives all voxels of a brick one value, and makes them active but in a signed tree.
    pub(super) fn set_tile(&mut self, brick: [i32; 3], value: i32) {
        let (node, n) = self.node(brick);
        node.tiles.push((n, value));
    }

    pub(super) fn set_leaf(&mut self, brick: [i32; 3], leaf: Leaf) {
        let (node, n) = self.node(brick);
        node.leaves.push((n, leaf));
    }

    /// Brings bricks into the order that they are written in.
    pub(super) fn sort(&mut self) {
        for node in self.nodes.values_mut() {
            node.tiles.sort_unstable_by_key(|tile| tile.0);
            node.leaves.sort_unstable_by_key(|leaf| leaf.0);
        }
    }

    fn is_sorted(&self) -> bool {
        self.nodes.values().all(Node::is_sorted)
    }

    /// Its active voxels.
    pub(super) fn active(&self) -> Active {
        let (mut count, mut low, mut high) = (0, [i32::MAX; 3], [i32::MIN; 3]);
        for (origin, node) in &self.nodes {
            let tiles = node.tiles.iter().filter(|_| !self.is_signed()).map(|(n, _)| (n, 512, WHOLE));
            let leaves = node.leaves.iter().filter_map(|(n, leaf)| Some((n, leaf.count(), leaf.extent()?)));
            for (n, voxels, extent) in tiles.chain(leaves) {
                count += u64::from(voxels);
                let within = [n >> (2 * NODE), n >> NODE & 15, n & 15].map(i32::from);
                for axis in 0..3 {
                    let first = ((origin[axis] << NODE) + within[axis]) * BRICK as i32;
                    low[axis] = low[axis].min(first + extent[0][axis] as i32);
                    high[axis] = high[axis].max(first + extent[1][axis] as i32);
                }
            }
        }
        (count, [low, high])
    }

    /// Of a signed tree: the value of a voxel, and whether it is active.
    #[cfg(test)]
    pub(super) fn value(&self, voxel: [i32; 3]) -> (f32, bool) {
        let length = self.length.unwrap_or_default();
        let brick = voxel.map(|index| index >> 3);
        let n = index(voxel, 3);
        let is_set = |mask: &[u64; 8], n: usize| mask[n / 64] >> (n % 64) & 1 != 0;
        let Some(node) = self.nodes.get(&brick.map(|index| index >> NODE)) else { return (length, false) };
        let within = index(brick, NODE) as u16;
        if let Some((_, tile)) = node.tiles.iter().find(|(n, _)| *n == within) {
            return (f32::from_bits(*tile as u32), false);
        }
        let Some((_, leaf)) = node.leaves.iter().find(|(n, _)| *n == within) else { return (length, false) };
        if is_set(&leaf.mask, n) {
            let packed = leaf.values.as_deref().unwrap_or_default();
            let mut plain = Vec::new();
            match i64::from_le_bytes(packed[..8].try_into().expect("eight bytes")) {
                ..=0 => plain.extend(&packed[8..]),
                _ => {
                    io::copy(&mut flate2::read::ZlibDecoder::new(&packed[8..]), &mut plain).expect("a zlib stream");
                }
            }
            let before = (0..n).filter(|n| is_set(&leaf.mask, *n)).count();
            let bytes = [plain[2 * before], plain[2 * before + 1]];
            return (half::f16::from_le_bytes(bytes).to_f32(), true);
        }
        let is_inside = match &leaf.inactive {
            Inactive::Background => false,
            Inactive::Negative => true,
            Inactive::Either(mask) => !is_set(mask, n),
        };
        (if is_inside { -length } else { length }, false)
    }

    /// Nodes by the upper node that holds them.
    fn uppers(&self) -> BTreeMap<[i32; 3], BTreeMap<usize, &Node>> {
        let mut uppers: BTreeMap<[i32; 3], BTreeMap<usize, &Node>> = BTreeMap::new();
        for (at, node) in &self.nodes {
            uppers.entry(at.map(|value| value >> UPPER)).or_default().insert(index(*at, UPPER), node);
        }
        uppers
    }

    /// Writes masks and tiles.
    pub(super) fn write_topology(&self, out: &mut dyn Write, watch: &dyn Watch) -> io::Result<()> {
        debug_assert!(self.is_sorted());
        let uppers = self.uppers();
        // One buffer of values a leaf; the background; no tiles of the root.
        for number in [1, self.length.map_or(0, f32::to_bits), 0, uppers.len() as u32] {
            out.write_all(&number.to_le_bytes())?;
        }
        for (origin, nodes) in uppers {
            let voxel = origin.map(|value| value << (UPPER + NODE + 3));
            voxel.iter().try_for_each(|value| out.write_all(&value.to_le_bytes()))?;
            let children = nodes.iter().filter(|(_, node)| node.uniform().is_none());
            let mut tiles = nodes.iter().filter_map(|(n, node)| Some((*n, node.uniform()?)));
            write_node(out, NODES, children.clone().map(|(n, _)| *n), &mut tiles, self.is_signed())?;
            for (_, node) in children {
                watch.go_on().map_err(io::Error::other)?;
                node.write_topology(out, self.is_signed())?;
            }
        }
        Ok(())
    }

    /// Writes the values of leaves; `ones` are those of a leaf without values of its own, by how many are active.
    pub(super) fn write_values(&self, out: &mut dyn Write, ones: &[Vec<u8>], watch: &dyn Watch) -> io::Result<()> {
        debug_assert!(self.is_sorted());
        for nodes in self.uppers().values() {
            for node in nodes.values() {
                watch.go_on().map_err(io::Error::other)?;
                for (_, leaf) in &node.leaves {
                    write_mask(out, &leaf.mask)?;
                    match &leaf.inactive {
                        Inactive::Background => out.write_all(&[ALL_BACKGROUND])?,
                        Inactive::Negative => out.write_all(&[ALL_NEGATIVE])?,
                        Inactive::Either(mask) => {
                            out.write_all(&[EITHER])?;
                            write_mask(out, &mask[..])?;
                        }
                    }
                    out.write_all(leaf.values.as_ref().unwrap_or(&ones[leaf.count() as usize]))?;
                }
            }
        }
        Ok(())
    }
}

/// Writes the masks of a node of `size` children or tiles, and its tiles in their order: active ones with their values;
/// in a signed tree those that are the background's negative.
fn write_node(
    out: &mut dyn Write,
    size: usize,
    children: impl Iterator<Item = usize>,
    tiles: &mut dyn Iterator<Item = (usize, i32)>,
    signed: bool,
) -> io::Result<()> {
    let (mut child_mask, mut tile_mask) = (vec![0_u64; size / 64], vec![0_u64; size / 64]);
    children.for_each(|n| child_mask[n / 64] |= 1 << (n % 64));
    if signed {
        let mut background = vec![u64::MAX; size / 64];
        tiles.for_each(|(n, _)| background[n / 64] &= !(1 << (n % 64)));
        write_mask(out, &child_mask)?;
        write_mask(out, &tile_mask)?;
        // Of no values in 16 bits not even the length is written.
        out.write_all(&[EITHER])?;
        return write_mask(out, &background);
    }
    let words: Vec<u32> = tiles
        .map(|(n, value)| {
            tile_mask[n / 64] |= 1 << (n % 64);
            value as u32
        })
        .collect();
    write_mask(out, &child_mask)?;
    write_mask(out, &tile_mask)?;
    out.write_all(&[ALL_BACKGROUND])?;
    out.write_all(&values(words.into_iter())?)
}

fn write_mask(out: &mut dyn Write, mask: &[u64]) -> io::Result<()> {
    mask.iter().try_for_each(|word| out.write_all(&word.to_le_bytes()))
}
