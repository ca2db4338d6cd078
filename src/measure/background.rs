//! What lies under the far end of a profile: a level of stray light, and the diffuse tail that noise hides.
//!
//! Far from the source, light in a slab is its slowest mode, K₀(κr) ~ e^(−κr)/√r. Outer rings are fitted by
//! a·e^(−κr)/√r + level; from where noise exceeds light the profile is continued by the same without the level.

use super::rings::Grid;

/// Fits start where the profile is below these shares of its largest ring. The later, the nearer is the light to its
/// slowest mode: started at 1e-2, a fit of the synthetic white sees a level of 4e-4 of its light (4 standard errors)
/// where there is none.
const STARTS: [f64; 9] = [1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5];
/// The latest start of those with a fit this good (χ² per degree of freedom) counts; what the one before says
/// differently is error.
const GOOD_FIT: f64 = 1.5;
/// A fit that knows its decay no better than this says nothing of the level: light that is nearly gone where the fit
/// starts can pass for a level, and a level for light. Fits of a hundred standard errors of light know it to 1%, those
/// of two to 90%.
const KNOWN_DECAY: f64 = 0.1;
/// Rings a fit needs.
const MIN_FIT: usize = 10;
/// Decays tried, per mm: support has 0.4, black 8.
const DECAYS: (f64, f64, usize) = (0.02, 40.0, 240);
/// Light ends where the mean of a few rings is below so many of its standard errors.
const LIGHT: f64 = 4.0;
const FEW: usize = 5;
/// The tail is fitted to the rings from this many times the last light on.
const TAIL_RANGE: f64 = 30.0;
/// The continuation ends at this share of the largest ring: less than 1e-6 of the energy is beyond.
const TAIL_END: f64 = 1e-9;

/// A level and its standard error, DN/s.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Level {
    pub value: f64,
    pub error: f64,
}

/// e^(−κ(r − from))/√(r/from) times a factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DiffuseTail {
    pub amplitude: f64,
    pub decay_per_mm: f64,
    pub from_mm: f64,
    /// Standard errors of ln amplitude and of κ.
    log_error: f64,
    decay_error: f64,
}

impl DiffuseTail {
    fn shape(decay: f64, from_mm: f64, r: f64) -> f64 {
        libm::exp(-decay * (r - from_mm)) * (from_mm / r).sqrt()
    }

    pub fn at(&self, r: f64) -> f64 {
        self.amplitude * Self::shape(self.decay_per_mm, self.from_mm, r)
    }

    /// Standard error at a radius.
    pub fn error_at(&self, r: f64) -> f64 {
        self.at(r) * libm::hypot(self.log_error, self.decay_error * (r - self.from_mm))
    }
}

struct Fit {
    tail: DiffuseTail,
    level: Level,
    chi: f64,
}

/// The level under the outer rings; `None` if they are too few, or signal reaches to the last of them.
pub(super) fn level(grid: &Grid, mean: &[f64], error: &[f64]) -> Option<Level> {
    let peak = mean.iter().copied().fold(0.0, f64::max);
    let (mut best, mut before): (Option<Fit>, Option<f64>) = (None, None);
    for start in STARTS {
        let Some(from) = mean.iter().position(|value| *value < start * peak) else { continue };
        if grid.bins - from < MIN_FIT {
            continue;
        }
        let Some(fit) = fit(grid, mean, error, from..grid.bins, true) else { continue };
        if !(fit.tail.decay_error < KNOWN_DECAY * fit.tail.decay_per_mm) {
            continue;
        }
        let better = best.as_ref().is_none_or(|best| fit.chi < GOOD_FIT || fit.chi < best.chi);
        if better {
            before = best.as_ref().map(|best| best.level.value);
            best = Some(fit);
        }
    }
    let Level { value, error } = best.as_ref()?.level;
    let widened = best.map_or(1.0, |fit| fit.chi.max(1.0).sqrt());
    let model = before.map_or(0.0, |before| value - before);
    Some(Level { value, error: libm::hypot(error * widened, model) })
}

/// The first ring whose light is lost in noise, if there is one.
pub(super) fn first_lost(mean: &[f64], error: &[f64]) -> Option<usize> {
    let lost = |first: usize| {
        let last = (first + FEW).min(mean.len());
        let sum: f64 = mean[first..last].iter().sum();
        let variance: f64 = error[first..last].iter().map(|error| error * error).sum();
        !(sum > LIGHT * variance.sqrt())
    };
    (0..mean.len()).find(|&first| lost(first))
}

/// The tail that the rings before `lost` fall along.
pub(super) fn tail(grid: &Grid, mean: &[f64], error: &[f64], lost: usize) -> Option<DiffuseTail> {
    let last = mean[lost.saturating_sub(FEW)..lost].iter().sum::<f64>() / FEW as f64;
    let from = mean[..lost].iter().rposition(|value| *value > TAIL_RANGE * last).map_or(0, |bin| bin + 1);
    let from = from.min(lost.saturating_sub(MIN_FIT));
    fit(grid, mean, error, from..lost, false).map(|fit| fit.tail).filter(|tail| tail.amplitude > 0.0)
}

/// Rings the continuation needs.
pub(super) fn tail_end(grid: &Grid, tail: &DiffuseTail, peak: f64, lost: usize) -> usize {
    let end = (lost..4 * lost).find(|&bin| tail.at(grid.radius(bin)) < TAIL_END * peak);
    end.unwrap_or(4 * lost)
}

/// Best decay of all tried, refined by a parabola's vertex; amplitude and level follow linearly.
fn fit(grid: &Grid, mean: &[f64], error: &[f64], rings: std::ops::Range<usize>, with_level: bool) -> Option<Fit> {
    if rings.len() < MIN_FIT || error[rings.clone()].iter().any(|error| !(*error > 0.0)) {
        return None;
    }
    let from_mm = grid.radius(rings.start);
    let linear = |decay: f64| {
        let (mut aa, mut ab, mut bb, mut ay, mut by, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for bin in rings.clone() {
            let weight = 1.0 / (error[bin] * error[bin]);
            let shape = DiffuseTail::shape(decay, from_mm, grid.radius(bin));
            aa += weight * shape * shape;
            ab += weight * shape;
            bb += weight;
            ay += weight * shape * mean[bin];
            by += weight * mean[bin];
            yy += weight * mean[bin] * mean[bin];
        }
        if !with_level {
            (ab, bb, by) = (0.0, 1.0, 0.0);
        }
        let determinant = aa * bb - ab * ab;
        let (amplitude, level) = ((bb * ay - ab * by) / determinant, (aa * by - ab * ay) / determinant);
        let misfit = yy - amplitude * ay - level * by;
        (misfit, amplitude, level, [bb / determinant, aa / determinant])
    };
    let (low, high, count) = DECAYS;
    let log_step = libm::log(high / low) / (count - 1) as f64;
    let decay = |i: f64| low * libm::exp(i * log_step);
    let misfit = |i: f64| linear(decay(i)).0;
    let best = (0..count).map(|i| (misfit(i as f64), i)).min_by(|a, b| a.0.total_cmp(&b.0))?.1;
    // A minimum at either end is no decay at all.
    if best == 0 || best == count - 1 {
        return None;
    }
    let centre = best as f64;
    let [before, here, after] = [misfit(centre - 1.0), misfit(centre), misfit(centre + 1.0)];
    let bend = before - 2.0 * here + after;
    let vertex = centre + if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    let decay_per_mm = decay(vertex);
    let (misfit, amplitude, level, variances) = linear(decay_per_mm);
    let chi = misfit.max(0.0) / (rings.len() - if with_level { 3 } else { 2 }) as f64;
    // χ² rises by bend/2 · x² in steps of ln κ; 1 is one standard deviation.
    let log_decay_error = if bend > 0.0 { log_step * (2.0 / bend).sqrt() } else { 1.0 };
    let widened = chi.max(1.0).sqrt();
    let tail = DiffuseTail {
        amplitude,
        decay_per_mm,
        from_mm,
        log_error: widened * variances[0].sqrt() / amplitude.abs(),
        decay_error: widened * log_decay_error * decay_per_mm,
    };
    // The level leans on the decay: its error with the decay free, from its change along it.
    let lean = (linear(decay(vertex + 0.5)).2 - linear(decay(vertex - 0.5)).2) / log_step * log_decay_error;
    Some(Fit { tail, level: Level { value: level, error: libm::hypot(variances[1].sqrt(), lean) }, chi })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::simulate::normal;
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::SeedableRng;

    fn rings(level: f64) -> (Grid, Vec<f64>, Vec<f64>) {
        let grid = Grid { centre: [0.0; 2], mm_per_pixel: 0.05, bin_mm: 0.05, bins: 200 };
        let light = |bin| 1e3 * (-1.5 * grid.radius(bin)).exp() / grid.radius(bin).sqrt();
        let mean =
            (0..200).map(|bin| light(bin) + level + 1e-3 * f64::from((bin * 7919 % 13) as u32 as f32 - 6.0) / 4.0);
        (grid, mean.collect(), vec![1e-3; 200])
    }

    #[test]
    fn a_level_is_told_from_a_tail() {
        let (grid, mean, error) = rings(0.05);
        let level = level(&grid, &mean, &error).unwrap();
        assert!((level.value - 0.05).abs() < 5.0 * level.error.max(2e-4) && level.error < 1e-3, "{level:?}");
    }

    /// The stated error is the true one: levels of many noisy profiles scatter as they say. With decay and amplitude
    /// free, least squares from the last start that knows its decay (100 standard errors of light) leaves 1.6e-4 at
    /// best.
    #[test]
    fn levels_scatter_as_their_errors_say() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(11);
        let (grid, _, error) = rings(0.05);
        const RUNS: usize = 400;
        let (mut pulls, mut squares, mut stated) = (0.0, 0.0, 0.0);
        for _ in 0..RUNS {
            let noisy = |bin| {
                let r = grid.radius(bin);
                1e3 * (-1.5 * r).exp() / r.sqrt() + 0.05 + 1e-3 * normal(&mut rng)
            };
            let mean: Vec<f64> = (0..200).map(noisy).collect();
            let level = level(&grid, &mean, &error).unwrap();
            let off = level.value - 0.05;
            (pulls, squares, stated) = (pulls + (off / level.error).powi(2), squares + off * off, stated + level.error);
            assert!(off.abs() < 5.0 * level.error && level.error < 1e-3, "{level:?}");
        }
        let [pull, scatter] = [pulls, squares].map(|sum: f64| (sum / RUNS as f64).sqrt());
        println!("pull {pull:.2}, scatter {scatter:.2e}, stated {:.2e}", stated / RUNS as f64);
        assert!((0.6..1.2).contains(&pull), "errors are off by a factor of {pull}");
        assert!((1.5e-4..3e-4).contains(&scatter), "scatter {scatter}");
    }

    #[test]
    fn a_tail_goes_on_as_it_fell() {
        let (grid, mean, error) = rings(0.0);
        let lost = first_lost(&mean, &error).unwrap();
        let tail = tail(&grid, &mean, &error, lost).unwrap();
        assert!((tail.decay_per_mm / 1.5 - 1.0).abs() < 0.02, "{tail:?}");
        let r = grid.radius(lost) + 2.0;
        let exact = 1e3 * (-1.5 * r).exp() / r.sqrt();
        assert!((tail.at(r) - exact).abs() < 4.0 * tail.error_at(r), "{} for {exact}", tail.at(r));
    }
}
