//! What the model misses by, ring by ring and texel by texel.

use super::kernel::{RowSums, Variance};

/// Sums of differences between data and model.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sums {
    /// Measurements.
    pub count: f64,
    /// Σ (D − R̂)².
    pub error: f64,
    /// Σ D².
    pub data: f64,
    /// Σ R̂².
    pub model_square: f64,
    /// Σ R̂.
    pub model: f64,
    /// Σ (D − R̂).
    pub bias: f64,
}

/// Differences by ring and by place.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Misses {
    /// Per ring.
    pub rings: Vec<Sums>,
    /// Per lit texel: Σ (D − R̂)² and Σ D².
    pub places: Vec<[f64; 2]>,
    /// Σ D and Σ R̂ along rows, along columns, and along the diagonals that fall and that rise, from [`AXIS_FROM`]
    /// pixels on.
    pub axes: [[f64; 2]; 4],
    /// Pairs of dark texels, by distance.
    pub dark: Vec<Dark>,
    /// Values near 0, beside those of the next texel to the right.
    pub gate: Gate,
}

/// Values that are exactly 0, and those that lie just above the smallest one: by less than half of it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Gate {
    /// Values that are 0.
    pub zeros: u64,
    /// Values just above the smallest one.
    pub above: u64,
    /// Those of them whose next one is 0.
    pub above_then_zero: u64,
    /// Zeros whose next one is just above.
    pub zero_then_above: u64,
    /// Zeros whose next one is anything but 0.
    pub zero_then_light: u64,
}

impl Gate {
    /// Counts the values of a row of texels at one offset.
    pub(super) fn add(&mut self, values: &[f32], above: &std::ops::Range<f32>) {
        for (at, value) in values.iter().enumerate() {
            let next = values.get(at + 1).copied().filter(|next| next.is_finite());
            if *value == 0.0 {
                self.zeros += 1;
                self.zero_then_above += u64::from(next.is_some_and(|next| above.contains(&next)));
                self.zero_then_light += u64::from(next.is_some_and(|next| next != 0.0));
            } else if above.contains(value) {
                self.above += 1;
                self.above_then_zero += u64::from(next == Some(0.0));
            }
        }
    }

    fn merge(&mut self, other: &Self) {
        self.zeros += other.zeros;
        self.above += other.above;
        self.above_then_zero += other.above_then_zero;
        self.zero_then_above += other.zero_then_above;
        self.zero_then_light += other.zero_then_light;
    }
}

/// What pairs of texels with little light see of each other at one distance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Dark {
    /// Measurements.
    pub count: f64,
    /// Σ D.
    pub sum: f64,
    /// Σ D².
    pub squares: f64,
}

/// Nearer, a pixel is too large to tell a direction.
pub(super) const AXIS_FROM: usize = 2;

impl Misses {
    pub(super) fn new(rings: usize, places: usize) -> Self {
        Self { rings: vec![Sums::default(); rings], places: vec![[0.0; 2]; places], ..Self::default() }
    }

    pub(super) fn add(&mut self, ring: usize, row: &RowSums) {
        let total = |values: &[f32]| values.iter().map(|value| f64::from(*value)).sum::<f64>();
        let sums = &mut self.rings[ring];
        sums.count += total(&row.count);
        sums.error += total(&row.error);
        sums.data += total(&row.data);
        sums.model_square += total(&row.model_square);
        sums.model += total(&row.model);
        sums.bias += total(&row.bias);
    }

    pub(super) fn add_places(&mut self, start: usize, row: &RowSums) {
        for ((place, error), data) in self.places[start..].iter_mut().zip(&row.error).zip(&row.data) {
            place[0] += f64::from(*error);
            place[1] += f64::from(*data);
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        for (sums, other) in self.rings.iter_mut().zip(&other.rings) {
            sums.count += other.count;
            sums.error += other.error;
            sums.data += other.data;
            sums.model_square += other.model_square;
            sums.model += other.model;
            sums.bias += other.bias;
        }
        for (sum, other) in self.axes.iter_mut().flatten().zip(other.axes.iter().flatten()) {
            *sum += other;
        }
        self.dark.resize(self.dark.len().max(other.dark.len()), Dark::default());
        for (sum, other) in self.dark.iter_mut().zip(&other.dark) {
            sum.count += other.count;
            sum.sum += other.sum;
            sum.squares += other.squares;
        }
        self.gate.merge(&other.gate);
    }

    /// √(Σ(D − R̂)² / ΣD²) over everything.
    pub fn relative(&self) -> f64 {
        relative(&self.rings)
    }

    /// The same without the lit texel itself, where equation 7 is no more than P(x, 0).
    pub fn relative_beyond_centre(&self) -> f64 {
        relative(&self.rings[1..])
    }

    /// The part of that which is noise of the measurement, by what is known of it.
    pub fn noise_beyond_centre(&self, variance: Variance) -> f64 {
        let rings = &self.rings[1..];
        let noise = |sums: &Sums| f64::from(variance.constant) * sums.count + f64::from(variance.linear) * sums.model;
        let data = rings.iter().map(|sums| sums.data).sum::<f64>();
        (rings.iter().map(noise).sum::<f64>() / data.max(f64::MIN_POSITIVE)).sqrt()
    }
}

fn relative(rings: &[Sums]) -> f64 {
    let total = |f: fn(&Sums) -> f64| rings.iter().map(f).sum::<f64>();
    (total(|sums| sums.error) / total(|sums| sums.data).max(f64::MIN_POSITIVE)).sqrt()
}
