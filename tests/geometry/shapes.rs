//! Slabs, boxes and spheres: depth has a formula, and every voxel must be what the formula says.

use super::support::*;
use glam::{DMat3, DVec3};
use lumislice::{
    appearance::LayerStack,
    voxel::{Lattice, MaterialId},
};

/// A box about `center`, turned.
struct TurnedBox {
    center: DVec3,
    half: DVec3,
    rotation: DMat3,
}

impl TurnedBox {
    /// Depth of a position, negative outside (where it is not the distance).
    fn depth(&self, p: DVec3) -> f64 {
        (self.half - (self.rotation.transpose() * (p - self.center)).abs()).min_element()
    }

    fn triangles(&self) -> Triangles {
        let place = |p: DVec3| self.rotation * p + self.center;
        box_triangles(-self.half, self.half).into_iter().map(|t| t.map(place)).collect()
    }
}

/// Voxels that differ from `depth`, and those not compared since depth 0 or a boundary is within `margin`.
fn differences(
    triangles: &[[DVec3; 3]],
    lattice: Lattice,
    thicknesses: &[f64],
    margin: f64,
    depth: impl Fn(DVec3) -> f64,
) -> (usize, usize) {
    let layers = stack(thicknesses);
    let mut boundaries = vec![0.0];
    thicknesses.iter().for_each(|t| boundaries.push(boundaries[boundaries.len() - 1] + t));
    let expected = |depth: f64| if depth < 0.0 { MaterialId::BACKGROUND } else { layers.material(depth, 0) };
    let found = voxels(&slicer_of(&solid_of(triangles), lattice, layers.clone()));
    let (mut wrong, mut left_out) = (0, 0);
    for (index, id) in indices(&lattice).zip(found) {
        let depth = depth(lattice.centre(index));
        if boundaries.iter().any(|b| (depth - b).abs() < margin) {
            left_out += 1;
        } else if expected(depth).0 != id {
            if wrong < 3 {
                println!("{index:?} at {:?}, depth {depth}: {id}", lattice.centre(index));
            }
            wrong += 1;
        }
    }
    (wrong, left_out)
}

/// Voxels compared.
fn assert_upright(low: DVec3, high: DVec3, lattice: Lattice, thicknesses: &[f64]) -> u64 {
    let depth = |p: DVec3| (p - low).min(high - p).min_element();
    let (wrong, left_out) = differences(&box_triangles(low, high), lattice, thicknesses, 0.0, depth);
    assert_eq!((wrong, left_out), (0, 0), "box {low} to {high}, pitch {}", lattice.pitch);
    lattice.voxels()
}

fn lattice_over(high: DVec3, pitch: DVec3) -> Lattice {
    Lattice::covering(high, pitch).unwrap()
}

const PITCHES: [DVec3; 3] = [DVec3::splat(0.1), DVec3::new(25.4 / 600.0, 25.4 / 300.0, 0.027), DVec3::splat(0.125)];

#[test]
fn a_slab_is_layered_as_asked() {
    let mut compared = 0;
    for pitch in PITCHES {
        let high = DVec3::new(12.0, 10.0, 2.0);
        compared += assert_upright(DVec3::ZERO, high, lattice_over(high, pitch), &[0.2, 0.5]);
        compared += assert_upright(DVec3::ZERO, high, lattice_over(high, pitch), &[0.078125, 0.0, 0.3, 0.078125]);
    }
    println!("{compared} voxels, 0 differ");
}

#[test]
fn an_upright_box_is_layered_as_asked() {
    let mut random = Random::new(1);
    let mut compared = 0;
    for pitch in PITCHES {
        for _ in 0..4 {
            let low = (random.vector() + 1.0) * 0.3;
            let high = low + 1.0 + (random.vector() + 1.0) * 1.2;
            let thicknesses: Vec<f64> = (0..4).map(|_| random.between(0.0, 0.35)).collect();
            compared += assert_upright(low, high, lattice_over(high + 0.2, pitch), &thicknesses);
        }
    }
    println!("{compared} voxels, 0 differ");
}

/// Faces and boundaries on voxel centres, in coordinates that binary numbers hold exactly.
#[test]
fn faces_and_boundaries_on_voxel_centres_count_as_stated() {
    let pitch = DVec3::new(0.125, 0.25, 0.0625);
    let lattice = lattice_over(DVec3::new(4.0, 5.0, 3.0), pitch);
    let low = lattice.centre([3, 2, 7]);
    let high = lattice.centre([27, 17, 40]);
    // The faces' own voxels have depth 0 and are inside; those at a boundary belong to the layer below it.
    assert_upright(low, high, lattice, &[0.25, 0.125, 0.375]);
    // Half a voxel off.
    assert_upright(low + pitch / 2.0, high + pitch / 2.0, lattice, &[0.0625, 0.1875, 0.03125]);
    // The same, without binary luck.
    let lattice = lattice_over(DVec3::splat(4.0), DVec3::splat(0.1));
    let (low, high) = (lattice.centre([3, 2, 7]), lattice.centre([27, 17, 38]));
    assert_upright(low, high, lattice, &[0.1, 0.2, 0.3]);
    // One voxel thick, and flat as a sheet of voxels.
    assert_upright(lattice.centre([3, 3, 3]), lattice.centre([4, 9, 9]), lattice, &[0.05]);
    // On the lattice's border.
    assert_upright(DVec3::ZERO, DVec3::splat(3.2), lattice_over(DVec3::splat(3.2), DVec3::splat(0.1)), &[0.15, 0.4]);
}

#[test]
fn a_turned_box_is_layered_as_asked() {
    let mut random = Random::new(2);
    let (mut compared, mut left_out) = (0, 0);
    for pitch in [DVec3::splat(0.05), j750()] {
        for _ in 0..6 {
            let shape = TurnedBox {
                center: DVec3::splat(2.0) + random.vector() * 0.1,
                half: DVec3::splat(0.3) + (random.vector() + 1.0) * 0.35,
                rotation: random.rotation(),
            };
            let lattice = lattice_over(DVec3::splat(4.0), pitch);
            let found = differences(&shape.triangles(), lattice, &[0.15, 0.0625, 0.31], 1e-9, |p| shape.depth(p));
            assert_eq!(found.0, 0, "pitch {pitch}");
            compared += lattice.voxels();
            left_out += found.1;
        }
    }
    println!("{compared} voxels, {left_out} left out for lying within 1e-9 mm of a boundary");
    assert!(left_out < 50);
}

/// A quarter turn, and 3-4-5 slopes: boundaries that pass through voxel centres in coordinates that are not exact.
#[test]
fn a_box_on_a_slope_through_voxel_centres_has_no_stray_voxels() {
    let slope = DMat3::from_cols(DVec3::new(0.6, 0.8, 0.0), DVec3::new(-0.8, 0.6, 0.0), DVec3::Z);
    let shape = TurnedBox { center: DVec3::splat(2.0), half: DVec3::new(1.25, 0.75, 1.0), rotation: slope };
    let lattice = lattice_over(DVec3::splat(4.0), DVec3::splat(0.05));
    let (wrong, left_out) = differences(&shape.triangles(), lattice, &[0.25, 0.25], 1e-9, |p| shape.depth(p));
    println!("{} voxels, {left_out} left out", lattice.voxels());
    assert_eq!(wrong, 0);
}

/// Largest relative error of the volumes of ten shells of 0.5 mm of a sphere of radius 10 mm.
fn worst_shell(pitch: f64) -> f64 {
    const RADIUS: f64 = 10.0;
    // A facet lies at most 0.9 µm below the sphere.
    let triangles = sphere(DVec3::splat(RADIUS), RADIUS, 120);
    let lattice = lattice_over(DVec3::splat(2.0 * RADIUS), DVec3::splat(pitch));
    let slicer = slicer_of(&solid_of(&triangles), lattice, stack(&[0.5; 10]));
    let mut counts = [0_u64; 256];
    voxels_of(&slicer, 0..lattice.dims[2], |_, _, row| row.iter().for_each(|&id| counts[usize::from(id)] += 1));
    let ball = |radius: f64| 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    let error = |shell: usize| {
        let outer = RADIUS - 0.5 * shell as f64;
        let expected = ball(outer) - ball(outer - 0.5);
        (counts[shell + 1] as f64 * lattice.voxel_volume() / expected - 1.0).abs()
    };
    let worst = (0..10).map(error).fold(0.0, f64::max);
    println!("pitch {pitch}: worst shell {:.4}% off", 100.0 * worst);
    worst
}

#[test]
fn shells_of_a_sphere_have_their_volume() {
    assert!(worst_shell(0.1) < 0.006);
}

#[test]
#[ignore = "slow: 64 M voxels"]
fn shells_of_a_sphere_have_their_volume_at_half_the_pitch() {
    assert!(worst_shell(0.05) < 0.002);
}

/// The layers do not depend on how finely a flat face is cut.
#[test]
fn the_triangulation_of_a_face_does_not_matter() {
    let (low, high) = (DVec3::splat(0.25), DVec3::new(2.2, 1.9, 1.7));
    let lattice = lattice_over(DVec3::splat(2.5), DVec3::splat(0.05));
    let layers: LayerStack = stack(&[0.1, 0.23, 0.3]);
    let coarse = box_triangles(low, high);
    let mut fine = coarse.clone();
    for _ in 0..3 {
        let quarter = |[a, b, c]: [DVec3; 3]| {
            let [ab, bc, ca] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        fine = fine.into_iter().flat_map(quarter).collect();
    }
    let whole = |triangles: &[[DVec3; 3]]| voxels(&slicer_of(&solid_of(triangles), lattice, layers.clone()));
    assert_eq!(whole(&coarse), whole(&fine));
}
