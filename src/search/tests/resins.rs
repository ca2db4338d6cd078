//! Resins for the tests: diffusion theory's half-spaces and decay, near the paper's white, black and support.

use crate::optics::{FrequencyGrid, KubelkaMunk, ResinId};
use crate::search::SearchTarget;
use proptest::prelude::*;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

pub const WHITE: ResinId = ResinId(0);
pub const BLACK: ResinId = ResinId(1);
pub const SUPPORT: ResinId = ResinId(2);

/// Parameters from R∞ and γ per coefficient.
fn from_half_space(half_space: &[f64], gamma: &[f64]) -> KubelkaMunk {
    let mut km = KubelkaMunk { alpha: vec![], beta: vec![], gamma: gamma.to_vec(), scattering: vec![] };
    for (r, gamma) in half_space.iter().zip(gamma) {
        km.alpha.push((1.0 / r + r) / 2.0);
        km.beta.push((1.0 / r - r) / 2.0);
        km.scattering.push(gamma * 2.0 / (1.0 / r - r));
    }
    km
}

/// Reduced scattering σs′ and absorption σa per mm to Kubelka–Munk: γ² = k² + 3σaσt′, R∞ = albedo′/(1 + 4γ/3σt′).
pub fn diffuse_resin(sigma_s: f64, sigma_a: f64) -> KubelkaMunk {
    let sigma_t = sigma_s + sigma_a;
    let gamma: Vec<f64> =
        FrequencyGrid::default().as_slice().iter().map(|k| (k * k + 3.0 * sigma_a * sigma_t).sqrt()).collect();
    let half_space: Vec<f64> = gamma.iter().map(|g| sigma_s / sigma_t / (1.0 + 4.0 * g / (3.0 * sigma_t))).collect();
    from_half_space(&half_space, &gamma)
}

/// White, black and support, one channel.
pub fn three_resins() -> Vec<Vec<KubelkaMunk>> {
    vec![vec![diffuse_resin(4.0, 0.17)], vec![diffuse_resin(1.25, 4.0)], vec![diffuse_resin(0.4, 0.025)]]
}

/// White, black, cyan, yellow, support in three channels.
pub fn colour_resins() -> Vec<Vec<KubelkaMunk>> {
    let resin = |s: [f64; 3], a: [f64; 3]| (0..3).map(|c| diffuse_resin(s[c], a[c])).collect();
    vec![
        resin([4.0; 3], [0.03, 0.04, 0.06]),
        resin([1.25; 3], [4.0; 3]),
        resin([0.4, 2.0, 3.0], [5.0, 0.6, 0.1]),
        resin([2.0, 2.2, 1.0], [0.02, 0.03, 8.0]),
        resin([0.4; 3], [0.025; 3]),
    ]
}

/// Resins of a few independent coefficients, extreme ones (clear, black, non-absorbing) among them.
pub fn random_resins(count: usize, coefficients: usize) -> impl Strategy<Value = Vec<KubelkaMunk>> {
    let pair = prop_oneof![
        8 => (0.001..8.0f64, 0.0001..8.0f64),
        1 => (0.001..8.0f64, Just(0.0)),
        1 => (Just(0.0), 0.001..8.0f64),
    ];
    prop::collection::vec(prop::collection::vec(pair, coefficients), count).prop_map(|resins| {
        resins
            .iter()
            .map(|pairs| {
                let mut km = KubelkaMunk { alpha: vec![], beta: vec![], gamma: vec![], scattering: vec![] };
                for &(s, k) in pairs {
                    km.alpha.push(1.0 + k / s);
                    km.beta.push(if s > 0.0 { (k * (k + 2.0 * s)).sqrt() / s } else { f64::INFINITY });
                    km.gamma.push((k * (k + 2.0 * s)).sqrt());
                    km.scattering.push(s);
                }
                km
            })
            .collect()
    })
}

/// A number in 0…1 from `random`.
pub fn unit(random: &mut Xoshiro256PlusPlus) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Plausible targets: an albedo, a width and a tail, not made of the resins.
pub fn random_targets(count: usize, channels: usize, seed: u64) -> Vec<SearchTarget> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let grid = FrequencyGrid::default();
    (0..count)
        .map(|_| SearchTarget {
            channels: (0..channels)
                .map(|_| {
                    let albedo = 0.05 + 0.6 * unit(&mut random);
                    let width = 0.05 + 0.95 * unit(&mut random).powi(2);
                    let tail = 0.5 + unit(&mut random);
                    grid.as_slice().iter().map(|k| albedo / (1.0 + (k * width).powi(2)).powf(tail / 2.0)).collect()
                })
                .collect(),
        })
        .collect()
}
