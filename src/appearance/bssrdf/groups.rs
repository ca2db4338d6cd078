//! Profiles in clusters, by the search's own distance.
//!
//! The search compares Hankel coefficients on the default grid, the first one weighted. A profile is a vector of ring
//! energies E, its coefficients are H E with H the mean of J₀(kr) over each ring, so the squared distance is a
//! quadratic form of rank 30 or less: (E − E′)ᵀ G (E − E′), G = Hᵀ W H. In the eigenvectors of G it is a plain square
//! in as many dimensions, and k-means is as many times faster than on 128 coefficients.

use faer::{Mat, Side};

use super::BssrdfError;
use crate::{
    appearance::{ClusterError, ClusterOptions, Clusters, cluster},
    optics::FrequencyGrid,
    parallel,
};

/// Eigenvalues below this share of the largest are rounding: a thousandth of what clusters differ by.
const NEGLIGIBLE: f64 = 1e-12;

/// Ring energies to coordinates in which distances are the search's.
#[derive(Debug, Clone)]
pub struct Metric {
    rings: usize,
    /// `[dimension][ring]`.
    rows: Vec<f64>,
    /// Coefficients of a channel, to turn distances into root mean squares.
    pub coefficients: usize,
}

/// How many clusters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ClusterCount {
    /// This many.
    Fixed(usize),
    /// The fewest that keep the root mean square error of R̂ over all texels below this.
    Within(f64),
}

impl ClusterCount {
    /// Whether so many texels can be grouped like this.
    ///
    /// # Errors
    /// [`BssrdfError::Option`].
    pub fn check(self, texels: usize) -> Result<(), BssrdfError> {
        let refuse = |name, found, expected| Err(BssrdfError::Option { name, found, expected });
        match self {
            Self::Fixed(k) if k > texels => refuse("clusters", k.to_string(), format!("at most the {texels} texels")),
            Self::Fixed(k) if !(1..=usize::from(u16::MAX)).contains(&k) => {
                refuse("clusters", k.to_string(), "1 to 65535".into())
            }
            Self::Within(bound) if !(bound > 0.0 && bound.is_finite()) => {
                refuse("max-rms", bound.to_string(), "a number above 0".into())
            }
            _ => Ok(()),
        }
    }
}

impl Metric {
    /// For profiles on rings with these edges (mm).
    ///
    /// # Errors
    /// Edges so odd that no eigenvectors are found.
    pub fn new(edges_mm: &[f64], grid: &FrequencyGrid, dc_weight: f64) -> Result<Self, BssrdfError> {
        let rings = edges_mm.len() - 1;
        let k = grid.as_slice();
        let h = Mat::from_fn(k.len(), rings, |row, ring| {
            let weight = if row == 0 { dc_weight.sqrt() } else { 1.0 };
            weight * mean_j0(k[row], edges_mm[ring], edges_mm[ring + 1])
        });
        let gram = h.transpose() * &h;
        let eigen = gram.self_adjoint_eigen(Side::Lower).map_err(|_| BssrdfError::Option {
            name: "pitch",
            found: format!("rings that end at {} mm", edges_mm[rings]),
            expected: "rings whose distance can be told".into(),
        })?;
        let values = eigen.S().column_vector();
        let most = (0..rings).map(|i| values[i]).fold(0.0, f64::max);
        let kept = (0..rings).rev().filter(|&i| values[i] > NEGLIGIBLE * most);
        let vectors = eigen.U();
        let rows = kept.flat_map(|i| {
            let scale = values[i].sqrt();
            (0..rings).map(move |ring| scale * vectors[(ring, i)])
        });
        Ok(Self { rings, rows: rows.collect(), coefficients: k.len() })
    }

    /// Number of dimensions.
    pub fn dims(&self) -> usize {
        self.rows.len() / self.rings
    }

    /// Coordinates of profiles, `[point][channel][dimension]` of `[point][channel][ring]`.
    pub fn coordinates(&self, energies: &[f64]) -> Vec<f64> {
        let dims = self.dims();
        let mut out = vec![0.0; energies.len() / self.rings * dims];
        parallel::rows(&mut out, dims, |point, out| {
            let energies = &energies[point * self.rings..][..self.rings];
            for (out, row) in out.iter_mut().zip(self.rows.chunks(self.rings)) {
                *out = row.iter().zip(energies).map(|(a, b)| a * b).sum();
            }
        });
        out
    }

    /// Groups profiles given as ring energies, `[point][channel][ring]`.
    ///
    /// # Errors
    /// [`BssrdfError::Option`] for a count or a bound out of range, or energies that are not finite.
    pub fn group(
        &self,
        energies: &[f64],
        channels: usize,
        count: ClusterCount,
        seed: u64,
    ) -> Result<Clusters, BssrdfError> {
        let points = self.coordinates(energies);
        let texels = energies.len() / (self.rings * channels);
        let weights = vec![1.0; texels];
        let with = |k: usize| {
            let options = ClusterOptions { k, seed, coefficients: self.dims(), ..ClusterOptions::default() };
            cluster(&points, &weights, &options).map_err(refuse)
        };
        count.check(texels)?;
        let bound = match count {
            ClusterCount::Fixed(k) => return with(k),
            ClusterCount::Within(bound) => bound,
        };
        let most = texels.min(usize::from(u16::MAX));
        let kept = |clusters: &Clusters| self.rms(clusters.total, texels, channels) <= bound;
        // Twice as many until it fits, then between the last two.
        let (mut low, mut high) = (0, 1);
        let mut found = with(high)?;
        while !kept(&found) && high < most {
            (low, high) = (high, most.min(2 * high));
            found = with(high)?;
        }
        while high - low > 1 && kept(&found) {
            let middle = low + (high - low) / 2;
            let tried = with(middle)?;
            if kept(&tried) {
                (high, found) = (middle, tried);
            } else {
                low = middle;
                if (high - low) * 20 < high {
                    break; // k-means itself is no better reproducible than that
                }
            }
        }
        Ok(found)
    }

    /// Root mean square error of R̂ that a sum of squared distances over `texels` stands for.
    pub fn rms(&self, total: f64, texels: usize, channels: usize) -> f64 {
        (total / (texels * channels * self.coefficients) as f64).sqrt()
    }
}

fn refuse(error: ClusterError) -> BssrdfError {
    let expected = "profiles that can be grouped".into();
    BssrdfError::Option { name: "profiles", found: error.to_string(), expected }
}

/// Mean of J₀(kr) over a ring, which is its Hankel transform over its energy.
fn mean_j0(k: f64, inner: f64, outer: f64) -> f64 {
    if k == 0.0 {
        return 1.0;
    }
    2.0 * (outer * libm::j1(k * outer) - inner * libm::j1(k * inner)) / (k * (outer * outer - inner * inner))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        appearance::{
            NormalizedDiffusion,
            bssrdf::{Rings, TailRings, areas},
        },
        optics::RadialProfile,
    };

    fn edges() -> Vec<f64> {
        let window = Rings::new(61, 61, 0.0586).edges_mm;
        let tail = TailRings::new(&window);
        window.iter().chain(&tail.edges_mm[1..]).copied().collect()
    }

    fn energies(edges: &[f64], albedo: f64, path: f64) -> Vec<f64> {
        let material = NormalizedDiffusion::new(albedo, path).unwrap();
        edges.windows(2).map(|e| albedo * (material.energy_within(e[1]) - material.energy_within(e[0]))).collect()
    }

    #[test]
    fn distance_is_the_searchs() {
        let (edges, grid) = (edges(), FrequencyGrid::default());
        for dc_weight in [1.0, 10.0] {
            let metric = Metric::new(&edges, &grid, dc_weight).unwrap();
            println!("{} rings, {} dimensions", edges.len() - 1, metric.dims());
            let all: Vec<f64> = [(0.6, 1.0), (0.5, 0.3), (0.2, 0.1)]
                .iter()
                .flat_map(|(albedo, path)| energies(&edges, *albedo, *path))
                .collect();
            let points = metric.coordinates(&all);
            let spectra: Vec<Vec<f64>> = all
                .chunks(edges.len() - 1)
                .map(|energies| {
                    let means = energies.iter().zip(areas(&edges)).map(|(e, a)| e / a).collect();
                    RadialProfile::from_rings(edges.clone(), means, None).unwrap().hankel(&grid).values
                })
                .collect();
            for (a, b) in [(0, 1), (1, 2), (0, 2)] {
                let weight = |i: usize| if i == 0 { dc_weight } else { 1.0 };
                let (p, q) = (&spectra[a], &spectra[b]);
                let truth: f64 = (0..128).map(|i| weight(i) * (p[i] - q[i]).powi(2)).sum();
                let dims = metric.dims();
                let (p, q) = (&points[a * dims..(a + 1) * dims], &points[b * dims..(b + 1) * dims]);
                let found: f64 = p.iter().zip(q).map(|(a, b)| (a - b).powi(2)).sum();
                // The optics take a line in each ring, not a step.
                assert!((found / truth - 1.0).abs() < 0.05, "{found} for {truth}");
            }
        }
    }

    fn many(texels: usize) -> (Vec<f64>, Vec<f64>) {
        let edges = edges();
        let unit = |i: usize, step: f64| (i as f64 * step).fract();
        let rows =
            parallel::map(texels, |i| energies(&edges, 0.05 + 0.6 * unit(i, 0.618_034), 0.05 + unit(i, 0.754_878)));
        (rows.into_iter().flatten().collect(), edges.clone())
    }

    #[test]
    fn fewest_that_keep_the_bound() {
        let (all, edges) = many(600);
        let metric = Metric::new(&edges, &FrequencyGrid::default(), 1.0).unwrap();
        let found = metric.group(&all, 1, ClusterCount::Within(0.01), 1).unwrap();
        let k = found.centroids.len();
        assert!(metric.rms(found.total, 600, 1) <= 0.01 && k > 2 && k < 200, "{k}");
        let fewer = metric.group(&all, 1, ClusterCount::Fixed(k * 8 / 10), 1).unwrap();
        assert!(metric.rms(fewer.total, 600, 1) > 0.01);
    }

    #[test]
    fn counts_out_of_range_are_refused() {
        let (all, edges) = many(5);
        let metric = Metric::new(&edges, &FrequencyGrid::default(), 1.0).unwrap();
        let refusal = |count| metric.group(&all, 1, count, 1).unwrap_err().to_string();
        assert_eq!(refusal(ClusterCount::Fixed(6)), "clusters: found 6, expected at most the 5 texels");
        assert_eq!(refusal(ClusterCount::Fixed(0)), "clusters: found 0, expected 1 to 65535");
        assert_eq!(refusal(ClusterCount::Within(0.0)), "max-rms: found 0, expected a number above 0");
    }

    #[test]
    #[ignore = "slow without optimisation: 76,800 profiles in 100 clusters within 5 s"]
    fn seventy_six_thousand_profiles() {
        let (all, edges) = many(76_800);
        let start = std::time::Instant::now();
        let metric = Metric::new(&edges, &FrequencyGrid::default(), 1.0).unwrap();
        let found = metric.group(&all, 1, ClusterCount::Fixed(100), 1).unwrap();
        let rms = metric.rms(found.total, 76_800, 1);
        let (rings, dims, rounds) = (edges.len() - 1, metric.dims(), found.iterations);
        let took = start.elapsed();
        println!("{rings} rings, {dims} dimensions, {rounds} rounds, rms {rms:.2e}: {took:?}");
        assert!(rings >= 40 && took.as_secs_f64() < 5.0, "{rings} rings, {took:?}");
    }
}
