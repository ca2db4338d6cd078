//! Printed albedo: radiosity per irradiance at spots of a surface, under even light.
//!
//! Even light is the same radiance from every direction on the whole object in free space. What then leaves a surface
//! point towards a direction is the share of light, followed backwards from there into the object, that gets out
//! again, whatever it met on its way. Directions are drawn with the cosine to the surface, so the mean share *is*
//! radiosity per irradiance.
//!
//! A spot is a few sites on the mesh. A walk starts outside of the steps that voxels have, on the line through its site,
//! and enters the first printed voxel there is near the site. A line that meets none, by the edge of a mesh that lies
//! between voxels, shows no print and is drawn again.

use glam::DVec3;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use rayon::prelude::*;

use super::{
    SEED_STEP, Scene,
    scene::{Place, Walker},
};
use crate::optics::{
    Estimate,
    monte_carlo::photon::{Direction, Moments, azimuth, uniform},
};
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
        let batches = walks.div_ceil(BATCH).max(1);
        let mut found = Vec::with_capacity(spots.len());
        // Groups of spots between two looks at the watch: about a second of work.
        let group = (1 + (1 << 20) / walks.max(1)) as usize;
        for (first, spots) in (0..).step_by(group).zip(spots.chunks(group)) {
            let work = (0..spots.len() as u64 * batches).into_par_iter().map(|piece| {
                let (spot, batch) = (piece / batches, piece % batches);
                let range = batch * BATCH..walks.min((batch + 1) * BATCH);
                let stream = (first as u64 + spot).wrapping_mul(SEED_STEP) ^ batch.rotate_right(24);
                if watch.stop_requested() {
                    return Vec::new();
                }
                self.batch(&spots[spot as usize], range, seed.wrapping_add(stream))
            });
            let counted: Vec<Vec<(Moments, u64)>> = work.collect();
            watch.go_on()?;
            for batches in counted.chunks(batches as usize) {
                let of_media = |media: usize| {
                    let mut sum = (Moments::default(), 0);
                    for batch in batches {
                        sum.0.add(&batch[media].0);
                        sum.1 += batch[media].1;
                    }
                    (sum.1 > 1).then(|| sum.0.estimate(sum.1))
                };
                found.push(self.distinct().iter().map(|&media| of_media(media)).collect());
            }
            watch.advance(spots.len() as u64);
        }
        Ok(found)
    }

    fn batch(&self, spot: &Spot, walks: std::ops::Range<u64>, seed: u64) -> Vec<(Moments, u64)> {
        let count = |media| {
            let walker = Walker::new(self, media);
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let (mut sum, mut seen) = (Moments::default(), 0);
            for walk in walks.clone() {
                let site = &spot.sites[walk as usize % spot.sites.len()];
                if let Some((place, direction)) = self.look_at(site, &mut rng) {
                    sum.score(walker.walk(place, direction, site.normal, &mut rng));
                    seen += 1;
                }
            }
            (sum, seen)
        };
        self.media().iter().map(count).collect()
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
            Some((place, Direction { x: -outward.x, y: -outward.y, z: -outward.z }))
        })
    }
}

/// A direction over a surface, drawn with the cosine to its normal, and that cosine.
pub(super) fn over(normal: DVec3, rng: &mut Xoshiro256PlusPlus) -> (DVec3, f64) {
    let cosine = (1.0 - uniform(rng)).sqrt(); // in (0, 1]
    let axis = Direction { x: normal.x, y: normal.y, z: normal.z };
    let drawn = axis.turned(cosine, azimuth(rng));
    (DVec3::new(drawn.x, drawn.y, drawn.z), cosine)
}
