//! A slot of mixtures: which resin of it a voxel gets.
//!
//! Between texels the amounts of the resins, thickness × share, are interpolated, so that a resin's share is the mean
//! of the texels' shares, weighted by the thickness that the slot has at each. A voxel's rank decides: the resins share
//! out the ranks in a fixed order. A mean lies between the least and the greatest of what it is made of; that tells for
//! most ranks what their resin is anywhere under a triangle.

use super::{align::MixedSlot, filling::Blend, textured::Footprint};
use crate::{
    optics::ResinId,
    voxel::{MaterialId, ThresholdMask},
};

/// The shares of a slot's resins in all stackings.
#[derive(Debug, Clone, PartialEq)]
pub struct BlendTable {
    /// The resins as they are printed.
    ids: Vec<MaterialId>,
    /// What stands for the slot in voxels whose resin is still to be found; no resin's id.
    mark: MaterialId,
    /// Amounts of the resins up to each, mm, row-major `[stacking][resin]`; the last is the slot's thickness.
    pub(super) amounts: Vec<f32>,
    /// What is distinct of the stackings' shares.
    blends: Vec<Blend>,
    /// Which of `blends` each stacking has; [`Self::ABSENT`] where it skips the slot.
    blend_of: Vec<u16>,
}

/// What is known of a slot's shares under some triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shares {
    /// The slot is nowhere there.
    Absent,
    /// They are those of one blend.
    Fixed(u16),
    /// They vary.
    Vary,
}

impl Shares {
    /// What is known of two places together.
    pub fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Absent, shares) | (shares, Self::Absent) => shares,
            (Self::Fixed(a), Self::Fixed(b)) if a == b => self,
            _ => Self::Vary,
        }
    }
}

/// How far from a level f32 amounts may take a rank for certain.
const SURE: u16 = 1;

impl BlendTable {
    const ABSENT: u16 = u16::MAX;

    /// The slot `mixed`, whose thickness is given by stacking.
    pub fn new(mixed: &MixedSlot, thickness: &[f64], id: impl Fn(ResinId) -> MaterialId, mark: MaterialId) -> Self {
        let ids: Vec<_> = mixed.resins.iter().map(|&resin| id(resin)).collect();
        let (mut amounts, mut blends, mut blend_of) = (Vec::new(), Vec::new(), Vec::new());
        for (stacking, &thickness) in thickness.iter().enumerate() {
            let shares = mixed.row(stacking);
            let mut sum = 0.0;
            amounts.extend(shares.iter().map(|share| {
                sum += share;
                (thickness * sum) as f32
            }));
            blend_of.push(if thickness > 0.0 {
                let blend = Blend::new(ids.iter().copied().zip(shares.iter().copied()));
                let known = blends.iter().position(|known| *known == blend);
                known.unwrap_or_else(|| {
                    blends.push(blend);
                    blends.len() - 1
                }) as u16
            } else {
                Self::ABSENT
            });
        }
        Self { ids, mark, amounts, blends, blend_of }
    }

    /// The resins, as they are printed, in the order that they share out ranks by.
    pub fn ids(&self) -> &[MaterialId] {
        &self.ids
    }

    /// What stands for the slot in voxels whose resin is still to be found.
    pub fn mark(&self) -> MaterialId {
        self.mark
    }

    /// What is distinct of the stackings' shares.
    pub fn blends(&self) -> &[Blend] {
        &self.blends
    }

    /// The resin that most stackings have most of.
    pub fn mostly(&self) -> MaterialId {
        let of = |id: &MaterialId| self.blends.iter().filter(|blend| blend.mostly() == *id).count();
        self.ids.iter().rev().max_by_key(|id| of(id)).copied().unwrap_or(MaterialId::BACKGROUND)
    }

    /// The resin of a voxel of that rank where the texels of `footprint` meet.
    #[inline(always)]
    pub fn material(&self, footprint: &Footprint, rank: u16) -> MaterialId {
        let count = self.ids.len();
        let rows = footprint.labels.map(|label| &self.amounts[usize::from(label) * count..][..count]);
        let mean = |resin: usize| footprint.mean(rows.map(|row| row[resin]));
        // The middle of the rank's share of the thickness.
        let at = mean(count - 1) * ((f32::from(rank) + 0.5) / ThresholdMask::LEVELS as f32);
        let resin = (0..count - 1).map(|resin| usize::from(at >= mean(resin))).sum::<usize>();
        self.ids[resin]
    }

    /// What is known of the shares where the stackings `labels` are.
    pub fn shares(&self, labels: &[u16]) -> Shares {
        let of = labels.iter().map(|&label| match self.blend_of[usize::from(label)] {
            Self::ABSENT => Shares::Absent,
            blend => Shares::Fixed(blend),
        });
        of.fold(Shares::Absent, Shares::and)
    }

    /// For each resin but the last: ranks below the first of the two levels are its or an earlier one's for certain
    /// where the stackings `labels` are, those from the second on for certain a later one's.
    pub fn levels(&self, labels: &[u16], levels: &mut Vec<[u16; 2]>) {
        let count = self.ids.len();
        for resin in 0..count - 1 {
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            for &label in labels {
                let row = &self.amounts[usize::from(label) * count..][..count];
                if row[count - 1] > 0.0 {
                    let share = row[resin] / row[count - 1];
                    (low, high) = (low.min(share), high.max(share));
                }
            }
            let level = |share: f32| share * ThresholdMask::LEVELS as f32;
            // Without the slot nothing is said of it: `as` saturates.
            levels.push([(level(low) as u16).saturating_sub(SURE), (level(high).ceil() as u16).saturating_add(SURE)]);
        }
    }
}
