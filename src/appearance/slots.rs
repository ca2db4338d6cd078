//! Stackings aligned to one sequence of slots, ready for interpolation.

use super::{
    align::{AlignedStackings, MixedSlot},
    blends::BlendTable,
    limits::SlotLimits,
    textured::Footprint,
};
use crate::{optics::ResinId, sdf::DepthRange, search::ResinLimit, voxel::MaterialId};

/// Rows of slot bottoms, one row per stacking.
#[derive(Debug, Clone, PartialEq)]
pub struct SlotTable {
    /// Material of every slot, of mixtures the one there is most of; then the core's.
    ids: Vec<MaterialId>,
    /// What of the slots are mixtures.
    mixed: Vec<BlendTable>,
    /// For every slot, and the core, which of `mixed` it is; [`Self::PURE`] for the others.
    mixed_of: Vec<u8>,
    limits: SlotLimits,
    /// Depth to which the limits can change what interpolation gives, mm.
    reach: f32,
    stride: usize,
    /// Depth at which each slot ends, mm; rows of `stride`, the surplus infinite.
    bottoms: Vec<f32>,
    thickness: f64,
}

/// What a slot is: a material, or one of the table's mixtures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SlotFilling {
    /// One resin.
    Pure(MaterialId),
    /// Its place in [`SlotTable::mixed`].
    Mixed(usize),
}

/// Least and greatest bottom of every slot, mm.
#[derive(Debug, Clone)]
pub struct SlotRanges {
    /// Least.
    pub low: [f32; SlotTable::MAX_STRIDE],
    /// Greatest.
    pub high: [f32; SlotTable::MAX_STRIDE],
}

impl SlotTable {
    /// Most slots of a sequence, rounded up to whole vectors. Depth 12 and seven resins align within 60.
    pub const MAX_STRIDE: usize = 64;
    /// Floats per vector; rows are padded to it.
    const LANES: usize = 8;

    /// A table of `stackings`, whose slots are printed as `ids` and keep `limits` (one per resin), over `core`. `None`
    /// if there are more slots than [`Self::MAX_STRIDE`].
    pub fn new(
        ids: &[MaterialId],
        stackings: &AlignedStackings,
        limits: &[ResinLimit],
        core: MaterialId,
    ) -> Option<Self> {
        let stride = ids.len().max(1).next_multiple_of(Self::LANES);
        if stride > Self::MAX_STRIDE {
            return None;
        }
        let bottoms = stackings.bottoms();
        let mut padded = vec![f32::INFINITY; stackings.len * stride];
        for (row, bottoms) in padded.chunks_mut(stride).zip(bottoms.chunks(ids.len().max(1))) {
            for (cell, &bottom) in row.iter_mut().zip(bottoms) {
                *cell = bottom as f32;
            }
        }
        let resins = (0..stackings.sequence.len()).map(|slot| stackings.resins(slot));
        let limits = SlotLimits::of_slots(resins, limits);
        Some(Self {
            mixed: Vec::new(),
            mixed_of: vec![Self::PURE; ids.len() + 1],
            ids: ids.iter().copied().chain([core]).collect(),
            reach: limits.reach(),
            limits,
            stride,
            bottoms: padded,
            // In the precision of the table, so that what ends here has ended there.
            thickness: f64::from(bottoms.iter().fold(0.0_f32, |most, &bottom| most.max(bottom as f32))),
        })
    }

    /// The same for stackings some of whose slots are mixtures, with the material that each resin is printed as.
    pub fn with_mixtures(
        id: impl Fn(ResinId) -> MaterialId,
        stackings: &AlignedStackings,
        limits: &[ResinLimit],
        core: MaterialId,
    ) -> Option<Self> {
        let ids: Vec<_> = stackings.sequence.iter().map(|&resin| id(resin)).collect();
        let mut table = Self::new(&ids, stackings, limits, core)?;
        // Marks for voxels of mixtures whose resin is still to be found.
        let used: Vec<_> =
            (0..stackings.sequence.len()).flat_map(|slot| stackings.resins(slot)).map(|r| id(*r)).collect();
        let mut marks = (1..=u8::MAX).rev().map(MaterialId).filter(|mark| *mark != core && !used.contains(mark));
        for mixed in &stackings.mixed {
            let MixedSlot { slot, .. } = *mixed;
            let thickness: Vec<_> = (0..stackings.len).map(|stacking| stackings.row(stacking)[slot]).collect();
            let blends = BlendTable::new(mixed, &thickness, &id, marks.next()?);
            table.ids[slot] = blends.mostly();
            table.mixed_of[slot] = table.mixed.len() as u8;
            table.mixed.push(blends);
        }
        Some(table)
    }

    /// Marks a slot of one resin.
    const PURE: u8 = u8::MAX;

    /// What of the slots are mixtures.
    pub fn mixed(&self) -> &[BlendTable] {
        &self.mixed
    }

    /// A slot's place among the mixtures, if it is one.
    #[inline(always)]
    pub(super) fn place(&self, slot: usize) -> Option<usize> {
        let place = self.mixed_of[slot];
        (place != Self::PURE).then_some(usize::from(place))
    }

    /// What stands for the slot where its resin need not be known: its material, or the mark of its mixture.
    fn mark(&self, slot: usize) -> SlotFilling {
        self.place(slot).map_or(SlotFilling::Pure(self.ids[slot]), SlotFilling::Mixed)
    }

    /// The material of a voxel in `slot`, of that rank, where the texels of `footprint` meet.
    #[inline(always)]
    pub fn material_in(&self, slot: usize, footprint: &Footprint, rank: u16) -> MaterialId {
        match self.place(slot) {
            None => self.ids[slot],
            Some(place) => self.mixed[place].material(footprint, rank),
        }
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

    #[inline(always)]
    fn vectors(&self, label: u16) -> &[[f32; Self::LANES]] {
        self.bottoms(label).as_chunks().0
    }

    /// Depth below which every stacking has ended, mm.
    pub fn thickness(&self) -> f64 {
        self.thickness
    }

    /// What lies below all slots.
    pub fn core(&self) -> MaterialId {
        self.ids[self.slots()]
    }

    /// The slot at `depth` mm where the texels of `footprint` meet, or the one past the last; `scratch` holds a row.
    #[inline(always)]
    pub fn slot(&self, scratch: &mut [f32; Self::MAX_STRIDE], footprint: &Footprint, depth: f32) -> usize {
        if footprint.single().is_none() && depth > self.reach {
            self.passed_between(footprint, depth)
        } else {
            passed(self.row(scratch, footprint, depth), depth)
        }
    }

    /// The slot at a `depth` where limits change nothing, and where a footprint of one stacking has it on one
    /// texel; `None` at others.
    #[inline(always)]
    pub fn slot_below_limits(&self, footprint: &Footprint, depth: f32) -> Option<usize> {
        // Not by a closure: it would be built for the plainest instruction set.
        if depth > self.reach { Some(self.passed_between(footprint, depth)) } else { None }
    }

    /// [`passed`] of the mean of four rows, without writing it down.
    #[inline(always)]
    fn passed_between(&self, footprint: &Footprint, depth: f32) -> usize {
        let [a, b, c, d] = footprint.labels;
        let rows = [self.vectors(a), self.vectors(b), self.vectors(c), self.vectors(d)];
        let mut counts = [0; Self::LANES];
        for (((a, b), c), d) in rows[0].iter().zip(rows[1]).zip(rows[2]).zip(rows[3]) {
            for (lane, count) in counts.iter_mut().enumerate() {
                // Beyond the slots this is infinite or, for a weight of 0, not a number: not passed either way.
                *count += u32::from(depth >= footprint.mean([a[lane], b[lane], c[lane], d[lane]]));
            }
        }
        counts.iter().sum::<u32>() as usize
    }

    /// The bottoms where the texels of `footprint` meet, within the limits as far as they matter from `depth` mm on;
    /// `scratch` may hold them.
    #[inline(always)]
    pub fn row<'a>(&'a self, scratch: &'a mut [f32; Self::MAX_STRIDE], footprint: &Footprint, depth: f32) -> &'a [f32] {
        if let Some(label) = footprint.single() {
            return self.bottoms(label);
        }
        let rows = footprint.labels.map(|label| self.bottoms(label));
        let blended = &mut scratch[..self.stride];
        for (slot, bottom) in blended.iter_mut().enumerate() {
            *bottom = footprint.mean(rows.map(|row| row[slot]));
        }
        let slots = self.slots();
        blended[slots..].fill(f32::INFINITY); // 0 · ∞ is not a number
        // Means of rows that keep their limits break none but a min-depth, and that only above it.
        if depth <= self.reach {
            self.limits.enforce(&mut blended[..slots]);
        }
        blended
    }

    /// The material of every slot, of mixtures the one there is most of; then the core's.
    pub fn ids(&self) -> &[MaterialId] {
        &self.ids
    }

    /// What all depths in `range` are, if that is certain.
    pub fn certain(&self, SlotRanges { low, high }: &SlotRanges, range: DepthRange) -> Option<SlotFilling> {
        let slots = self.slots();
        let [min, max] = Self::rounded_out(range);
        self.limits.certain(&low[..slots], &high[..slots], min, max).map(|slot| self.mark(slot))
    }

    /// A range of depths in single precision that holds `range`. No depth is negative, and the first slot begins at 0.
    pub fn rounded_out(range: DepthRange) -> [f32; 2] {
        [(range.min as f32).next_down().max(0.0), (range.max as f32).next_up()]
    }

    /// Calls `visit` for stretches of depth, from one (mm) to below another, that certainly are one slot's.
    pub fn for_certain_depths(
        &self,
        SlotRanges { low, high }: &SlotRanges,
        mut visit: impl FnMut(f32, f32, SlotFilling),
    ) {
        let slots = self.slots();
        for slot in 0..=slots {
            if let Some((from, to)) = self.limits.certain_depths(&low[..slots], &high[..slots], slot)
                && from < to
            {
                visit(from, to, self.mark(slot));
            }
        }
    }

    pub(super) fn slots(&self) -> usize {
        self.ids.len() - 1
    }
}

/// Number of slots that end at or above `depth`.
#[inline(always)]
fn passed(bottoms: &[f32], depth: f32) -> usize {
    bottoms.iter().map(|&bottom| u32::from(depth >= bottom)).sum::<u32>() as usize
}
