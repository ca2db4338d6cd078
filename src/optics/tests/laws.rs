//! One suite of laws for all models of light: whatever the resins, each keeps them within its own rounding or noise.

use proptest::{
    prelude::*,
    test_runner::{Config, TestCaseError, TestRunner},
};

use crate::{
    optics::{
        ChannelPrediction, FrequencyGrid, Grains, KubelkaMunk, Light, MaterialSet, Model, RadialProfile, Resin,
        ResinChannel, ResinId, SlabSpectrum, Stack, Transport, TransportOptions, VolumeCoefficients, predict,
    },
    watch::Unwatched,
};

const DIRECTIONS: TransportOptions = TransportOptions::REFLECTION;
const fn photons(light: Light) -> Model {
    Model::MonteCarlo { light, photons: 60_000, seed: 7 }
}

/// Every model, how far off a law it may be, and how many cases it is asked: photons are six times their noise at most.
const MODELS: [(Model, f64, u32); 5] = [
    (Model::KubelkaMunk, 1e-10, 64),
    (Model::Transport { light: Light::Diffuse, options: DIRECTIONS }, 1e-7, 16),
    (Model::Transport { light: Light::Normal, options: DIRECTIONS }, 1e-7, 16),
    (photons(Light::Diffuse), 1.2e-2, 5),
    (photons(Light::Normal), 1.2e-2, 5),
];

/// Two resins, three layers of them by turns, and where the middle one is cut.
#[derive(Debug)]
struct Draw {
    resins: [VolumeCoefficients; 2],
    mm: [f64; 3],
    cut: f64,
}

const A: ResinId = ResinId(0);
const B: ResinId = ResinId(1);

impl Draw {
    fn stack(&self) -> Stack {
        Stack::new([A, B, A].into_iter().zip(self.mm))
    }

    /// So thick that nothing comes through of either resin.
    fn endless_mm(&self) -> f64 {
        self.resins.iter().map(|resin| 60.0 / resin.diffuse_attenuation()).fold(0.0, f64::max)
    }
}

fn draws() -> impl Strategy<Value = Draw> {
    let index = prop::sample::select(vec![1.0, 1.0, 1.3, 1.5, 1.52]);
    let resin = (0.5..12.0, 0.05..4.0, -0.5..0.9, index);
    let resin = resin.prop_map(|(sigma_s, sigma_a, g, refractive_index)| VolumeCoefficients {
        sigma_s,
        sigma_a,
        g,
        refractive_index,
    });
    let resins = [resin.clone(), resin];
    (resins, [0.01..1.0, 0.01..1.0, 0.01..1.0], 0.01..0.99).prop_map(|(resins, mm, cut)| Draw { resins, mm, cut })
}

/// A set of resins and the model that is asked about them.
struct World {
    set: MaterialSet,
    model: Model,
    within: f64,
}

/// A resin whose Kubelka–Munk parameters are read off a slab of transport's.
pub(super) fn resin(index: usize, volume: VolumeCoefficients, grid: &FrequencyGrid) -> Resin {
    let slab_mm = volume.representative_thickness_mm();
    let stack = Stack::new([(volume.with_refractive_index(1.0), slab_mm)]);
    let slab = Transport { stack: &stack, light: Light::Diffuse, options: DIRECTIONS }.spectra(grid);
    // Waves of light may be below 0, which no one-dimensional medium's are.
    let reflection: Vec<f64> = slab.reflection.iter().map(|r| r.max(0.0)).collect();
    let transmission = slab.transmission.iter().zip(&reflection).map(|(t, r)| t.clamp(1e-9, 1.0 - r)).collect();
    let slab = SlabSpectrum { reflection, transmission };
    // No model asks for profiles.
    let profile = RadialProfile::from_rings((0..=8).map(f64::from).collect(), vec![0.1; 8], None).unwrap();
    let channel = ResinChannel {
        volume: Some(volume),
        fit: None,
        kubelka_munk: KubelkaMunk::from_slab(&slab, slab_mm).unwrap(),
        slab,
        slab_mm,
        reflection: profile.clone(),
        transmission: profile,
    };
    Resin {
        name: format!("resin {index}"),
        rgba: [index as u8, 0, 0, 255],
        density_g_per_cm3: 1.0,
        price_per_kg: None,
        print_as_background: false,
        channels: vec![channel],
        refractive_index: volume.refractive_index,
        notes: String::new(),
    }
}

impl World {
    fn new(model: Model, within: f64, draw: &Draw) -> Self {
        let grid = FrequencyGrid::linear(9, 8.0);
        let resins = draw.resins.iter().enumerate().map(|(index, volume)| resin(index, *volume, &grid));
        let set = MaterialSet {
            name: "drawn".into(),
            channels: vec!["Y".into()],
            resins: resins.collect(),
            provenance: String::new(),
            grid,
            warnings: Vec::new(),
            grains: Grains::FINE,
        };
        Self { set, model, within }
    }

    fn lit_by(&self) -> Light {
        match self.model {
            Model::KubelkaMunk => Light::Diffuse,
            Model::Transport { light, .. } | Model::MonteCarlo { light, .. } => light,
        }
    }

    fn light(&self, stack: &Stack) -> ChannelPrediction {
        predict(&self.set, stack, &self.model, &Unwatched).unwrap().light.remove(0)
    }

    fn same(&self, a: &[f64], b: &[f64]) -> Result<(), TestCaseError> {
        prop_assert_eq!(a.len(), b.len());
        let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        prop_assert!(worst <= self.within, "{} apart: {:?} and {:?}", worst, a, b);
        Ok(())
    }

    fn alike(&self, a: &Stack, b: &Stack) -> Result<(), TestCaseError> {
        let [a, b] = [a, b].map(|stack| self.light(stack));
        self.same(&a.reflection_hankel, &b.reflection_hankel)?;
        self.same(&a.transmission_hankel, &b.transmission_hankel)
    }
}

/// Holds every model to `law`.
fn hold(law: impl Fn(&World, &Draw) -> Result<(), TestCaseError>) {
    for (model, within, cases) in MODELS {
        let mut runner = TestRunner::new(Config { failure_persistence: None, ..Config::with_cases(cases) });
        let outcome = runner.run(&draws(), |draw| law(&World::new(model, within, &draw), &draw));
        outcome.unwrap_or_else(|failure| panic!("{model:?}: {failure}"));
    }
}

#[test]
fn no_light_is_made() {
    hold(|world, draw| {
        for stack in [draw.stack(), draw.stack().over(B)] {
            let light = world.light(&stack);
            for (r, t) in light.reflection_hankel.iter().zip(&light.transmission_hankel) {
                let sum = r.abs() + t.abs() + light.glint;
                prop_assert!(sum <= 1.0 + world.within, "{} + {} + {}", r, t, light.glint);
            }
            prop_assert!(light.reflection_hankel[0] >= 0.0 && light.transmission_hankel[0] >= 0.0);
        }
        Ok(())
    });
}

#[test]
fn nothing_changes_nothing() {
    hold(|world, draw| {
        let light = world.light(&Stack::default());
        let n = world.set.grid.len();
        world.same(&light.reflection_hankel, &vec![0.0; n])?;
        world.same(&light.transmission_hankel, &vec![1.0; n])?;
        let whole = draw.stack();
        let mut padded = whole.clone();
        for at in [0, 2, 5] {
            padded.layers.insert(at, crate::optics::Layer::new(B, 0.0));
        }
        world.alike(&whole, &padded)?;
        world.alike(&whole.over(B), &padded.over(B))
    });
}

#[test]
fn a_layer_in_two_parts_is_the_same() {
    hold(|world, draw| {
        let whole = draw.stack();
        let [top, middle, bottom] = draw.mm;
        let parts = [(A, top), (B, draw.cut * middle), (B, (1.0 - draw.cut) * middle), (A, bottom)];
        world.alike(&whole, &Stack::new(parts))?;
        world.alike(&whole.over(B), &Stack::new(parts).over(B))
    });
}

#[test]
fn what_is_thick_enough_is_endless() {
    hold(|world, draw| {
        let core = world.light(&Stack::default().over(A));
        let nothing = vec![0.0; world.set.grid.len()];
        world.same(&core.transmission_hankel, &nothing)?;
        let thick = world.light(&Stack::new([(A, draw.endless_mm())]));
        world.same(&thick.reflection_hankel, &core.reflection_hankel)?;
        world.same(&thick.transmission_hankel, &nothing)?;
        // A half-space under its own resin is itself.
        world.alike(&Stack::default().over(A), &Stack::new([(A, draw.mm[0])]).over(A))
    });
}

/// As much comes through from either side; of a beam, which leaves in all directions, that is not so.
#[test]
fn both_faces_let_the_same_through() {
    hold(|world, draw| {
        if world.lit_by() == Light::Normal {
            return Ok(());
        }
        let stack = Stack::new([(A, draw.mm[0]), (B, draw.mm[1])]);
        let turned = Stack::new([(B, draw.mm[1]), (A, draw.mm[0])]);
        let [there, back] = [stack, turned].map(|stack| world.light(&stack));
        world.same(&there.transmission_hankel, &back.transmission_hankel)
    });
}
