//! A slab of one resin: reflection and transmission as matrices over directions, by doubling.
//!
//! S = L⁺ + L⁻ and D = L⁺ − L⁻ obey S′ = −(A + B) D and D′ = −(A − B) S. Of light that enters both faces alike, the
//! upper one sees D = Y S,
//!
//! ```text
//! Y = ½h (A − B) φ(Q),   Q = (½h)² (A + B)(A − B),   φ(q) = tanh √q / √q,
//! ```
//!
//! and of light that enters them with opposite signs S = Z D with Z = ½h φ(Q) (A + B). Then R + T = (I − Y)(I + Y)⁻¹
//! and R − T = (Z − I)(Z + I)⁻¹. A layer that absorbs nothing has no net flux in A − B, and R + T = 1 to rounding
//! whatever the directions. As tanh 2x = 2 tanh x / (1 + tanh² x), twice the thickness has Y ← 2Y (I + ZY)⁻¹ and Z ← 2
//! (I + ZY)⁻¹ Z: one product, one factorisation and two solves. T is a difference: it is good to 10⁻¹³ of the light
//! that enters, not of itself.

use faer::{
    Mat, Scale,
    linalg::solvers::{PartialPivLu, Solve},
};

use super::scattering::Generator;

/// Flux that comes back and flux that goes through, to (row) from (column).
#[derive(Debug, Clone)]
pub(super) struct Slab {
    pub(super) reflection: Mat<f64>,
    pub(super) transmission: Mat<f64>,
}

/// The slab's Y and Z.
struct Halves {
    y: Mat<f64>,
    z: Mat<f64>,
}

/// Largest norm of Q for which φ is its Padé approximant [2/2]. There the thickness that the steepest direction sees is
/// off by a share of 5e-11, that of the others by much less.
const PADE_NORM: f64 = 0.5;
/// A half-space is a slab through which less than this comes …
const OPAQUE: f64 = 1e-12;
/// … or, of a resin that hardly absorbs, one that has been doubled this often from a mean free path or a mm.
const MAX_HALF_SPACE_DOUBLINGS: usize = 30;

impl Slab {
    /// A slab `thickness_mm` ≥ 0 thick.
    pub(super) fn new(generator: &Generator, thickness_mm: f64) -> Self {
        Halves::new(generator, thickness_mm).slab()
    }

    /// Reflection of a slab so thick that nothing comes through.
    pub(super) fn half_space(generator: &Generator, extinction: f64) -> Mat<f64> {
        let mut halves = Halves::new(generator, 1.0 / extinction.max(1.0));
        let mut slab = halves.slab();
        for _ in 0..MAX_HALF_SPACE_DOUBLINGS {
            if slab.transmission.norm_max() < OPAQUE {
                break;
            }
            halves.double();
            slab = halves.slab();
        }
        slab.reflection
    }
}

impl Halves {
    fn new(Generator { minus, plus }: &Generator, thickness_mm: f64) -> Self {
        let product = plus * minus;
        let norm = (0..product.ncols()).map(|j| product.col(j).norm_l1()).fold(0.0, f64::max);
        let mut half = thickness_mm / 2.0;
        let mut doublings = 0;
        while half * half * norm > PADE_NORM {
            half /= 2.0;
            doublings += 1;
        }
        let q = Scale(half * half) * product;
        let squared = &q * &q;
        // tanh x / x ≈ (945 + 105 x² + x⁴) / (945 + 420 x² + 15 x⁴)
        let n = q.nrows();
        let polynomial = |linear: f64, square: f64| {
            plus_identity(Mat::from_fn(n, n, |i, j| linear * q[(i, j)] + square * squared[(i, j)]), 945.0)
        };
        let phi = factorise(&polynomial(420.0, 15.0)).solve(polynomial(105.0, 1.0));
        let mut it = Self { y: Scale(half) * (minus * &phi), z: Scale(half) * (&phi * plus) };
        (0..doublings).for_each(|_| it.double());
        it
    }

    fn double(&mut self) {
        let system = factorise(&plus_identity(&self.z * &self.y, 1.0));
        system.rsolve_in_place(&mut self.y);
        system.solve_in_place(&mut self.z);
        self.y *= Scale(2.0);
        self.z *= Scale(2.0);
    }

    fn slab(&self) -> Slab {
        let mut sum = plus_identity(Scale(-1.0) * &self.y, 1.0);
        factorise(&plus_identity(self.y.clone(), 1.0)).rsolve_in_place(&mut sum);
        let mut difference = plus_identity(self.z.clone(), -1.0);
        factorise(&plus_identity(self.z.clone(), 1.0)).rsolve_in_place(&mut difference);
        Slab { reflection: Scale(0.5) * (&sum + &difference), transmission: Scale(0.5) * (&sum - &difference) }
    }
}

pub(super) fn factorise(matrix: &Mat<f64>) -> PartialPivLu<f64> {
    matrix.partial_piv_lu()
}

pub(super) fn plus_identity(mut matrix: Mat<f64>, scale: f64) -> Mat<f64> {
    for i in 0..matrix.nrows() {
        matrix[(i, i)] += scale;
    }
    matrix
}
