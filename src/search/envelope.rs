//! How bright, and how dark, whatever lies under a partial stacking can be: the remaining-thickness bound.
//!
//! A half-space of the core covered by any stack of resins of total thickness h reflects R(h), and growing the stack
//! from below by a sheet dh of resin i changes it, per coefficient, by Kubelka and Munk's
//!
//! ```text
//!   dR/dh = f_i(R) = S_i (R² + 1) − 2 (K_i + S_i) R,      K_i + S_i = α_i S_i
//! ```
//!
//! so the brightest stack of thickness ≤ h is the solution of dR/dh = max(0, maxᵢ f_i(R)) and the darkest that of dR/dh
//! = min(0, minᵢ f_i(R)) (the comparison theorem for scalar equations). Two of the parabolas cross at most once in (0,
//! 1), since the product of their crossings is 1, so the solution runs through a few stretches of one resin each, and
//! along each it is the closed form of that resin's slab: no step size, no quadrature error.
//!
//! The bound is exact for a single coefficient; it lets every coefficient choose resins of its own, and ignores depth
//! and limits, which only makes it looser.

use crate::optics::KubelkaMunk;

/// Relative widening of the range against rounding; the loss of pruning is not measurable.
const WIDEN: f64 = 1e-9;

/// Which end of the range.
#[derive(Clone, Copy, PartialEq)]
enum End {
    Brightest,
    Darkest,
}

/// One resin at one coefficient.
#[derive(Clone, Copy)]
struct Sheet<'a> {
    resin: &'a KubelkaMunk,
    index: usize,
    s: f64,
    k_plus_s: f64,
    r_infinity: f64,
}

impl<'a> Sheet<'a> {
    fn new(resin: &'a KubelkaMunk, index: usize) -> Self {
        let r_infinity = 1.0 / (resin.alpha[index] + resin.beta[index]);
        Self { resin, index, s: resin.scattering[index], k_plus_s: resin.k_plus_s(index), r_infinity }
    }

    /// f(R) = dR/dh.
    fn slope(&self, r: f64) -> f64 {
        self.s * (r * r + 1.0) - 2.0 * self.k_plus_s * r
    }

    /// The reflectance of a slab of `h` mm over `r`.
    fn grow(&self, r: f64, h: f64) -> f64 {
        let (r_slab, t_slab) = self.resin.slab_coefficient(self.index, h);
        r_slab + t_slab * t_slab * r / (1.0 - r_slab * r).max(f64::MIN_POSITIVE)
    }

    /// Thickness in mm that takes the reflectance from `from` to `to`, which lies between `from` and R∞.
    fn thickness(&self, from: f64, to: f64) -> f64 {
        let gamma = self.resin.gamma[self.index];
        if gamma == 0.0 {
            return (1.0 / (1.0 - to) - 1.0 / (1.0 - from)) / self.s;
        }
        // (R − R∞)/(1 − R R∞) decays as e^(−2γh).
        let left = |r: f64| (r - self.r_infinity) / (1.0 - r * self.r_infinity);
        libm::log(left(from) / left(to)) / (2.0 * gamma)
    }

    /// The reflectance in (0, 1) at which both slopes agree.
    fn crossing(&self, other: &Self) -> Option<f64> {
        let a = other.s - self.s;
        let b = other.k_plus_s - self.k_plus_s;
        // aR² − 2bR + a = 0
        let ratio = b / a;
        (ratio > 1.0).then(|| 1.0 / (ratio + (ratio * ratio - 1.0).sqrt())).filter(|r| *r > 0.0)
    }
}

/// Follows the steepest resin from `r` through `h` mm.
fn follow(sheets: &[Sheet], end: End, mut r: f64, mut h: f64) -> f64 {
    let sign = if end == End::Brightest { 1.0 } else { -1.0 };
    let steepest = |r: f64| {
        sheets
            .iter()
            .copied()
            .max_by(|a, b| (sign * a.slope(r)).total_cmp(&(sign * b.slope(r))))
            .filter(|s| sign * s.slope(r) > 0.0)
    };
    let Some(mut sheet) = steepest(r) else { return r };
    // Each crossing is passed at most once, and there are fewer than one per pair.
    for _ in 0..sheets.len() * sheets.len() {
        // The next reflectance on the way to R∞ at which another resin becomes the steeper one.
        let next = sheets
            .iter()
            .filter_map(|other| Some((sheet.crossing(other)?, *other)))
            .filter(|(at, _)| sign * (at - r) > 1e-14 && sign * (sheet.r_infinity - at) > 1e-14)
            .min_by(|a, b| (sign * a.0).total_cmp(&(sign * b.0)));
        let Some((at, other)) = next else { break };
        let needed = sheet.thickness(r, at);
        if needed.is_nan() || needed >= h {
            break;
        }
        (r, h) = (at, h - needed);
        // Just past the crossing: either the other is steeper now, or they only touched after a third had taken over.
        let past = at + sign * 1e-9;
        if sign * other.slope(past) > sign * sheet.slope(past) {
            sheet = other;
        }
        if sign * sheet.slope(r) <= 0.0 {
            return r;
        }
    }
    sheet.grow(r, h)
}

/// Reflectance range of what can lie below, for every number of units left.
pub(super) struct Envelope {
    /// Least reflectance with at most u units, index `[u][coefficient]`.
    pub darkest: Vec<Vec<f64>>,
    /// Greatest reflectance with at most u units, index `[u][coefficient]`.
    pub brightest: Vec<Vec<f64>>,
}

/// The range for one channel: `resins` over a half-space that reflects `core`, for 0…`units` units of `unit_mm`.
pub(super) fn envelope(resins: &[&KubelkaMunk], core: &[f64], units: usize, unit_mm: f64) -> Envelope {
    let mut range = Envelope {
        darkest: vec![Vec::with_capacity(core.len()); units + 1],
        brightest: vec![Vec::with_capacity(core.len()); units + 1],
    };
    for (index, &start) in core.iter().enumerate() {
        let sheets: Vec<Sheet> = resins.iter().map(|resin| Sheet::new(resin, index)).collect();
        let (mut dark, mut bright) = (start, start);
        for u in 0..=units {
            range.darkest[u].push((dark * (1.0 - WIDEN)).max(0.0));
            range.brightest[u].push((bright * (1.0 + WIDEN)).min(1.0));
            dark = follow(&sheets, End::Darkest, dark, unit_mm);
            bright = follow(&sheets, End::Brightest, bright, unit_mm);
        }
    }
    range
}

#[cfg(test)]
mod tests {
    use super::super::tests::resins::random_resins;
    use super::*;
    use proptest::prelude::*;

    /// The plain way: the largest slope in very many small steps.
    fn by_steps(sheets: &[Sheet], sign: f64, mut r: f64, h: f64) -> f64 {
        let steps = 20_000;
        for _ in 0..steps {
            let slope = sheets.iter().map(|s| sign * s.slope(r)).fold(0.0, f64::max);
            r += sign * slope * h / steps as f64;
        }
        r
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn follows_the_steepest_resin(resins in random_resins(4, 3), start in 0.0..0.99f64, h in 0.01..3.0f64) {
            for index in 0..3 {
                let sheets: Vec<Sheet> = resins.iter().map(|r| Sheet::new(r, index)).collect();
                for (end, sign) in [(End::Brightest, 1.0), (End::Darkest, -1.0)] {
                    let (exact, steps) = (follow(&sheets, end, start, h), by_steps(&sheets, sign, start, h));
                    prop_assert!((exact - steps).abs() < 2e-3, "{sign}: {exact} against {steps} in steps");
                    prop_assert!(sign * (exact - start) >= -1e-12);
                }
            }
        }

        #[test]
        fn no_stack_leaves_the_range(
            resins in random_resins(4, 3), start in 0.0..0.99f64,
            stack in prop::collection::vec((0..4usize, 1..5usize), 0..6),
        ) {
            let references: Vec<&KubelkaMunk> = resins.iter().collect();
            let range = envelope(&references, &[start; 3], 30, 0.1);
            let units: usize = stack.iter().map(|layer| layer.1).sum();
            for index in 0..3 {
                let r = stack.iter().fold(start, |r, &(resin, u)| Sheet::new(&resins[resin], index).grow(r, 0.1 * u as f64));
                prop_assert!(r <= range.brightest[units][index] && r >= range.darkest[units][index]);
            }
        }
    }
}
