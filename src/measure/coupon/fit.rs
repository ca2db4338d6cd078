//! Coefficients of all resins of a coupon at once, channel by channel.
//!
//! Least squares in ln σs′ and ln σa of every resin, over all fields: what lies under a resin is fitted with it. The
//! light is that of a tent, from all sides, and the camera looks straight down; by reciprocity that is light along the
//! normal and all that returns, which is what [`Transport`] tells of a stack.
//!
//! Fields are endless to the model. What their neighbours make of them ([`super::aside`]) is worked out at the
//! coefficients found, and they are found again with that, as often as it still changes a value.
//!
//! *Assumed:* n and g, as the set has them. A g off by 0.2 is part of the uncertainty, and so is a card that is off:
//! no field contradicts it, for all are off together.

use super::{Coupon, Reading, aside};
use crate::measure::MeasureError;
use crate::measure::chance::beyond_chance;
use crate::numeric::least_squares::{Budget, Descent, damped_inverse, dot, gradient};
use crate::optics::{FrequencyGrid, Light, Stack, Transport, TransportOptions, VolumeCoefficients};
use crate::parallel;
use crate::watch::{Thousandths, Watch};

/// Totals need no azimuthal order but the first, see `totals`.
const OPTIONS: TransportOptions = TransportOptions { polar: 12, orders: 1 };
/// Where both may go, per mm.
pub(super) const LEAST_PER_MM: f64 = 1e-5;
const MOST_PER_MM: f64 = 1e3;
/// Step of the differences in ln σ.
const DIFFERENCE: f64 = 1e-3;
const DESCENT: Descent = Descent { first_damping: 1e-2, most_damping: 1e6, least_gain: 1e-4 };
const STEPS: usize = 40;
/// Factors on what is believed that the fit starts from in turn, scattering and absorption, until one explains the
/// values.
const STARTS: [[f64; 2]; 9] =
    [[1.0, 1.0], [0.3, 1.0], [3.0, 1.0], [1.0, 0.3], [1.0, 3.0], [0.3, 0.3], [3.0, 3.0], [0.3, 3.0], [3.0, 0.3]];
/// Values missed by so many of their errors, rms, are not explained.
const EXPLAINED: f64 = 3.0;
/// Values missed by so much of the light, rms, are refused.
const MOST_MISFIT: f64 = 0.02;
/// How far g may be from what is stated.
const G_UNKNOWN: f64 = 0.2;
const G: std::ops::RangeInclusive<f64> = -0.5..=0.95;
/// Times that neighbours are worked out, and changes of their part that end it, as shares of a value.
const ROUNDS: usize = 4;
const SETTLED: f64 = 2e-3;

/// One channel's coefficients of all resins.
#[derive(Debug, Clone, PartialEq)]
pub struct CouponFit {
    /// Name of the channel.
    pub channel: String,
    /// Of every resin of the coupon, with n and g as stated.
    pub coefficients: Vec<VolumeCoefficients>,
    /// One standard deviation of σs (1 − g) and of σa, as shares of them.
    pub shares: Vec<[f64; 2]>,
    /// Root mean square of what the fields are missed by, in units of their errors.
    pub misfit: f64,
    /// The same as a share of the light.
    pub residual: f64,
    /// What neighbours make of every field, as a share of what it would return if it had no end.
    pub aside: Vec<f64>,
    /// What every field is missed by, in units of its error.
    pub missed: Vec<f64>,
}

impl CouponFit {
    /// Whether fields are missed by more than their errors explain.
    pub(super) fn is_missed(&self) -> bool {
        let fields = self.missed.len();
        beyond_chance(self.misfit.powi(2) * fields as f64, fields.saturating_sub(2 * self.coefficients.len()))
    }

    /// σs (1 − g) and σa of a resin per mm, each with one standard deviation.
    ///
    /// # Panics
    /// Where the coupon has no such resin.
    pub fn coefficients_with_errors(&self, resin: usize) -> [(f64, f64); 2] {
        let (found, [scattering, absorption]) = (self.coefficients[resin], self.shares[resin]);
        let reduced = found.sigma_s * (1.0 - found.g);
        [(reduced, reduced * scattering), (found.sigma_a, found.sigma_a * absorption)]
    }
}

/// Fits every channel of a coupon's photographs. `watch` hears one stage.
///
/// # Errors
/// [`MeasureError::Scene`] for a reading of another coupon, unlike refractive indices, and fields that no resins of
/// these indices make; [`MeasureError::Stopped`].
pub fn fit_coupon(coupon: &Coupon, reading: &Reading, watch: &dyn Watch) -> Result<Vec<CouponFit>, MeasureError> {
    coupon.check_reading(reading)?;
    coupon.refractive_index()?;
    let stage = Thousandths::begin(watch, "fitting", coupon.channels.len() as u64);
    let mut fits = Vec::new();
    for channel in 0..coupon.channels.len() {
        stage.go_on()?;
        fits.push(Data::new(coupon, reading, channel, watch).fit()?);
        stage.advance(1);
    }
    Ok(fits)
}

/// ln σs′ and ln σa of every resin, and what comes of them.
struct Point {
    at: Vec<f64>,
    /// What the fields return, without their neighbours' part.
    light: Vec<f64>,
    /// In units of the errors.
    residuals: Vec<f64>,
}

impl Point {
    fn objective(&self) -> f64 {
        dot(&self.residuals, &self.residuals)
    }
}

struct Data<'a> {
    coupon: &'a Coupon,
    reading: &'a Reading,
    channel: usize,
    watch: &'a dyn Watch,
    /// By resin.
    g: Vec<f64>,
    /// By field.
    aside: Vec<f64>,
}

impl<'a> Data<'a> {
    fn new(coupon: &'a Coupon, reading: &'a Reading, channel: usize, watch: &'a dyn Watch) -> Self {
        let g = coupon.resins.iter().map(|resin| resin.believed[channel].g).collect();
        Self { coupon, reading, channel, watch, g, aside: vec![0.0; coupon.fields.len()] }
    }

    fn fit(mut self) -> Result<CouponFit, MeasureError> {
        // Near enough to begin with, for what neighbours do hangs on the resins less than the fields' own light does.
        let believed = self.believed([1.0; 2]);
        self.aside = self.neighbours(&self.point(believed, &self.g, None))?;
        let mut found = self.best()?;
        for _ in 0..ROUNDS {
            let aside = self.neighbours(&found)?;
            let change = aside.iter().zip(&self.aside).map(|(now, before)| (now - before).abs()).fold(0.0, f64::max);
            self.aside = aside;
            found = self.descend(&found.at, &self.g);
            if change < SETTLED {
                break;
            }
        }
        let values = &self.reading.values[self.channel];
        let misfit = self.misfit(&found);
        let off = found.residuals.iter().zip(values).map(|(off, value)| (off * value.error).powi(2));
        let residual = (off.sum::<f64>() / values.len() as f64).sqrt();
        if !(residual <= MOST_MISFIT) {
            let what = format!("channel {}: coefficients", self.coupon.channels[self.channel]);
            let found = format!("fields missed by {residual:.3} of the light, rms");
            let expected = "at most 0.02: are photographs, card and specular right, and was this coupon printed of \
                 these resins?";
            return Err(MeasureError::scene(what, found, expected));
        }
        let slopes = self.slopes(&found, &self.g);
        // Errors that turn out larger than stated count as they are.
        let spare = values.len().saturating_sub(found.at.len()).max(1) as f64;
        let scale = (found.objective() / spare).sqrt().max(1.0);
        let inverse = damped_inverse(&slopes, 0.0);
        let other = |by: f64| {
            let g: Vec<f64> = self.g.iter().map(|g| (g + by).clamp(*G.start(), *G.end())).collect();
            self.descend(&found.at, &g).at
        };
        let (low, high) = (other(-G_UNKNOWN), other(G_UNKNOWN));
        // Values that are all off as the card is.
        let together: Vec<f64> =
            values.iter().map(|value| self.reading.card_error * value.value / value.error).collect();
        let together = gradient(&slopes, &together);
        let share = |i: usize| {
            let Some(inverse) = &inverse else { return f64::INFINITY };
            let own = libm::hypot(scale * inverse[i][i].sqrt(), dot(&inverse[i], &together));
            libm::hypot(own, 0.5 * (high[i] - low[i]))
        };
        Ok(CouponFit {
            channel: self.coupon.channels[self.channel].clone(),
            coefficients: self.volumes(&found.at, &self.g),
            shares: (0..self.g.len()).map(|resin| [share(2 * resin), share(2 * resin + 1)]).collect(),
            misfit,
            residual,
            aside: self.aside.clone(),
            missed: found.residuals,
        })
    }

    /// ln σs′ and ln σa of every resin as believed, times factors.
    fn believed(&self, factors: [f64; 2]) -> Vec<f64> {
        let of = |resin: &super::CouponResin| {
            let volume = resin.believed[self.channel];
            let believed = [volume.sigma_s * (1.0 - volume.g), volume.sigma_a];
            [0, 1].map(|i| libm::log((factors[i] * believed[i]).clamp(LEAST_PER_MM, MOST_PER_MM)))
        };
        self.coupon.resins.iter().flat_map(of).collect()
    }

    fn neighbours(&self, found: &Point) -> Result<Vec<f64>, MeasureError> {
        Ok(aside::shares(self.coupon, &self.volumes(&found.at, &self.g), &found.light, self.watch)?)
    }

    fn misfit(&self, found: &Point) -> f64 {
        (found.objective() / found.residuals.len() as f64).sqrt()
    }

    /// The first start that explains the values, or what comes nearest.
    fn best(&self) -> Result<Point, MeasureError> {
        let mut best: Option<Point> = None;
        for factors in STARTS {
            if self.watch.stop_requested() {
                return Err(crate::watch::Stopped.into());
            }
            let found = self.descend(&self.believed(factors), &self.g);
            if best.as_ref().is_none_or(|best| found.objective() < best.objective()) {
                best = Some(found);
            }
            if best.as_ref().is_some_and(|best| self.misfit(best) < EXPLAINED) {
                break;
            }
        }
        best.ok_or_else(|| MeasureError::scene("coupon", "no resin", "at least two"))
    }

    fn volumes(&self, at: &[f64], g: &[f64]) -> Vec<VolumeCoefficients> {
        let volume = |(resin, g): (usize, &f64)| {
            let [reduced, sigma_a] = [0, 1].map(|i| libm::exp(at[2 * resin + i]).clamp(LEAST_PER_MM, MOST_PER_MM));
            let refractive_index = self.coupon.resins[resin].believed[self.channel].refractive_index;
            VolumeCoefficients { sigma_s: (reduced / (1.0 - g)).min(MOST_PER_MM), sigma_a, g: *g, refractive_index }
        };
        g.iter().enumerate().map(volume).collect()
    }

    fn descend(&self, from: &[f64], g: &[f64]) -> Point {
        DESCENT.run(
            Budget::Steps(STEPS),
            self.point(from.to_vec(), g, None),
            Point::objective,
            |here| self.slopes(here, g),
            |here, slopes, damping| {
                let inverse = damped_inverse(slopes, damping)?;
                let downhill = gradient(slopes, &here.residuals);
                let step = |row: &Vec<f64>| dot(row, &downhill).clamp(-1.0, 1.0);
                let (least, most) = (libm::log(LEAST_PER_MM), libm::log(MOST_PER_MM));
                let at = here.at.iter().zip(&inverse).map(|(at, row)| (at - step(row)).clamp(least, most));
                Some(self.point(at.collect(), g, None))
            },
        )
    }

    /// Parameter by parameter, only of the fields that have its resin.
    fn slopes(&self, here: &Point, g: &[f64]) -> Vec<Vec<f64>> {
        let slope = |i: usize| {
            let mut at = here.at.clone();
            at[i] += DIFFERENCE;
            let there = self.point(at, g, Some((i / 2, here))).residuals;
            there.iter().zip(&here.residuals).map(|(there, here)| (there - here) / DIFFERENCE).collect()
        };
        (0..here.at.len()).map(slope).collect()
    }

    /// What comes of coefficients; where only those of a resin are others than at a known point, fields without it are
    /// taken from there.
    fn point(&self, at: Vec<f64>, g: &[f64], other: Option<(usize, &Point)>) -> Point {
        let volumes = self.volumes(&at, g);
        let light = parallel::map(self.coupon.fields.len(), |field| {
            let stack = &self.coupon.fields[field].stack;
            match other {
                Some((resin, known)) if !stack.pairs().any(|(layer, _)| *layer == resin) => known.light[field],
                _ => returned(&stack.map(|&resin| volumes[resin]), self.reading.specular),
            }
        });
        let values = &self.reading.values[self.channel];
        let residual = |((light, aside), value): ((&f64, &f64), &super::read::Value)| {
            (light * (1.0 + aside) - value.value) / value.error
        };
        let residuals = light.iter().zip(&self.aside).zip(values).map(residual).collect();
        Point { at, light, residuals }
    }
}

/// What an endless stack returns straight up of light from all sides; with what its surface mirrors, or without.
pub(super) fn returned(stack: &Stack<VolumeCoefficients>, specular: bool) -> f64 {
    let model = Transport { stack, light: Light::Normal, options: OPTIONS };
    let light = model.spectra(&FrequencyGrid::of(vec![0.0])).reflection.first().copied().unwrap_or(0.0);
    if specular { light + model.glint() } else { light }
}
