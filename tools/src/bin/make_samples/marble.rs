//! Marble as a function of space: domain-warped gradient noise (Perlin 2002, *Improving Noise*) bends leaning
//! planes into veins. Being solid, it runs on across the borders of charts.

use glam::DVec3;

use crate::shape::smooth_step;

/// What marble does to light at one point.
#[derive(Clone, Copy)]
pub struct Stone {
    /// Linear albedo, 0…1.
    pub albedo: f64,
    /// Mean free path as part of the longest.
    pub mean_free_path: f64,
}

/// Linear albedo of clear stone and of the darkest vein.
pub const CLEAR_ALBEDO: f64 = 0.86;
const VEIN_ALBEDO: f64 = 0.33;
/// Linear albedo in red, green and blue where the stone is rosy instead: clear, and in the darkest vein.
const ROSE: [f64; 3] = [0.66, 0.36, 0.30];
const SERPENTINE: [f64; 3] = [0.10, 0.22, 0.15];
/// Shifts the bold veins so that they cross chest and flanks and leave the face clear.
const PHASE: f64 = 0.67;
/// Mean free path in a vein, as part of that in clear stone: minerals that colour veins also scatter more.
const VEIN_PATH: f64 = 0.28;

impl Stone {
    /// Linear albedo of a rosy stone with the same veins, in green.
    pub fn rosy(self) -> [f64; 3] {
        let vein = ((CLEAR_ALBEDO - self.albedo) / (CLEAR_ALBEDO - VEIN_ALBEDO)).clamp(0.0, 1.0);
        std::array::from_fn(|channel| ROSE[channel] + vein * (SERPENTINE[channel] - ROSE[channel]))
    }
}

/// A hash of lattice coordinates, as 64 well-mixed bits (the finaliser of splitmix64).
fn hash(x: i64, y: i64, z: i64, seed: u64) -> u64 {
    let mut h = seed
        ^ (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (y as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
        ^ (z as u64).wrapping_mul(0x1656_67B1_9E37_79F9);
    h = (h ^ (h >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    h ^ (h >> 31)
}

/// Gradient noise of unit lattice, about −1…1.
fn noise(p: DVec3, seed: u64) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let (x, y, z) = (cell.x as i64, cell.y as i64, cell.z as i64);
    let corner = |dx: i64, dy: i64, dz: i64| {
        let h = hash(x + dx, y + dy, z + dz, seed);
        let component = |shift: u32| ((h >> shift & 0xFFFF) as f64 / 32767.5) - 1.0;
        let gradient = DVec3::new(component(0), component(16), component(32));
        gradient.dot(f - DVec3::new(dx as f64, dy as f64, dz as f64))
    };
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let along_x = |dy: i64, dz: i64| mix(corner(0, dy, dz), corner(1, dy, dz), fade.x);
    let along_y = |dz: i64| mix(along_x(0, dz), along_x(1, dz), fade.y);
    1.5 * mix(along_y(0), along_y(1), fade.z)
}

/// Octaves of noise, each half as large and half as strong.
fn cloud(p: DVec3, octaves: u32, seed: u64) -> f64 {
    let mut sum = 0.0;
    let (mut scale, mut strength) = (1.0, 1.0);
    for octave in 0..octaves {
        sum += strength * noise(p * scale, seed + u64::from(octave));
        scale *= 2.03;
        strength *= 0.5;
    }
    sum
}

fn warp(p: DVec3, octaves: u32, seed: u64) -> DVec3 {
    DVec3::new(cloud(p, octaves, seed), cloud(p, octaves, seed + 100), cloud(p, octaves, seed + 200))
}

/// 1 on the zero surface of `value`, falling to 0 at `width`.
fn line(value: f64, width: f64) -> f64 {
    1.0 - smooth_step(value.abs() / width)
}

/// Distance of `value` from the nearest integer.
fn from_integer(value: f64) -> f64 {
    (value - value.round()).abs()
}

/// The stone at `p`, mm on the figure about 100 mm high.
pub fn marble(p: DVec3) -> Stone {
    // Veins follow the leaning layers of a sediment, folded at two scales.
    let folded = p + 10.0 * warp(p / 44.0, 2, 11) + 1.6 * warp(p / 8.0, 3, 47);
    let layers = folded.dot(DVec3::new(0.52, 0.55, 0.65)) / 27.0 + PHASE + 0.35 * cloud(folded / 50.0, 2, 5);
    let cracks = folded.dot(DVec3::new(-0.75, 0.55, -0.36)) / 17.0 + 0.8 * cloud(folded / 30.0, 3, 23);

    // Where the stone was strained most, veins are wide and strong; elsewhere they thin out.
    let strain = smooth_step(0.55 + 0.9 * cloud(p / 26.0, 2, 71));
    let width = (0.03 + 0.10 * strain) * (1.0 + 0.6 * cloud(p / 7.0, 2, 83)).max(0.25);
    let core = line(from_integer(layers), width) * (0.45 + 0.55 * strain);
    let halo = line(from_integer(layers), 0.40) * strain;
    let second = line(from_integer(layers + 0.13 + 0.10 * cloud(p / 16.0, 2, 211)), 0.02) * 0.5;
    let thread = line(from_integer(cracks), 0.035) * smooth_step(0.35 + 1.2 * cloud(p / 20.0, 2, 97)) * 0.6;
    let bloom = smooth_step(0.5 + 0.8 * cloud(folded / 20.0, 4, 131));
    let grain = cloud(p / 1.6, 2, 151);

    let vein = 1.0 - (1.0 - core) * (1.0 - 0.32 * halo) * (1.0 - thread) * (1.0 - second);
    let albedo = CLEAR_ALBEDO - (CLEAR_ALBEDO - VEIN_ALBEDO) * vein - 0.07 * bloom + 0.006 * grain;
    let clarity = (1.0 - vein) * (1.0 - 0.22 * bloom);
    Stone { albedo: albedo.clamp(0.0, 1.0), mean_free_path: VEIN_PATH + (1.0 - VEIN_PATH) * clarity }
}
