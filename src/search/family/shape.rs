//! One order of slots that all stackings of a family have, and the numbers that tell them apart.
//!
//! The numbers of a stacking are the thicknesses of its slots, mm, and then, for every slot of several resins, the
//! shares of all but the first.

use crate::{
    numeric::rounding::rounded,
    optics::{Grains, Mixed, Mixture, ResinId, Stack, VolumeCoefficients},
    search::{
        ResinLimit, SearchOptions,
        refine::polytope::{Constraint, Polytope},
    },
};

/// Thicknesses, mm, and shares below this are none.
const NOTHING: f64 = 1e-6;

/// A place in the order of layers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Slot {
    /// What may be there: one resin, or several, mixed; the first makes up what the others leave.
    pub resins: Vec<usize>,
    /// Least thickness, mm.
    pub least_mm: f64,
}

/// An order of slots.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shape {
    /// From the observer down, at least one.
    pub slots: Vec<Slot>,
}

impl Shape {
    /// Numbers of a stacking.
    pub fn len(&self) -> usize {
        self.slots.len() + self.slots.iter().map(|slot| slot.resins.len() - 1).sum::<usize>()
    }

    /// Where the shares of each slot's resins but the first stand.
    fn shares(&self) -> impl Iterator<Item = (&Slot, std::ops::Range<usize>)> {
        let mut at = self.slots.len();
        self.slots.iter().map(move |slot| {
            let first = at;
            at += slot.resins.len() - 1;
            (slot, first..at)
        })
    }

    /// The resins of each slot with their shares.
    fn parts<'a>(&'a self, x: &'a [f64]) -> impl Iterator<Item = Vec<(usize, f64)>> + 'a {
        self.shares().map(|(slot, range)| {
            let shares: Vec<f64> = x[range].iter().map(|share| share.clamp(0.0, 1.0)).collect();
            let rest = (1.0 - shares.iter().sum::<f64>()).max(0.0);
            slot.resins.iter().copied().zip([rest].into_iter().chain(shares)).collect()
        })
    }

    /// The stacking: every slot, those of no thickness too.
    pub fn stacking(&self, x: &[f64], core: Option<ResinId>) -> Stack<Mixture> {
        let mixture = |parts: Vec<(usize, f64)>| {
            let sum: f64 = parts.iter().map(|part| part.1).sum();
            let first = ResinId(parts[0].0);
            Mixture::new(parts.iter().map(|&(resin, share)| (ResinId(resin), share / sum))).unwrap_or(first.into())
        };
        let mm = x.iter().map(|mm| mm.max(0.0));
        Stack::new(self.parts(x).map(mixture).zip(mm)).over(core.map(Mixture::from))
    }

    /// What is there to rounding only is not there, and no number has more digits than every processor agrees on.
    pub fn tidy(&self, x: &mut [f64]) {
        x.iter_mut().for_each(|value| *value = if value.abs() < NOTHING { 0.0 } else { rounded(*value) });
    }

    /// Of the slots that may be left out, the thinnest that is there and thinner than `least_mm`.
    pub fn thin_slot(&self, x: &[f64], least_mm: f64) -> Option<usize> {
        let is_thin = |&slot: &usize| self.slots[slot].least_mm == 0.0 && x[slot] > 0.0 && x[slot] < least_mm - NOTHING;
        (0..self.slots.len()).filter(is_thin).min_by(|&a, &b| x[a].total_cmp(&x[b]))
    }

    /// Coefficients of the slots of several resins in one channel, with the changes that each share makes; `resins`
    /// are all resins' coefficients in the channel.
    pub fn mixed(&self, x: &[f64], resins: &[VolumeCoefficients], grains: Grains) -> Vec<Mixed> {
        let mixed = self.parts(x).filter(|parts| parts.len() > 1).map(|parts| {
            let parts: Vec<_> = parts.iter().map(|&(resin, part)| (resins[resin], part)).collect();
            let there: Vec<_> = parts.iter().filter(|part| part.1 != 0.0).copied().collect();
            let tangents = (1..parts.len()).map(|at| grains.slope(&parts, at, 0)).collect();
            Mixed { tangents, volume: grains.mixed(&there) }
        });
        mixed.collect()
    }

    /// What a job and a printer allow within `room_mm`; `None` where nothing is.
    pub fn limits(&self, options: &SearchOptions, room_mm: f64, thin: bool) -> Option<Polytope> {
        let limit = |resin: usize| options.limits.get(resin).copied().unwrap_or(ResinLimit::NONE);
        let (n, slots) = (self.len(), self.slots.len());
        let row = |value: &dyn Fn(usize) -> f64| (0..n).map(value).collect::<Vec<f64>>();
        let only = |at: usize, sign: f64| row(&|i| if i == at { sign } else { 0.0 });
        let mut constraints = Vec::new();
        for (at, slot) in self.slots.iter().enumerate() {
            let of_slot = ResinLimit::all(slot.resins.iter().map(|&resin| limit(resin)));
            let (depth_mm, least_mm) = (of_slot.min_depth_mm, of_slot.min_mm.max(slot.least_mm));
            let most_mm = of_slot.max_mm;
            // What has no room is left out.
            let fits = depth_mm + least_mm <= room_mm;
            if !fits && (at > 0 && !thin) {
                return None;
            }
            let (least_mm, most_mm) = match fits {
                true => (least_mm, most_mm),
                false if at == 0 => (room_mm, room_mm),
                false => (0.0, 0.0),
            };
            if least_mm > most_mm {
                return None;
            }
            constraints.push(Constraint { a: only(at, 1.0), b: least_mm });
            if most_mm.is_finite() {
                constraints.push(Constraint { a: only(at, -1.0), b: -most_mm });
            }
            if depth_mm > 0.0 && fits {
                if at == 0 {
                    return None;
                }
                constraints.push(Constraint { a: row(&|i| if i < at { 1.0 } else { 0.0 }), b: depth_mm });
            }
        }
        if let Some(core) = options.core {
            let depth_mm = limit(core.0).min_depth_mm.min(room_mm);
            if depth_mm > 0.0 {
                constraints.push(Constraint { a: row(&|i| if i < slots { 1.0 } else { 0.0 }), b: depth_mm });
            }
        }
        constraints.push(Constraint { a: row(&|i| if i < slots { -1.0 } else { 0.0 }), b: -room_mm });
        for (_, range) in self.shares().filter(|(_, range)| !range.is_empty()) {
            constraints.extend(range.clone().map(|share| Constraint { a: only(share, 1.0), b: 0.0 }));
            constraints.push(Constraint { a: row(&|i| if range.contains(&i) { -1.0 } else { 0.0 }), b: -1.0 });
        }
        Some(Polytope::of(constraints))
    }
}
