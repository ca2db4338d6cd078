//! From textures of albedo and mean free path to few weighted profiles, and back to texels.

use rayon::prelude::*;

use super::{DiffusionError, NormalizedDiffusion};
use crate::optics::FrequencyGrid;

/// The different (albedo, mean free path) pairs of an image, in ascending order.
#[derive(Debug, Clone, PartialEq)]
pub struct DistinctPairs {
    /// Albedo and mean free path in mm.
    pub pairs: Vec<[f32; 2]>,
    /// Number of texels with each pair.
    pub weights: Vec<f64>,
    /// Steps per axis to which the values had to be rounded to get few enough pairs; `None`: they are the image's own.
    pub levels: Option<u32>,
    /// Greatest values, the upper end of the levels.
    most: [f32; 2],
}

/// Finest and coarsest rounding tried, in bits per axis.
const BITS: std::ops::RangeInclusive<u32> = 3..=12;

impl DistinctPairs {
    /// The pairs of `texels` (albedo, mean free path; each a finite number, at least 0). An image of 8-bit codes keeps its own values;
    /// where there are more than `max_pairs` (at least 64), values are rounded to ever fewer even steps until there are not.
    pub fn new(texels: &[[f32; 2]], max_pairs: usize) -> Self {
        let most = texels.par_iter().copied().reduce(|| [0.0; 2], |a, b| [a[0].max(b[0]), a[1].max(b[1])]);
        let mut found = Self { pairs: Vec::new(), weights: Vec::new(), levels: None, most };
        found.count(texels);
        for bits in BITS.rev() {
            if found.pairs.len() <= max_pairs.max(64) {
                break;
            }
            found.levels = Some(1 << bits);
            found.count(texels);
        }
        found
    }

    fn count(&mut self, texels: &[[f32; 2]]) {
        let mut keys: Vec<u64> = texels.par_iter().map(|texel| key(self.rounded(*texel))).collect();
        keys.par_sort_unstable();
        self.pairs.clear();
        self.weights.clear();
        for run in keys.chunk_by(|a, b| a == b) {
            self.pairs.push([f32::from_bits((run[0] >> 32) as u32), f32::from_bits(run[0] as u32)]);
            self.weights.push(run.len() as f64);
        }
    }

    fn rounded(&self, texel: [f32; 2]) -> [f32; 2] {
        let Some(levels) = self.levels else { return texel };
        let steps = (levels - 1) as f32;
        let round =
            |value: f32, most: f32| if most > 0.0 { (value / most * steps).round() / steps * most } else { 0.0 };
        [round(texel[0], self.most[0]), round(texel[1], self.most[1])]
    }

    /// The index of the pair of each texel. `texels` must be those the pairs come from; another gets the next pair in order.
    pub fn index(&self, texels: &[[f32; 2]]) -> Vec<u32> {
        let keys: Vec<u64> = self.pairs.iter().map(|pair| key(*pair)).collect();
        let last = keys.len().saturating_sub(1);
        let find = |texel: &[f32; 2]| keys.partition_point(|known| *known < key(self.rounded(*texel))).min(last) as u32;
        texels.par_iter().map(find).collect()
    }

    /// The cluster of each texel, given the cluster of each pair. `texels` as in [`DistinctPairs::index`].
    pub fn labels(&self, texels: &[[f32; 2]], cluster_of: &[u32]) -> Vec<u32> {
        let mut labels = self.index(texels);
        labels.par_iter_mut().for_each(|label| *label = cluster_of[*label as usize]);
        labels
    }

    /// R̂ of every pair by normalised diffusion, row-major [pair][coefficient].
    ///
    /// # Errors
    /// The first pair that is no material.
    pub fn spectra(&self, grid: &FrequencyGrid) -> Result<Vec<f64>, DiffusionError> {
        let materials: Result<Vec<_>, _> =
            self.pairs.iter().map(|[a, l]| NormalizedDiffusion::new(f64::from(*a), f64::from(*l))).collect();
        Ok(materials?.par_iter().flat_map_iter(|material| material.spectrum(grid)).collect())
    }
}

/// Orders pairs of numbers that are at least 0 as their values do.
fn key(pair: [f32; 2]) -> u64 {
    // + 0.0 turns −0 into 0.
    u64::from((pair[0] + 0.0).to_bits()) << 32 | u64::from((pair[1] + 0.0).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 8-bit codes of a smooth image.
    fn image(n: usize, codes: f32) -> Vec<[f32; 2]> {
        let code = |x: f32| (x * codes).round() / codes;
        (0..n)
            .map(|i| i as f32 / n as f32)
            .map(|x| [code(0.3 + 0.2 * (40.0 * x).sin()), 2.0 * code(0.5 + 0.4 * (17.0 * x).cos())])
            .collect()
    }

    #[test]
    fn every_texel_finds_its_own_pair() {
        let texels = image(5000, 255.0);
        let distinct = DistinctPairs::new(&texels, 20_000);
        assert_eq!(distinct.levels, None);
        assert_eq!(distinct.weights.iter().sum::<f64>(), 5000.0);
        assert!(distinct.pairs.is_sorted_by(|a, b| a < b));
        let index = distinct.index(&texels);
        assert!(texels.iter().zip(&index).all(|(texel, i)| distinct.pairs[*i as usize] == *texel));
        let mut count = vec![0.0; distinct.pairs.len()];
        index.iter().for_each(|i| count[*i as usize] += 1.0);
        assert_eq!(count, distinct.weights);
    }

    #[test]
    fn too_many_pairs_are_rounded_by_less_than_a_step() {
        let texels = image(5000, 1e6);
        let distinct = DistinctPairs::new(&texels, 500);
        assert!(distinct.pairs.len() <= 500);
        let steps = (distinct.levels.unwrap() - 1) as f32;
        for (texel, i) in texels.iter().zip(distinct.index(&texels)) {
            let pair = distinct.pairs[i as usize];
            assert!(
                (0..2).all(|c| (pair[c] - texel[c]).abs() <= 0.501 * distinct.most[c] / steps),
                "{pair:?} {texel:?}"
            );
        }
    }

    #[test]
    fn labels_go_through_the_pairs() {
        let texels = [[0.5, 1.0], [0.1, 1.0], [0.5, 1.0], [0.1, -0.0], [0.1, 0.0]];
        let distinct = DistinctPairs::new(&texels, 100);
        assert_eq!(distinct.pairs, [[0.1, 0.0], [0.1, 1.0], [0.5, 1.0]]);
        assert_eq!(distinct.labels(&texels, &[7, 8, 9]), [9, 8, 9, 7, 7]);
        let spectra = distinct.spectra(&FrequencyGrid::default()).unwrap();
        assert!((spectra[2 * 128] - 0.5).abs() < 1e-7 && spectra.len() == 3 * 128);
        assert!(DistinctPairs::new(&[[1.5, 1.0]], 100).spectra(&FrequencyGrid::default()).is_err());
        assert_eq!(DistinctPairs::new(&[], 100).index(&[]), Vec::<u32>::new());
    }
}
