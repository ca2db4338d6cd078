//! Stackings aligned to one sequence of slots, ready for interpolation.

use super::textured::Footprint;
use crate::{sdf::DepthRange, search::ResinLimit, voxel::MaterialId};

/// Rows of slot bottoms, one row per stacking.
#[derive(Debug, Clone, PartialEq)]
pub struct SlotTable {
    /// Material of every slot, then the core's.
    ids: Vec<MaterialId>,
    /// What the resin of each slot may do.
    limits: Vec<ResinLimit>,
    /// Whether any of them forbids anything.
    limited: bool,
    stride: usize,
    /// Depth at which each slot ends, mm; rows of `stride`, the surplus infinite.
    bottoms: Vec<f32>,
    thickness: f64,
}

impl SlotTable {
    /// Most slots of a sequence, rounded up to whole vectors. Depth 12 and seven resins align within 60.
    pub const MAX_STRIDE: usize = 64;
    /// Floats per vector; rows are padded to it.
    const LANES: usize = 8;

    /// A table of `bottoms` (mm, ascending in each row of `slots.len()`), where each slot has a material and its limit.
    /// `None` if there are more slots than [`Self::MAX_STRIDE`].
    pub fn new(slots: &[(MaterialId, ResinLimit)], bottoms: &[f64], core: MaterialId) -> Option<Self> {
        let stride = slots.len().max(1).next_multiple_of(Self::LANES);
        if stride > Self::MAX_STRIDE {
            return None;
        }
        let rows = bottoms.chunks(slots.len().max(1));
        let padded = rows.flat_map(|row| {
            let surplus = std::iter::repeat_n(f32::INFINITY, stride - row.len());
            row.iter().map(|&bottom| bottom as f32).chain(surplus)
        });
        Some(Self {
            ids: slots.iter().map(|slot| slot.0).chain([core]).collect(),
            limits: slots.iter().map(|slot| slot.1).collect(),
            limited: slots.iter().any(|slot| slot.1.min_depth_mm > 0.0 || slot.1.min_mm > 0.0),
            stride,
            bottoms: padded.collect(),
            // In the precision of the table, so that what ends here has ended there.
            thickness: f64::from(bottoms.iter().fold(0.0_f32, |most, &bottom| most.max(bottom as f32))),
        })
    }

    /// Length of a row.
    #[inline(always)]
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// The row of a stacking.
    #[inline(always)]
    pub fn bottoms(&self, label: u16) -> &[f32] {
        let start = usize::from(label) * self.stride;
        &self.bottoms[start..start + self.stride]
    }

    /// Depth below which every stacking has ended, mm.
    pub fn thickness(&self) -> f64 {
        self.thickness
    }

    /// What lies below all slots.
    pub fn core(&self) -> MaterialId {
        self.ids[self.limits.len()]
    }

    /// The material at `depth` mm where the texels of `footprint` meet; `scratch` holds a row.
    #[inline(always)]
    pub fn material(&self, scratch: &mut [f32; Self::MAX_STRIDE], footprint: &Footprint, depth: f32) -> MaterialId {
        if let Some(label) = footprint.single() {
            return self.ids[passed(self.bottoms(label), depth)];
        }
        let rows = footprint.labels.map(|label| self.bottoms(label));
        let blended = &mut scratch[..self.stride];
        let [a, b, c, d] = footprint.weights;
        for (slot, bottom) in blended.iter_mut().enumerate() {
            *bottom = a * rows[0][slot] + b * rows[1][slot] + c * rows[2][slot] + d * rows[3][slot];
        }
        let slots = self.limits.len();
        blended[slots..].fill(f32::INFINITY); // 0 · ∞ is not a number
        if self.limited {
            self.enforce(&mut blended[..slots]);
        }
        self.ids[passed(blended, depth)]
    }

    fn enforce(&self, _bottoms: &mut [f32]) {}

    /// The material of all depths in `range`, given that the bottom of slot s lies in `low[s]..=high[s]`, if it is certain.
    pub fn certain(&self, low: &[f32], high: &[f32], range: DepthRange) -> Option<MaterialId> {
        let slots = self.limits.len();
        let min = range.min.max(0.0);
        let slot = high[..slots].iter().take_while(|&&high| f64::from(high) <= min).count();
        if slot == slots {
            return Some(self.ids[slots]);
        }
        if range.max >= f64::from(low[slot]) {
            return None;
        }
        let limit = &self.limits[slot];
        let top = if slot == 0 { 0.0 } else { f64::from(high[slot - 1]) };
        let unhindered = min >= limit.min_depth_mm && f64::from(low[slot]) - top >= limit.min_mm;
        unhindered.then(|| self.ids[slot])
    }
}

/// Number of slots that end at or above `depth`.
#[inline(always)]
fn passed(bottoms: &[f32], depth: f32) -> usize {
    bottoms.iter().map(|&bottom| usize::from(depth >= bottom)).sum()
}
