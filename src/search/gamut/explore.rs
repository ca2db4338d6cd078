//! Stackings spread over all that they reach.
//!
//! The plane of albedo and log radius is cut into cells, and each cell keeps the simplest stacking that was met in it;
//! new ones come from changing kept ones (MAP-Elites: Mouret and Clune, *Illuminating search spaces by mapping elites*,
//! 2015). Kept besides are the stackings of least and greatest radius at every albedo, and of least and greatest albedo
//! at every radius, and half of the changes start from those, so that the boundary is pushed outwards. Where transport
//! places them, the kept ones are sorted anew by it and a few thousand changes more are made: what lies at the edge by
//! Kubelka–Munk leaves gaps there. A heuristic: what it reaches can be reached; what it misses is not proven out of
//! reach. Evidence for its reach: four times as many changes move the boundary by under 1% (`gamut::tests`).

use std::collections::BTreeMap;

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use super::width::{RADII_MM, RadiusTable};
use crate::{
    optics::{FrequencyGrid, KubelkaMunk, ModalReflection},
    parallel,
    search::{SearchOptions, options::UnitLimit},
    watch::Watch,
};

/// Layers from the top: resin and units.
pub(super) type Runs = Vec<(usize, usize)>;

/// Cells of the plane: albedo 0 to 1, and the table's radii in even steps of their logarithm. At least two to a column
/// of [`super::Boundary`], or the outline would fall back to a point of the inside.
const ALBEDO_CELLS: usize = 160;
const RADIUS_CELLS: usize = 72;
/// Changes that are tried by Kubelka–Munk.
pub(super) const TRIALS: usize = 240_000;
/// Changes that are tried by transport, so many at once.
const TRANSPORT_TRIALS: usize = 3072;
const BATCH: usize = 128;
/// Trials between two looks at the watch.
const TRIALS_AT_ONCE: usize = 1024;
/// Every so many-th kept stacking of the inside is shown.
const INSIDE_STRIDE: usize = 8;

/// A stacking where it was met.
#[derive(Debug, Clone)]
struct Elite {
    runs: Runs,
    albedo: f64,
    radius: f64,
}

/// The search's state.
pub(super) struct Explorer<'a> {
    options: &'a SearchOptions,
    limits: &'a [UnitLimit],
    /// R̂ and T̂, index `[resin][units]`; 0 units are left empty.
    slabs: Vec<Vec<(Vec<f64>, Vec<f64>)>>,
    base: Vec<f64>,
    radii: RadiusTable,
    cells: Vec<Option<Elite>>,
    /// Least and greatest radius per column of cells, least and greatest albedo per row.
    extremes: [Vec<Option<Elite>>; 4],
    random: Xoshiro256PlusPlus,
}

impl<'a> Explorer<'a> {
    /// For one channel of the resins.
    pub fn new(
        resins: &[&KubelkaMunk],
        limits: &'a [UnitLimit],
        grid: &FrequencyGrid,
        options: &'a SearchOptions,
    ) -> Self {
        let slab = |resin: &KubelkaMunk, units: usize| {
            let slab = resin.slab(units as f64 * options.unit_mm());
            (slab.reflection, slab.transmission)
        };
        let slabs = resins.iter().map(|resin| (0..=options.units).map(|units| slab(resin, units)).collect()).collect();
        let base = options.core.map_or_else(|| vec![0.0; grid.len()], |core| resins[core.0].half_space());
        let none = |n: usize| vec![None; n];
        Self {
            options,
            limits,
            slabs,
            base,
            radii: RadiusTable::new(grid),
            cells: none(ALBEDO_CELLS * RADIUS_CELLS),
            extremes: [none(ALBEDO_CELLS), none(ALBEDO_CELLS), none(RADIUS_CELLS), none(RADIUS_CELLS)],
            random: Xoshiro256PlusPlus::seed_from_u64(2010),
        }
    }

    /// The stackings that were kept, with their spectra: all extremes, and some of the inside. By `model`, if there is
    /// one. Ends early, with less, where `watch` asks for it.
    pub fn explore(
        mut self,
        trials: usize,
        model: Option<&ModalReflection>,
        watch: &dyn Watch,
    ) -> Vec<(Runs, Vec<f64>)> {
        self.meet(Runs::new());
        let resins = self.slabs.len();
        for units in 1..=self.options.units {
            (0..resins).for_each(|resin| self.meet(vec![(resin, units)]));
        }
        for top in 0..resins {
            for below in (0..resins).filter(|below| *below != top) {
                for power in 0..self.options.units.ilog2() {
                    self.meet(vec![(top, 1 << power), (below, self.options.units - (1 << power))]);
                    self.meet(vec![(top, 1 << power), (below, 1 << power)]);
                }
            }
        }
        for trial in 0..trials {
            if trial % TRIALS_AT_ONCE == 0 && watch.stop_requested() {
                break;
            }
            let Some(parent) = self.parent() else { break };
            let child = self.changed(parent);
            self.meet(child);
        }
        let kept = self.kept();
        match model {
            None => kept.into_iter().map(|runs| (runs.clone(), self.reflection(&runs))).collect(),
            Some(model) => self.sorted_anew(kept, model, watch),
        }
    }

    fn kept(&self) -> Vec<Runs> {
        let inside = self.cells.iter().flatten().step_by(INSIDE_STRIDE);
        let mut kept: Vec<Runs> =
            self.extremes.iter().flatten().flatten().chain(inside).map(|elite| elite.runs.clone()).collect();
        kept.sort();
        kept.dedup();
        kept
    }

    /// Goes on from `kept` by `model`.
    fn sorted_anew(mut self, kept: Vec<Runs>, model: &ModalReflection, watch: &dyn Watch) -> Vec<(Runs, Vec<f64>)> {
        self.cells.fill(None);
        self.extremes.iter_mut().for_each(|group| group.fill(None));
        let unit_mm = self.options.unit_mm();
        let reflection = |runs: &Runs| {
            let layers: Vec<_> = runs.iter().map(|&(resin, units)| (resin, units as f64 * unit_mm)).collect();
            model.reflection(&layers)
        };
        let mut known: BTreeMap<Runs, Vec<f64>> = BTreeMap::new();
        let mut next = kept;
        for _ in 0..=TRANSPORT_TRIALS / BATCH {
            if watch.stop_requested() {
                break;
            }
            let spectra: Vec<Vec<f64>> = parallel::map_all(&next, reflection);
            for (runs, spectrum) in next.into_iter().zip(spectra) {
                self.place(runs.clone(), &spectrum);
                known.insert(runs, spectrum);
            }
            next = Vec::with_capacity(BATCH);
            for _ in 0..BATCH {
                let Some(parent) = self.parent() else { break };
                let child = self.changed(parent);
                if self.allowed(&child) && !known.contains_key(&child) && !next.contains(&child) {
                    next.push(child);
                }
            }
        }
        self.kept().into_iter().filter_map(|runs| known.remove_entry(&runs)).collect()
    }

    fn below(&mut self, n: usize) -> usize {
        (self.random.next_u64() % n.max(1) as u64) as usize
    }

    /// Any kept stacking.
    fn parent(&mut self) -> Option<Runs> {
        let extreme = self.below(2) == 0;
        for _ in 0..64 {
            let group = self.below(4);
            let from = if extreme { self.extremes[group].len() } else { self.cells.len() };
            let at = self.below(from);
            let found = if extreme { &self.extremes[group][at] } else { &self.cells[at] };
            if let Some(elite) = found {
                return Some(elite.runs.clone());
            }
        }
        // Hardly anything is kept yet: the first there is.
        self.cells.iter().flatten().next().map(|elite| elite.runs.clone())
    }

    /// A stacking that differs by a thickness, a layer, or a resin.
    fn changed(&mut self, mut runs: Runs) -> Runs {
        let (layer, resin) = (self.below(runs.len()), self.below(self.slabs.len()));
        let step = 1 << self.below(self.options.units.ilog2() as usize);
        match self.below(if runs.is_empty() { 1 } else { 6 }) {
            0 => {
                let at = self.below(runs.len() + 1);
                runs.insert(at, (resin, step));
            }
            1 => {
                runs.remove(layer);
            }
            2 => runs[layer].0 = resin,
            3 => runs[layer].1 += step,
            4 => runs[layer].1 = runs[layer].1.saturating_sub(step),
            _ => {
                // Thickness goes from one layer to another.
                let other = self.below(runs.len());
                let moved = step.min(runs[layer].1);
                runs[layer].1 -= moved;
                runs[other].1 += moved;
            }
        }
        let mut joined = Runs::new();
        for (resin, units) in runs.into_iter().filter(|run| run.1 > 0) {
            match joined.last_mut() {
                Some(last) if last.0 == resin => last.1 += units,
                _ => joined.push((resin, units)),
            }
        }
        joined
    }

    /// Whether it keeps the limits.
    fn allowed(&self, runs: &Runs) -> bool {
        let mut depth = 0;
        for &(resin, units) in runs {
            let limit = &self.limits[resin];
            if depth < limit.top || units < limit.least || units > limit.most {
                return false;
            }
            depth += units;
        }
        // A last layer of the core's resin is the core's.
        let core = self.options.core.map(|core| core.0);
        depth <= self.options.units
            && runs.len() <= self.options.depth
            && core.is_none_or(|core| depth >= self.limits[core].top && runs.last().is_none_or(|last| last.0 != core))
    }

    fn reflection(&self, runs: &Runs) -> Vec<f64> {
        let mut below = self.base.clone();
        for &(resin, units) in runs.iter().rev() {
            let (r, t) = &self.slabs[resin][units];
            for (below, (r, t)) in below.iter_mut().zip(r.iter().zip(t)) {
                *below = r + t * t * *below / (1.0 - r * *below).max(f64::MIN_POSITIVE);
            }
        }
        self.options.surface.surface_over(&below)
    }

    /// Keeps a stacking where it has a place.
    fn meet(&mut self, runs: Runs) {
        if !self.allowed(&runs) {
            return;
        }
        let spectrum = self.reflection(&runs);
        self.place(runs, &spectrum);
    }

    fn place(&mut self, runs: Runs, spectrum: &[f64]) {
        let Some(radius) = self.radii.half_energy(spectrum) else { return };
        let elite = Elite { runs, albedo: spectrum[0], radius };
        let column = ((elite.albedo * ALBEDO_CELLS as f64) as usize).min(ALBEDO_CELLS - 1);
        let [low, high] = RADII_MM.map(libm::log);
        let row = ((libm::log(radius) - low) / (high - low) * RADIUS_CELLS as f64) as usize;
        let row = row.min(RADIUS_CELLS - 1);
        let cell = &mut self.cells[row * ALBEDO_CELLS + column];
        if cell.as_ref().is_none_or(|kept| elite.runs.len() < kept.runs.len()) {
            *cell = Some(elite.clone());
        }
        let [narrow, wide, dark, bright] = &mut self.extremes;
        let keep = |place: &mut Option<Elite>, better: fn(&Elite, &Elite) -> bool| {
            if place.as_ref().is_none_or(|kept| better(&elite, kept)) {
                *place = Some(elite.clone());
            }
        };
        keep(&mut narrow[column], |new, kept| new.radius < kept.radius);
        keep(&mut wide[column], |new, kept| new.radius > kept.radius);
        keep(&mut dark[row], |new, kept| new.albedo < kept.albedo);
        keep(&mut bright[row], |new, kept| new.albedo > kept.albedo);
    }
}
