//! Volume fractions of resins in voxels: what a mixture is before a mask makes it grains.
//!
//! ```text
//!   slab    as a [`Slab`](super::Slab): all x and y, a fixed number of slices, blocks of bricks
//!   brick   nothing; one composition for all voxels; or for each of its resins a number a voxel
//! ```
//!
//! Fractions are whole ten-thousandths ([`WHOLE`]), and sum to it exactly in every voxel that is inside an object.

use rayon::prelude::*;

use super::{BRICK, BRICK_VOXELS, Lattice, MaterialId, slab::Layout};

/// All of a voxel's volume. Decimal, so that a mixture of 10% reads 0.1.
pub const WHOLE: u16 = 10_000;

/// Shares up to this are what rounding leaves of sums of others. Masks have 2¹⁵ thresholds: by chance one voxel in a
/// billion would be drawn by it.
const LEAST: f64 = 1e-9;

/// Resins with their fractions in units of 1 / [`WHOLE`], in the order of their ids; they sum to it.
pub type Composition = Vec<(MaterialId, u16)>;

/// Resins with their shares of a voxel, on their way to a [`Composition`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Weights(Vec<(MaterialId, f64)>);

impl Weights {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Adds a share, 0 to 1, of a resin.
    pub fn add(&mut self, resin: MaterialId, share: f64) {
        if share <= 0.0 {
            return;
        }
        match self.0.iter_mut().find(|known| known.0 == resin) {
            Some(known) => known.1 += share,
            None => self.0.push((resin, share)),
        }
    }

    /// The shares in whole units, which replace `parts`. Shares are to sum to 1.
    ///
    /// Each is within one unit of what it was, and none above one in a billion is lost: what would round to 0 is 1, taken
    /// from the largest, which may so be off by more.
    pub fn round(&mut self, parts: &mut Composition) {
        parts.clear();
        self.0.retain(|(_, share)| *share > LEAST);
        self.0.sort_unstable_by_key(|part| part.0);
        let (mut sum, mut below) = (0.0, 0);
        let count = self.0.len();
        for (n, (resin, share)) in self.0.iter().enumerate() {
            sum += share;
            let level = if n + 1 == count { WHOLE } else { (sum * f64::from(WHOLE)).round() as u16 };
            parts.push((*resin, level - below));
            below = level;
        }
        let lost = parts.iter_mut().filter(|part| part.1 == 0).map(|part| part.1 = 1).count();
        if let Some(largest) = parts.iter_mut().max_by_key(|part| part.1) {
            largest.1 -= lost as u16;
        }
    }
}

/// The fractions in one brick.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum BrickFractions {
    /// All of it is outside.
    #[default]
    Empty,
    /// The same in all voxels.
    Uniform(Composition),
    /// By resin, in no order, x running fastest; all 0 in voxels that are outside.
    Each(Vec<(MaterialId, Box<[u16; BRICK_VOXELS]>)>),
}

impl BrickFractions {
    /// Those of printed voxels: their one id, or `None` and the id of each.
    pub fn of_ids(uniform: Option<MaterialId>, ids: &[u8; BRICK_VOXELS]) -> Self {
        match uniform {
            Some(MaterialId::BACKGROUND) => Self::Empty,
            Some(id) => Self::Uniform(vec![(id, WHOLE)]),
            None => {
                let mut found = Self::Each(Vec::new());
                for (voxel, id) in ids.iter().enumerate().filter(|(_, id)| **id != 0) {
                    found.set(voxel, &[(MaterialId(*id), WHOLE)]);
                }
                found
            }
        }
    }

    /// A resin's fraction in a voxel.
    pub fn of(&self, resin: MaterialId, voxel: usize) -> u16 {
        match self {
            Self::Empty => 0,
            Self::Uniform(parts) => parts.iter().find(|part| part.0 == resin).map_or(0, |part| part.1),
            Self::Each(resins) => resins.iter().find(|known| known.0 == resin).map_or(0, |known| known.1[voxel]),
        }
    }

    /// Whether nothing is in a voxel.
    pub fn is_free(&self, voxel: usize) -> bool {
        match self {
            Self::Empty => true,
            Self::Uniform(_) => false,
            Self::Each(resins) => resins.iter().all(|resin| resin.1[voxel] == 0),
        }
    }

    /// Gives a voxel that is free its composition.
    pub fn set(&mut self, voxel: usize, parts: &[(MaterialId, u16)]) {
        if let Self::Empty = self {
            *self = Self::Each(Vec::new());
        }
        let Self::Each(resins) = self else { return };
        for &(resin, fraction) in parts {
            let at = resins.iter().position(|known| known.0 == resin).unwrap_or_else(|| {
                resins.push((resin, Box::new([0; BRICK_VOXELS])));
                resins.len() - 1
            });
            resins[at].1[voxel] = fraction;
        }
    }

    /// The same as one composition, where all voxels are alike and none is outside.
    pub fn settle(&mut self) {
        let Self::Each(resins) = self else { return };
        if resins.iter().all(|(_, fractions)| fractions.iter().all(|other| *other == fractions[0])) {
            let mut parts: Composition = resins.iter().map(|(resin, fractions)| (*resin, fractions[0])).collect();
            parts.sort_unstable();
            *self = if parts.is_empty() { Self::Empty } else { Self::Uniform(parts) };
        }
    }
}

/// The fractions in all voxels between two heights.
#[derive(Debug)]
pub struct FractionSlab {
    layout: Layout,
    blocks: Vec<Vec<BrickFractions>>,
}

impl FractionSlab {
    /// An empty slab at the bottom of the lattice.
    pub fn new(lattice: Lattice) -> Self {
        let layout = Layout::new(lattice);
        let blocks = vec![vec![BrickFractions::Empty; layout.shape.bricks()]; layout.blocks()];
        Self { layout, blocks }
    }

    /// Empties the slab and moves it to position `index` in build direction.
    pub fn reset(&mut self, index: u32) {
        self.layout.index = index;
        self.blocks.par_iter_mut().for_each(|block| block.fill(BrickFractions::Empty));
    }

    /// The bricks of every block, with the index of its first voxel, for filling in parallel.
    pub fn blocks_mut(&mut self) -> impl IndexedParallelIterator<Item = ([u32; 3], &mut [BrickFractions])> {
        let first_voxel = self.layout.first_voxels();
        self.blocks.par_iter_mut().enumerate().map(move |(n, block)| (first_voxel(n), &mut block[..]))
    }

    /// The brick at `at`, counted in bricks from the lattice's corner, which must be one of the slab's.
    pub fn brick(&self, at: [u32; 3]) -> &BrickFractions {
        let Layout { shape, index, .. } = self.layout;
        let [x, y, z] = at.map(|at| at as usize);
        let (block, brick) = self.layout.place([x, y, z - index as usize * shape.0[2]]);
        &self.blocks[block][brick]
    }

    /// Copies a resin's fractions in row (j, k) into `row`, which is `dims[0]` long.
    pub fn read_row(&self, resin: MaterialId, j: u32, k: u32, row: &mut [u16]) {
        debug_assert_eq!(row.len(), self.layout.lattice.dims[0] as usize);
        let first = BRICK * (j as usize % BRICK + BRICK * (k as usize % BRICK));
        for (x, voxels) in (0..).zip(row.chunks_mut(BRICK)) {
            match self.brick([x, j / BRICK as u32, k / BRICK as u32]) {
                BrickFractions::Each(resins) => match resins.iter().find(|known| known.0 == resin) {
                    Some((_, fractions)) => voxels.copy_from_slice(&fractions[first..first + voxels.len()]),
                    None => voxels.fill(0),
                },
                brick => voxels.fill(brick.of(resin, 0)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: MaterialId = MaterialId(1);
    const BLACK: MaterialId = MaterialId(2);

    #[test]
    fn rounded_fractions_sum_to_the_whole() {
        let mut parts = Vec::new();
        for shares in [[0.9, 0.1, 0.0], [1.0 / 3.0; 3], [0.00004, 0.00003, 0.99993], [0.12345, 0.0, 0.87655]] {
            let mut weights = Weights::default();
            // In two halves and backwards, as layers may come.
            for (n, share) in shares.iter().enumerate().rev().chain(shares.iter().enumerate()) {
                weights.add(MaterialId(n as u8 + 1), share / 2.0);
            }
            weights.round(&mut parts);
            assert_eq!(parts.iter().map(|part| part.1).sum::<u16>(), WHOLE, "{shares:?}");
            assert!(parts.is_sorted() && parts.iter().all(|part| part.1 > 0), "{parts:?}");
            for (resin, fraction) in &parts {
                let off = f64::from(*fraction) / f64::from(WHOLE) - shares[usize::from(resin.0) - 1];
                // Of what would be lost, one here, each takes a unit from the largest.
                let most = if *fraction > WHOLE / 2 { 2.0 } else { 1.0 };
                assert!(off.abs() < most / f64::from(WHOLE), "{shares:?}: {parts:?}");
            }
            assert_eq!(parts.len(), shares.iter().filter(|share| **share > 0.0).count(), "{shares:?}: {parts:?}");
        }
        let mut weights = Weights::default();
        [(BLACK, 0.1), (WHITE, 0.9)].into_iter().for_each(|(resin, share)| weights.add(resin, share));
        weights.round(&mut parts);
        assert_eq!(parts, [(WHITE, 9000), (BLACK, 1000)]);
    }

    #[test]
    fn no_share_is_lost_and_rounding_is_none() {
        let (mut weights, mut parts) = (Weights::default(), Vec::new());
        let rest = 1.0 - 254.0 * 1e-7;
        (1..=254).for_each(|id| weights.add(MaterialId(id), 1e-7));
        weights.add(MaterialId(255), rest);
        weights.round(&mut parts);
        assert_eq!((parts.len(), parts[0].1, parts[254].1), (255, 1, WHOLE - 254));
        weights.clear();
        [(WHITE, 1.0 - 1e-16), (BLACK, 1e-16)].into_iter().for_each(|(resin, share)| weights.add(resin, share));
        weights.round(&mut parts);
        assert_eq!(parts, [(WHITE, WHOLE)]);
    }

    #[test]
    fn bricks_hold_what_they_were_given() {
        let mut brick = BrickFractions::default();
        brick.set(7, &[(WHITE, 9000), (BLACK, 1000)]);
        brick.set(8, &[(BLACK, WHOLE)]);
        assert_eq!([6, 7, 8].map(|voxel| brick.of(BLACK, voxel)), [0, 1000, WHOLE]);
        assert_eq!([6, 7, 8].map(|voxel| brick.is_free(voxel)), [true, false, false]);
        brick.settle();
        assert!(matches!(brick, BrickFractions::Each(_)));
        let mut alike = BrickFractions::default();
        (0..BRICK_VOXELS).for_each(|voxel| alike.set(voxel, &[(BLACK, 1000), (WHITE, 9000)]));
        alike.settle();
        assert_eq!(alike, BrickFractions::Uniform(vec![(WHITE, 9000), (BLACK, 1000)]));
        let ids = std::array::from_fn(|n| (n % 3) as u8);
        let printed = BrickFractions::of_ids(None, &ids);
        assert!((0..BRICK_VOXELS).all(|n| printed.of(BLACK, n) == if n % 3 == 2 { WHOLE } else { 0 }));
        assert!((0..BRICK_VOXELS).all(|n| printed.is_free(n) == (n % 3 == 0)));
    }

    #[test]
    fn rows_read_back_what_bricks_were_given() {
        let lattice = Lattice { origin: glam::DVec3::ZERO, pitch: glam::DVec3::splat(0.1), dims: [203, 77, 130] };
        let fraction = |[i, j, k]: [u32; 3]| ((i * 7 + j * 3 + k * 5) % 9999 + 1) as u16;
        let mut slab = FractionSlab::new(lattice);
        slab.reset(1);
        let shape = slab.layout.shape;
        slab.blocks_mut().for_each(|(first, bricks)| {
            for (n, brick) in bricks.iter_mut().enumerate() {
                let at = [n % shape.0[0], n / shape.0[0] % shape.0[1], n / (shape.0[0] * shape.0[1])];
                for voxel in 0..BRICK_VOXELS {
                    let within = [voxel % 8, voxel / 8 % 8, voxel / 64];
                    let index = std::array::from_fn(|axis| first[axis] + (at[axis] * BRICK + within[axis]) as u32);
                    brick.set(voxel, &[(BLACK, fraction(index))]);
                }
            }
        });
        let mut row = vec![0; 203];
        let height = shape.voxels()[2];
        for k in height..(2 * height).min(130) {
            for j in 0..77 {
                slab.read_row(BLACK, j, k, &mut row);
                assert!(row.iter().enumerate().all(|(i, &found)| found == fraction([i as u32, j, k])));
                slab.read_row(WHITE, j, k, &mut row);
                assert!(row.iter().all(|found| *found == 0));
            }
        }
    }
}
