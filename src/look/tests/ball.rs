//! A ball in closed form.

use glam::DVec3;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

use crate::look::spots::over;
use crate::optics::{
    Estimate, VolumeCoefficients,
    fresnel::refraction,
    monte_carlo::photon::{Direction, HenyeyGreenstein, azimuth, uniform},
};

/// What a ball of a refractive index prints, by a walk that knows it in closed form and shares no step with the code
/// under test but Fresnel's equations.
pub(super) fn in_an_exact_ball(radius: f64, medium: &VolumeCoefficients, index: f64, walks: u32) -> Estimate {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(77);
    let phase = HenyeyGreenstein::new(medium.g);
    let (mut sum, mut squared) = (0.0, 0.0);
    for _ in 0..walks {
        let (outward, _) = over(DVec3::Z, &mut rng);
        let entered = refraction(outward.z, 1.0, index).unwrap();
        let flat = -outward.truncate() / index;
        let (mut at, mut to) = (DVec3::Z * radius, flat.extend(-entered.cosine));
        let mut weight = 1.0 - entered.reflectance;
        'walk: loop {
            let mut way = -(1.0 - uniform(&mut rng)).ln() / medium.sigma_t();
            loop {
                let (b, c) = (at.dot(to), at.length_squared() - radius * radius);
                let rim = -b + (b * b - c).max(0.0).sqrt();
                if way < rim {
                    at += to * way;
                    break;
                }
                at += to * rim;
                way -= rim;
                let normal = at.normalize();
                let cosine = to.dot(normal).clamp(1e-9, 1.0);
                match refraction(cosine, index, 1.0) {
                    Some(found) if index == 1.0 || uniform(&mut rng) >= found.reflectance => break 'walk,
                    _ => to = (to - 2.0 * cosine * normal).normalize(),
                }
            }
            weight *= medium.albedo();
            if weight < 1e-6 {
                weight = 0.0;
                break;
            }
            let turned = Direction { x: to.x, y: to.y, z: to.z };
            let turned = turned.turned(phase.sample(uniform(&mut rng)), azimuth(&mut rng));
            to = DVec3::new(turned.x, turned.y, turned.z);
        }
        sum += weight;
        squared += weight * weight;
    }
    let (n, mean) = (f64::from(walks), sum / f64::from(walks));
    Estimate { mean, standard_error: ((squared / n - mean * mean) / n).sqrt() }
}
