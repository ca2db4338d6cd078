//! The forward problem by scalar Kubelka–Munk (Hašan et al. 2010, section 5.2).

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
