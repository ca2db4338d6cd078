//! The forward problem by scalar Kubelka–Munk (Hašan et al. 2010, section 5.2), as searches see it: R̂ alone.

use crate::optics::{Composite, Interface, KubelkaMunk, Stack};

/// R̂ of `stack` in one channel, `len` coefficients. From the bottom up, where [`predict`](crate::optics::predict)
/// composes from the top down and knows T̂ too: the same but for rounding.
pub(super) fn reflection(stack: &Stack<&KubelkaMunk>, len: usize) -> Vec<f64> {
    reflection_under(&stack.map(|resin| (*resin, 1.0)), len)
}

/// The same of resins with refractive indices, under air.
pub(super) fn reflection_under(stack: &Stack<(&KubelkaMunk, f64)>, len: usize) -> Vec<f64> {
    let mut below = stack.core.map_or_else(|| vec![0.0; len], |(core, _)| core.half_space());
    let mut index_below = stack.core.map_or(1.0, |(_, index)| index);
    // Each layer over what lies below it.
    for layer in stack.layers.iter().rev().filter(|layer| layer.thickness_mm > 0.0) {
        let (resin, index) = layer.resin;
        below = Interface::between(index, index_below).over(below);
        below = Composite::from_slab(&resin.slab(layer.thickness_mm)).reflection_over(&below);
        index_below = index;
    }
    Interface::between(1.0, index_below).surface_over(&below)
}

/// R̂ per channel of `stack`.
///
/// `resins` has index `[resin][channel]`, all on one grid; the stack's resins must be within it. No resins, no
/// channels.
pub(super) fn reflection_of(resins: &[Vec<KubelkaMunk>], stack: &Stack) -> Vec<Vec<f64>> {
    let channels = resins.first().map_or(0, Vec::len);
    let in_channel = |channel: usize| stack.map(|resin| &resins[resin.0][channel]);
    (0..channels).map(|channel| reflection(&in_channel(channel), resins[0][channel].len())).collect()
}
