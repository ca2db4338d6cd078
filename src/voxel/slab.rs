//! A slab of slices as a sparse grid: blocks of bricks of voxels.
//!
//! ```text
//!   slab   all x and y, a fixed number of slices      filled and written at once, then reused for the next
//!   block  up to 256 bricks, roughly cubic in mm      the unit of parallel work
//!   brick  8 × 8 × 8 voxels                           one id for all, or one id each
//! ```
//!
//! Blocks are aligned to the lattice's origin, never to the slices asked for, so what a voxel gets does not depend on
//! which part of the job it is computed in.

use super::Lattice;

/// Voxels along an edge of a brick.
pub const BRICK: usize = 8;
/// Voxels in a brick.
pub const BRICK_VOXELS: usize = BRICK * BRICK * BRICK;

/// What a voxel is made of: 0 is the background, n > 0 the n-th resin of the material set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, serde::Serialize, serde::Deserialize)]
pub struct MaterialId(pub u8);

impl MaterialId {
    /// Outside of every object.
    pub const BACKGROUND: Self = Self(0);

    /// The id of the resin at `index` in its material set (at most 254).
    pub fn from_resin(index: usize) -> Self {
        debug_assert!(index < 255);
        Self(index as u8 + 1)
    }

    /// The resin's index in its material set; `None` for the background.
    pub fn resin(self) -> Option<usize> {
        usize::from(self.0).checked_sub(1)
    }
}

/// Bricks per block along each axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlockShape(pub [usize; 3]);

impl BlockShape {
    /// Bricks in a block. Fewer make the descent from the root dearer, more make a slab (hence its memory) thicker: at
    /// J750 pitch 256 bricks are 2.7 × 2.7 × 1.7 mm, 64 slices.
    const BRICKS: usize = 256;

    /// The shape whose edges are most alike in mm for this pitch.
    pub fn for_lattice(lattice: &Lattice) -> Self {
        let mut bricks = [1_usize; 3];
        while bricks.iter().product::<usize>() < Self::BRICKS {
            let edge = |axis: usize| bricks[axis] as f64 * lattice.pitch[axis];
            let mut shortest = 2;
            for axis in [1, 0] {
                if edge(axis) < edge(shortest) {
                    shortest = axis;
                }
            }
            bricks[shortest] *= 2;
        }
        Self(bricks)
    }

    /// Voxels along each axis.
    pub fn voxels(self) -> [u32; 3] {
        self.0.map(|n| (n * BRICK) as u32)
    }

    /// Bricks in a block.
    pub fn bricks(self) -> usize {
        self.0.iter().product()
    }

    /// Index of the brick at (x, y, z) within its block; x runs fastest.
    #[inline]
    pub fn brick_index(self, [x, y, z]: [usize; 3]) -> usize {
        x + self.0[0] * (y + self.0[1] * z)
    }
}

/// The content of one brick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tile<'a> {
    /// Every voxel is the same.
    Uniform(MaterialId),
    /// One id per voxel; x runs fastest, then y, then z.
    Dense(&'a [u8; BRICK_VOXELS]),
}

/// The bricks of one block.
#[derive(Debug, Default, Clone)]
pub struct Block {
    tiles: Vec<u32>,
    pool: Vec<[u8; BRICK_VOXELS]>,
}

/// Marks a tile that holds an id rather than an index into the pool.
const UNIFORM: u32 = 1 << 31;

impl Block {
    fn clear(&mut self, bricks: usize) {
        self.tiles.clear();
        self.tiles.resize(bricks, UNIFORM);
        self.pool.clear();
    }

    /// The content of a brick.
    #[inline]
    pub fn tile(&self, brick: usize) -> Tile<'_> {
        let tile = self.tiles[brick];
        if tile & UNIFORM != 0 {
            Tile::Uniform(MaterialId((tile & 0xff) as u8))
        } else {
            Tile::Dense(&self.pool[tile as usize])
        }
    }

    /// Makes every voxel of a brick the same.
    pub fn set_uniform(&mut self, brick: usize, id: MaterialId) {
        self.tiles[brick] = UNIFORM | u32::from(id.0);
    }

    /// The voxels of a brick for writing; a uniform brick is unfolded first.
    pub fn dense_mut(&mut self, brick: usize) -> &mut [u8; BRICK_VOXELS] {
        let tile = self.tiles[brick];
        let index = if tile & UNIFORM != 0 {
            self.pool.push([(tile & 0xff) as u8; BRICK_VOXELS]);
            self.tiles[brick] = (self.pool.len() - 1) as u32;
            self.pool.len() - 1
        } else {
            tile as usize
        };
        &mut self.pool[index]
    }
}

/// Where the blocks of a slab are, row after row.
#[derive(Debug)]
pub(super) struct Layout {
    pub lattice: Lattice,
    pub shape: BlockShape,
    blocks_per_row: usize,
    rows: usize,
    /// The slab's position in build direction.
    pub index: u32,
}

impl Layout {
    /// At the bottom of the lattice.
    pub fn new(lattice: Lattice) -> Self {
        let shape = BlockShape::for_lattice(&lattice);
        let [blocks_per_row, rows] = [0, 1].map(|axis| lattice.dims[axis].div_ceil(shape.voxels()[axis]) as usize);
        Self { lattice, shape, blocks_per_row, rows, index: 0 }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.blocks_per_row * self.rows
    }

    /// The first voxel of a block, by the block's place.
    pub fn first_voxels(&self) -> impl Fn(usize) -> [u32; 3] + Sync + Send + use<> {
        let (shape, per_row, k) = (self.shape.voxels(), self.blocks_per_row, self.index * self.shape.voxels()[2]);
        move |n| [(n % per_row) as u32 * shape[0], (n / per_row) as u32 * shape[1], k]
    }

    /// The block of the brick at `at`, counted from the corner of the slab, and the brick's place in it.
    #[inline]
    pub fn place(&self, at: [usize; 3]) -> (usize, usize) {
        let shape = self.shape.0;
        let block = at[0] / shape[0] + self.blocks_per_row * (at[1] / shape[1]);
        (block, self.shape.brick_index(std::array::from_fn(|axis| at[axis] % shape[axis])))
    }
}

/// All voxels between two heights.
#[derive(Debug)]
pub struct Slab {
    layout: Layout,
    blocks: Vec<Block>,
}

impl Slab {
    /// An empty slab at the bottom of the lattice.
    pub fn new(lattice: Lattice) -> Self {
        let layout = Layout::new(lattice);
        let mut slab = Self { blocks: vec![Block::default(); layout.blocks()], layout };
        slab.reset(0);
        slab
    }

    /// Number of slabs that cover a lattice.
    pub fn count(lattice: &Lattice) -> u32 {
        lattice.dims[2].div_ceil(BlockShape::for_lattice(lattice).voxels()[2])
    }

    /// Empties the slab and moves it to position `index` in build direction; buffers are kept.
    pub fn reset(&mut self, index: u32) {
        self.layout.index = index;
        for block in &mut self.blocks {
            block.clear(self.layout.shape.bricks());
        }
    }

    /// The lattice the slab is part of.
    pub fn lattice(&self) -> &Lattice {
        &self.layout.lattice
    }

    /// Bricks per block.
    pub fn shape(&self) -> BlockShape {
        self.layout.shape
    }

    /// The slices of the lattice that this slab holds.
    pub fn slices(&self) -> std::ops::Range<u32> {
        let Layout { lattice, shape, index, .. } = &self.layout;
        let height = shape.voxels()[2];
        index * height..((index + 1) * height).min(lattice.dims[2])
    }

    /// The blocks with the index of their first voxel, for filling in parallel.
    pub fn blocks_mut(&mut self) -> impl rayon::iter::IndexedParallelIterator<Item = ([u32; 3], &mut Block)> {
        use rayon::prelude::*;
        let first_voxel = self.layout.first_voxels();
        self.blocks.par_iter_mut().enumerate().map(move |(n, block)| (first_voxel(n), block))
    }

    /// The material of one voxel, which must lie in [`Self::slices`].
    pub fn voxel(&self, [i, j, k]: [u32; 3]) -> MaterialId {
        let [x, y, z] = [i, j, k - self.slices().start].map(|v| v as usize);
        match self.tile([x / BRICK, y / BRICK, z / BRICK]) {
            Tile::Uniform(id) => id,
            Tile::Dense(ids) => MaterialId(ids[x % BRICK + BRICK * (y % BRICK + BRICK * (z % BRICK))]),
        }
    }

    /// The content of the brick at `[x, y, z]`, counted from the corner of the slab.
    pub fn tile(&self, at: [usize; 3]) -> Tile<'_> {
        let (block, brick) = self.layout.place(at);
        self.blocks[block].tile(brick)
    }

    /// The bricks of a row along x, at (y, z) counted from the slab's corner; the last ones may lie beyond the lattice.
    pub fn tiles(&self, [y, z]: [usize; 2]) -> impl Iterator<Item = Tile<'_>> {
        let Layout { shape, blocks_per_row, .. } = self.layout;
        let first = shape.brick_index([0, y % shape.0[1], z]);
        let blocks = self.blocks[y / shape.0[1] * blocks_per_row..].iter().take(blocks_per_row);
        blocks.flat_map(move |block| (first..first + shape.0[0]).map(|brick| block.tile(brick)))
    }

    /// Copies row (j, k) of material ids into `row`, which is `dims[0]` long.
    pub fn read_row(&self, j: u32, k: u32, row: &mut [u8]) {
        let [y, z] = [j, k - self.slices().start].map(|v| v as usize);
        let first = BRICK * (y % BRICK + BRICK * (z % BRICK));
        let mut parts = row.chunks_mut(BRICK);
        // Not zipped, for then blocks and bricks would not be two plain loops.
        self.tiles([y / BRICK, z / BRICK]).for_each(|tile| match (parts.next(), tile) {
            (None, _) => {}
            (Some(voxels), Tile::Uniform(id)) => voxels.fill(id.0),
            (Some(voxels), Tile::Dense(ids)) => voxels.copy_from_slice(&ids[first..first + voxels.len()]),
        });
    }

    /// Adds to `counts` how often every id occurs in slice `k`; brick by brick, for most are of one.
    pub fn count_voxels(&self, k: u32, counts: &mut [u64; 256]) {
        let [width, height, _] = self.lattice().dims.map(|dim| dim as usize);
        let z = (k - self.slices().start) as usize;
        for y in 0..height.div_ceil(BRICK) {
            let rows = BRICK.min(height - y * BRICK);
            for (x, tile) in (0..width).step_by(BRICK).zip(self.tiles([y, z / BRICK])) {
                // Bricks may reach beyond the lattice.
                let across = BRICK.min(width - x);
                match tile {
                    Tile::Uniform(id) => counts[usize::from(id.0)] += (across * rows) as u64,
                    Tile::Dense(ids) => {
                        for row in ids.as_chunks::<BRICK>().0[z % BRICK * BRICK..].iter().take(rows) {
                            match *row == [row[0]; BRICK] {
                                true => counts[usize::from(row[0])] += across as u64,
                                false => row[..across].iter().for_each(|id| counts[usize::from(*id)] += 1),
                            }
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use rayon::iter::ParallelIterator;

    fn lattice(pitch: DVec3, dims: [u32; 3]) -> Lattice {
        Lattice { origin: DVec3::ZERO, pitch, dims }
    }

    #[test]
    fn blocks_are_roughly_cubic_in_millimetres() {
        let j750 = lattice(DVec3::new(25.4 / 600.0, 25.4 / 300.0, 0.027), [1; 3]);
        assert_eq!(BlockShape::for_lattice(&j750), BlockShape([8, 4, 8]));
        let cubic = BlockShape::for_lattice(&lattice(DVec3::splat(0.1), [1; 3]));
        assert_eq!(cubic.bricks(), 256);
        assert_eq!(cubic.0.iter().max().unwrap() / cubic.0.iter().min().unwrap(), 2);
    }

    #[test]
    fn rows_read_back_what_blocks_were_given() {
        let lattice = lattice(DVec3::splat(0.1), [203, 77, 130]);
        let id = |[i, j, k]: [u32; 3]| ((i * 7 + j * 3 + k * 5) % 251) as u8;
        let mut slab = Slab::new(lattice);
        slab.reset(1);
        let shape = slab.shape();
        slab.blocks_mut().for_each(|(first, block)| {
            for z in 0..shape.0[2] {
                for y in 0..shape.0[1] {
                    for x in 0..shape.0[0] {
                        let voxels = block.dense_mut(shape.brick_index([x, y, z]));
                        for (n, voxel) in voxels.iter_mut().enumerate() {
                            *voxel = id([
                                first[0] + (x * BRICK + n % 8) as u32,
                                first[1] + (y * BRICK + n / 8 % 8) as u32,
                                first[2] + (z * BRICK + n / 64) as u32,
                            ]);
                        }
                    }
                }
            }
        });
        let mut row = vec![0; 203];
        for k in slab.slices() {
            for j in 0..77 {
                slab.read_row(j, k, &mut row);
                assert!(row.iter().enumerate().all(|(i, &v)| v == id([i as u32, j, k])));
                assert!((0..203).all(|i| slab.voxel([i, j, k]).0 == id([i, j, k])));
            }
        }
    }

    /// Several blocks along a row, the last ones beyond the lattice, in a slab that is not the first.
    #[test]
    fn voxels_are_counted_as_rows_have_them() {
        let lattice = lattice(DVec3::splat(0.1), [203, 77, 130]);
        let mut slab = Slab::new(lattice);
        slab.reset(1);
        let bricks = slab.shape().bricks();
        assert!(lattice.dims[0] > 2 * slab.shape().voxels()[0] && slab.slices().start > 0);
        slab.blocks_mut().for_each(|([i, j, _], block)| {
            let shift = (i / 8 + j) as usize;
            for brick in (0..bricks).step_by(3) {
                block.set_uniform(brick, MaterialId((brick + shift) as u8));
                (shift..).zip(block.dense_mut(bricks - 1 - brick)).for_each(|(n, id)| *id = (n / 5 % 7) as u8);
            }
        });
        let mut row = [0; 203];
        for k in slab.slices() {
            let (mut counts, mut expected) = ([0; 256], [0; 256]);
            slab.count_voxels(k, &mut counts);
            for j in 0..77 {
                slab.read_row(j, k, &mut row);
                row.iter().for_each(|id| expected[usize::from(*id)] += 1);
            }
            assert_eq!(counts, expected, "{k}");
        }
    }
}
