//! Data that are exactly of the form of equation 7: the profiles come back.

use super::patch::Patch;
use crate::appearance::bssrdf::{Channel, FactorOptions, Factors, Freedom, factor};
use crate::watch::Unwatched;

fn fit(patch: &Patch, values: &[f32], more: &str, freedom: Freedom) -> Factors {
    let folder = patch.write(values, more);
    factor(&folder.open(), Channel::Stored(0), &FactorOptions { freedom, ..Default::default() }, &Unwatched).unwrap()
}

/// Relative differences to the truth over all texels and the rings below `rings`: root mean square, mean.
fn off(patch: &Patch, factors: &Factors, keep: impl Fn(f64) -> bool) -> (f64, f64, usize) {
    let rings = crate::appearance::bssrdf::Rings::new(patch.window, patch.window, patch.pitch_mm);
    let (mut square, mut sum, mut count) = (0.0, 0.0, 0usize);
    for y in 0..patch.height {
        for x in 0..patch.width {
            let truth = patch.truth(x, y, &rings);
            for (found, truth) in factors.profile(y * patch.width + x).zip(&truth).filter(|(_, truth)| keep(**truth)) {
                square += (found / truth - 1.0).powi(2);
                sum += found / truth - 1.0;
                count += 1;
            }
        }
    }
    ((square / count as f64).sqrt(), sum / count as f64, count)
}

#[test]
fn profiles_come_back() {
    let patch = Patch::SMALL;
    let factors = fit(&patch, &patch.responses(1), "", Freedom::Profiles);
    let (rms, mean, _) = off(&patch, &factors, |_| true);
    println!("no noise: rms {rms:.2e}, mean {mean:.1e}, {:?}", factors.rounds);
    assert!(factors.converged && rms < 0.01, "{rms}");
    assert!(factors.misses.relative() < 0.01, "{}", factors.misses.relative());
}

/// The requirement: 1% noise, within 2% where the signal is above the floor.
#[test]
fn profiles_come_back_from_noise() {
    let patch = Patch { noise: [0.01, 2e-3], ..Patch::SMALL };
    for known in ["", "noise-floor-per-mm2 = 2e-3\n"] {
        let factors = fit(&patch, &patch.responses(2), known, Freedom::Profiles);
        let (rms, mean, count) = off(&patch, &factors, |truth| truth > patch.noise[1]);
        println!("1% and a floor: rms {rms:.2e}, mean {mean:.1e}, {count} values, {:?}", factors.variance);
        assert!(rms < 0.02, "{rms}");
        assert!(mean.abs() < 0.003, "biased by {mean}");
    }
}
