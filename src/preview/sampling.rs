//! Reading and smoothing fields of cells.

use glam::Vec3;
use rayon::prelude::*;

use crate::parallel;

/// The eight cells around a position with their trilinear weights; cells outside are left out.
#[inline]
pub(super) fn corners(n: [usize; 3], position: Vec3, mut visit: impl FnMut(usize, f32)) {
    // Half a cell and one more, so that truncation rounds down.
    let shifted = position + 0.5;
    let whole = shifted.max(Vec3::ZERO).as_uvec3();
    let high = whole.to_array().map(|v| v as usize);
    if !shifted.cmpge(Vec3::ZERO).all() || (0..3).any(|axis| high[axis] > n[axis]) {
        return;
    }
    let part = shifted - whole.as_vec3();
    let rest = 1.0 - part;
    let plane = n[0] * n[1];
    let within = (0..3).all(|axis| high[axis] >= 1 && high[axis] < n[axis]);
    for corner in 0..8_usize {
        let upper = [corner & 1, corner >> 1 & 1, corner >> 2];
        let weight = |axis: usize| if upper[axis] == 1 { part[axis] } else { rest[axis] };
        // One more than the cell's index, so that it is never negative.
        let at: [usize; 3] = std::array::from_fn(|axis| high[axis] + upper[axis]);
        if within || (0..3).all(|axis| at[axis] >= 1 && at[axis] <= n[axis]) {
            visit(at[0] + n[0] * at[1] + plane * at[2] - 1 - n[0] - plane, weight(0) * weight(1) * weight(2));
        }
    }
}

/// The trilinear value at a position in cells; outside everything is 0.
#[inline]
pub(super) fn trilinear(n: [usize; 3], position: Vec3, value: impl Fn(usize) -> f32) -> f32 {
    let mut sum = 0.0;
    corners(n, position, |cell, weight| sum += weight * value(cell));
    sum
}

/// Half width of the window that is averaged over, and how often.
const WINDOWS: [usize; 2] = [2, 1];

/// A field averaged over windows of five, then three cells along every axis; outside everything is 0.
pub(super) fn smoothed(n: [usize; 3], value: impl Fn(usize) -> u8 + Sync) -> Vec<u16> {
    let [nx, ny, _] = n;
    let mut field: Vec<u16> = (0..n.iter().product()).into_par_iter().map(|cell| u16::from(value(cell)) << 8).collect();
    let average = |line: &mut dyn FnMut(usize) -> u16, length: usize, half: usize, out: &mut [u16]| {
        let mut sum = (0..half.min(length)).map(|at| u32::from(line(at))).sum::<u32>();
        for (at, out) in out.iter_mut().enumerate() {
            sum += if at + half < length { u32::from(line(at + half)) } else { 0 };
            sum -= if at > half { u32::from(line(at - half - 1)) } else { 0 };
            *out = (sum / (2 * half as u32 + 1)) as u16;
        }
    };
    for half in WINDOWS {
        parallel::rows(&mut field, nx * ny, |_, layer| {
            let mut out = vec![0; nx.max(ny)];
            for row in layer.chunks_exact_mut(nx) {
                average(&mut |at| row[at], nx, half, &mut out[..nx]);
                row.copy_from_slice(&out[..nx]);
            }
            for x in 0..nx {
                average(&mut |at| layer[x + nx * at], ny, half, &mut out[..ny]);
                for (y, &value) in out[..ny].iter().enumerate() {
                    layer[x + nx * y] = value;
                }
            }
        });
        // Along z a row of sums moves from layer to layer.
        let layers: Vec<&[u16]> = field.chunks_exact(nx * ny).collect();
        let mut next = vec![0; field.len()];
        parallel::rows(&mut next, nx * ny, |z, out| {
            let near = &layers[z.saturating_sub(half)..(z + half + 1).min(layers.len())];
            for (cell, out) in out.iter_mut().enumerate() {
                let sum: u32 = near.iter().map(|layer| u32::from(layer[cell])).sum();
                *out = (sum / (2 * half as u32 + 1)) as u16;
            }
        });
        field = next;
    }
    field
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_fields_are_read_back_exactly_between_centres() {
        let n = [5, 4, 3];
        let value = |cell: usize| (cell % 5) as f32 + 10.0 * (cell / 5 % 4) as f32 + 100.0 * (cell / 20) as f32;
        for position in [Vec3::new(2.3, 1.7, 1.2), Vec3::new(0.5, 0.5, 0.5), Vec3::new(4.5, 3.5, 2.5)] {
            let expected = (position - 0.5).dot(Vec3::new(1.0, 10.0, 100.0));
            assert!((trilinear(n, position, value) - expected).abs() < 1e-3);
        }
    }

    #[test]
    fn outside_is_nothing() {
        let ones = |position| trilinear([2, 2, 2], position, |_| 1.0);
        assert_eq!(ones(Vec3::new(0.0, 1.0, 1.0)), 0.5);
        assert_eq!(ones(Vec3::new(2.0, 1.0, 1.0)), 0.5);
        for far in [-0.6, 2.6, -1e9, 1e9, f32::NAN] {
            assert_eq!(ones(Vec3::new(1.0, far, 1.0)), 0.0);
        }
    }

    #[test]
    fn smoothing_keeps_constants_inside_and_sums_to_one() {
        let n = [9, 11, 13];
        let flat = smoothed(n, |_| 255);
        assert_eq!(flat[4 + 9 * (5 + 11 * 6)], 255 << 8);
        let dot = smoothed(n, |cell| if cell == 4 + 9 * (5 + 11 * 6) { 255 } else { 0 });
        let sum: u32 = dot.iter().map(|&v| u32::from(v)).sum();
        assert!((sum as f64 / f64::from(255 << 8) - 1.0).abs() < 0.02, "{sum}");
    }
}
