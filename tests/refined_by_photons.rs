//! Whether refined stackings keep their promise: targets are Monte Carlo profiles of random stackings, and Monte Carlo judges what is found.

#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

use std::{ops::ControlFlow, time::Instant};

use lumislice::{
    optics::{Light, MaterialSet, PhotonOptions, Prediction, VolumeCoefficients},
    search::{
        BlockTable, Objective, RefineOptions, Refiner, ResinLimit, SearchOptions, SearchTarget, Stacking,
        match_sequences,
    },
};

/// A small generator of random numbers in [0, 1), after Steele, Lea and Flood 2014: the targets must not change with a library's version.
struct SplitMix(u64);

impl SplitMix {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

struct Judge {
    set: MaterialSet,
    core: usize,
    photons: u64,
}

impl Judge {
    fn volume(&self, resin: usize) -> &[VolumeCoefficients] {
        self.set.resins[resin].volume.as_deref().expect("synthetic resins have coefficients")
    }

    fn reflection(&self, stacking: &Stacking, seed: u64) -> Vec<Vec<f64>> {
        let layers: Vec<_> =
            stacking.layers.iter().map(|layer| (self.volume(layer.resin), layer.thickness_mm)).collect();
        let options = PhotonOptions { light: Light::Diffuse, photons: self.photons, seed };
        let core = Some(self.volume(self.core));
        let found =
            Prediction::monte_carlo(&self.set.channels, &layers, core, options, |_| ControlFlow::Continue(())).unwrap();
        found.light.into_iter().map(|light| light.reflection_hankel).collect()
    }
}

/// 2 to 4 layers of two neighbouring resins each, support below 0.2 mm, thin ones as likely as thick ones.
fn random_stacking(random: &mut SplitMix, resins: usize, support: usize) -> Stacking {
    loop {
        let mut layers: Vec<(usize, f64)> = Vec::new();
        let count = 2 + (3.0 * random.unit()) as usize;
        while layers.len() < count {
            let resin = (resins as f64 * random.unit()) as usize;
            if layers.last().is_none_or(|last| last.0 != resin) {
                layers.push((resin, 0.05 * 40.0_f64.powf(random.unit())));
            }
        }
        let stacking = Stacking::from_layers(layers);
        let top: f64 =
            stacking.layers.iter().take_while(|layer| layer.resin != support).map(|layer| layer.thickness_mm).sum();
        if top >= 0.2 && stacking.thickness_mm() <= 5.0 {
            return stacking;
        }
    }
}

/// 2e7 photons, 20 targets: `LUMISLICE_PHOTONS` and `LUMISLICE_TARGETS` make it smaller.
#[test]
#[ignore = "60 Monte Carlo runs of 2e7 photons, some minutes"]
fn what_was_promised_is_what_photons_see() {
    let number = |name: &str, default: u64| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(default);
    let set = MaterialSet::builtin("synthetic").unwrap();
    let resin = |name: &str| set.resin(name).unwrap().0;
    let (core, support) = (resin("black"), resin("support"));
    let mut limits = vec![ResinLimit::NONE; set.resins.len()];
    limits[support].min_depth_mm = 0.2;
    let options = SearchOptions { limits, core: Some(core), ..SearchOptions::default() };
    let parameters: Vec<_> = set.resins.iter().map(|resin| resin.kubelka_munk.clone()).collect();
    let volumes: Vec<_> = set.resins.iter().map(|resin| resin.volume.clone().unwrap()).collect();
    let start = Instant::now();
    let table = BlockTable::new(&parameters, &options).unwrap();
    let refiner = Refiner::new(&volumes, &set.grid, &options, RefineOptions::default());
    println!("tables {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
    let judge = Judge { core, photons: number("LUMISLICE_PHOTONS", 20_000_000), set };
    let objective = Objective::default();
    let mut random = SplitMix(2010);
    let mut ratios = Vec::new();
    println!("{:>9} {:>9} {:>9} {:>9} {:>7}  target → found", "promise", "photons", "discrete", "ratio", "ms");
    for number in 0..number("LUMISLICE_TARGETS", 20) {
        let wanted = random_stacking(&mut random, judge.set.resins.len(), support);
        let target = SearchTarget { channels: judge.reflection(&wanted, 3 * number) };
        let start = Instant::now();
        let candidates = match_sequences(&table, &target, Refiner::SEQUENCES).unwrap();
        let refined = refiner.refine(&candidates, &target).unwrap();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let photons = objective.of(&judge.reflection(&refined.stacking, 3 * number + 1), &target);
        let discrete = objective.of(&judge.reflection(&candidates[0].stacking, 3 * number + 2), &target);
        let ratio = discrete / photons;
        let layers = |stacking: &Stacking| -> String {
            let name = |resin: usize| &judge.set.resins[resin].name[..1];
            stacking.layers.iter().map(|layer| format!("{}{:.3} ", name(layer.resin), layer.thickness_mm)).collect()
        };
        println!(
            "{:9.1e} {photons:9.1e} {discrete:9.1e} {ratio:9.1} {ms:7.0}  {}→ {}",
            refined.objective,
            layers(&wanted),
            layers(&refined.stacking)
        );
        assert!(photons <= 1.2 * refined.objective + 2e-5, "a promise of {} became {photons}", refined.objective);
        // Both objectives hold the noise of two Monte Carlo runs. Up to half of the light leaves near the centre, where it counts alike
        // at all 128 frequencies: 2 · 128 · ½ · ½ / N, 3.2e-6 at 2e7 photons, with a long tail as it is one number squared.
        let noise = 8e-6 * 2e7 / judge.photons as f64;
        assert!(photons < discrete + noise, "the discrete answer was better: {discrete} against {photons}");
        ratios.push(ratio);
    }
    ratios.sort_by(f64::total_cmp);
    println!("better than the discrete answer by {:.1} in the median", ratios[ratios.len() / 2]);
    assert!(ratios[ratios.len() / 2] > 10.0);
}
