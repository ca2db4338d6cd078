//! Whether refined stackings keep their promise: targets are Monte Carlo profiles of random stackings and the slabs of
//! Hašan et al. 2010, section 8.2, and Monte Carlo judges what is found.
//!
//! The judge has noise of its own: light near the centre counts alike at all frequencies, so that two runs of one
//! stacking differ by 3e-6 on average at 2e7 photons. A stacking is therefore judged by several independent runs R_1 …
//! R_K. The mean over pairs i ≠ j of Σ w (R_i − R_t)(R_j − R_t) has no noise in its mean, and leaving out each run in
//! turn tells its standard error.

use std::time::Instant;

use lumislice::{
    optics::{Light, MaterialSet, Model, ResinId, Stack, predict},
    search::{MatchOptions, Matcher, Objective, ResinLimit, SearchOptions, SearchTarget},
    watch::Unwatched,
};

/// A small generator of random numbers in [0, 1), after Steele, Lea and Flood 2014: the targets must not change with a
/// library's version.
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Independent runs that a stacking is judged by.
const RUNS: u64 = 8;

struct Judge {
    set: MaterialSet,
    photons: u64,
    seeds: SplitMix,
}

/// What photons say of a stacking.
struct Verdict {
    /// The objective of all photons together, noise included.
    plain: f64,
    /// Without the judge's noise, and its standard error.
    unbiased: f64,
    standard_error: f64,
}

impl Judge {
    fn reflection(&mut self, stacking: &Stack, photons: u64) -> Vec<f64> {
        let seed = self.seeds.next();
        let model = Model::MonteCarlo { light: Light::Diffuse, photons, seed };
        let found = predict(&self.set, stacking, &model, &Unwatched).unwrap();
        found.light.into_iter().next().unwrap().reflection_hankel
    }

    fn verdict(&mut self, stacking: &Stack, target: &[f64], objective: &Objective) -> Verdict {
        let weights = objective.weights(target);
        let runs: Vec<Vec<f64>> = (0..RUNS)
            .map(|_| {
                let run = self.reflection(stacking, self.photons / RUNS);
                run.iter().zip(target).map(|(r, t)| r - t).collect()
            })
            .collect();
        let product = |a: &[f64], b: &[f64]| -> f64 {
            a.iter().zip(b).zip(&weights).map(|((a, b), weight)| weight * a * b).sum()
        };
        // Σ over pairs of different runs among those that are kept.
        let pairs = |kept: &[&Vec<f64>]| -> f64 {
            let sum: Vec<f64> = (0..target.len()).map(|i| kept.iter().map(|run| run[i]).sum()).collect();
            let own: f64 = kept.iter().map(|run| product(run, run)).sum();
            let count = kept.len() as f64;
            (product(&sum, &sum) - own) / (count * (count - 1.0))
        };
        let all: Vec<&Vec<f64>> = runs.iter().collect();
        let mean: Vec<f64> =
            (0..target.len()).map(|i| all.iter().map(|run| run[i]).sum::<f64>() / RUNS as f64).collect();
        let without = |left: usize| -> f64 {
            let kept: Vec<_> = all.iter().enumerate().filter(|(i, _)| *i != left).map(|(_, run)| *run).collect();
            pairs(&kept)
        };
        let jackknife: Vec<f64> = (0..runs.len()).map(without).collect();
        let middle = jackknife.iter().sum::<f64>() / RUNS as f64;
        let spread: f64 = jackknife.iter().map(|value| (value - middle).powi(2)).sum();
        let standard_error = (spread * (RUNS - 1) as f64 / RUNS as f64).sqrt();
        Verdict { plain: product(&mean, &mean), unbiased: pairs(&all), standard_error }
    }
}

/// 2 to 4 layers of two neighbouring resins each, support below 0.2 mm, thin ones as likely as thick ones.
fn random_stacking(random: &mut SplitMix, resins: usize, support: ResinId, core: ResinId) -> Stack {
    loop {
        let mut layers: Vec<(ResinId, f64)> = Vec::new();
        let count = 2 + (3.0 * random.unit()) as usize;
        while layers.len() < count {
            let resin = ResinId((resins as f64 * random.unit()) as usize);
            if layers.last().is_none_or(|last| last.0 != resin) {
                layers.push((resin, 0.05 * 40.0_f64.powf(random.unit())));
            }
        }
        let stacking = Stack::joined(layers).over(core);
        let top: f64 =
            stacking.layers.iter().take_while(|layer| layer.resin != support).map(|layer| layer.thickness_mm).sum();
        if top >= 0.2 && stacking.thickness_mm() <= 5.0 {
            return stacking;
        }
    }
}

/// Section 8.2: from a little white on support to white as bright, in five steps.
fn slabs_of_8_2(judge: &mut Judge, white: ResinId, support: ResinId, core: ResinId) -> Vec<Vec<f64>> {
    let photons = judge.photons;
    let wide = judge.reflection(&Stack::new([(white, 0.25), (support, 4.5)]).over(core), photons);
    let narrow = judge.reflection(&Stack::new([(white, 5.0)]).over(core), photons);
    let scale = wide[0] / narrow[0];
    let mixed = |f: f64| wide.iter().zip(&narrow).map(|(w, n)| (1.0 - f) * w + f * scale * n).collect();
    (0..5).map(|i| mixed(f64::from(i) / 4.0)).collect()
}

/// 2e7 photons, 20 random targets and the five slabs: `LUMISLICE_PHOTONS` and `LUMISLICE_TARGETS` make it smaller.
#[test]
#[ignore = "70 Monte Carlo runs of 2e7 photons, some minutes"]
fn what_was_promised_is_what_photons_see() {
    let number = |name: &str, default: u64| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(default);
    let set = MaterialSet::builtin("synthetic").unwrap();
    let resin = |name: &str| set.resin(name).unwrap().0;
    let (white, core, support) = (resin("white"), resin("black"), resin("support"));
    let mut limits = vec![ResinLimit::NONE; set.resins.len()];
    limits[support.0].min_depth_mm = 0.2;
    let options = SearchOptions { limits, core: Some(core), ..SearchOptions::default() };
    let options = MatchOptions { search: options, ..MatchOptions::default() };
    let matcher = Matcher::new(&set, &options).unwrap();
    let mut judge = Judge { photons: number("LUMISLICE_PHOTONS", 20_000_000), set, seeds: SplitMix(8) };
    let layers = |judge: &Judge, stacking: &Stack| -> String {
        let name = |resin: ResinId| &judge.set[resin].name[..1];
        stacking.pairs().map(|(&resin, mm)| format!("{}{mm:.3} ", name(resin))).collect()
    };
    let mut random = SplitMix(2010);
    let mut targets: Vec<(String, Vec<f64>)> = Vec::new();
    for _ in 0..number("LUMISLICE_TARGETS", 20) {
        let wanted = random_stacking(&mut random, judge.set.resins.len(), support, core);
        targets.push((layers(&judge, &wanted), judge.reflection(&wanted, judge.photons)));
    }
    let realisable = targets.len();
    let slabs = slabs_of_8_2(&mut judge, white, support, core).into_iter().enumerate();
    targets.extend(slabs.map(|(i, slab)| (format!("8.2, {} of 5 ", i + 1), slab)));

    let (mut ratios, mut close) = (Vec::new(), 0);
    println!(
        "{:>9} {:>9} {:>18} {:>18} {:>7} {:>5}  target → found",
        "promise", "photons", "refined", "discrete", "ratio", "ms"
    );
    for (number, (name, spectrum)) in targets.into_iter().enumerate() {
        let target = SearchTarget { channels: vec![spectrum.clone()] };
        let start = Instant::now();
        let found = matcher.match_targets(&[target], &Unwatched).unwrap().remove(0);
        let (discrete, refined) = (found.search.unwrap().stacking, found.refined.unwrap());
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let found = judge.verdict(&refined.stacking, &spectrum, &options.search.objective);
        let discrete = judge.verdict(&discrete, &spectrum, &options.search.objective);
        let ratio = discrete.plain / found.plain;
        println!(
            "{:9.1e} {:9.1e} {:9.1e} ± {:.0e} {:9.1e} ± {:.0e} {ratio:7.1} {ms:5.0}  {name}→ {}",
            refined.objective,
            found.plain,
            found.unbiased,
            found.standard_error,
            discrete.unbiased,
            discrete.standard_error,
            layers(&judge, &refined.stacking),
        );
        let noise = 5e-6 * 2e7 / judge.photons as f64;
        assert!(
            found.plain <= 1.2 * refined.objective + 2e-5 + noise - 5e-6,
            "a promise of {} became {}",
            refined.objective,
            found.plain
        );
        assert!(refined.objective <= refined.unrefined, "worse than the discrete answer by transport");
        let both = found.standard_error.hypot(discrete.standard_error);
        assert!(
            found.unbiased < discrete.unbiased + 3.0 * both,
            "the discrete answer was better: {} against {} ± {both}",
            discrete.unbiased,
            found.unbiased
        );
        close += usize::from((found.unbiased - discrete.unbiased).abs() < 3.0 * both);
        if number < realisable {
            ratios.push(ratio);
        }
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "better than the discrete answer by {:.1} in the median of {realisable}; on {close} targets the two cannot be \
            told apart",
        ratios[ratios.len() / 2]
    );
    assert!(ratios[ratios.len() / 2] > 10.0);
}
