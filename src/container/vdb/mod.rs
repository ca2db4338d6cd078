//! OpenVDB for Blender, Houdini and whoever reads its grids: a grid of densities for each resin, 1 where it is, or of
//! its fractions; a grid of signed distances, and a grid of ids with the resins' names in its metadata. Sparse: bricks
//! of one resin are tiles, background is nothing.
//!
//! The file format is that of OpenVDB's own sources (`io/Archive.cc`, `io/Compression.h`, `tree/RootNode.h`,
//! `tree/InternalNode.h`, `tree/LeafNode.h`), version 224: trees of three levels, 32³ nodes of 16³ leaves of 8³ voxels,
//! active-mask and zip compression. Our bricks are its leaves. A voxel's centre lies at its whole index; the transform
//! has a scale for each axis, in mm.
//!
//! | file | what it does |
//! | --- | --- |
//! | `distance` | signed distances from the boundary of what is printed |
//! | `fractions` | what a brick's volume fractions add to the grids of resins |
//! | `tree` | a sparse tree, from bricks to bytes |
//! | `file` | headers, metadata, transforms |

mod distance;
mod file;
mod fractions;
#[cfg(test)]
mod tests;
mod tree;

use std::{
    fs::File,
    io::{self, BufWriter, Write},
};

use self::{
    distance::{Cell, Distances},
    file::{Grid, Value, write_file},
    tree::{Inactive, Leaf, Tree},
};
use super::{Container, ContainerError, Content, Counts, SliceImage, Voxels, deflate::zlib_of_few};
use crate::{
    parallel,
    voxel::{BRICK, BRICK_VOXELS, Lattice, MaterialId},
    watch::Watch,
};

/// Name of the grid of ids.
pub const IDS: &str = "material";

/// Name of the grid of signed distances.
pub const DISTANCE: &str = "distance";

/// What its metadata says of it.
const DISTANCE_IS: &str = "signed distance in mm from the boundary of the printed voxels, negative inside";

/// What the metadata of a resin's grid says where it holds fractions.
const FRACTION_IS: &str = "volume fraction of the resin, 0 to 1";

/// Half of the width of the band around the surface that distances are known in, mm; `None` for lattices without any.
pub(crate) fn half_width_mm(lattice: &Lattice) -> Option<f64> {
    Distances::new(lattice).map(|distances| f64::from(distances.half_width()))
}

/// What one brick adds to a grid.
enum Piece {
    /// All voxels are active and alike.
    Tile(i32),
    Leaf(Leaf),
}

/// What a row of bricks along x adds, layer by layer.
#[derive(Default)]
struct BrickRow {
    /// Where, to which grid, what.
    pieces: Vec<([i32; 3], usize, Piece)>,
    cells: Vec<Cell>,
}

/// A file being written: its trees in memory.
pub struct Vdb {
    out: BufWriter<File>,
    content: Content,
    ids: Tree,
    /// By the index of the resin.
    densities: Vec<Tree>,
    distances: Option<Distances>,
    /// Ones, compressed, by how many there are.
    ones: Vec<Vec<u8>>,
}

impl Vdb {
    /// Begins one in `file`.
    ///
    /// # Errors
    /// None but those of compressing.
    pub fn new(file: File, content: Content) -> io::Result<Self> {
        let ones = (0..=BRICK_VOXELS).map(|count| values(std::iter::repeat_n(1.0_f32.to_bits(), count)));
        Ok(Self {
            out: BufWriter::with_capacity(1 << 20, file),
            ids: Tree::default(),
            densities: content.resins.iter().map(|_| Tree::default()).collect(),
            distances: Distances::new(&content.lattice),
            ones: ones.collect::<io::Result<_>>()?,
            content,
        })
    }
}

/// Words as OpenVDB compresses them: their compressed length and the bytes, or the length negated and the words.
fn values(words: impl Iterator<Item = u32>) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(BRICK_VOXELS);
    bytes.extend(words.map(u32::to_le_bytes));
    compressed(bytes.as_flattened())
}

/// The same of bytes.
fn compressed(plain: &[u8]) -> io::Result<Vec<u8>> {
    let zipped = zlib_of_few(plain)?;
    let (length, bytes) =
        if zipped.len() < plain.len() { (zipped.len() as i64, &zipped[..]) } else { (-(plain.len() as i64), plain) };
    Ok([&length.to_le_bytes(), bytes].concat())
}

/// A brick's values, x fastest, in the order of a leaf, z fastest.
fn in_leaf_order<T: Copy>(brick: &[T; BRICK_VOXELS]) -> [T; BRICK_VOXELS] {
    std::array::from_fn(|n| {
        let [x, y, z] = [n / (BRICK * BRICK), n / BRICK % BRICK, n % BRICK];
        brick[x + BRICK * (y + BRICK * z)]
    })
}

/// The voxels of a leaf that are such, a bit each.
fn mask_of<T: Copy>(leaf: &[T; BRICK_VOXELS], is_such: impl Fn(T) -> bool) -> [u64; 8] {
    let word = |values: &[T; 64]| values.iter().rev().fold(0, |bits, value| bits << 1 | u64::from(is_such(*value)));
    std::array::from_fn(|n| word(&leaf.as_chunks().0[n]))
}

/// What a brick of several ids, in the order of a leaf, adds to the grid of ids.
fn id_leaf(ids: &[u8; BRICK_VOXELS]) -> io::Result<Piece> {
    let mask = mask_of(ids, |id| id != 0);
    let words = ids.iter().filter(|id| **id != 0).map(|id| u32::from(*id));
    Ok(Piece::Leaf(Leaf { mask, values: Some(values(words)?), inactive: Inactive::Background }))
}

/// What it adds to that of every resin in it.
fn density_leaves(ids: &[u8; BRICK_VOXELS]) -> Vec<(usize, Piece)> {
    let mut present = [false; 256];
    ids.iter().for_each(|id| present[usize::from(*id)] = true);
    let leaf = |id: u8| {
        let mask = mask_of(ids, |other| other == id);
        (usize::from(id), Piece::Leaf(Leaf { mask, values: None, inactive: Inactive::Background }))
    };
    (1..=u8::MAX).filter(|id| present[usize::from(*id)]).map(leaf).collect()
}

impl Container for Vdb {
    fn take(&mut self, voxels: &dyn Voxels, _: &[SliceImage], watch: &dyn Watch) -> Result<(), ContainerError> {
        let [across, rows, layers] = voxels.bricks();
        let fractions = self.content.fractions;
        let row = |n: usize| -> io::Result<BrickRow> {
            let mut ids = [0; BRICK_VOXELS];
            let mut row = BrickRow::default();
            for z in layers.clone() {
                for x in across.clone() {
                    let brick = [x, rows.start + n as u32, z];
                    let at = brick.map(|index| index as i32);
                    let uniform = voxels.brick(brick, &mut ids);
                    row.cells.push(uniform.map_or_else(|| Cell::of(&ids), Cell::uniform));
                    let mut add = |found: Vec<(usize, Piece)>| {
                        row.pieces.extend(found.into_iter().map(|(grid, piece)| (at, grid, piece)));
                    };
                    match uniform {
                        Some(MaterialId::BACKGROUND) => {}
                        Some(MaterialId(id)) => {
                            add(vec![(0, Piece::Tile(i32::from(id)))]);
                            if !fractions {
                                add(vec![(usize::from(id), Piece::Tile(1.0_f32.to_bits() as i32))]);
                            }
                        }
                        None => {
                            let leaf = in_leaf_order(&ids);
                            add(vec![(0, id_leaf(&leaf)?)]);
                            if !fractions {
                                add(density_leaves(&leaf));
                            }
                        }
                    }
                    if fractions && uniform != Some(MaterialId::BACKGROUND) {
                        add(fractions::pieces(&voxels.brick_fractions(brick))?);
                    }
                }
            }
            Ok(row)
        };
        let found: Vec<io::Result<_>> = parallel::map(rows.len(), row);
        let mut cells = vec![Vec::new(); layers.len()];
        for row in found {
            let row = row?;
            for (at, grid, piece) in row.pieces {
                let tree = if grid == 0 { Some(&mut self.ids) } else { self.densities.get_mut(grid - 1) };
                let Some(tree) = tree else { continue };
                match piece {
                    Piece::Tile(value) => tree.set_tile(at, value),
                    Piece::Leaf(leaf) => tree.set_leaf(at, leaf),
                }
            }
            let mut of_row = row.cells.into_iter();
            cells.iter_mut().for_each(|layer| layer.extend(of_row.by_ref().take(across.len())));
        }
        if let Some(distances) = &mut self.distances {
            cells.into_iter().try_for_each(|layer| distances.take(layer))?;
        }
        Ok(watch.go_on()?)
    }

    fn finish(mut self: Box<Self>, counts: &Counts, watch: &dyn Watch) -> Result<(), ContainerError> {
        if let Some(distances) = &mut self.distances {
            distances.finish()?;
        }
        let trees = self.densities.iter_mut().chain([&mut self.ids]);
        let mut trees: Vec<&mut Tree> = trees.chain(self.distances.as_mut().map(Distances::tree_mut)).collect();
        parallel::rows(&mut trees, 1, |_, trees| trees.iter_mut().for_each(|tree| tree.sort()));
        let text = |value: &str| Value::Text(value.to_owned());
        let name = self.content.free_name(IDS);
        let mut names = vec![("class".to_owned(), text("unknown")), ("name".to_owned(), text(&name))];
        for resin in &self.content.resins {
            names.push((format!("material_{:03}", resin.id.0), text(&resin.name)));
        }
        let ids = Grid { name, kind: "Tree_int32_5_4_3", metadata: names, tree: &self.ids };
        let mut grids = Vec::new();
        for (resin, tree) in self.content.resins.iter().zip(&self.densities) {
            if counts[usize::from(resin.id.0)] > 0 || !tree.is_empty() {
                let mut metadata =
                    vec![("class".to_owned(), text("fog volume")), ("name".to_owned(), text(&resin.name))];
                if self.content.fractions {
                    metadata.push(("description".to_owned(), text(FRACTION_IS)));
                }
                grids.push(Grid { name: resin.name.clone(), kind: "Tree_float_5_4_3", metadata, tree });
            }
        }
        if let Some(distances) = &self.distances {
            grids.push(distance_grid(&self.content, distances));
        }
        grids.push(ids);
        write_file(&mut self.out, &self.content, &grids, &self.ones, watch)?;
        Ok(self.out.flush()?)
    }
}

/// Signed distances: a level set where voxels are cubes, which OpenVDB's tools for level sets ask for.
fn distance_grid<'a>(content: &Content, distances: &'a Distances) -> Grid<'a> {
    let pitch = content.lattice.pitch;
    let class = if pitch.min_element() == pitch.max_element() { "level set" } else { "unknown" };
    let text = |value: &str| Value::Text(value.to_owned());
    let name = content.free_name(DISTANCE);
    let metadata = [
        ("class", text(class)),
        ("name", text(&name)),
        ("description", text(DISTANCE_IS)),
        ("half_width_mm", Value::Float(distances.half_width())),
    ];
    Grid {
        name,
        kind: "Tree_float_5_4_3_HalfFloat",
        metadata: metadata.map(|(key, value)| (key.to_owned(), value)).to_vec(),
        tree: distances.tree(),
    }
}
