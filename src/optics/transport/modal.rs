//! Many stacks of the same resins, with derivatives: the transport equation in each resin's own modes.
//!
//! [`super::slab`] doubles every slab anew. A search asks for thousands of stacks of few resins, so here what depends
//! on the resins alone is computed once ([`super::modes`]). Through a layer h thick ρ ← e^{−Λh} ρ e^{−Λh}, and
//! boundaries do the rest; a half-space has ρ = 0. Only falling exponentials occur, and ∂ρ/∂h = −(Λρ + ρΛ).

use faer::{
    Col, Mat, Row,
    linalg::solvers::{PartialPivLu, Solve},
};

use super::{
    FewTurns, TransportOptions, TransportSpectra,
    directions::{AIR, Directions},
    flux,
    interface::reflectances,
    modes::{Interface, Modes, Rates},
    scattering::Scattering,
    slab::factorise,
};
use crate::optics::{Light, VolumeCoefficients};
use crate::parallel;

/// Least absorption per mm: without any, one mode neither grows nor falls, and U and W are singular. Changes an albedo
/// by 1e-5 at most in stacks of 10 mm of white.
const LEAST_ABSORPTION: f64 = 1e-8;

/// The reflection of any stack of some resins, in one channel, under diffuse light, without the glint of its surface.
#[derive(Debug)]
pub struct ModalReflection {
    setting: Setting,
    k: Vec<f64>,
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

/// Resins under air, over a half-space of one of them or over air, and the light on them: what holds at every
/// frequency.
#[derive(Debug)]
pub(super) struct Setting {
    pub(super) scattering: Vec<Scattering>,
    indices: Vec<f64>,
    base: Option<usize>,
    directions: Directions,
    source: Col<f64>,
    flux: Row<f64>,
}

/// All that is known at one spatial frequency.
#[derive(Debug)]
pub(super) struct Frequency {
    /// One per resin.
    rates: Vec<Rates>,
    /// Between resins, index above · resins + below.
    interfaces: Vec<Interface>,
    /// From air into each resin.
    tops: Vec<Top>,
    /// From each resin into what lies below the stack.
    bottoms: Vec<Bottom>,
    /// R̂ and T̂ without any layer.
    bare: (f64, f64),
}

/// The surface: `enter` is M times the source, `leave` and `leave_below` the flux of P and Q.
#[derive(Debug)]
pub(super) struct Top {
    interface: Interface,
    enter: Col<f64>,
    leave: Row<f64>,
    leave_below: Row<f64>,
}

/// Below the lowest layer: ρ there, and the flux that leaves for its amplitudes.
#[derive(Debug)]
struct Bottom {
    rho: Mat<f64>,
    exit: Option<Row<f64>>,
}

impl ModalReflection {
    /// `resins` over a half-space of the resin `base` (an index), or over nothing, at spatial frequencies `k` in
    /// rad/mm.
    pub fn new(resins: &[VolumeCoefficients], base: Option<usize>, k: &[f64], options: TransportOptions) -> Self {
        let setting = Setting::new(resins, base, Light::Diffuse, options);
        Self { frequencies: parallel::map_all(k, |&k| Frequency::new(&setting, k)), setting, k: k.to_vec() }
    }

    /// R̂ of `layers`, (resin, mm ≥ 0) from the observer down, at each frequency.
    pub fn reflection(&self, layers: &[(usize, f64)]) -> Vec<f64> {
        self.frequencies.iter().map(|frequency| frequency.spectra(layers).0).collect()
    }

    /// The same with T̂; 0 over a half-space.
    #[cfg_attr(not(test), expect(dead_code, reason = "tested and timed; searches weigh R̂ alone"))]
    pub fn spectra(&self, layers: &[(usize, f64)]) -> TransportSpectra {
        let mut spectra = self.discrete(layers);
        if self.setting.base.is_none() {
            let mut merged: Vec<(usize, f64)> = Vec::new();
            for &(resin, mm) in layers.iter().filter(|(_, mm)| *mm > 0.0) {
                match merged.last_mut() {
                    Some((above, sum)) if *above == resin => *sum += mm,
                    _ => merged.push((resin, mm)),
                }
            }
            let layers: Vec<_> =
                merged.iter().map(|&(resin, mm)| (self.setting.scattering[resin].clone(), mm)).collect();
            if let Some(light) = FewTurns::new(&layers, &self.setting.directions, Light::Diffuse, &self.k) {
                let pairs = spectra.transmission.iter_mut().zip(&self.k);
                pairs.for_each(|(value, &k)| *value += light.correction(k));
            }
        }
        spectra
    }

    /// R̂ and T̂ as the directions see them.
    pub(super) fn discrete(&self, layers: &[(usize, f64)]) -> TransportSpectra {
        let (reflection, transmission) = self.frequencies.iter().map(|frequency| frequency.spectra(layers)).unzip();
        TransportSpectra { reflection, transmission }
    }

    /// R̂ with ∂R̂/∂h.
    pub fn slope(&self, layers: &[(usize, f64)]) -> ReflectionSlope {
        let mut slope = ReflectionSlope {
            reflection: Vec::with_capacity(self.frequencies.len()),
            per_mm: vec![Vec::with_capacity(self.frequencies.len()); layers.len()],
        };
        for frequency in &self.frequencies {
            let (reflection, per_mm) = frequency.slope(layers);
            slope.reflection.push(reflection);
            slope.per_mm.iter_mut().zip(per_mm).for_each(|(values, value)| values.push(value));
        }
        slope
    }
}

impl Setting {
    pub(super) fn new(
        resins: &[VolumeCoefficients],
        base: Option<usize>,
        light: Light,
        options: TransportOptions,
    ) -> Self {
        Self { base, ..Self::with_indices(resins, &[], light, options) }
    }

    /// Directions that know further refractive indices too, and no base.
    pub(super) fn with_indices(
        resins: &[VolumeCoefficients],
        further: &[f64],
        light: Light,
        options: TransportOptions,
    ) -> Self {
        let indices: Vec<f64> = resins.iter().map(|resin| resin.refractive_index).collect();
        let directions = Directions::new(indices.iter().chain(further).copied(), options);
        let scattering = resins.iter().map(|resin| scattering(resin, &directions)).collect();
        // The beam, the last unknown, has no part in diffuse light.
        let n = match light {
            Light::Diffuse => directions.beam(),
            Light::Normal => directions.len(),
        };
        let (source, flux) = (super::source(light, &directions), flux(&directions));
        let (source, flux) = (source.subrows(0, n).to_owned(), flux.subcols(0, n).to_owned());
        Self { scattering, indices, base: None, directions, source, flux }
    }

    /// Unknowns per hemisphere.
    pub(super) fn len(&self) -> usize {
        self.source.nrows()
    }

    /// A medium over the directions, which must know its refractive index.
    pub(super) fn scattering_of(&self, volume: &VolumeCoefficients) -> Scattering {
        scattering(volume, &self.directions)
    }

    /// Between two media, given by their modes and refractive indices.
    pub(super) fn interface(&self, above: (&Modes, f64), below: (&Modes, f64)) -> Interface {
        Interface::new(above.0, below.0, reflectances(&self.directions, above.1, below.1).as_deref())
    }

    /// The surface, from air into a medium.
    pub(super) fn top(&self, air: (&Modes, f64), below: (&Modes, f64)) -> Top {
        let interface = self.interface(air, below);
        let (leave, leave_below) = interface.leaving(&self.flux);
        Top { enter: interface.enter(self.source.clone()), leave, leave_below, interface }
    }
}

fn scattering(volume: &VolumeCoefficients, directions: &Directions) -> Scattering {
    let absorbing = VolumeCoefficients { sigma_a: volume.sigma_a.max(LEAST_ABSORPTION), ..*volume };
    Scattering::new(&absorbing, directions)
}

impl Frequency {
    pub(super) fn new(setting: &Setting, k: f64) -> Self {
        let Setting { indices, base, source, flux, .. } = setting;
        let n = source.nrows();
        let modes: Vec<_> = setting.scattering.iter().map(|resin| Modes::new(&resin.generator(k), n)).collect();
        let air = Modes::air(n);
        let medium = |medium: Option<usize>| medium.map_or((&air, AIR), |resin| (&modes[resin], indices[resin]));
        let interface = |above: Option<usize>, below: Option<usize>| setting.interface(medium(above), medium(below));
        let resins = 0..modes.len();
        let top = |below: Option<usize>| setting.top(medium(None), medium(below));
        let bottom = |resin: usize| {
            let interface = interface(Some(resin), *base);
            let down = factorise(&interface.down(None));
            let mut up = interface.up(None);
            down.rsolve_in_place(&mut up);
            let exit = base.is_none().then(|| interface.enter_row(&solved(flux, &down)));
            Bottom { rho: interface.above(&up), exit }
        };
        let bare = match base {
            None => (0.0, flux * source),
            Some(_) => (top(*base).value(None).0, 0.0),
        };
        Self {
            interfaces: resins
                .clone()
                .flat_map(|above| resins.clone().map(move |below| (above, below)))
                .map(|(above, below)| interface(Some(above), Some(below)))
                .collect(),
            tops: resins.clone().map(|resin| top(Some(resin))).collect(),
            bottoms: resins.map(bottom).collect(),
            bare,
            rates: modes.into_iter().map(|modes| modes.rates).collect(),
        }
    }

    /// R̂ and T̂.
    pub(super) fn spectra(&self, layers: &[(usize, f64)]) -> (f64, f64) {
        let steps = self.steps(layers);
        let Some(first) = steps.first() else { return self.bare };
        let (reflection, mut column, _) = self.tops[first.resin].value(Some(&first.rho));
        for step in &steps {
            column = step.decay.column(&column);
            if let Some(boundary) = &step.below {
                column = boundary.through(column);
            }
        }
        let exit = steps.last().and_then(|last| self.bottoms[last.resin].exit.as_ref());
        (reflection, exit.map_or(0.0, |exit| exit * column))
    }

    /// R̂ and ∂R̂/∂h of every layer.
    fn slope(&self, layers: &[(usize, f64)]) -> (f64, Vec<f64>) {
        let steps = self.steps(layers);
        let Some(first) = steps.first() else { return (self.bare.0, Vec::new()) };
        let (reflection, mut column, mut row) = self.tops[first.resin].value(Some(&first.rho));
        let mut slopes = Vec::with_capacity(steps.len());
        for Step { resin, decay, rho, below } in &steps {
            let rates = &self.rates[*resin];
            slopes.push(-(&rates.row(&row) * (rho * &column) + (&row * rho) * &rates.column(&column)));
            (row, column) = (decay.row(&row), decay.column(&column));
            if let Some(boundary) = below {
                row = boundary.interface.change(&row, &boundary.up);
                column = boundary.through(column);
            }
        }
        (reflection, slopes)
    }

    /// Builds the stack from the base up; the steps are from the observer down.
    fn steps(&self, layers: &[(usize, f64)]) -> Vec<Step<'_>> {
        let mut steps: Vec<Step> = Vec::with_capacity(layers.len());
        for &(resin, mm) in layers.iter().rev() {
            let decay = self.rates[resin].decay(mm);
            let through = |rho: &Mat<f64>| decay.right_of(&decay.left_of(rho));
            let (rho, below) = match steps.last() {
                None => (through(&self.bottoms[resin].rho), None),
                Some(lower) => {
                    let interface = &self.interfaces[resin * self.rates.len() + lower.resin];
                    let boundary = Boundary::new(interface, &lower.rho);
                    (through(&interface.above(&boundary.up)), Some(boundary))
                }
            };
            steps.push(Step { resin, decay, rho, below });
        }
        steps.reverse();
        steps
    }
}

/// A layer: e^{−Λh}, ρ at its top, and the boundary to the layer below it if there is one.
struct Step<'a> {
    resin: usize,
    decay: Rates,
    rho: Mat<f64>,
    below: Option<Boundary<'a>>,
}

/// A boundary within a stack.
pub(super) struct Boundary<'a> {
    pub(super) interface: &'a Interface,
    /// Factors of N₁ + N₂ρ.
    down: PartialPivLu<f64>,
    /// (P + Qρ)(N₁ + N₂ρ)⁻¹.
    pub(super) up: Mat<f64>,
}

impl<'a> Boundary<'a> {
    pub(super) fn new(interface: &'a Interface, rho: &Mat<f64>) -> Self {
        let down = factorise(&interface.down(Some(rho)));
        let mut up = interface.up(Some(rho));
        down.rsolve_in_place(&mut up);
        Self { interface, down, up }
    }

    pub(super) fn through(&self, column: Col<f64>) -> Col<f64> {
        let mut column = self.interface.enter(column);
        self.down.solve_in_place(&mut column);
        column
    }
}

impl Top {
    /// R̂ over ρ, the amplitudes below the surface, and the row that ρ's changes make R̂'s with.
    pub(super) fn value(&self, rho: Option<&Mat<f64>>) -> (f64, Col<f64>, Row<f64>) {
        let down = factorise(&self.interface.down(rho));
        let mut column = self.enter.clone();
        down.solve_in_place(&mut column);
        let leave = rho.map_or_else(|| self.leave.clone(), |rho| &self.leave + &self.leave_below * rho);
        let reflection = &leave * &column;
        let row = &self.leave_below - self.interface.change_below(&solved(&leave, &down));
        (reflection, column, row)
    }
}

/// Row × matrix⁻¹.
fn solved(row: &Row<f64>, matrix: &PartialPivLu<f64>) -> Row<f64> {
    let mut column = row.transpose().to_owned();
    matrix.solve_transpose_in_place(&mut column);
    column.transpose().to_owned()
}
