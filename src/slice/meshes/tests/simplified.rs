//! Fewer triangles: as sound as the fine ones, and near to them both ways.

use std::collections::HashSet;

use glam::{DMat3, DVec3};

use super::*;
use crate::{
    mesh::{LoadOptions, load},
    sdf::Surface,
    slice::meshes::write_3mf,
};

const IDS: [MaterialId; 4] = [WHITE, SUPPORT, BLACK, CYAN];

/// A part as a surface to ask for distances.
fn surface(meshes: &MaterialMeshes, part: usize) -> Surface {
    let positions = meshes.positions.iter().map(|p| DVec3::from(p.map(f64::from))).collect();
    Surface::new(&TriangleMesh { positions, triangles: meshes.parts[part].triangles.clone(), ..Default::default() })
        .unwrap()
}

/// Distances of points all over the triangles of `from`, `spacing` mm apart, to `to`: the share of them above `error`,
/// and the greatest. Points of edges are looked at once, not for every triangle that has them.
fn distances(from: &Surface, to: &Surface, spacing: f64, error: f64) -> (f64, f64) {
    distances_by(from, spacing, error, |p| to.closest(p).distance)
}

/// The same by another distance.
fn distances_by(from: &Surface, spacing: f64, error: f64, distance: impl Fn(DVec3) -> f64) -> (f64, f64) {
    let (mut above, mut greatest) = (0_u32, 0.0_f64);
    let mut seen = HashSet::new();
    for &[a, b, c] in from.triangles() {
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let steps = (longest / spacing).ceil() as u32;
        let share = |n: u32| f64::from(n) / f64::from(steps);
        for i in 0..=steps {
            for j in 0..=steps - i {
                let point = a + (b - a) * share(i) + (c - a) * share(j);
                if !seen.insert((point * 1e6).round().as_i64vec3()) {
                    continue;
                }
                let found = distance(point);
                greatest = greatest.max(found);
                above += u32::from(found > error);
            }
        }
    }
    (f64::from(above) / seen.len() as f64, greatest)
}

/// Every part of the one lies along the same part of the other.
fn assert_near(fine: &MaterialMeshes, few: &MaterialMeshes, error: f64) {
    for part in 0..fine.parts.len() {
        let [fine, few] = [fine, few].map(|meshes| surface(meshes, part));
        for (from, to) in [(&fine, &few), (&few, &fine)] {
            let (share, greatest) = distances(from, to, 0.1, error);
            println!("part {part}: {:.4}% above {error} mm, at most {greatest:.5} mm", 100.0 * share);
            assert!(share < 1e-3 && greatest < 2.0 * error, "part {part}: {share} above {error} mm, {greatest} mm");
        }
    }
}

/// Both parts of a boundary have its triangles still.
fn assert_few(fine: &MaterialMeshes, few: &MaterialMeshes, share: f64) {
    assert_sound(few);
    assert_closed(outer_triangles(few), "the outer surface");
    let count = |meshes: &MaterialMeshes| meshes.parts.iter().map(|part| part.triangles.len()).sum::<usize>() as f64;
    let kept = count(few) / count(fine);
    println!("{} triangles of {}: {:.1}%", count(few), count(fine), 100.0 * kept);
    assert!(kept <= share, "{kept} of the triangles are left, expected at most {share}");
}

/// The sample `slab.toml`: boxes within boxes, of which every face, edge and corner is known.
#[test]
fn a_slab_is_made_of_few_triangles_with_sharp_edges() {
    const ERROR_MM: f64 = 0.001;
    let size = DVec3::new(20.0, 20.0, 6.0);
    let layers = stack(&[(WHITE, 0.5), (SUPPORT, 1.0), (WHITE, 0.5), (BLACK, 0.5)], BLACK);
    let slicer = slicer(vec![(cuboid(DVec3::ZERO, size), layers)], size, 0.1);
    let few = simplified(&slicer, 0.1, ERROR_MM, &[WHITE, SUPPORT, BLACK]);
    assert_sound(&few);
    assert_closed(outer_triangles(&few), "the outer surface");
    let count: usize = few.parts.iter().map(|part| part.triangles.len()).sum();
    println!("{count} triangles");
    assert!(count <= 5000, "{count} triangles");
    let volume = |depth: f64| (size - 2.0 * depth).element_product();
    let expected = [volume(0.0) - volume(0.5) + volume(1.5) - volume(2.0), volume(0.5) - volume(1.5), volume(2.0)];
    for (part, expected) in few.parts.iter().zip(expected) {
        assert!((part.volume_mm3 / expected - 1.0).abs() < 1e-4, "{}: {} mm³", part.name, part.volume_mm3);
    }
    let boxed = |depths: &[f64]| {
        let boxes = depths.iter().flat_map(|&depth| box_triangles(DVec3::splat(depth), size - depth));
        let (positions, triangles) = indexed(&boxes.collect::<Vec<_>>());
        Surface::new(&TriangleMesh { positions, triangles, ..Default::default() }).unwrap()
    };
    for (part, depths) in [&[0.0, 0.5, 1.5, 2.0][..], &[0.5, 1.5], &[2.0]].into_iter().enumerate() {
        let (found, truth) = (surface(&few, part), boxed(depths));
        for (from, to) in [(&found, &truth), (&truth, &found)] {
            let (_, greatest) = distances(from, to, 0.25, ERROR_MM);
            assert!(greatest < ERROR_MM, "part {part} is off by {greatest} mm");
        }
    }
}

/// Edges at an angle to the nodes: some notches stay, which cost the core 0.15%.
#[test]
fn a_tilted_box_keeps_its_edges() {
    let size = DVec3::new(6.0, 5.0, 4.0);
    let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.4, 0.7, 0.2);
    let mut mesh_of = cuboid(-0.5 * size, 0.5 * size);
    mesh_of.positions.iter_mut().for_each(|p| *p = turn * *p + 5.0);
    let slicer = slicer(vec![(mesh_of, stack(&[(WHITE, 0.8)], BLACK))], DVec3::splat(10.0), 0.1);
    let few = simplified(&slicer, 0.2, 0.005, &[WHITE, BLACK]);
    assert_sound(&few);
    let count: usize = few.parts.iter().map(|part| part.triangles.len()).sum();
    println!("{count} triangles");
    let core = (size - 1.6).element_product();
    for (part, expected) in few.parts.iter().zip([size.element_product() - core, core]) {
        println!("{}: {} of {expected} mm³", part.name, part.volume_mm3);
        assert!((part.volume_mm3 / expected - 1.0).abs() < 2e-3, "{}: {} mm³", part.name, part.volume_mm3);
    }
    assert!(count < 2500, "{count} triangles");
}

/// Few triangles of a ball of `stacks` rings of facets, with two layers around a core, are at most `kept` of the fine
/// ones and near to the exact boundaries, which are known by the distance to the facets, both ways. Between the places
/// that are held against the error the fine triangles are chords, at this pitch 2 µm off.
fn assert_ball(stacks: u32, kept: f64, error: f64) {
    const DEPTHS: [f64; 3] = [0.0, 0.4, 1.4];
    let ball = || sphere(DVec3::splat(5.0), 5.0, stacks);
    let slicer = slicer(vec![(ball(), stack(&[(WHITE, 0.4), (SUPPORT, 1.0)], BLACK))], DVec3::splat(10.0), 0.2);
    let ids = [WHITE, SUPPORT, BLACK];
    let fine = mesh(&slicer, 0.2, &ids);
    let few = simplified(&slicer, 0.2, error, &ids);
    assert_few(&fine, &few, kept);
    let facets = Surface::new(&ball()).unwrap();
    // The place on the nearest boundary.
    let onto = |p: DVec3| {
        let found = facets.closest(p);
        let off = |depth: &f64| (found.distance - depth).abs();
        let depth = DEPTHS.into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
        if depth > 0.0 { found.point + (p - found.point) * (depth / found.distance) } else { found.point }
    };
    for part in 0..ids.len() {
        let [fine, few] = [&fine, &few].map(|meshes| surface(meshes, part));
        for (way, (share, greatest)) in [
            distances_by(&few, 0.1, error, |p| p.distance(onto(p))),
            distances_by(&fine, 0.1, error, |p| few.closest(onto(p)).distance),
        ]
        .into_iter()
        .enumerate()
        {
            println!("part {part}: {:.4}% above {error} mm, at most {greatest:.5} mm", 100.0 * share);
            assert!(share < 5e-3 && greatest < 1.5 * error, "{part}, {way}: {share} above {error} mm, {greatest} mm");
        }
    }
    for (few, fine) in few.parts.iter().zip(&fine.parts) {
        assert!((few.volume_mm3 / fine.volume_mm3 - 1.0).abs() < 0.01, "{}", few.name);
    }
}

#[test]
fn a_sphere_stays_within_the_error() {
    assert_ball(128, 0.06, 0.02);
    assert_ball(128, 0.2, 0.005);
}

/// Large facets at an angle to each other: two of their edges pass many a cell, where the fine triangles are off by more
/// than few need be.
#[test]
fn a_faceted_ball_is_made_of_few_triangles() {
    assert_ball(12, 0.03, 0.005);
}

/// Where layers end, three materials meet: these curves are shared by all three.
#[test]
fn curves_between_three_materials_are_shared() {
    let slicer = super::textured::patched_sphere(|x, y| ((x * 5 + y * 7) % 3) as u16);
    let fine = mesh(&slicer, 0.16, &IDS);
    let few = simplified(&slicer, 0.16, 0.005, &IDS);
    assert_few(&fine, &few, 0.9);
    assert_near(&fine, &few, 0.005);
    assert_volumes(&few, &slicer, 0.01);
}

#[test]
fn few_triangles_are_the_same_whatever_the_thread_count() {
    let size = DVec3::new(10.0, 8.0, 3.0);
    let ball = (sphere(DVec3::splat(4.0), 4.0, 32), stack(&[(WHITE, 0.5), (SUPPORT, 0.6)], BLACK));
    let slicer = slicer(vec![ball], size.max(DVec3::splat(8.0)), 0.2);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| simplified(&slicer, 0.2, 0.005, &IDS[..3]))
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn few_triangles_read_back() {
    let slicer =
        slicer(vec![(sphere(DVec3::splat(3.0), 3.0, 48), stack(&[(WHITE, 0.8)], BLACK))], DVec3::splat(6.0), 0.2);
    let few = simplified(&slicer, 0.2, 0.005, &[WHITE, BLACK]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("few.3mf");
    write_3mf(&few, &[[200, 100, 50, 255]; 256], std::fs::File::create(&path).unwrap()).unwrap();
    let read = load(&path, &LoadOptions::default()).unwrap().mesh;
    let all = [0, 1].map(|part| super::writers::corners(&few, part)).concat();
    assert!(super::writers::read_corners(&read) == all, "the assembly differs");
}
