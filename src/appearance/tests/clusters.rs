//! Laws of the clusters.

use super::*;
use crate::appearance::NormalizedDiffusion;
use crate::optics::FrequencyGrid;
use crate::search::{Norm, SearchTarget};

fn options(k: usize) -> ClusterOptions {
    ClusterOptions { k, objective: Objective::L2, ..Default::default() }
}

fn unit(random: &mut Xoshiro256PlusPlus) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Profiles of a texture-like set of materials, and weights.
fn materials(n: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for _ in 0..n {
        let albedo = 0.05 + 0.55 * unit(&mut random);
        let material = NormalizedDiffusion::new(albedo, 0.05 + unit(&mut random) * albedo).unwrap();
        points.extend(material.spectrum(&FrequencyGrid::default()));
        weights.push(1.0 + (unit(&mut random) * 50.0).floor());
    }
    (points, weights)
}

fn square(a: &[f64], b: &[f64], objective: Objective) -> f64 {
    let of = |(a, b): (&[f64], &[f64])| objective.of(&[a.to_vec()], &SearchTarget { channels: vec![b.to_vec()] });
    a.chunks(128).zip(b.chunks(128)).map(of).sum()
}

#[test]
fn every_point_has_the_nearest_centroid_and_fits_add_up() {
    let (points, weights) = materials(800, 4);
    let objectives = [(Norm::L2, 0.0), (Norm::L2, 1.0), (Norm::L2, 10.0), (Norm::Spatial, 1.0)];
    for objective in objectives.map(|(norm, dc_weight)| Objective { norm, dc_weight }) {
        let found = cluster(&points, &weights, &ClusterOptions { objective, ..options(20) }).unwrap();
        assert_eq!(found.centroids.len(), 20);
        let (mut total, mut worst) = (0.0, vec![0.0f64; 20]);
        for ((point, weight), label) in points.chunks(128).zip(&weights).zip(&found.labels) {
            let squares: Vec<f64> = found.centroids.iter().map(|c| square(point, c, objective)).collect();
            let nearest = squares.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(squares[label.index()] <= nearest + 1e-12, "{objective:?}");
            total += weight * nearest;
            worst[label.index()] = worst[label.index()].max(nearest.sqrt());
        }
        assert!((total - found.total).abs() < 1e-9 * total);
        let from_fits: f64 = found.fits.iter().map(|fit| fit.weight * fit.rms * fit.rms).sum();
        assert!((total - from_fits).abs() < 1e-9 * total);
        assert!(found.fits.iter().zip(worst).all(|(fit, worst)| (fit.worst - worst).abs() < 1e-9));
    }
}

/// Relative errors of single points against their clusters, point by point as the search sees them.
#[test]
fn relative_clusters_lower_relative_errors() {
    // Dark and bright ones, in two channels.
    let (mut points, _) = materials(1200, 6);
    points.chunks_mut(128).step_by(3).flatten().for_each(|r| *r *= 0.05);
    let weights = vec![1.0; 600];
    let relative = Objective { norm: Norm::Relative, dc_weight: 1.0 };
    let total = |objective: Objective| {
        let found = cluster(&points, &weights, &ClusterOptions { objective, ..options(30) }).unwrap();
        let of = |(point, label): (&[f64], &ClusterId)| square(&found.centroids[label.index()], point, relative);
        (points.chunks(256).zip(&found.labels).map(of).sum::<f64>(), found.total)
    };
    let ((own, reported), (plain, _)) = (total(relative), total(Objective::L2));
    assert!(own < 0.5 * plain, "{own} against {plain}");
    assert!((own / reported - 1.0).abs() < 0.1, "{own}, but {reported} was reported");
}

/// Errors in lightness of single points against their clusters, as the search sees them.
#[test]
fn natural_clusters_lower_errors_in_lightness() {
    let (mut points, _) = materials(1200, 6);
    points.chunks_mut(128).step_by(3).flatten().for_each(|r| *r *= 0.1);
    let weights = vec![1.0; 600];
    let natural = Objective::default();
    let total = |objective: Objective| {
        let found = cluster(&points, &weights, &ClusterOptions { objective, ..options(30) }).unwrap();
        let of = |(point, label): (&[f64], &ClusterId)| square(&found.centroids[label.index()], point, natural);
        points.chunks(256).zip(&found.labels).map(of).sum::<f64>()
    };
    let (own, plain) = (total(natural), total(Objective::L2));
    assert!(own < 0.8 * plain, "{own} against {plain}");
}

/// Lloyd's iteration without bounds, from the same seeds.
#[test]
fn bounds_change_nothing() {
    let (points, weights) = materials(600, 9);
    let found = cluster(&points, &weights, &options(15)).unwrap();
    let mut lloyd = Lloyd::new(&points, &weights, 128);
    lloyd.seed(15, 1);
    let mut centroids = lloyd.centroids.clone();
    let mut labels = vec![0; 600];
    for round in 0..found.iterations {
        for (point, label) in points.chunks(128).zip(&mut labels) {
            let distance = |c: usize| square(point, &centroids[c * 128..(c + 1) * 128], Objective::L2);
            *label = (0..15).min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap();
        }
        if round + 1 < found.iterations {
            for c in 0..15 {
                let members: Vec<usize> = (0..600).filter(|p| labels[*p] == c).collect();
                let weight: f64 = members.iter().map(|p| weights[*p]).sum();
                for i in 0..128 {
                    centroids[c * 128 + i] =
                        members.iter().map(|p| weights[*p] * points[p * 128 + i]).sum::<f64>() / weight;
                }
            }
        }
    }
    assert!(found.iterations > 3);
    assert!(labels.iter().zip(&found.labels).all(|(a, b)| *a == b.index()));
}

#[test]
fn thread_count_changes_no_byte() {
    let (points, weights) = materials(1500, 2);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| cluster(&points, &weights, &options(30)).unwrap())
    };
    assert_eq!(with(1), with(3));
    let other = cluster(&points, &weights, &ClusterOptions { seed: 2, ..options(30) }).unwrap();
    assert_ne!(other.centroids, with(1).centroids);
}

#[test]
fn a_weight_is_that_many_points() {
    let (points, _) = materials(40, 3);
    let weights: Vec<f64> = (0..40).map(|i| 1.0 + (i % 3) as f64).collect();
    let found = cluster(&points, &weights, &options(40)).unwrap();
    assert!(found.total < 1e-20, "as many clusters as points");
    let one = cluster(&points, &weights, &options(1)).unwrap();
    let repeated: Vec<f64> = points.chunks(128).zip(&weights).flat_map(|(row, w)| row.repeat(*w as usize)).collect();
    let plain = cluster(&repeated, &vec![1.0; repeated.len() / 128], &options(1)).unwrap();
    assert!((one.total - plain.total).abs() < 1e-10);
    assert!(square(&one.centroids[0], &plain.centroids[0], Objective::L2) < 1e-24);
}

#[test]
fn no_more_clusters_than_different_points() {
    let (three, _) = materials(3, 5);
    let points = three.repeat(7);
    let found = cluster(&points, &[1.0; 21], &options(100)).unwrap();
    assert_eq!((found.requested, found.centroids.len(), found.fits.len()), (100, 3, 3));
    assert!(found.total < 1e-24 && found.converged);
    assert!(found.labels.iter().enumerate().all(|(p, label)| *label == found.labels[p % 3]));
}

#[test]
fn an_empty_cluster_takes_the_farthest_point() {
    // Two centroids on the same spot: the second gets no point.
    let points: Vec<f64> = [0.0, 0.1, 6.0, 9.0].iter().flat_map(|x| [*x; CHUNK]).collect();
    let mut lloyd = Lloyd::new(&points, &[1.0; 4], CHUNK);
    lloyd.centroids = vec![0.0; 2 * CHUNK];
    lloyd.run(10);
    assert_eq!(lloyd.labels, [0, 0, 1, 1]);
}

#[test]
fn bad_points_are_refused() {
    let ask = |points: &[f64], weights: &[f64], coefficients| {
        cluster(points, weights, &ClusterOptions { coefficients, ..options(2) }).unwrap_err()
    };
    assert!(matches!(ask(&[], &[], 1), ClusterError::Shape { .. }));
    assert!(matches!(ask(&[1.0, 2.0, 3.0], &[1.0, 1.0], 1), ClusterError::Shape { .. }));
    assert!(matches!(ask(&[1.0, f64::NAN], &[1.0], 1), ClusterError::Value { point: 0, index: 1, .. }));
    assert!(matches!(ask(&[1.0, 2.0], &[1.0, 0.0], 1), ClusterError::Weight { point: 1, .. }));
    let none = cluster(&[1.0], &[1.0], &ClusterOptions { coefficients: 1, ..options(0) });
    assert!(matches!(none, Err(ClusterError::Option { name: "k", .. })));
}

#[test]
#[ignore = "measures: 20,000 weighted profiles in 100 clusters"]
fn twenty_thousand_profiles() {
    let (points, weights) = materials(20_000, 1);
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let start = std::time::Instant::now();
        let found = pool.install(|| cluster(&points, &weights, &options(100)).unwrap());
        let (rounds, total) = (found.iterations, found.total);
        println!("{threads} threads: {:?}, {rounds} rounds, total {total}, rest {}", start.elapsed(), found.converged);
    }
}
