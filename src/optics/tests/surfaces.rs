//! Boundaries as layers of the scalar model, against transport, which refracts every direction.

use rand_xoshiro::{
    Xoshiro256PlusPlus,
    rand_core::{Rng, SeedableRng},
};

use super::laws::resin;
use crate::{
    optics::{FrequencyGrid, Grains, MaterialSet, Model, ResinId, Stack, VolumeCoefficients, predict},
    watch::Unwatched,
};

/// Reduced scattering and absorption per mm of white, clear, magenta, yellow, cyan and black inks as printers have them
/// (rounded from a provisional fit to photographs of prints, red and green channels), n = 1.52.
const INKS: [(f64, f64); 8] =
    [(9.5, 0.006), (0.004, 0.009), (6.0, 0.03), (0.85, 2.35), (3.1, 1.07), (0.29, 14.6), (0.74, 1.6), (0.18, 22.0)];
const BLACK: ResinId = ResinId(7);

fn inks() -> MaterialSet {
    let grid = FrequencyGrid::linear(3, 2.0);
    let volume =
        |&(sigma_s, sigma_a): &(f64, f64)| VolumeCoefficients { sigma_s, sigma_a, g: 0.0, refractive_index: 1.52 };
    MaterialSet {
        name: "inks".into(),
        channels: vec!["Y".into()],
        resins: INKS.iter().enumerate().map(|(index, ink)| resin(index, volume(ink), &grid)).collect(),
        provenance: String::new(),
        grid,
        grains: Grains::FINE,
        warnings: Vec::new(),
    }
}

/// Relative errors of the albedo by the scalar model over random stacks on black, ascending; what is darker than 0.05
/// counts as 0.05.
fn errors(set: &MaterialSet, count: usize) -> Vec<f64> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1942);
    let mut uniform = move || (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let albedo =
        |stack: &Stack, model: &Model| predict(set, stack, model, &Unwatched).unwrap().light[0].reflection_hankel[0];
    let mut errors: Vec<f64> = (0..count)
        .map(|_| {
            let layers = 1 + (3.0 * uniform()) as usize;
            let mut layer = || (ResinId((uniform() * INKS.len() as f64) as usize), 0.1 * 16.0_f64.powf(uniform()));
            // White at the bottom, as most prints have it.
            let layers: Vec<_> = (0..layers).map(|_| layer()).chain([(ResinId(0), 2.0)]).collect();
            let stack = Stack::joined(layers).over(BLACK);
            let (scalar, exact) = (albedo(&stack, &Model::KubelkaMunk), albedo(&stack, &Model::REFLECTION));
            (scalar - exact).abs() / exact.max(0.05)
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    errors
}

/// With the surface as a layer, the scalar model's albedos of real inks are nearer to transport's by an order of
/// magnitude: without it they are up to three times as bright. What is left is light that has just been bent into a
/// thin dark layer, where it is no more diffuse than in the models' other thin layers.
#[test]
fn a_surface_is_a_layer() {
    let set = inks();
    let found = errors(&set, 40);
    let mut matched = set;
    matched.resins.iter_mut().for_each(|resin| resin.refractive_index = 1.0);
    let without = errors(&matched, 40);
    println!("with the surface: median {:.4}, worst {:.4}", found[20], found[39]);
    println!("without: median {:.4}, worst {:.4}", without[20], without[39]);
    assert!(found[20] < 0.1 * without[20], "{found:?} and {without:?}");
}
