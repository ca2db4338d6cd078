//! The inner loops of the factorisation, over a stretch of texels in a row and one pixel of their windows.
//!
//! R̂ = g·eᵢ·eₒ with g the global profile at the pixel's distance and e = √(P/g) of the lit and the lit-up texel. The
//! variance of a measurement is V = floor² + gain·R̂ + (relative·R̂)², the weight of a difference of logarithms is
//! R̂²/V.

use multiversion::multiversion;

/// Coefficients of V(R̂): constant, linear, square.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variance {
    /// floor², per mm⁴.
    pub constant: f32,
    /// gain, per mm².
    pub linear: f32,
    /// relative².
    pub square: f32,
}

impl Variance {
    #[inline(always)]
    fn of(self, r: f32) -> f32 {
        self.constant + r * (self.linear + r * self.square)
    }
}

/// How a measurement is held against the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Residual {
    /// ln(D/R̂) by its Padé approximant 2(ρ − 1)/(ρ + 1), finite at 0 and below: for a model that is far off.
    Logarithm,
    /// (D − R̂)/R̂: zero on average whatever the noise, as a logarithm of noisy values is not.
    Linear,
}

/// One texel's sums over the pixels of a ring.
#[derive(Debug, Clone, Default)]
pub struct RowSums {
    /// Measurements.
    pub count: Vec<f32>,
    /// Σ (D − R̂)².
    pub error: Vec<f32>,
    /// Σ D².
    pub data: Vec<f32>,
    /// Σ R̂².
    pub model_square: Vec<f32>,
    /// Σ R̂.
    pub model: Vec<f32>,
    /// Σ (D − R̂).
    pub bias: Vec<f32>,
}

impl RowSums {
    /// Zeros for `width` texels.
    pub fn reset(&mut self, width: usize) {
        for sums in
            [&mut self.count, &mut self.error, &mut self.data, &mut self.model_square, &mut self.model, &mut self.bias]
        {
            sums.clear();
            sums.resize(width, 0.0);
        }
    }
}

/// Adds ½·weight·residual to the lit texel's gradient and the weight to `weights`; `steps` becomes what goes to the
/// texels seen.
#[allow(clippy::too_many_arguments)]
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
pub fn gradient(
    data: &[f32],
    lit: &[f32],
    seen: &[f32],
    global: f32,
    variance: Variance,
    kind: Residual,
    to_lit: &mut [f32],
    steps: &mut [f32],
    weights: &mut [f32],
) {
    let logarithm = kind == Residual::Logarithm;
    let texels = data.iter().zip(lit).zip(seen);
    for (((((&data, &lit), &seen), to_lit), step), weight) in texels.zip(to_lit).zip(steps).zip(weights) {
        let r = global * lit * seen;
        let there = data.abs() <= f32::MAX;
        let data = if there { data } else { r };
        // weight · residual = R̂²/V · (D − R̂)/R̂; the approximant divides by (ρ + 1)/2.
        let damp = if logarithm { 2.0 * r / (data.max(0.0) + r + f32::MIN_POSITIVE) } else { 1.0 };
        let share = r / variance.of(r);
        *step = 0.5 * share * (data - r) * damp;
        *to_lit += *step;
        *weight += if there { share * r } else { 0.0 };
    }
}

/// Adds what a stretch of measurements differs by to `sums`, from texel `at` on.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
pub fn differences(data: &[f32], lit: &[f32], seen: &[f32], global: f32, at: usize, sums: &mut RowSums) {
    let end = at + data.len();
    let texels = data.iter().zip(lit).zip(seen);
    let squares = sums.error[at..end].iter_mut().zip(&mut sums.data[at..end]).zip(&mut sums.model_square[at..end]);
    let plain = sums.count[at..end].iter_mut().zip(&mut sums.model[at..end]).zip(&mut sums.bias[at..end]);
    for ((((&data, &lit), &seen), ((error, square), model_square)), ((count, model), bias)) in
        texels.zip(squares).zip(plain)
    {
        let r = global * lit * seen;
        let there = data.abs() <= f32::MAX && r > 0.0;
        let (data, r, one) = if there { (data, r, 1.0) } else { (0.0, 0.0, 0.0) };
        *count += one;
        *error += (data - r) * (data - r);
        *square += data * data;
        *model_square += r * r;
        *model += r;
        *bias += data - r;
    }
}

/// The coupling of a stretch of texels with those that one window pixel sees: ¼·weight·availability·(pᵢ + pₒ) added to
/// `out`, where pₒ lies between two rings' rows.
#[allow(clippy::too_many_arguments)]
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
pub fn couple(
    lit: &[f32],
    seen: &[f32],
    global: f32,
    variance: Variance,
    availability: [&[f32]; 2],
    p: &[f32],
    rows: [&[f32]; 2],
    share: f32,
    out: &mut [f32],
) {
    let texels = lit.iter().zip(seen).zip(availability[0]).zip(availability[1]).zip(p).zip(rows[0]).zip(rows[1]);
    for (((((((&lit, &seen), &a), &b), &p), &low), &high), out) in texels.zip(out) {
        let r = global * lit * seen;
        *out += 0.25 * r * r / variance.of(r) * (a + b) * (p + low + share * (high - low));
    }
}
