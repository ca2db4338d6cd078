//! Vector code and what it may leave out: the same bits as one by one.

use glam::DVec3;

use super::Numbers;
use crate::{
    sdf::{
        BrickOffsets, BrickSurface, Part,
        closest_many::{LANES, Pairs},
        closest_point, nearest_in_brick, nearest_in_parts,
    },
    voxel::{BRICK_VOXELS, Lattice},
};

/// Triangles around the origin, at all distances, of all shapes, with shared corners: the ties that must not change
/// hands.
fn patch(numbers: &mut Numbers, count: usize) -> Vec<[DVec3; 3]> {
    let away = DVec3::splat(0.05 + 2.0 * numbers.next());
    let spread = DVec3::splat(0.1 + numbers.next());
    let mut corners = [0; 3].map(|_| numbers.point(away - spread, away + spread));
    let mut triangles = Vec::new();
    for n in 0..count {
        let thin = if n % 5 == 0 { 1e-4 } else { 1.0 };
        corners[n % 3] =
            corners[(n + 1) % 3] + thin * (numbers.point(away - spread, away + spread) - corners[(n + 1) % 3]);
        triangles.push(corners);
    }
    triangles
}

#[test]
fn parts_change_no_bit_of_what_is_nearest() {
    let mut numbers = Numbers(7);
    let (mut whole, mut one) = (BrickSurface::default(), BrickSurface::default());
    let (mut kept_in_parts, mut all_in_parts) = (0, 0);
    for round in 0..300 {
        let pitch =
            if round % 2 == 0 { DVec3::new(0.0423, 0.0847, 0.027) } else { DVec3::splat(0.1 * numbers.next() + 0.01) };
        let offsets = BrickOffsets::new(&Lattice { origin: DVec3::ZERO, pitch, dims: [8; 3] });
        let triangles = patch(&mut numbers, 1 + round % 40);
        let candidates: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut least = [f32::INFINITY; BRICK_VOXELS];
        let mut alone = Vec::new();
        for &candidate in &candidates {
            nearest_in_brick(&triangles, &[candidate], DVec3::ZERO, &offsets, &mut one);
            alone.push(one.distance);
            for (least, distance) in least.iter_mut().zip(one.distance) {
                *least = least.min(distance);
            }
        }
        nearest_in_brick(&triangles, &candidates, DVec3::ZERO, &offsets, &mut whole);
        for (voxel, least) in least.iter().enumerate() {
            assert_eq!(whole.distance[voxel].to_bits(), least.to_bits(), "round {round}, voxel {voxel}");
            assert_eq!(alone[whole.candidate[voxel] as usize][voxel].to_bits(), least.to_bits());
        }
        // What is said of a part holds for its voxels, and a part that is settled is not touched.
        one.distance.fill(-1.0);
        nearest_in_parts(
            &triangles,
            &candidates,
            DVec3::ZERO,
            &offsets,
            &mut one,
            |_| true,
            |part, kept, range| {
                for voxel in part.bytes().flat_map(|byte| byte * 8..byte * 8 + 8) {
                    assert!(kept.contains(&whole.candidate[voxel]));
                    assert!((range.min..=range.max).contains(&f64::from(least[voxel])));
                }
                kept_in_parts += kept.len();
                all_in_parts += candidates.len();
                part.index() % 2 == 0
            },
        );
        for part in Part::all() {
            let mut voxels = part.rows().flatten();
            assert!(voxels.all(|voxel| one.distance[voxel] == if part.index() % 2 == 0 { -1.0 } else { least[voxel] }));
        }
    }
    assert!(kept_in_parts * 2 < all_in_parts, "{kept_in_parts} of {all_in_parts} are kept");
}

#[test]
fn eight_at_once_are_the_closest_points_one_by_one() {
    let mut numbers = Numbers(11);
    for _ in 0..2000 {
        let mut pairs = Pairs::EMPTY;
        let triangles = patch(&mut numbers, LANES);
        let positions = [(); LANES].map(|()| numbers.point(DVec3::splat(-1.0), DVec3::splat(3.0)));
        // On a corner the distance is 0.
        let positions: Vec<DVec3> =
            positions.iter().enumerate().map(|(n, p)| if n == 3 { triangles[3][1] } else { *p }).collect();
        for (lane, triangle) in triangles.iter().enumerate() {
            pairs.set_triangle(lane, triangle);
            pairs.set_position(lane, positions[lane]);
        }
        let found = pairs.closest();
        for (lane, triangle) in triangles.iter().enumerate() {
            let one = closest_point(positions[lane], triangle);
            let distance = one.distance_squared.sqrt();
            let gradient = if distance > 0.0 { (positions[lane] - one.point) / distance } else { DVec3::ZERO };
            assert_eq!(found.distance[lane].to_bits(), distance.to_bits());
            assert_eq!(found.gradient.map(|axis| axis[lane]), gradient.to_array());
        }
    }
}
