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
//! - zeros in place of what is missing: nothing one way, light the other.
//!
//! Offsets up to a few pixels are compared, where windows have most of their light.

use rayon::prelude::*;

use super::{BssrdfError, Dataset, responses::Channel, rings::Rings};
use crate::watch::{Thousandths, Watch};

/// Offsets compared reach so many pixels…
const REACH: isize = 4;
/// …in rows handed out so many at a time.
const BAND_ROWS: usize = 32;
/// A pair tells zeros from light where the other way has at least this share of the mean response there.
const LIT_SHARE: f64 = 0.3;
/// …and so many of the smallest steps of the data: counts of photons are 0 by chance.
const QUANTA: f64 = 14.0;
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

/// What breaks the symmetry, with its size.
#[derive(Debug, Clone, PartialEq)]
pub enum Breach {
    /// Windows are another way round.
    Turned {
        /// How.
        how: &'static str,
        /// What they leave as they are, and turned back: root mean square differences as shares.
        leaves: [f64; 2],
    },
    /// Windows are shifted against their texels.
    Shifted {
        /// By how much, pixels to the right and down.
        pixels: [f64; 2],
    },
    /// A column or row of the windows is brighter than its mirror image.
    HotLine {
        /// "column" or "row".
        what: &'static str,
        /// Its place from the lit texel, pixels.
        at: isize,
        /// By this share.
        share: f64,
    },
    /// Rows or columns of lit texels have gains of their own.
    Gains {
        /// "row" or "column".
        what: &'static str,
        /// The worst one.
        at: usize,
        /// Its gain less 1.
        share: f64,
        /// Root mean square over all.
        rms: f64,
    },
    /// Zeros where the other way there is light.
    Zeros {
        /// How many.
        count: u64,
        /// Of so many pairs that have light.
        of: u64,
        /// One of them: row and column of the lit texel.
        at: [usize; 2],
    },
}

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
}

impl Pairs {
    fn add(&mut self, a: f64, b: f64) {
        self.a += a;
        self.b += b;
        self.squares += 0.5 * (a * a + b * b);
        self.difference += (a - b) * (a - b);
    }

    fn merge(&mut self, other: &Self) {
        self.a += other.a;
        self.b += other.b;
        self.squares += other.squares;
        self.difference += other.difference;
    }

    /// ln of the ratio of the sums, and its standard error with all differences independent.
    fn log_ratio(&self) -> Option<(f64, f64)> {
        let log = libm::log(self.a / self.b);
        (self.a > 0.0 && self.b > 0.0 && log.is_finite()).then(|| (log, self.difference.sqrt() / self.a.min(self.b)))
    }
}

impl Breach {
    /// Whether no surface can have such windows, so that nothing should be made of them.
    pub fn is_no_data(&self) -> bool {
        match self {
            Self::Turned { .. } => true,
            Self::Zeros { count, of, .. } => *count as f64 > MOST_ZEROS * *of as f64,
            Self::Shifted { pixels: [x, y] } => libm::hypot(*x, *y) > MOST_SHIFT,
            _ => false,
        }
    }
}

/// More zeros than this share of what has light the other way are no dead pixels.
const MOST_ZEROS: f64 = 1e-3;
/// A shift from here on puts the light into another texel.
const MOST_SHIFT: f64 = 0.75;

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
        let mut sums = Sums::new(half_plane.len(), reach as usize, [width, rows.len()]);
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
    let mut total = Sums::new(half_plane.len(), reach as usize, [width, 0]);
    for batch in starts.chunks(rayon::current_num_threads()) {
        progress.go_on()?;
        let parts: Vec<Result<Sums, BssrdfError>> = batch.par_iter().map(|first| band_sums(*first)).collect();
        for part in parts {
            total.append(part?);
        }
        progress.advance((batch.len() * BAND_ROWS) as u64);
    }
    Ok(total.judge(&half_plane, rings, global, dataset.pitch_mm))
}

impl Sums {
    /// Of `rows` rows, nothing so far.
    fn new(offsets: usize, reach: usize, [width, rows]: [usize; 2]) -> Self {
        Self {
            offsets: vec![Pairs::default(); offsets],
            rows: vec![vec![Pairs::default(); rows]; reach],
            columns: vec![vec![Pairs::default(); width]; reach],
            symmetries: [Pairs::default(); 8],
            zeros: 0,
            lit: 0,
            first_zero: None,
            places: vec![Pairs::default(); rows * width],
        }
    }

    fn append(&mut self, part: Self) {
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
    }

    fn judge(self, offsets: &[[isize; 2]], rings: &Rings, global: &[f32], pitch_mm: f64) -> Reciprocity {
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
            breaches.extend(shift(offsets, &ratios, rings, global, pitch_mm));
            if breaches.is_empty() {
                breaches.extend(hot_line(offsets, &ratios));
            }
            breaches.extend(gains("row", &self.rows));
            breaches.extend(gains("column", &self.columns));
        }
        let places = self.places.iter().map(|pairs| relative(pairs) as f32).collect();
        Reciprocity { relative: left[0], places, breaches }
    }
}

fn relative(pairs: &Pairs) -> f64 {
    if pairs.squares > 0.0 { (pairs.difference / pairs.squares).sqrt() } else { f64::NAN }
}

/// The shift whose 2 s·∇ ln R is what the mean window differs from its mirror image by.
fn shift(
    offsets: &[[isize; 2]],
    ratios: &[Option<(f64, f64)>],
    rings: &Rings,
    global: &[f32],
    pitch_mm: f64,
) -> Option<Breach> {
    let log_at = |r: f64| {
        let r = r * pitch_mm;
        let distances = &rings.distances_mm;
        let after = distances.partition_point(|distance| *distance < r).clamp(1, distances.len() - 1);
        let at = ((r - distances[after - 1]) / (distances[after] - distances[after - 1])).clamp(0.0, 1.0);
        let [low, high] = [after - 1, after].map(|i| libm::log(f64::from(global[i])));
        low + at * (high - low)
    };
    let (mut xx, mut xy, mut yy, mut xv, mut yv, mut vv, mut n) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0_f64);
    let rows: Vec<_> = offsets
        .iter()
        .zip(ratios)
        .filter_map(|(&[dx, dy], ratio)| {
            let (value, error) = (*ratio)?;
            let r = ((dx * dx + dy * dy) as f64).sqrt();
            let slope = (log_at(r + 0.5) - log_at((r - 0.5).max(0.0))) / if r < 0.5 { r + 0.5 } else { 1.0 };
            Some((2.0 * slope * dx as f64 / r, 2.0 * slope * dy as f64 / r, value, error))
        })
        .collect();
    for (gx, gy, value, _) in &rows {
        xx += gx * gx;
        xy += gx * gy;
        yy += gy * gy;
        xv += gx * value;
        yv += gy * value;
        vv += value * value;
        n += 1.0;
    }
    let determinant = xx * yy - xy * xy;
    if !(determinant > 0.0) || n < 6.0 {
        return None;
    }
    let pixels = [(yy * xv - xy * yv) / determinant, (xx * yv - xy * xv) / determinant];
    let left: f64 = rows.iter().map(|(gx, gy, v, _)| (v - gx * pixels[0] - gy * pixels[1]).powi(2)).sum();
    let noise: f64 = rows.iter().map(|(.., error)| error * error).sum();
    let explains = left < 0.35 * vv && vv > SIGMAS * SIGMAS * noise / n.sqrt();
    (explains && libm::hypot(pixels[0], pixels[1]) > NAMED_SHIFT).then_some(Breach::Shifted { pixels })
}

/// The column or row of the mean window that stands out of its mirror image most.
fn hot_line(offsets: &[[isize; 2]], ratios: &[Option<(f64, f64)>]) -> Option<Breach> {
    let mut worst: Option<(f64, Breach)> = None;
    for axis in 0..2 {
        let reach = offsets.iter().map(|offset| offset[axis].abs()).max().unwrap_or(0);
        for at in 1..=reach {
            let (mut sum, mut weight) = (0.0, 0.0);
            for (offset, ratio) in offsets.iter().zip(ratios).filter(|(offset, _)| offset[axis].abs() == at) {
                let Some((value, error)) = ratio else { continue };
                let own = 1.0 / (error * error + 1e-8);
                sum += own * value * offset[axis].signum() as f64;
                weight += own;
            }
            let (mean, error) = (sum / weight, (1.0 / weight).sqrt());
            let significance = mean.abs() / error;
            if mean.abs() > NAMED_GAIN && significance > SIGMAS && worst.as_ref().is_none_or(|w| mean.abs() > w.0) {
                let what = if axis == 0 { "column" } else { "row" };
                let at = if mean > 0.0 { at } else { -at };
                worst = Some((mean.abs(), Breach::HotLine { what, at, share: libm::expm1(mean.abs()) }));
            }
        }
    }
    worst.map(|worst| worst.1)
}

/// ln gain of every line by least squares over the differences to the lines 1, 2, … further (Gauss–Seidel).
fn gains(what: &'static str, by_step: &[Vec<Pairs>]) -> Option<Breach> {
    const SWEEPS: usize = 4000;
    let count = by_step.first()?.len();
    // From line, to line, difference, weight: less a step's own mean, which no line's gain makes.
    let mut links = Vec::new();
    for (step, lines) in by_step.iter().enumerate() {
        let known: Vec<(usize, f64, f64)> = lines
            .iter()
            .enumerate()
            .filter_map(|(at, pairs)| pairs.log_ratio().map(|(log, error)| (at, log, 1.0 / (error * error + 1e-6))))
            .filter(|(at, ..)| at + step + 1 < count)
            .collect();
        let weight: f64 = known.iter().map(|line| line.2).sum();
        let mean = known.iter().map(|line| line.1 * line.2).sum::<f64>() / weight.max(f64::MIN_POSITIVE);
        links.extend(known.into_iter().map(|(at, log, weight)| (at, at + step + 1, log - mean, weight)));
    }
    if links.len() < 4 || count < 4 {
        return None;
    }
    let mut near: Vec<Vec<(usize, f64, f64)>> = vec![Vec::new(); count];
    for &(from, to, difference, weight) in &links {
        near[from].push((to, difference, weight));
        near[to].push((from, -difference, weight));
    }
    let mut logs = vec![0.0_f64; count];
    for _ in 0..SWEEPS {
        let mut moved = 0.0_f64;
        for at in 0..count {
            let weight: f64 = near[at].iter().map(|link| link.2).sum();
            if weight > 0.0 {
                let value = near[at].iter().map(|(to, off, own)| own * (logs[*to] + off)).sum::<f64>() / weight;
                moved = moved.max((value - logs[at]).abs());
                logs[at] = value;
            }
        }
        if moved < 1e-7 {
            break;
        }
    }
    // Against the lines on both sides: what drifts slowly over the patch is no gain of a line.
    let own: Vec<(usize, f64, f64)> = (0..count)
        .map(|at| {
            let from = at.saturating_sub(3);
            let mut around: Vec<f64> =
                (from..(at + 4).min(count)).filter(|near| *near != at).map(|near| logs[near]).collect();
            around.sort_by(f64::total_cmp);
            let middle = around[around.len() / 2];
            let weight: f64 = near[at].iter().map(|link| link.2).sum();
            (at, logs[at] - middle, (1.0 / weight.max(f64::MIN_POSITIVE)).sqrt())
        })
        .collect();
    let rms = (own.iter().map(|line| line.1 * line.1).sum::<f64>() / count as f64).sqrt();
    let named = own.iter().filter(|(_, log, error)| log.abs() > NAMED_GAIN && log.abs() > SIGMAS * error);
    let (at, log, _) = named.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    Some(Breach::Gains { what, at: *at, share: libm::expm1(*log), rms })
}

impl std::fmt::Display for Breach {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Turned { how, leaves: [as_is, back] } => write!(
                f,
                "windows that look {how}: both ways differ by {:.1}% as they are, by {:.1}% if that is undone",
                100.0 * as_is,
                100.0 * back
            ),
            Self::Shifted { pixels: [x, y] } => write!(
                f,
                "windows are shifted by about {x:+.2}, {y:+.2} pixels against their lit texels (right, down): is the lit \
                 texel the middle pixel's centre?"
            ),
            Self::HotLine { what, at, share } => write!(
                f,
                "{what} {at:+} of the windows, from the lit texel, is {:.1}% brighter than its mirror image: a hot {what} \
                 of the sensor, or another background there",
                100.0 * share
            ),
            Self::Gains { what, at, share, rms } => write!(
                f,
                "lit {what}s have gains of their own, {what} {at} {:+.1}%, {:.1}% rms over all: light or exposure that \
                 changed while they were measured",
                100.0 * share,
                100.0 * rms
            ),
            Self::Zeros { count, of, at: [row, column] } => write!(
                f,
                "{count} zeros in {of} pairs that have light the other way, one in the window of row {row}, column {column}"
            ),
        }
    }
}
