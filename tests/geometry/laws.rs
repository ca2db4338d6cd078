//! Laws of the closest-point pipeline against brute force: triangles, hierarchy, cull, kernel.

use super::support::*;
use glam::{DMat3, DVec3, Vec3A};
use lumislice::{
    sdf::{
        BlockBox, BrickOffsets, BrickSurface, CullScratch, DepthRange, Surface, closest_point, cull, nearest_in_brick,
    },
    voxel::{BRICK_VOXELS, Lattice},
};
use proptest::prelude::*;

/// Distance to a triangle by searching it: the distance to the segment that is parallel to one edge is convex in how
/// far away that segment is. No cross products, hence no cancellation however thin the triangle is.
fn distance_by_search(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let to_segment = |t: f64| {
        let (from, to) = (a + (c - a) * t, b + (c - b) * t);
        let along = to - from;
        let length = along.length_squared();
        let s = if length > 0.0 { ((p - from).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
        (p - from - along * s).length()
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..200 {
        let third = (high - low) / 3.0;
        if to_segment(low + third) <= to_segment(high - third) {
            high -= third;
        } else {
            low += third;
        }
    }
    to_segment(low).min(to_segment(high)).min(to_segment((low + high) / 2.0))
}

/// A triangle with longest edge `length` and a height of `aspect` times that, anywhere within `spread` of the origin.
fn sliver(random: &mut Random, length: f64, aspect: f64, spread: f64) -> [DVec3; 3] {
    let turn: DMat3 = random.rotation();
    let at = random.vector() * spread;
    let foot = random.between(-0.2, 1.2).clamp(0.0, 1.0);
    let mut corners = [DVec3::ZERO, DVec3::X * length, DVec3::new(foot * length, aspect * length, 0.0)];
    let middle = DVec3::X * random.between(0.0, length);
    corners.rotate_left(random.below(3));
    corners.map(|corner| turn * (corner - middle) + at)
}

fn soup(random: &mut Random, count: usize, snapped: bool) -> Triangles {
    let snap = |p: DVec3| if snapped { (p * 4.0).round() / 4.0 } else { p };
    (0..count)
        .map(|_| {
            loop {
                let size = 0.05 + 3.0 * random.unit().powi(3);
                let at = random.vector() * 3.0;
                let triangle = match random.below(5) {
                    0 => sliver(random, 4.0, 0.01, 3.0),
                    _ => [at, at + random.vector() * size, at + random.vector() * size],
                }
                .map(snap);
                if (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).length() > 1e-6 {
                    return triangle;
                }
            }
        })
        .collect()
}

#[test]
fn thin_triangles_keep_their_distance() {
    let mut random = Random::new(3);
    let mut beyond = false;
    for (aspect, allowed) in [(1.0, 1e-12), (1e-3, 1e-11), (1e-5, 1e-9), (1e-7, 1e-7), (1e-9, 1e-6), (1e-11, 1e-6)] {
        let mut worst = 0.0_f64;
        for _ in 0..3000 {
            let triangle = sliver(&mut random, 60.0, aspect, 5.0);
            let near = triangle[random.below(3)];
            let [wa, wb, wc] = [0, 1, 2].map(|_| 0.01 + random.unit());
            let within = (triangle[0] * wa + triangle[1] * wb + triangle[2] * wc) / (wa + wb + wc);
            let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize();
            let p = match random.below(4) {
                0 => random.vector() * 30.0,
                1 => near + random.vector() * 0.3,
                // Over the triangle, where distances to its edges do not help.
                2 => within + normal * random.between(0.0, 5.0),
                _ => within + random.vector() * aspect,
            };
            let found = closest_point(p, &triangle).distance_squared.sqrt();
            worst = worst.max((found - distance_by_search(p, triangle)).abs());
        }
        println!("height {aspect:e} of the length of 60 mm: worst error {worst:.1e} mm");
        beyond |= worst > allowed;
    }
    assert!(!beyond);
}

/// 4 × 4 × 4 positions of a box, its corners among them.
fn positions(block: &BlockBox) -> impl Iterator<Item = DVec3> {
    let (centre, half) = (block.centre, block.half);
    let at = |n: usize| (n as f64 / 3.0) * 2.0 - 1.0;
    (0..64).map(move |n| centre + half * DVec3::new(at(n % 4), at(n / 4 % 4), at(n / 16)))
}

fn assert_cull_keeps(triangles: &[[DVec3; 3]], block: &BlockBox, list: &mut Vec<u32>, from: std::ops::Range<usize>) {
    let start = list.len();
    let range = cull(triangles, block, from, 0.0, list, &mut CullScratch::default());
    assert!(list[start..].is_sorted() && start < list.len());
    for p in positions(block) {
        let distances: Vec<f64> = triangles.iter().map(|t| closest_point(p, t).distance_squared.sqrt()).collect();
        let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
        for (index, distance) in (0_u32..).zip(&distances) {
            assert!(*distance > least + 1e-9 || list[start..].contains(&index), "{index} lost at {p}");
        }
        assert!(range.min <= least + 1e-12 && least <= range.max + 1e-12, "{least} at {p} is not in {range:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_cull_keeps_the_nearest(
        seed in any::<u64>(),
        count in 1..60usize,
        snapped in any::<bool>(),
        flat in any::<bool>(),
    ) {
        let mut random = Random::new(seed);
        let mut triangles = soup(&mut random, count, snapped);
        if flat {
            // Coplanar triangles and shared corners: ties everywhere.
            triangles.iter_mut().flatten().for_each(|p| p.z = 0.0);
            triangles.retain(|t| (t[1] - t[0]).cross(t[2] - t[0]).length() > 1e-6);
            prop_assume!(!triangles.is_empty());
        }
        let snap = |p: DVec3| if snapped { (p * 4.0).round() / 4.0 } else { p };
        let half = (random.vector() + 1.01) * random.between(0.05, 1.5);
        let block = BlockBox { centre: snap(random.vector() * 4.0), half };
        let mut list: Vec<u32> = (0..triangles.len() as u32).collect();
        let all = 0..list.len();
        assert_cull_keeps(&triangles, &block, &mut list, all);
        // And again in one of its eighths, from what is left.
        let kept = triangles.len()..list.len();
        let eighth = BlockBox { centre: block.centre + block.half / 2.0, half: block.half / 2.0 };
        assert_cull_keeps(&triangles, &eighth, &mut list, kept);
    }

    #[test]
    fn the_hierarchy_finds_the_nearest(
        seed in any::<u64>(),
        count in 1..80usize,
        snapped in any::<bool>(),
        far in any::<bool>(),
    ) {
        let mut random = Random::new(seed);
        let shift = if far { DVec3::new(9e5, -9e5, 1e5) } else { DVec3::ZERO };
        let soup = soup(&mut random, count, snapped);
        let triangles: Triangles = soup.into_iter().map(|t| t.map(|p| p + shift)).collect();
        let surface = Surface::new(&mesh_of(&triangles)).unwrap();
        for _ in 0..20 {
            let p = shift + random.vector() * 5.0;
            let p = if snapped { p.round() } else { p };
            let found = surface.closest(p);
            let squared = |t: &[DVec3; 3]| closest_point(p, t).distance_squared;
            let (nearest, least) = triangles.iter().map(squared).enumerate().fold(
                (0, f64::INFINITY), |best, (index, d)| if d < best.1 { (index, d) } else { best });
            prop_assert_eq!(found.triangle as usize, nearest);
            prop_assert_eq!(found.distance, least.sqrt());
            let [wa, wb, wc] = found.barycentric;
            let [a, b, c] = triangles[nearest];
            let scale = 1.0 + shift.length();
            prop_assert!((a * wa + b * wb + c * wc - found.point).length() < 1e-12 * scale);
            let mut within = Vec::new();
            let radius = found.distance + random.unit();
            surface.within(p, radius, &mut within);
            let near = (0..).zip(&triangles).filter(|(_, t)| squared(t) <= radius * radius);
            let expected: Vec<u32> = near.map(|(i, _)| i).collect();
            prop_assert_eq!(within, expected);
        }
    }
}

#[test]
fn one_triangle_makes_a_hierarchy() {
    let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let surface = Surface::new(&mesh_of(&[triangle])).unwrap();
    assert_eq!(surface.closest(DVec3::new(0.25, 0.25, 2.0)).distance, 2.0);
    assert_eq!(surface.closest(DVec3::splat(1e6)).triangle, 0);
    assert!(Surface::new(&Default::default()).is_none());
}

/// The builder of the hierarchy gives the same bytes whenever and on however many threads it runs.
#[test]
fn the_hierarchy_is_built_the_same_every_time() {
    use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::builder::build_bvh2};
    let mut random = Random::new(4);
    let boxes: Vec<Aabb> = soup(&mut random, 20_000, false)
        .iter()
        .map(|t| {
            let (low, high) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
            Aabb::new(Vec3A::from(low.as_vec3()), Vec3A::from(high.as_vec3()))
        })
        .collect();
    let build = || {
        let bvh = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Default::default());
        let nodes: Vec<_> = bvh
            .nodes
            .iter()
            .map(|n| {
                (
                    n.aabb().min.to_array().map(f32::to_bits),
                    n.aabb().max.to_array().map(f32::to_bits),
                    n.prim_count,
                    n.first_index,
                )
            })
            .collect();
        (nodes, bvh.primitive_indices)
    };
    let first = build();
    assert_eq!(first, build());
    for threads in [1, 2, 3] {
        assert_eq!(first, rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(build));
    }
}

/// One brick about `centre` with the positions of its voxels in double precision.
fn brick(pitch: DVec3, centre: DVec3) -> (BrickOffsets, Vec<DVec3>) {
    let offsets = BrickOffsets::new(&Lattice { origin: DVec3::ZERO, pitch, dims: [8; 3] });
    let at = |n: usize, axis: usize| (n as f64 - 3.5) * pitch[axis];
    let positions = (0..BRICK_VOXELS).map(|v| centre + DVec3::new(at(v % 8, 0), at(v / 8 % 8, 1), at(v / 64, 2)));
    (offsets, positions.collect())
}

/// The largest error of the kernel's distances to one triangle, in units of its reach times ε.
fn worst_ulps(triangle: [DVec3; 3], centre: DVec3, pitch: DVec3) -> f64 {
    let (offsets, positions) = brick(pitch, centre);
    let mut found = BrickSurface::default();
    nearest_in_brick(&[triangle], &[0], centre, &offsets, &mut found);
    let reach = triangle.iter().map(|c| (*c - centre).abs().max_element()).fold(0.0, f64::max);
    let mut worst = 0.0_f64;
    for (distance, p) in found.distance.into_iter().zip(positions) {
        let exact = closest_point(p, &triangle).distance_squared.sqrt();
        worst = worst.max((f64::from(distance) - exact).abs());
    }
    assert!(worst <= f64::from(found.error), "{worst} over {} from {triangle:?} at {centre}", found.error);
    worst / (reach * f64::from(f32::EPSILON))
}

/// Triangles of all shapes around a brick: (name, worst error in ulps).
fn kernel_errors(cases: usize) -> Vec<(String, f64)> {
    let mut random = Random::new(5);
    let mut results = Vec::new();
    for (length, aspect) in
        [(0.5, 0.6), (6.0, 0.3), (60.0, 0.5), (60.0, 1e-2), (60.0, 1e-4), (60.0, 1e-6), (60.0, 1e-8)]
    {
        for spread in [0.1, 3.0] {
            let mut worst = 0.0_f64;
            for case in 0..cases {
                let mut triangle = sliver(&mut random, length, aspect, spread);
                if case % 4 == 0 {
                    // A corner within the brick.
                    let shift = triangle[random.below(3)] + random.vector() * 0.1;
                    triangle = triangle.map(|p| p - shift);
                } else if case % 4 == 1 {
                    // The brick beyond a corner, in line with an edge, where a sliver's halfplanes meet.
                    let corner = random.below(3);
                    let from = triangle[(corner + 1 + random.below(2)) % 3];
                    let shift = triangle[corner] + (triangle[corner] - from) * random.unit();
                    triangle = triangle.map(|p| p - shift);
                }
                let centre = random.vector() * 60.0;
                let pitch = if case % 2 == 0 { j750() } else { DVec3::splat(0.1) };
                worst = worst.max(worst_ulps(triangle.map(|p| p + centre), centre, pitch));
            }
            results.push((format!("{length} mm long, {aspect:e} as high, {spread} mm off"), worst));
        }
    }
    results
}

#[test]
fn the_kernel_stays_within_its_error() {
    for (what, worst) in kernel_errors(120) {
        println!("{what}: {worst:.2} ulps");
    }
}

#[test]
#[ignore = "slow: 14 million distances; measures ERROR_ULPS of the kernel"]
fn the_kernel_stays_within_its_error_at_length() {
    for (what, worst) in kernel_errors(4000) {
        println!("{what}: {worst:.2} ulps");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Of several triangles the kernel picks a nearest one, the first where they tie exactly.
    #[test]
    fn the_kernel_picks_a_nearest(seed in any::<u64>(), count in 1..12usize) {
        let mut random = Random::new(seed);
        let mut triangles = soup(&mut random, count, false);
        triangles.push(triangles[0]);
        let candidates: Vec<u32> = (0..triangles.len() as u32).collect();
        let (offsets, positions) = brick(j750(), DVec3::ZERO);
        let mut found = BrickSurface::default();
        nearest_in_brick(&triangles, &candidates, DVec3::ZERO, &offsets, &mut found);
        for (voxel, p) in positions.into_iter().enumerate() {
            let chosen = found.candidate[voxel] as usize;
            prop_assert!(chosen != count, "the last is the first once more");
            let exact = closest_point(p, &triangles[chosen]).distance_squared.sqrt();
            prop_assert!(exact <= distance(&triangles, p) + 2.0 * f64::from(found.error));
        }
    }
}

/// How many candidates the cull leaves per round, and what the range is worth: figures for `cull::ROUNDS`.
#[test]
fn a_range_is_never_empty() {
    let triangles = sphere(DVec3::ZERO, 10.0, 12);
    let mut list: Vec<u32> = (0..triangles.len() as u32).collect();
    let all = 0..list.len();
    let block = BlockBox { centre: DVec3::new(3.0, 2.0, 1.0), half: DVec3::splat(0.3) };
    let DepthRange { min, max } = cull(&triangles, &block, all, 0.0, &mut list, &mut CullScratch::default());
    assert!(min < max && max - min < 4.0 * block.radius());
}
