//! The forward problem by scalar Kubelka–Munk (Hašan et al. 2010, section 5.2), as searches see it: R̂ alone.

use crate::optics::{Composite, KubelkaMunk, Stack};

/// R̂ of `stack` in one channel, `len` coefficients. From the bottom up, where [`predict`](crate::optics::predict)
/// composes from the top down and knows T̂ too: the same but for rounding.
pub(super) fn reflection(stack: &Stack<&KubelkaMunk>, len: usize) -> Vec<f64> {
    let base = stack.core.map_or_else(|| vec![0.0; len], KubelkaMunk::half_space);
    // Each layer over what lies below it.
    stack
        .layers
        .iter()
        .rev()
        .fold(base, |below, layer| Composite::from_slab(&layer.resin.slab(layer.thickness_mm)).reflection_over(&below))
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
