//! Boundaries as layers of the scalar model, against transport, which refracts every direction.

use rand_xoshiro::{
    Xoshiro256PlusPlus,
    rand_core::{Rng, SeedableRng},
};

use crate::{
    optics::{Light, MaterialSet, Model, ResinId, Stack, TransportOptions, predict},
    watch::Unwatched,
};

/// A built-in set whose resins all bend light.
fn bent(name: &str, index: f64) -> MaterialSet {
    let mut set = MaterialSet::builtin(name).unwrap();
    for resin in &mut set.resins {
        resin.refractive_index = index;
        for volume in resin.channels.iter_mut().filter_map(|channel| channel.volume.as_mut()) {
            volume.refractive_index = index;
        }
    }
    set
}

fn albedos(set: &MaterialSet, stack: &Stack, model: &Model) -> Vec<f64> {
    predict(set, stack, model, &Unwatched).unwrap().light.iter().map(|light| light.reflection_hankel[0]).collect()
}

/// Relative errors of the albedo over random stacks of layers of 0.1 to 1.6 mm over black, ascending.
fn errors(set: &MaterialSet, count: usize) -> Vec<f64> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1942);
    let mut uniform = move || (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let black = set.resin("black").unwrap().0;
    let transport = Model::Transport { light: Light::Diffuse, options: TransportOptions { polar: 6, orders: 1 } };
    let mut errors = Vec::new();
    for _ in 0..count {
        let layers = 1 + (3.0 * uniform()) as usize;
        let mut layer = || (ResinId((uniform() * set.resins.len() as f64) as usize), 0.1 * 16.0_f64.powf(uniform()));
        let stack = Stack::joined((0..layers).map(|_| layer())).over(black);
        let [scalar, exact] = [Model::KubelkaMunk, transport].map(|model| albedos(set, &stack, &model));
        // What is darker than a blink of an eye can tell is not asked in percent.
        errors.extend(scalar.iter().zip(&exact).map(|(scalar, exact)| (scalar - exact).abs() / exact.max(0.05)));
    }
    errors.sort_by(f64::total_cmp);
    errors
}

/// Layers of white, black and support of n = 1.52 under air: with the surface as a layer, the scalar model's albedo is
/// nearer to transport's than without by an order of magnitude.
#[test]
fn a_surface_is_a_layer() {
    let set = bent("synthetic", 1.52);
    let errors = errors(&set, 40);
    let (median, worst) = (errors[errors.len() / 2], errors[errors.len() - 1]);
    println!("synthetic at n = 1.52: median {median:.4}, worst {worst:.4}");
    let colours = self::errors(&bent("inks-rgb-7", 1.52), 40);
    println!(
        "inks-rgb-7 at n = 1.52: median {:.4}, worst {:.4}",
        colours[colours.len() / 2],
        colours[colours.len() - 1]
    );
    assert!(median < 0.02 && worst < 0.1, "{errors:?}");
}
