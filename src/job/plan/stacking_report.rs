//! What `stackings.json` says of an object.

use serde::{Deserialize, Serialize};

use super::{layer_maps::LayerMaps, on_surface::VariantEntry};
use crate::{
    numeric::rounding::{four_digits, rounded},
    optics::{Layer, Stack},
    search::Move,
    voxel::MaterialId,
};

/// The stackings of one object and how well they do.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StackingReport {
    /// `stacking`, `profile`, `texture` or `clusters`.
    pub kind: String,
    /// Resins of the aligned sequence, top first; empty for a single stacking.
    pub sequence: Vec<String>,
    /// One entry per stacking, in the order of their labels.
    pub stackings: Vec<StackingEntry>,
    /// What lies where the object is thin or its print would miss, a label each after those of `stackings`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub variants: Vec<VariantEntry>,
    /// What fills the inside below all stackings.
    pub core: String,
    #[serde(skip)]
    pub(in crate::job) ids: Vec<MaterialId>,
    #[serde(skip)]
    pub(in crate::job) maps: LayerMaps,
}

/// One stacking.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StackingEntry {
    /// Layers, top first.
    pub layers: Vec<Layer<String>>,
    /// Share of the surface's area that has it, 0 to 1.
    pub share: f64,
    /// Albedo asked for per channel; `None` where the stacking was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_albedo: Option<Vec<f64>>,
    /// Albedo predicted per channel.
    pub predicted_albedo: Vec<f64>,
    /// What the search says; `None` where the stacking was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<SearchEntry>,
    /// Root mean square distance of the cluster's spectra from their mean; `None` without clusters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cluster_rms: Option<f64>,
    /// What `gamut-map` did to the target; `None` where the job does not ask for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gamut_map: Option<GamutMapEntry>,
}

/// A target before and after it was brought into the gamut. The search's objective is that of the target after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GamutMapEntry {
    /// Whether it lay inside of what layers of one resin each reach, or what a search with mixtures found looks like
    /// it.
    pub reached: bool,
    /// Half-energy radius asked for per channel, mm; `None` where there is no light.
    pub target_half_energy_radius_mm: Vec<Option<f64>>,
    /// Factor of its albedo, the same in all channels.
    pub albedo_factor: f64,
    /// Factor of all its radii.
    pub width_factor: f64,
    /// The objective of the stacking that was found with the target as it was asked for.
    pub objective_as_asked: f64,
}

impl GamutMapEntry {
    pub(super) fn new(moved: &Move, objective_as_asked: f64) -> Self {
        Self {
            reached: moved.reached(),
            target_half_energy_radius_mm: moved
                .from
                .iter()
                .map(|from| from.map(|[_, radius]| rounded(radius)))
                .collect(),
            albedo_factor: moved.albedo_factor,
            width_factor: moved.width_factor,
            objective_as_asked: four_digits(objective_as_asked),
        }
    }
}

/// How a search ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SearchEntry {
    /// Σ w (R̂ − R̂_t)² over coefficients and channels, with the weights of the job's objective.
    pub objective: f64,
    /// Its root per coefficient: the error of a coefficient, or its share of the target's where the objective is
    /// relative.
    pub rms: f64,
    /// No stacking of the searched space is better than this; `None`, as the next two, where layers may be mixtures and
    /// a fit found the stacking.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bound: Option<f64>,
    /// Whether the objective is proven optimal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proven: Option<bool>,
    /// Partial stackings looked at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<u64>,
    /// What the transport model says of the stacking of whole units and what it was refined to; `None` where nothing
    /// was refined. Objective, bound and proof are then those of the stacking of whole units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transport: Option<TransportEntry>,
}

/// A stacking in the transport model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TransportEntry {
    /// The objective of the layers.
    pub objective: f64,
    /// Root mean square error of a coefficient.
    pub rms: f64,
    /// The objective that the stacking of whole units has.
    pub unrefined: f64,
}

impl StackingReport {
    /// Every stacking over the core.
    pub fn stacks(&self) -> impl Iterator<Item = Stack<String>> {
        self.stackings.iter().map(|entry| self.over_core(&entry.layers))
    }

    /// Those of all labels over the core: the stackings, and what was made of them.
    pub fn stacks_of_labels(&self) -> impl Iterator<Item = Stack<String>> {
        self.stacks().chain(self.variants.iter().map(|variant| self.over_core(&variant.layers)))
    }

    fn over_core(&self, layers: &[Layer<String>]) -> Stack<String> {
        Stack { layers: layers.to_vec(), core: Some(self.core.clone()) }
    }

    /// The entry of a label's cluster, and the albedo predicted of its stacking.
    pub fn of_label(&self, label: u16) -> Option<(&StackingEntry, &[f64])> {
        let label = usize::from(label);
        match self.stackings.get(label) {
            Some(entry) => Some((entry, &entry.predicted_albedo)),
            None => {
                let variant = self.variants.get(label - self.stackings.len())?;
                Some((self.stackings.get(variant.cluster)?, &variant.predicted_albedo))
            }
        }
    }

    /// The layers of a label; none of one that there is not.
    pub fn layers_of(&self, label: u16) -> &[Layer<String>] {
        let label = usize::from(label);
        match (self.stackings.get(label), label.checked_sub(self.stackings.len())) {
            (Some(entry), _) => &entry.layers,
            (None, Some(variant)) => self.variants.get(variant).map_or(&[], |variant| &variant.layers),
            (None, None) => &[],
        }
    }

    /// The cluster of a label.
    pub fn cluster_of(&self, label: u16) -> u16 {
        let variant = usize::from(label).checked_sub(self.stackings.len()).and_then(|at| self.variants.get(at));
        variant.map_or(label, |variant| variant.cluster as u16)
    }

    /// Every material that may occur, the core's among them.
    pub fn materials(&self) -> impl Iterator<Item = MaterialId> {
        self.ids.iter().copied()
    }
}
