//! What neighbours make of a field: light that goes aside under one surface and comes out of another, or never.
//!
//! ```text
//!      ┌ middle ┐
//!   ───┴────────┴────│────────────   a photon is followed twice with the same random numbers: through the field
//!        ╲  ╱╲       │  ╱            without end, and, if it was ever beyond the border, through the coupon.
//!   field  ╲╱  ╲_____│_╱  neighbour  Only such photons make a difference, so that few of them tell it.
//! ```
//!
//! Flights after Woodcock et al. 1965: collisions are drawn at the greatest extinction of all resins, and those that a
//! place is too thin for do not happen. No face between fields is ever looked for.
//!
//! *Assumed:* within a coupon only the surface bends light. What leaves at the sides is lost, and at the bottom nothing
//! comes back.

use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

use super::{Coupon, Field};
use crate::optics::monte_carlo::photon::{Direction, FAINT, HenyeyGreenstein, Moments, REVIVED, azimuth, uniform};
use crate::optics::{Stack, VolumeCoefficients, fresnel::refraction};
use crate::parallel;
use crate::watch::{Stopped, Watch};

/// Photons between two looks at how well the difference is known.
const BATCH: u64 = 4000;
const MOST_BATCHES: u64 = 25;
/// Good enough: one standard deviation as a share of what the field returns.
const KNOWN: f64 = 1.5e-3;

/// What neighbours add to each field's middle, as a share of `endless`, what it would return if it had no end. The same
/// for the same coefficients.
pub(super) fn shares(
    coupon: &Coupon,
    volumes: &[VolumeCoefficients],
    endless: &[f64],
    watch: &dyn Watch,
) -> Result<Vec<f64>, Stopped> {
    let light = Light::new(coupon, volumes);
    let share = |field: usize| {
        let mut sums = Moments::default();
        for batch in 1..=MOST_BATCHES {
            if watch.stop_requested() {
                return 0.0;
            }
            for photon in (batch - 1) * BATCH..batch * BATCH {
                sums.score(light.difference(field, photon));
            }
            let estimate = sums.estimate(batch * BATCH);
            if estimate.standard_error < KNOWN * endless[field] || batch == MOST_BATCHES {
                return estimate.mean / endless[field];
            }
        }
        0.0
    };
    let shares = parallel::map(coupon.fields.len(), share);
    watch.go_on()?;
    Ok(shares)
}

/// The coupon as light sees it in one channel.
struct Light<'a> {
    coupon: &'a Coupon,
    volumes: &'a [VolumeCoefficients],
    phase: Vec<HenyeyGreenstein>,
    /// The greatest extinction, per mm.
    greatest: f64,
    /// Squares of the spacing along x, and which field each is, if one.
    columns: usize,
    field_of: Vec<Option<usize>>,
}

/// What a photon goes through.
#[derive(Clone, Copy)]
enum Through {
    /// One field's stack, without end.
    Endless,
    /// The coupon.
    Coupon,
}

impl<'a> Light<'a> {
    fn new(coupon: &'a Coupon, volumes: &'a [VolumeCoefficients]) -> Self {
        let [columns, rows] = [0, 1].map(|axis| (coupon.size_mm[axis] / coupon.spacing_mm).ceil() as usize);
        let mut light = Self {
            coupon,
            volumes,
            phase: volumes.iter().map(|volume| HenyeyGreenstein::new(volume.g)).collect(),
            greatest: volumes.iter().map(VolumeCoefficients::sigma_t).fold(1e-3, f64::max),
            columns,
            field_of: vec![None; columns * rows],
        };
        for (number, field) in coupon.fields.iter().enumerate() {
            if let Some(square) = light.square(field.middle_mm) {
                light.field_of[square] = Some(number);
            }
        }
        light
    }

    fn square(&self, [x, y]: [f64; 2]) -> Option<usize> {
        let [width, height, _] = self.coupon.size_mm;
        let inside = x >= 0.0 && y >= 0.0 && x < width && y < height;
        let side = self.coupon.spacing_mm;
        let square = || (x / side) as usize + self.columns * (y / side) as usize;
        inside.then(square).filter(|square| *square < self.field_of.len())
    }

    /// The resin at a place of the coupon; `None` beside and below it.
    fn resin(&self, at: [f64; 2], depth: f64) -> Option<usize> {
        let square = self.square(at)?;
        match self.field_of[square] {
            Some(field) => layer(&self.coupon.fields[field].stack, depth),
            None if depth >= self.coupon.size_mm[2] => None,
            None => {
                let half = 0.5 * self.coupon.mark_mm;
                let marked = |mark: &[f64; 2]| (0..2).all(|axis| (at[axis] - mark[axis]).abs() < half);
                let marked = self.coupon.marks.iter().any(marked);
                Some(if marked { self.coupon.dark } else { self.coupon.rim })
            }
        }
    }

    /// What a photon of a field brings back through the coupon less what it brings back without end.
    fn difference(&self, field: usize, photon: u64) -> f64 {
        let seed = (field as u64) << 32 | photon;
        let walk = |through| self.walk(field, through, &mut Xoshiro256PlusPlus::seed_from_u64(seed));
        match walk(Through::Endless) {
            (_, false) => 0.0,
            (endless, true) => walk(Through::Coupon).0 - endless,
        }
    }

    /// Weight of a photon that comes back, and whether it was beyond the field.
    fn walk(&self, field: usize, through: Through, rng: &mut Xoshiro256PlusPlus) -> (f64, bool) {
        let Field { middle_mm: middle, stack, .. } = &self.coupon.fields[field];
        let index = stack.layers.first().map_or(1.0, |layer| self.volumes[layer.resin].refractive_index);
        let read = super::READ_SHARE * self.coupon.spacing_mm;
        let [x, y] = middle.map(|middle| middle + read * (uniform(rng) - 0.5));
        let (mut at, mut depth) = ([x, y], 0.0);
        let mut direction = Direction { x: 0.0, y: 0.0, z: 1.0 };
        let mut weight = 1.0 - refraction(1.0, 1.0, index).map_or(1.0, |found| found.reflectance);
        let mut beyond = false;
        let half = 0.5 * self.coupon.spacing_mm;
        loop {
            let mut flight = -libm::log(1.0 - uniform(rng)) / self.greatest;
            let up = -depth / direction.z;
            let leaves = direction.z < 0.0 && up <= flight;
            if leaves {
                flight = up;
            }
            at = [at[0] + direction.x * flight, at[1] + direction.y * flight];
            depth = if leaves { 0.0 } else { depth + direction.z * flight };
            beyond |= (0..2).any(|axis| (at[axis] - middle[axis]).abs() > half);
            if leaves {
                let mirrored = refraction(-direction.z, index, 1.0).map_or(1.0, |found| found.reflectance);
                if uniform(rng) >= mirrored {
                    let lost = matches!(through, Through::Coupon) && self.square(at).is_none();
                    return (if lost { 0.0 } else { weight }, beyond);
                }
                direction.z = -direction.z;
                continue;
            }
            let resin = match through {
                Through::Endless => layer(stack, depth),
                Through::Coupon => self.resin(at, depth),
            };
            let Some(resin) = resin else { return (0.0, beyond) };
            let volume = &self.volumes[resin];
            if uniform(rng) * self.greatest >= volume.sigma_t() {
                continue;
            }
            weight *= volume.sigma_s / volume.sigma_t();
            if weight < FAINT {
                if uniform(rng) * REVIVED >= weight {
                    return (0.0, beyond);
                }
                weight = REVIVED;
            }
            direction = direction.turned(self.phase[resin].sample(uniform(rng)), azimuth(rng));
        }
    }
}

/// The resin at a depth of a stack; `None` below it.
fn layer(stack: &Stack<usize>, depth: f64) -> Option<usize> {
    let mut until = 0.0;
    let within = |(_, mm): &(&usize, f64)| {
        until += mm;
        depth < until
    };
    stack.pairs().find(within).map(|(resin, _)| *resin)
}
