//! Single values that are far from what is seen the other way, held against pairs of their own brightness.

use super::Breach;

/// Octaves of brightness, and quarter octaves of differences below 1.
const OCTAVES: usize = 64;
const QUARTERS: usize = 96;
/// Nine in ten differ by less than this many standard deviations.
const NINE_IN_TEN: f64 = 1.645;
/// Pairs are named from so many standard deviations on, and this share.
const FAR: f64 = 10.0;
const LEAST: f64 = 0.1;
/// …if there are so many, and this part of all.
const MANY: u64 = 10;
const PART: f64 = 1e-4;
/// Brightness is judged by so many pairs at least.
const ENOUGH: u64 = 200;

/// Pairs by brightness and difference.
#[derive(Debug, Clone)]
pub(super) struct Outliers {
    counts: Vec<[u64; QUARTERS + 1]>,
    /// The pair that differs most: its share, and its place.
    worst: (f64, [usize; 2]),
}

impl Default for Outliers {
    fn default() -> Self {
        Self { counts: vec![[0; QUARTERS + 1]; OCTAVES], worst: (0.0, [0, 0]) }
    }
}

impl Outliers {
    /// A pair's sum, and (D − D′)/(D + D′).
    pub fn add(&mut self, sum: f64, share: f64, at: [usize; 2]) {
        let octave = (sum.to_bits() >> 52) as usize & (OCTAVES - 1);
        self.counts[octave][quarter(share.abs())] += 1;
        if share.abs() > self.worst.0 {
            self.worst = (share.abs(), at);
        }
    }

    pub fn merge(&mut self, other: &Self) {
        let counts = self.counts.iter_mut().flatten().zip(other.counts.iter().flatten());
        counts.for_each(|(sum, part)| *sum += part);
        if other.worst.0 > self.worst.0 {
            self.worst = other.worst;
        }
    }

    pub fn judge(&self) -> Option<Breach> {
        let (mut count, mut of) = (0, 0);
        for octave in &self.counts {
            let all: u64 = octave.iter().sum();
            if all < ENOUGH {
                continue;
            }
            let mut below = 0;
            let nine = octave.iter().position(|here| {
                below += here;
                below as f64 >= 0.9 * all as f64
            });
            let bound = (FAR / NINE_IN_TEN * edge(nine.unwrap_or(0) + 1)).max(LEAST);
            let far = octave.iter().enumerate().filter(|(quarter, _)| edge(*quarter) >= bound);
            count += far.map(|(_, here)| here).sum::<u64>();
            of += all;
        }
        (count >= MANY && count as f64 > PART * of as f64).then_some(Breach::Outliers { count, of, at: self.worst.1 })
    }
}

/// Quarter octave of a share, the last one is 1.
fn quarter(share: f64) -> usize {
    let above = (share.to_bits() >> 50) as i64 - (1.0_f64.to_bits() >> 50) as i64;
    (above + QUARTERS as i64).clamp(0, QUARTERS as i64) as usize
}

/// Where a quarter octave begins.
fn edge(quarter: usize) -> f64 {
    f64::from_bits(((1.0_f64.to_bits() >> 50) + quarter as u64 - QUARTERS as u64) << 50)
}
