//! Do the exposures fit together? For every two, the pixels well exposed in both tell the true ratio of their times and
//! the shift between them; a network of such links tells which exposure is odd.

use super::own_light::Line;
use super::{Sensor, Survey};
use crate::measure::frame::Plane;

/// Well exposed: from this share of the range up to saturation. Below, noise and black level count; a twentieth of 14
/// bits is 800.
const WELL_EXPOSED: f64 = 0.05;
/// Fewest shared pixels that make a link: their median ratio is good to half a percent.
const MIN_SHARED: usize = 24;
/// A link is no better than this (of its ratio): flicker, shutter.
const LINK_FLOOR: f64 = 0.003;
/// Off by more, an exposure is mislabelled: the slips are thirds of a stop (26%); nominal times are off by 7% at most
/// (1/15 is 1/16).
const MISLABELLED: f64 = 0.12;
/// Off by more (and five standard deviations) it is used at the measured time.
const OFF_LABEL: f64 = 0.015;
/// Shifted by more, pixels, it is left out: the profile is steepest within a pixel or two.
const MISALIGNED_PX: f64 = 0.3;

/// Two exposures that share well-exposed pixels; `i` is the shorter.
pub(in crate::measure) struct Link {
    pub(super) i: usize,
    pub(super) j: usize,
    /// Light of i over that of j, by its pixels.
    ratio: f64,
    /// ln of the true ratio of times over that of the labels, and its variance.
    log_time: f64,
    log_variance: f64,
    /// Shift of i against j, pixels, and its variance per direction.
    shift: [f64; 2],
    shift_variance: [f64; 2],
    /// Indices of the shared pixels.
    shared: Vec<usize>,
    /// i as a straight line over j.
    pub(super) line: Option<Line>,
}

/// An exposure against the majority.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Offset {
    /// ln of its true time over its label.
    pub log_time: f64,
    /// Standard error of it; infinite for an exposure without links.
    pub log_error: f64,
    /// Shift, pixels.
    pub shift_px: [f64; 2],
    shift_error: f64,
}

impl Offset {
    pub fn mislabelled(&self) -> bool {
        self.log_time.abs() > MISLABELLED.max(5.0 * self.log_error)
    }

    pub fn off_label(&self) -> bool {
        self.log_time.abs() > OFF_LABEL.max(5.0 * self.log_error)
    }

    pub fn misaligned(&self) -> bool {
        libm::hypot(self.shift_px[0], self.shift_px[1]) > MISALIGNED_PX.max(5.0 * self.shift_error)
    }
}

/// All links between the exposures of a survey.
pub(super) fn links(survey: &Survey, sensor: &Sensor) -> Vec<Link> {
    let count = survey.windows.len();
    let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
    pairs.filter_map(|(i, j)| Link::between(survey, sensor, i, j)).collect()
}

impl Link {
    fn between(survey: &Survey, sensor: &Sensor, i: usize, j: usize) -> Option<Self> {
        let (a, b) = (&survey.windows[i], &survey.windows[j]);
        let range = if sensor.clipped.is_finite() { sensor.clipped } else { f64::from(survey.top()) } - sensor.black;
        let lowest = (sensor.black + WELL_EXPOSED * range) as f32;
        let clipped = sensor.clipped as f32;
        let well = |value: f32| value > lowest && value < clipped;
        let shared: Vec<usize> =
            (0..a.plane.values.len()).filter(|&k| well(a.plane.values[k]) && well(b.plane.values[k])).collect();
        if shared.len() < MIN_SHARED {
            return None;
        }
        let light = |plane: &Plane, k: usize| f64::from(plane.values[k]) - sensor.black;
        let mut logs: Vec<f64> = shared.iter().map(|&k| libm::log(light(&a.plane, k) / light(&b.plane, k))).collect();
        let log_ratio = median(&mut logs);
        let mut spread: Vec<f64> = logs.iter().map(|log| (log - log_ratio).abs()).collect();
        // 1.4826 turns the median deviation of a normal distribution into σ, √(π/2) is the price of a median.
        let error = 1.4826 * 1.2533 * median(&mut spread) / (shared.len() as f64).sqrt();
        let ratio = libm::exp(log_ratio);
        let (shift, shift_variance) = shift(&a.plane, &b.plane, ratio, &shared, sensor)?;
        let values = |plane: &Plane| shared.iter().map(|&k| light(plane, k)).collect::<Vec<f64>>();
        let line = Line::through(&values(&b.plane), &values(&a.plane), ratio, sensor);
        let log_time = log_ratio - libm::log(a.exposure.seconds / b.exposure.seconds);
        let log_variance = error * error + LINK_FLOOR * LINK_FLOOR;
        Some(Self { i, j, ratio, log_time, log_variance, shift, shift_variance, shared, line })
    }

    /// Whether it links an exposure.
    pub(super) fn joins(&self, k: usize) -> bool {
        self.i == k || self.j == k
    }

    /// Electrons per DN by the scatter between the two; read noise does not count in well-exposed pixels.
    pub(super) fn gain(&self, survey: &Survey, sensor: &Sensor) -> Option<f64> {
        let (a, b) = (&survey.windows[self.i].plane.values, &survey.windows[self.j].plane.values);
        let square = |k: &usize| {
            let (x, y) = (f64::from(a[*k]) - sensor.black, f64::from(b[*k]) - sensor.black);
            (x - self.ratio * y).powi(2) / (x + self.ratio * self.ratio * y)
        };
        let mut squares: Vec<f64> = self.shared.iter().map(square).collect();
        // The median of χ² with one degree of freedom is 0.4549.
        let inverse = median(&mut squares) / 0.4549;
        (inverse > 0.0 && inverse.is_finite()).then(|| 1.0 / inverse)
    }
}

/// Shift of `a` against `b` by least squares on the gradient of `b`: a(p) = ratio · b(p − shift).
fn shift(a: &Plane, b: &Plane, ratio: f64, shared: &[usize], sensor: &Sensor) -> Option<([f64; 2], [f64; 2])> {
    let width = b.width;
    let light = |k: usize| f64::from(b.values[k]) - sensor.black;
    let usable = |k: usize| f64::from(b.values[k]) < sensor.clipped;
    let (mut xx, mut xy, mut yy, mut xd, mut yd) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for &k in shared {
        let (x, y) = (k % width, k / width);
        if x == 0 || y == 0 || x + 1 == width || y + 1 == b.height {
            continue;
        }
        let around = [k - 1, k + 1, k - width, k + width];
        if !around.iter().all(|&near| usable(near)) {
            continue;
        }
        let [gx, gy] = [0.5 * (light(k + 1) - light(k - 1)), 0.5 * (light(k + width) - light(k - width))];
        let here = f64::from(a.values[k]) - sensor.black;
        let difference = here / ratio - light(k);
        let weight = 1.0 / (sensor.variance(here) / (ratio * ratio) + sensor.variance(light(k)));
        xx += weight * gx * gx;
        xy += weight * gx * gy;
        yy += weight * gy * gy;
        xd -= weight * gx * difference;
        yd -= weight * gy * difference;
    }
    let determinant = xx * yy - xy * xy;
    if !(determinant > 1e-9 * (xx + yy).powi(2)) {
        return None;
    }
    let shift = [(yy * xd - xy * yd) / determinant, (xx * yd - xy * xd) / determinant];
    Some((shift, [yy / determinant, xx / determinant]))
}

/// Every exposure's offset from the majority (the median is 0) that fits the links best.
pub(super) fn solve(count: usize, links: &[Link]) -> Vec<Offset> {
    let times = network(count, links, |link| (link.log_time, link.log_variance));
    let across = network(count, links, |link| (link.shift[0], link.shift_variance[0]));
    let down = network(count, links, |link| (link.shift[1], link.shift_variance[1]));
    let offset = |k: usize| Offset {
        log_time: times[k].0,
        log_error: times[k].1,
        shift_px: [across[k].0, down[k].0],
        shift_error: libm::hypot(across[k].1, down[k].1),
    };
    (0..count).map(offset).collect()
}

/// Values whose differences are as the links say, by weighted least squares (Gauss–Seidel); each with the error its own
/// links leave. An exposure without shared pixels keeps 0.
fn network(count: usize, links: &[Link], read: impl Fn(&Link) -> (f64, f64)) -> Vec<(f64, f64)> {
    let settling = Settling { sweeps: 2000, least: 1e-9, held: 0.0 };
    let (values, weights) = settling.run(count, |k, values| {
        let (mut sum, mut weight) = (0.0, 0.0);
        for link in links {
            let (difference, variance) = read(link);
            let (other, target) = match k {
                _ if k == link.i => (link.j, difference),
                _ if k == link.j => (link.i, -difference),
                _ => continue,
            };
            sum += (values[other] + target) / variance;
            weight += 1.0 / variance;
        }
        (sum, weight)
    });
    let mut linked: Vec<f64> = (0..count).filter(|&k| weights[k] > 0.0).map(|k| values[k]).collect();
    let middle = if linked.is_empty() { 0.0 } else { median(&mut linked) };
    let settled = |k: usize| {
        if weights[k] > 0.0 { (values[k] - middle, 1.0 / f64::sqrt(weights[k])) } else { (0.0, f64::INFINITY) }
    };
    (0..count).map(settled).collect()
}

/// How values that pull at each other come to rest (Gauss–Seidel).
pub(super) struct Settling {
    /// Sweeps over all values at most.
    pub sweeps: usize,
    /// The last sweep is one that moves none as far.
    pub least: f64,
    /// Weight that holds every value at 0, as a share of what pulls at it.
    pub held: f64,
}

impl Settling {
    /// The values, and the weights of what pulls at them. `pull` sums what a value should be by all the others, times
    /// the weights, and the weights; where these are 0 a value keeps 0.
    pub fn run(&self, count: usize, pull: impl Fn(usize, &[f64]) -> (f64, f64)) -> (Vec<f64>, Vec<f64>) {
        let (mut values, mut weights) = (vec![0.0_f64; count], vec![0.0_f64; count]);
        for sweep in 0..self.sweeps {
            let mut moved = 0.0_f64;
            for k in 0..count {
                let (sum, weight) = pull(k, &values);
                if weight > 0.0 {
                    let value = sum / (weight * (1.0 + self.held));
                    moved = moved.max((value - values[k]).abs());
                    (values[k], weights[k]) = (value, weight);
                }
            }
            if sweep > 0 && moved < self.least {
                break;
            }
        }
        (values, weights)
    }
}

pub(super) fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
