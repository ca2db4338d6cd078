//! Hankel pairs with closed forms, from points and from rings; tails; the way back.

use std::f64::consts::{PI, TAU};

use crate::optics::{FrequencyGrid, InverseHankel, RadialProfile, RingEdges, Tail, repair_transmission};

/// A profile, its transform, and its energy within a radius.
struct Pair {
    name: &'static str,
    f: fn(f64, f64) -> f64,
    transform: fn(f64, f64) -> f64,
    energy_within: fn(f64, f64) -> f64,
}

const PAIRS: [Pair; 3] = [
    Pair {
        name: "exp(-ar)/r",
        f: |a, r| (-a * r).exp() / r,
        transform: |a, k| TAU / (a * a + k * k).sqrt(),
        energy_within: |a, r| TAU * (1.0 - (-a * r).exp()) / a,
    },
    Pair {
        name: "exp(-ar)",
        f: |a, r| (-a * r).exp(),
        transform: |a, k| TAU * a / (a * a + k * k).powf(1.5),
        energy_within: |a, r| TAU * (1.0 - (-a * r).exp() * (1.0 + a * r)) / (a * a),
    },
    Pair {
        name: "exp(-ar^2)",
        f: |a, r| (-a * r * r).exp(),
        transform: |a, k| PI / a * (-k * k / (4.0 * a)).exp(),
        energy_within: |a, r| PI / a * (1.0 - (-a * r * r).exp()),
    },
];

const DECAYS: [f64; 3] = [1.0, 3.0, 10.0];

fn rings_of(pair: &Pair, a: f64, edges: &[f64]) -> RadialProfile {
    let means = edges
        .windows(2)
        .map(|e| ((pair.energy_within)(a, e[1]) - (pair.energy_within)(a, e[0])) / (PI * (e[1] * e[1] - e[0] * e[0])))
        .collect();
    RadialProfile::from_rings(edges.to_vec(), means, None).unwrap()
}

fn points_of(pair: &Pair, a: f64, first: f64, step: f64, reach: f64) -> RadialProfile {
    let r: Vec<f64> = (0..).map(|i| first + f64::from(i) * step).take_while(|r| *r <= reach).collect();
    let f = r.iter().map(|r| (pair.f)(a, *r)).collect();
    RadialProfile::from_points(r, f, None).unwrap()
}

/// Largest error of the transform over the default grid, relative to f̂(0).
fn worst(profile: &RadialProfile, pair: &Pair, a: f64) -> f64 {
    let grid = FrequencyGrid::default();
    let spectrum = profile.hankel(&grid);
    let error = |(k, value): (&f64, &f64)| (value - (pair.transform)(a, *k)).abs();
    grid.as_slice().iter().zip(&spectrum.values).map(error).fold(0.0, f64::max) / (pair.transform)(a, 0.0)
}

#[test]
fn point_samples_every_10_um_give_the_closed_forms() {
    for pair in &PAIRS {
        for a in DECAYS {
            let error = worst(&points_of(pair, a, 0.005, 0.01, 40.0 / a), pair, a);
            println!("points {} a {a}: {error:.1e}", pair.name);
            assert!(error < 2e-5, "{} at a = {a}: {error:e}", pair.name);
        }
    }
}

#[test]
fn ring_means_give_the_closed_forms() {
    for pair in &PAIRS {
        for a in DECAYS {
            for (name, edges) in [("fine", RingEdges::fine()), ("growing", RingEdges::growing())] {
                let error = worst(&rings_of(pair, a, edges.as_slice()), pair, a);
                println!("{name} rings {} a {a}: {error:.1e}", pair.name);
                assert!(error < 1e-5, "{} at a = {a} on {name} rings: {error:e}", pair.name);
            }
        }
    }
}

#[test]
fn rings_keep_their_energy_exactly() {
    for pair in &PAIRS {
        let profile = rings_of(pair, 3.0, RingEdges::fine().as_slice());
        let albedo = profile.hankel(&FrequencyGrid::default()).values[0];
        let exact = (pair.energy_within)(3.0, 80.0);
        assert!((albedo / exact - 1.0).abs() < 1e-12, "{}: {albedo} for {exact}", pair.name);
        assert!((profile.energy() / exact - 1.0).abs() < 1e-12, "{}", pair.name);
    }
}

#[test]
fn accuracy_follows_the_spacing() {
    // The interpolation is of fourth order, so half the spacing must gain clearly more than a factor of 4.
    let pair = &PAIRS[0];
    let error = |step: f64| worst(&points_of(pair, 3.0, 0.5 * step, step, 12.0), pair, 3.0);
    assert!(error(0.04) > 5.0 * error(0.02), "{} then {}", error(0.04), error(0.02));
}

#[test]
fn a_cut_profile_gets_its_tail_back() {
    let pair = &PAIRS[1];
    let profile = points_of(pair, 0.5, 0.01, 0.02, 6.0); // cut where 20% of the energy is still outside
    let spectrum = profile.hankel(&FrequencyGrid::default());
    let Tail::Exponential { decay_per_mm, share, .. } = spectrum.tail else { panic!("{:?}", spectrum.tail) };
    assert!((decay_per_mm - 0.5).abs() < 1e-6);
    let beyond = 1.0 - (pair.energy_within)(0.5, profile.reach_mm()) / (pair.transform)(0.5, 0.0);
    assert!((share - beyond).abs() < 1e-6, "{share} for {beyond}");
    assert!(worst(&profile, pair, 0.5) < 1e-5);
}

#[test]
fn a_rising_or_scattered_end_is_cut_not_extrapolated() {
    let r: Vec<f64> = (1..200).map(|i| f64::from(i) * 0.02).collect();
    let rising = r.iter().map(|r| 1.0 + 0.1 * r).collect();
    let profile = RadialProfile::from_points(r.clone(), rising, None).unwrap();
    assert!(matches!(profile.hankel(&FrequencyGrid::default()).tail, Tail::Cut { .. }));
    let scattered = r.iter().enumerate().map(|(i, r)| (-r).exp() * if i % 2 == 0 { 1.0 } else { 0.1 }).collect();
    let profile = RadialProfile::from_points(r, scattered, None).unwrap();
    assert!(matches!(profile.hankel(&FrequencyGrid::default()).tail, Tail::Cut { .. }));
}

#[test]
fn half_energy_radii_agree_from_profile_and_from_spectrum() {
    let grid = FrequencyGrid::default();
    for a in DECAYS {
        let profile = rings_of(&PAIRS[0], a, RingEdges::growing().as_slice());
        let spectrum = profile.hankel(&grid).values;
        let back = InverseHankel::new(&spectrum, &grid);
        for share in [0.1, 0.5, 0.9] {
            let exact = -(1.0_f64 - share).ln() / a;
            let direct = profile.radius_of_energy(share).unwrap();
            let inverse = back.radius_of_energy(share).unwrap();
            println!("a {a} share {share}: exact {exact:.5} rings {direct:.5} spectrum {inverse:.5}");
            assert!((direct / exact - 1.0).abs() < 2e-3, "a {a} share {share}: {direct} for {exact}");

            assert!((inverse / exact - 1.0).abs() < 1e-2, "a {a} share {share}: {inverse} for {exact}");
        }
    }
}

#[test]
fn there_and_back_is_the_same_spectrum() {
    let grid = FrequencyGrid::default();
    let spectrum: Vec<f64> = grid.as_slice().iter().map(|k| 0.6 / (4.0 + k * k).sqrt()).collect();
    let edges: Vec<f64> = RingEdges::growing().as_slice().iter().copied().filter(|r| *r <= 10.0).collect();
    let again = InverseHankel::new(&spectrum, &grid).rings(&edges).unwrap().hankel(&grid).values;
    let worst = spectrum.iter().zip(&again).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-3, "{worst:e}");
}

#[test]
fn no_light_comes_back_as_no_light() {
    let (grid, nothing) = (FrequencyGrid::default(), vec![0.0; FrequencyGrid::DEFAULT_LEN]);
    let inverse = InverseHankel::new(&nothing, &grid);
    assert_eq!([0.01, 1.0, 20.0].map(|r_mm| inverse.energy_within(r_mm)), [0.0; 3]);
    assert_eq!(inverse.radius_of_energy(0.5), None);
}

#[test]
fn transmission_in_noise_is_continued_in_the_logarithm() {
    let grid = FrequencyGrid::default();
    let clean: Vec<f64> = grid.as_slice().iter().map(|k| 0.1 * (-1.5 * k).exp()).collect();
    let noisy = |i: usize| 1e-5 * (2.3 * i as f64 + 0.2).sin();
    for noise in [None, Some(vec![0.7e-5; grid.len()])] {
        let mut values: Vec<f64> = clean.iter().enumerate().map(|(i, t)| t + noisy(i)).collect();
        let repair = repair_transmission(&mut values, noise.as_deref(), &grid).unwrap().unwrap();
        assert!((repair.slope_mm - 1.5).abs() < 0.1, "{repair:?}");
        assert!((4.0..8.0).contains(&repair.from_k), "{repair:?}");
        assert!(values[repair.from_index..].windows(2).all(|pair| pair[1] < pair[0]), "monotone");
        assert!((values[127] / clean[127]).ln().abs() < 1.0, "{} for {}", values[127], clean[127]);
    }
    let mut untouched = clean.clone();
    assert_eq!(repair_transmission(&mut untouched, None, &grid), Ok(None));
    assert_eq!(untouched, clean);
    assert!(repair_transmission(&mut vec![0.0; grid.len()], None, &grid).is_err());
}
