//! Signed distances against brute force, and against a ball's; trees; fractions in bricks; names of grids.

use glam::DVec3;

use super::{
    DISTANCE, IDS, Piece,
    distance::{Cell, Distances},
    fractions::pieces,
    tree::{Inactive, Leaf, Tree},
};
use crate::{
    container::{Content, ContentResin},
    voxel::{BRICK, BRICK_VOXELS, BrickFractions, Lattice, MaterialId, WHOLE},
    watch::Unwatched,
};

/// Whether voxels are inside, x fastest.
struct Solid {
    lattice: Lattice,
    inside: Vec<bool>,
}

impl Solid {
    fn new(dims: [u32; 3], pitch: [f64; 3], is_inside: impl Fn([u32; 3]) -> bool) -> Self {
        let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::from(pitch), dims };
        let [nx, ny, nz] = dims;
        let all = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        Self { lattice, inside: all.map(is_inside).collect() }
    }

    fn is_inside(&self, at: [i32; 3]) -> bool {
        let [nx, ny, _] = self.lattice.dims.map(|dim| dim as usize);
        let within = (0..3).all(|axis| (0..self.lattice.dims[axis] as i32).contains(&at[axis]));
        let [x, y, z] = at.map(|index| index as usize);
        within && self.inside[x + nx * (y + ny * z)]
    }

    /// Its distances, and half of their band's width.
    fn distances(&self) -> (Tree, f32) {
        let mut distances = Distances::new(&self.lattice).unwrap();
        let [bx, by, bz] = self.lattice.dims.map(|dim| dim.div_ceil(BRICK as u32) as i32);
        for z in 0..bz {
            let layer = (0..by).flat_map(|y| (0..bx).map(move |x| [x, y, z]));
            let cell = |brick: [i32; 3]| {
                let ids: [u8; BRICK_VOXELS] = std::array::from_fn(|n| {
                    let within = [n % BRICK, n / BRICK % BRICK, n / (BRICK * BRICK)];
                    // A resin other than the first is inside too.
                    7 * u8::from(self.is_inside([0, 1, 2].map(|axis| 8 * brick[axis] + within[axis] as i32)))
                });
                if ids == [0; BRICK_VOXELS] { Cell::Outside } else { Cell::of(&ids) }
            };
            distances.take(layer.map(cell).collect()).unwrap();
        }
        distances.finish().unwrap();
        (distances.tree().clone(), distances.half_width())
    }

    /// The distance of a voxel's centre from the nearest voxel of the other kind, by all of them within the band.
    fn brute(&self, at: [i32; 3], half_width: f64) -> f64 {
        let pitch = self.lattice.pitch;
        let reach = (half_width / pitch).ceil().as_ivec3().to_array();
        let mut least = f64::INFINITY;
        for dz in -reach[2]..=reach[2] {
            for dy in -reach[1]..=reach[1] {
                for dx in -reach[0]..=reach[0] {
                    if self.is_inside([at[0] + dx, at[1] + dy, at[2] + dz]) != self.is_inside(at) {
                        let way = (DVec3::new(dx.into(), dy.into(), dz.into()).abs() - 0.5).max(DVec3::ZERO) * pitch;
                        least = least.min(way.length());
                    }
                }
            }
        }
        least
    }

    /// Every voxel of the lattice and some around it against `brute`; how many are active.
    fn check(&self) -> u64 {
        let (tree, half_width) = self.distances();
        let wide = f64::from(half_width);
        let beyond = (DVec3::splat(wide) / self.lattice.pitch).ceil().as_ivec3() + 2;
        let span = |axis: usize| -beyond[axis]..self.lattice.dims[axis] as i32 + beyond[axis];
        let mut active = 0;
        for (z, y, x) in span(2).flat_map(|z| span(1).flat_map(move |y| span(0).map(move |x| (z, y, x)))) {
            let at = [x, y, z];
            let (found, is_active) = tree.value(at);
            active += u64::from(is_active);
            assert_eq!(found < 0.0, self.is_inside(at), "{at:?}");
            let expected = self.brute(at, wide);
            if is_active {
                // 16 bits round to one part in 2048.
                assert!((f64::from(found.abs()) - expected).abs() <= expected / 2000.0, "{at:?}: {found}, {expected}");
            } else {
                assert_eq!(found.abs(), half_width, "{at:?}");
                assert!(expected > wide * 0.9995, "{at:?}: {expected}");
            }
        }
        assert_eq!(tree.active().0, active);
        active
    }
}

fn noise(at: [u32; 3]) -> u32 {
    let mut state = at.iter().fold(7_u32, |state, index| (state ^ index).wrapping_mul(0x9e37_79b1).rotate_left(13));
    state ^= state >> 15;
    state.wrapping_mul(0x85eb_ca6b) >> 16
}

#[test]
fn distances_are_those_of_brute_force_for_any_voxels() {
    for (dims, pitch) in [
        ([21, 19, 27], [0.1, 0.1, 0.1]),
        ([20, 11, 37], [0.0423, 0.0847, 0.014]),
        ([17, 25, 9], [0.1, 0.2, 0.9]),
        ([9, 8, 7], [0.1, 1.4, 1.5]),
    ] {
        for of_a_hundred in [2, 50, 97] {
            let solid = Solid::new(dims, pitch, |at| noise(at) % 100 < of_a_hundred);
            assert!(solid.inside.contains(&true) && solid.check() > 0);
        }
    }
}

#[test]
fn far_inside_and_far_outside_hold_no_active_voxels_and_have_their_signs() {
    // A hollow box, larger than a node of 128 voxels along z, whose walls are thicker than the band.
    let walls = |at: [u32; 3]| {
        let within = |axis: usize, low: u32, high: u32| (low..high).contains(&at[axis]);
        !(within(0, 24, 33) && within(1, 24, 33) && within(2, 60, 90))
    };
    let solid = Solid::new([56, 56, 150], [0.1; 3], walls);
    let active = solid.check();
    // Three voxels to either side of each face: less at the edges outside, more at those inside.
    let (outer, inner) = (2 * 56 * (56 + 2 * 150), 2 * 9 * (9 + 2 * 30));
    let sides = f64::from(outer + inner);
    assert!((5.8 * sides..6.2 * sides).contains(&(active as f64)), "{active}, {sides}");
    let nothing = Solid::new([9, 9, 9], [0.1; 3], |_| false).distances().0;
    assert!(nothing.is_empty());
}

/// What the documentation says of distances from the mesh: off by up to half of a voxel's diagonal.
#[test]
fn distances_of_a_ball_are_its_surface_s_within_half_a_voxel() {
    for pitch in [[0.1; 3], [0.0423, 0.0847, 0.027]] {
        let pitch = DVec3::from(pitch);
        let radius = 1.5;
        let dims = (2.0 * radius / pitch).ceil().as_uvec3().to_array();
        let from_middle = |at: [f64; 3]| ((DVec3::from(at) + 0.5) * pitch - radius).length() - radius;
        let solid = Solid::new(dims, pitch.to_array(), |at| from_middle(at.map(f64::from)) < 0.0);
        let (tree, _) = solid.distances();
        let (mut worst, mut count) = (0.0_f64, 0);
        let span = |axis: usize| -4..dims[axis] as i32 + 4;
        for (z, y, x) in span(2).flat_map(|z| span(1).flat_map(move |y| span(0).map(move |x| (z, y, x)))) {
            let (found, is_active) = tree.value([x, y, z]);
            if is_active {
                worst = worst.max((f64::from(found) - from_middle([x, y, z].map(f64::from))).abs());
                count += 1;
            }
        }
        let bound = pitch.length() / 2.0;
        assert!(worst <= bound && worst > 0.3 * bound && count > 10_000, "{pitch}: {worst} of {bound}, {count}");
    }
}

#[test]
fn voxels_like_needles_have_no_distances() {
    let lattice = |pitch: [f64; 3]| Lattice { origin: DVec3::ZERO, pitch: DVec3::from(pitch), dims: [4; 3] };
    for pitch in [[0.1, 0.1, 1.7], [0.1, 1.7, 1.7], [0.001, 10.0, 10.0]] {
        assert!(Distances::new(&lattice(pitch)).is_none(), "{pitch:?}");
    }
    for pitch in [[0.1, 0.1, 1.59], [0.1, 1.59, 1.59], [1.0; 3]] {
        assert!(Distances::new(&lattice(pitch)).is_some(), "{pitch:?}");
    }
}

/// Leaves and tiles of several nodes and two upper ones, by their numbers.
#[test]
fn a_tree_is_written_alike_whatever_order_its_bricks_came_in() {
    let place = |n: u32| [n as i32 % 5 - 2, n as i32 / 5 % 7, n as i32 / 35 * 90];
    let written = |order: &[u32]| {
        let mut tree = Tree::default();
        for &n in order {
            match n % 3 {
                0 => tree.set_tile(place(n), n as i32),
                _ => {
                    let mask = std::array::from_fn(|word| u64::from(n + 1) << word);
                    let values = Some(vec![n as u8; 3]);
                    tree.set_leaf(place(n), Leaf { mask, values, inactive: Inactive::Background });
                }
            }
        }
        tree.sort();
        let (mut topology, mut values) = (Vec::new(), Vec::new());
        tree.write_topology(&mut topology, &Unwatched).unwrap();
        tree.write_values(&mut values, &vec![Vec::new(); BRICK_VOXELS + 1], &Unwatched).unwrap();
        [topology, values]
    };
    let in_order: Vec<u32> = (0..210).collect();
    let expected = written(&in_order);
    // Steps that have no divisor in common with 210 come to all of them.
    for step in [11, 67, 209] {
        let shuffled: Vec<u32> = in_order.iter().map(|n| (n * step + 17) % 210).collect();
        assert!(written(&shuffled) == expected, "{step}");
    }
    // The leaf of the least index along x, then y, then z in the first node of 16³.
    let in_file = |n: &u32| (place(*n).map(|index| index >> 4), place(*n));
    let least = in_order.into_iter().filter(|n| n % 3 != 0).min_by_key(in_file).unwrap();
    let mask: Vec<u8> = (0..8).flat_map(|word| (u64::from(least + 1) << word).to_le_bytes()).collect();
    assert_eq!(expected[1][..64], mask);
    assert_eq!(expected[1][64..68], [0, least as u8, least as u8, least as u8]);
}

#[test]
fn bricks_of_fractions_are_tiles_or_leaves_of_what_is_there() {
    let [white, black] = [1, 2].map(MaterialId);
    assert!(pieces(&BrickFractions::Empty).unwrap().is_empty());
    let tiles = pieces(&BrickFractions::Uniform(vec![(white, 9000), (black, 1000)])).unwrap();
    for ((grid, piece), (resin, fraction)) in tiles.iter().zip([(1, 0.9_f32), (2, 0.1)]) {
        assert_eq!(*grid, resin);
        assert!(matches!(piece, Piece::Tile(bits) if *bits as u32 == fraction.to_bits()));
    }
    let mut brick = BrickFractions::default();
    brick.set(0, &[(white, WHOLE)]);
    brick.set(511, &[(white, 2500), (black, 7500)]);
    let leaves = pieces(&brick).unwrap();
    let active = |grid: usize| {
        let piece = leaves.iter().find(|found| found.0 == grid).map(|found| &found.1);
        let Some(Piece::Leaf(leaf)) = piece else { panic!("no leaf of {grid}") };
        (leaf.mask.iter().map(|word| word.count_ones()).sum::<u32>(), leaf.values.is_some())
    };
    assert_eq!([active(1), active(2)], [(2, true), (1, true)]);
    let mut whole = BrickFractions::default();
    whole.set(9, &[(black, WHOLE)]);
    let ones = pieces(&whole).unwrap();
    assert!(matches!(&ones[..], [(2, Piece::Leaf(leaf))] if leaf.values.is_none()));
}

#[test]
fn grids_of_ours_have_names_unlike_resins() {
    let resin = |name: &str| ContentResin { id: MaterialId(1), name: name.to_owned(), rgba: [9; 4] };
    let content = Content {
        name: "job".to_owned(),
        lattice: Lattice { origin: DVec3::ZERO, pitch: DVec3::ONE, dims: [1; 3] },
        resins: ["white", "distance", "distance_"].map(resin).to_vec(),
        max_colors: None,
        fractions: false,
    };
    assert_eq!([IDS, DISTANCE].map(|name| content.free_name(name)), ["material", "distance__"]);
}
