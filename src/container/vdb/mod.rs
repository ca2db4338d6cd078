//! OpenVDB for Blender, Houdini and whoever reads its grids: a grid of densities for each resin, 1 where it is, and a
//! grid of ids with the resins' names in its metadata. Sparse: bricks of one resin are tiles, background is nothing.
//!
//! The file format is that of OpenVDB's own sources (`io/Archive.cc`, `io/Compression.h`, `tree/RootNode.h`,
//! `tree/InternalNode.h`, `tree/LeafNode.h`), version 224: trees of three levels, 32³ nodes of 16³ leaves of 8³ voxels,
//! active-mask and zip compression. Our bricks are its leaves. A voxel's centre lies at its whole index; the transform
//! has a scale for each axis, in mm.
//!
//! | file | what it does |
//! | --- | --- |
//! | `tree` | a sparse tree, from bricks to bytes |
//! | `file` | headers, metadata, transforms |

mod file;
mod tree;

use std::{
    fs::File,
    io::{self, BufWriter, Write},
};

use self::{
    file::{Grid, Value, write_file},
    tree::{Leaf, Tree},
};
use super::{Container, ContainerError, Content, Counts, SliceImage, Voxels, deflate::zlib};
use crate::{
    parallel,
    voxel::{BRICK, BRICK_VOXELS, MaterialId},
    watch::Watch,
};

/// Name of the grid of ids.
pub const IDS: &str = "material";

/// What one brick adds to a grid.
enum Piece {
    /// All voxels are active and alike.
    Tile(i32),
    Leaf(Leaf),
}

/// A file being written: its trees in memory.
pub struct Vdb {
    out: BufWriter<File>,
    content: Content,
    ids: Tree,
    /// By the index of the resin.
    densities: Vec<Tree>,
    /// Ones, compressed, by how many there are.
    ones: Vec<Vec<u8>>,
}

impl Vdb {
    /// Begins one in `file`.
    ///
    /// # Errors
    /// None but those of compressing.
    pub fn new(file: File, content: Content) -> io::Result<Self> {
        let ones = (0..=BRICK_VOXELS).map(|count| values(&vec![1.0_f32.to_bits(); count]));
        Ok(Self {
            out: BufWriter::with_capacity(1 << 20, file),
            ids: Tree::default(),
            densities: content.resins.iter().map(|_| Tree::default()).collect(),
            ones: ones.collect::<io::Result<_>>()?,
            content,
        })
    }
}

/// Words as OpenVDB compresses them: their compressed length and the bytes, or the length negated and the words.
fn values(words: &[u32]) -> io::Result<Vec<u8>> {
    let plain: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let zipped = zlib(&plain)?;
    let (length, bytes) =
        if zipped.len() < plain.len() { (zipped.len() as i64, zipped) } else { (-(plain.len() as i64), plain) };
    let mut out = length.to_le_bytes().to_vec();
    out.extend(bytes);
    Ok(out)
}

/// Index within a leaf, z fastest, of the voxel that is the n-th of a brick, x fastest.
fn turned(n: usize) -> usize {
    let [x, y, z] = [n % BRICK, n / BRICK % BRICK, n / (BRICK * BRICK)];
    (x << 6) | (y << 3) | z
}

/// What a brick of several ids adds to the grid of ids, and to that of every resin in it.
fn pieces(ids: &[u8; BRICK_VOXELS]) -> io::Result<Vec<(usize, Piece)>> {
    let mut leaf_ids = [0_u8; BRICK_VOXELS];
    for (n, id) in ids.iter().enumerate() {
        leaf_ids[turned(n)] = *id;
    }
    let mask = |is: &dyn Fn(u8) -> bool| {
        let mut mask = [0_u64; 8];
        for (n, _) in leaf_ids.iter().enumerate().filter(|(_, id)| is(**id)) {
            mask[n / 64] |= 1 << (n % 64);
        }
        mask
    };
    let active: Vec<u32> = leaf_ids.iter().filter(|id| **id != 0).map(|id| u32::from(*id)).collect();
    let mut found = vec![(0, Piece::Leaf(Leaf { mask: mask(&|id| id != 0), values: Some(values(&active)?) }))];
    let mut present = [false; 256];
    active.iter().for_each(|id| present[*id as usize] = true);
    for id in (1..=u8::MAX).filter(|id| present[usize::from(*id)]) {
        found.push((usize::from(id), Piece::Leaf(Leaf { mask: mask(&|other| other == id), values: None })));
    }
    Ok(found)
}

impl Container for Vdb {
    fn take(&mut self, voxels: &dyn Voxels, _: &[SliceImage], watch: &dyn Watch) -> Result<(), ContainerError> {
        let [across, rows, layers] = voxels.bricks();
        let row = |n: usize| -> io::Result<Vec<([u32; 3], usize, Piece)>> {
            let mut ids = [0; BRICK_VOXELS];
            let mut found = Vec::new();
            for z in layers.clone() {
                for x in across.clone() {
                    let at = [x, rows.start + n as u32, z];
                    match voxels.brick(at, &mut ids) {
                        Some(MaterialId::BACKGROUND) => {}
                        Some(MaterialId(id)) => {
                            found.push((at, 0, Piece::Tile(i32::from(id))));
                            found.push((at, usize::from(id), Piece::Tile(1.0_f32.to_bits() as i32)));
                        }
                        None => found.extend(pieces(&ids)?.into_iter().map(|(grid, piece)| (at, grid, piece))),
                    }
                }
            }
            Ok(found)
        };
        let found: Vec<io::Result<_>> = parallel::map(rows.len(), row);
        for row in found {
            for (at, grid, piece) in row? {
                let tree = if grid == 0 { Some(&mut self.ids) } else { self.densities.get_mut(grid - 1) };
                let Some(tree) = tree else { continue };
                match piece {
                    Piece::Tile(value) => tree.set_tile(at, value),
                    Piece::Leaf(leaf) => tree.set_leaf(at, leaf),
                }
            }
        }
        Ok(watch.go_on()?)
    }

    fn finish(mut self: Box<Self>, counts: &Counts, watch: &dyn Watch) -> Result<(), ContainerError> {
        let text = |value: &str| Value::Text(value.to_owned());
        let mut names = vec![("class".to_owned(), text("unknown")), ("name".to_owned(), text(IDS))];
        for resin in &self.content.resins {
            names.push((format!("material_{:03}", resin.id.0), text(&resin.name)));
        }
        let ids = Grid { name: IDS.to_owned(), kind: "Tree_int32_5_4_3", metadata: names, tree: &self.ids };
        let mut grids = Vec::new();
        for (resin, tree) in self.content.resins.iter().zip(&self.densities) {
            if counts[usize::from(resin.id.0)] > 0 || !tree.is_empty() {
                let metadata = vec![("class".to_owned(), text("fog volume")), ("name".to_owned(), text(&resin.name))];
                grids.push(Grid { name: resin.name.clone(), kind: "Tree_float_5_4_3", metadata, tree });
            }
        }
        grids.push(ids);
        write_file(&mut self.out, &self.content, &grids, &self.ones, watch)?;
        Ok(self.out.flush()?)
    }
}
