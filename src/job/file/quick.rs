//! A job made coarse, for a first look at it.

use glam::DVec3;

use super::{Job, OutputFormat, StackingModel};

/// Voxels of a quick job are at least so large, mm: a figure of 40 mm is some millions of them.
const PITCH_MM: f64 = 0.2;
/// Stackings of a quick job: each takes half a second.
const STACKINGS: usize = 12;

impl Job {
    /// The same job, coarsely: voxels of at least 0.2 mm, at most 12 stackings an object, and no correction of the
    /// print. Layers stay as thin as they may be, and what formats and the printer ask of finer voxels does not matter:
    /// pictures are all that comes of it.
    pub fn quick(mut self) -> Self {
        // As the formats that are dropped have it.
        self.stacking.mixtures = Some(self.allows_mixtures());
        self.output.formats = vec![OutputFormat::Preview];
        self.printer.min_slices = None;
        self.is_coarse = true;
        if let StackingModel::Transport { min_layer_mm, .. } = &mut self.stacking.model {
            min_layer_mm.get_or_insert(self.printer.pitch_mm.max_element());
        }
        self.printer.pitch_mm = self.printer.pitch_mm.max(DVec3::splat(PITCH_MM));
        self.clusters.k = self.clusters.k.min(STACKINGS);
        self.appearance.rounds = Some(0);
        self.appearance.thin_parts = Some(false);
        self
    }
}
