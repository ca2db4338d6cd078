//! The transport model of a shape's stackings, cheap or expensive.

use super::{
    Resins,
    shape::{Shape, Slot},
};
use crate::{
    optics::{Base, Grains, LayeredReflection, TransportOptions, VolumeCoefficients},
    search::{
        objective::ColourError,
        refine::{fit::Residuals, nodes::Nodes},
    },
};

/// What lies below a shape's slots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Below {
    /// The core, or nothing, without an end.
    Endless,
    /// The core up to the middle of a part so many mm thick, lit alike from both sides.
    Middle(f64),
}

/// What a model should give at every frequency, per channel, and the roots of what each frequency weighs.
#[derive(Debug, Clone)]
pub(super) struct Goal {
    pub wanted: Vec<Vec<f64>>,
    pub roots: Vec<Vec<f64>>,
    /// How errors of the albedo count in place of their roots, if as a colour.
    pub colour: Option<ColourError>,
}

/// One of the models.
pub(super) struct Model {
    nodes: Nodes,
    grains: Grains,
    channels: Vec<Channel>,
}

struct Channel {
    resins: Vec<VolumeCoefficients>,
    endless: LayeredReflection,
    /// With the core as a layer over a mirror.
    middle: Option<LayeredReflection>,
}

impl Model {
    pub fn new(shape: &Shape, resins: &Resins, core: Option<usize>, nodes: Nodes, options: TransportOptions) -> Self {
        let (grid, grains, resins) = (&resins.grid, resins.grains, &resins.volumes);
        let k: Vec<f64> = nodes.indices.iter().map(|&i| grid.as_slice()[i]).collect();
        let channel = |channel: usize| {
            let resins: Vec<_> = resins.iter().map(|resin| resin[channel]).collect();
            let pure = |slot: &Slot| match slot.resins[..] {
                [resin] => Some(resins[resin]),
                _ => None,
            };
            let layers: Vec<_> = shape.slots.iter().map(pure).collect();
            let indices: Vec<f64> = shape.slots.iter().map(|slot| resins[slot.resins[0]].refractive_index).collect();
            let over = |layers: &[_], base| LayeredReflection::new(layers, &indices, base, &k, options);
            let middle = core.map(|core| {
                let layers: Vec<_> = layers.iter().copied().chain([Some(resins[core])]).collect();
                over(&layers, Base::Mirror)
            });
            let base = core.map_or(Base::Nothing, |core| Base::HalfSpace(resins[core]));
            Channel { endless: over(&layers, base), middle, resins }
        };
        Self { channels: (0..resins.first().map_or(0, Vec::len)).map(channel).collect(), nodes, grains }
    }

    /// Channels, and coefficients of each.
    pub fn size(&self) -> (usize, usize) {
        (self.channels.len(), self.nodes.indices.last().map_or(0, |last| last + 1))
    }

    /// R̂ per channel.
    pub fn reflection(&self, shape: &Shape, x: &[f64], below: Below) -> Vec<Vec<f64>> {
        let one = |channel: &Channel| {
            let mixtures: Vec<_> =
                shape.mixed(x, &channel.resins, self.grains).into_iter().map(|mixed| mixed.volume).collect();
            let (model, mm) = channel.model(shape, x, below);
            self.nodes.spread(&model.reflection(&mm, &mixtures))
        };
        self.channels.iter().map(one).collect()
    }

    /// How far R̂ is from the goal, weighted, with slopes in the numbers of the stacking.
    pub fn residuals(&self, shape: &Shape, x: &[f64], below: Below, goal: &Goal) -> Residuals {
        let mut residuals = Residuals { values: Vec::new(), per_mm: vec![Vec::new(); shape.len()] };
        for ((channel, wanted), roots) in self.channels.iter().zip(&goal.wanted).zip(&goal.roots) {
            let (model, mm) = channel.model(shape, x, below);
            let slope = model.slope(&mm, &shape.mixed(x, &channel.resins, self.grains));
            let reflection = self.nodes.spread(&slope.reflection);
            let off = reflection.iter().zip(wanted).zip(roots);
            residuals.values.extend(off.map(|((found, wanted), root)| root * (found - wanted)));
            // A thicker slot leaves less room for the core.
            let core = slope.per_mm.get(shape.slots.len());
            let thicker = slope.per_mm.iter().take(shape.slots.len()).map(|per_mm| match core {
                Some(core) => per_mm.iter().zip(core).map(|(slot, core)| slot - core).collect(),
                None => per_mm.clone(),
            });
            let all = thicker.chain(slope.along.iter().flatten().cloned());
            for (slopes, at_nodes) in residuals.per_mm.iter_mut().zip(all) {
                slopes.extend(self.nodes.spread(&at_nodes).iter().zip(roots).map(|(slope, root)| root * slope));
            }
        }
        if let Some(colour) = &goal.colour {
            goal.colour_residuals(colour, &mut residuals);
        }
        residuals
    }
}

impl Goal {
    /// Puts the errors of the colour in the place of those of the albedo.
    fn colour_residuals(&self, colour: &ColourError, residuals: &mut Residuals) {
        let firsts = self.firsts();
        let roots: [f64; 3] = std::array::from_fn(|channel| self.roots[channel][0]);
        let albedo = std::array::from_fn(|i| colour.asked[i] + residuals.values[firsts[i]] / roots[i]);
        let slopes = colour.slopes(albedo);
        firsts.iter().zip(colour.residuals(albedo)).for_each(|(&at, residual)| residuals.values[at] = residual);
        for of_number in &mut residuals.per_mm {
            let along: [f64; 3] = std::array::from_fn(|channel| of_number[firsts[channel]] / roots[channel]);
            for (i, &at) in firsts.iter().enumerate() {
                of_number[at] = (0..3).map(|channel| slopes[channel][i] * along[channel]).sum();
            }
        }
    }

    /// Where the albedos of three channels stand among all residuals.
    pub fn firsts(&self) -> [usize; 3] {
        let len = self.wanted.first().map_or(0, Vec::len);
        [0, len, 2 * len]
    }
}

impl Channel {
    fn model(&self, shape: &Shape, x: &[f64], below: Below) -> (&LayeredReflection, Vec<f64>) {
        let mut mm: Vec<f64> = x[..shape.slots.len()].iter().map(|mm| mm.max(0.0)).collect();
        match (below, &self.middle) {
            (Below::Middle(half_mm), Some(model)) => {
                mm.push((half_mm - mm.iter().sum::<f64>()).max(0.0));
                (model, mm)
            }
            _ => (&self.endless, mm),
        }
    }
}
