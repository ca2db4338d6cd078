//! Laws of volume fractions: they are what lots are drawn by, and fill what is printed.

use super::{
    support::*,
    textured::{anything, noisy_box},
};
use glam::DVec3;
use lumislice::{
    appearance::{LayerField, LayerStack},
    slice::{ObjectField, Slicer},
    voxel::{BrickFractions, Lattice, MaterialId, ThresholdMask, WHOLE, Weights},
};
use proptest::prelude::*;

/// Every so many ranks are asked.
const STEP: usize = 64;

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Of all ranks as many get a resin as its fraction says, wherever texels of any stackings meet.
    #[test]
    fn fractions_are_the_shares_of_ranks(seed in any::<u64>()) {
        let mut random = Random::new(seed);
        let textured = anything(&mut random);
        let field = LayerField::Textured(Box::new(textured.layers.clone()));
        let (mut weights, mut parts, mut row) = (Weights::default(), Vec::new(), Vec::new());
        for _ in 0..8 {
            let triangle = random.below(textured.mesh.triangles.len()) as u32;
            let uv = textured.uv_on(&mut random, triangle);
            let depth = random.between(0.0, 1.5) as f32;
            textured.layers.bottoms(triangle, uv, &mut row);
            if row.iter().any(|bottom| (bottom - depth).abs() < 1e-4) {
                continue;
            }
            weights.clear();
            field.weigh(triangle, uv, |bottom| f64::from(u8::from(f64::from(depth) < bottom)), &mut weights);
            weights.round(&mut parts);
            prop_assert_eq!(parts.iter().map(|part| part.1).sum::<u16>(), WHOLE);
            let mut counts = [0; 256];
            for rank in (STEP / 2..ThresholdMask::LEVELS).step_by(STEP) {
                counts[usize::from(textured.layers.material(triangle, uv, depth, rank as u16).0)] += 1;
            }
            for (id, count) in (0..).zip(counts) {
                let counted = f64::from(count * STEP as u32) / ThresholdMask::LEVELS as f64;
                let fraction = parts.iter().find(|part| part.0 == MaterialId(id)).map_or(0, |part| part.1);
                let off = (f64::from(fraction) / f64::from(WHOLE) - counted).abs();
                prop_assert!(off < 2.5e-3, "{id}: {counted} of the ranks, {parts:?} at {depth} mm of {row:?}");
            }
        }
    }
}

const HIGH: DVec3 = DVec3::new(3.0, 2.6, 2.2);

/// A box whose layers vary from texel to texel.
fn noisy(dithered: bool) -> Slicer {
    let (solid, layers) = noisy_box(HIGH, 96, true);
    let lattice = Lattice::covering(HIGH, j750()).unwrap();
    let field = ObjectField::new(&solid, lattice, LayerField::Textured(Box::new(layers))).unwrap();
    Slicer::new(lattice, vec![if dithered { field.with_dithered_boundaries() } else { field }])
}

/// What is printed is full and the rest empty, what is printed is there, and all voxels of a resin are as many as its
/// fractions; but for so many `ties`. Returns how many bricks are of one composition.
fn fill_what_is_printed(slicer: &Slicer, ties: u64) -> usize {
    assert!(slicer.draws_by_lot());
    let lattice = slicer.lattice();
    let [width, height, depth] = lattice.dims;
    let (mut printed, mut filled) = ([0_u64; 5], [0_u64; 5]);
    let (mut strange, mut tiles) = (0, 0);
    let done: Result<(), std::convert::Infallible> = slicer.for_each_slab_with_fractions(
        0..depth,
        |_| true,
        |slab, fractions| {
            let fractions = fractions.unwrap();
            let (mut ids, mut row) = (vec![0; width as usize], vec![0; width as usize]);
            for (k, j) in slab.slices().flat_map(|k| (0..height).map(move |j| (k, j))) {
                slab.read_row(j, k, &mut ids);
                let mut sums = vec![0; width as usize];
                for id in 1..5_u8 {
                    fractions.read_row(MaterialId(id), j, k, &mut row);
                    for ((sum, fraction), printed) in sums.iter_mut().zip(&row).zip(&ids) {
                        *sum += fraction;
                        filled[usize::from(id)] += u64::from(*fraction);
                        strange += u32::from(*printed == id && *fraction == 0);
                    }
                }
                assert!(ids.iter().zip(sums).all(|(id, sum)| sum == if *id == 0 { 0 } else { WHOLE }), "{j} {k}");
                ids.iter().for_each(|id| printed[usize::from(*id)] += 1);
            }
            let bricks = [width, height].map(|dim| dim.div_ceil(8));
            for z in slab.slices().step_by(8).map(|k| k / 8) {
                let all = (0..bricks[1]).flat_map(|y| (0..bricks[0]).map(move |x| [x, y, z]));
                let is_tile = |at| matches!(fractions.brick(at), BrickFractions::Uniform(_));
                tiles += all.filter(|at| is_tile(*at)).count();
            }
            Ok(())
        },
    );
    let Ok(()) = done;
    let all: u64 = printed[1..].iter().sum();
    println!("{strange} of {all} voxels are of resins that are not there");
    assert!(u64::from(strange) <= ties, "{strange} of {all} voxels are of resins that are not there");
    for id in (1..5).filter(|id| filled[*id] > 0) {
        let expected = filled[id] as f64 / f64::from(WHOLE);
        let off = printed[id] as f64 / expected - 1.0;
        println!("{id}: {} voxels printed of {expected:.1} ({off:+.4})", printed[id]);
        assert!(off.abs() < 0.01, "{id}: {} voxels printed of {expected}", printed[id]);
    }
    tiles
}

#[test]
fn fractions_of_mixtures_fill_what_is_printed() {
    fill_what_is_printed(&noisy(false), 0);
}

#[test]
fn fractions_across_dithered_boundaries_fill_what_is_printed() {
    fill_what_is_printed(&noisy(true), 0);
}

#[test]
fn bricks_of_one_mixture_are_tiles() {
    let lattice = Lattice::covering(HIGH, j750()).unwrap();
    let grey = vec![(MaterialId(1), 0.9), (MaterialId(2), 0.1)];
    let layers = LayerStack::with_mixtures([(grey, 3.0)], MaterialId(3));
    let slicer = slicer_of(&solid_of(&box_triangles(DVec3::ZERO, HIGH)), lattice, layers);
    let whole = lattice.dims.map(|dim| dim as usize / 8 - 1).iter().product::<usize>();
    let tiles = fill_what_is_printed(&slicer, 0);
    assert!(tiles >= whole, "{tiles} tiles of {whole} bricks");
}

/// Two boxes side by side, each with a part of the bricks between them, and none joined to the other.
#[test]
fn bricks_of_one_mixture_in_two_objects_are_tiles() {
    let lattice = Lattice::covering(HIGH, j750()).unwrap();
    // In the middle of a brick: of its 8 voxels along x one object has 3 and the other 5.
    let border = lattice.pitch.x * (lattice.dims[0] / 16 * 8 + 3) as f64;
    let field = |low: f64, high: f64| {
        let grey = vec![(MaterialId(1), 0.9), (MaterialId(2), 0.1)];
        let layers = LayerField::Uniform(LayerStack::with_mixtures([(grey, 3.0)], MaterialId(3)));
        let solid = solid_of(&box_triangles(DVec3::new(low, 0.0, 0.0), DVec3::new(high, HIGH.y, HIGH.z)));
        ObjectField::new(&solid, lattice, layers).unwrap()
    };
    let slicer = Slicer::new(lattice, vec![field(0.0, border), field(border, HIGH.x)]);
    let whole = lattice.dims.map(|dim| dim as usize / 8 - 1).iter().product::<usize>();
    let tiles = fill_what_is_printed(&slicer, 0);
    assert!(tiles >= whole, "{tiles} tiles of {whole} bricks");
}
