//! Whether another round is worth its time.

use super::residual::{Looked, Seen};
use crate::job::record::Ended;

/// A correction of this much of an albedo is worth a round, and where fewer of the points than this share want one,
/// none is: neither 2% nor a hundredth of the surface that is off by more can be seen.
const WORTHWHILE: f64 = 0.02;
const FEW: f64 = 0.01;
/// Standard errors that an improvement must be above.
const BEYOND_NOISE: f64 = 2.0;

/// How many points want a correction.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Wanting {
    points: usize,
    wanting: usize,
    within_reach: usize,
}

impl Wanting {
    /// Counts a point: the corrections that it wants, as logarithms by channel, and by how much what lies there falls
    /// short of the ones it wanted before. What falls short the same way is out of reach.
    pub fn count(&mut self, off: &[f64], short: &[f64], least_short: f64) {
        let blocked = |off: f64, short: f64| short.abs() > least_short && off * short > 0.0;
        let wants = |off: f64| off.abs() > WORTHWHILE;
        self.points += 1;
        self.wanting += usize::from(off.iter().any(|off| wants(*off)));
        let reachable = |(off, short): (&f64, &f64)| wants(*off) && !blocked(*off, *short);
        self.within_reach += usize::from(off.iter().zip(short).any(reachable));
    }

    /// Why no other round should follow, if none should.
    pub fn ends(self, before: Option<&Looked>, now: &Looked) -> Option<Ended> {
        let few = |count: usize| (count as f64) < FEW * self.points.max(1) as f64;
        if few(self.wanting) {
            Some(Ended::NothingLeft)
        } else if few(self.within_reach) {
            Some(Ended::OutOfReach)
        } else {
            before.and_then(|before| without_gain(&gains(before, now)))
        }
    }
}

/// Whether the print is farther off than it was, beyond noise.
pub(super) fn is_worse(before: &Looked, now: &Looked) -> bool {
    without_gain(&gains(before, now)) == Some(Ended::Worse)
}

/// How much nearer the print is to what is asked for than it was, at every point: by how much less the squared miss is,
/// noise taken off.
fn gains(before: &Looked, now: &Looked) -> Vec<f64> {
    let points = |looked: &Looked| looked.objects.iter().flatten().map(|seen| seen.as_ref().map(miss)).collect();
    let [before, now]: [Vec<Option<f64>>; 2] = [points(before), points(now)];
    before.iter().zip(&now).filter_map(|(before, now)| Some((*before)? - (*now)?)).collect()
}

/// Why no round should follow one that gained so much, if none should.
fn without_gain(gains: &[f64]) -> Option<Ended> {
    let losses: Vec<f64> = gains.iter().map(|gain| -gain).collect();
    match (rises(gains), rises(&losses)) {
        (true, _) => None,
        (_, true) => Some(Ended::Worse),
        _ => Some(Ended::NoBetter),
    }
}

/// Whether the mean of numbers is above 0 beyond noise.
fn rises(numbers: &[f64]) -> bool {
    let n = numbers.len() as f64;
    let mean = numbers.iter().sum::<f64>() / n;
    let variance = numbers.iter().map(|number| (number - mean).powi(2)).sum::<f64>() / n;
    mean > BEYOND_NOISE * (variance / n).sqrt()
}

fn miss(Seen { asked, printed, shape, .. }: &Seen) -> f64 {
    let one = |(asked, printed): (&f64, &crate::optics::Estimate)| {
        (printed.mean - asked).powi(2) - printed.standard_error.powi(2)
    };
    shape.lit() * asked.iter().zip(printed).map(one).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: f64 = 0.03;

    fn wanting(points: &[([f64; 2], [f64; 2])]) -> Wanting {
        let mut wanting = Wanting::default();
        points.iter().for_each(|(off, short)| wanting.count(off, short, SHORT));
        wanting
    }

    #[test]
    fn what_falls_short_the_same_way_is_out_of_reach() {
        let Wanting { points, wanting, within_reach } = wanting(&[
            ([0.01, -0.01], [0.0; 2]),
            ([0.5, 0.0], [0.2, 0.0]),
            ([-0.5, 0.0], [0.2, 0.0]),
            ([0.5, 0.1], [0.2, 0.0]),
            ([0.5, 0.0], [0.02, 0.0]),
        ]);
        assert_eq!((points, wanting, within_reach), (5, 4, 3));
    }

    #[test]
    fn means_rise_beyond_noise_or_not() {
        let waves: Vec<f64> = (0..1000).map(|n| f64::from(n % 7 - 3)).collect();
        let raised = |by: f64| waves.iter().map(|wave| wave + by).collect::<Vec<_>>();
        // Their standard error is 2/√1000.
        assert!(!rises(&raised(0.0)) && !rises(&raised(0.1)) && rises(&raised(0.2)) && !rises(&raised(-0.2)));
        assert!(!rises(&[]));
        let ends = |by: f64| without_gain(&raised(by));
        assert_eq!([ends(0.2), ends(0.1), ends(-0.2)], [None, Some(Ended::NoBetter), Some(Ended::Worse)]);
    }
}
