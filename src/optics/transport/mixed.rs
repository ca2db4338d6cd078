//! Stacks of one order of layers, some of them of media that are not known beforehand, with derivatives in thicknesses
//! and coefficients: what a fit of mixtures asks for.
//!
//! [`super::modal`] knows every resin; here the modes of a mixture are computed anew whenever it changes, once per
//! frequency, and nothing else is. Perturbation theory gives the slopes in its coefficients for a few products more:
//! with S′ = −(A + B) D and D′ = −(A − B) S (see [`super::slab`]) and changes δP of A + B and δM of A − B within a
//! layer h thick, in the layer's own modes ([`super::modes`])
//!
//! ```text
//! δR̂ = −½ ∫₀ʰ (r + s) Y (a + b) − (r − s) X (a − b) dz,   X = U⁻¹ δP W,   Y = W⁻¹ δM U,
//! ```
//!
//! where a falls and b = ρa rises as e^{∓Λz}, r is the row with which changes of ρ at depth z make R̂'s, and s = rρ.
//! All four are exponentials, so the integral is a sum over pairs of modes.
//!
//! Below the layers lies nothing, a half-space, or a mirror: a slab that is symmetric about a plane and lit alike from
//! both sides has no net flux through it, as if one lay there, and R̂ over the mirror is R̂ + T̂ of the slab.

use std::ops::Deref;

use faer::{Mat, c64, linalg::solvers::Solve};

use super::{
    TransportOptions,
    directions::AIR,
    modal::{Boundary, Setting, Top},
    modes::{Interface, Modes, Rates},
    scattering::{Generator, Scattering},
    slab::factorise,
};
use crate::{
    numeric::complex::{exp, norm},
    optics::{Light, VolumeCoefficients},
    parallel,
};

/// What lies below the layers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Base {
    /// Nothing: no light returns.
    Nothing,
    /// A half-space.
    HalfSpace(VolumeCoefficients),
    /// A perfect mirror: the stack's own mirror image, lit like the stack.
    Mirror,
}

/// The reflection, in one channel, of layers in one order under diffuse light, without the glint of their surface.
pub struct LayeredReflection {
    setting: Setting,
    layers: Vec<Place>,
    base: Bottom,
    frequencies: Vec<Known>,
}

/// Where the coefficients of a layer stand.
#[derive(Debug, Clone, Copy)]
enum Place {
    /// Among the media that are known.
    Known(usize),
    /// Among the mixtures.
    Mixed(usize),
}

enum Bottom {
    Nothing,
    HalfSpace(usize),
    Mirror,
}

/// What does not change at one frequency.
struct Known {
    k: f64,
    air: Modes,
    media: Vec<Modes>,
    /// Between a layer and the next, where both are known.
    interfaces: Vec<Option<Interface>>,
    /// Into the first layer, if it is known.
    top: Option<Top>,
    /// ρ at the bottom of the last layer, if it is known.
    bottom: Option<Mat<f64>>,
}

/// A mixture in its place, and changes of its coefficients that slopes are wanted along.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixed {
    /// The coefficients; the refractive index must be one of those given to [`LayeredReflection::new`].
    pub volume: VolumeCoefficients,
    /// Changes of σs and σa per mm, and of g.
    pub tangents: Vec<[f64; 3]>,
}

/// R̂ of a stack and how it changes.
#[derive(Debug, Clone, PartialEq)]
pub struct LayeredSlope {
    /// R̂ per frequency.
    pub reflection: Vec<f64>,
    /// ∂R̂/∂h per mm: layer, frequency.
    pub per_mm: Vec<Vec<f64>>,
    /// ∂R̂ along each tangent: mixture, tangent, frequency.
    pub along: Vec<Vec<Vec<f64>>>,
}

/// Step of the derivative of the equations' coefficients along a tangent, as a share of it.
const STEP: f64 = 1e-5;

/// What comes through a layer below this is not worth a quotient, whose divisor's square would be 0.
const DARK: f64 = 1e-100;

impl LayeredReflection {
    /// `layers` from the observer down, at least one, `None` for mixtures, over `base`, at spatial frequencies `k` in
    /// rad/mm; `mixed` are the refractive indices that mixtures may have.
    pub fn new(
        layers: &[Option<VolumeCoefficients>],
        mixed: &[f64],
        base: Base,
        k: &[f64],
        options: TransportOptions,
    ) -> Self {
        let mut media: Vec<VolumeCoefficients> = Vec::new();
        let mut place = |volume: &VolumeCoefficients| {
            media.iter().position(|known| known == volume).unwrap_or_else(|| {
                media.push(*volume);
                media.len() - 1
            })
        };
        let mut mixtures = 0..;
        let layers = layers.iter().map(|layer| match layer {
            Some(volume) => Place::Known(place(volume)),
            None => Place::Mixed(mixtures.next().unwrap_or(0)),
        });
        let layers: Vec<_> = layers.collect();
        let base = match &base {
            Base::Nothing => Bottom::Nothing,
            Base::HalfSpace(volume) => Bottom::HalfSpace(place(volume)),
            Base::Mirror => Bottom::Mirror,
        };
        let setting = Setting::with_indices(&media, mixed, Light::Diffuse, options);
        let frequencies = parallel::map_all(k, |&k| Known::new(&setting, &layers, &base, k));
        Self { setting, layers, base, frequencies }
    }

    /// R̂ at each frequency of layers `mm` ≥ 0 thick; `mixtures` in the order of their layers.
    pub fn reflection(&self, mm: &[f64], mixtures: &[VolumeCoefficients]) -> Vec<f64> {
        let mixtures: Vec<_> = mixtures.iter().map(|volume| self.setting.scattering_of(volume)).collect();
        let at = |known: &Known| self.stack(known, &known.modes(&mixtures, &self.setting)).reflection(mm);
        parallel::map_all(&self.frequencies, at)
    }

    /// R̂ with its slopes.
    pub fn slope(&self, mm: &[f64], mixtures: &[Mixed]) -> LayeredSlope {
        let scattering: Vec<_> = mixtures.iter().map(|mixed| self.setting.scattering_of(&mixed.volume)).collect();
        // Either side of each mixture, along each tangent.
        let sides = |mixed: &Mixed| -> Vec<[Scattering; 2]> {
            let side = |tangent, by| self.setting.scattering_of(&moved(&mixed.volume, tangent, by));
            mixed.tangents.iter().map(|tangent| [STEP, -STEP].map(|by| side(tangent, by))).collect()
        };
        let sides: Vec<_> = mixtures.iter().map(sides).collect();
        let at = |known: &Known| {
            let change = |sides: &[Scattering; 2]| change(sides, known.k, self.setting.len());
            let changes: Vec<Vec<_>> = sides.iter().map(|tangents| tangents.iter().map(change).collect()).collect();
            self.stack(known, &known.modes(&scattering, &self.setting)).slope(mm, &changes)
        };
        let found: Vec<(f64, Slopes)> = parallel::map_all(&self.frequencies, at);
        let of = |value: &dyn Fn(&Slopes) -> f64| found.iter().map(|at| value(&at.1)).collect();
        let along = |(mixture, mixed): (usize, &Mixed)| {
            (0..mixed.tangents.len()).map(|tangent| of(&|slopes| slopes.along[mixture][tangent])).collect()
        };
        LayeredSlope {
            per_mm: (0..mm.len()).map(|layer| of(&|slopes| slopes.per_mm[layer])).collect(),
            along: mixtures.iter().enumerate().map(along).collect(),
            reflection: found.into_iter().map(|at| at.0).collect(),
        }
    }

    fn stack<'a>(&'a self, known: &'a Known, mixed: &'a [(Modes, f64)]) -> Layered<'a> {
        Layered::new(&self.setting, known, &self.layers, &self.base, mixed)
    }
}

fn moved(volume: &VolumeCoefficients, [sigma_s, sigma_a, g]: &[f64; 3], by: f64) -> VolumeCoefficients {
    VolumeCoefficients {
        sigma_s: volume.sigma_s + by * sigma_s,
        sigma_a: volume.sigma_a + by * sigma_a,
        g: volume.g + by * g,
        ..*volume
    }
}

/// How the equations change along a tangent.
fn change(sides: &[Scattering; 2], k: f64, n: usize) -> Generator {
    let [more, less] = [sides[0].generator(k), sides[1].generator(k)];
    let slope =
        |more: &Mat<f64>, less: &Mat<f64>| Mat::from_fn(n, n, |i, j| (more[(i, j)] - less[(i, j)]) / (2.0 * STEP));
    Generator { minus: slope(&more.minus, &less.minus), plus: slope(&more.plus, &less.plus) }
}

impl Known {
    fn new(setting: &Setting, layers: &[Place], base: &Bottom, k: f64) -> Self {
        let n = setting.len();
        let media: Vec<_> = setting.scattering.iter().map(|medium| Modes::new(&medium.generator(k), n)).collect();
        let air = Modes::air(n);
        let medium = |place: &Place| match place {
            Place::Known(medium) => Some((&media[*medium], setting.scattering[*medium].index)),
            Place::Mixed(_) => None,
        };
        let between = |pair: &[Place]| Some(setting.interface(medium(&pair[0])?, medium(&pair[1])?));
        let interfaces = layers.windows(2).map(between).collect();
        let top = layers.first().and_then(medium).map(|first| setting.top((&air, AIR), first));
        let bottom = layers.last().and_then(medium).map(|last| bottom(setting, &air, &media, base, last));
        Self { k, interfaces, top, bottom, air, media }
    }

    fn modes(&self, mixtures: &[Scattering], setting: &Setting) -> Vec<(Modes, f64)> {
        let modes = |mixture: &Scattering| Modes::new(&mixture.generator(self.k), setting.len());
        mixtures.iter().map(|mixture| (modes(mixture), mixture.index)).collect()
    }
}

/// ρ at the bottom of a layer that lies on the base.
fn bottom(setting: &Setting, air: &Modes, media: &[Modes], base: &Bottom, last: (&Modes, f64)) -> Mat<f64> {
    let below = match base {
        Bottom::Mirror => return Mat::identity(setting.len(), setting.len()),
        Bottom::Nothing => (air, AIR),
        Bottom::HalfSpace(medium) => (&media[*medium], setting.scattering[*medium].index),
    };
    let interface = setting.interface(last, below);
    let mut up = interface.up(None);
    factorise(&interface.down(None)).rsolve_in_place(&mut up);
    interface.above(&up)
}

/// What is known beforehand, or made for one stack.
enum Held<'a, T> {
    Known(&'a T),
    Made(T),
}

impl<T> Deref for Held<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        match self {
            Held::Known(it) => it,
            Held::Made(it) => it,
        }
    }
}

impl<'a, T> Held<'a, T> {
    fn or_made(known: Option<&'a T>, make: impl FnOnce() -> T) -> Self {
        known.map_or_else(|| Held::Made(make()), Held::Known)
    }
}

/// Layers of any thickness at one frequency.
struct Layered<'a> {
    layers: Vec<&'a Modes>,
    /// Which layer each mixture is.
    mixed: Vec<usize>,
    top: Held<'a, Top>,
    interfaces: Vec<Held<'a, Interface>>,
    bottom: Held<'a, Mat<f64>>,
}

/// A layer of a certain thickness.
struct Step<'a> {
    decay: Rates,
    /// ρ at its top and at its bottom.
    rho: Mat<f64>,
    rho_below: Held<'a, Mat<f64>>,
    below: Option<Boundary<'a>>,
}

/// Derivatives of R̂ at one frequency.
struct Slopes {
    per_mm: Vec<f64>,
    /// Mixture, tangent.
    along: Vec<Vec<f64>>,
}

impl<'a> Layered<'a> {
    fn new(setting: &'a Setting, known: &'a Known, places: &[Place], base: &Bottom, mixed: &'a [(Modes, f64)]) -> Self {
        let layers: Vec<(&Modes, f64)> = places
            .iter()
            .map(|place| match *place {
                Place::Known(medium) => (&known.media[medium], setting.scattering[medium].index),
                Place::Mixed(mixture) => (&mixed[mixture].0, mixed[mixture].1),
            })
            .collect();
        let interface = |(pair, known): (&[(&Modes, f64)], &'a Option<Interface>)| {
            Held::or_made(known.as_ref(), || setting.interface(pair[0], pair[1]))
        };
        let is_mixed = |(layer, place): (usize, &Place)| matches!(place, Place::Mixed(_)).then_some(layer);
        Self {
            mixed: places.iter().enumerate().filter_map(is_mixed).collect(),
            top: Held::or_made(known.top.as_ref(), || setting.top((&known.air, AIR), layers[0])),
            interfaces: layers.windows(2).zip(&known.interfaces).map(interface).collect(),
            bottom: Held::or_made(known.bottom.as_ref(), || {
                bottom(setting, &known.air, &known.media, base, layers[layers.len() - 1])
            }),
            layers: layers.into_iter().map(|(modes, _)| modes).collect(),
        }
    }

    fn reflection(&self, mm: &[f64]) -> f64 {
        self.steps(mm).first().map_or(0.0, |first| self.top.value(Some(&first.rho)).0)
    }

    /// Builds the stack from the base up; the steps are from the observer down.
    fn steps(&self, mm: &[f64]) -> Vec<Step<'_>> {
        let mut steps: Vec<Step> = Vec::with_capacity(mm.len());
        for (layer, &mm) in mm.iter().enumerate().rev() {
            let decay = self.layers[layer].rates.decay(mm);
            let (rho_below, below) = match steps.last() {
                None => (Held::Known(&*self.bottom), None),
                Some(lower) => {
                    let boundary = Boundary::new(&self.interfaces[layer], &lower.rho);
                    (Held::Made(self.interfaces[layer].above(&boundary.up)), Some(boundary))
                }
            };
            let rho = decay.right_of(&decay.left_of(&rho_below));
            steps.push(Step { decay, rho, rho_below, below });
        }
        steps.reverse();
        steps
    }

    /// R̂ and how it changes with the layers' thicknesses and with `changes` of the mixtures' equations.
    fn slope(&self, mm: &[f64], changes: &[Vec<Generator>]) -> (f64, Slopes) {
        let steps = self.steps(mm);
        let (reflection, mut column, mut row) = self.top.value(steps.first().map(|first| &first.rho));
        let mut slopes = Slopes { per_mm: Vec::with_capacity(mm.len()), along: Vec::with_capacity(changes.len()) };
        for (layer, Step { decay, rho, rho_below, below }) in steps.iter().enumerate() {
            let modes = self.layers[layer];
            slopes
                .per_mm
                .push(-(&modes.rates.row(&row) * (rho * &column) + (&row * rho) * &modes.rates.column(&column)));
            let (row_below, column_below) = (decay.row(&row), decay.column(&column));
            if let Some(mixture) = self.mixed.iter().position(|&mixed| mixed == layer) {
                let rates = &modes.rates;
                let field = Field {
                    r: rates.complex_row(&row),
                    s: rates.complex_row(&(&row_below * &**rho_below)),
                    a: rates.complex_column(&column),
                    b: rates.complex_column(&(&**rho_below * &column_below)),
                };
                let sensitivity = field.sensitivity(modes, mm[layer]);
                slopes.along.push(changes[mixture].iter().map(|change| product(&sensitivity, change)).collect());
            }
            (row, column) = (row_below, column_below);
            if let Some(boundary) = below {
                row = boundary.interface.change(&row, &boundary.up);
                column = boundary.through(column);
            }
        }
        (reflection, slopes)
    }
}

/// The light in a layer, in its modes: a falls from the top, b rises from the bottom, and so do the rows r and s that
/// changes of them make R̂'s with.
struct Field {
    /// At the top.
    r: Vec<c64>,
    a: Vec<c64>,
    /// At the bottom.
    s: Vec<c64>,
    b: Vec<c64>,
}

impl Field {
    /// What each element of A − B and of A + B changes R̂ by, in a layer `mm` thick.
    fn sensitivity(&self, modes: &Modes, mm: f64) -> Generator {
        let Self { r, s, a, b } = self;
        let rates = modes.rates.complex();
        let decay: Vec<c64> = rates.iter().map(|rate| exp(-*rate * mm)).collect();
        let n = rates.len();
        // Light that goes the same way as the row, and the other way.
        let (mut alike, mut against) = (Mat::<c64>::zeros(n, n), Mat::<c64>::zeros(n, n));
        for q in 0..n {
            for p in 0..n {
                let (sum, difference) = ((rates[p] + rates[q]) * mm, (rates[p] - rates[q]) * mm);
                let falling = mm * mean_decay(sum, decay[p] * decay[q]);
                // e^{−λ_p z} e^{−λ_q (h − z)}, from the end where it is larger.
                let (larger, less, by) = match difference.re >= 0.0 {
                    true => (decay[q], decay[p], difference),
                    false => (decay[p], decay[q], -difference),
                };
                let crossing = match norm(larger) > DARK {
                    true => mm * larger * mean_decay(by, less / larger),
                    false => c64::new(0.0, 0.0),
                };
                alike[(p, q)] = (r[p] * a[q] + s[p] * b[q]) * falling;
                against[(p, q)] = (r[p] * b[q] + s[p] * a[q]) * crossing;
            }
        }
        let y = modes.rates.to_real(Mat::from_fn(n, n, |p, q| -0.5 * (alike[(p, q)] + against[(p, q)])));
        let x = modes.rates.to_real(Mat::from_fn(n, n, |p, q| 0.5 * (alike[(p, q)] - against[(p, q)])));
        modes.of_equations(&x, &y)
    }
}

/// (1 − e^{−x})/x, where e^{−x} is given.
fn mean_decay(x: c64, decay: c64) -> c64 {
    if norm(x) < 1e-2 { 1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x / 120.0))) } else { (1.0 - decay) / x }
}

/// Σ of the products of all elements.
fn product(a: &Generator, b: &Generator) -> f64 {
    let sum = |a: &Mat<f64>, b: &Mat<f64>| -> f64 {
        (0..a.ncols()).map(|j| (0..a.nrows()).map(|i| a[(i, j)] * b[(i, j)]).sum::<f64>()).sum()
    };
    sum(&a.minus, &b.minus) + sum(&a.plus, &b.plus)
}
