//! Sums of |x − y|^−p over pieces of surface y, for many positions x at once.
//!
//! A piece of area A, centroid m and second moments H counts as the first terms of its Taylor series; with r = x − m
//!
//! ```text
//!   ∫ |x − y|^−p dA ≈ r^−p · ( A + p/(2 r²) · ( (p + 2) · rᵀHr / r² − tr H ) )
//! ```
//!
//! Single precision, without branches, for several instruction sets with the same bits (see [`super::kernel`]). What is
//! summed is (d/r)^p with d the position's exact distance, so that nothing overflows, whatever p.

use glam::{DVec3, Vec3};
use multiversion::multiversion;

use super::moments::Moments;

/// Pieces of surface, ready for the sum. Coordinates are relative to the brick's centre.
#[derive(Debug, Default)]
pub struct Sources {
    patches: Vec<Patch>,
    centres: Vec<[f32; 3]>,
}

/// Pieces that differ in their centroid only.
#[derive(Debug, Clone, Copy)]
struct Patch {
    /// End of its centroids, which start where those of the patch before it end.
    end: u32,
    area: f32,
    /// Second moments times p(p + 2)/2, those off the diagonal twice.
    second: [f32; 6],
    /// Trace of the second moments times p/2.
    trace: f32,
}

impl Sources {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.patches.clear();
        self.centres.clear();
    }

    /// Adds a piece whose moments are given relative to `origin`.
    pub fn add(&mut self, moments: &Moments, origin: DVec3, exponent: f64) {
        self.centres.push((moments.centre - origin).as_vec3().to_array());
        self.patch(moments, exponent);
    }

    /// Adds a triangle as `n`² equal ones: cut along lines parallel to its edges they are all translates or mirror
    /// images of each other, so they have the same second moments.
    pub fn add_triangle(&mut self, corners: &[Vec3; 3], n: u32, exponent: f64) {
        let mut moments = Moments::of_triangle(&corners.map(|c| c.as_dvec3()));
        let share = 1.0 / f64::from(n * n);
        moments.area *= share;
        moments.second = moments.second.map(|m| m * share * share);
        let step = 1.0 / n as f32;
        let (along, across) = ((corners[1] - corners[0]) * step, (corners[2] - corners[0]) * step);
        let mut push = |i: u32, j: u32, third: f32| {
            let centre = corners[0] + along * (i as f32 + third) + across * (j as f32 + third);
            self.centres.push(centre.to_array());
        };
        for j in 0..n {
            for i in 0..n - j {
                push(i, j, 1.0 / 3.0);
                if i + j + 1 < n {
                    push(i, j, 2.0 / 3.0);
                }
            }
        }
        self.patch(&moments, exponent);
    }

    fn patch(&mut self, moments: &Moments, exponent: f64) {
        let scale = exponent * (exponent + 2.0) / 2.0;
        let [xx, yy, zz, xy, yz, zx] = moments.second.map(|m| m * scale);
        self.patches.push(Patch {
            end: self.centres.len() as u32,
            area: moments.area as f32,
            second: [xx, yy, zz, 2.0 * xy, 2.0 * yz, 2.0 * zx].map(|m| m as f32),
            trace: (moments.trace() * exponent / 2.0) as f32,
        });
    }
}

/// Positions and what is summed there; all of one length.
pub struct Positions<'a> {
    /// Relative to the brick's centre, mm.
    pub x: &'a [f32],
    /// See `x`.
    pub y: &'a [f32],
    /// See `x`.
    pub z: &'a [f32],
    /// Squares of the exact distances, mm².
    pub scale: &'a [f32],
    /// ∫ (d / |x − y|)^p dA, mm².
    pub sum: &'a mut [f32],
}

/// Adds `sources` to the sums.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
pub fn accumulate(sources: &Sources, exponent: f64, positions: &mut Positions<'_>) {
    // Even exponents take a few products; `0` stands for all others.
    match exponent {
        4.0 => add::<2>(sources, exponent, positions),
        6.0 => add::<3>(sources, exponent, positions),
        8.0 => add::<4>(sources, exponent, positions),
        10.0 => add::<5>(sources, exponent, positions),
        12.0 => add::<6>(sources, exponent, positions),
        16.0 => add::<8>(sources, exponent, positions),
        _ => add::<0>(sources, exponent, positions),
    }
}

/// Turns sums into distances: d_p = d · ((p − 2)/2π · sum / d²)^(−1/(p − 2)).
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
pub fn finish(exponent: f64, positions: &mut Positions<'_>) {
    let constant = ((exponent - 2.0) / std::f64::consts::TAU) as f32;
    let root = (-1.0 / (exponent - 2.0)) as f32;
    for (sum, scale) in positions.sum.iter_mut().zip(positions.scale) {
        *sum = scale.sqrt() * power(constant * *sum / scale, root);
    }
}

/// Positions come in powers of 8: 512 and 64 fill the widest vectors, 8 have their own width.
#[inline(always)]
fn add<const HALF: u32>(sources: &Sources, exponent: f64, positions: &mut Positions<'_>) {
    match positions.sum.len() {
        0..8 => add_lanes::<HALF, 1>(sources, exponent, positions),
        8..16 => add_lanes::<HALF, 8>(sources, exponent, positions),
        _ => add_lanes::<HALF, 16>(sources, exponent, positions),
    }
}

#[inline(always)]
fn add_lanes<const HALF: u32, const LANES: usize>(sources: &Sources, exponent: f64, positions: &mut Positions<'_>) {
    let half = (exponent / 2.0) as f32;
    let (x, y, z) = (positions.x.as_chunks().0, positions.y.as_chunks().0, positions.z.as_chunks().0);
    let (scale, sum) = (positions.scale.as_chunks().0, positions.sum.as_chunks_mut().0);
    for ((((x, y), z), scale), sum) in x.iter().zip(y).zip(z).zip(scale).zip(sum) {
        add_chunk::<HALF, LANES>(sources, half, x, y, z, scale, sum);
    }
}

#[inline(always)]
fn add_chunk<const HALF: u32, const LANES: usize>(
    sources: &Sources,
    half: f32,
    x: &[f32; LANES],
    y: &[f32; LANES],
    z: &[f32; LANES],
    scale: &[f32; LANES],
    sum: &mut [f32; LANES],
) {
    let mut centres = sources.centres.iter();
    let mut start = 0;
    for patch in &sources.patches {
        let [xx, yy, zz, xy, yz, zx] = patch.second;
        for &[cx, cy, cz] in centres.by_ref().take((patch.end - start) as usize) {
            for n in 0..LANES {
                let (rx, ry, rz) = (x[n] - cx, y[n] - cy, z[n] - cz);
                let inverse = 1.0 / (rx * rx + ry * ry + rz * rz);
                let form = rx * (xx * rx + xy * ry) + ry * (yy * ry + yz * rz) + rz * (zz * rz + zx * rx);
                let weight = patch.area + inverse * (inverse * form - patch.trace);
                let ratio = scale[n] * inverse;
                let falloff = if HALF == 0 { power(ratio, half) } else { whole_power::<HALF>(ratio) };
                sum[n] += falloff * weight;
            }
        }
        start = patch.end;
    }
}

/// tᴺ, N from 1 to 15.
#[inline(always)]
fn whole_power<const N: u32>(t: f32) -> f32 {
    let (t2, t4) = (t * t, t * t * (t * t));
    let mut product = 1.0;
    if N & 1 != 0 {
        product *= t;
    }
    if N & 2 != 0 {
        product *= t2;
    }
    if N & 4 != 0 {
        product *= t4;
    }
    if N & 8 != 0 {
        product *= t4 * t4;
    }
    product
}

/// t^e for t > 0, as 2^(e·log₂ t), with a relative error below 2·10⁻⁷·(1 + |e·log₂ t|); 0 for what is too small. Our
/// own, because the standard library's differs from system to system and stays scalar.
#[inline(always)]
fn power(t: f32, e: f32) -> f32 {
    // log₂: the mantissa m is brought to [√½, √2), log m = 2 atanh((m − 1)/(m + 1)).
    const ROOT_HALF_BITS: u32 = 0x3f35_04f3;
    let shifted = t.to_bits().wrapping_sub(ROOT_HALF_BITS);
    let whole = (shifted as i32) >> 23;
    let m = f32::from_bits((shifted & 0x007f_ffff) + ROOT_HALF_BITS);
    let s = (m - 1.0) / (m + 1.0);
    let s2 = s * s;
    let series = 1.0 + s2 * (1.0 / 3.0 + s2 * (1.0 / 5.0 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0))));
    let log2 = whole as f32 + 2.0 * std::f32::consts::LOG2_E * s * series;
    // 2^x: the whole part goes to the exponent, the rest, within ±½, into the exponential series.
    const LOWEST: f32 = -126.0;
    const HIGHEST: f32 = 126.0;
    let x = e * log2;
    let clamped = if x < LOWEST { LOWEST } else { x };
    let clamped = if clamped > HIGHEST { HIGHEST } else { clamped };
    // Adding and taking away 1.5·2²³ rounds to a whole number.
    const ROUNDER: f32 = 12_582_912.0;
    let rounded = (clamped + ROUNDER) - ROUNDER;
    let f = (clamped - rounded) * std::f32::consts::LN_2;
    let series =
        1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f * (1.0 / 720.0))))));
    let scaled = series * f32::from_bits((((rounded as i32) + 127) << 23) as u32);
    if x < LOWEST { 0.0 } else { scaled }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_agree_with_the_standard_library() {
        for n in 1..4000 {
            let t = n as f32 / 1999.0;
            for e in [1.05_f32, 2.5, 4.0, 31.7, -0.2, -10.0] {
                let exact = f64::from(t).powf(f64::from(e));
                if (1e-30..1e30).contains(&exact) {
                    let bound = 3e-7 * (1.0 + (f64::from(e) * f64::from(t).log2()).abs());
                    let error = (f64::from(power(t, e)) / exact - 1.0).abs();
                    assert!(error < bound, "{t}^{e}: {error:e}");
                }
            }
            let error = f64::from(whole_power::<5>(t)) / f64::from(t).powi(5) - 1.0;
            assert!(error.abs() < 1e-6);
        }
        assert_eq!(power(0.0, 1.5), 0.0);
    }
}
