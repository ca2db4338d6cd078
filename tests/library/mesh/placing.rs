//! Placement: the matrix tells the truth, the box stands where it should, inside stays inside.

use glam::DVec3;
use lumislice::mesh::{MeshError, Placement, Size, close, place};
use proptest::prelude::*;

use super::shapes::{box_triangles, mesh_of, reversed, sphere};

fn bounds(positions: &[DVec3]) -> (DVec3, DVec3) {
    let low = positions.iter().copied().reduce(DVec3::min).unwrap();
    (low, positions.iter().copied().reduce(DVec3::max).unwrap())
}

fn vector(range: std::ops::Range<f64>) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(range).prop_map(DVec3::from_array)
}

proptest! {
    #[test]
    fn the_matrix_maps_every_vertex_and_the_minimum_is_the_position(
        scale in prop_oneof![-5.0..-0.1, 0.1..5.0f64],
        rotate_deg in vector(-400.0..400.0),
        position_mm in vector(-50.0..50.0),
    ) {
        let mesh = mesh_of(&sphere(DVec3::new(3.0, -7.0, 1.0), 2.0, 6));
        let before = mesh.positions.clone();
        let (placed, matrix) = place(mesh, &Placement { size: Size::Scale(scale), rotate_deg, position_mm }).unwrap();
        for (p, q) in before.iter().zip(&placed.positions) {
            prop_assert!(matrix.transform_point3(*p).distance(*q) < 1e-11);
        }
        prop_assert_eq!(bounds(&placed.positions).0, position_mm);
        let solid = close(placed).unwrap();
        // A mirrored solid still faces outwards by itself.
        prop_assert_eq!(solid.health.turned_shells, 0);
    }

    #[test]
    fn height_is_measured_after_rotation(height in 0.5..100.0f64, rotate_deg in vector(-180.0..180.0)) {
        let mesh = mesh_of(&box_triangles(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)));
        let placement = Placement { size: Size::HeightMm(height), rotate_deg, ..Placement::default() };
        let (placed, _) = place(mesh, &placement).unwrap();
        let (low, high) = bounds(&placed.positions);
        prop_assert_eq!(low, DVec3::ZERO);
        prop_assert!((high.z - height).abs() < 1e-9 * height);
    }
}

#[test]
fn rotations_are_about_fixed_axes_in_the_order_x_y_z() {
    let mesh = mesh_of(&box_triangles(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)));
    let placement = Placement { rotate_deg: DVec3::new(90.0, 0.0, 90.0), ..Placement::default() };
    let (placed, matrix) = place(mesh, &placement).unwrap();
    // About x: y → z, z → −y; then about z: −y → x. Quarter turns are exact.
    assert_eq!(matrix.transform_vector3(DVec3::Y), DVec3::Z);
    assert_eq!(matrix.transform_vector3(DVec3::Z), DVec3::X);
    assert_eq!(matrix.transform_vector3(DVec3::X), DVec3::Y);
    assert_eq!(bounds(&placed.positions), (DVec3::ZERO, DVec3::new(3.0, 1.0, 2.0)));
}

#[test]
fn senseless_parameters_are_refused_by_name() {
    let mesh = || mesh_of(&box_triangles(DVec3::ZERO, DVec3::ONE));
    let normal = Placement::default();
    let cases = [
        ("scale", Placement { size: Size::Scale(0.0), ..normal }),
        ("scale", Placement { size: Size::Scale(f64::NAN), ..normal }),
        ("scale", Placement { size: Size::Scale(1e9), ..normal }),
        ("height-mm", Placement { size: Size::HeightMm(-1.0), ..normal }),
        ("height-mm", Placement { size: Size::HeightMm(f64::INFINITY), ..normal }),
        ("rotate-deg", Placement { rotate_deg: DVec3::NAN, ..normal }),
        ("position-mm", Placement { position_mm: DVec3::splat(1e7), ..normal }),
    ];
    for (expected, placement) in cases {
        match place(mesh(), &placement) {
            Err(MeshError::Placement { name, .. }) => assert_eq!(name, expected),
            other => panic!("{placement:?} gave {other:?}"),
        }
    }
    let flat = mesh_of(&[[DVec3::ZERO, DVec3::X, DVec3::Y]]);
    assert!(place(flat, &Placement { size: Size::HeightMm(5.0), ..normal }).is_err());
}

/// What closing drops counts for nothing: neither for the size nor for the position.
#[test]
fn what_is_dropped_is_not_measured() {
    let cube = box_triangles(DVec3::splat(20.0), DVec3::splat(24.0));
    let [a, b, c, d] = [[-6.0, 0.0, 0.0], [-6.0, 4.0, 0.0], [-6.0, 4.0, 50.0], [-6.0, 0.0, 50.0]].map(DVec3::from);
    let flat = box_triangles(DVec3::ZERO, DVec3::new(0.0, 4.0, 70.0));
    let strays = [
        ("a point", vec![[DVec3::ZERO; 3]]),
        ("a sliver", vec![[DVec3::ZERO, 1e-9 * DVec3::X, 1e-9 * DVec3::Y]]),
        ("a needle", vec![[DVec3::ZERO, DVec3::Z * 90.0, DVec3::Z * 40.0]]),
        ("a sheet", vec![[a, b, c], [a, c, d]]),
        ("a flat shell", flat),
    ];
    for (name, stray) in strays {
        for (size, expected) in [(Size::Scale(1.0), 4.0), (Size::Scale(-1.0), 4.0), (Size::HeightMm(8.0), 8.0)] {
            let position_mm = DVec3::new(1.0, 2.0, 0.0);
            let placement = Placement { size, position_mm, ..Placement::default() };
            let before = mesh_of(&[cube.clone(), stray.clone()].concat());
            let corner = if size == Size::Scale(-1.0) { DVec3::splat(24.0) } else { DVec3::splat(20.0) };
            let (placed, matrix) = place(before, &placement).unwrap();
            let mut solid = close(placed).unwrap();
            let matrix = solid.settle(&placement) * matrix;
            let (low, high) = bounds(&solid.mesh.positions);
            assert!((low - position_mm).length() < 1e-9, "{name} {size:?}: {low}");
            assert!((high - low - DVec3::splat(expected)).length() < 1e-9, "{name} {size:?}: {low} {high}");
            assert!((matrix.transform_point3(corner) - position_mm).length() < 1e-9, "{name} {size:?}");
            assert!((solid.health.volume_mm3 / expected.powi(3) - 1.0).abs() < 1e-9, "{name} {size:?}");
            assert!((solid.health.area_mm2 / (6.0 * expected * expected) - 1.0).abs() < 1e-9, "{name} {size:?}");
            assert!(solid.outline().flatten().all(|p| p.cmpge(low - 1e-9).all() && p.cmple(high + 1e-9).all()));
        }
    }
    // A hole drilled by a box that faces inwards, which stands out of the cube.
    let drill = reversed(&box_triangles(DVec3::new(21.0, 21.0, 19.0), DVec3::new(23.0, 23.0, 25.0)));
    for (size, scale) in [(Size::Scale(1.0), 1.0), (Size::HeightMm(8.0), 2.0)] {
        let placement = Placement { size, ..Placement::default() };
        let (placed, matrix) = place(mesh_of(&[cube.clone(), drill.clone()].concat()), &placement).unwrap();
        let mut solid = close(placed).unwrap();
        let matrix = solid.settle(&placement) * matrix;
        let corners = solid.mesh.triangles.iter().flatten().map(|&v| solid.mesh.positions[v as usize]);
        let (low, high) = bounds(&corners.collect::<Vec<_>>());
        assert!(low.length() < 1e-9 && (high - DVec3::splat(4.0 * scale)).length() < 1e-9, "{low} {high}");
        assert!((matrix.transform_point3(DVec3::splat(20.0))).length() < 1e-9);
        assert!((solid.health.volume_mm3 / (48.0 * scale.powi(3)) - 1.0).abs() < 1e-9, "{size:?}");
    }
    // A sound mesh is not touched.
    let mut solid = close(mesh_of(&cube)).unwrap();
    assert_eq!(solid.settle(&Placement::default()), glam::DMat4::IDENTITY);
}
