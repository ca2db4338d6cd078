//! Axes: what they are, where their ticks stand.

/// How values go along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By their decimal logarithm; values must be above 0.
    Log10,
}

impl Scale {
    /// Where along the axis; not finite for what has no place on it.
    pub(super) fn forward(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Log10 if value > 0.0 => libm::log10(value),
            Self::Log10 => f64::NAN,
        }
    }

    fn back(self, along: f64) -> f64 {
        match self {
            Self::Linear => along,
            Self::Log10 => libm::pow(10_f64, along),
        }
    }
}

/// One of a panel's two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Quantity and unit, as `r [mm]`.
    pub label: String,
    /// How values go along it.
    pub scale: Scale,
    /// First and last value; `None`: what the data need.
    pub range: Option<[f64; 2]>,
}

impl Axis {
    /// An even axis.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), scale: Scale::Linear, range: None }
    }

    /// A logarithmic axis.
    pub fn log(label: impl Into<String>) -> Self {
        Self { label: label.into(), scale: Scale::Log10, range: None }
    }

    /// Sets the first and the last value. A range that its scale cannot have counts as none.
    #[must_use]
    pub fn range(mut self, first: f64, last: f64) -> Self {
        self.range = Some([first, last]);
        self
    }

    /// The axis over `values` or its own range, from pixel `start` to pixel `end`.
    pub(super) fn placed(&self, values: impl Iterator<Item = f64>, [start, end]: [f64; 2]) -> Placed {
        /// Room left beyond the data on either side, a share of their extent.
        const MARGIN: f64 = 0.04;
        let own = self.range.map(|range| range.map(|value| self.scale.forward(value)));
        let [low, high] = own.filter(|[low, high]| low < high && (high - low).is_finite()).unwrap_or_else(|| {
            let along = values.map(|value| self.scale.forward(value)).filter(|along| along.is_finite());
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), a| (l.min(a), h.max(a)));
            let extent = high - low;
            // A single value stands in the middle of something.
            if !(low <= high && extent.is_finite()) {
                [0.0, 1.0]
            } else if extent <= 1e-12 * low.abs().max(high.abs()) {
                let around = if self.scale == Scale::Log10 || low == 0.0 { 0.5 } else { 0.1 * low.abs() };
                [low - around, high + around]
            } else {
                // An even axis whose data begin at 0 begins there too.
                let below = if self.scale == Scale::Linear && low == 0.0 { 0.0 } else { MARGIN * extent };
                [low - below, high + MARGIN * extent]
            }
        });
        Placed { scale: self.scale, low, high, start, end }
    }
}

/// An axis with its place on the page.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    scale: Scale,
    low: f64,
    high: f64,
    start: f64,
    end: f64,
}

/// A place on an axis; minor ticks have no label.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tick {
    pub at: f64,
    pub label: Option<String>,
}

impl Placed {
    /// Where a value stands on the page; not finite for what has no place. It may lie outside of the axis.
    pub fn at(&self, value: f64) -> f64 {
        self.at_along(self.scale.forward(value))
    }

    fn at_along(&self, along: f64) -> f64 {
        self.start + (along - self.low) / (self.high - self.low) * (self.end - self.start)
    }

    /// Ticks, about `wanted` of them with a label.
    pub fn ticks(&self, wanted: usize) -> Vec<Tick> {
        match self.scale {
            Scale::Linear => self.linear_ticks(wanted),
            // Within less than two decades powers of ten are too few.
            Scale::Log10 if self.high - self.low < 1.7 => self.few_decades(),
            Scale::Log10 => self.decades(wanted),
        }
    }

    fn linear_ticks(&self, wanted: usize) -> Vec<Tick> {
        let step = round_step((self.high - self.low) / wanted.max(1) as f64);
        let (first, last) = ((self.low / step).ceil(), (self.high / step).floor());
        (0..=(last - first).max(0.0) as usize)
            .map(|n| {
                let value = (first + n as f64) * step;
                Tick { at: self.at_along(value), label: Some(decimal(value, step)) }
            })
            .collect()
    }

    fn decades(&self, wanted: usize) -> Vec<Tick> {
        let span = (self.high.floor() - self.low.ceil()).max(1.0);
        let step = (span / wanted.max(1) as f64).ceil().max(1.0) as i64;
        let mut ticks = Vec::new();
        for decade in self.low.floor() as i64..=self.high.ceil() as i64 {
            let label = (decade.rem_euclid(step) == 0).then(|| power_of_ten(decade));
            self.push(&mut ticks, decade as f64, label);
            if step == 1 {
                (2..10).for_each(|n| self.push(&mut ticks, decade as f64 + libm::log10(f64::from(n)), None));
            }
        }
        ticks
    }

    fn few_decades(&self) -> Vec<Tick> {
        let mut ticks = Vec::new();
        let narrow = self.high - self.low < 0.7;
        for decade in self.low.floor() as i32..=self.high.ceil() as i32 {
            for n in 1..10 {
                let value = f64::from(n) * 10_f64.powi(decade);
                let labelled = narrow || matches!(n, 1 | 2 | 5);
                self.push(&mut ticks, libm::log10(value), labelled.then(|| decimal(value, value)));
            }
        }
        if ticks.iter().filter(|tick| tick.label.is_some()).count() >= 2 {
            return ticks;
        }
        // Less than a factor of two: even steps do.
        let [low, high] = [self.low, self.high].map(|along| self.scale.back(along));
        let step = round_step((high - low) / 5.0);
        let mut ticks = Vec::new();
        for n in (low / step).ceil() as i64..=(high / step).floor() as i64 {
            let value = n as f64 * step;
            self.push(&mut ticks, libm::log10(value), Some(decimal(value, step)));
        }
        ticks
    }

    fn push(&self, ticks: &mut Vec<Tick>, along: f64, label: Option<String>) {
        const ROUNDING: f64 = 1e-9;
        if along >= self.low - ROUNDING && along <= self.high + ROUNDING {
            ticks.push(Tick { at: self.at_along(along), label });
        }
    }
}

/// The nearest of 1, 2, 5 and 10 times a power of ten that is no smaller.
fn round_step(step: f64) -> f64 {
    let power = libm::pow(10_f64, libm::log10(step).floor());
    let mantissa = step / power;
    let round = [1.0, 2.0, 5.0].into_iter().find(|round| mantissa <= round * (1.0 + 1e-9)).unwrap_or(10.0);
    round * power
}

/// A value with the decimals its `step` needs; very large and very small ones by powers of ten.
fn decimal(value: f64, step: f64) -> String {
    let size = value.abs().max(step);
    if value == 0.0 || value.abs() < 1e-9 * step {
        return "0".to_owned();
    }
    if !(1e-4..1e6).contains(&size) {
        let exponent = libm::log10(value.abs()).floor() as i64;
        let mantissa = value / 10_f64.powi(exponent as i32);
        let digits = (libm::log10(size).floor() - libm::log10(step).floor()).clamp(0.0, 6.0) as usize;
        return match format!("{mantissa:.digits$}").replace('-', "−") {
            one if one == "1" => power_of_ten(exponent),
            one if one == "−1" => format!("−{}", power_of_ten(exponent)),
            mantissa => format!("{mantissa}·{}", power_of_ten(exponent)),
        };
    }
    let decimals = (-libm::log10(step).floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}").replace('-', "−")
}

/// 10ⁿ, but 1, 10 and 100 and 0.1 as they are.
fn power_of_ten(exponent: i64) -> String {
    match exponent {
        0 => "1".to_owned(),
        1 => "10".to_owned(),
        2 => "100".to_owned(),
        -1 => "0.1".to_owned(),
        _ => format!("10{}", superscript(exponent)),
    }
}

fn superscript(number: i64) -> String {
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit as u32 - '0' as u32).unwrap_or(digit),
    };
    number.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, values: &[f64]) -> Vec<String> {
        let placed = axis.placed(values.iter().copied(), [0.0, 100.0]);
        placed.ticks(5).into_iter().filter_map(|tick| tick.label).collect()
    }

    #[test]
    fn ticks_are_round_numbers_inside_the_axis() {
        assert_eq!(labels(&Axis::linear("x"), &[0.0, 5.0]), ["0", "2", "4"]);
        assert_eq!(labels(&Axis::linear("x").range(-0.1, 0.35), &[]), ["−0.1", "0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(&Axis::log("x").range(1e-6, 100.0), &[]), ["10⁻⁶", "10⁻⁴", "10⁻²", "1", "100"]);
        assert_eq!(labels(&Axis::log("x").range(0.1, 3.0), &[]), ["0.1", "0.2", "0.5", "1", "2"]);
        assert_eq!(labels(&Axis::log("x").range(1.0, 1.5), &[]), ["1.0", "1.1", "1.2", "1.3", "1.4", "1.5"]);
        assert_eq!(labels(&Axis::linear("x").range(0.0, 4e-6), &[]), ["0", "10⁻⁶", "2·10⁻⁶", "3·10⁻⁶", "4·10⁻⁶"]);
        assert_eq!(labels(&Axis::linear("x").range(-2e7, 2e7), &[]), ["−2·10⁷", "−10⁷", "0", "10⁷", "2·10⁷"]);
    }

    #[test]
    fn an_axis_holds_its_data_whatever_they_are() {
        for scale in [Scale::Linear, Scale::Log10] {
            for values in [&[][..], &[0.0], &[7.0], &[7.0, 7.0], &[-3.0, 1e-3, f64::NAN, 2.0], &[f64::INFINITY]] {
                let axis = Axis { label: String::new(), scale, range: None };
                let placed = axis.placed(values.iter().copied(), [10.0, 200.0]);
                assert!(!placed.ticks(5).is_empty(), "{scale:?} {values:?}");
                for at in values.iter().map(|value| placed.at(*value)).filter(|at| at.is_finite()) {
                    assert!((10.0..=200.0).contains(&at), "{scale:?} {values:?}: {at}");
                }
            }
        }
    }

    #[test]
    fn a_senseless_range_counts_as_none() {
        let axis = Axis::log("x").range(0.0, 10.0);
        let placed = axis.placed([1.0, 100.0].into_iter(), [0.0, 1.0]);
        assert!(placed.at(100.0) < 1.0 && placed.at(1.0) > 0.0);
    }
}
