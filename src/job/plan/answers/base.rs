//! A stacking as numbers: thicknesses of its layers, then shares of its top layer; and what light goes through with
//! them, over the core or up to the middle of a thin part.

use crate::optics::{Mixture, ResinId};

/// What lies below the layers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Below {
    /// The core, without an end.
    Core,
    /// The core, up to the middle of a part at this depth, mm; then the mirror image of all.
    CoreToMiddle(f64),
    /// The last layer, up to the middle of a part at this depth, mm; then the mirror image of all.
    Middle(f64),
}

/// What was found for a cluster.
#[derive(Debug)]
pub(super) struct Base {
    pub layers: Vec<(Mixture, f64)>,
    /// Index of its model.
    pub model: usize,
    /// What the top layer mostly is, and what else it may be, where it may be mixed.
    pub top: Option<(ResinId, Vec<ResinId>)>,
    /// Albedo per channel that the model promises of a flat slab.
    pub promised: Vec<f64>,
}

/// Most that a step may change ln thickness, or shares in their unit.
const LONGEST: f64 = 0.7;
const MOST_SHARES: f64 = 3.0;
/// Unit of shares of the top layer in a step.
pub(super) const SHARE: f64 = 0.05;
/// Most of the top layer that may be other than what it mostly is. In thin places, which lie along sharp edges too,
/// dark prints need all that they can get, for light comes in by another face.
const MIXED: f64 = 0.8;
const MIXED_WHERE_THIN: f64 = 1.0;
/// Part of a thin place that squeezed layers take.
const SQUEEZED: f64 = 0.85;

impl Below {
    /// Depth of the middle of a thin part, mm.
    pub fn middle_mm(self) -> Option<f64> {
        match self {
            Self::Core => None,
            Self::CoreToMiddle(half) | Self::Middle(half) => Some(half),
        }
    }

    /// Most of the top layer that may be other than what it mostly is.
    pub fn most_mixed(self) -> f64 {
        if self == Self::Core { MIXED } else { MIXED_WHERE_THIN }
    }
}

impl Base {
    /// The last layer that is one, not a slot that was found to be skipped.
    pub fn last(&self) -> Option<usize> {
        self.layers.iter().rposition(|layer| layer.1 > 0.0)
    }

    /// The share of all thicknesses that a thin part has room for.
    pub fn room(&self, below: Below) -> f64 {
        let whole: f64 = self.layers.iter().map(|layer| layer.1).sum();
        below.middle_mm().map_or(1.0, |half| (SQUEEZED * half / whole.max(f64::MIN_POSITIVE)).min(1.0))
    }

    /// Thicknesses of the layers in mm, then shares of the top layer.
    pub fn numbers(&self) -> Vec<f64> {
        let thickness = self.layers.iter().map(|layer| layer.1);
        let others = self.top.iter().flat_map(|(_, others)| others);
        thickness.chain(others.map(|resin| self.layers[0].0.share(*resin))).collect()
    }

    /// Thicknesses of what light goes through, mm: the layers, cut off at the middle of a thin part, and what lies
    /// between the last and that.
    pub fn thicknesses(&self, numbers: &[f64], below: Below) -> Vec<f64> {
        let mut mm: Vec<f64> = numbers[..self.layers.len()].to_vec();
        if let Some(half) = below.middle_mm() {
            let mut left = half;
            for mm in &mut mm {
                *mm = mm.min(left);
                left -= *mm;
            }
            if let (Below::Middle(_), Some(last)) = (below, self.last()) {
                mm[last] += std::mem::take(&mut left);
            }
            mm.push(left);
        } else if mm.is_empty() {
            mm.push(0.0);
        }
        mm
    }

    /// The top layer, where it may be mixed.
    pub fn mixed_top(&self, numbers: &[f64]) -> Option<Mixture> {
        self.top.as_ref().and_then(|_| self.mixtures(numbers).next())
    }

    /// The mixtures of all layers.
    pub fn mixtures<'a>(&'a self, numbers: &'a [f64]) -> impl Iterator<Item = Mixture> + 'a {
        let shares = &numbers[self.layers.len()..];
        let top = self.top.as_ref().and_then(|(carrier, others)| {
            let rest = 1.0 - shares.iter().sum::<f64>();
            Mixture::new(others.iter().copied().zip(shares.iter().copied()).chain([(*carrier, rest)]))
        });
        let first = top
            .into_iter()
            .chain(self.top.is_none().then(|| self.layers.first().map(|layer| layer.0.clone())).flatten());
        first.chain(self.layers.iter().skip(1).map(|layer| layer.0.clone()))
    }

    /// Moves a number by `step`: a thickness by a factor, a share by so many of its unit.
    pub fn shift(&self, numbers: &mut [f64], n: usize, step: f64) {
        if n < self.layers.len() {
            numbers[n] *= libm::exp(step.clamp(-LONGEST, LONGEST));
        } else {
            numbers[n] += SHARE * step.clamp(-MOST_SHARES, MOST_SHARES);
        }
    }
}
