//! Gains of lit rows and columns.

use super::{Breach, NAMED_GAIN, Pairs, SIGMAS};

/// ln gain of every line by least squares over the differences to the lines 1, 2, … further (Gauss–Seidel).
pub(super) fn gains(what: &'static str, by_step: &[Vec<Pairs>]) -> Option<Breach> {
    const SWEEPS: usize = 4000;
    let count = by_step.first()?.len();
    // From line, to line, difference, weight: less a step's own mean, which no line's gain makes.
    let mut links = Vec::new();
    for (step, lines) in by_step.iter().enumerate() {
        let known: Vec<(usize, f64, f64)> = (0..count.saturating_sub(step + 1))
            .filter_map(|at| lines[at].log_ratio().map(|(log, error)| (at, log, error)))
            .collect();
        // A few pairs may agree by chance: no line is known better than most are.
        let mut errors: Vec<f64> = known.iter().map(|line| line.2).collect();
        errors.sort_by(f64::total_cmp);
        let usual = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
        let weigh = |(at, log, error): (usize, f64, f64)| (at, log, 1.0 / (error.max(usual).powi(2) + 1e-6));
        let known: Vec<(usize, f64, f64)> = known.into_iter().map(weigh).collect();
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
