//! What a stretch of depth is filled with: one resin, or several that a mask of thresholds shares the voxels out to.

use multiversion::multiversion;

use crate::voxel::{BRICK_VOXELS, MaterialId, ThresholdMask};

/// What fills a stretch of depth everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filling {
    /// One resin.
    Pure(MaterialId),
    /// Resins in fixed shares: which of the layers' [`Blend`]s.
    Mixed(u16),
}

/// Resins in fixed shares of the volume. The same resins in the same order divide the ranks of every mixture of a
/// slot, so that where shares change slowly from place to place few voxels change.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Blend {
    /// A resin has the ranks below this that none before it has; the last one's is [`ThresholdMask::LEVELS`].
    parts: Vec<(u16, MaterialId)>,
}

impl Blend {
    /// Resins with their shares, which are to sum to 1; at least one.
    pub fn new(parts: impl IntoIterator<Item = (MaterialId, f64)>) -> Self {
        let mut sum = 0.0;
        let cumulated = parts.into_iter().map(|(id, share)| {
            sum += share;
            (ThresholdMask::level(sum), id)
        });
        let mut parts: Vec<_> = cumulated.collect();
        if let Some(last) = parts.last_mut() {
            last.0 = ThresholdMask::LEVELS as u16;
        }
        Self { parts }
    }

    /// The resin of a voxel of that rank.
    #[inline]
    pub fn at(&self, rank: u16) -> MaterialId {
        let part = self.parts.iter().find(|part| rank < part.0).or(self.parts.last());
        part.map_or(MaterialId::BACKGROUND, |part| part.1)
    }

    /// The resins with their shares, 0 to 1.
    pub fn shares(&self) -> impl Iterator<Item = (MaterialId, f64)> {
        let below = std::iter::once(0).chain(self.parts.iter().map(|part| part.0));
        let share = |levels: u16| f64::from(levels) / ThresholdMask::LEVELS as f64;
        self.parts.iter().zip(below).map(move |(&(level, id), below)| (id, share(level - below)))
    }

    /// The resins of a brick's voxels, from their ranks.
    pub fn lay(&self, ranks: &[u16; BRICK_VOXELS], ids: &mut [u8; BRICK_VOXELS]) {
        lay(&self.parts, ranks, ids);
    }

    /// The resin with the greatest share, the first of equals.
    pub fn mostly(&self) -> MaterialId {
        let mut below = 0;
        let mut most = (0, MaterialId::BACKGROUND);
        for &(level, id) in &self.parts {
            if level - below > most.0 {
                most = (level - below, id);
            }
            below = level;
        }
        most.1
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn lay(parts: &[(u16, MaterialId)], ranks: &[u16; BRICK_VOXELS], ids: &mut [u8; BRICK_VOXELS]) {
    for &(level, id) in parts.iter().rev() {
        for (to, rank) in ids.iter_mut().zip(ranks) {
            *to = if *rank < level { id.0 } else { *to };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_shared_out() {
        let blend = Blend::new([(MaterialId(4), 0.25), (MaterialId(2), 0.5), (MaterialId(9), 0.25)]);
        let mut counts = [0; 10];
        let mut ids = [0; BRICK_VOXELS];
        for brick in 0..ThresholdMask::LEVELS / BRICK_VOXELS {
            let ranks = std::array::from_fn(|n| (n * 64 + brick) as u16);
            blend.lay(&ranks, &mut ids);
            for (id, rank) in ids.iter().zip(ranks) {
                assert_eq!(*id, blend.at(rank).0);
                counts[usize::from(*id)] += 4;
            }
        }
        assert_eq!([2, 4, 9].map(|id| counts[id]), [2, 1, 1].map(|part| part * ThresholdMask::LEVELS));
        assert_eq!(blend.mostly(), MaterialId(2));
    }
}
