//! The resins' limits after interpolation.
//!
//! Every stacking keeps its limits, but a mean of two need not: between `white .2, support 2` and `black 1` the support
//! starts at 0.1 mm. The limits are re-imposed per voxel, by one pass from the top down over the runs (adjacent slots
//! of one resin joined):
//!
//! 1. What lies above its resin's min-depth is given to the run above; where there is none, the whole run is given to
//!    the next one below.
//! 2. A run thinner than its resin's min-mm is given to the run above; on top, to the run below if that may start
//!    there, else it grows to min-mm.
//! 3. A run gives what exceeds its max-mm, its own or what it was given, to the next one below.
//!
//! What is left over below the last run is the core's. After the pass no limit is violated, whatever the input; an
//! input that violates none is returned bit for bit. Where every corner of an interpolation keeps min-depth, rule 1
//! always finds a run above: the corner that has the resin has something above it.

use crate::{optics::ResinId, search::ResinLimit};

/// Depths closer than this are the same, mm: far below a printer's resolution, far above f32 rounding of depths to 100
/// mm.
const SAME_MM: f32 = 1e-4;

/// The limits of each slot of a sequence, ready for the voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct SlotLimits {
    resin: Vec<u32>,
    min_depth: Vec<f32>,
    min: Vec<f32>,
    max: Vec<f32>,
    /// Some slot has a max-mm.
    max_limited: bool,
    /// Greatest min-mm.
    growth: f32,
    /// Some slot has a limit at all.
    limited: bool,
}

/// Consecutive slots of one resin.
#[derive(Clone, Copy)]
struct Run {
    top: f32,
    bottom: f32,
    /// Its lowest slot.
    slot: usize,
}

/// Re-imposes `limits` (one per resin; a resin beyond them has none) on one row of `bottoms` over `sequence`. See
/// [`SlotLimits::enforce`], which is the one for many rows.
pub fn enforce_limits(bottoms: &mut [f32], sequence: &[ResinId], limits: &[ResinLimit]) -> bool {
    SlotLimits::new(sequence, limits).enforce(bottoms)
}

impl SlotLimits {
    /// `limits` holds one limit per resin; a resin beyond it has none.
    pub fn new(sequence: &[ResinId], limits: &[ResinLimit]) -> Self {
        Self::of_slots(sequence.iter().map(std::slice::from_ref), limits)
    }

    /// The same for slots of one resin or of a mixture, given by its resins: a mixture keeps the limits of them all.
    pub fn of_slots<'a>(slots: impl IntoIterator<Item = &'a [ResinId]>, limits: &[ResinLimit]) -> Self {
        let slots: Vec<&[ResinId]> = slots.into_iter().collect();
        let of = |resin: &ResinId| limits.get(resin.0).copied().unwrap_or(ResinLimit::NONE);
        let all = |resins: &&[ResinId]| ResinLimit::all(resins.iter().map(of));
        // Slots of the same resins are one run where they meet.
        let same = |resins: &&[ResinId]| slots.iter().position(|other| other == resins).unwrap_or_default() as u32;
        let column = |f: fn(ResinLimit) -> f64| slots.iter().map(|slot| f(all(slot)) as f32).collect::<Vec<f32>>();
        let (min_depth, min, max) = (column(|l| l.min_depth_mm), column(|l| l.min_mm), column(|l| l.max_mm));
        let growth = min.iter().copied().fold(0.0, f32::max);
        let max_limited = max.iter().any(|max| max.is_finite());
        Self {
            resin: slots.iter().map(same).collect(),
            limited: growth > 0.0 || max_limited || min_depth.iter().any(|depth| *depth > 0.0),
            min_depth,
            min,
            max,
            max_limited,
            growth,
        }
    }

    /// Changes `bottoms` (mm, one per slot, never decreasing, from 0 on) so that no limit is violated. Returns whether
    /// anything had to change.
    #[inline]
    pub fn enforce(&self, bottoms: &mut [f32]) -> bool {
        if !self.limited || self.surely_kept(bottoms) || self.kept(bottoms) {
            return false;
        }
        self.repair(bottoms);
        true
    }

    /// The slot whose resin has all depths `min`…`max` (mm) after [`SlotLimits::enforce`], given that the bottom of
    /// slot s before it lies in `low[s]`…`high[s]`; the number of slots for what lies below them all; `None` where that
    /// is not certain.
    ///
    /// The bottoms must be means of rows that keep the limits: then something that may lie on top always does. Limits
    /// can move the top of a run down as far as its min-depth, or as far as the greatest min-mm, which a thin layer on
    /// top may grow to; they move its bottom up only where it is too thin then. A max-mm can shift everything below it,
    /// so with one nothing but the core is certain.
    pub fn certain(&self, low: &[f32], high: &[f32], min: f32, max: f32) -> Option<usize> {
        let slot = high.iter().take_while(|high| **high <= min).count();
        let (from, to) = self.certain_depths(low, high, slot)?;
        (from <= min && max < to).then_some(slot)
    }

    /// Depth in mm below which [`SlotLimits::enforce`] changes nothing in means of rows that keep the limits.
    /// Min-depths act above themselves only; a thickness limit can shift everything.
    pub fn reach(&self) -> f32 {
        if self.max_limited || self.growth > 0.0 {
            return f32::INFINITY;
        }
        self.min_depth.iter().fold(0.0, |reach: f32, &depth| reach.max(depth))
    }

    /// The depths, from one (mm) to below another, that certainly belong to `slot`; see [`Self::certain`]. `slot` may
    /// be one past the last, for what lies below all.
    pub fn certain_depths(&self, low: &[f32], high: &[f32], slot: usize) -> Option<(f32, f32)> {
        let (top_low, top_high) = if slot == 0 { (0.0, 0.0) } else { (low[slot - 1], high[slot - 1]) };
        if slot == self.resin.len() {
            return Some((top_high, f32::INFINITY));
        }
        if !self.limited {
            return Some((top_high, low[slot]));
        }
        let pushed = if top_low < self.min_depth[slot] { self.min_depth[slot].max(self.growth) } else { self.growth };
        let thin = low[slot] - top_high.max(pushed) < self.min[slot] + 2.0 * SAME_MM;
        let on_top = top_low <= SAME_MM && self.min_depth[slot] > 0.0;
        (!thin && !on_top && !self.max_limited).then_some((top_high.max(pushed + SAME_MM), low[slot]))
    }

    /// Every slot by itself keeps its min-depth and min-mm, and none has a max-mm. No branches: most voxels end here.
    #[inline]
    fn surely_kept(&self, bottoms: &[f32]) -> bool {
        let (mut top, mut suspect) = (0.0, self.max_limited);
        for ((&bottom, min_depth), min) in bottoms.iter().zip(&self.min_depth).zip(&self.min) {
            suspect |= (bottom > top) & ((top + SAME_MM < *min_depth) | (bottom - top + SAME_MM < *min));
            top = bottom;
        }
        !suspect
    }

    /// Every run keeps its limits.
    fn kept(&self, bottoms: &[f32]) -> bool {
        let (mut slot, mut top) = (0, 0.0);
        while let Some(run) = self.next_run(bottoms, slot, top) {
            let thickness = run.bottom - run.top;
            let thin = thickness + SAME_MM < self.min[run.slot];
            if run.top + SAME_MM < self.min_depth[run.slot] || thin || thickness > self.max[run.slot] + SAME_MM {
                return false;
            }
            (slot, top) = (run.slot + 1, run.bottom);
        }
        true
    }

    /// The run of one resin that starts at `top`, the first among the slots from `slot` on.
    #[inline]
    fn next_run(&self, bottoms: &[f32], slot: usize, top: f32) -> Option<Run> {
        let first = slot + bottoms[slot..].iter().position(|bottom| *bottom > top)?;
        let mut run = Run { top, bottom: bottoms[first], slot: first };
        for (next, &bottom) in bottoms.iter().enumerate().skip(first + 1) {
            if bottom > run.bottom {
                if self.resin[next] != self.resin[first] {
                    break;
                }
                (run.bottom, run.slot) = (bottom, next);
            }
        }
        Some(run)
    }

    #[cold]
    fn repair(&self, bottoms: &mut [f32]) {
        let mut above: Option<Run> = None;
        // The slots from `slot` on hold the input from `read` mm down, those before it the result down to `done` mm.
        let (mut slot, mut read, mut done) = (0, 0.0f32, 0.0f32);
        while let Some(input) = self.next_run(bottoms, slot, read) {
            let (first, last) = (slot, input.slot);
            (slot, read) = (last + 1, input.bottom);
            if let Some(run) = &mut above
                && self.resin[run.slot] == self.resin[last]
            {
                // It joins the run above, as far as that may grow.
                let bottom = input.bottom.min(run.top + self.max[last]).max(done);
                clip(&mut bottoms[first..=last], input.top, done, bottom);
                *run = Run { top: run.top, bottom, slot: last };
                done = bottom;
                continue;
            }
            if input.bottom <= done {
                bottoms[first..=last].fill(done); // what lies above has grown over it
                continue;
            }
            let reach = above.map_or(done, |run| (run.top + self.max[run.slot]).max(done));
            let mut top = done;
            if top + SAME_MM < self.min_depth[last] {
                // Rule 1: the run above takes it down to min-depth, or, where it cannot, the run below takes all of it.
                top = self.min_depth[last].min(input.bottom);
                if above.is_none() || top > reach + SAME_MM {
                    bottoms[first..=last].fill(done);
                    continue;
                }
            }
            let mut bottom = input.bottom;
            if bottom - top + SAME_MM < self.min[last] || bottom <= top {
                // Rule 2: too thin.
                if above.is_some() {
                    top = bottom.min(reach);
                    bottom = top;
                } else if self.may_grow(bottoms, &input, done) {
                    bottom = (top + self.min[last]).min(bottoms[bottoms.len() - 1]);
                } else {
                    bottoms[first..=last].fill(done);
                    continue;
                }
            }
            // Rule 3.
            bottom = bottom.min(top + self.max[last]);
            if let Some(run) = &mut above
                && top > run.bottom
            {
                bottoms[run.slot..first].fill(top);
                run.bottom = top;
            }
            clip(&mut bottoms[first..=last], input.top, top, bottom);
            if bottom > top {
                above = Some(Run { top, bottom, slot: last });
            }
            done = bottom;
        }
        bottoms[slot..].fill(done);
    }

    /// Whether the thin run on top should grow to its min-mm: nothing below it may take its place, and there is room.
    fn may_grow(&self, bottoms: &[f32], run: &Run, top: f32) -> bool {
        let next = self.next_run(bottoms, run.slot + 1, run.bottom);
        let next_may_start = next.is_some_and(|next| self.min_depth[next.slot] <= top + SAME_MM);
        let room = bottoms.last().is_some_and(|last| top + self.min[run.slot] <= last + SAME_MM);
        !next_may_start && room
    }
}

/// Writes the slots of a run that lies in `top`…`bottom` now and began at `was` before: those before the run end where
/// it begins, those within it keep their depths as far as they can.
fn clip(bottoms: &mut [f32], was: f32, top: f32, bottom: f32) {
    for depth in bottoms.iter_mut() {
        *depth = if *depth <= was { top } else { depth.clamp(top, bottom) };
    }
    if let Some(last) = bottoms.last_mut() {
        *last = bottom;
    }
}

#[cfg(test)]
#[path = "tests/limits.rs"]
mod tests;
