//! Sharp borders between two materials whose far light differs by a factor of thousands.

use std::f64::consts::{PI, TAU};

use super::patch::{Patch, Random};
use crate::appearance::bssrdf::{Channel, FactorOptions, Factors, Rings, factor};
use crate::watch::Unwatched;

const PATCH: Patch = Patch { width: 36, height: 34, window: 25, pitch_mm: 0.15, noise: [0.0, 0.0] };

/// P of a texel: squares of 8 texels.
fn profile(x: isize, y: isize, r: f64) -> f64 {
    let decay = if (x.div_euclid(8) + y.div_euclid(8)).rem_euclid(2) == 1 { 0.35 } else { 0.12 };
    let area = PATCH.pitch_mm * PATCH.pitch_mm;
    match r > 0.0 {
        true => 0.5 * (-r / decay).exp() / (TAU * decay * r),
        false => -0.5 * (-(area / PI).sqrt() / decay).exp_m1() / area,
    }
}

fn fit(noise: f64) -> Factors {
    let (half, mut random) = ((PATCH.window / 2) as isize, Random::new(5));
    let mut values = Vec::new();
    for y in 0..PATCH.height as isize {
        for x in 0..PATCH.width as isize {
            for (dy, dx) in (-half..=half).flat_map(|dy| (-half..=half).map(move |dx| (dy, dx))) {
                let r = ((dx * dx + dy * dy) as f64).sqrt() * PATCH.pitch_mm;
                let value = (profile(x, y, r) * profile(x + dx, y + dy, r)).sqrt();
                values.push((value * (1.0 + noise * random.normal())) as f32);
            }
        }
    }
    let folder = PATCH.write(&values, "");
    factor(&folder.open(), Channel::Stored(0), &FactorOptions::default(), &Unwatched).unwrap()
}

/// √(Σ(D − R̂)² / ΣD²) of the worst ring, and √(Σ(P − truth)² / Σ truth²) of the worst.
fn worst(factors: &Factors) -> [f64; 2] {
    let rings = Rings::new(PATCH.window, PATCH.window, PATCH.pitch_mm);
    let mut sums = vec![[0.0; 2]; rings.len()];
    for y in 0..PATCH.height {
        for x in 0..PATCH.width {
            let truth = rings.distances_mm.iter().map(|r| profile(x as isize, y as isize, *r)).collect::<Vec<_>>();
            for ((sum, truth), found) in
                sums.iter_mut().zip(rings.means(&truth)).zip(factors.profile(y * PATCH.width + x))
            {
                sum[0] += (found - truth).powi(2);
                sum[1] += truth * truth;
            }
        }
    }
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
    let data = largest(&mut factors.misses.rings.iter().map(|sums| (sums.error / sums.data).sqrt()));
    [data, largest(&mut sums.iter().map(|[off, all]| (off / all).sqrt()))]
}

/// The requirement: every ring within 1%.
#[test]
fn every_ring_comes_back() {
    let factors = fit(0.0);
    let [data, truth] = worst(&factors);
    println!("data {data:.1e}, truth {truth:.1e}, {} rounds, {:?}", factors.rounds.len(), factors.rounds.last());
    assert!(factors.converged && data < 0.01 && truth < 0.01, "{data} {truth}");
}

/// Noise of 1% is found as such, by the fit and by light going both ways.
#[test]
fn noise_is_told_from_what_the_model_misses() {
    let factors = fit(0.01);
    let [data, truth] = worst(&factors);
    let found = factors.rounds.last().unwrap().relative;
    println!("data {data:.1e}, truth {truth:.1e}, noise {found:.2e}, {} rounds", factors.rounds.len());
    assert!(factors.converged && data < 0.02 && truth < 0.05, "{data} {truth}");
    assert!((0.005..0.02).contains(&found), "{found}");
    assert!((0.005..0.02).contains(&(factors.reciprocity.relative / 2f64.sqrt())));
}
