//! Surfaces that bend light: nothing is lost, slabs print as transport has it, balls as a walk in an exact ball.

use std::sync::Arc;

use glam::DVec3;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

use super::{
    ball::in_an_exact_ball,
    spots::{printed, sites, synthetic, top, volume},
};
use crate::look::{Beam, Camera, Ground, LAMPS, Lamps, Lit, Scene, Spot, Stage, path::Path, spots::over};
use crate::mesh::TriangleMesh;
use crate::optics::{
    Interface, Light, MaterialSet, Model, Stack, TransportOptions, VolumeCoefficients, fresnel::refraction,
    monte_carlo::photon::Moments, predict,
};
use crate::sdf::Surface;
use crate::test_shapes::{box_triangles, indexed, sphere};
use crate::watch::Unwatched;

const INDEX: f64 = 1.52;

fn mesh(triangles: &[[DVec3; 3]]) -> TriangleMesh {
    let (positions, triangles) = indexed(triangles);
    TriangleMesh { positions, triangles, ..TriangleMesh::default() }
}

fn under(scene: Scene, mesh: &TriangleMesh) -> Scene {
    scene.under(vec![Arc::new(Surface::new(mesh).unwrap())], &[1.0, INDEX, INDEX, INDEX])
}

/// The synthetic resins, all of one refractive index.
fn bent() -> MaterialSet {
    let mut set = MaterialSet::builtin("synthetic").unwrap();
    for resin in &mut set.resins {
        resin.refractive_index = INDEX;
        let volumes = resin.channels.iter_mut().filter_map(|channel| channel.volume.as_mut());
        volumes.for_each(|volume| volume.refractive_index = INDEX);
    }
    set
}

#[test]
fn slabs_under_a_surface_print_as_the_transport_model_has_it() {
    let (_, media) = synthetic();
    let set = bent();
    let [pitch, width] = [DVec3::new(0.0423, 0.0847, 0.05), DVec3::splat(24.0)];
    let core_mm = 2.0;
    let model = Model::Transport { light: Light::Diffuse, options: TransportOptions::default() };
    let id = |name: &str| set.resin(name).unwrap().0.0 as u8 + 1;
    for (top_resin, mm) in [("white", 2.0), ("support", 1.0)] {
        let stack = Stack::new([(set.resin(top_resin).unwrap().0, mm)]).over(set.resin("black").unwrap().0);
        let promised = predict(&set, &stack, &model, &Unwatched).unwrap().light[0].reflection_hankel[0];
        let dims = [width.x / pitch.x, width.y / pitch.y, (mm + core_mm) / pitch.z].map(|n| n.round() as u32);
        let size = DVec3::from(dims.map(f64::from)) * pitch;
        let voxels = volume(dims, pitch, |p| if size.z - p.z < mm { id(top_resin) } else { id("black") });
        let scene =
            under(Scene::new(voxels, std::slice::from_ref(&media)).unwrap(), &mesh(&box_triangles(DVec3::ZERO, size)));
        let found = printed(&scene, top(size), 200_000);
        println!("{top_resin}: printed {:.5} ± {:.5}, promised {promised:.5}", found.mean, found.standard_error);
        assert!((found.mean - promised).abs() < 3.0 * found.standard_error + 0.005 * promised, "{found:?}");
    }
}

/// Lit by a sky and by parallel light from three sides, a slab shows what it does under even light, times what of that
/// light gets in: by paths from all sides.
#[test]
fn pictures_under_a_surface_show_what_gets_in() {
    let (set, media) = synthetic();
    let [white, black] = ["white", "black"].map(|name| set.resin(name).unwrap().0.0 as u8 + 1);
    let (pitch, size) = (DVec3::splat(0.1), DVec3::new(24.0, 24.0, 3.0));
    let dims = (size / pitch).to_array().map(|n| n.round() as u32);
    let white_over_black = volume(dims, pitch, |p| if p.z > 1.0 { white } else { black });
    let scene = under(Scene::new(white_over_black, &[media]).unwrap(), &mesh(&box_triangles(DVec3::ZERO, size)));
    let albedo = printed(&scene, top(size), 100_000);
    let beam = |cosine: f64| {
        let toward = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        Beam { toward, lit: Lit::Everything }
    };
    let stage = Stage {
        scene: &scene,
        camera: Camera::new([DVec3::ZERO, size], 0.0, 1.0, [8; 2]),
        lamps: Lamps { beams: [1.0, 0.5, 0.2].map(beam) },
        ground: Ground { z: -1.0, albedo: 0.0 },
        surface: true,
    };
    let sites = top(size).sites;
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    let mut sums = [Moments::default(); LAMPS];
    let walks = 100_000;
    for walk in 0..walks {
        let site = &sites[walk % sites.len()];
        let (outward, _) = over(site.normal, &mut rng);
        let seen = Path::new(&stage, &scene.media()[0]).radiance(scene.place(site.point + outward), -outward, &mut rng);
        sums.iter_mut().zip(seen).for_each(|(sum, seen)| sum.score(std::f64::consts::PI * seen));
    }
    let gets_in = 1.0 - Interface::between(1.0, INDEX).above;
    let entering = |cosine: f64| (1.0 - refraction(cosine, 1.0, INDEX).unwrap().reflectance) / gets_in;
    let steps = (0..1000).map(|n| (f64::from(n) + 0.5) / 1000.0);
    let sky: f64 = steps.map(|mu| 2e-3 * mu * entering(mu) * std::f64::consts::PI * Lamps::sky(DVec3::Z * mu)).sum();
    let beams = stage.lamps.beams.map(|beam| beam.toward.z * entering(beam.toward.z));
    for (lamp, (sum, share)) in sums.iter().zip([sky].into_iter().chain(beams)).enumerate() {
        let (found, expected) = (sum.estimate(walks as u64), albedo.mean * share);
        println!("lamp {lamp}: {:.5} ± {:.5}, expected {expected:.5}", found.mean, found.standard_error);
        let noise = found.standard_error.hypot(albedo.standard_error * share);
        assert!((found.mean - expected).abs() < 3.5 * noise && noise < 0.01 * expected, "{lamp}: {found:?}");
    }
}

/// The normal that points straight down is one like the others.
#[test]
fn undersides_print_as_tops_do() {
    let (set, media) = synthetic();
    let white = set.resin("white").unwrap().0.0 as u8 + 1;
    let size = DVec3::new(6.4, 6.4, 4.0);
    let voxels = volume([64, 64, 40], DVec3::splat(0.1), |_| white);
    let scene = under(Scene::new(voxels, &[media]).unwrap(), &mesh(&box_triangles(DVec3::ZERO, size)));
    let above = top(size);
    let mut below = above.clone();
    for site in &mut below.sites {
        (site.point.z, site.normal) = (0.0, -site.normal);
    }
    let [above, below] = [above, below].map(|spot| printed(&scene, spot, 50_000));
    let noise = above.standard_error.hypot(below.standard_error);
    assert!((above.mean - below.mean).abs() < 3.5 * noise && noise < 0.005, "{above:?} {below:?}");
}

#[test]
fn what_enters_leaves_where_nothing_absorbs() {
    let white = VolumeCoefficients::new(8.0, 0.0, 0.5).unwrap();
    let media = vec![VolumeCoefficients::new(0.0, 0.0, 0.0).unwrap(), white];
    let (radius, pitch) = (1.0, DVec3::new(0.04, 0.05, 0.03));
    let centre = DVec3::splat(1.2);
    let voxels = volume([60, 48, 80], pitch, |p| u8::from(p.distance(centre) < radius));
    let scene = under(Scene::new(voxels, &[media]).unwrap(), &mesh(&sphere(centre, radius, 60)));
    let found = printed(&scene, Spot::of(sites(centre, radius, 64)), 20_000);
    // All but the glint.
    let glint = Interface::between(1.0, INDEX).above;
    let apart = (found.mean - (1.0 - glint)).abs();
    assert!(apart < 4.0 * found.standard_error + 1e-3, "{found:?} instead of {}", 1.0 - glint);
}

#[test]
fn balls_under_a_surface_print_as_a_walk_in_an_exact_ball_has_it() {
    let (_, media) = synthetic();
    for (id, radius) in [(1_u8, 0.6), (3, 2.5)] {
        let (pitch, dims) = (DVec3::splat(radius / 100.0), [212; 3]);
        let centre = pitch * 106.0;
        let voxels = volume(dims, pitch, |p| if p.distance(centre) < radius { id } else { 0 });
        let scene =
            under(Scene::new(voxels, std::slice::from_ref(&media)).unwrap(), &mesh(&sphere(centre, radius, 200)));
        let found = printed(&scene, Spot::of(sites(centre, radius, 512)), 200_000);
        let expected = in_an_exact_ball(radius, &media[usize::from(id)], INDEX, 200_000);
        let sigma = found.standard_error.hypot(expected.standard_error);
        println!("ball of {id} under a surface: {found:?} and {expected:?}");
        assert!((found.mean - expected.mean).abs() < 3.0 * sigma + 0.005 * expected.mean, "{found:?} {expected:?}");
    }
}
