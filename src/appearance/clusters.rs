//! Groups of like profiles: weighted k-means (Hašan et al. 2010, section 7.1: 100 clusters in place of every surface
//! point).
//!
//! The distance is the search's own objective ([`super::metric`]), so the error of a cluster adds to its match's.
//! Seeding is k-means++ (Arthur and Vassilvitskii 2007); the iteration is Lloyd's with the bounds of Hamerly, *Making
//! k-means even faster* (SDM 2010), which skip a point while its centroid is certainly still the nearest: the upper
//! bound is kept exact, the lower one falls by how far the centroids have moved.
//!
//! Deterministic: points are looked at in parallel but each on its own, and every sum runs in the order of the points.
//! A local optimum, as k-means is; another seed may find a better one.

use multiversion::multiversion;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

use super::metric::Metric;
use crate::parallel;
use crate::search::Objective;

/// What to look for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClusterOptions {
    /// Number of clusters wanted; 100 in the paper.
    pub k: usize,
    /// Seed of the choice of first centroids.
    pub seed: u64,
    /// Coefficients per channel: every `coefficients`-th value of a point, from the first on, is an albedo.
    pub coefficients: usize,
    /// What the search will minimise.
    pub objective: Objective,
    /// Most rounds of Lloyd's iteration.
    pub max_iterations: usize,
}

impl Default for ClusterOptions {
    fn default() -> Self {
        Self { k: 100, seed: 1, coefficients: 128, objective: Objective::default(), max_iterations: 100 }
    }
}

/// How well a centroid stands for its points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClusterFit {
    /// Sum of the points' weights.
    pub weight: f64,
    /// Square root of the weighted mean of the squared distances.
    pub rms: f64,
    /// Greatest distance.
    pub worst: f64,
}

/// A group of points, and what is made for it: a target, a stacking. Its place among them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(transparent)]
pub struct ClusterId(pub u16);

impl ClusterId {
    /// Its place among all.
    pub fn index(self) -> usize {
        usize::from(self.0)
    }
}

/// Points in groups.
#[derive(Debug, Clone, PartialEq)]
pub struct Clusters {
    /// Number of clusters asked for; more than `centroids.len()` where there were not as many different points.
    pub requested: usize,
    /// Cluster of each point: the one with the nearest centroid.
    pub labels: Vec<ClusterId>,
    /// Weighted mean of each cluster's points.
    pub centroids: Vec<Vec<f64>>,
    /// One per cluster.
    pub fits: Vec<ClusterFit>,
    /// Weighted sum of squared distances.
    pub total: f64,
    /// Rounds taken.
    pub iterations: usize,
    /// Whether the iteration came to rest (or nearly, see `REST`) before `max_iterations`.
    pub converged: bool,
}

/// Why points cannot be grouped.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ClusterError {
    /// A parameter outside its range.
    #[error("cluster option {name} is {found}, expected {expected}")]
    Option {
        /// The option's name.
        name: &'static str,
        /// Its value.
        found: f64,
        /// The values it may take.
        expected: &'static str,
    },
    /// Points and weights do not fit together.
    #[error(
        "{values} values for {points} weighted points, expected at least one point and a whole number of channels of \
            {coefficients} coefficients each"
    )]
    Shape {
        /// Number of values.
        values: usize,
        /// Number of weights.
        points: usize,
        /// Coefficients per channel.
        coefficients: usize,
    },
    /// A value that is not a finite number.
    #[error("point {point}, coefficient {index} is {found}, expected a finite number")]
    Value {
        /// Index of the point.
        point: usize,
        /// Index into the point.
        index: usize,
        /// The value.
        found: f64,
    },
    /// A weight that is none.
    #[error("weight of point {point} is {found}, expected a finite number above 0")]
    Weight {
        /// Index of the point.
        point: usize,
        /// The weight.
        found: f64,
    },
}

impl crate::blame::Blamed for ClusterError {}

/// The iteration rests when a round lowers the total by less than this share. Evidence: 20,000 random materials in 100
/// clusters rest 1e-5 above the total of full convergence.
const REST: f64 = 1e-4;
/// Values summed between two looks at the limit of a distance.
const CHUNK: usize = 16;

/// Groups `points`, row-major `[point][channel][coefficient]`, each counting `weights[point]` times.
///
/// # Errors
/// Options out of range, rows that do not fit, values that are not finite, weights not above 0.
pub fn cluster(points: &[f64], weights: &[f64], options: &ClusterOptions) -> Result<Clusters, ClusterError> {
    let dims = check(points, weights, options)?;
    let metric = Metric::new(&options.objective, options.coefficients, dims / options.coefficients);
    // Padded to whole chunks.
    let stride = metric.dimensions().next_multiple_of(CHUNK);
    let mut placed = vec![0.0; weights.len() * stride];
    parallel::rows(&mut placed, stride, |n, row| metric.place(&points[n * dims..][..dims], row));
    let mut lloyd = Lloyd::new(&placed, weights, stride);
    lloyd.seed(options.k, options.seed);
    lloyd.run(options.max_iterations);

    let members = lloyd.members();
    let centroids: Vec<Vec<f64>> = parallel::map(members.len(), |c| {
        let points = members[c].iter().map(|&p| (&points[p as usize * dims..][..dims], weights[p as usize]));
        metric.centroid(&lloyd.centroids[c * stride..][..stride], points)
    });
    let fits: Vec<ClusterFit> = members
        .iter()
        .map(|members| {
            let weight: f64 = members.iter().map(|&p| weights[p as usize]).sum();
            let square: f64 = members.iter().map(|&p| weights[p as usize] * lloyd.upper[p as usize].powi(2)).sum();
            let worst = members.iter().map(|&p| lloyd.upper[p as usize]).fold(0.0, f64::max);
            ClusterFit { weight, rms: if weight > 0.0 { (square / weight).sqrt() } else { 0.0 }, worst }
        })
        .collect();
    Ok(Clusters {
        requested: options.k,
        total: lloyd.total(),
        iterations: lloyd.iterations,
        converged: lloyd.converged,
        labels: lloyd.labels.into_iter().map(|label| ClusterId(label as u16)).collect(), // k is at most 65,535
        centroids,
        fits,
    })
}

/// Values per point.
fn check(points: &[f64], weights: &[f64], options: &ClusterOptions) -> Result<usize, ClusterError> {
    let ClusterOptions { k, coefficients, objective: Objective { dc_weight, .. }, max_iterations, .. } = *options;
    let option = |name, found, expected, valid| match valid {
        true => Ok(()),
        false => Err(ClusterError::Option { name, found, expected }),
    };
    option("k", k as f64, "1 to 65535", (1..=usize::from(u16::MAX)).contains(&k))?;
    option("dc-weight", dc_weight, "a finite number, at least 0", dc_weight >= 0.0 && dc_weight.is_finite())?;
    option("max-iterations", max_iterations as f64, "at least 1", max_iterations > 0)?;
    let dims = points.len() / weights.len().max(1);
    if dims == 0 || coefficients == 0 || points.len() != dims * weights.len() || !dims.is_multiple_of(coefficients) {
        return Err(ClusterError::Shape { values: points.len(), points: weights.len(), coefficients });
    }
    if let Some(bad) = points.iter().position(|value| !value.is_finite()) {
        return Err(ClusterError::Value { point: bad / dims, index: bad % dims, found: points[bad] });
    }
    if let Some(point) = weights.iter().position(|weight| !(*weight > 0.0 && weight.is_finite())) {
        return Err(ClusterError::Weight { point, found: weights[point] });
    }
    Ok(dims)
}

/// The iteration's state.
struct Lloyd<'a> {
    points: &'a [f64],
    weights: &'a [f64],
    stride: usize,
    centroids: Vec<f64>,
    labels: Vec<u32>,
    /// Distance of each point to its centroid.
    upper: Vec<f64>,
    /// At most the distance of each point to any other centroid.
    lower: Vec<f64>,
    iterations: usize,
    converged: bool,
}

impl<'a> Lloyd<'a> {
    fn new(points: &'a [f64], weights: &'a [f64], stride: usize) -> Self {
        let n = weights.len();
        Self {
            points,
            weights,
            stride,
            centroids: Vec::new(),
            labels: vec![0; n],
            upper: vec![f64::INFINITY; n],
            lower: vec![0.0; n],
            iterations: 0,
            converged: false,
        }
    }

    fn row(&self, point: usize) -> &'a [f64] {
        &self.points[point * self.stride..(point + 1) * self.stride]
    }

    /// k-means++: each next centroid is a point drawn with probability weight · squared distance to the nearest so far.
    /// Stops early when every point is a centroid.
    fn seed(&mut self, k: usize, seed: u64) {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        // Here `upper` holds squared distances.
        let mut mass: Vec<f64> = self.weights.to_vec();
        for c in 0..k {
            let total: f64 = mass.iter().sum();
            let share = (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
            let Some(chosen) = draw(&mass, share * total) else { break };
            let centroid = self.row(chosen);
            self.centroids.extend_from_slice(centroid);
            let rows = self.points.par_chunks(self.stride).zip(self.weights);
            let state = self.upper.par_iter_mut().zip(&mut self.labels).zip(&mut mass);
            rows.zip(state).with_min_len(256).for_each(|((row, weight), ((nearest, label), mass))| {
                let square = distance_squared(row, centroid, *nearest);
                if square < *nearest {
                    *nearest = square;
                    *label = c as u32;
                    *mass = weight * square;
                }
            });
        }
        self.upper.iter_mut().for_each(|upper| *upper = upper.sqrt());
    }

    fn run(&mut self, max_iterations: usize) {
        let mut last = f64::INFINITY;
        loop {
            self.iterations += 1;
            let changed = self.assign();
            let total = self.total();
            if !changed || last - total <= REST * last.min(f64::MAX) || total == 0.0 {
                self.converged = true;
                return;
            }
            if self.iterations >= max_iterations {
                return;
            }
            last = total;
            self.update();
        }
    }

    fn total(&self) -> f64 {
        self.weights.iter().zip(&self.upper).map(|(weight, distance)| weight * distance * distance).sum()
    }

    /// Gives every point the label of its nearest centroid; whether any label changed.
    fn assign(&mut self) -> bool {
        let (stride, centroids) = (self.stride, &self.centroids);
        // Half the distance of each centroid to its nearest other: nothing nearer than that can change sides.
        let halves: Vec<f64> = parallel::map(centroids.len() / stride, |c| {
            let own = &centroids[c * stride..][..stride];
            let others = centroids.chunks(stride).enumerate().filter(|(o, _)| *o != c);
            0.5 * others.fold(f64::INFINITY, |near, (_, b)| near.min(distance_squared(own, b, near))).sqrt()
        });
        let first = self.iterations == 1;
        let state = self.labels.par_iter_mut().zip(&mut self.upper).zip(&mut self.lower);
        let changed =
            self.points.par_chunks(stride).zip(state).with_min_len(256).map(|(row, ((label, upper), lower))| {
                let own = *label as usize;
                let own_square = distance_squared(row, &centroids[own * stride..(own + 1) * stride], f64::INFINITY);
                *upper = own_square.sqrt();
                if *upper <= lower.max(halves[own]) && !first {
                    return false;
                }
                let (mut nearest, mut second) = ((own_square, own), f64::INFINITY);
                for (c, centroid) in centroids.chunks_exact(stride).enumerate() {
                    if c == own {
                        continue;
                    }
                    let square = distance_squared(row, centroid, second);
                    if square < nearest.0 || (square == nearest.0 && c < nearest.1) {
                        second = nearest.0;
                        nearest = (square, c);
                    } else if square < second {
                        second = square;
                    }
                }
                *label = nearest.1 as u32;
                *upper = nearest.0.sqrt();
                *lower = second.sqrt();
                nearest.1 != own
            });
        changed.reduce(|| false, |a, b| a | b) || first
    }

    /// Moves the centroids to the means of their points; a centroid without points goes to the point farthest from its
    /// own, or away.
    fn update(&mut self) {
        let members = self.members();
        let mut means: Vec<Option<Vec<f64>>> = parallel::map_all(&members, |members| self.mean(members));
        let empty: Vec<usize> = (0..means.len()).filter(|c| means[*c].is_none()).collect();
        if !empty.is_empty() {
            let cost = |p: &usize| self.weights[*p] * self.upper[*p] * self.upper[*p];
            let mut far: Vec<usize> = (0..self.weights.len()).filter(|p| self.upper[*p] > 0.0).collect();
            far.sort_by(|a, b| cost(b).total_cmp(&cost(a)).then(a.cmp(b)));
            for (c, p) in empty.into_iter().zip(far) {
                means[c] = Some(self.row(p).to_vec());
            }
        }
        if means.iter().any(Option::is_none) {
            // Fewer clusters from here on: all bounds and labels start anew.
            self.centroids = means.into_iter().flatten().flatten().collect();
            self.labels.fill(0);
            self.lower.fill(0.0);
            return;
        }
        let means: Vec<f64> = means.into_iter().flatten().flatten().collect();
        let moved: Vec<f64> = means
            .chunks(self.stride)
            .zip(self.centroids.chunks(self.stride))
            .map(|(new, old)| distance_squared(new, old, f64::INFINITY).sqrt())
            .collect();
        // The farthest move and the farthest of another centroid.
        let first = (0..moved.len()).max_by(|a, b| moved[*a].total_cmp(&moved[*b])).unwrap_or(0);
        let second = moved.iter().enumerate().filter(|(c, _)| *c != first).map(|(_, m)| *m).fold(0.0, f64::max);
        let labels = &self.labels;
        self.lower.iter_mut().zip(labels).for_each(|(lower, &label)| {
            *lower -= if label as usize == first { second } else { moved[first] };
        });
        self.centroids = means;
    }

    fn mean(&self, members: &[u32]) -> Option<Vec<f64>> {
        if members.is_empty() {
            return None;
        }
        let (mut sum, mut weight) = (vec![0.0; self.stride], 0.0);
        for &p in members {
            let w = self.weights[p as usize];
            weight += w;
            sum.iter_mut().zip(self.row(p as usize)).for_each(|(sum, x)| *sum += w * x);
        }
        sum.iter_mut().for_each(|sum| *sum /= weight);
        Some(sum)
    }

    /// The points of each cluster in their order.
    fn members(&self) -> Vec<Vec<u32>> {
        let mut members = vec![Vec::new(); self.centroids.len() / self.stride];
        for (p, &label) in self.labels.iter().enumerate() {
            members[label as usize].push(p as u32);
        }
        members
    }
}

/// The first index at which the running sum of `mass` exceeds `at`; the last with any mass where rounding denies it;
/// `None` without mass.
fn draw(mass: &[f64], at: f64) -> Option<usize> {
    let (mut sum, mut last) = (0.0, None);
    for (i, mass) in mass.iter().enumerate().filter(|(_, mass)| **mass > 0.0) {
        sum += mass;
        last = Some(i);
        if sum > at {
            break;
        }
    }
    last
}

/// Σ (a − b)², or something above `limit` as soon as that is certain.
#[multiversion(targets("x86_64+avx2", "x86_64+avx", "aarch64+neon"))]
fn distance_squared(a: &[f64], b: &[f64], limit: f64) -> f64 {
    let mut total = 0.0;
    for (a, b) in a.chunks_exact(CHUNK).zip(b.chunks_exact(CHUNK)) {
        let mut lanes = [0.0; 4];
        for (a, b) in a.chunks_exact(4).zip(b.chunks_exact(4)) {
            for i in 0..4 {
                let difference = a[i] - b[i];
                lanes[i] += difference * difference;
            }
        }
        total += (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
        if total > limit {
            return total;
        }
    }
    total
}

#[cfg(test)]
#[path = "tests/clusters.rs"]
mod tests;
