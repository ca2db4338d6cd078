//! A job made coarse, for a first look at it.

use glam::DVec3;

use super::{Job, StackingModel};

/// Voxels of a quick job are at least so large, mm: a figure of 40 mm is some millions of them.
const PITCH_MM: f64 = 0.2;
/// Stackings of a quick job: each takes half a second.
const STACKINGS: usize = 12;

impl Job {
    /// The same job, coarsely: voxels of at least 0.2 mm, at most 12 stackings an object, and no correction of the
    /// print. Layers stay as thin as they may be.
    pub fn quick(mut self) -> Self {
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
