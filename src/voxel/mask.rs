//! A threshold for every voxel of space: blue noise in three dimensions.
//!
//! Void-and-cluster (Ulichney, *The void-and-cluster method for dither array generation*, 1993) on a tile of 32,768
//! voxels, as cubic in mm as powers of two allow, that repeats along x, y and z. Voxels are ranked one after the other,
//! each where those before it repel least, so that the voxels below any level are spread evenly. Between two voxels a
//! distance r apart, in units of the cubic root of a voxel's volume, the potential is
//!
//! ```text
//!   exp(−r²/2) + ½ (1 + r²)^(−3/2) + PLANE for each family of lattice planes that has both in one plane
//! ```
//!
//! The Gaussian keeps neighbours apart, the tail does so for few voxels far from each other, and the last term shares
//! out every level evenly over the planes of small Miller indices: a layer that is one plane of voxels thick gets its
//! share like any other.
//!
//! *Guaranteed:* every threshold once in a tile, so that shares of the volume are exact over a period; the same mask on
//! every machine, for it needs nothing but sums of single-precision numbers in a fixed order. A threshold depends on
//! the index of the voxel alone. *Measured* (`voxel::mask`): energy at wavelengths above a millimetre, worst shares of
//! planes.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use glam::DVec3;
use multiversion::multiversion;

use super::{BRICK, BRICK_VOXELS};

/// A permutation of the voxels of a tile that repeats; see the [module](self).
///
/// ```
/// use lumislice::voxel::ThresholdMask;
///
/// let mask = ThresholdMask::new(glam::DVec3::new(0.04233, 0.08467, 0.027));
/// assert_eq!(mask.period(), [32, 16, 64]);
/// assert_eq!(mask.rank([1, 2, 3]), mask.rank([33, 18, 67]));
/// let dark = (0..64).flat_map(|k| (0..16).flat_map(move |j| (0..32).map(move |i| [i, j, k])));
/// assert_eq!(dark.filter(|&at| mask.rank(at) < 3277).count(), 3277);
/// ```
#[derive(Clone)]
pub struct ThresholdMask {
    /// Bricks of the tile per axis, powers of two.
    bricks: [u32; 3],
    /// Ranks, brick by brick.
    ranks: Vec<[u16; BRICK_VOXELS]>,
}

impl std::fmt::Debug for ThresholdMask {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ThresholdMask").field("period", &self.period()).finish_non_exhaustive()
    }
}

/// Strength of a plane in the potential. At 0.015 no plane of one period, of axes or of diagonals, is off by more than
/// 1% at any of the levels 2, 10, 30, 50, 80%; without it by 5%. At 0.02 shares are better still, but wavelengths of
/// a millimetre get twice the energy at 2%.
const PLANE: f64 = 0.015;

/// Miller indices of the families of planes.
const PLANES: [[i32; 3]; 13] = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, 1, 0],
    [1, -1, 0],
    [1, 0, 1],
    [1, 0, -1],
    [0, 1, 1],
    [0, 1, -1],
    [1, 1, 1],
    [1, 1, -1],
    [1, -1, 1],
    [-1, 1, 1],
];

/// Share of the tile that the start is, which is moved about until it is even.
const START: usize = ThresholdMask::LEVELS / 10;
/// Moves of the start at most; it needs some 1,300.
const MOVES: usize = 4 * START;
/// What makes a ranked voxel no void. More than all potentials together.
const RANKED: f32 = 65536.0;

impl ThresholdMask {
    /// Ranks of a tile, from 0 to one below this.
    pub const LEVELS: usize = 1 << 15;

    /// The mask for voxels of `pitch` mm. Takes a few tenths of a second.
    pub fn new(pitch: DVec3) -> Self {
        let tile = Tile::new(pitch);
        let mut ranks = vec![[0; BRICK_VOXELS]; Self::LEVELS / BRICK_VOXELS];
        let bricks = tile.dims.map(|dim| dim / BRICK);
        for (voxel, rank) in tile.ranked().into_iter().enumerate() {
            let at = tile.position(voxel);
            let [x, y, z] = at.map(|at| at / BRICK);
            let within = at[0] % BRICK + BRICK * (at[1] % BRICK + BRICK * (at[2] % BRICK));
            ranks[x + bricks[0] * (y + bricks[1] * z)][within] = rank;
        }
        Self { bricks: bricks.map(|n| n as u32), ranks }
    }

    /// The mask for voxels of `pitch` mm, made once for all who hold it.
    pub fn shared(pitch: DVec3) -> Arc<Self> {
        static KNOWN: Mutex<Vec<([u64; 3], Weak<ThresholdMask>)>> = Mutex::new(Vec::new());
        let key = pitch.to_array().map(f64::to_bits);
        // A mask that could not be made leaves nothing behind.
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|(_, mask)| mask.strong_count() > 0);
        if let Some(mask) = known.iter().find(|(of, _)| *of == key).and_then(|(_, mask)| mask.upgrade()) {
            return mask;
        }
        let mask = Arc::new(Self::new(pitch));
        known.push((key, Arc::downgrade(&mask)));
        mask
    }

    /// Voxels along each axis after which the mask repeats: powers of two.
    pub fn period(&self) -> [u32; 3] {
        self.bricks.map(|n| n * BRICK as u32)
    }

    /// Ranks of the voxels of a brick, by its index in units of bricks; x runs fastest, then y, then z.
    #[inline]
    pub fn brick(&self, at: [u32; 3]) -> &[u16; BRICK_VOXELS] {
        let [x, y, z] = std::array::from_fn(|axis| at[axis] & (self.bricks[axis] - 1));
        &self.ranks[(x + self.bricks[0] * (y + self.bricks[1] * z)) as usize]
    }

    /// Ranks of a second mask that has next to nothing to do with the first: the same, half a period away.
    #[inline]
    pub fn second(&self, at: [u32; 3]) -> &[u16; BRICK_VOXELS] {
        self.brick(std::array::from_fn(|axis| at[axis] + self.bricks[axis] / 2))
    }

    /// The rank of a voxel.
    pub fn rank(&self, at: [u32; 3]) -> u16 {
        let [x, y, z] = at.map(|at| at as usize % BRICK);
        self.brick(at.map(|at| at / BRICK as u32))[x + BRICK * (y + BRICK * z)]
    }

    /// Ranks below this, of [`Self::LEVELS`], are a `share` (0 to 1) of the volume.
    pub fn level(share: f64) -> u16 {
        (share.clamp(0.0, 1.0) * Self::LEVELS as f64).round() as u16
    }
}

/// A tile on its way.
struct Tile {
    dims: [usize; 3],
    /// Potential of a voxel at the origin, twice along x so that it can be read from anywhere.
    kernel: Vec<f32>,
}

impl Tile {
    fn new(pitch: DVec3) -> Self {
        let mut dims = [BRICK; 3];
        while dims.iter().product::<usize>() < ThresholdMask::LEVELS {
            let edge = |axis: usize| dims[axis] as f64 * pitch[axis];
            let shortest =
                [1, 0].into_iter().fold(2, |least, axis| if edge(axis) < edge(least) { axis } else { least });
            dims[shortest] *= 2;
        }
        let unit = libm::cbrt(pitch.x * pitch.y * pitch.z);
        let mut kernel = Vec::with_capacity(2 * ThresholdMask::LEVELS);
        for k in 0..dims[2] {
            for j in 0..dims[1] {
                kernel.extend((0..2 * dims[0]).map(|i| potential([i % dims[0], j, k], dims, pitch / unit)));
            }
        }
        Self { dims, kernel }
    }

    fn position(&self, voxel: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [voxel % nx, voxel / nx % ny, voxel / (nx * ny)]
    }

    /// The rank of every voxel, x fastest.
    fn ranked(&self) -> Vec<u16> {
        let mut field = vec![0.0; ThresholdMask::LEVELS];
        let mut start = Vec::with_capacity(START);
        let mut state = 1_u64;
        while start.len() < START {
            // Knuth's linear congruential generator; any scattering will do.
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let voxel = (state >> 33) as usize % ThresholdMask::LEVELS;
            if field[voxel] < RANKED {
                self.add::<false>(&mut field, voxel);
                field[voxel] += RANKED;
                start.push(voxel);
            }
        }
        // From the tightest cluster into the largest void, until that is the same place.
        for _ in 0..MOVES {
            let tightest = tightest(&field, &start);
            let from = start[tightest];
            field[from] -= RANKED;
            let to = self.add::<true>(&mut field, from);
            self.add::<false>(&mut field, to);
            field[to] += RANKED;
            start[tightest] = to;
            if from == to {
                break;
            }
        }
        let mut ranks = vec![0; ThresholdMask::LEVELS];
        // What of the start would be missed least has the highest of its ranks.
        let (mut rest, mut thinned) = (start, field.clone());
        while !rest.is_empty() {
            let from = rest.swap_remove(tightest(&thinned, &rest));
            ranks[from] = rest.len() as u16;
            self.add::<true>(&mut thinned, from);
        }
        let mut void = (0..field.len()).fold(0, |least, n| if field[n] < field[least] { n } else { least });
        for rank in START..ThresholdMask::LEVELS {
            ranks[void] = rank as u16;
            field[void] += RANKED;
            void = self.add::<false>(&mut field, void);
        }
        ranks
    }

    /// Adds the potential of `voxel`, or takes it away; the voxel of the least of all, the first of equals.
    fn add<const AWAY: bool>(&self, field: &mut [f32], voxel: usize) -> usize {
        add(field, &self.kernel, self.dims, self.position(voxel), if AWAY { -1.0 } else { 1.0 })
    }
}

/// The potential at a voxel of a tile of `dims` voxels by one at its corner.
fn potential(at: [usize; 3], dims: [usize; 3], pitch: DVec3) -> f32 {
    let way = DVec3::from(std::array::from_fn(|axis| at[axis].min(dims[axis] - at[axis]) as f64)) * pitch;
    let squared = way.length_squared();
    let tail = 1.0 + squared;
    let mut sum = libm::exp(-squared / 2.0) + 0.5 / (tail * tail.sqrt());
    for miller in PLANES {
        let through = (0..3).filter(|&axis| miller[axis] != 0);
        let planes = through.clone().map(|axis| dims[axis]).min().unwrap_or(1);
        let plane: i64 = through.map(|axis| i64::from(miller[axis]) * at[axis] as i64).sum();
        if plane.rem_euclid(planes as i64) == 0 {
            // A voxel's share of all planes of a family is the same for all families.
            sum += PLANE * planes as f64 / 32.0;
        }
    }
    sum as f32
}

/// The place in `voxels` of the one with the greatest value, the first of equals.
fn tightest(field: &[f32], voxels: &[usize]) -> usize {
    (0..voxels.len()).fold(0, |most, n| if field[voxels[n]] > field[voxels[most]] { n } else { most })
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn add(field: &mut [f32], kernel: &[f32], dims: [usize; 3], [x, y, z]: [usize; 3], sign: f32) -> usize {
    const LANES: usize = 8;
    let [nx, ny, nz] = dims;
    let mut least = [f32::INFINITY; LANES];
    let mut rows = field.chunks_exact_mut(nx);
    for k in 0..nz {
        for j in 0..ny {
            let Some(row) = rows.next() else { break };
            let from = 2 * nx * ((j + ny - y) % ny + ny * ((k + nz - z) % nz)) + nx - x;
            let kernel = &kernel[from..from + nx];
            for (values, kernel) in row.as_chunks_mut::<LANES>().0.iter_mut().zip(kernel.as_chunks::<LANES>().0) {
                for lane in 0..LANES {
                    let value = values[lane] + sign * kernel[lane];
                    values[lane] = value;
                    least[lane] = if value < least[lane] { value } else { least[lane] };
                }
            }
        }
    }
    let least = least.iter().copied().fold(f32::INFINITY, |a, b| if b < a { b } else { a });
    // Found again, which is quicker than to keep its place.
    for (chunk, values) in field.as_chunks::<{ 4 * LANES }>().0.iter().enumerate() {
        let mut here = false;
        for value in values {
            here |= *value == least;
        }
        if here {
            let within = values.iter().position(|value| *value == least).unwrap_or_default();
            return chunk * values.len() + within;
        }
    }
    0
}

#[cfg(test)]
#[path = "tests/mask.rs"]
mod tests;
