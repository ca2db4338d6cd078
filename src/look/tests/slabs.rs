//! Laws of the walk through voxels: it equals the layered one where that can be asked, and stepping from face to face
//! where not.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use crate::look::{ExitImage, Pattern, Photons, Response, Sides, TexelGrid, VoxelGrid, VoxelScene, Windows};
use crate::optics::{Estimate, Light, MonteCarlo, MonteCarloResult, RingEdges, Stack, VolumeCoefficients};
use crate::watch::Unwatched;

const VOID: VolumeCoefficients = VolumeCoefficients { sigma_s: 0.0, sigma_a: 0.0, g: 0.0, refractive_index: 1.0 };
const WHITE: VolumeCoefficients = VolumeCoefficients { sigma_s: 8.0, sigma_a: 0.17, g: 0.5, refractive_index: 1.0 };
const BLACK: VolumeCoefficients = VolumeCoefficients { sigma_s: 2.5, sigma_a: 4.0, g: 0.5, refractive_index: 1.0 };
const SUPPORT: VolumeCoefficients = VolumeCoefficients { sigma_s: 1.6, sigma_a: 0.025, g: 0.75, refractive_index: 1.0 };
const MEDIA: [VolumeCoefficients; 4] = [VOID, WHITE, BLACK, SUPPORT];

const DIFFUSE: Photons = Photons { light: Light::Diffuse, count: 200_000, seed: 3 };

fn grid(dims: [usize; 3], pitch_mm: [f64; 3], id: impl Fn(usize, usize, usize) -> u8) -> VoxelGrid {
    let [nx, ny, nz] = dims;
    let ids = (0..nx * ny * nz).map(|at| id(at % nx, at / nx % ny, at / (nx * ny)));
    VoxelGrid::new(dims, pitch_mm, ids.collect()).unwrap()
}

/// The whole top as one texel, or as many.
fn texels(grid: &VoxelGrid, dims: [usize; 2]) -> TexelGrid {
    of_size(grid.size_mm(), dims)
}

fn of_size([x, y, _]: [f64; 3], dims: [usize; 2]) -> TexelGrid {
    TexelGrid { origin_mm: [0.0; 2], pitch_mm: [x / dims[0] as f64, y / dims[1] as f64], dims }
}

fn everywhere(grid: &VoxelGrid) -> Pattern {
    let [x, y, _] = grid.size_mm();
    Pattern::Rectangle { min_mm: [0.0; 2], max_mm: [x, y] }
}

fn image(scene: &VoxelScene, pattern: &Pattern, dims: [usize; 2], photons: Photons) -> ExitImage {
    scene.image(pattern, of_size(scene.size_mm(), dims), photons, &Unwatched).unwrap()
}

fn layered(
    layers: &[(VolumeCoefficients, f64)],
    base: Option<VolumeCoefficients>,
    photons: Photons,
) -> MonteCarloResult {
    let stack = Stack::new(layers.iter().copied()).over(base);
    let (light, rings) = (photons.light, RingEdges::growing());
    MonteCarlo { stack, light, photons: photons.count, seed: photons.seed + 1, rings }.run().unwrap()
}

#[track_caller]
fn agree(what: &str, a: Estimate, b: Estimate) {
    let sigma = a.standard_error.hypot(b.standard_error);
    assert!((a.mean - b.mean).abs() <= 3.0 * sigma, "{what}: {} and {}, sigma {sigma}", a.mean, b.mean);
}

#[test]
fn layers_of_voxels_are_layers() {
    // Odd pitches, and sides that every photon passes many times.
    let volume = grid([3, 5, 20], [0.07, 0.11, 0.05], |_, _, k| if k < 4 { 1 } else { 3 });
    let layers = [(WHITE, 0.2), (SUPPORT, 0.8)];
    for light in [Light::Diffuse, Light::Normal] {
        for (sides, base) in [
            (Sides::Periodic, None),
            (Sides::Mirrored, None),
            (Sides::Periodic, Some(BLACK)),
            (Sides::Mirrored, Some(WHITE)),
        ] {
            let scene = VoxelScene::new(&volume, &MEDIA, sides, base).unwrap();
            let photons = Photons { light, ..DIFFUSE };
            let found = image(&scene, &everywhere(&volume), [1, 1], photons);
            let expected = layered(&layers, base, photons);
            agree("reflection", found.reflection, expected.reflection);
            agree("transmission", found.transmission, expected.transmission);
            assert!((found.radiosity[0] - found.reflection.mean).abs() < 1e-6, "all leave by the one texel");
        }
    }
}

#[test]
fn a_point_of_light_spreads_as_between_layers() {
    // Wide enough that little comes back from the periodic neighbours, and what does is in both counts.
    let volume = grid([100, 50, 20], [0.1, 0.2, 0.05], |_, _, k| if k < 4 { 3 } else { 1 });
    let scene = VoxelScene::new(&volume, &MEDIA, Sides::Periodic, None).unwrap();
    let middle = [5.0 - 1e-3, 5.0 - 1e-3];
    let point = Pattern::Rectangle { min_mm: middle, max_mm: middle };
    let found = image(&scene, &point, [400, 400], DIFFUSE);
    let expected = layered(&[(SUPPORT, 0.2), (WHITE, 0.8)], None, DIFFUSE);
    // Encircled energy: within circles of exit texels, against rings.
    let profile = expected.reflection_profile;
    for radius in [0.1_f64, 0.3, 0.6, 1.2, 2.4] {
        let area = found.texels.texel_mm2();
        let texel = |at: usize| {
            ((at % 400) as f64 * 0.025 + 0.0125 - middle[0], (at / 400) as f64 * 0.025 + 0.0125 - middle[1])
        };
        let within: f64 = (0..400 * 400)
            .filter(|&at| texel(at).0.hypot(texel(at).1) < radius)
            .map(|at| found.radiosity[at] * area)
            .sum();
        let rings = profile.ring_edges().unwrap();
        let expected: f64 = profile
            .value_per_mm2()
            .iter()
            .zip(rings.windows(2))
            .map(|(value, edge)| {
                let (inner, outer) = (edge[0].min(radius), edge[1].min(radius));
                value * std::f64::consts::PI * (outer * outer - inner * inner)
            })
            .sum();
        // Photons are counted or not: σ ≤ √(E(1 − E)/N), for both.
        let sigma = (2.0 * expected * (1.0 - expected) / DIFFUSE.count as f64).sqrt();
        // The staircase of texels on a circle: half a texel of its rim, by the mean of the profile there.
        let rim = 0.1 * 0.025 / radius * expected;
        assert!((within - expected).abs() < 3.0 * sigma + rim, "{radius} mm: {within} and {expected}, sigma {sigma}");
    }
}

#[test]
fn a_fine_checkerboard_is_its_mixture() {
    let mixed = |a: f64, b: f64| 0.5 * (a + b);
    let mixture = VolumeCoefficients {
        sigma_s: mixed(WHITE.sigma_s, BLACK.sigma_s),
        sigma_a: mixed(WHITE.sigma_a, BLACK.sigma_a),
        g: 0.5, // of both
        refractive_index: 1.0,
    };
    let expected = layered(&[(mixture, 0.4)], None, DIFFUSE);
    let board = |cell_mm: f64| {
        let layers = (0.4 / cell_mm).round() as usize;
        let volume = grid([2, 2, layers], [cell_mm; 3], |i, j, k| 1 + ((i + j + k) % 2) as u8);
        let scene = VoxelScene::new(&volume, &MEDIA, Sides::Periodic, None).unwrap();
        image(&scene, &everywhere(&volume), [1, 1], DIFFUSE)
    };
    let fine = board(0.002);
    agree("reflection", fine.reflection, expected.reflection);
    agree("transmission", fine.transmission, expected.transmission);
    // Cells of more than a mean free path let light past the black.
    let (coarse, fine) = (board(0.2).reflection, expected.reflection);
    assert!(coarse.mean > fine.mean + 10.0 * coarse.standard_error, "{} and {}", coarse.mean, fine.mean);
}

#[test]
fn without_absorption_nothing_is_lost() {
    let clear = MEDIA.map(|volume| VolumeCoefficients { sigma_a: 0.0, ..volume });
    let volume = grid([4, 4, 8], [0.1, 0.1, 0.05], |i, j, k| ((i * 7 + j * 3 + k * 5) % 4) as u8);
    for sides in [Sides::Periodic, Sides::Mirrored, Sides::Open] {
        let scene = VoxelScene::new(&volume, &clear, sides, None).unwrap();
        let found = image(&scene, &everywhere(&volume), [4, 4], Photons { count: 20_000, ..DIFFUSE });
        let sum = found.reflection.mean + found.transmission.mean + found.lost.mean;
        assert!((sum - 1.0).abs() < 1e-9, "{sides:?}: {sum}");
        assert_eq!(found.lost.mean > 0.0, sides == Sides::Open);
        let seen = found.radiosity.iter().sum::<f64>() / 16.0;
        assert!((seen - found.reflection.mean).abs() < 1e-6);
    }
}

#[test]
fn a_void_lets_everything_through() {
    let volume = grid([2, 2, 2], [0.1; 3], |_, _, _| 0);
    let scene = VoxelScene::new(&volume, &[VOID], Sides::Periodic, None).unwrap();
    let found = image(&scene, &everywhere(&volume), [1, 1], Photons { count: 1000, ..DIFFUSE });
    assert_eq!((found.reflection.mean, found.transmission.mean), (0.0, 1.0));
}

#[test]
fn mirrors_show_what_a_mirrored_neighbour_would() {
    let id = |i: usize| if i < 3 { 1 } else { 2 };
    let half = grid([5, 1, 20], [0.1, 0.1, 0.05], |i, _, _| id(i));
    let both = grid([10, 1, 20], [0.1, 0.1, 0.05], |i, _, _| id(i.min(9 - i)));
    let scene = |grid, sides| VoxelScene::new(grid, &MEDIA, sides, Some(BLACK)).unwrap();
    let a = image(&scene(&half, Sides::Mirrored), &everywhere(&half), [5, 1], DIFFUSE);
    let b = image(&scene(&both, Sides::Periodic), &everywhere(&both), [10, 1], DIFFUSE);
    for i in 0..5 {
        let sigma = a.standard_error[i].hypot(b.standard_error[i]);
        let difference = a.radiosity[i] - b.radiosity[i];
        assert!(difference.abs() < 3.0 * sigma, "texel {i}: {} and {}, sigma {sigma}", a.radiosity[i], b.radiosity[i]);
    }
}

/// Stripes of white and black, 0.2 mm wide, and the responses of their texels of 0.1 mm.
fn striped_responses(sides: Sides, photons: Photons) -> Vec<Response> {
    let volume = grid([40, 20, 20], [0.05, 0.1, 0.05], |i, _, _| if i / 4 % 2 == 0 { 1 } else { 2 });
    let scene = VoxelScene::new(&volume, &MEDIA, sides, Some(BLACK)).unwrap();
    let windows = Windows { texels: texels(&volume, [20, 20]), reach: [4, 3] };
    scene.responses(&windows, 10, photons).unwrap()
}

#[test]
fn responses_are_reciprocal_and_bounded_by_the_albedo() {
    let responses = striped_responses(Sides::Periodic, Photons { count: 60_000, ..DIFFUSE });
    let (width, row) = (9, 3); // the window's middle row
    for lit in 4..16_usize {
        for step in 1..=4.min(19 - lit) {
            let (there, back) = (&responses[lit], &responses[lit + step]);
            let (to, from) = (4 + step + width * row, 4 - step + width * row);
            let sigma = f64::from(there.standard_error[to]).hypot(f64::from(back.standard_error[from]));
            let difference = f64::from(there.share[to] - back.share[from]);
            assert!(difference.abs() < 4.0 * sigma, "{lit} to {}: {difference}, sigma {sigma}", lit + step);
        }
        let seen: f64 = responses[lit].share.iter().map(|&share| f64::from(share)).sum();
        assert!(seen > 0.5 * responses[lit].reflection.mean && seen <= responses[lit].reflection.mean + 1e-6);
    }
    // White reflects more than black.
    assert!(responses[4].reflection.mean > 2.0 * responses[6].reflection.mean);
}

#[test]
fn windows_go_on_beyond_periodic_sides_only() {
    let photons = Photons { count: 5_000, ..DIFFUSE };
    let beyond = |responses: &[Response]| responses[0].share[3 + 9 * 3]; // one texel left of the first
    assert!(beyond(&striped_responses(Sides::Periodic, photons)) > 0.0);
    assert_eq!(beyond(&striped_responses(Sides::Mirrored, photons)), 0.0);
    assert_eq!(beyond(&striped_responses(Sides::Open, photons)), 0.0);
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let volume = grid([8, 8, 8], [0.1, 0.1, 0.05], |i, j, k| ((i ^ j ^ k) % 4) as u8);
    let scene = VoxelScene::new(&volume, &MEDIA, Sides::Periodic, Some(BLACK)).unwrap();
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let photons = Photons { count: 50_000, ..DIFFUSE };
    let on = |threads| pool(threads).install(|| image(&scene, &everywhere(&volume), [8, 8], photons));
    assert_eq!(on(1), on(3));
    let windows = Windows { texels: texels(&volume, [8, 8]), reach: [2, 2] };
    let few = Photons { count: 500, ..DIFFUSE };
    let rows = |threads| pool(threads).install(|| scene.responses(&windows, 5, few).unwrap());
    assert_eq!(rows(1), rows(3));
}

#[test]
fn light_from_an_image_falls_where_the_image_is_bright() {
    let volume = grid([10, 10, 4], [0.1, 0.1, 0.05], |_, _, _| 1);
    let scene = VoxelScene::new(&volume, &MEDIA, Sides::Periodic, None).unwrap();
    let edge: Vec<f32> = (0..100).map(|at| if at % 10 < 5 { 1.0 } else { 0.0 }).collect();
    let lit = Pattern::Image { texels: texels(&volume, [10, 10]), irradiance: edge };
    let half = Pattern::Rectangle { min_mm: [0.0; 2], max_mm: [0.5, 1.0] };
    let (a, b) = (image(&scene, &lit, [10, 1], DIFFUSE), image(&scene, &half, [10, 1], DIFFUSE));
    for i in 0..10 {
        let sigma = a.standard_error[i].hypot(b.standard_error[i]);
        assert!((a.radiosity[i] - b.radiosity[i]).abs() < 3.0 * sigma, "column {i}");
    }
    assert!(a.radiosity[2] > 3.0 * a.radiosity[7]);
}

#[test]
fn what_cannot_be_traced_is_refused() {
    let volume = grid([2, 2, 2], [0.1; 3], |_, _, _| 3);
    assert!(VoxelGrid::new([2, 2, 2], [0.1, f64::NAN, 0.1], vec![0; 8]).is_err());
    assert!(VoxelGrid::new([2, 2, 2], [0.1; 3], vec![0; 7]).is_err());
    assert!(VoxelGrid::new([0, 2, 2], [0.1; 3], vec![]).is_err());
    let found = VoxelScene::new(&volume, &MEDIA[..3], Sides::Open, None).unwrap_err().to_string();
    assert_eq!(found, "material id: found 3, expected 0 to 2, as there are coefficients");
    let run = |scene: &VoxelScene, pattern: &Pattern| {
        let photons = Photons { count: 10, ..DIFFUSE };
        scene.image(pattern, texels(&volume, [2, 2]), photons, &Unwatched).unwrap_err().to_string()
    };
    let scene = VoxelScene::new(&volume, &MEDIA, Sides::Open, None).unwrap();
    let clear = VolumeCoefficients { sigma_a: 0.0, ..WHITE };
    assert!(VoxelScene::new(&volume, &MEDIA, Sides::Open, Some(clear)).is_err());
    let outside = Pattern::Rectangle { min_mm: [0.0; 2], max_mm: [0.3, 0.1] };
    assert!(run(&scene, &outside).starts_with("lit area: found"));
    let dark = Pattern::Image { texels: texels(&volume, [2, 2]), irradiance: vec![0.0; 4] };
    assert_eq!(run(&scene, &dark), "irradiance: found 0 everywhere, expected some light");
}

/// The same volume by exact steps from voxel face to voxel face, periodic sides, uniform diffuse light, nothing below:
/// totals of reflection and transmission, of walks that die by chance rather than by weight. Shares no step with the
/// code under test.
fn face_to_face(grid: &VoxelGrid, media: &[VolumeCoefficients], photons: u64, seed: u64) -> [Estimate; 2] {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut random = || (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let (dims, pitch, size) = (grid.dims(), grid.pitch_mm(), grid.size_mm());
    let mut ends = [0_u64; 2];
    'photons: for _ in 0..photons {
        let mut at = [size[0] * random(), size[1] * random(), 0.0];
        let mut cell = [0, 1, 2].map(|axis| ((at[axis] / pitch[axis]) as i64).min(dims[axis] as i64 - 1));
        let cosine = random().sqrt();
        let azimuth = std::f64::consts::TAU * random();
        let sine = (1.0 - cosine * cosine).sqrt();
        let mut direction = [sine * azimuth.cos(), sine * azimuth.sin(), cosine];
        let mut depth = -(1.0 - random()).ln();
        loop {
            let [i, j, k] = cell.map(|n| n as usize);
            let medium = &media[usize::from(grid.ids()[i + dims[0] * (j + dims[1] * k)])];
            let face = |axis: usize| {
                let plane = (cell[axis] + i64::from(direction[axis] > 0.0)) as f64 * pitch[axis];
                if direction[axis] == 0.0 { f64::INFINITY } else { ((plane - at[axis]) / direction[axis]).max(0.0) }
            };
            let steps = [0, 1, 2].map(face);
            let axis = (0..3).min_by(|&a, &b| steps[a].total_cmp(&steps[b])).unwrap();
            if depth > steps[axis] * medium.sigma_t() {
                depth -= steps[axis] * medium.sigma_t();
                (0..3).for_each(|other| at[other] += steps[axis] * direction[other]);
                let forwards = direction[axis] > 0.0;
                cell[axis] += if forwards { 1 } else { -1 };
                at[axis] = (cell[axis] + i64::from(!forwards)) as f64 * pitch[axis];
                if !(0..dims[axis] as i64).contains(&cell[axis]) {
                    if axis == 2 {
                        ends[usize::from(forwards)] += 1;
                        continue 'photons;
                    }
                    cell[axis] = cell[axis].rem_euclid(dims[axis] as i64);
                    at[axis] = (cell[axis] + i64::from(!forwards)) as f64 * pitch[axis];
                }
                continue;
            }
            let step = depth / medium.sigma_t();
            (0..3).for_each(|axis| at[axis] += step * direction[axis]);
            if random() >= medium.albedo() {
                continue 'photons;
            }
            // Henyey–Greenstein about the old direction, by an explicit basis.
            let g = medium.g;
            let s = (1.0 - g * g) / (1.0 - g + 2.0 * g * random());
            let cosine = if g == 0.0 { 2.0 * random() - 1.0 } else { (1.0 + g * g - s * s) / (2.0 * g) };
            let (sine, azimuth) = ((1.0 - cosine * cosine).max(0.0).sqrt(), std::f64::consts::TAU * random());
            let w = glam::DVec3::from(direction);
            let u = w.cross(if w.x.abs() < 0.5 { glam::DVec3::X } else { glam::DVec3::Y }).normalize();
            let turned = cosine * w + sine * (azimuth.cos() * u + azimuth.sin() * w.cross(u));
            direction = turned.normalize().into();
            depth = -(1.0 - random()).ln();
        }
    }
    ends.map(|count| {
        let mean = count as f64 / photons as f64;
        Estimate { mean, standard_error: (mean * (1.0 - mean) / photons as f64).sqrt() }
    })
}

/// Blobs of resin as a print has: layers of varying thickness over 2 mm.
fn blobs() -> VoxelGrid {
    grid([48, 24, 74], [0.0423, 0.0847, 0.027], |i, j, k| {
        let wave = |x: f64| 0.5 + 0.5 * (x * std::f64::consts::TAU).sin();
        let (x, y, z) = (i as f64 / 48.0, j as f64 / 24.0, k as f64 * 0.027);
        let white = 0.1 + 0.4 * wave(x);
        if z < white {
            1
        } else if z < white + 0.8 * wave(y) {
            3
        } else {
            2
        }
    })
}

#[test]
fn uneven_layers_equal_stepping_from_face_to_face() {
    let volume = blobs();
    let scene = VoxelScene::new(&volume, &MEDIA, Sides::Periodic, None).unwrap();
    let found = image(&scene, &everywhere(&volume), [1, 1], DIFFUSE);
    let [reflection, transmission] = face_to_face(&volume, &MEDIA, DIFFUSE.count, 11);
    agree("reflection", found.reflection, reflection);
    agree("transmission", found.transmission, transmission);
}
