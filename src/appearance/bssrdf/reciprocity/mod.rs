//! Light goes both ways: D(x, x+o) = D(x+o, x). What a window says of its neighbour, the neighbour's window must say
//! back.
//!
//! A factorisation by equation 7 is symmetric, so it fits whatever part of the data is, and is silent about the rest.
//! What the rest looks like tells most slips of a measurement:
//!
//! - windows that are transposed, flipped or turned agree with each other once they are turned back;
//! - windows off by a part of a pixel: the mean window is not its own mirror image, and 2 s·∇ ln R is the difference;
//! - a hot column or row of the windows: the mean window has one column its mirror image lacks;
//! - lit rows or columns of texels with a gain: ln D(x, x+o) − ln D(x+o, x) = ln gain(x) − ln gain(x+o);
//! - light that drifts: ln D(x, x+o) − ln D(x+o, x) grows with o as a straight line;
//! - zeros in place of what is missing: nothing one way, light the other;
//! - texels with a gain each, or in another order: what one texel's window differs by, it differs by at all offsets, as
//!   noise does not;
//! - single values that are wrong: pairs that differ by many times what nine in ten of their brightness differ by.
//!
//! Offsets up to a few pixels are compared, where windows have most of their light.

mod breach;
mod gains;
mod mean_window;
mod outliers;
mod texels;

pub use breach::Breach;

use gains::gains;
use mean_window::{bent, hot_line, shift_or_drift};
use outliers::Outliers;
use texels::{Shares, texels};

use super::{BssrdfError, Dataset, responses::Channel, rings::Rings};
use crate::parallel;
use crate::watch::{Thousandths, Watch};

/// Offsets compared reach so many pixels…
const REACH: isize = 4;
/// …in rows handed out so many at a time.
const BAND_ROWS: usize = 32;
/// A pair tells zeros from light where the other way has at least this share of the mean response there.
const LIT_SHARE: f64 = 0.3;
/// Shares of pairs are summed where they have this part of the mean response.
const SEEN_SHARE: f64 = 0.02;
/// …and so many of the smallest steps of the data: counts of photons are 0 by chance.
const QUANTA: f64 = 24.0;
/// Symmetries other than the windows' own are named if they leave this share of what the windows as they are leave.
const BETTER: f64 = 0.7;
/// Differences are named from this many standard errors on…
const SIGMAS: f64 = 6.0;
/// …shifts from this part of a pixel on, gains from this share on.
const NAMED_SHIFT: f64 = 0.05;
const NAMED_GAIN: f64 = 0.02;

/// The eight symmetries of a square, as what a window's offset becomes.
pub type Symmetry = [[isize; 2]; 2];

const SYMMETRIES: [(Symmetry, &str); 8] = [
    ([[1, 0], [0, 1]], "as they are"),
    ([[0, 1], [1, 0]], "transposed (rows for columns)"),
    ([[-1, 0], [0, 1]], "flipped left to right"),
    ([[1, 0], [0, -1]], "flipped upside down"),
    ([[-1, 0], [0, -1]], "turned by 180 degrees"),
    ([[0, -1], [1, 0]], "turned by 90 degrees"),
    ([[0, 1], [-1, 0]], "turned by 270 degrees"),
    ([[0, -1], [-1, 0]], "transposed along the other diagonal"),
];

/// How far a channel is from being reciprocal.
#[derive(Debug, Clone, PartialEq)]
pub struct Reciprocity {
    /// √(Σ(D − D′)² / ½Σ(D² + D′²)) over all pairs compared, D′ the other way.
    pub relative: f64,
    /// The same by lit texel; NaN where nothing was compared.
    pub places: Vec<f32>,
    /// What breaks it.
    pub breaches: Vec<Breach>,
}

/// Sums over pairs.
#[derive(Debug, Clone, Copy, Default)]
struct Pairs {
    a: f64,
    b: f64,
    squares: f64,
    difference: f64,
    count: f64,
}

impl Pairs {
    fn add(&mut self, a: f64, b: f64) {
        self.a += a;
        self.b += b;
        self.squares += 0.5 * (a * a + b * b);
        self.difference += (a - b) * (a - b);
        self.count += 1.0;
    }

    fn merge(&mut self, other: &Self) {
        self.a += other.a;
        self.b += other.b;
        self.squares += other.squares;
        self.difference += other.difference;
        self.count += other.count;
    }

    /// ln of the ratio of the sums, and its standard error with all differences independent.
    fn log_ratio(&self) -> Option<(f64, f64)> {
        let log = libm::log(self.a / self.b);
        // What all pairs differ by alike is the ratio, not its error.
        let alike = (self.a - self.b).powi(2) / self.count;
        let spread = (self.difference - alike).max(0.0) * self.count / (self.count - 1.0);
        let known = self.a > 0.0 && self.b > 0.0 && log.is_finite() && self.count > 1.0;
        known.then(|| (log, spread.sqrt() / self.a.min(self.b)))
    }
}

/// What one band of rows says.
struct Sums {
    /// Per offset of the half plane.
    offsets: Vec<Pairs>,
    /// Per offset along an axis (1 to [`REACH`] down, then right), by row or column of the lit texel.
    rows: Vec<Vec<Pairs>>,
    columns: Vec<Vec<Pairs>>,
    symmetries: [Pairs; 8],
    zeros: u64,
    lit: u64,
    first_zero: Option<[usize; 2]>,
    places: Vec<Pairs>,
    /// Per offset of the half plane, and per texel: those of a band, and of the rows below that it reaches.
    shares: Vec<Shares>,
    texels: Vec<Shares>,
    outliers: Outliers,
}

/// Compares all pairs of texels that are a few pixels apart. `global` is the mean response per distance, `least` the
/// smallest value above 0 there is.
///
/// # Errors
/// Files that cannot be read; [`BssrdfError::Stopped`].
pub fn reciprocity(
    dataset: &Dataset,
    channel: Channel,
    rings: &Rings,
    global: &[f32],
    least: f64,
    watch: &dyn Watch,
) -> Result<Reciprocity, BssrdfError> {
    let Dataset { width, height, window, .. } = *dataset;
    let half = [window[0] as isize / 2, window[1] as isize / 2];
    let reach = REACH.min(half[0]).min(half[1]);
    let all: Vec<[isize; 2]> = (-reach..=reach)
        .flat_map(|dy| (-reach..=reach).map(move |dx| [dx, dy]))
        .filter(|&[dx, dy]| [dx, dy] != [0, 0])
        .collect();
    let index = |[dx, dy]: [isize; 2]| all.iter().position(|o| *o == [dx, dy]).unwrap_or(0);
    let mean_at = |[dx, dy]: [isize; 2]| {
        let r = ((dx * dx + dy * dy) as f64).sqrt() * dataset.pitch_mm;
        let at = rings.distances_mm.partition_point(|distance| *distance < r - 1e-9).min(global.len() - 1);
        f64::from(global[at])
    };
    // One of every two offsets that mirror each other.
    let half_plane: Vec<[isize; 2]> = all.iter().copied().filter(|&[dx, dy]| dy > 0 || (dy == 0 && dx > 0)).collect();
    let turned: Vec<[[usize; 2]; 8]> = half_plane
        .iter()
        .map(|&[dx, dy]| {
            SYMMETRIES.map(|(m, _)| {
                let to = [m[0][0] * dx + m[0][1] * dy, m[1][0] * dx + m[1][1] * dy];
                [index(to), index([-to[0], -to[1]])]
            })
        })
        .collect();
    let means: Vec<f64> = half_plane.iter().map(|offset| mean_at(*offset)).collect();

    let read = |rows: std::ops::Range<usize>| -> Result<Vec<Vec<f32>>, BssrdfError> {
        let mut reader = dataset.responses.reader()?;
        let (mut windows, mut planes) = (Vec::new(), Vec::new());
        for y in rows {
            reader.read(y, channel, &mut windows)?;
            let mut plane = Vec::with_capacity(all.len() * width);
            for [dx, dy] in &all {
                let pixel = ((dy + half[1]) * window[0] as isize + dx + half[0]) as usize;
                plane.extend_from_slice(&windows[pixel * width..(pixel + 1) * width]);
            }
            for x in (0..width).filter(|x| !dataset.is_present(y * width + x)) {
                plane.iter_mut().skip(x).step_by(width).for_each(|value| *value = f32::NAN);
            }
            planes.push(plane);
        }
        Ok(planes)
    };
    let band_sums = |first: usize| -> Result<Sums, BssrdfError> {
        let rows = first..height.min(first + BAND_ROWS);
        let planes = read(first..height.min(rows.end + reach as usize))?;
        let mut sums = Sums::new(half_plane.len(), reach as usize, [width, rows.len()], planes.len());
        for y in rows.clone() {
            for (o, &[dx, dy]) in half_plane.iter().enumerate() {
                let other = y + dy as usize;
                if other >= height {
                    continue;
                }
                let (here, there) = (&planes[y - first], &planes[other - first]);
                for x in 0..width {
                    let Some(to) = x.checked_add_signed(dx).filter(|to| *to < width) else { continue };
                    for (s, [from, back]) in turned[o].iter().enumerate() {
                        let (a, b) = (f64::from(here[from * width + x]), f64::from(there[back * width + to]));
                        if !(a.is_finite() && b.is_finite()) {
                            continue;
                        }
                        sums.symmetries[s].add(a, b);
                        if s > 0 {
                            continue;
                        }
                        sums.offsets[o].add(a, b);
                        sums.places[(y - first) * width + x].add(a, b);
                        if dx == 0 {
                            sums.rows[dy as usize - 1][y - first].add(a, b);
                        } else if dy == 0 {
                            sums.columns[dx as usize - 1][x].add(a, b);
                        }
                        if 0.5 * (a + b) > SEEN_SHARE * means[o] {
                            let share = ((a - b) / (a + b)).clamp(-1.0, 1.0);
                            sums.shares[o].add(share);
                            sums.texels[(y - first) * width + x].add(share);
                            sums.texels[(other - first) * width + to].add(-share);
                            sums.outliers.add(a + b, share, [y, x]);
                        }
                        let most = a.max(b);
                        if most > LIT_SHARE * means[o] && most > QUANTA * least {
                            sums.lit += 1;
                            if a == 0.0 || b == 0.0 {
                                sums.zeros += 1;
                                let place = if a == 0.0 { [y, x] } else { [other, to] };
                                sums.first_zero.get_or_insert(place);
                            }
                        }
                    }
                }
            }
        }
        Ok(sums)
    };
    let starts: Vec<usize> = (0..height).step_by(BAND_ROWS).collect();
    let progress = Thousandths::begin(watch, "both ways", height as u64);
    let mut total = Sums::new(half_plane.len(), reach as usize, [width, 0], height);
    for batch in starts.chunks(rayon::current_num_threads()) {
        progress.go_on()?;
        let parts: Vec<Result<Sums, BssrdfError>> = parallel::map_all(batch, |first| band_sums(*first));
        for (part, first) in parts.into_iter().zip(batch) {
            total.append(part?, first * width);
        }
        progress.advance((batch.len() * BAND_ROWS) as u64);
    }
    Ok(total.judge(dataset, &half_plane, rings, global))
}

impl Sums {
    /// Of `rows` rows, nothing so far.
    fn new(offsets: usize, reach: usize, [width, rows]: [usize; 2], with_reach: usize) -> Self {
        Self {
            offsets: vec![Pairs::default(); offsets],
            rows: vec![vec![Pairs::default(); rows]; reach],
            columns: vec![vec![Pairs::default(); width]; reach],
            symmetries: [Pairs::default(); 8],
            zeros: 0,
            lit: 0,
            first_zero: None,
            places: vec![Pairs::default(); rows * width],
            shares: vec![Shares::default(); offsets],
            texels: vec![Shares::default(); with_reach * width],
            outliers: Outliers::default(),
        }
    }

    /// `start` is the first texel of the part.
    fn append(&mut self, part: Self, start: usize) {
        self.offsets.iter_mut().zip(&part.offsets).for_each(|(sum, part)| sum.merge(part));
        self.rows.iter_mut().zip(part.rows).for_each(|(all, part)| all.extend(part));
        for (all, part) in self.columns.iter_mut().zip(&part.columns) {
            all.iter_mut().zip(part).for_each(|(sum, part)| sum.merge(part));
        }
        self.symmetries.iter_mut().zip(&part.symmetries).for_each(|(sum, part)| sum.merge(part));
        self.zeros += part.zeros;
        self.lit += part.lit;
        self.first_zero = self.first_zero.or(part.first_zero);
        self.places.extend(part.places);
        self.shares.iter_mut().zip(&part.shares).for_each(|(sum, part)| sum.merge(part));
        self.texels[start..].iter_mut().zip(&part.texels).for_each(|(sum, part)| sum.merge(part));
        self.outliers.merge(&part.outliers);
    }

    fn judge(self, dataset: &Dataset, offsets: &[[isize; 2]], rings: &Rings, global: &[f32]) -> Reciprocity {
        let mut breaches = Vec::new();
        let left = self.symmetries.map(|pairs| relative(&pairs));
        let best = (1..8).min_by(|&a, &b| left[a].total_cmp(&left[b])).unwrap_or(0);
        // Turned by half a turn, a reciprocal mean window is the same: only places tell.
        if left[best] < BETTER * left[0] {
            breaches.push(Breach::Turned { how: SYMMETRIES[best].1, leaves: [left[0], left[best]] });
        }
        if self.zeros > 0 && self.zeros as f64 > 1e-6 * self.lit as f64 {
            let at = self.first_zero.unwrap_or_default();
            breaches.push(Breach::Zeros { count: self.zeros, of: self.lit, at });
        }
        if breaches.is_empty() {
            let ratios: Vec<Option<(f64, f64)>> = self.offsets.iter().map(Pairs::log_ratio).collect();
            let lines: Vec<Breach> =
                gains("row", &self.rows).into_iter().chain(gains("column", &self.columns)).collect();
            let size = [dataset.width, dataset.height];
            match texels(size, offsets, &self.shares, &self.texels) {
                // The mean window of texels in another order says little.
                Some(found) if found.variance > bent(&self.shares) => {
                    breaches.extend(if found.by_line && !lines.is_empty() { lines } else { vec![found.breach] });
                }
                _ => {
                    breaches.extend(shift_or_drift(offsets, &ratios, rings, global, dataset));
                    if breaches.is_empty() {
                        breaches.extend(hot_line(offsets, &ratios));
                    }
                    breaches.extend(lines);
                }
            }
        }
        if breaches.is_empty() {
            breaches.extend(self.outliers.judge());
        }
        let places = self.places.iter().map(|pairs| relative(pairs) as f32).collect();
        Reciprocity { relative: left[0], places, breaches }
    }
}

fn relative(pairs: &Pairs) -> f64 {
    if pairs.squares > 0.0 { (pairs.difference / pairs.squares).sqrt() } else { f64::NAN }
}
