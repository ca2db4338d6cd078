//! The forward problem by scalar Kubelka–Munk (Hašan et al. 2010, section 5.2).

use crate::optics::{Composite, KubelkaMunk, Stack};

/// R̂ per channel of `stack`.
///
/// `resins` has index `[resin][channel]`, all on one grid; the stack's resins must be within it. No resins, no channels.
pub fn reflection_of(resins: &[Vec<KubelkaMunk>], stack: &Stack) -> Vec<Vec<f64>> {
    let channels = resins.first().map_or(0, Vec::len);
    (0..channels)
        .map(|channel| {
            let len = resins[0][channel].len();
            let base = stack.core.map_or_else(|| vec![0.0; len], |core| resins[core.0][channel].half_space());
            // From the bottom up, each layer over what lies below it.
            stack.layers.iter().rev().fold(base, |below, layer| {
                Composite::from_slab(&resins[layer.resin.0][channel].slab(layer.thickness_mm)).reflection_over(&below)
            })
        })
        .collect()
}
