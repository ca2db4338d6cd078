use glam::{DVec3, IVec2, IVec3};

use super::{Numbers, icosphere};
use crate::test_shapes::box_triangles;
use crate::{
    sdf::{Cells, FeatureWindow, Reach, SurfaceVoxels, cell_centre, closest_point, for_cells},
    voxel::Lattice,
};

/// The transform of arbitrary features in a box of `size`, against the definition.
#[test]
fn the_transform_is_exact() {
    let mut numbers = Numbers(1);
    for round in 0..60 {
        let mut pick = |n: f64| (numbers.next() * n) as i32;
        let size = IVec3::new(1 + pick(9.0), 1 + pick(9.0), 1 + pick(9.0));
        let features: Vec<IVec3> = (0..pick(12.0)).map(|_| IVec3::new(pick(9.0), pick(9.0), pick(9.0))).collect();
        let pitch = numbers.point(DVec3::splat(0.2), DVec3::splat(1.0));
        let reach = if round % 2 == 0 { 100.0 } else { 2.0 };
        let nearest = |x: i32, y: i32, z: i32| {
            let column = features.iter().filter(|f| f.x == x && f.y == y).map(|f| f.z);
            column.min_by_key(|f| (f - z).abs())
        };
        let mut window = FeatureWindow::default();
        let columns = [IVec2::ZERO, IVec2::splat(9)];
        let sizes = size.to_array().map(|n| n as usize);
        let first = IVec3::new(1, 2, 0);
        window.compute(pitch, first, sizes, Reach { columns, distance: reach }, nearest);
        for n in 0..sizes.iter().product::<usize>() {
            let (x, y, z) = (n % sizes[0], n / sizes[0] % sizes[1], n / (sizes[0] * sizes[1]));
            let at = first + IVec3::new(x as i32, y as i32, z as i32);
            let distance = |f: IVec3| ((f - at).as_dvec3() * pitch).length();
            let expected = features.iter().map(|&f| distance(f)).fold(f64::INFINITY, f64::min);
            match window.feature(at) {
                Some(found) => {
                    assert!(features.contains(&found));
                    assert!(distance(found) - expected < 1e-12 || expected > reach);
                }
                None => assert!(expected > reach),
            }
        }
    }
}

fn touched(lattice: &Lattice, triangle: &[DVec3; 3]) -> Vec<IVec3> {
    let everywhere = Cells { low: IVec3::MIN, high: IVec3::MAX };
    let mut found = Vec::new();
    for_cells(lattice, triangle, &everywhere, |_, _| true, |cell| found.push(cell));
    found
}

#[test]
fn triangles_touch_the_cells_they_pass_through() {
    let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::new(0.3, 0.5, 0.2), dims: [20; 3] };
    let mut numbers = Numbers(5);
    for _ in 0..40 {
        let triangle: [DVec3; 3] = std::array::from_fn(|_| numbers.point(DVec3::splat(-1.0), DVec3::splat(4.0)));
        let found = touched(&lattice, &triangle);
        for _ in 0..300 {
            // Every point of the triangle lies in a cell that was found …
            let (mut u, mut v) = (numbers.next(), numbers.next());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let p = triangle[0] + u * (triangle[1] - triangle[0]) + v * (triangle[2] - triangle[0]);
            assert!(found.contains(&(p / lattice.pitch).floor().as_ivec3()));
        }
        for cell in &found {
            // … and every cell found has the triangle within half a diagonal of its centre, once.
            let distance = closest_point(cell_centre(&lattice, *cell), &triangle).distance_squared.sqrt();
            assert!(distance <= lattice.pitch.length() / 2.0 + 1e-8);
            assert_eq!(found.iter().filter(|other| *other == cell).count(), 1);
        }
    }
}

/// A slab's columns against the surface voxels one by one, slabs thinner and thicker than a word.
#[test]
fn columns_know_their_nearest_surface_voxel() {
    let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::new(0.2, 0.25, 0.04), dims: [25, 20, 150] };
    let triangles = icosphere(DVec3::new(2.5, 2.5, 3.0), 2.3, 2);
    let all: Vec<IVec3> = triangles.iter().flat_map(|t| touched(&lattice, t)).collect();
    for (slices, reach) in [(0..8, 1.0), (40..48, 0.5), (64..144, 20.0), (10..140, 3.0)] {
        let mut voxels = SurfaceVoxels::default();
        voxels.rebuild(&triangles, &lattice, slices.clone(), reach);
        let [low, high] = voxels.bounds();
        for x in low.x..high.x {
            for y in (low.y..high.y).step_by(3) {
                let column: Vec<i32> = all.iter().filter(|f| f.x == x && f.y == y).map(|f| f.z).collect();
                for z in slices.clone() {
                    let z = z as i32;
                    let expected = column.iter().map(|f| (f - z).abs()).min();
                    let found = voxels.nearest(x, y, z);
                    if let Some(found) = found {
                        assert!(column.contains(&found));
                    }
                    if expected.is_some_and(|n| f64::from(n) * lattice.pitch.z <= reach) {
                        assert_eq!(found.map(|f| (f - z).abs()), expected);
                    }
                }
            }
        }
    }
}

/// Exact and grid distance differ by at most half a diagonal, for every voxel, inside and outside.
#[test]
fn the_error_stays_within_half_a_diagonal() {
    let pitch = DVec3::new(0.11, 0.17, 0.07);
    let shapes = [
        icosphere(DVec3::splat(1.6), 1.5, 3),
        box_triangles(DVec3::new(0.1, 0.17, 0.2), DVec3::new(3.0, 2.9, 2.8)),
        // Too thin for its walls to hold a voxel's centre.
        box_triangles(DVec3::new(0.5, 0.5, 1.41), DVec3::new(2.5, 2.5, 1.43)),
    ];
    for triangles in shapes {
        let lattice = Lattice { origin: DVec3::ZERO, pitch, dims: [30, 20, 48] };
        let (mut voxels, mut window) = (SurfaceVoxels::default(), FeatureWindow::default());
        let (reach, mut worst) = (3.0, 0.0_f64);
        for slab in 0..6 {
            voxels.rebuild(&triangles, &lattice, 8 * slab..8 * (slab + 1), reach);
            let first = IVec3::new(0, 0, 8 * slab as i32);
            let from = Reach { columns: voxels.bounds(), distance: reach };
            window.compute(pitch, first, [30, 20, 8], from, |x, y, z| voxels.nearest(x, y, z));
            for n in (0..30 * 20 * 8).step_by(7) {
                let at = first + IVec3::new(n % 30, n / 30 % 20, n / 600);
                let p = cell_centre(&lattice, at);
                let exact =
                    triangles.iter().map(|t| closest_point(p, t).distance_squared).fold(f64::INFINITY, f64::min);
                if let Some(feature) = window.feature(at) {
                    let grid = ((feature - at).as_dvec3() * pitch).length();
                    worst = worst.max((grid - exact.sqrt()).abs());
                } else {
                    assert!(exact.sqrt() > reach - pitch.length() / 2.0);
                }
            }
        }
        println!("grid against exact: at most {worst:.4} mm, half a diagonal is {:.4} mm", pitch.length() / 2.0);
        assert!(worst <= pitch.length() / 2.0, "{worst}");
        // The bound is no idle one.
        assert!(worst > pitch.length() / 5.0, "{worst}");
    }
}
