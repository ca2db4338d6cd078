//! A resin's own modes at one spatial frequency, and boundaries between them.
//!
//! With S = L⁺ + L⁻ and D = L⁺ − L⁻ (see [`super::slab`]), S″ = Q S has the modes Q = V Λ² V⁻¹, and
//!
//! ```text
//! S = U (a + b),   D = W (a − b),   U = V,   W = (A − B) V Λ⁻¹,   a(z) = e^{−Λz} a(0),   b(z) = e^{Λz} b(0):
//! ```
//!
//! a falls on its way down, b on its way up: L⁺ = E a + H b and L⁻ = H a + E b with E = ½(U + W), H = ½(U − W). Below a
//! depth b = ρ a. In air the modes are the directions (U = W = I). A boundary gives the amplitudes below it and ρ above
//! it as
//!
//! ```text
//! a′ = (N₁ + N₂ρ′)⁻¹ M a,     ρ = C + (P + Qρ′)(N₁ + N₂ρ′)⁻¹ M,
//! ```
//!
//! where, with one refractive index on both sides, X = U⁻¹U′, Z = W⁻¹W′, N₁ = Q = ½(X + Z), N₂ = P = ½(X − Z), M = I
//! and C = 0, and else, with reflectances F, transmittances T = I − F (diagonal) and K = (E − F H)⁻¹,
//!
//! ```text
//! C = −K (H − F E),   M = T (E + H C),   P = K T H′,   Q = K T E′,   N₁ = E′ − F H′ − T H P,   N₂ = H′ − F E′ − T H Q.
//! ```
//!
//! Eigenvalues of Q are real or come in conjugate pairs; a pair is kept as a 2 × 2 block, so that everything is real.
//! Where two modes nearly coincide V is ill-conditioned: the results agree with doubling to 1e-8 on random stacks.

use faer::{Col, Mat, Row, Scale, c64, linalg::solvers::Solve};

use super::{scattering::Generator, slab::factorise};
use crate::numeric::complex::{norm, sqrt};

/// Λ: a real rate per mode, or a pair a ± ib as [[a, b], [−b, a]].
#[derive(Debug, Clone)]
pub(super) struct Rates {
    real: Vec<f64>,
    /// 0 for a real mode; b for the first mode of a pair, −b for the second.
    imaginary: Vec<f64>,
    /// The other mode of a pair; a real mode itself.
    other: Vec<usize>,
}

/// U and W and their inverses.
pub(super) struct Modes {
    u: Mat<f64>,
    w: Mat<f64>,
    u_inverse: Mat<f64>,
    w_inverse: Mat<f64>,
    pub(super) rates: Rates,
}

/// A boundary, by the names above; with one refractive index on both sides Q = N₁, P = N₂.
#[derive(Debug)]
pub(super) struct Interface {
    n1: Mat<f64>,
    n2: Mat<f64>,
    mirror: Option<Box<Mirror>>,
}

/// What only a boundary between different refractive indices has.
#[derive(Debug)]
struct Mirror {
    p: Mat<f64>,
    q: Mat<f64>,
    c: Mat<f64>,
    m: Mat<f64>,
}

impl Interface {
    pub(super) fn new(above: &Modes, below: &Modes, reflectances: Option<&[f64]>) -> Self {
        let Some(f) = reflectances else {
            let (x, z) = (&above.u_inverse * &below.u, &above.w_inverse * &below.w);
            return Self { n1: half(&x + &z), n2: half(x - z), mirror: None };
        };
        let f = Col::from_fn(above.u.nrows(), |i| f[i]);
        let (f, t) = (f.as_diagonal(), Col::from_fn(f.nrows(), |i| 1.0 - f[i]));
        let t = t.as_diagonal();
        let ((e, h), (e_below, h_below)) = (above.directions(), below.directions());
        let k = factorise(&(&e - f * &h));
        let c = k.solve(f * &e - &h);
        let m = t * (&e + &h * &c);
        let (p, q) = (k.solve(t * &h_below), k.solve(t * &e_below));
        let n1 = &e_below - f * &h_below - t * (&h * &p);
        let n2 = &h_below - f * &e_below - t * (&h * &q);
        Self { n1, n2, mirror: Some(Box::new(Mirror { p, q, c, m })) }
    }

    fn p(&self) -> &Mat<f64> {
        self.mirror.as_ref().map_or(&self.n2, |mirror| &mirror.p)
    }

    fn q(&self) -> &Mat<f64> {
        self.mirror.as_ref().map_or(&self.n1, |mirror| &mirror.q)
    }

    /// N₁ + N₂ρ.
    pub(super) fn down(&self, rho: Option<&Mat<f64>>) -> Mat<f64> {
        rho.map_or_else(|| self.n1.clone(), |rho| &self.n1 + &self.n2 * rho)
    }

    /// P + Qρ.
    pub(super) fn up(&self, rho: Option<&Mat<f64>>) -> Mat<f64> {
        rho.map_or_else(|| self.p().clone(), |rho| self.p() + self.q() * rho)
    }

    /// ρ above, from (P + Qρ)(N₁ + N₂ρ)⁻¹.
    pub(super) fn above(&self, up: &Mat<f64>) -> Mat<f64> {
        self.mirror.as_ref().map_or_else(|| up.clone(), |mirror| &mirror.c + up * &mirror.m)
    }

    /// M a.
    pub(super) fn enter(&self, column: Col<f64>) -> Col<f64> {
        match &self.mirror {
            None => column,
            Some(mirror) => &mirror.m * column,
        }
    }

    /// Row × M.
    pub(super) fn enter_row(&self, row: &Row<f64>) -> Row<f64> {
        self.mirror.as_ref().map_or_else(|| row.clone(), |mirror| row * &mirror.m)
    }

    /// Row × P and row × Q.
    pub(super) fn leaving(&self, row: &Row<f64>) -> (Row<f64>, Row<f64>) {
        (row * self.p(), row * self.q())
    }

    /// Row × N₂.
    pub(super) fn change_below(&self, row: &Row<f64>) -> Row<f64> {
        row * &self.n2
    }

    /// Row × (Q − (P + Qρ)(N₁ + N₂ρ)⁻¹ N₂): how ρ above changes with ρ below, but for a factor on the right.
    pub(super) fn change(&self, row: &Row<f64>, up: &Mat<f64>) -> Row<f64> {
        row * self.q() - (row * up) * &self.n2
    }
}

/// Square of the least rate, over the greatest's: a rate that changes nothing over any layer.
const LEAST_SQUARE: f64 = 1e-14;

impl Modes {
    pub(super) fn new(Generator { minus, plus }: &Generator, n: usize) -> Self {
        let (minus, plus) = (minus.submatrix(0, 0, n, n), plus.submatrix(0, 0, n, n));
        let product = plus * minus;
        let eigen = product.eigen().expect("a finite matrix has eigenvalues");
        let (vectors, values) = (eigen.U(), eigen.S().column_vector());
        let mut u = Mat::zeros(n, n);
        let mut rates = Rates::zeros(n);
        // What neither scatters nor absorbs has modes without a rate, which rounding may put below 0.
        let least = LEAST_SQUARE * (0..n).map(|j| norm(values[j])).fold(f64::MIN_POSITIVE, f64::max);
        let mut j = 0;
        while j < n {
            let rate = sqrt(values[j]);
            rates.real[j] = rate.re;
            if values[j].im == 0.0 || j + 1 == n {
                rates.real[j] = values[j].re.max(least).sqrt();
                u.col_mut(j).copy_from(Col::from_fn(n, |i| vectors[(i, j)].re));
                j += 1;
                continue;
            }
            // V (x ± iy) = V λ: [x y] Λ with Λ = [[a, b], [−b, a]].
            u.col_mut(j).copy_from(Col::from_fn(n, |i| vectors[(i, j)].re));
            u.col_mut(j + 1).copy_from(Col::from_fn(n, |i| vectors[(i, j)].im));
            rates.real[j + 1] = rate.re;
            rates.other.swap(j, j + 1);
            (rates.imaginary[j], rates.imaginary[j + 1]) = (rate.im, -rate.im);
            j += 2;
        }
        let u_inverse = factorise(&u).solve(Mat::<f64>::identity(n, n));
        let inverse = rates.inverse();
        let w = inverse.right_of(&(minus * &u));
        let w_inverse = inverse.left_of(&(&u_inverse * plus));
        Self { u, w, u_inverse, w_inverse, rates }
    }

    /// Directions as modes.
    pub(super) fn air(n: usize) -> Self {
        let identity = || Mat::identity(n, n);
        let rates = Rates::zeros(n);
        Self { u: identity(), w: identity(), u_inverse: identity(), w_inverse: identity(), rates }
    }

    /// Sensitivities to A − B and A + B, from those to X = U⁻¹ δ(A + B) W and Y = W⁻¹ δ(A − B) U.
    pub(super) fn of_equations(&self, x: &Mat<f64>, y: &Mat<f64>) -> Generator {
        Generator {
            minus: self.w_inverse.transpose() * y * self.u.transpose(),
            plus: self.u_inverse.transpose() * x * self.w.transpose(),
        }
    }

    /// E and H.
    fn directions(&self) -> (Mat<f64>, Mat<f64>) {
        (half(&self.u + &self.w), half(&self.u - &self.w))
    }
}

impl Rates {
    fn zeros(n: usize) -> Self {
        Self { real: vec![0.0; n], imaginary: vec![0.0; n], other: (0..n).collect() }
    }

    fn map(&self, of: impl Fn(f64, f64) -> (f64, f64)) -> Self {
        let (real, imaginary) = self.real.iter().zip(&self.imaginary).map(|(&re, &im)| of(re, im)).unzip();
        Self { real, imaginary, other: self.other.clone() }
    }

    /// e^{−Λh}.
    pub(super) fn decay(&self, mm: f64) -> Self {
        self.map(|re, im| {
            let (sin, cos) = libm::sincos(im * mm);
            let size = libm::exp(-re * mm);
            (size * cos, -size * sin)
        })
    }

    fn inverse(&self) -> Self {
        self.map(|re, im| {
            let square = re * re + im * im;
            (re / square, -im / square)
        })
    }

    /// Λ M.
    pub(super) fn left_of(&self, matrix: &Mat<f64>) -> Mat<f64> {
        let n = matrix.nrows();
        Mat::from_fn(n, matrix.ncols(), |i, j| {
            self.real[i] * matrix[(i, j)] + self.imaginary[i] * matrix[(self.other[i], j)]
        })
    }

    /// M Λ.
    pub(super) fn right_of(&self, matrix: &Mat<f64>) -> Mat<f64> {
        let n = matrix.ncols();
        Mat::from_fn(matrix.nrows(), n, |i, j| {
            self.real[j] * matrix[(i, j)] + self.imaginary[self.other[j]] * matrix[(i, self.other[j])]
        })
    }

    pub(super) fn row(&self, row: &Row<f64>) -> Row<f64> {
        Row::from_fn(row.ncols(), |j| {
            let other = self.other[j];
            self.real[j] * row[j] + self.imaginary[other] * row[other]
        })
    }

    pub(super) fn column(&self, column: &Col<f64>) -> Col<f64> {
        Col::from_fn(column.nrows(), |i| self.real[i] * column[i] + self.imaginary[i] * column[self.other[i]])
    }
}

/// Modes of which every one is an exponential: of a pair x, y those of x − iy and x + iy.
impl Rates {
    /// Whether a mode is the first of a pair.
    fn begins_pair(&self, mode: usize) -> bool {
        self.other[mode] == mode + 1
    }

    pub(super) fn complex(&self) -> Vec<c64> {
        self.real.iter().zip(&self.imaginary).map(|(&re, &im)| c64::new(re, im)).collect()
    }

    pub(super) fn complex_row(&self, row: &Row<f64>) -> Vec<c64> {
        let of = |j: usize| match self.other[j] {
            other if other == j => c64::new(row[j], 0.0),
            other if other > j => 0.5 * c64::new(row[j], row[other]),
            other => 0.5 * c64::new(row[other], -row[j]),
        };
        (0..row.ncols()).map(of).collect()
    }

    pub(super) fn complex_column(&self, column: &Col<f64>) -> Vec<c64> {
        let of = |j: usize| match self.other[j] {
            other if other == j => c64::new(column[j], 0.0),
            other if other > j => c64::new(column[j], -column[other]),
            other => c64::new(column[other], column[j]),
        };
        (0..column.nrows()).map(of).collect()
    }

    /// Factors of a matrix's elements in these modes as factors of them in the real ones: the sum of the products is
    /// the same.
    pub(super) fn to_real(&self, mut matrix: Mat<c64>) -> Mat<f64> {
        let (n, i) = (matrix.nrows(), c64::new(0.0, 1.0));
        for pair in (0..n).filter(|&mode| self.begins_pair(mode)) {
            for other in 0..n {
                let (w, conjugate) = (matrix[(pair, other)], matrix[(pair + 1, other)]);
                (matrix[(pair, other)], matrix[(pair + 1, other)]) = (w + conjugate, i * (conjugate - w));
            }
        }
        for pair in (0..n).filter(|&mode| self.begins_pair(mode)) {
            for other in 0..n {
                let (w, conjugate) = (matrix[(other, pair)], matrix[(other, pair + 1)]);
                (matrix[(other, pair)], matrix[(other, pair + 1)]) = (0.5 * (w + conjugate), 0.5 * i * (w - conjugate));
            }
        }
        Mat::from_fn(n, n, |p, q| matrix[(p, q)].re)
    }
}

fn half(matrix: Mat<f64>) -> Mat<f64> {
    Scale(0.5) * matrix
}
