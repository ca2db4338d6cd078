//! What single texels differ by: each with a gain, or in another order.

use super::{Breach, NAMED_GAIN, SIGMAS};

/// Sums of (D − D′)/(D + D′), which is half of ln(D/D′) where that is small, and bounded.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Shares {
    pub sum: f64,
    pub squares: f64,
    pub count: f64,
}

impl Shares {
    pub fn add(&mut self, share: f64) {
        self.sum += share;
        self.squares += share * share;
        self.count += 1.0;
    }

    pub fn merge(&mut self, other: &Self) {
        self.sum += other.sum;
        self.squares += other.squares;
        self.count += other.count;
    }
}

/// The part of a window's differences that all its pixels share is named from this correlation on.
const CORRELATED: f64 = 0.05;
/// Lines explain texels that they leave less than this part of.
const LEFT_BY_LINES: f64 = 0.3;

pub(super) struct Found {
    pub breach: Breach,
    /// Mean square of what the pixels of a window share.
    pub variance: f64,
    /// Whether it is the same along rows or columns.
    pub by_line: bool,
}

/// What the pixels of one texel's window share. Noise of different pixels is independent, however large: the square of
/// a window's sum is the sum of its squares, but for chance.
pub(super) fn texels(
    [width, height]: [usize; 2],
    offsets: &[[isize; 2]],
    by_offset: &[Shares],
    by_texel: &[Shares],
) -> Option<Found> {
    // What all windows share is no texel's.
    let means: Vec<f64> = by_offset.iter().map(|shares| shares.sum / shares.count.max(1.0)).collect();
    let own = |texel: usize| {
        let (x, y) = (texel % width, texel / width);
        let inside = |dx: isize, dy: isize| {
            x.checked_add_signed(dx).is_some_and(|x| x < width) && y.checked_add_signed(dy).is_some_and(|y| y < height)
        };
        let sign = |dx, dy| f64::from(u8::from(inside(dx, dy))) - f64::from(u8::from(inside(-dx, -dy)));
        by_texel[texel].sum - offsets.iter().zip(&means).map(|([dx, dy], mean)| sign(*dx, *dy) * mean).sum::<f64>()
    };
    let known: Vec<usize> = (0..by_texel.len()).filter(|texel| by_texel[*texel].count >= 3.0).collect();
    let sums: Vec<f64> = known.iter().map(|texel| own(*texel)).collect();
    let (mut between, mut pairs, mut squares, mut count) = (0.0, 0.0, 0.0, 0.0);
    for (sum, shares) in sums.iter().zip(known.iter().map(|texel| &by_texel[*texel])) {
        between += sum * sum - shares.squares;
        pairs += shares.count * (shares.count - 1.0);
        squares += shares.squares;
        count += shares.count;
    }
    let (all, variance) = (squares / f64::max(count, 1.0), between / f64::max(pairs, 1.0));
    let correlation = variance / all;
    let chance = (2.0 / known.len() as f64).sqrt() * count / f64::max(pairs, 1.0);
    // ln(D/D′) is twice a share, and a gain's part in it.
    let rms = 2.0 * variance.max(0.0).sqrt();
    if !(correlation > CORRELATED.max(SIGMAS * chance) && rms > NAMED_GAIN) {
        return None;
    }
    let of: Vec<f64> = sums.iter().zip(&known).map(|(sum, texel)| sum / by_texel[*texel].count).collect();
    let (worst, most) = known.iter().zip(&of).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let breach = Breach::Texels {
        differ: [2.0 * all.sqrt(), 2.0 * (all - 2.0 * variance).max(0.0).sqrt()],
        at: [worst / width, worst % width],
        share: libm::expm1(2.0 * most),
        rms,
    };
    Some(Found { breach, variance, by_line: is_by_line(&known, &of, width) })
}

/// Whether means of rows and columns leave little of the texels' own.
fn is_by_line(known: &[usize], of: &[f64], width: usize) -> bool {
    let less_means = |values: &[f64], line: &dyn Fn(usize) -> usize| {
        let mut sums = vec![[0.0, 0.0]; known.iter().map(|texel| line(*texel) + 1).max().unwrap_or(0)];
        for (texel, value) in known.iter().zip(values) {
            let sum = &mut sums[line(*texel)];
            *sum = [sum[0] + value, sum[1] + 1.0];
        }
        let less = |(texel, value): (&usize, &f64)| {
            let [sum, count] = sums[line(*texel)];
            value - sum / count
        };
        known.iter().zip(values).map(less).collect::<Vec<f64>>()
    };
    let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    let left = less_means(&less_means(of, &|texel| texel / width), &|texel| texel % width);
    square(&left) < LEFT_BY_LINES * square(of)
}
