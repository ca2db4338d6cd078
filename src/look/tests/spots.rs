//! Laws of printed albedo: nothing is lost without absorption, wide slabs print as the transport model has it, balls as
//! a walk in an exact ball has it.

use glam::DVec3;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

use super::ball::in_an_exact_ball;
use crate::look::{Scene, Site, Spot, Volume};
use crate::optics::{
    EdgeResponse, Estimate, Light, MaterialSet, Model, Stack, TransportOptions, VolumeCoefficients,
    monte_carlo::photon::{azimuth, uniform},
    predict,
};
use crate::voxel::{BRICK, Lattice};
use crate::watch::Unwatched;

/// A volume of the ids that `id` gives for the centres of voxels, mm.
pub(in crate::look) fn volume(dims: [u32; 3], pitch: DVec3, id: impl Fn(DVec3) -> u8) -> Volume {
    let lattice = Lattice { origin: DVec3::ZERO, pitch, dims };
    let mut volume = Volume::new(lattice).unwrap();
    for start in (0..dims[2]).step_by(BRICK) {
        volume.add_slices(start..dims[2].min(start + BRICK as u32), |j, k, row| {
            (0..).zip(row).for_each(|(i, voxel)| *voxel = id(lattice.centre([i, j, k])));
        });
    }
    volume
}

/// Coefficients of the synthetic resins by id.
pub(in crate::look) fn synthetic() -> (MaterialSet, Vec<VolumeCoefficients>) {
    let set = MaterialSet::builtin("synthetic").unwrap();
    let void = VolumeCoefficients::new(0.0, 0.0, 0.0).unwrap();
    let media = std::iter::once(void).chain(set.resins.iter().map(|resin| resin.volumes().unwrap()[0])).collect();
    (set, media)
}

pub(super) fn printed(scene: &Scene, spot: Spot, walks: u64) -> Estimate {
    scene.printed_albedo(&[spot], walks, 1, &Unwatched).unwrap()[0][0].unwrap()
}

/// The middle of the top of a slab, a millimetre around it.
pub(super) fn top(size: DVec3) -> Spot {
    let site = |n: u32| {
        let (turn, out) = (f64::from(n) * 2.4, (f64::from(n) / 64.0).sqrt());
        let aside = DVec3::new(turn.cos(), turn.sin(), 0.0) * out;
        Site { point: DVec3::new(size.x / 2.0, size.y / 2.0, size.z) + aside, normal: DVec3::Z }
    };
    Spot::of((0..64).map(site).collect())
}

/// By a shadow's edge on a wide slab, photons through voxels and the transport model's profile show the same.
#[test]
fn edges_on_wide_slabs_are_those_of_the_transport_model() {
    let (set, media) = synthetic();
    let model = Model::Transport { light: Light::Diffuse, options: TransportOptions::default() };
    let named: Stack<String> = "white:0.5,support:1.5".parse().unwrap();
    let stack = set.stack(&named).unwrap().over(set.resin("black").map(|(id, _)| id));
    let reflection = predict(&set, &stack, &model, &Unwatched).unwrap().light[0].reflection_hankel.clone();
    let expected = EdgeResponse::new(&reflection, &set.grid);
    let id = |name: &str| set.resin(name).unwrap().0.0 as u8 + 1;
    let [white, support, black] = ["white", "support", "black"].map(id);
    let pitch = DVec3::splat(0.1);
    let volume = volume([240, 240, 40], pitch, |p| match 4.0 - p.z {
        depth if depth < 0.5 => white,
        depth if depth < 2.0 => support,
        _ => black,
    });
    let scene = Scene::new(volume, &[media]).unwrap();
    let edge_mm = [-3.0, -1.0, -0.3, 0.0, 0.2, 0.7, 2.0];
    let spot = top(DVec3::new(24.0, 24.0, 4.0));
    let found = scene.radiosity(&[spot], &edge_mm, 200_000, 5, &Unwatched).unwrap()[0][0].clone().unwrap();
    for (x, found) in edge_mm.iter().zip(&found.edge) {
        let expected = expected.at(*x);
        // The integral of the edge ends at 1e-3 of the albedo, the model's slab is endless.
        let limit = 4.0 * found.standard_error + 2e-3 * reflection[0];
        assert!((found.mean - expected).abs() < limit, "{x} mm: {found:?}, not {expected}");
    }
}

#[test]
fn wide_slabs_print_as_the_transport_model_has_it() {
    let (set, media) = synthetic();
    // At 24 mm light that enters at the sides makes 3 mm of support 0.45% brighter; at 32 mm nothing is left of that.
    let [pitch, width, core_mm] = [DVec3::new(0.0423, 0.0847, 0.05), DVec3::splat(32.0), DVec3::splat(2.0)];
    let stacks = [
        "white:2",
        "white:0.5,support:1",
        "support:0.5,white:0.5",
        "black:0.1,white:1",
        "support:3",
        "white:0.3,support:3",
    ];
    let model = Model::Transport { light: Light::Diffuse, options: TransportOptions::default() };
    for text in stacks {
        let named: Stack<String> = text.parse().unwrap();
        let stack = set.stack(&named).unwrap().over(set.resin("black").map(|(id, _)| id));
        let promised = predict(&set, &stack, &model, &Unwatched).unwrap().light[0].reflection_hankel[0];
        let thickness: f64 = stack.pairs().map(|(_, mm)| mm).sum();
        let dims = [width.x / pitch.x, width.y / pitch.y, (thickness + core_mm.z) / pitch.z].map(|n| n.round() as u32);
        let size = DVec3::from(dims.map(f64::from)) * pitch;
        let bottoms: Vec<(u8, f64)> = stack
            .pairs()
            .scan(0.0, |bottom, (resin, mm)| {
                *bottom += mm;
                Some((resin.0 as u8 + 1, *bottom))
            })
            .collect();
        let core = stack.core.unwrap().0 as u8 + 1;
        let scene = Scene::new(
            volume(dims, pitch, |p| {
                bottoms.iter().find(|(_, bottom)| size.z - p.z < *bottom).map_or(core, |(id, _)| *id)
            }),
            std::slice::from_ref(&media),
        )
        .unwrap();
        let found = printed(&scene, top(size), 300_000);
        let apart = found.mean - promised;
        println!("{text}: printed {:.5} ± {:.5}, promised {promised:.5}", found.mean, found.standard_error);
        assert!(apart.abs() < 3.0 * found.standard_error + 5e-4, "{text}: {found:?} instead of {promised}");
        assert!(apart.abs() < 0.005 * promised, "{text}: {found:?} instead of {promised}");
    }
}

#[test]
fn nothing_is_lost_where_nothing_absorbs() {
    // Loose blobs of two resins with air between them: light goes in and out many times.
    let id = |p: DVec3| {
        let wave = (p.x * 4.0).sin() * (p.y * 5.0).cos() + (p.z * 3.0).sin();
        if wave > 0.6 { 2 } else { u8::from(wave > 0.1) }
    };
    let white = |sigma_s: f64, g: f64| VolumeCoefficients::new(sigma_s, 0.0, g).unwrap();
    let media = vec![white(0.0, 0.0), white(8.0, 0.5), white(1.0, 0.8)];
    let scene = Scene::new(volume([90, 70, 60], DVec3::new(0.05, 0.06, 0.07), id), &[media]).unwrap();
    let point = DVec3::new(2.25, 2.1, 0.5);
    let rise = (0..400).find(|n| id(point + DVec3::Z * f64::from(*n) * 0.01) != 0).unwrap();
    let spot = Spot::of(vec![Site { point: point + DVec3::Z * f64::from(rise) * 0.01, normal: -DVec3::Z }]);
    let found = printed(&scene, spot, 20_000);
    assert!((found.mean - 1.0).abs() < 1e-12 && found.standard_error < 1e-9, "{found:?}");
}

/// Sites evenly over a ball.
pub(super) fn sites(centre: DVec3, radius: f64, count: usize) -> Vec<Site> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let site = |_| {
        let z = 2.0 * uniform(&mut rng) - 1.0;
        let ((x, y), s) = (azimuth(&mut rng), (1.0 - z * z).sqrt());
        let normal = DVec3::new(s * x, s * y, z);
        Site { point: centre + normal * radius, normal }
    };
    (0..count).map(site).collect()
}

#[test]
fn balls_print_as_a_walk_in_an_exact_ball_has_it() {
    let (_, media) = synthetic();
    for (id, radius) in [(1_u8, 0.6), (3, 2.5)] {
        let (pitch, dims) = (DVec3::splat(radius / 100.0), [212; 3]);
        let centre = pitch * 106.0;
        let ball = |p: DVec3| if p.distance(centre) < radius { id } else { 0 };
        let scene = Scene::new(volume(dims, pitch, ball), std::slice::from_ref(&media)).unwrap();
        let found = printed(&scene, Spot::of(sites(centre, radius, 512)), 400_000);
        let expected = in_an_exact_ball(radius, &media[usize::from(id)], 1.0, 400_000);
        let sigma = found.standard_error.hypot(expected.standard_error);
        println!("ball of {id}: {found:?} and {expected:?}");
        assert!((found.mean - expected.mean).abs() < 3.0 * sigma + 0.002 * expected.mean, "{found:?} {expected:?}");
    }
}

/// Below it white and black take turns from voxel to voxel: a site that stands for a disc shows what all of its points
/// show on the mean, and not the voxel that it lies in.
#[test]
fn a_site_stands_for_its_disc() {
    let (_, media) = synthetic();
    let size = DVec3::splat(4.0);
    let id = |p: DVec3| 1 + ((p.x * 4.0) as u8 + (p.y * 4.0) as u8) % 2;
    let scene = Scene::new(volume([80, 80, 80], DVec3::splat(0.05), id), &[media]).unwrap();
    let middle = Site { point: DVec3::new(2.1, 2.1, size.z), normal: DVec3::Z };
    let point = |n: u32| {
        let (turn, out) = (f64::from(n) * 2.399_963, 0.6 * (f64::from(n) / 2048.0).sqrt());
        Site { point: middle.point + DVec3::new(turn.cos(), turn.sin(), 0.0) * out, ..middle }
    };
    let all = printed(&scene, Spot::of((0..2048).map(point).collect()), 200_000);
    let disc = printed(&scene, Spot { sites: vec![middle], site_radius_mm: 0.6 }, 200_000);
    let alone = printed(&scene, Spot::of(vec![middle]), 200_000);
    let sigma = all.standard_error.hypot(disc.standard_error);
    assert!((all.mean - disc.mean).abs() < 3.0 * sigma + 0.002, "{all:?} {disc:?}");
    assert!((all.mean - alone.mean).abs() > 0.05, "{all:?} {alone:?}");
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let (_, media) = synthetic();
    let id = |p: DVec3| 1 + (p.x * 5.0) as u8 % 3;
    let scene = Scene::new(volume([40, 40, 40], DVec3::splat(0.05), id), &[media.clone(), media]).unwrap();
    let spots: Vec<_> = (0..3).map(|_| top(DVec3::splat(2.0))).collect();
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let on = |threads| pool(threads).install(|| scene.printed_albedo(&spots, 10_000, 9, &Unwatched).unwrap());
    let found = on(1);
    assert_eq!(found, on(3));
    assert_eq!(found[0][0], found[0][1], "both channels are the same");
    assert_ne!(found[0][0], found[1][0], "spots have streams of their own");
    // A spot far from the print has nothing to show.
    let nowhere = Spot::of(vec![Site { point: DVec3::splat(9.0), normal: DVec3::Z }]);
    assert_eq!(scene.printed_albedo(&[nowhere], 100, 1, &Unwatched).unwrap(), [[None, None]]);
}
