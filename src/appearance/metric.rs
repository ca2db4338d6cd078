//! Where a profile lies for the distance to be the search's [`Objective`], so that a cluster's error adds to its
//! match's.
//!
//! For weights that are the same for all targets the coordinates are √w R̂. Relative errors are measured against each
//! point's own size, which no plain distance does; but with y = √w R̂ of one channel, n coefficients and s = |y| (at
//! least √n times what counts as black), the points √n (y/s, ln s) lie as far apart as |Δy| √n/s to first order: the
//! direction and the logarithm of the length. Clusters are formed there, and each is then represented by the one
//! profile that minimises its relative errors.
//!
//! Errors in lightness go by each point's own albedo A as well: with the slope s of L*/100 there, the points √w
//! (L*/100, s R̂_1, s R̂_2 …) lie as far apart as they should to first order where shapes are alike.

use crate::colour::{lightness, lightness_slope};
use crate::search::{BLACK_RMS, Norm, Objective};

/// The coordinates of clustering.
pub(super) struct Metric {
    norm: Norm,
    coefficients: usize,
    channels: usize,
    /// √w per coefficient of a channel.
    roots: Vec<f64>,
}

impl Metric {
    pub(super) fn new(objective: &Objective, coefficients: usize, channels: usize) -> Self {
        let roots = objective.fixed_weights(coefficients).into_iter().map(f64::sqrt).collect();
        Self { norm: objective.norm, coefficients, channels, roots }
    }

    /// Coordinates of a point.
    pub(super) fn dimensions(&self) -> usize {
        self.channels * (self.coefficients + usize::from(self.norm == Norm::Relative))
    }

    /// Writes the coordinates of `point`, `[channel][coefficient]`.
    pub(super) fn place(&self, point: &[f64], coordinates: &mut [f64]) {
        let relative = self.norm == Norm::Relative;
        let (lengths, directions) = coordinates.split_at_mut(if relative { self.channels } else { 0 });
        for (c, channel) in point.chunks(self.coefficients).enumerate() {
            let to_unit = self.share(channel).sqrt();
            if relative {
                lengths[c] = self.root_n() * libm::log(self.size(channel));
            }
            let at = c * self.coefficients;
            let scaled = channel.iter().zip(&self.roots).map(|(r, root)| to_unit * root * r);
            directions[at..at + self.coefficients].iter_mut().zip(scaled).for_each(|(to, value)| *to = value);
            if self.norm == Norm::Natural {
                directions[at] = self.roots[0] * lightness(channel[0]) / 100.0;
            }
        }
    }

    /// The point that stands for a cluster with centroid `coordinates`, whose members are given with their weights.
    pub(super) fn centroid<'a>(
        &self,
        coordinates: &[f64],
        members: impl Iterator<Item = (&'a [f64], f64)> + Clone,
    ) -> Vec<f64> {
        let dims = self.channels * self.coefficients;
        let fixed = !matches!(self.norm, Norm::Relative | Norm::Natural);
        if fixed && self.roots.iter().all(|root| *root > 0.0) {
            return coordinates[..dims].iter().zip(self.roots.iter().cycle()).map(|(x, root)| x / root).collect();
        }
        let (mut sum, mut mass) = (vec![0.0; dims], vec![0.0; self.channels]);
        for (point, weight) in members {
            for (c, channel) in point.chunks(self.coefficients).enumerate() {
                let share = weight * self.share(channel);
                mass[c] += share;
                let at = c * self.coefficients;
                sum[at..at + self.coefficients].iter_mut().zip(channel).for_each(|(sum, r)| *sum += share * r);
            }
        }
        sum.iter().enumerate().map(|(i, sum)| sum / mass[i / self.coefficients].max(f64::MIN_POSITIVE)).collect()
    }

    /// What a point's own size makes of the weights of its errors.
    fn share(&self, channel: &[f64]) -> f64 {
        match self.norm {
            Norm::Natural => lightness_slope(channel[0]).powi(2),
            Norm::Relative => (self.root_n() / self.size(channel)).powi(2),
            Norm::L2 | Norm::Spatial => 1.0,
        }
    }

    /// |y| of one channel, or what counts as black.
    fn size(&self, channel: &[f64]) -> f64 {
        let square: f64 = channel.iter().zip(&self.roots).map(|(r, root)| (root * r).powi(2)).sum();
        square.sqrt().max(BLACK_RMS * self.root_n())
    }

    fn root_n(&self) -> f64 {
        (self.coefficients as f64).sqrt()
    }
}
