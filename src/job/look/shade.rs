//! Even light where an object shades itself.
//!
//! In a hollow less of the sky is seen, and its walls see each other. Whatever a hollow is made of, it is darker there,
//! and brightening it would be wrong: what is asked for is the albedo. So what is held against the print is what a
//! surface of the asked albedo ρ would show, which sees a share V of the sky and surfaces as bright as itself in the
//! rest: ρ V / (1 − (1 − V) ρ).
//!
//! Deep inside a vase that is next to nothing, and what shows there has come through the wall: layers that made it dark
//! would make the wall dark outside. Places that see less than [`LIT_SKY`] of the sky are judged by nothing.

use glam::DVec3;

use crate::job::record::SpotRecord;
use crate::look::{Scene, Site};

/// Share of the sky that a place must see for what it shows to tell of its own layers. Walls of 1.6 mm around a vase:
/// inside less than 0.1 is seen, and what shows has come through; outside more than 0.9. Where 0.1 to 0.3 was seen
/// prints came within ΔE 1.0 in the median.
pub(in crate::job) const LIT_SKY: f64 = 0.3;
/// Rays that look for the sky.
pub(in crate::job) const RAYS: usize = 64;
/// π(3 − √5) over a turn: no two multiples of it point the same way.
const GOLDEN: f64 = 0.381_966_011_250_105_1;

/// Share of the sky that a site sees, weighted with the cosine to its surface; rays are turned by `turn`, 0 to 1.
pub(in crate::job) fn sky(scene: &Scene, site: &Site, turn: f64) -> f64 {
    // Above the steps that voxels make.
    let from = site.point + site.normal * scene.volume().lattice().pitch.length();
    let sees = |direction: &DVec3| scene.meets(from, *direction).is_none();
    directions(site, turn).filter(sees).count() as f64 / RAYS as f64
}

/// [`RAYS`] directions around a site's normal, as dense as the cosine to it is large, turned by `turn`, 0 to 1.
pub(in crate::job) fn directions(site: &Site, turn: f64) -> impl Iterator<Item = DVec3> {
    let normal = site.normal;
    let across = normal.any_orthonormal_vector();
    let along = normal.cross(across);
    (0..RAYS).map(move |ray| {
        let square = (ray as f64 + 0.5) / RAYS as f64;
        let angle = std::f64::consts::TAU * (ray as f64 * GOLDEN + turn).fract();
        let aside = across * libm::cos(angle) + along * libm::sin(angle);
        aside * square.sqrt() + normal * (1.0 - square).sqrt()
    })
}

/// What a surface shows in even light where it sees a share of the sky, by channel like its albedo.
pub(in crate::job) fn all_shown(albedo: &[f64], sky: f64) -> Vec<f64> {
    albedo.iter().map(|albedo| shown(*albedo, sky)).collect()
}

fn shown(albedo: f64, sky: f64) -> f64 {
    albedo * sky / (1.0 - (1.0 - sky) * albedo)
}

impl SpotRecord {
    /// Whether it sees enough of the sky, 0.3 of it, to be held against what is asked for.
    pub fn is_lit(&self) -> bool {
        self.sky >= LIT_SKY
    }

    /// What a surface of `albedo`, by channel, shows there, which the print is held against: less in a hollow.
    pub fn shows(&self, albedo: &[f64]) -> Vec<f64> {
        all_shown(albedo, self.sky)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::{look::Volume, optics::VolumeCoefficients, voxel::Lattice};

    /// A floor with a wall on one side, as high as the scene.
    #[test]
    fn a_wall_takes_half_of_the_sky_beside_it() {
        let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::splat(0.1), dims: [400, 400, 200] };
        let mut volume = Volume::new(lattice).unwrap();
        for start in (0..200).step_by(8) {
            volume.add_slices(start..start + 8, |_, k, row| {
                row.iter_mut().enumerate().for_each(|(i, id)| *id = u8::from(k < 8 || i < 8));
            });
        }
        let clear = VolumeCoefficients::new(0.0, 0.0, 0.0).unwrap();
        let white = VolumeCoefficients::new(8.0, 0.1, 0.5).unwrap();
        let scene = Scene::new(volume, &[vec![clear, white]]).unwrap();
        let site = |x: f64| Site { point: DVec3::new(x, 20.0, 0.8), normal: DVec3::Z };
        let beside = sky(&scene, &site(0.9), 0.3);
        assert!((beside - 0.5).abs() < 0.05, "{beside}");
        // From 10 mm away 19 mm of wall take (1 − sin 45°…) a part only: half of (1 − cos of its height's angle).
        let away = sky(&scene, &site(10.8), 0.3);
        let expected = 1.0 - 0.5 * (1.0 - (10.0_f64 / 19.0).atan().sin());
        assert!((away - expected).abs() < 0.06, "{away} instead of {expected}");
        let top = Site { point: DVec3::new(0.4, 20.0, 20.0), normal: DVec3::Z };
        assert_eq!(sky(&scene, &top, 0.7), 1.0);
    }

    #[test]
    fn a_white_hollow_is_as_bright_as_the_sky() {
        assert_eq!(shown(0.3, 1.0), 0.3);
        assert!((shown(1.0, 0.2) - 1.0).abs() < 1e-15);
        assert!((shown(0.5, 0.5) - 1.0 / 3.0).abs() < 1e-15);
    }
}
