//! Which orders of slots are worth a try, by the resins' coefficients and limits, and where fits start.

use super::shape::{Shape, Slot};
use crate::{
    optics::{Base, LayeredReflection, TransportOptions, VolumeCoefficients},
    search::{RefineOptions, ResinLimit, SearchOptions},
};

/// A slot of several resins is no thinner, mm: a few voxels of any printer, so that each resin has its share.
pub(crate) const LEAST_MIXED_MM: f64 = 0.2;
/// The slab that white is told by, mm.
const SLAB_MM: f64 = 1.0;
/// A resin in which light goes this much further than in white between two events, taken isotropically, is clear.
const CLEAR: f64 = 4.0;

/// An order of slots to try.
pub(super) struct Offer {
    pub shape: Shape,
    /// Whether its coats take in a resin that is clear.
    pub dilutes: bool,
}

/// Shapes, the one to be preferred first; none if no resin may be at the surface.
pub(super) fn offered(
    resins: &[Vec<VolumeCoefficients>],
    background: &[bool],
    options: &SearchOptions,
    layers: &RefineOptions,
) -> Vec<Offer> {
    let limit = |resin: usize| options.limits.get(resin).copied().unwrap_or(ResinLimit::NONE);
    let least_mm = LEAST_MIXED_MM.max(layers.min_layer_mm);
    let room = |resin: &usize| limit(*resin).max_mm >= least_mm;
    let surface = |resin: &usize| limit(*resin).min_depth_mm <= 0.0;
    let inks = (0..resins.len()).filter(|&resin| !background[resin]).filter(room);
    // Without a resin of its own at the surface, a void would do.
    let bright = |resin: &usize| brightness(&resins[*resin]);
    let Some(white) = inks.clone().filter(surface).max_by(|a, b| bright(a).total_cmp(&bright(b))) else {
        return Vec::new();
    };
    let index = |resin: usize| resins[resin][0].refractive_index;
    let mixable = inks.filter(|&resin| resin != white && index(resin) == index(white));
    // Events per mm, taken isotropically, where there are most.
    let events = |resin: usize| -> f64 {
        let all = resins[resin].iter().map(|volume| volume.sigma_s * (1.0 - volume.g) + volume.sigma_a);
        all.fold(0.0, f64::max)
    };
    let is_clear = |resin: &usize| CLEAR * events(*resin) <= events(white);
    let clear = |of: &dyn Fn(usize) -> bool| {
        let found = (0..resins.len()).filter(|&resin| resin != white && of(resin) && limit(resin).max_mm > 0.0);
        found.filter(is_clear).min_by(|&a, &b| events(a).total_cmp(&events(b)))
    };
    let clears: Vec<usize> =
        [clear(&|resin| background[resin]), clear(&|resin| !background[resin])].into_iter().flatten().collect();
    let coloured: Vec<usize> = mixable.clone().filter(|resin| !is_clear(resin)).collect();
    let with_clear: Vec<usize> = mixable.filter(|resin| !is_clear(resin) || clears.contains(resin)).collect();
    let shape = |inks: &[usize], clear: Option<usize>| {
        let upper: Vec<usize> = inks.iter().copied().filter(surface).collect();
        let mut slots = vec![slot(white, &upper, least_mm)];
        if upper.len() < inks.len() {
            // Inks that must keep off the surface.
            slots.push(slot(white, inks, least_mm));
        }
        slots.extend(clear.map(|clear| slot(clear, &[], 0.0)));
        slots.extend(clear.map(|_| slot(white, &[], 0.0)));
        Shape { slots }
    };
    let offer = |inks: &[usize], dilutes: bool| -> Vec<Offer> {
        clears.iter().map(|&clear| Offer { shape: shape(inks, Some(clear)), dilutes }).collect()
    };
    let mut offers = offer(&coloured, false);
    if with_clear.len() > coloured.len() {
        offers.extend(offer(&with_clear, true));
    }
    if offers.is_empty() {
        offers.push(Offer { shape: shape(&coloured, None), dilutes: false });
    }
    offers
}

fn slot(first: usize, others: &[usize], least_mm: f64) -> Slot {
    Slot { resins: [first].into_iter().chain(others.iter().copied()).collect(), least_mm }
}

/// What a slab of a resin reflects, on the mean over the channels.
fn brightness(volumes: &[VolumeCoefficients]) -> f64 {
    let directions = TransportOptions { polar: 4, orders: 1 };
    let one = |volume: &VolumeCoefficients| {
        let slab = LayeredReflection::new(&[Some(*volume)], &[], Base::Nothing, &[0.0], directions);
        slab.reflection(&[SLAB_MM], &[])[0]
    };
    volumes.iter().map(one).sum::<f64>() / volumes.len() as f64
}

/// Where fits start: thin and thick coats, over little and much of what is clear.
pub(super) fn starts(shape: &Shape) -> Vec<Vec<f64>> {
    let slots = shape.slots.len();
    let mixed = shape.slots.iter().filter(|slot| slot.resins.len() > 1).count();
    // Of the coats, of the clear slot and of the white one below it.
    let patterns: [([f64; 3], f64); 5] = [
        ([0.4, 0.3, 1.0], 0.05),
        ([0.3, 2.0, 1.0], 0.05),
        ([0.3, 3.0, 0.05], 0.03),
        ([1.2, 0.05, 0.05], 0.2),
        ([0.25, 0.8, 2.0], 0.5),
    ];
    let start = |(mm, ink): &([f64; 3], f64)| {
        let coats = slots.saturating_sub(2).max(1);
        let thickness = |slot: usize| if slot < coats { mm[0] / coats as f64 } else { mm[slot - coats + 1] };
        let shares = shape.len() - slots;
        let share = ink / (shares as f64 / mixed.max(1) as f64).max(1.0);
        (0..slots).map(thickness).chain((0..shares).map(|_| share)).collect()
    };
    patterns.iter().map(start).collect()
}
