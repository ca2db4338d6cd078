//! What the mean window differs from its mirror image by: a shift, a drift, a hot line.

use super::{
    super::{Dataset, rings::Rings},
    Breach, NAMED_GAIN, NAMED_SHIFT, SIGMAS, Shares,
};

/// Mean square of what the mean window differs from its mirror image by, as a share.
pub(super) fn bent(shares: &[Shares]) -> f64 {
    let (sum, count) = shares.iter().fold((0.0, 0.0), |(sum, count), offset| {
        (sum + offset.sum * offset.sum / offset.count.max(1.0), count + offset.count)
    });
    sum / f64::max(count, 1.0)
}

/// Two slopes that explain the logarithms of the ratios, and the sum of squares that they leave.
fn fit(rows: &[[f64; 4]]) -> Option<([f64; 2], f64)> {
    let (mut xx, mut xy, mut yy, mut xv, mut yv) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for [gx, gy, value, _] in rows {
        xx += gx * gx;
        xy += gx * gy;
        yy += gy * gy;
        xv += gx * value;
        yv += gy * value;
    }
    let determinant = xx * yy - xy * xy;
    if !(determinant > 0.0) {
        return None;
    }
    let slopes = [(yy * xv - xy * yv) / determinant, (xx * yv - xy * xv) / determinant];
    let left = rows.iter().map(|[gx, gy, value, _]| (value - gx * slopes[0] - gy * slopes[1]).powi(2)).sum();
    Some((slopes, left))
}

/// The shift whose 2 s·∇ ln R is what the mean window differs from its mirror image by, or the drift that grows with
/// the offset.
pub(super) fn shift_or_drift(
    offsets: &[[isize; 2]],
    ratios: &[Option<(f64, f64)>],
    rings: &Rings,
    global: &[f32],
    dataset: &Dataset,
) -> Option<Breach> {
    let log_at = |r: f64| {
        let r = r * dataset.pitch_mm;
        let distances = &rings.distances_mm;
        let after = distances.partition_point(|distance| *distance < r).clamp(1, distances.len() - 1);
        let at = ((r - distances[after - 1]) / (distances[after] - distances[after - 1])).clamp(0.0, 1.0);
        let [low, high] = [after - 1, after].map(|i| libm::log(f64::from(global[i])));
        low + at * (high - low)
    };
    let known = || offsets.iter().zip(ratios).filter_map(|(offset, ratio)| ratio.map(|ratio| (*offset, ratio)));
    let shifts: Vec<[f64; 4]> = known()
        .map(|([dx, dy], (value, error))| {
            let r = ((dx * dx + dy * dy) as f64).sqrt();
            let slope = (log_at(r + 0.5) - log_at((r - 0.5).max(0.0))) / if r < 0.5 { r + 0.5 } else { 1.0 };
            [2.0 * slope * dx as f64 / r, 2.0 * slope * dy as f64 / r, value, error]
        })
        .collect();
    let drifts: Vec<[f64; 4]> =
        known().map(|([dx, dy], (value, error))| [-dx as f64, -dy as f64, value, error]).collect();
    let n = shifts.len() as f64;
    let all: f64 = shifts.iter().map(|row| row[2] * row[2]).sum();
    let noise: f64 = shifts.iter().map(|row| row[3] * row[3]).sum();
    if n < 6.0 || !(all > SIGMAS * SIGMAS * noise / n.sqrt()) {
        return None;
    }
    let ((pixels, by_shift), (slopes, by_drift)) = (fit(&shifts)?, fit(&drifts)?);
    let most = 0.35 * all;
    if by_shift < most && by_shift <= by_drift && libm::hypot(pixels[0], pixels[1]) > NAMED_SHIFT {
        return Some(Breach::Shifted { pixels });
    }
    let across = [slopes[0] * (dataset.width - 1) as f64, slopes[1] * (dataset.height - 1) as f64];
    let drifts = by_drift < most && by_drift < by_shift && across[0].abs().max(across[1].abs()) > NAMED_GAIN;
    drifts.then_some(Breach::Drift { across })
}

/// The column or row of the mean window that stands out of its mirror image most.
pub(super) fn hot_line(offsets: &[[isize; 2]], ratios: &[Option<(f64, f64)>]) -> Option<Breach> {
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
