//! One photon's random walk through voxels.
//!
//! Delta tracking (Woodcock et al. 1965): flights are drawn as if the densest medium filled the volume, and a collision
//! is real with probability σt/σ_max of the voxel it falls into. Unbiased, and blind to voxel faces. Stepping from face
//! to face, which is exact too, takes twice as long on layers of the synthetic resins at the J750's pitch: σt differs
//! by a factor of 5 between them, while a mean free path crosses 5 to 30 faces. A void that fills most of a volume, or
//! a resin many times denser than the rest, would turn that round.

use rand_xoshiro::Xoshiro256PlusPlus;

use super::{Sides, VoxelGrid};
use crate::optics::{
    VolumeCoefficients,
    monte_carlo::photon::{Direction, FAINT, HenyeyGreenstein, REVIVED, azimuth, uniform},
};

/// A material as the walk sees it.
#[derive(Debug, Clone, Copy)]
struct Medium {
    /// σt/σ_max: how many of the collisions in it are real.
    real: f64,
    albedo: f64,
    phase: HenyeyGreenstein,
}

/// How a walk ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum End {
    /// Through the top at `at`, mm, within the grid; `turns` are the periods that it left the grid by, as mm to add.
    Top { at: [f64; 2], turns: [f64; 2], weight: f64 },
    /// Through the bottom.
    Bottom { weight: f64 },
    /// Through an open side.
    Side { weight: f64 },
    /// Absorbed.
    Absorbed,
}

/// The volume as the walk sees it.
pub(super) struct Walk<'a> {
    grid: &'a VoxelGrid,
    media: Vec<Medium>,
    base: Option<Medium>,
    sides: Sides,
    /// 1/σ_max, mm.
    mean_free_path: f64,
    size: [f64; 3],
    per_mm: [f64; 3],
}

impl<'a> Walk<'a> {
    /// `media` by id.
    pub fn new(
        grid: &'a VoxelGrid,
        media: &[VolumeCoefficients],
        base: Option<VolumeCoefficients>,
        sides: Sides,
    ) -> Self {
        let size = grid.size_mm();
        // Any bound will do where everything is void.
        let densest = media.iter().chain(&base).map(VolumeCoefficients::sigma_t).fold(0.0, f64::max);
        let densest = if densest > 0.0 { densest } else { 1.0 / size[2] };
        let medium = |volume: &VolumeCoefficients| Medium {
            real: volume.sigma_t() / densest,
            albedo: volume.albedo(),
            phase: HenyeyGreenstein::new(volume.g),
        };
        Self {
            grid,
            media: media.iter().map(medium).collect(),
            base: base.as_ref().map(medium),
            sides,
            mean_free_path: 1.0 / densest,
            size,
            per_mm: grid.pitch_mm().map(|pitch| 1.0 / pitch),
        }
    }

    /// Follows one photon that enters the top at `at` until it leaves or dies.
    pub fn trace(&self, mut at: [f64; 2], mut direction: Direction, rng: &mut Xoshiro256PlusPlus) -> End {
        let (mut z, mut turns, mut weight) = (0.0, [0.0; 2], 1.0);
        loop {
            let flight = -libm::log(1.0 - uniform(rng)) * self.mean_free_path;
            let reached = z + flight * direction.z;
            let leaves = reached < 0.0 || (reached >= self.size[2] && self.base.is_none());
            let way = match leaves {
                false => flight,
                true if reached < 0.0 => z / -direction.z,
                true => (self.size[2] - z) / direction.z,
            };
            at[0] += way * direction.x;
            at[1] += way * direction.y;
            let sides_x = self.pass_side(0, &mut at[0], &mut direction.x, &mut turns[0]);
            let sides_y = self.pass_side(1, &mut at[1], &mut direction.y, &mut turns[1]);
            if !(sides_x && sides_y) {
                return End::Side { weight };
            }
            if leaves {
                return if reached < 0.0 { End::Top { at, turns, weight } } else { End::Bottom { weight } };
            }
            z = reached;
            let medium = match &self.base {
                Some(base) if z >= self.size[2] => base,
                _ => &self.media[usize::from(self.id([at[0], at[1], z]))],
            };
            if uniform(rng) >= medium.real {
                continue;
            }
            weight *= medium.albedo;
            if weight < FAINT {
                if uniform(rng) * REVIVED >= weight {
                    return End::Absorbed;
                }
                weight = REVIVED;
            }
            direction = direction.turned(medium.phase.sample(uniform(rng)), azimuth(rng));
        }
    }

    /// Brings a coordinate beyond a side back into the grid; `false` where it is lost.
    #[inline]
    fn pass_side(&self, axis: usize, at: &mut f64, direction: &mut f64, turns: &mut f64) -> bool {
        let size = self.size[axis];
        if *at >= 0.0 && *at < size {
            return true;
        }
        let passed = (*at / size).floor();
        let within = (*at - passed * size).clamp(0.0, size);
        match self.sides {
            Sides::Open => return false,
            Sides::Periodic => {
                *turns += passed * size;
                *at = within;
            }
            Sides::Mirrored => {
                let turned = passed.rem_euclid(2.0) != 0.0;
                *at = if turned { size - within } else { within };
                *direction = if turned { -*direction } else { *direction };
            }
        }
        true
    }

    #[inline]
    fn id(&self, at: [f64; 3]) -> u8 {
        let dims = self.grid.dims();
        // A point on the far side itself belongs to the last voxel.
        let [i, j, k] = std::array::from_fn(|axis| ((at[axis] * self.per_mm[axis]) as usize).min(dims[axis] - 1));
        self.grid.ids()[i + dims[0] * (j + dims[1] * k)]
    }
}
