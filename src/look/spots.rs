//! Printed albedo: radiosity per irradiance at spots of a surface, under even light.
//!
//! Even light is the same radiance from every direction on the whole object in free space. What then leaves a surface
//! point towards a direction is the share of light, followed backwards from there into the object, that gets out
//! again, whatever it met on its way. Directions are drawn with the cosine to the surface, so the mean share *is*
//! radiosity per irradiance.
//!
//! A **shadow's edge** at a spot: the same, where light enters on one side of a plane only. The plane stands on the
//! surface, x mm from the site, so that the site lies x mm inside of what is lit; a walk counts where it leaves the
//! print on the lit side. On a flat slab that is L(x) of [`crate::optics::EdgeResponse`].
//!
//! A spot is a few sites on the mesh, each of which stands for a small disc. A walk starts outside of the steps that
//! voxels have, on a line through a place of such a disc, and enters the first printed voxel there is near that place.
//! A line that meets none, by the edge of a mesh that lies between voxels, shows no print and is drawn again. Whether a
//! site is in the open is asked of its middle: a disc may reach beyond an edge, or into the wall of a narrow gap, by as
//! much as its radius, which is 0.03 mm for the spots of looks.

use glam::DVec3;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

use super::{
    SEED_STEP, Scene,
    scene::Place,
    walker::{Walker, WayOut},
};
use crate::optics::{
    Estimate,
    monte_carlo::photon::{Direction, Moments, azimuth, uniform},
};
use crate::parallel;
use crate::watch::{Stopped, Watch};

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Where, mm.
    pub point: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
}

/// A small part of a surface, by points spread evenly over it.
#[derive(Debug, Clone, PartialEq)]
pub struct Spot {
    /// The points, at least one.
    pub sites: Vec<Site>,
    /// Each point stands for a disc of this radius around it, mm: every walk goes through another place of it. Resins
    /// change from voxel to voxel, so that points alone would show those voxels that they happen to lie in.
    pub site_radius_mm: f64,
}

impl Spot {
    /// These points, each for itself.
    pub fn of(sites: Vec<Site>) -> Self {
        Self { sites, site_radius_mm: 0.0 }
    }

    /// The way into the light across a shadow's edge at this spot: a unit vector in the plane of its first site.
    pub fn into_the_light(&self) -> DVec3 {
        self.sites[0].normal.any_orthonormal_vector()
    }

    /// The place that a walk goes through.
    fn site(&self, walk: u64, rng: &mut Xoshiro256PlusPlus) -> Site {
        let Site { point, normal } = self.sites[walk as usize % self.sites.len()];
        if self.site_radius_mm == 0.0 {
            return Site { point, normal };
        }
        let across = normal.any_orthonormal_vector();
        let (sin, cos) = azimuth(rng);
        let aside = across * cos + normal.cross(across) * sin;
        Site { point: point + aside * (self.site_radius_mm * uniform(rng).sqrt()), normal }
    }
}

/// What a spot shows in one channel, per unit irradiance.
#[derive(Debug, Clone, PartialEq)]
pub struct Radiosity {
    /// Under even light.
    pub albedo: Estimate,
    /// By a shadow's edge, for each distance that was asked for.
    pub edge: Vec<Estimate>,
}

/// Walks of one piece of work: some ms.
const BATCH: u64 = 4096;
/// Half a voxel's diagonal is the most that voxels rise over the surface; along a flat line of sight that is farther,
/// up to so many times.
const FLATTEST: f64 = 4.0;
/// Lines that are tried for one walk.
const TRIES: usize = 16;

impl Scene {
    /// Radiosity per irradiance of every spot under even light, in each channel, by `walks` walks each; `None` where
    /// no printed voxel was found. Same seed, same result, for any number of threads.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn printed_albedo(
        &self,
        spots: &[Spot],
        walks: u64,
        seed: u64,
        watch: &dyn Watch,
    ) -> Result<Vec<Vec<Option<Estimate>>>, Stopped> {
        let found = self.radiosity(spots, &[], walks, seed, watch)?;
        let albedo = |channels: Vec<Option<Radiosity>>| channels.into_iter().map(|found| Some(found?.albedo)).collect();
        Ok(found.into_iter().map(albedo).collect())
    }

    /// [`Self::printed_albedo`], and by the same walks what a shadow's edge shows at these distances from it, mm,
    /// negative in the shadow.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn radiosity(
        &self,
        spots: &[Spot],
        edge_mm: &[f64],
        walks: u64,
        seed: u64,
        watch: &dyn Watch,
    ) -> Result<Vec<Vec<Option<Radiosity>>>, Stopped> {
        let batches = walks.div_ceil(BATCH).max(1);
        let mut found = Vec::with_capacity(spots.len());
        // Groups of spots between two looks at the watch: about a second of work.
        let group = (1 + (1 << 20) / walks.max(1)) as usize;
        for (first, spots) in (0..).step_by(group).zip(spots.chunks(group)) {
            let work = |piece: usize| {
                let piece = piece as u64;
                let (spot, batch) = (piece / batches, piece % batches);
                let range = batch * BATCH..walks.min((batch + 1) * BATCH);
                let stream = (first as u64 + spot).wrapping_mul(SEED_STEP) ^ batch.rotate_right(24);
                if watch.stop_requested() {
                    return Vec::new();
                }
                self.batch(&spots[spot as usize], edge_mm, range, seed.wrapping_add(stream))
            };
            let counted: Vec<Vec<Sums>> = parallel::map(spots.len() * batches as usize, work);
            watch.go_on()?;
            for batches in counted.chunks(batches as usize) {
                let of_media = |media: usize| {
                    let mut sum = Sums::new(edge_mm.len());
                    batches.iter().for_each(|batch| sum.add(&batch[media]));
                    sum.radiosity()
                };
                found.push(self.distinct().iter().map(|&media| of_media(media)).collect());
            }
            watch.advance(spots.len() as u64);
        }
        Ok(found)
    }

    fn batch(&self, spot: &Spot, edge_mm: &[f64], walks: std::ops::Range<u64>, seed: u64) -> Vec<Sums> {
        let across = spot.into_the_light();
        let count = |media| {
            let walker = Walker::new(self, media);
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let mut sums = Sums::new(edge_mm.len());
            for walk in walks.clone() {
                let site = spot.site(walk, &mut rng);
                let Some((place, direction)) = self.look_at(&site, &mut rng) else { continue };
                let out = walker.walk(place, direction, site.normal, &mut rng);
                sums.albedo.score(out.weight);
                sums.walks += 1;
                if out.weight > 0.0 && !edge_mm.is_empty() {
                    let inside = (self.left_at(&out) - site.point).dot(across);
                    for (sum, x) in sums.edge.iter_mut().zip(edge_mm) {
                        sum.score(if inside > -x { out.weight } else { 0.0 });
                    }
                }
            }
            sums
        };
        self.media().iter().map(count).collect()
    }

    /// Where a walk leaves the print, mm.
    fn left_at(&self, out: &WayOut) -> DVec3 {
        self.position(self.first_void(out.from, out.direction.into(), f64::INFINITY).unwrap_or(out.from))
    }

    /// Whether light can leave the surface at a site: there is air over the steps that voxels make.
    pub fn is_open(&self, site: &Site) -> bool {
        let step = self.volume().lattice().pitch.length() / 2.0;
        [1.0, 2.0].iter().all(|height| self.is_void(self.place(site.point + site.normal * (height * step))))
    }

    /// A line of sight onto a site, drawn with the cosine to its surface: where it enters the print.
    fn look_at(&self, site: &Site, rng: &mut Xoshiro256PlusPlus) -> Option<(Place, Direction)> {
        let step = self.volume().lattice().pitch.length() / 2.0;
        let point = self.place(site.point);
        (0..TRIES).find_map(|_| {
            let (outward, cosine) = over(site.normal, rng);
            let away = outward / self.volume().lattice().pitch;
            // In a narrow gap the other wall is nearer than that.
            let mut back = (step / cosine).min(FLATTEST * step);
            while back > 0.1 * step && !self.is_void(point + away * back) {
                back *= 0.5;
            }
            let place = self.first_printed(point + away * back, -outward, back + FLATTEST * step)?;
            Some((place, (-outward).into()))
        })
    }
}

/// What the walks of a spot came to, in one channel.
struct Sums {
    albedo: Moments,
    edge: Vec<Moments>,
    walks: u64,
}

impl Sums {
    fn new(distances: usize) -> Self {
        Self { albedo: Moments::default(), edge: vec![Moments::default(); distances], walks: 0 }
    }

    fn add(&mut self, other: &Self) {
        self.albedo.add(&other.albedo);
        self.edge.iter_mut().zip(&other.edge).for_each(|(sum, other)| sum.add(other));
        self.walks += other.walks;
    }

    fn radiosity(&self) -> Option<Radiosity> {
        let estimate = |sum: &Moments| sum.estimate(self.walks);
        let edge = self.edge.iter().map(estimate).collect();
        (self.walks > 1).then(|| Radiosity { albedo: estimate(&self.albedo), edge })
    }
}

/// A direction over a surface, drawn with the cosine to its normal, and that cosine.
pub(super) fn over(normal: DVec3, rng: &mut Xoshiro256PlusPlus) -> (DVec3, f64) {
    let cosine = (1.0 - uniform(rng)).sqrt(); // in (0, 1]
    (Direction::from(normal).turned(cosine, azimuth(rng)).into(), cosine)
}
