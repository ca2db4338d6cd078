//! Monte Carlo through voxels: how a print looks, the referee of what varies over the surface, and the maker of
//! synthetic BSSRDFs.
//!
//! One walker goes through them all: sparse bricks of material ids ([`Volume`]) with what they do to light ([`Scene`]).
//! A print of any shape stands in free space and is looked at from outside ([`Scene::radiosity`], [`Stage`]); a flat
//! slab goes on beyond its sides, or not, and is lit on its top ([`VoxelScene`]).
//!
//! **In, of a slab:** a [`VoxelGrid`], the coefficients of its ids in one channel, what lies at the sides and below,
//! light on the top. **Out:** an image of the radiosity of the top ([`VoxelScene::image`]), or for a lit texel the
//! window of texels that its light leaves by ([`VoxelScene::responses`]), each value with its standard error.
//!
//! *Guaranteed:* estimates without bias; the same bytes for the same seed whatever the number of threads. *Not
//! covered:* refractive indices of slabs count as matched, whatever the resins say: voxel faces and the top neither
//! reflect nor bend; polarisation; time of flight.

mod camera;
mod film;
mod grid;
mod lamps;
mod light;
mod media;
mod normals;
mod packed;
mod path;
mod scene;
mod skin;
mod smooth;
mod spectrum;
mod spots;
mod strides;
mod tally;
#[cfg(test)]
mod tests;
mod volume;
mod voxel_surface;
mod walk;
mod walker;

use std::ops::Range;

use glam::DVec3;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

pub use camera::Camera;
pub use film::{Film, Stage};
pub use grid::VoxelGrid;
pub use lamps::{Beam, Ground, LAMPS, Lamps, Lit};
pub use light::{Pattern, TexelGrid};
pub use scene::Scene;
pub use smooth::{Shown, smooth, smooth_chroma};
pub use spectrum::ExitSpectrum;
pub use spots::{Radiosity, Site, Spot};
pub use tally::{ExitImage, Response};
pub use volume::{Volume, VolumeTooLarge};

use crate::optics::{
    Light, OpticsError, VolumeCoefficients,
    monte_carlo::{in_batches, photon::uniform},
};
use crate::parallel;
use crate::voxel::{BRICK, Lattice};
use crate::watch::Watch;
use light::Source;
use tally::{Counted, ImageTally};
use walk::{End, Walk};

/// What lies beyond the four sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// The volume again, and again.
    Periodic,
    /// Its mirror image: perfect mirrors.
    Mirrored,
    /// Nothing: light that leaves is lost.
    Open,
}

/// A slab of voxels in one channel, its lit top at z = 0 and z **down** into it.
#[derive(Debug)]
pub struct VoxelScene {
    scene: Scene,
    size_mm: [f64; 3],
    sides: Sides,
    /// The id of what lies below.
    base: Option<u8>,
}

/// How many photons to trace, and which.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Photons {
    /// Directions they enter by.
    pub light: Light,
    /// Their number, at least 2: of an image, or of each lit texel.
    pub count: u64,
    /// Same seed, same result.
    pub seed: u64,
}

/// Texels that are lit one by one, and the window around each in which its light is counted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Windows {
    /// The texels.
    pub texels: TexelGrid,
    /// Texels from the lit one to the window's edge along x and y: windows are 2·reach + 1 wide.
    pub reach: [usize; 2],
}

impl VoxelScene {
    /// What fills each voxel of `grid` by its id, all zeros for a void; what lies beyond the sides; and as `base` a
    /// half-space below the grid, as wide as it, without which what leaves the bottom is transmitted.
    ///
    /// # Errors
    /// [`OpticsError::Parameter`] for an id without coefficients, coefficients out of range, more than 254 of them, a
    /// half-space that absorbs nothing, a grid that is too large.
    pub fn new(
        grid: &VoxelGrid,
        media: &[VolumeCoefficients],
        sides: Sides,
        base: Option<VolumeCoefficients>,
    ) -> Result<Self, OpticsError> {
        let largest = grid.ids().iter().copied().max().unwrap_or(0);
        if usize::from(largest) >= media.len() {
            let expected = format!("0 to {}, as there are coefficients", media.len() as i64 - 1);
            return Err(OpticsError::parameter("material id", largest, expected));
        }
        if media.len() > MAX_MEDIA {
            return Err(OpticsError::parameter("materials", media.len(), format!("at most {MAX_MEDIA}")));
        }
        if let Some(base) = &base {
            base.check()?;
            // A conservative half-space returns every photon, after a walk of infinite mean length.
            if base.sigma_a <= 0.0 {
                let name = "absorption-per-mm of the half-space below";
                return Err(OpticsError::parameter(name, base.sigma_a, "more than 0".into()));
            }
        }
        let dims = grid.dims();
        let too_large = || OpticsError::parameter("voxel grid", format!("{dims:?} voxels"), "fewer".into());
        let voxels = dims.iter().map(|&n| u32::try_from(n)).collect::<Result<Vec<_>, _>>().map_err(|_| too_large())?;
        let lattice =
            Lattice { origin: DVec3::ZERO, pitch: grid.pitch_mm().into(), dims: [voxels[0], voxels[1], voxels[2]] };
        let mut volume = Volume::new(lattice).map_err(|_| too_large())?;
        // Material 0 is one like the others here, and nothing to the volume.
        for first in (0..lattice.dims[2]).step_by(BRICK) {
            volume.add_slices(first..lattice.dims[2].min(first + BRICK as u32), |j, k, row| {
                let from = dims[0] * (j as usize + dims[1] * k as usize);
                row.iter_mut().zip(&grid.ids()[from..]).for_each(|(to, id)| *to = id + 1);
            });
        }
        let void = VolumeCoefficients::new(0.0, 0.0, 0.0)?;
        let all: Vec<_> = std::iter::once(void).chain(media.iter().copied()).chain(base).collect();
        let base = base.map(|_| all.len() as u8 - 1);
        Ok(Self { scene: Scene::new(volume, &[all])?, size_mm: grid.size_mm(), sides, base })
    }

    /// Size of the slab, mm.
    pub fn size_mm(&self) -> [f64; 3] {
        self.size_mm
    }

    /// The radiosity of `texels` under `pattern`, in units of its irradiance (or per mm² of unit flux, for a point of
    /// light). `watch` hears of the photons about every million.
    ///
    /// # Errors
    /// [`OpticsError::Parameter`] for what is out of range, [`OpticsError::Stopped`].
    pub fn image(
        &self,
        pattern: &Pattern,
        texels: TexelGrid,
        photons: Photons,
        watch: &dyn Watch,
    ) -> Result<ExitImage, OpticsError> {
        let walk = self.checked_walk(photons)?;
        texels.check()?;
        let source = Source::new(pattern, photons.light, self.size_mm)?;
        let mut tally = ImageTally::new(texels);
        let trace = |batch: Range<u64>, mut rng: Xoshiro256PlusPlus| {
            let mut counted = Counted::default();
            for photon in batch {
                let share = (photon as f64 + uniform(&mut rng)) / photons.count as f64;
                let (at, direction) = source.draw(share, &mut rng);
                counted.score(&texels, walk.trace(at, direction, &mut rng));
            }
            counted
        };
        in_batches(photons.count, photons.seed, watch, trace, |counted| tally.add(&counted))?;
        Ok(tally.image(photons.count, source.flux))
    }

    /// The responses of row `row` of `windows.texels`, texel by texel, `photons.count` for each. Every texel has a
    /// random stream of its own, so that a row is the same whichever rows are asked for.
    ///
    /// With periodic sides a window goes on beyond them; with mirrored and open ones it finds nothing there.
    ///
    /// # Errors
    /// [`OpticsError::Parameter`] for what is out of range.
    pub fn responses(&self, windows: &Windows, row: usize, photons: Photons) -> Result<Vec<Response>, OpticsError> {
        let walk = self.checked_walk(photons)?;
        let texels = windows.texels;
        texels.check()?;
        if row >= texels.dims[1] {
            return Err(OpticsError::parameter("row", row, format!("0 to {}", texels.dims[1] - 1)));
        }
        let lit = |column: usize| {
            let [min_mm, max_mm] = texels.rectangle(column, row);
            let source = Source::new(&Pattern::Rectangle { min_mm, max_mm }, photons.light, self.size_mm)?;
            let index = (column + texels.dims[0] * row) as u64;
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(photons.seed.wrapping_add(index.wrapping_mul(SEED_STEP)));
            let mut response = tally::Window::new([column as i64, row as i64], windows.reach);
            for _ in 0..photons.count {
                let (at, direction) = source.draw(0.0, &mut rng);
                response.score(&texels, walk.trace(at, direction, &mut rng));
            }
            Ok(response.finish(photons.count))
        };
        parallel::map(texels.dims[0], lit).into_iter().collect()
    }

    fn checked_walk(&self, photons: Photons) -> Result<Walk<'_>, OpticsError> {
        if photons.count < 2 {
            return Err(OpticsError::parameter("photons", photons.count, "at least 2".into()));
        }
        Ok(Walk::new(self))
    }
}

/// Most materials of a slab: a voxel's id is a byte, of which one stands for nothing, and the half-space below has one.
const MAX_MEDIA: usize = 254;

/// Distance of the seeds of neighbouring texels: 2⁶⁴ divided by the golden ratio, which spreads multiples evenly.
const SEED_STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// Whether a walk has left by the top, and with what.
fn top(end: End) -> Option<([f64; 2], [f64; 2], f64)> {
    match end {
        End::Top { at, turns, weight } => Some((at, turns, weight)),
        _ => None,
    }
}
