//! The surface of a print as its voxels have it, where no mesh is known.
//!
//! Where it is comes from lines that meet it; which way it looks, from what is printed around: the vector from there to
//! the middle of what is air in a ball. On a plane cut into voxels that is within a few degrees of the plane's normal
//! for balls of three voxels or more.

use glam::DVec3;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

use super::{Scene, Site};
use crate::optics::monte_carlo::photon::uniform;

/// Samples of a ball from its middle to its edge. Of a ball of 2 mm in voxels of 42 × 85 × 30 µm normals are 3.0° off
/// in the mean and 9.2° at most; with 3, as far apart as the voxels are long, 7.1° and 21°.
const STEPS: i32 = 5;
/// Radius of the ball that a normal is read from, in diagonals of a voxel, and at least so many mm.
const BALL_VOXELS: f64 = 2.5;
const BALL_MM: f64 = 0.2;
/// Lines that are sent out to find the surface nearest to a position.
const LINES: usize = 2048;
/// Lines for each site at random, at most.
const TRIES: usize = 64;

impl Scene {
    /// Outward unit normal of the print's surface near a position, mm; `None` where nothing or everything is printed
    /// around.
    pub fn normal_near(&self, position: DVec3) -> Option<DVec3> {
        let radius = (BALL_VOXELS * self.volume().lattice().pitch.length()).max(BALL_MM);
        let mut outward = DVec3::ZERO;
        for (z, y, x) in
            (-STEPS..=STEPS).flat_map(|z| (-STEPS..=STEPS).flat_map(move |y| (-STEPS..=STEPS).map(move |x| (z, y, x))))
        {
            let aside = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) / f64::from(STEPS);
            if aside.length_squared() <= 1.0 && self.is_void(self.place(position + aside * radius)) {
                outward += aside;
            }
        }
        outward.try_normalize()
    }

    /// A site of the surface where the line from `position` along `direction` (a unit vector) first meets the print.
    pub fn site_along(&self, position: DVec3, direction: DVec3) -> Option<Site> {
        let point = self.meets(position, direction)?;
        Some(Site { point, normal: self.normal_near(point)? })
    }

    /// Up to `count` sites where lines at random, alike in every direction, meet the print from outside: even over its
    /// area, but for what of it lies in hollows, which fewer lines reach. Same seed, same sites.
    pub fn random_sites(&self, count: usize, seed: u64) -> Vec<Site> {
        let Some([low, high]) = self.bounds() else { return Vec::new() };
        let (middle, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut line = || {
            let toward = direction([uniform(&mut rng), uniform(&mut rng)]);
            let across = toward.any_orthonormal_vector();
            let (turn, out) = (std::f64::consts::TAU * uniform(&mut rng), radius * uniform(&mut rng).sqrt());
            let aside = across * libm::cos(turn) + toward.cross(across) * libm::sin(turn);
            let site = self.site_along(middle + aside * out - toward * (2.0 * radius), toward)?;
            self.is_open(&site).then_some(site)
        };
        (0..count).filter_map(|_| (0..TRIES).find_map(|_| line())).collect()
    }

    /// The nearest of the sites that lines from `position` to all sides find, in air or in the print.
    pub fn site_near(&self, position: DVec3) -> Option<Site> {
        let golden = 0.618_033_988_749_894_9;
        let reach = self.bounds().map(|[low, high]| (high - low).length() + position.distance(0.5 * (low + high)))?;
        let printed = !self.is_void(self.place(position));
        let line = |n: usize| {
            let toward = direction([(n as f64 + 0.5) / LINES as f64, (n as f64 * golden).fract()]);
            let point = if printed {
                self.position(self.first_void(self.place(position), toward, reach)?)
            } else {
                self.meets(position, toward)?
            };
            Some((position.distance(point), point))
        };
        let (_, point) = (0..LINES).filter_map(line).min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Site { point, normal: self.normal_near(point)? })
    }
}

/// A unit vector, evenly over the sphere from two numbers in [0, 1).
fn direction([height, turn]: [f64; 2]) -> DVec3 {
    let z = 1.0 - 2.0 * height;
    let (flat, turn) = ((1.0 - z * z).max(0.0).sqrt(), std::f64::consts::TAU * turn);
    DVec3::new(flat * libm::cos(turn), flat * libm::sin(turn), z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::look::tests::spots::{synthetic, volume};

    const CENTRE: DVec3 = DVec3::splat(2.5);
    const RADIUS: f64 = 2.0;

    fn ball() -> Scene {
        let pitch = DVec3::new(0.042, 0.085, 0.03);
        let dims = [119, 59, 167];
        Scene::new(volume(dims, pitch, |p| u8::from(p.distance(CENTRE) < RADIUS)), &[synthetic().1]).unwrap()
    }

    #[test]
    fn sites_of_a_ball_lie_on_it_and_look_outwards() {
        let scene = ball();
        let sites = scene.random_sites(400, 3);
        assert_eq!(sites.len(), 400);
        let mut mean = DVec3::ZERO;
        for site in &sites {
            let outward = (site.point - CENTRE) / RADIUS;
            assert!((outward.length() - 1.0).abs() < 0.05, "{site:?}");
            assert!(outward.normalize().dot(site.normal) > 0.97, "{site:?}");
            mean += outward / 400.0;
        }
        // Even over the ball: each coordinate has a deviation of 1/√3.
        assert!(mean.abs().max_element() < 4.0 / (3.0_f64 * 400.0).sqrt(), "{mean}");
        assert_eq!(sites, scene.random_sites(400, 3));
    }

    #[test]
    fn the_nearest_site_is_straight_ahead() {
        let scene = ball();
        for (from, radius) in [(DVec3::new(0.3, -0.5, 1.0), 3.4), (DVec3::new(0.8, 0.1, -0.2), 1.6)] {
            let ahead = from.normalize();
            let found = scene.site_near(CENTRE + ahead * radius).unwrap();
            assert!(found.point.distance(CENTRE + ahead * RADIUS) < 0.2, "{found:?}");
        }
    }
}
