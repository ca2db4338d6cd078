//! The transport model at the frequencies that a fit asks for.

use super::{fit::Residuals, nodes::Nodes};
use crate::optics::{FrequencyGrid, ModalReflection, ResinId, TransportOptions, VolumeCoefficients};

/// The transport model of a set of resins.
#[derive(Debug)]
pub(super) struct Tables {
    /// The frequencies that it is asked at.
    nodes: Nodes,
    /// One per channel, at the nodes.
    channels: Vec<ModalReflection>,
}

/// What a model should give at every frequency, per channel, and the roots of what each frequency weighs.
#[derive(Debug, Clone)]
pub(super) struct Goal {
    pub(super) wanted: Vec<Vec<f64>>,
    pub(super) roots: Vec<Vec<f64>>,
}

impl Tables {
    /// Tables of `resins`, index `[resin][channel]`, over `core` at the frequencies of `grid` that `nodes` chooses.
    pub(super) fn new(
        resins: &[Vec<VolumeCoefficients>],
        core: Option<ResinId>,
        grid: &FrequencyGrid,
        nodes: Nodes,
        directions: TransportOptions,
    ) -> Self {
        let chosen: Vec<f64> = nodes.indices.iter().map(|&i| grid.as_slice()[i]).collect();
        let channel = |channel: usize| {
            let resins: Vec<_> = resins.iter().map(|resin| resin[channel]).collect();
            ModalReflection::new(&resins, core.map(|core| core.0), &chosen, directions)
        };
        Self { channels: (0..resins.first().map_or(0, Vec::len)).map(channel).collect(), nodes }
    }

    /// R̂ per channel of layers from the observer down.
    pub(super) fn reflection(&self, layers: &[(usize, f64)]) -> Vec<Vec<f64>> {
        self.channels.iter().map(|channel| self.nodes.spread(&channel.reflection(layers))).collect()
    }

    pub(super) fn objective(&self, goal: &Goal, sequence: &[usize], mm: &[f64]) -> f64 {
        let layers: Vec<_> = sequence.iter().copied().zip(mm.iter().copied()).collect();
        let channels = self.reflection(&layers).into_iter().zip(&goal.wanted).zip(&goal.roots);
        let square = |((found, wanted), root): ((&f64, &f64), &f64)| (root * (found - wanted)).powi(2);
        channels.map(|((found, wanted), roots)| found.iter().zip(wanted).zip(roots).map(square).sum::<f64>()).sum()
    }

    pub(super) fn residuals(&self, goal: &Goal, sequence: &[usize], mm: &[f64]) -> Residuals {
        let layers: Vec<_> = sequence.iter().copied().zip(mm.iter().copied()).collect();
        let mut residuals = Residuals { values: Vec::new(), per_mm: vec![Vec::new(); layers.len()] };
        for ((model, wanted), roots) in self.channels.iter().zip(&goal.wanted).zip(&goal.roots) {
            let slope = model.slope(&layers);
            let reflection = self.nodes.spread(&slope.reflection);
            let off = reflection.iter().zip(wanted).zip(roots);
            residuals.values.extend(off.map(|((found, wanted), root)| root * (found - wanted)));
            for (all, per_mm) in residuals.per_mm.iter_mut().zip(&slope.per_mm) {
                all.extend(self.nodes.spread(per_mm).iter().zip(roots).map(|(slope, root)| root * slope));
            }
        }
        residuals
    }
}
