//! What holds whatever the data.

use super::patch::{Patch, Random};
use crate::appearance::bssrdf::{
    BssrdfError, Channel, FactorOptions, Factors, Freedom, Planes, Rings, factor,
    kernel::Variance,
    operator::{Operator, Prior},
    passes::Model,
    shape::nodes,
};
use crate::watch::{Interrupt, Unwatched, Watch};

fn fit(patch: &Patch, values: &[f32], more: &str) -> Factors {
    let folder = patch.write(values, more);
    factor(&folder.open(), Channel::Stored(0), &FactorOptions::default(), &Unwatched).unwrap()
}

#[test]
fn thread_count_changes_no_byte() {
    let patch = Patch { height: 40, noise: [0.05, 1e-3], ..Patch::SMALL };
    let values = patch.responses(7);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fit(&patch, &values, ""))
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one.root, three.root);
    assert_eq!((one.global, one.misses), (three.global, three.misses));
}

/// The normal operator is symmetric and positive, with and without the prior.
#[test]
fn the_operator_is_symmetric() {
    let (width, height) = (11, 9);
    let rings = Rings::new(9, 7, 0.1);
    let mut random = Random::new(3);
    let mut planes = |low: f64, high: f64| {
        let mut planes = Planes::new(rings.len(), width, height, 0.0);
        planes.data.iter_mut().for_each(|value| *value = (low + (high - low) * random.unit()) as f32);
        planes
    };
    let (availability, outside) = (planes(0.0, 1.0), planes(0.0, 0.2));
    let (p, q) = (planes(-1.0, 1.0), planes(-1.0, 1.0));
    let mut roots = Planes::new(rings.distances_mm.len(), width, height, 0.0);
    roots.data.iter_mut().for_each(|value| *value = (0.5 + random.unit()) as f32);
    let global: Vec<f32> = rings.distances_mm.iter().map(|r| (-5.0 * r).exp() as f32).collect();
    let nodes = nodes(&rings);
    let model = Model { global: &global, roots: &roots, nodes: &nodes };
    for tied in [false, true] {
        let operator = Operator {
            rings: &rings,
            model: &model,
            variance: Variance { constant: 1e-3, linear: 1e-4, square: 0.01 },
            availability: &availability,
            outside: &outside,
            prior: Prior { second: 3.0, first: 1.0, value: 0.1 },
            tied,
        };
        let apply = |p: &Planes| {
            let mut out = p.map(|_| 0.0);
            operator.apply(p, &mut out);
            out
        };
        let (mut p, mut q) = (p.clone(), q.clone());
        if tied {
            p.tie();
            q.tie();
        }
        let (a, b) = (apply(&p).dot(&q), apply(&q).dot(&p));
        assert!((a - b).abs() < 1e-4 * a.abs().max(b.abs()), "tied {tied}: {a} and {b}");
        assert!(apply(&p).dot(&p) > 0.0);
    }
}

/// What conjugate gradients return solves the system.
#[test]
fn the_system_is_solved() {
    let patch = Patch { noise: [0.02, 1e-3], ..Patch::SMALL };
    let factors = fit(&patch, &patch.responses(5), "");
    assert!(factors.converged, "{:?}", factors.rounds);
    assert!(factors.rounds.len() < 8 && factors.rounds.iter().all(|round| round.steps < 100));
}

/// A constant factor on the data is the same factor on the profiles.
#[test]
fn profiles_scale_with_the_data() {
    let patch = Patch::SMALL;
    let values = patch.responses(1);
    let half: Vec<f32> = values.iter().map(|value| 0.5 * value).collect();
    let (one, two) = (fit(&patch, &values, ""), fit(&patch, &half, ""));
    for texel in [0, 57, 479] {
        for (a, b) in one.profile(texel).zip(two.profile(texel)) {
            assert!((b / a - 0.5).abs() < 2e-3, "{a} and {b}");
        }
    }
}

/// Holes: masked texels, missing windows, missing pixels; what is left still tells the profiles.
#[test]
fn holes_do_little_harm() {
    let patch = Patch { noise: [0.01, 0.0], ..Patch::SMALL };
    let whole = fit(&patch, &patch.responses(4), "");
    let mut values = patch.responses(4);
    let pixels = patch.window * patch.window;
    let mut random = Random::new(9);
    for (texel, window) in values.chunks_mut(pixels).enumerate() {
        if texel % 7 == 3 {
            window.fill(f32::NAN);
        }
        window.iter_mut().filter(|_| random.unit() < 0.1).for_each(|value| *value = f32::NAN);
    }
    let holed = fit(&patch, &values, "");
    assert!(holed.missing > 0 && holed.converged, "{:?}", holed.rounds);
    let texels = patch.width * patch.height;
    let differences =
        (0..texels).flat_map(|t| holed.profile(t).zip(whole.profile(t)).map(|(a, b)| (a / b - 1.0).powi(2)));
    let (sum, count) = differences.fold((0.0, 0), |(sum, count), d| (sum + d, count + 1));
    let rms = (sum / f64::from(count)).sqrt();
    assert!(rms < 0.02, "{rms}");
}

#[test]
fn equal_texels_have_the_global_profile() {
    let patch = Patch { width: 9, height: 8, window: 7, ..Patch::SMALL };
    let material = Patch::material(3, 3);
    let window: Vec<f32> = (-3i32..=3)
        .flat_map(|dy| (-3i32..=3).map(move |dx| f64::from(dx * dx + dy * dy).sqrt() * 0.06))
        .map(|r| patch.profile(material, r) as f32)
        .collect();
    let factors = fit(&patch, &window.repeat(72), "");
    assert!(factors.converged && factors.misses.relative() < 1e-4);
    let truth = patch.truth(3, 3, &Rings::new(7, 7, 0.06));
    assert!(factors.profile(40).zip(truth).all(|(found, truth)| (found / truth - 1.0).abs() < 1e-3));
}

/// One texel: all but the middle of its window lies beyond the patch, and is taken to be like itself.
#[test]
fn one_texel_has_its_own_profile() {
    let patch = Patch { width: 1, height: 1, ..Patch::SMALL };
    let factors = fit(&patch, &patch.responses(1), "");
    let first: Vec<f64> = factors.profile(0).collect();
    assert!(factors.converged && first.iter().all(|p| p.is_finite() && *p > 0.0));
    let own: f64 = factors.energy[0];
    let areas = crate::appearance::bssrdf::areas(&Rings::new(17, 17, 0.06).edges_mm);
    let found: f64 = first.iter().zip(areas).map(|(p, a)| p * a).sum();
    assert!((found / own - 1.0).abs() < 0.1, "{found} of {own}");
}

#[test]
fn equation_7_beats_simpler_models() {
    let patch = Patch { noise: [0.01, 1e-3], ..Patch::SMALL };
    let folder = patch.write(&patch.responses(6), "");
    let error = |freedom| {
        let options = FactorOptions { freedom, ..Default::default() };
        factor(&folder.open(), Channel::Stored(0), &options, &Unwatched).unwrap().misses.relative()
    };
    let (full, scaled, global) = (error(Freedom::Profiles), error(Freedom::Scaled), error(Freedom::Global));
    println!("profiles {full:.4}, scaled {scaled:.4}, global {global:.4}");
    assert!(full < 0.5 * scaled && scaled < global);
}

/// Asks to stop once the data are read.
#[derive(Default)]
struct OnlyReading(Interrupt);

impl Watch for OnlyReading {
    fn stage(&self, name: &str, _steps: u64) {
        if name != "reading" {
            self.0.request();
        }
    }

    fn stop_requested(&self) -> bool {
        self.0.requested()
    }
}

#[test]
fn a_watch_can_stop_it() {
    let patch = Patch::SMALL;
    let folder = patch.write(&patch.responses(1), "");
    let watch = OnlyReading::default();
    let result = factor(&folder.open(), Channel::Stored(0), &FactorOptions::default(), &watch);
    assert!(matches!(result, Err(BssrdfError::Stopped(_))));
}
