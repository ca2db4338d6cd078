//! Voxels for containers: some slices at a time, by rows or by bricks.

use std::{borrow::Cow, ops::Range};

use crate::{
    look::Volume,
    voxel::{BRICK, BRICK_VOXELS, BrickFractions, FractionSlab, Lattice, MaterialId, Slab, Tile, WHOLE},
};

/// Some slices of a lattice of material ids, a whole layer of bricks or several (fewer slices at the top only).
pub trait Voxels: Sync {
    /// The whole lattice.
    fn lattice(&self) -> &Lattice;
    /// The slices that are held.
    fn slices(&self) -> Range<u32>;
    /// Copies row (j, k) of ids into `row`, which is `dims[0]` long.
    fn read_row(&self, j: u32, k: u32, row: &mut [u8]);
    /// A brick of the layers held, counted from the lattice's corner: its one id, or `None` and its ids in `ids`, x
    /// running fastest. Beyond the lattice voxels are 0.
    fn brick(&self, at: [u32; 3], ids: &mut [u8; BRICK_VOXELS]) -> Option<MaterialId>;

    /// Copies the volume fractions of a resin in row (j, k), in units of 1 / [`WHOLE`], into `row`, which is `dims[0]`
    /// long. Those of printed voxels are all or nothing.
    fn read_fractions(&self, resin: MaterialId, j: u32, k: u32, row: &mut [u16]) {
        let mut ids = vec![0; row.len()];
        self.read_row(j, k, &mut ids);
        row.iter_mut().zip(ids).for_each(|(fraction, id)| *fraction = if id == resin.0 { WHOLE } else { 0 });
    }

    /// The same of a brick, counted as by [`Self::brick`].
    fn brick_fractions(&self, at: [u32; 3]) -> Cow<'_, BrickFractions> {
        let mut ids = [0; BRICK_VOXELS];
        let uniform = self.brick(at, &mut ids);
        Cow::Owned(BrickFractions::of_ids(uniform, &ids))
    }

    /// Bricks along each axis, the last one that of the layers held.
    fn bricks(&self) -> [Range<u32>; 3] {
        let [nx, ny, _] = self.lattice().dims.map(|dim| dim.div_ceil(BRICK as u32));
        let Range { start, end } = self.slices();
        [0..nx, 0..ny, start / BRICK as u32..end.div_ceil(BRICK as u32)]
    }
}

impl Voxels for Slab {
    fn lattice(&self) -> &Lattice {
        Slab::lattice(self)
    }

    fn slices(&self) -> Range<u32> {
        Slab::slices(self)
    }

    fn read_row(&self, j: u32, k: u32, row: &mut [u8]) {
        Slab::read_row(self, j, k, row);
    }

    fn brick(&self, at: [u32; 3], ids: &mut [u8; BRICK_VOXELS]) -> Option<MaterialId> {
        let first = Slab::slices(self).start / BRICK as u32;
        let tile = self.tile([at[0], at[1], at[2] - first].map(|index| index as usize));
        within(Slab::lattice(self), at, tile, ids)
    }
}

/// A slab whose voxels are drawn by lot, with the fractions that they are drawn by.
#[derive(Debug)]
pub struct Drawn<'a> {
    /// The voxels.
    pub slab: &'a Slab,
    /// The fractions in them.
    pub fractions: &'a FractionSlab,
}

impl Voxels for Drawn<'_> {
    fn lattice(&self) -> &Lattice {
        self.slab.lattice()
    }

    fn slices(&self) -> Range<u32> {
        self.slab.slices()
    }

    fn read_row(&self, j: u32, k: u32, row: &mut [u8]) {
        self.slab.read_row(j, k, row);
    }

    fn brick(&self, at: [u32; 3], ids: &mut [u8; BRICK_VOXELS]) -> Option<MaterialId> {
        Voxels::brick(self.slab, at, ids)
    }

    fn read_fractions(&self, resin: MaterialId, j: u32, k: u32, row: &mut [u16]) {
        self.fractions.read_row(resin, j, k, row);
    }

    fn brick_fractions(&self, at: [u32; 3]) -> Cow<'_, BrickFractions> {
        Cow::Borrowed(self.fractions.brick(at))
    }
}

/// A layer of bricks of a volume.
#[derive(Debug)]
pub struct VolumeLayer<'a> {
    /// The volume.
    pub volume: &'a Volume,
    /// Which layer, from 0.
    pub layer: u32,
}

impl Voxels for VolumeLayer<'_> {
    fn lattice(&self) -> &Lattice {
        self.volume.lattice()
    }

    fn slices(&self) -> Range<u32> {
        let first = self.layer * BRICK as u32;
        first..(first + BRICK as u32).min(self.lattice().dims[2])
    }

    fn read_row(&self, j: u32, k: u32, row: &mut [u8]) {
        for (i, id) in row.iter_mut().enumerate() {
            *id = self.volume.voxel([i as i64, i64::from(j), i64::from(k)]).0;
        }
    }

    fn brick(&self, at: [u32; 3], ids: &mut [u8; BRICK_VOXELS]) -> Option<MaterialId> {
        let mut dense = [0; BRICK_VOXELS];
        within(self.lattice(), at, self.volume.tile_at(at.map(|index| index as usize), &mut dense), ids)
    }
}

/// A tile without what lies beyond the lattice.
fn within(lattice: &Lattice, at: [u32; 3], tile: Tile<'_>, ids: &mut [u8; BRICK_VOXELS]) -> Option<MaterialId> {
    let inside: [usize; 3] =
        std::array::from_fn(|axis| (lattice.dims[axis].saturating_sub(at[axis] * BRICK as u32) as usize).min(BRICK));
    match tile {
        Tile::Uniform(id) if id == MaterialId::BACKGROUND || inside == [BRICK; 3] => return Some(id),
        Tile::Uniform(id) => ids.fill(id.0),
        Tile::Dense(dense) => ids.copy_from_slice(dense),
    }
    if inside != [BRICK; 3] {
        for (n, id) in ids.iter_mut().enumerate() {
            let place = [n % BRICK, n / BRICK % BRICK, n / (BRICK * BRICK)];
            if (0..3).any(|axis| place[axis] >= inside[axis]) {
                *id = 0;
            }
        }
    }
    uniform(ids)
}

fn uniform(ids: &[u8; BRICK_VOXELS]) -> Option<MaterialId> {
    ids.iter().all(|id| *id == ids[0]).then_some(MaterialId(ids[0]))
}

/// Up to eight slices that make a layer of bricks, read from images.
#[derive(Debug)]
pub struct SliceBatch {
    /// The whole lattice.
    pub lattice: Lattice,
    /// The first slice, a multiple of eight.
    pub first: u32,
    /// Ids of each slice, row 0 the row of largest y.
    pub images: Vec<Vec<u8>>,
}

impl Voxels for SliceBatch {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn slices(&self) -> Range<u32> {
        self.first..self.first + self.images.len() as u32
    }

    fn read_row(&self, j: u32, k: u32, row: &mut [u8]) {
        let [width, height, _] = self.lattice.dims.map(|dim| dim as usize);
        let from_top = height - 1 - j as usize;
        row.copy_from_slice(&self.images[(k - self.first) as usize][from_top * width..(from_top + 1) * width]);
    }

    fn brick(&self, at: [u32; 3], ids: &mut [u8; BRICK_VOXELS]) -> Option<MaterialId> {
        let [width, height, _] = self.lattice.dims.map(|dim| dim as usize);
        let [left, low] = [at[0] as usize * BRICK, at[1] as usize * BRICK];
        let across = BRICK.min(width - left);
        ids.fill(0);
        for (z, image) in self.images.iter().enumerate() {
            for y in 0..BRICK.min(height - low) {
                let from = (height - 1 - low - y) * width + left;
                let to = BRICK * (y + BRICK * z);
                ids[to..to + across].copy_from_slice(&image[from..from + across]);
            }
        }
        uniform(ids)
    }
}
