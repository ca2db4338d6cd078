//! Shapes whose layers are known.

use std::f64::consts::PI;

use glam::DVec3;

use super::*;
use crate::slice::{DistanceKind, meshes::MeshingError};
use crate::watch::{Interrupt, Stopped, Watch};

/// Four layers and a core in a slab.
fn layered_slab() -> Slicer {
    let size = DVec3::new(10.0, 8.0, 3.0);
    let layers = stack(&[(WHITE, 0.2), (SUPPORT, 0.3), (BLACK, 0.25), (WHITE, 0.4)], CYAN);
    slicer(vec![(cuboid(DVec3::ZERO, size), layers)], size, 0.05)
}

#[test]
fn a_layered_slab_is_closed_and_keeps_its_volumes() {
    let slicer = layered_slab();
    let meshes = mesh(&slicer, 0.1, &[WHITE, SUPPORT, BLACK, CYAN]);
    assert_sound(&meshes);
    assert_volumes(&meshes, &slicer, 0.01);
    let outer = outer_triangles(&meshes);
    assert_closed(outer, "the outer surface");
    let total: f64 = meshes.parts.iter().map(|part| part.volume_mm3).sum();
    assert!((total / 240.0 - 1.0).abs() < 2e-3, "{total}");
}

#[test]
fn boundaries_of_a_slab_lie_at_their_depths() {
    // Above the middle of the upper face, 2 mm from the sides. Boundaries that fall on nodes keep a margin.
    let meshes = mesh(&layered_slab(), 0.1, &[WHITE, SUPPORT, BLACK, CYAN]);
    let middle = |[x, y, z]: [f32; 3]| (2.0..8.0).contains(&x) && (2.0..6.0).contains(&y) && z > 1.6;
    let heights = meshes.positions.iter().filter(|p| middle(**p)).map(|p| f64::from(p[2]));
    let expected = [1.85, 2.25, 2.5, 2.8, 3.0];
    let mut seen = [false; 5];
    for z in heights {
        let nearest = (0..5).min_by(|&a, &b| (z - expected[a]).abs().total_cmp(&(z - expected[b]).abs())).unwrap();
        assert!((z - expected[nearest]).abs() < 1.1e-4, "{z}");
        seen[nearest] = true;
    }
    assert_eq!(seen, [true; 5]);
}

/// By the Lp-averaged distance layers are thinner or thicker near edges; voxels and meshes must agree on how.
#[test]
fn meshes_of_averaged_layers_keep_the_volumes_of_their_voxels() {
    const VOXEL_MM: f64 = 0.04;
    let size = DVec3::new(4.4, 4.0, 3.6);
    let lattice = Lattice::covering(size, DVec3::splat(VOXEL_MM)).unwrap();
    // Whole voxels, or flat faces alone would be off by half of one. Deep down, where other faces count too, boundaries
    // no longer lie between voxels: 1.1% of the black layer.
    let layers = || stack(&[(WHITE, 0.32), (SUPPORT, 0.4), (BLACK, 0.32)], CYAN);
    let field = || ObjectField::new(&solid(cuboid(DVec3::ZERO, size)), lattice, layers()).unwrap();
    let exact = voxel_volumes(&Slicer::new(lattice, vec![field()]));
    let averaged = Slicer::new(lattice, vec![field().with_distance(DistanceKind::Lp { exponent: 8.0 })]);
    let moved = voxel_volumes(&averaged)[usize::from(CYAN.0)] / exact[usize::from(CYAN.0)] - 1.0;
    assert!(moved.abs() > 0.03, "the averaged distance differs: the core's volume by {moved}");
    let meshes = mesh(&averaged, 0.06, &[WHITE, SUPPORT, BLACK, CYAN]);
    assert_sound(&meshes);
    assert_volumes(&meshes, &averaged, 0.015);
    assert_closed(outer_triangles(&meshes), "the outer surface");
}

#[test]
fn a_layered_sphere_is_closed_and_keeps_its_volumes() {
    let mesh_of = sphere(DVec3::splat(5.0), 5.0, 64);
    let layers = stack(&[(WHITE, 0.4), (SUPPORT, 1.0), (WHITE, 0.4)], BLACK);
    let slicer = slicer(vec![(mesh_of, layers)], DVec3::splat(10.0), 0.08);
    let meshes = mesh(&slicer, 0.2, &[WHITE, SUPPORT, BLACK]);
    assert_sound(&meshes);
    assert_volumes(&meshes, &slicer, 0.01);
    assert_closed(outer_triangles(&meshes), "the outer surface");
    let core = meshes.parts[2].volume_mm3;
    assert!((core / (4.0 / 3.0 * PI * 3.2_f64.powi(3)) - 1.0).abs() < 0.01, "{core}");
}

#[test]
fn what_is_not_asked_for_is_a_void() {
    let slicer = layered_slab();
    let all = mesh(&slicer, 0.2, &[WHITE, SUPPORT, BLACK, CYAN]);
    let some = mesh(&slicer, 0.2, &[CYAN, WHITE]);
    assert_sound(&some);
    assert_eq!(some.parts.len(), 2);
    assert!((some.parts[0].volume_mm3 / all.parts[3].volume_mm3 - 1.0).abs() < 1e-6);
    assert!((some.parts[1].volume_mm3 / all.parts[0].volume_mm3 - 1.0).abs() < 0.01);
}

#[test]
fn a_layer_without_thickness_is_gone() {
    let size = DVec3::splat(4.0);
    let layers = |middle: &[(MaterialId, f64)]| stack(&[&[(WHITE, 0.5)], middle, &[(BLACK, 0.5)]].concat(), CYAN);
    let with = slicer(vec![(cuboid(DVec3::ZERO, size), layers(&[(SUPPORT, 0.0)]))], size, 0.2);
    let without = slicer(vec![(cuboid(DVec3::ZERO, size), layers(&[]))], size, 0.2);
    let ids = [WHITE, SUPPORT, BLACK, CYAN];
    let (with, without) = (mesh(&with, 0.2, &ids), mesh(&without, 0.2, &ids));
    assert!(with.parts[1].triangles.is_empty());
    assert_eq!(with, without);
}

#[test]
fn layers_below_the_pitch_still_close() {
    let size = DVec3::splat(6.0);
    let layers = stack(&[(WHITE, 0.1), (SUPPORT, 0.05), (BLACK, 0.12), (WHITE, 0.07), (SUPPORT, 0.3)], CYAN);
    let ball = sphere(size / 2.0, 3.0, 24);
    let slicer = slicer(vec![(ball, layers)], size, 0.2);
    let meshes = mesh(&slicer, 0.3, &[WHITE, SUPPORT, BLACK, CYAN]);
    assert_sound(&meshes);
    assert_closed(outer_triangles(&meshes), "the outer surface");
}

#[test]
fn the_earlier_object_owns_what_two_share() {
    let extent = DVec3::new(7.0, 4.0, 4.0);
    let objects = || {
        vec![
            (cuboid(DVec3::ZERO, DVec3::splat(4.0)), stack(&[(WHITE, 0.5)], BLACK)),
            (cuboid(DVec3::new(3.0, 0.0, 0.0), extent), stack(&[(SUPPORT, 0.5)], CYAN)),
        ]
    };
    let ids = [WHITE, SUPPORT, BLACK, CYAN];
    let first = slicer(objects(), extent, 0.1);
    let meshes = mesh(&first, 0.1, &ids);
    assert_sound(&meshes);
    assert_volumes(&meshes, &first, 0.01);
    assert_closed(outer_triangles(&meshes), "the outer surface");
    let alone = slicer(objects().into_iter().take(1).collect(), extent, 0.1);
    let alone = mesh(&alone, 0.1, &ids);
    for part in [0, 2] {
        let [a, b] = [&meshes, &alone].map(|meshes| meshes.parts[part].volume_mm3);
        assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
    }
}

#[test]
fn the_same_whatever_the_thread_count() {
    let slicer = layered_slab();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| mesh(&slicer, 0.2, &[WHITE, BLACK, CYAN]))
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn the_default_pitch_is_half_the_thinnest_layer_within_reason() {
    let j750 = DVec3::new(0.0423, 0.0847, 0.027);
    assert_eq!(MaterialMesher::default_pitch_mm(Some(0.2), j750), 0.1);
    assert_eq!(MaterialMesher::default_pitch_mm(Some(0.078), j750), 0.054);
    assert_eq!(MaterialMesher::default_pitch_mm(None, j750), 0.2);
    assert_eq!(MaterialMesher::default_pitch_mm(Some(2.0), DVec3::splat(0.5)), 0.5);
}

#[test]
fn bad_pitches_are_refused_and_work_can_be_ended() {
    let slicer = layered_slab();
    let run = |pitch_mm: f64, watch: &dyn Watch| {
        MaterialMesher { pitch_mm, error_mm: 0.005 }.mesh(slicer.objects(), &[], watch)
    };
    assert_eq!(run(0.0, &Unwatched).unwrap_err().to_string(), "the mesh pitch is 0 mm, expected a positive length");
    assert!(matches!(run(f64::NAN, &Unwatched), Err(MeshingError::Pitch { .. })));
    assert!(matches!(run(1e-6, &Unwatched), Err(MeshingError::TooFine { axis: 'x', .. })));
    let stop = Interrupt::new();
    stop.request();
    assert_eq!(run(1.0, &stop), Err(MeshingError::Stopped(Stopped)));
    let empty = MaterialMesher { pitch_mm: 1.0, error_mm: 0.005 }.mesh(&[], &resins(&[WHITE]), &Unwatched).unwrap();
    assert!(empty.positions.is_empty() && empty.parts[0].triangles.is_empty());
}
