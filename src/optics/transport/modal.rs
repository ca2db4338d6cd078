//! Reflection of many stacks of the same resins, with its derivatives: the transport equation in each resin's own modes.
//!
//! [`super::slab`] doubles every slab anew. A search asks for thousands of stacks of few resins, so here what depends on the resins alone is
//! reckoned once. With S = L⁺ + L⁻ and D = L⁺ − L⁻ (see there), S″ = Q S has the modes Q = V Λ² V⁻¹, and
//!
//! ```text
//! S = U (a + b),   D = W (a − b),   U = V,   W = (A − B) V Λ⁻¹,   a(z) = e^{−Λz} a(0),   b(z) = e^{Λz} b(0):
//! ```
//!
//! a falls on its way down, b on its way up. Below a depth b = ρ a. Through a layer h thick ρ ← e^{−Λh} ρ e^{−Λh}; from a resin m into
//! resin n above it, with X = U_n⁻¹ U_m, Z = W_n⁻¹ W_m, G = ½(X + Z) and F = ½(X − Z), ρ ← (F + G ρ)(G + F ρ)⁻¹. A half-space has ρ = 0, and
//! so has nothing at all, whose modes are the directions (U = W = I). Only falling exponentials occur, and ∂ρ/∂h = −(Λρ + ρΛ).
//!
//! Eigenvalues of Q are real or come in conjugate pairs; a pair is kept as a 2 × 2 block, so that everything is real. Where two modes
//! nearly coincide V is ill-conditioned: the results agree with doubling to 1e-8 on random stacks, which is ample for a search.

use faer::{
    Col, Mat, Row,
    linalg::solvers::{PartialPivLu, Solve},
};
use rayon::prelude::*;

use super::{
    TransportOptions,
    directions::Directions,
    scattering::{Generator, Scattering},
    slab::factorise,
};
use crate::optics::VolumeCoefficients;

/// Least absorption per mm: without any, one mode neither grows nor falls, and U and W are singular. Changes an albedo by 1e-5 at most
/// in stacks of 10 mm of white.
const LEAST_ABSORPTION: f64 = 1e-8;

/// The reflection of any stack of some resins, in one channel, under diffuse light.
#[derive(Debug)]
pub struct ModalReflection {
    frequencies: Vec<Frequency>,
}

/// R̂ of a stack and how it changes with the layers' thicknesses.
#[derive(Debug, Clone, PartialEq)]
pub struct ReflectionSlope {
    /// R̂ per frequency.
    pub reflection: Vec<f64>,
    /// ∂R̂/∂h per mm: layer, frequency.
    pub per_mm: Vec<Vec<f64>>,
}

/// All that is known at one spatial frequency.
#[derive(Debug)]
struct Frequency {
    /// One per resin.
    rates: Vec<Rates>,
    /// From (below) into (above), index above · media + below; air is the last medium.
    interfaces: Vec<Interface>,
    /// Medium of the base.
    base: usize,
    media: usize,
    source: Col<f64>,
    flux: Row<f64>,
}

#[derive(Debug)]
struct Interface {
    g: Mat<f64>,
    f: Mat<f64>,
}

/// Λ: a real rate per mode, or a pair a ± ib as [[a, b], [−b, a]].
#[derive(Debug, Clone)]
struct Rates {
    real: Vec<f64>,
    /// 0 for a real mode; b for the first mode of a pair, −b for the second.
    imaginary: Vec<f64>,
    /// The other mode of a pair; a real mode itself.
    other: Vec<usize>,
}

/// U and W and their inverses.
struct Modes {
    u: Mat<f64>,
    w: Mat<f64>,
    u_inverse: Mat<f64>,
    w_inverse: Mat<f64>,
    rates: Rates,
}

impl ModalReflection {
    /// `resins` over a half-space of the resin `base` (an index), or over nothing, at spatial frequencies `k` in rad/mm.
    pub fn new(resins: &[VolumeCoefficients], base: Option<usize>, k: &[f64], options: TransportOptions) -> Self {
        let directions = Directions::new(options.polar, options.orders);
        let scattering: Vec<_> = resins
            .iter()
            .map(|resin| {
                let absorbing = VolumeCoefficients { sigma_a: resin.sigma_a.max(LEAST_ABSORPTION), ..*resin };
                Scattering::new(&absorbing, &directions)
            })
            .collect();
        let frequencies = k.par_iter().map(|&k| Frequency::new(&scattering, base, &directions, k)).collect();
        Self { frequencies }
    }

    /// R̂ of `layers`, (resin, mm ≥ 0) from the observer down, at each frequency.
    pub fn reflection(&self, layers: &[(usize, f64)]) -> Vec<f64> {
        self.frequencies.iter().map(|frequency| frequency.descend(layers).reflection()).collect()
    }

    /// The same with ∂R̂/∂h.
    pub fn slope(&self, layers: &[(usize, f64)]) -> ReflectionSlope {
        let mut slope = ReflectionSlope {
            reflection: Vec::with_capacity(self.frequencies.len()),
            per_mm: vec![Vec::with_capacity(self.frequencies.len()); layers.len()],
        };
        for frequency in &self.frequencies {
            let (reflection, per_mm) = frequency.descend(layers).slope();
            slope.reflection.push(reflection);
            slope.per_mm.iter_mut().zip(per_mm).for_each(|(values, value)| values.push(value));
        }
        slope
    }
}

impl Frequency {
    fn new(resins: &[Scattering], base: Option<usize>, directions: &Directions, k: f64) -> Self {
        // The beam, the last unknown, has no part in diffuse light.
        let n = directions.beam();
        let modes: Vec<_> =
            resins.iter().map(|resin| Modes::new(&resin.generator(k), n)).chain([Modes::air(n)]).collect();
        let interface = |above: &Modes, below: &Modes| {
            let (x, z) = (&above.u_inverse * &below.u, &above.w_inverse * &below.w);
            Interface { g: half(&x + &z), f: half(&x - &z) }
        };
        let pairs = modes.iter().flat_map(|above| modes.iter().map(move |below| interface(above, below)));
        let diffuse: Vec<_> = directions.diffuse().collect();
        let order: Vec<_> = directions.unknowns().map(|unknown| unknown.order).collect();
        Self {
            interfaces: pairs.collect(),
            base: base.unwrap_or(resins.len()),
            media: modes.len(),
            source: Col::from_fn(n, |i| diffuse[i]),
            flux: Row::from_fn(n, |i| if order[i] == 0 { 1.0 } else { 0.0 }),
            rates: modes.into_iter().map(|modes| modes.rates).collect(),
        }
    }

    fn interface(&self, above: usize, below: usize) -> &Interface {
        &self.interfaces[above * self.media + below]
    }

    /// Builds the stack from the base up.
    fn descend(&self, layers: &[(usize, f64)]) -> Stack<'_> {
        let mut steps = Vec::with_capacity(layers.len());
        // ρ at the top of the medium below, and that medium.
        let (mut rho, mut below) = (None::<Mat<f64>>, self.base);
        for &(resin, mm) in layers.iter().rev() {
            let enter = Step::new(self.interface(resin, below), rho.as_ref());
            let decay = self.rates[resin].decay(mm);
            let reflected = decay.right_of(&decay.left_of(&enter.rho));
            steps.push(Step { layer: Some((resin, decay, reflected.clone())), ..enter });
            (rho, below) = (Some(reflected), resin);
        }
        let top = Step::new(self.interface(self.media - 1, below), rho.as_ref());
        steps.push(top);
        steps.reverse();
        Stack { frequency: self, steps }
    }
}

/// A stack at one frequency, as a chain of interfaces from air down to the base.
struct Stack<'a> {
    frequency: &'a Frequency,
    steps: Vec<Step<'a>>,
}

/// An interface and the layer above it.
struct Step<'a> {
    interface: &'a Interface,
    /// Factors of G + F ρ with the ρ below.
    down: PartialPivLu<f64>,
    /// ρ just above the interface.
    rho: Mat<f64>,
    /// The layer above: its resin, e^{−Λh}, and ρ at its top; none in air.
    layer: Option<(usize, Rates, Mat<f64>)>,
}

impl<'a> Step<'a> {
    fn new(interface: &'a Interface, below: Option<&Mat<f64>>) -> Self {
        let Interface { g, f } = interface;
        let (up, down) = match below {
            Some(rho) => (f + g * rho, g + f * rho),
            None => (f.clone(), g.clone()),
        };
        let down = factorise(&down);
        let mut rho = up;
        down.rsolve_in_place(&mut rho);
        Self { interface, down, rho, layer: None }
    }
}

impl Stack<'_> {
    fn reflection(&self) -> f64 {
        &self.frequency.flux * (&self.steps[0].rho * &self.frequency.source)
    }

    /// R̂ and ∂R̂/∂h of every layer: dρ above an interface is (G − ρ F) dρ′ (G + F ρ′)⁻¹ of that below it.
    fn slope(&self) -> (f64, Vec<f64>) {
        let mut row = self.frequency.flux.clone();
        let mut column = self.frequency.source.clone();
        let mut slopes = Vec::with_capacity(self.steps.len() - 1);
        for pair in self.steps.windows(2) {
            let [upper, lower] = pair else { break };
            let Interface { g, f } = upper.interface;
            row = &row * g - (&row * &upper.rho) * f;
            upper.down.solve_in_place(&mut column);
            if let Some((resin, decay, rho)) = &lower.layer {
                let rates = &self.frequency.rates[*resin];
                let through = rho * &column;
                let slope = &rates.row(&row) * &through + (&row * rho) * &rates.column(&column);
                slopes.push(-slope);
                row = decay.row(&row);
                column = decay.column(&column);
            }
        }
        (self.reflection(), slopes)
    }
}

impl Modes {
    fn new(Generator { minus, plus }: &Generator, n: usize) -> Self {
        let (minus, plus) = (minus.submatrix(0, 0, n, n), plus.submatrix(0, 0, n, n));
        let product = plus * minus;
        let eigen = product.eigen().expect("a finite matrix has eigenvalues");
        let (vectors, values) = (eigen.U(), eigen.S().column_vector());
        let mut u = Mat::zeros(n, n);
        let mut rates = Rates::zeros(n);
        let mut j = 0;
        while j < n {
            let rate = values[j].sqrt();
            rates.real[j] = rate.re;
            if values[j].im == 0.0 || j + 1 == n {
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
    fn air(n: usize) -> Self {
        let identity = || Mat::identity(n, n);
        let rates = Rates::zeros(n);
        Self { u: identity(), w: identity(), u_inverse: identity(), w_inverse: identity(), rates }
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
    fn decay(&self, mm: f64) -> Self {
        self.map(|re, im| {
            let (sin, cos) = (im * mm).sin_cos();
            let size = (-re * mm).exp();
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
    fn left_of(&self, matrix: &Mat<f64>) -> Mat<f64> {
        let n = matrix.nrows();
        Mat::from_fn(n, matrix.ncols(), |i, j| {
            self.real[i] * matrix[(i, j)] + self.imaginary[i] * matrix[(self.other[i], j)]
        })
    }

    /// M Λ.
    fn right_of(&self, matrix: &Mat<f64>) -> Mat<f64> {
        let n = matrix.ncols();
        Mat::from_fn(matrix.nrows(), n, |i, j| {
            self.real[j] * matrix[(i, j)] + self.imaginary[self.other[j]] * matrix[(i, self.other[j])]
        })
    }

    fn row(&self, row: &Row<f64>) -> Row<f64> {
        Row::from_fn(row.ncols(), |j| {
            let other = self.other[j];
            self.real[j] * row[j] + self.imaginary[other] * row[other]
        })
    }

    fn column(&self, column: &Col<f64>) -> Col<f64> {
        Col::from_fn(column.nrows(), |i| self.real[i] * column[i] + self.imaginary[i] * column[self.other[i]])
    }
}

fn half(matrix: Mat<f64>) -> Mat<f64> {
    faer::Scale(0.5) * matrix
}
