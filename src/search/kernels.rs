//! The inner loops: one partial stacking against one block, over all coefficients.
//!
//! Everything is laid out as lanes, lane = coefficient · channels + channel, padded with lanes of weight 0 to a whole
//! number of chunks. The sums are kept in chunk order and rounding never depends on the processor's vector width, so
//! every machine finds the same stacking. A sum that passes `limit` ends early and is returned as it stands.

use multiversion::multiversion;

use crate::optics::{Composite, Interface};

/// Lanes summed between two looks at the limit: low frequencies come first and decide most cases in the first chunk.
pub(super) const CHUNK: usize = 16;

/// Spectra of a partial stacking (R̂∪, R̂∩, T̂), of whole chunks of lanes.
#[derive(Debug, Clone)]
pub(super) struct PartialStack {
    pub r_top: Vec<f64>,
    pub r_bottom: Vec<f64>,
    pub t: Vec<f64>,
}

impl PartialStack {
    /// Nothing but a surface.
    pub fn empty(surface: Interface, lanes: usize) -> Self {
        let Composite { reflection_top, reflection_bottom, transmission } = surface.surface(lanes);
        Self { r_top: reflection_top, r_bottom: reflection_bottom, t: transmission }
    }
}

/// Spectra of one block: R̂ and T̂² − R̂².
#[derive(Debug, Clone)]
pub(super) struct Block {
    pub r: Vec<f64>,
    pub t: Vec<f64>,
    /// T̂² − R̂²: a block over something that reflects r reflects (R̂ + (T̂² − R̂²) r)/(1 − R̂ r).
    pub det: Vec<f64>,
}

/// R̂_t and weights.
#[derive(Debug, Clone)]
pub(super) struct Goal {
    pub target: Vec<f64>,
    pub weight: Vec<f64>,
}

/// Σ w (R̂ − R̂_t)² of the stack over something that reflects `below` (equation 6).
#[multiversion(targets("x86_64+avx2", "x86_64+avx", "aarch64+neon"))]
pub(super) fn objective(stack: &PartialStack, below: &[f64], goal: &Goal, limit: f64) -> f64 {
    let lanes = goal.target.len();
    let (r_top, r_bottom, t) = (&stack.r_top[..lanes], &stack.r_bottom[..lanes], &stack.t[..lanes]);
    let (below, target, weight) = (&below[..lanes], &goal.target[..lanes], &goal.weight[..lanes]);
    let mut total = 0.0;
    let mut start = 0;
    while start + CHUNK <= lanes {
        let mut terms = [0.0; CHUNK];
        for (j, term) in terms.iter_mut().enumerate() {
            let i = start + j;
            let trapped = (1.0 - r_bottom[i] * below[i]).max(f64::MIN_POSITIVE);
            let error = r_top[i] + t[i] * t[i] * below[i] / trapped - target[i];
            *term = weight[i] * error * error;
        }
        total += sum(&terms);
        if total > limit {
            return total;
        }
        start += CHUNK;
    }
    total
}

/// Lower bound on the objective of `stack` over `block` over anything that reflects between `darkest` and `brightest`:
/// the paper's too-bright and too-dark bounds, which never touch the same coefficient, summed.
#[multiversion(targets("x86_64+avx2", "x86_64+avx", "aarch64+neon"))]
pub(super) fn bound(
    stack: &PartialStack,
    block: &Block,
    darkest: &[f64],
    brightest: &[f64],
    goal: &Goal,
    limit: f64,
) -> f64 {
    let lanes = goal.target.len();
    let (r_top, r_bottom, t) = (&stack.r_top[..lanes], &stack.r_bottom[..lanes], &stack.t[..lanes]);
    let (r_block, det) = (&block.r[..lanes], &block.det[..lanes]);
    let (darkest, brightest) = (&darkest[..lanes], &brightest[..lanes]);
    let (target, weight) = (&goal.target[..lanes], &goal.weight[..lanes]);
    let mut total = 0.0;
    let mut start = 0;
    while start + CHUNK <= lanes {
        let mut terms = [0.0; CHUNK];
        for (j, term) in terms.iter_mut().enumerate() {
            let i = start + j;
            let through = t[i] * t[i];
            // The block over r reflects a/b; the stack over that reflects R∪ + T² (a/b)/(1 − R∩ a/b) = R∪ + T² a/(b −
            // R∩ a).
            let over = |r: f64| {
                let a = r_block[i] + det[i] * r;
                let b = 1.0 - r_block[i] * r;
                r_top[i] + through * a / (b - r_bottom[i] * a).max(f64::MIN_POSITIVE)
            };
            let too_bright = over(darkest[i]) - target[i];
            let too_dark = target[i] - over(brightest[i]);
            let error = too_bright.max(too_dark).max(0.0);
            *term = weight[i] * error * error;
        }
        total += sum(&terms);
        if total > limit {
            return total;
        }
        start += CHUNK;
    }
    total
}

/// Lower bound on the objective of `stack` over anything that reflects between `darkest` and `brightest`.
#[multiversion(targets("x86_64+avx2", "x86_64+avx", "aarch64+neon"))]
pub(super) fn range_bound(stack: &PartialStack, darkest: &[f64], brightest: &[f64], goal: &Goal, limit: f64) -> f64 {
    let lanes = goal.target.len();
    let (r_top, r_bottom, t) = (&stack.r_top[..lanes], &stack.r_bottom[..lanes], &stack.t[..lanes]);
    let (darkest, brightest) = (&darkest[..lanes], &brightest[..lanes]);
    let (target, weight) = (&goal.target[..lanes], &goal.weight[..lanes]);
    let mut total = 0.0;
    let mut start = 0;
    while start + CHUNK <= lanes {
        let mut terms = [0.0; CHUNK];
        for (j, term) in terms.iter_mut().enumerate() {
            let i = start + j;
            let through = t[i] * t[i];
            let over = |r: f64| r_top[i] + through * r / (1.0 - r_bottom[i] * r).max(f64::MIN_POSITIVE);
            let error = (over(darkest[i]) - target[i]).max(target[i] - over(brightest[i])).max(0.0);
            *term = weight[i] * error * error;
        }
        total += sum(&terms);
        if total > limit {
            return total;
        }
        start += CHUNK;
    }
    total
}

/// `stack` over `block`, into `whole` (equations 3 and 4).
#[multiversion(targets("x86_64+avx2", "x86_64+avx", "aarch64+neon"))]
pub(super) fn extend(stack: &PartialStack, block: &Block, whole: &mut PartialStack) {
    let lanes = whole.t.len();
    let (r_top, r_bottom, t) = (&stack.r_top[..lanes], &stack.r_bottom[..lanes], &stack.t[..lanes]);
    let (r_block, t_block) = (&block.r[..lanes], &block.t[..lanes]);
    let (top, bottom, through) = (&mut whole.r_top[..lanes], &mut whole.r_bottom[..lanes], &mut whole.t[..lanes]);
    for i in 0..lanes {
        let between = 1.0 / (1.0 - r_bottom[i] * r_block[i]).max(f64::MIN_POSITIVE);
        top[i] = r_top[i] + t[i] * t[i] * r_block[i] * between;
        bottom[i] = r_block[i] + t_block[i] * t_block[i] * r_bottom[i] * between;
        through[i] = t[i] * t_block[i] * between;
    }
}

/// Pairwise, in an order that does not depend on the vector width.
#[inline(always)]
fn sum(terms: &[f64; CHUNK]) -> f64 {
    let mut partial = [0.0; 4];
    for quad in terms.chunks_exact(4) {
        for (p, term) in partial.iter_mut().zip(quad) {
            *p += term;
        }
    }
    (partial[0] + partial[1]) + (partial[2] + partial[3])
}
