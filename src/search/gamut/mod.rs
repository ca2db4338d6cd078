//! What stackings can reach: albedo against half-energy radius, and targets brought into it.
//!
//! **In:** the resins' parameters and the space of a search. **Out:** a [`Gamut`] per channel: stackings spread over
//! all it reaches, and the [`Boundary`] around them; a [`GamutMap`] that moves targets outside smoothly inside.
//!
//! ```text
//!   resins, options ──► Explorer: stackings spread by mutation, by Kubelka–Munk and then by transport ──► Boundary
//!   targets ──► (albedo, radius) ──► GamutMap: albedo and width factors ──► targets within reach
//! ```
//!
//! Two numbers stand for a spectrum of 128: a target inside the boundary may still be out of reach by its shape. A
//! channel is judged on its own: in colour, what each channel reaches need not be reached together.

mod alike;
mod boundary;
mod explore;
mod map;
#[cfg(test)]
mod tests;
mod width;

use serde::{Deserialize, Serialize};

pub use alike::{GLOWS, far_glow, far_miss};
pub use boundary::Boundary;
use explore::{Explorer, Runs, TRIALS};
pub use map::{GamutMap, Lies, Move};

use super::{MatchOptions, RefineOptions, ResinLimit, SearchCache, SearchError, SearchOptions, options::MAX_UNITS};
use crate::optics::{
    FrequencyGrid, InverseHankel, KubelkaMunk, MaterialSet, ModalReflection, Resin, ResinId, Stack, TransportOptions,
    VolumeCoefficients,
};
use crate::parallel;
use crate::watch::Watch;

/// Directions that place a stacking to 0.4% in albedo and 1.3% in radius (docs/accuracy.md), at a third of the cost of
/// those that judge it.
const DIRECTIONS: TransportOptions = TransportOptions { polar: 4, orders: 6 };

/// What a set of resins reaches, per channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gamut {
    /// One per channel.
    pub channels: Vec<ChannelGamut>,
}

/// What is reached in one channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelGamut {
    /// Stackings spread over the whole gamut, by ascending albedo.
    pub points: Vec<GamutPoint>,
    /// Around them.
    pub boundary: Boundary,
}

/// A stacking and where it lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GamutPoint {
    /// Its layers over the search's core.
    pub stacking: Stack,
    /// R̂(0).
    pub albedo: f64,
    /// Radius within which half of the reflected light leaves, mm.
    pub half_energy_radius_mm: f64,
}

/// Where a stacking lies in a gamut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// No other of its albedo has a smaller radius.
    Narrow,
    /// None has a greater one.
    Wide,
    /// Between the two.
    Inside,
}

impl Side {
    /// In files and at the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Narrow => "narrow",
            Self::Wide => "wide",
            Self::Inside => "inside",
        }
    }
}

/// Units of refined layers that make the thinnest: a quarter of 27 µm of black at the surface changes an albedo by 0.04
/// and leaves a notch.
const PARTS: f64 = 16.0;

/// The space of `options` in steps of a printer's layers instead of a search's blocks; without `refine.step_mm`, which
/// leaves any thickness, in sixteenths of the thinnest layer. Where these would be more units than a search may have,
/// they are coarser.
fn layer_space(options: &SearchOptions, refine: &RefineOptions, resins: usize) -> SearchOptions {
    let step_mm = refine.step_mm.unwrap_or(refine.min_layer_mm / PARTS);
    let given = |resin: usize| options.limits.get(resin).copied().unwrap_or(ResinLimit::NONE);
    let limit = |limit: ResinLimit| match limit.min_mm.max(refine.min_layer_mm) {
        min_mm if min_mm <= limit.max_mm => ResinLimit { min_mm, ..limit },
        // What may not be as thick as the thinnest layer is in none.
        _ => ResinLimit { min_mm: 0.0, max_mm: 0.0, ..limit },
    };
    SearchOptions {
        units: (options.max_thickness_mm / step_mm).ceil().min(MAX_UNITS as f64) as usize,
        limits: (0..resins).map(|resin| limit(given(resin))).collect(),
        ..options.clone()
    }
}

/// Where a spectrum lies: its albedo, and its half-energy radius in mm. `None` where it reflects nothing, or half of
/// the light leaves farther out than the grid can tell (20 mm on the default grid).
pub fn place_of(spectrum: &[f64], grid: &FrequencyGrid) -> Option<[f64; 2]> {
    let radius = InverseHankel::new(spectrum, grid).radius_of_energy(0.5)?;
    Some([spectrum[0], radius])
}

impl Gamut {
    /// [`Self::explore`], unless `cache` knows what it would find.
    ///
    /// # Errors
    /// Those of [`Self::explore`].
    pub fn explored(
        set: &MaterialSet,
        options: &MatchOptions,
        watch: &dyn Watch,
        cache: Option<&SearchCache>,
    ) -> Result<Self, SearchError> {
        // It never mixes.
        let question = (set, &options.search, options.judge, options.layers);
        SearchCache::recall(cache, "gamut", &question, || Self::explore(set, options, watch))
    }

    /// Explores what the resins of `set` reach with at most `depth` layers that keep the limits of `options.search`, as
    /// fine as `options.layers` may be: whole units of a search, 78 µm, leave gaps. Stackings are found by
    /// Kubelka–Munk; if transport judges, they are placed by it, and more are found by it. The same for the same input,
    /// whatever the number of threads.
    ///
    /// # Errors
    /// Options out of range, contradictory limits, no stacking that keeps them and reflects anything; a resin without
    /// coefficients, if transport judges; [`SearchError::Stopped`].
    pub fn explore(set: &MaterialSet, options: &MatchOptions, watch: &dyn Watch) -> Result<Self, SearchError> {
        let parameters: Vec<_> = set.resins.iter().map(Resin::kubelka_munk).collect();
        let space = layer_space(&options.search, &options.layers, parameters.len());
        let space = SearchOptions { surface: set.surface(), ..space };
        Self::of_space(&parameters, options.volumes(set)?.as_deref(), &set.grid, &space, watch)
    }

    /// The same of `resins`, index `[resin][channel]` on `grid`, in layers of whole units of `options`.
    fn of_space(
        resins: &[Vec<KubelkaMunk>],
        volumes: Option<&[Vec<VolumeCoefficients>]>,
        grid: &FrequencyGrid,
        options: &SearchOptions,
        watch: &dyn Watch,
    ) -> Result<Self, SearchError> {
        let limits = options.validate(resins.len())?;
        let channels = resins.first().map_or(0, Vec::len);
        let explored: Vec<Option<ChannelGamut>> = parallel::map(channels, |channel| {
            let parameters: Vec<_> = resins.iter().map(|resin| &resin[channel]).collect();
            let model = volumes.map(|volumes| {
                let volumes: Vec<_> = volumes.iter().map(|resin| resin[channel]).collect();
                ModalReflection::new(&volumes, options.core.map(|core| core.0), grid.as_slice(), DIRECTIONS)
            });
            let found = Explorer::new(&parameters, &limits, grid, options).explore(TRIALS, model.as_ref(), watch);
            ChannelGamut::around(&found, grid, options)
        });
        watch.go_on()?;
        let channels: Option<Vec<_>> = explored.into_iter().collect();
        channels.map(|channels| Self { channels }).ok_or(SearchError::Infeasible {
            units: options.units,
            unit_mm: options.unit_mm(),
            depth: options.depth,
        })
    }
}

impl ChannelGamut {
    /// Where `point`, one of its own, lies.
    pub fn side(&self, point: &GamutPoint) -> Side {
        let place = [point.albedo, point.half_energy_radius_mm];
        if self.boundary.wide().contains(&place) {
            Side::Wide
        } else if self.boundary.narrow().contains(&place) {
            Side::Narrow
        } else {
            Side::Inside
        }
    }

    fn around(found: &[(Runs, Vec<f64>)], grid: &FrequencyGrid, options: &SearchOptions) -> Option<Self> {
        let unit_mm = options.unit_mm();
        let point = |(runs, spectrum): &(Runs, Vec<f64>)| {
            let layers = runs.iter().map(|&(resin, units)| (ResinId(resin), units as f64 * unit_mm));
            let [albedo, half_energy_radius_mm] = place_of(spectrum, grid)?;
            let stacking = Stack::joined(layers).over(options.core);
            Some(GamutPoint { stacking, albedo, half_energy_radius_mm })
        };
        let mut points: Vec<GamutPoint> = parallel::map_all(found, point).into_iter().flatten().collect();
        points.sort_by(|a, b| a.albedo.total_cmp(&b.albedo));
        let places: Vec<_> = points.iter().map(|point| [point.albedo, point.half_energy_radius_mm]).collect();
        Some(Self { boundary: Boundary::around(&places)?, points })
    }
}
