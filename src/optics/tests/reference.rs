//! Against reference values of independent programs. They are not part of the crate: `LUMISLICE_SHARED` names their folder
//! (`../shared` beside the crate by default), and without it these tests say so and pass.

use std::path::PathBuf;

use crate::optics::{Layer, Light, MonteCarlo, RingEdges, VolumeCoefficients};

/// A file of the reference folder, or `None` after saying that it is skipped.
pub(super) fn reference(name: &str) -> Option<String> {
    let shared = std::env::var_os("LUMISLICE_SHARED")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let path = shared.join("reference").join(name);
    match std::fs::read_to_string(&path) {
        Ok(text) => Some(text),
        Err(_) => {
            println!("skipped: no {}", path.display());
            None
        }
    }
}

/// The numbers of a CSV text, comment and header lines left out.
pub(super) fn numbers(text: &str) -> Vec<Vec<f64>> {
    text.lines().filter_map(|line| line.split(',').map(|cell| cell.trim().parse().ok()).collect()).collect()
}

/// z-scores of reflection and transmission of every slab with τ ≤ 10, both lights, against adding–doubling.
fn z_scores(rows: &[Vec<f64>], photons: u64, seed: u64) -> Vec<f64> {
    let mut scores = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        let [albedo, tau, g, r_normal, t_normal, r_diffuse, t_diffuse, _] = row[..] else { panic!("columns") };
        for (light, r, t) in [(Light::Normal, r_normal, t_normal), (Light::Diffuse, r_diffuse, t_diffuse)] {
            let job = MonteCarlo {
                layers: vec![Layer {
                    coefficients: VolumeCoefficients { sigma_s: albedo * tau, sigma_a: (1.0 - albedo) * tau, g },
                    thickness_mm: 1.0,
                }],
                base: None,
                light,
                photons,
                seed: seed + 1000 * index as u64, // no two rows share random numbers
                rings: RingEdges::new(vec![0.0, 1.0]).unwrap(),
            };
            let result = job.run().unwrap();
            for (estimate, exact) in [(result.reflection, r), (result.transmission, t)] {
                scores.push((estimate.mean - exact) / estimate.standard_error);
            }
        }
    }
    scores
}

/// Largest |z|, share below 3, mean square.
fn summary(scores: &[f64]) -> (f64, f64, f64) {
    let n = scores.len() as f64;
    let largest = scores.iter().fold(0.0_f64, |largest, z| largest.max(z.abs()));
    let below_3 = scores.iter().filter(|z| z.abs() < 3.0).count() as f64 / n;
    (largest, below_3, scores.iter().map(|z| z * z).sum::<f64>() / n)
}

#[test]
fn monte_carlo_agrees_with_adding_doubling_quickly() {
    let Some(text) = reference("adding_doubling_slabs.csv") else { return };
    let rows: Vec<_> = numbers(&text).into_iter().filter(|row| row[1] <= 2.0).step_by(11).collect();
    let scores = z_scores(&rows, 100_000, 1);
    let (largest, _, mean_square) = summary(&scores);
    println!("{} z: largest {largest:.2}, mean square {mean_square:.3}", scores.len());
    assert!(largest < 4.5 && (0.3..2.2).contains(&mean_square));
}

#[test]
#[ignore = "the full proof: 4.8e9 photons, most of an hour; LUMISLICE_PHOTONS and LUMISLICE_SEEDS make it smaller"]
fn monte_carlo_agrees_with_adding_doubling() {
    let Some(text) = reference("adding_doubling_slabs.csv") else { return };
    let setting = |name: &str, default: u64| std::env::var(name).map_or(default, |value| value.parse().unwrap());
    let (photons, seeds) = (setting("LUMISLICE_PHOTONS", 10_000_000), setting("LUMISLICE_SEEDS", 3));
    let rows: Vec<_> = numbers(&text).into_iter().filter(|row| row[1] <= 10.0).collect();
    let started = std::time::Instant::now();
    let scores: Vec<f64> = (1..=seeds).flat_map(|seed| z_scores(&rows, photons, seed)).collect();
    let (largest, below_3, mean_square) = summary(&scores);
    println!(
        "{} rows, {photons} photons, {seeds} seeds, {:.0?}: {} z, largest {largest:.2}, below 3 {below_3:.4}, mean square {mean_square:.3}",
        rows.len(),
        started.elapsed(),
        scores.len()
    );
    assert!(largest < 4.5 && below_3 >= 0.98 && (0.8..=1.25).contains(&mean_square));
}
