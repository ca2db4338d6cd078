//! Where the sensor is full, told from the pictures: numbers that pile up where light goes on.
//!
//! A profile's own top holds ever fewer pixels towards its largest value; a full sensor puts all that would be brighter
//! there. So a pile is a band at the top of a picture that holds several times the pixels of the band of twice its
//! width below it. Two exposures of different times whose piles are at the same number have a ceiling there; one alone
//! has one if its top is much lower than its time lets expect.

use super::Survey;
use super::survey::Window;

/// Half a band: numbers that agree to this share of the range are the same ceiling.
const SAME: f64 = 0.02;
/// Exposures differ in time from this factor on.
const LONGER: f64 = 1.2;
/// Fewest pixels of a pile: the spot is larger.
const MIN_PILE: usize = 12;
/// A pile holds this many times the pixels of the band below.
const STEEP: f64 = 2.0;
/// A top this much lower than the times ask for is a ceiling of its own.
const LOWER: f64 = 0.8;

/// Pixels at the top of an exposure.
struct Pile {
    seconds: f64,
    /// The value of the [`MIN_PILE`]th brightest pixel of the window above black: hot ones do not count.
    top: f64,
    /// Pixels within the band there, and their mean above black.
    count: usize,
    mean: f64,
    /// Whether it is steep.
    is_pile: bool,
}

impl Pile {
    fn of(window: &Window, black: f64) -> Option<Self> {
        let mut values: Vec<f64> =
            window.plane.values.iter().map(|value| f64::from(*value) - black).filter(|v| v.is_finite()).collect();
        if values.len() <= MIN_PILE {
            return None;
        }
        let top = *values.select_nth_unstable_by(MIN_PILE, |a, b| b.total_cmp(a)).1;
        let within = |from: f64, to: f64| values.iter().filter(move |v| **v >= from * top && **v < to * top);
        let (count, sum) = within(1.0 - SAME, f64::INFINITY).fold((0, 0.0), |(n, sum), value| (n + 1, sum + value));
        let below = within(1.0 - 3.0 * SAME, 1.0 - SAME).count();
        let is_pile = top > 0.0 && count >= MIN_PILE && count as f64 > STEEP * below as f64;
        Some(Self { seconds: window.exposure.seconds, top, count, mean: sum / count.max(1) as f64, is_pile })
    }
}

/// What the pictures say of the sensor's ceiling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Ceiling {
    /// Numbers end there, DN above black.
    At(f64),
    /// No picture has one: the brightest pixels grow with the times.
    None,
    /// The brightest pixels do not grow with the times, but pile up nowhere.
    Contradicted {
        /// Label of the longer exposure, s.
        seconds: f64,
        /// Its brightest pixels over what the shorter one lets expect.
        share: f64,
    },
}

/// The number that brightest pixels end at.
pub(super) fn ceiling(survey: &Survey, black: f64) -> Ceiling {
    let piles: Vec<Pile> = survey.windows.iter().filter_map(|window| Pile::of(window, black)).collect();
    let at = |pile: &Pile, other: &Pile| (pile.top / other.top - 1.0).abs() < SAME;
    let longer = |pile: &Pile, other: &Pile| {
        pile.seconds > LONGER * other.seconds && pile.count as f64 > LONGER.sqrt() * other.count as f64
    };
    let shared = |pile: &&Pile| {
        pile.is_pile && piles.iter().any(|other| at(pile, other) && (longer(pile, other) || longer(other, pile)))
    };
    let highest = piles.iter().filter(shared).max_by(|a, b| a.count.cmp(&b.count));
    if let Some(pile) = highest {
        return Ceiling::At(pile.mean);
    }
    let mut contradicted = Ceiling::None;
    for pair in piles.windows(2) {
        let [shorter, longer] = pair else { continue };
        let share = longer.top / shorter.top / (longer.seconds / shorter.seconds);
        if shorter.top > 0.0 && share < LOWER {
            if longer.is_pile {
                return Ceiling::At(longer.mean);
            }
            contradicted = Ceiling::Contradicted { seconds: longer.seconds, share };
        }
    }
    contradicted
}
