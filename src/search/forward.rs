//! The forward problem by scalar Kubelka–Munk (Hašan et al. 2010, section 5.2), and the objective (equation 5).

use super::Stacking;
use crate::optics::{Composite, KubelkaMunk};

/// R̂ per channel of `stacking` over a half-space of the resin `core`, or over nothing.
///
/// `resins` has index `[resin][channel]`, all on one grid; the stacking's and the core's indices must be within it. No resins,
/// no channels.
pub fn reflection_of(resins: &[Vec<KubelkaMunk>], stacking: &Stacking, core: Option<usize>) -> Vec<Vec<f64>> {
    let channels = resins.first().map_or(0, Vec::len);
    (0..channels)
        .map(|channel| {
            let len = resins[0][channel].len();
            let base = core.map_or_else(|| vec![0.0; len], |core| resins[core][channel].half_space());
            // From the bottom up, each layer over what lies below it.
            stacking.layers.iter().rev().fold(base, |below, layer| {
                Composite::from_slab(&resins[layer.resin][channel].slab(layer.thickness_mm)).reflection_over(&below)
            })
        })
        .collect()
}

/// Σ over channels and coefficients of (R̂ − R̂_t)², the first coefficient's term times `dc_weight` (equation 5).
pub fn objective(reflection: &[Vec<f64>], target: &super::SearchTarget, dc_weight: f64) -> f64 {
    let channel = |(r, t): (&Vec<f64>, &Vec<f64>)| -> f64 {
        let square = |(r, t): (&f64, &f64)| (r - t) * (r - t);
        let all: f64 = r.iter().zip(t).map(square).skip(1).sum();
        all + r.iter().zip(t).map(square).next().map_or(0.0, |dc| dc_weight * dc)
    };
    reflection.iter().zip(&target.channels).map(channel).sum()
}
