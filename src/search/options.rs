//! What a search is asked, what it answers, and how it may fail.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Objective, ResinLimit};
use crate::optics::{ChannelId, FrequencyGrid, Interface, OpticsError, ProfileFile, ResinId, Stack};
use crate::watch::Stopped;
use crate::words::short;

/// The space of stackings that is searched, shared by all targets.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchOptions {
    /// Thickest stacking, mm; 5 in the paper.
    pub max_thickness_mm: f64,
    /// n: the thickness is a multiple of h₀ = `max_thickness_mm`/n; 64 in the paper.
    pub units: usize,
    /// Most blocks in a stacking; 6 in the paper. A layer of u·h₀ takes as many blocks as u has binary ones: 63 h₀
    /// takes six.
    pub depth: usize,
    /// What is minimised.
    pub objective: Objective,
    /// One per resin; empty for no limits at all.
    pub limits: Vec<ResinLimit>,
    /// The resin that fills the half-space below the stacking; `None`: nothing lies there and no light returns.
    pub core: Option<ResinId>,
    /// What lies between air and every stacking; a [`Matcher`](super::Matcher) and a [`Gamut`](super::Gamut) take that
    /// of their set in its place. Between layers of unlike refractive indices the search sees nothing.
    pub surface: Interface,
    /// Stop after this many nodes with the best stacking so far; `None`: search until the optimum is proven.
    pub max_nodes: Option<u64>,
}

impl Default for SearchOptions {
    /// The paper's section 8.3, its objective too, without limits or core.
    fn default() -> Self {
        Self {
            max_thickness_mm: 5.0,
            units: 64,
            depth: 6,
            objective: Objective::L2,
            limits: Vec::new(),
            core: None,
            surface: Interface::NONE,
            max_nodes: None,
        }
    }
}

/// What a stacking should reflect.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchTarget {
    /// R̂_t per channel, on the frequency grid of the resins.
    pub channels: Vec<Vec<f64>>,
}

impl SearchTarget {
    /// What a profile file or several ask for, over `grid`: one serves all of `channels` channels, or each has its own.
    ///
    /// # Errors
    /// A file that cannot be read, or is no profile of reflection.
    pub fn from_profiles(
        paths: &[impl AsRef<Path>],
        channels: usize,
        grid: &FrequencyGrid,
    ) -> Result<Self, OpticsError> {
        let spectra = paths.iter().map(|path| Ok(ProfileFile::read_reflection(path.as_ref())?.hankel(grid).values));
        let spectra = spectra.collect::<Result<Vec<_>, OpticsError>>()?;
        let of = |channel: usize| spectra.get(channel).or(spectra.last()).cloned();
        Ok(Self { channels: (0..channels).filter_map(of).collect() })
    }
}

/// A stacking found, and how good it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Match {
    /// The layers over the search's core. A last layer of the core's own resin belongs to the core and is not listed.
    pub stacking: Stack,
    /// The search's [`Objective`] by Kubelka–Munk.
    pub objective: f64,
    /// R̂ of the stacking, core included, per channel.
    pub reflection: Vec<Vec<f64>>,
    /// No stacking of the searched space has an objective below this one.
    pub bound: f64,
    /// Whether `objective` is the optimum of the searched space; false only where the node budget ended the search.
    pub proven: bool,
    /// Partial stackings looked at.
    pub nodes: u64,
}

/// Why there is no match.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// An option outside its range.
    #[error("search option {name} is {found}, expected {expected}")]
    Option {
        /// The option's name.
        name: &'static str,
        /// Its value.
        found: f64,
        /// The values it may take.
        expected: &'static str,
    },
    /// A resin limit that contradicts itself or the number of resins.
    #[error("limit of resin {resin}: {found}, expected 0 ≤ min-depth, 0 ≤ min ≤ max, in mm and one limit per resin")]
    Limit {
        /// The resin.
        resin: ResinId,
        /// The limit as given.
        found: String,
    },
    /// The resins do not agree with each other.
    #[error("resin {resin}, channel {channel}: {found} coefficients, expected {expected} as in the first resin")]
    Resins {
        /// The resin.
        resin: ResinId,
        /// The channel.
        channel: ChannelId,
        /// Number of coefficients found (0: the channel is missing).
        found: usize,
        /// Number of coefficients expected.
        expected: usize,
    },
    /// Layers of whole steps that keep the limits were not found.
    #[error(
        "no layers of whole steps of {} mm keep the limits, expected a finer step or wider limits",
        short(*step_mm)
    )]
    Steps {
        /// The step, mm.
        step_mm: f64,
    },
    /// The target does not fit the resins.
    #[error(
        "target has {channels} channels of {coefficients} coefficients, expected {expected_channels} of \
         {expected_coefficients}"
    )]
    Target {
        /// Channels found.
        channels: usize,
        /// Coefficients of the first channel that does not fit.
        coefficients: usize,
        /// Channels of the resins.
        expected_channels: usize,
        /// Coefficients of the resins.
        expected_coefficients: usize,
    },
    /// A target coefficient is not a finite number.
    #[error("target channel {channel}, coefficient {index} is {found}, expected a finite number")]
    TargetValue {
        /// The channel.
        channel: ChannelId,
        /// Index into the frequency grid.
        index: usize,
        /// The coefficient.
        found: f64,
    },
    /// The limits leave no stacking.
    #[error(
        "no stacking of at most {units} units of {} mm in {depth} blocks keeps the resins' limits; loosen a limit or \
         raise depth",
        short(*unit_mm)
    )]
    Infeasible {
        /// Units the stacking may be thick.
        units: usize,
        /// Thickness of a unit, mm.
        unit_mm: f64,
        /// Blocks allowed.
        depth: usize,
    },
    /// The model that judges needs coefficients of a resin that is given by profiles only.
    #[error("resin {resin}: found no coefficients, expected scattering-per-mm and absorption-per-mm")]
    NoCoefficients {
        /// The resin.
        resin: String,
    },
    /// The watch asked the search to stop.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The node budget ended the search before any stacking that keeps the limits was met.
    #[error("no stacking found within {nodes} nodes, expected a larger node budget")]
    Budget {
        /// The budget.
        nodes: u64,
    },
}

impl crate::blame::Blamed for SearchError {}

/// A [`ResinLimit`] in units of h₀: what a layer of the resin must keep to be within it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct UnitLimit {
    /// Least depth of its top.
    pub top: usize,
    /// Least thickness.
    pub least: usize,
    /// Greatest thickness.
    pub most: usize,
}

/// Rounding slack, in units, when a limit is a whole number of units.
const UNIT_SLACK: f64 = 1e-9;
/// The largest n: beyond it h₀ is far below any printer's layer.
pub(super) const MAX_UNITS: usize = 4096;
/// The deepest search: no stacking of n ≤ 4096 units that anyone prints takes more blocks.
const MAX_DEPTH: usize = 24;

impl SearchOptions {
    /// Thickness of a unit h₀, mm.
    pub fn unit_mm(&self) -> f64 {
        self.max_thickness_mm / self.units as f64
    }

    /// Checks everything for `resins` resins; returns the limits in units.
    pub(super) fn validate(&self, resins: usize) -> Result<Vec<UnitLimit>, SearchError> {
        let check = |name, found: f64, expected, valid| match valid {
            true => Ok(()),
            false => Err(SearchError::Option { name, found, expected }),
        };
        let h_max = self.max_thickness_mm;
        check("max-thickness-mm", h_max, "a finite number above 0", h_max > 0.0 && h_max.is_finite())?;
        check("units", self.units as f64, "1 to 4096", (1..=MAX_UNITS).contains(&self.units))?;
        check("depth", self.depth as f64, "1 to 24", (1..=MAX_DEPTH).contains(&self.depth))?;
        let dc = self.objective.dc_weight;
        check("dc-weight", dc, "a finite number, at least 0", dc >= 0.0 && dc.is_finite())?;
        if let Some(core) = self.core {
            check("core", core.0 as f64, "the index of a resin", core.0 < resins)?;
        }
        if !self.limits.is_empty() && self.limits.len() != resins {
            let found = format!("{} limits for {resins} resins", self.limits.len());
            return Err(SearchError::Limit { resin: ResinId(self.limits.len().min(resins)), found });
        }
        let none = ResinLimit::NONE;
        (0..resins).map(|resin| self.unit_limit(ResinId(resin), self.limits.get(resin).unwrap_or(&none))).collect()
    }

    fn unit_limit(&self, resin: ResinId, limit: &ResinLimit) -> Result<UnitLimit, SearchError> {
        let ResinLimit { min_depth_mm, min_mm, max_mm } = *limit;
        if !(min_depth_mm >= 0.0 && min_mm >= 0.0 && max_mm >= min_mm) {
            let found = format!("min-depth {}, min {}, max {}", short(min_depth_mm), short(min_mm), short(max_mm));
            return Err(SearchError::Limit { resin, found });
        }
        let up = |mm: f64| ((mm / self.unit_mm() - UNIT_SLACK).ceil()).clamp(0.0, 1e9) as usize;
        let down = |mm: f64| ((mm / self.unit_mm() + UNIT_SLACK).floor()).clamp(0.0, 1e9) as usize;
        Ok(UnitLimit { top: up(min_depth_mm), least: up(min_mm), most: down(max_mm) })
    }
}
