//! Stackings of one kind: the same slots in the same order for every target of an object, told apart by few continuous
//! numbers.
//!
//! **In:** targets, endless or of thin parts. **Out:** for each the [`FamilyAnswer`] that reflects most like it by
//! transport.
//!
//! ```text
//!   white with shares of the other inks   ≥ 0.2 mm   how dark, in which colour
//!   clear, or support                     ≥ 0 mm     how far light gets sideways
//!   white                                 ≥ 0 mm     what sends it back
//!   core
//! ```
//!
//! Layers of such a family are thick enough for any lattice, and stackings of like targets are alike: a slot of one is
//! the same slot of the other, so that thicknesses and shares between them are stackings for what lies between. No
//! order of layers is searched; [`shapes`] offers a few and the best for all targets is taken. Then every target's
//! numbers are fitted ([`solve`]) from those of a target like it ([`tree`]).
//!
//! Nothing is random, and nothing depends on the number of threads.

mod descent;
mod model;
mod shape;
mod shapes;
mod solve;
#[cfg(test)]
mod tests;
mod tree;

pub(crate) use shapes::LEAST_MIXED_MM;

use serde::{Deserialize, Serialize};

use self::{
    model::Model,
    shape::Shape,
    shapes::Offer,
    solve::{Asked, Solved, Solver, Spectra, roughly},
    tree::Places,
};
use super::{RefineOptions, SearchError, SearchOptions, SearchTarget, far_miss, refine::nodes::Nodes};
use crate::{
    optics::{
        ChannelId, FrequencyGrid, Grains, MaterialSet, Mixture, Resin, Stack, TransportOptions, VolumeCoefficients,
    },
    parallel,
    watch::Watch,
};

/// What a part of an object should reflect.
#[derive(Debug, Clone, PartialEq)]
pub struct PartTarget {
    /// The spectrum.
    pub target: SearchTarget,
    /// Half of the part's thickness, mm, where it is lit alike from both sides: the stacking ends there, and its mirror
    /// image follows. `None`: the core goes on without an end.
    pub half_thickness_mm: Option<f64>,
}

impl From<SearchTarget> for PartTarget {
    fn from(target: SearchTarget) -> Self {
        Self { target, half_thickness_mm: None }
    }
}

/// Stackings of one order of slots, for any number of targets.
pub struct Family {
    shape: Shape,
    options: SearchOptions,
    /// No layer that is there is thinner, mm; 0 where any thickness prints.
    min_layer_mm: f64,
    cheap: Model,
    expensive: Model,
}

/// The stacking of a family that reflects most like a target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FamilyAnswer {
    /// The slots from the observer down, those of no thickness too, over the core. All answers of a family have the
    /// same number of slots, and the same resins may be in each.
    pub stacking: Stack<Mixture>,
    /// R̂ per channel by transport; of a thin part as it looks under the same light from both sides.
    pub reflection: Vec<Vec<f64>>,
    /// The search's objective.
    pub objective: f64,
    /// The numbers that tell the stacking from others of its family: the slots' thicknesses, mm, then the shares of the
    /// resins in the slots of several, but the first of each.
    pub parameters: Vec<f64>,
    /// By how much they change for the natural logarithm of each channel's spectrum, to first order: channel, number.
    /// Numbers on a limit stay there.
    pub response: Vec<Vec<f64>>,
}

/// Directions of the cheap model.
const CHEAP: TransportOptions = TransportOptions { polar: 4, orders: 3 };
/// Targets that shapes are tried on, and by how much a shape that comes later must be better in the root of the
/// objective.
const TRIED: usize = 5;
const BETTER: f64 = 0.95;
/// The same of shapes whose coats take in clear, for targets that lie side by side and [`differ`]. Alone a slab gains little
/// by it (worth 0.14 for 0.15), but light goes far through such coats: squares of 3 mm in orange beside blue came out
/// 4.2 of CIEDE2000 off in the median, 2.2 without; the sample's veins in colour 1.27, 1.16 without.
const BETTER_DILUTED: f64 = 0.5;
/// Targets that are fitted from many starts too, and by how much one of those, or a neighbour's answer, must be better.
const ANCHORS: usize = 6;
const DEEPER: f64 = 0.95;
/// Neighbours whose answers are tried.
const NEIGHBOURS: usize = 4;

impl Family {
    /// The family that serves `targets` best; `None` where limits leave none. `set` must have coefficients.
    ///
    /// # Errors
    /// [`SearchError::NoCoefficients`], [`SearchError::Stopped`].
    pub fn new(
        set: &MaterialSet,
        options: &SearchOptions,
        layers: &RefineOptions,
        targets: &[PartTarget],
        watch: &dyn Watch,
    ) -> Result<Option<Self>, SearchError> {
        let resins = Resins::new(set)?;
        let models = Models { resins: &resins, core: options.core.map(|core| core.0) };
        let tried: Vec<&PartTarget> = Places::new(targets).spread(TRIED).into_iter().map(|i| &targets[i]).collect();
        let mut best: Option<(f64, Shape, Model)> = None;
        let shapes = shapes::offered(&resins.volumes, &resins.background, options, layers);
        let single = shapes.len() == 1;
        let differ = differ(targets);
        for Offer { shape, dilutes } in shapes {
            watch.go_on()?;
            if shape.limits(options, options.max_thickness_mm, false).is_none() {
                continue;
            }
            let cheap = models.cheap(&shape);
            // Nothing to compare with.
            let worth = if single { 0.0 } else { worth(&shape, &cheap, options, &tried) };
            let better = if dilutes && differ && layers.side_by_side { BETTER_DILUTED } else { BETTER };
            if best.as_ref().is_none_or(|best| worth < better * best.0) {
                best = Some((worth, shape, cheap));
            }
        }
        Ok(best.map(|(_, shape, cheap)| Self {
            expensive: models.expensive(&shape),
            cheap,
            shape,
            options: options.clone(),
            min_layer_mm: if layers.thin_below_mixtures { 0.0 } else { layers.min_layer_mm },
        }))
    }

    /// The best stacking of each target, in parallel; the answers do not depend on the number of threads. A target is a
    /// step of the stage that `watch` hears.
    ///
    /// # Errors
    /// [`SearchError::Target`] for one unlike the resins; [`SearchError::Infeasible`] where a part is too thin for the
    /// limits; [`SearchError::Stopped`].
    pub fn answers(&self, targets: &[PartTarget], watch: &dyn Watch) -> Result<Vec<FamilyAnswer>, SearchError> {
        targets.iter().try_for_each(|part| self.check(&part.target))?;
        if targets.is_empty() {
            return Ok(Vec::new());
        }
        let asked = |part: &PartTarget| Asked::new(part, &self.shape, &self.options).ok_or_else(|| self.infeasible());
        let asked: Vec<Asked> = targets.iter().map(asked).collect::<Result<_, _>>()?;
        let places = Places::new(targets);
        let solver = self.solver();
        let starts = self.starts();
        let anew = |target: usize, shift: Option<&Spectra>| -> Option<Solved> {
            // The best two valleys by the cheap model.
            let ends =
                parallel::map_all(&starts, |start| roughly(&self.shape, &self.cheap, &asked[target], start, shift));
            let mut ends: Vec<_> = ends.into_iter().flatten().collect();
            ends.sort_by(|a, b| a.1.total_cmp(&b.1));
            let solved = ends.iter().take(1).filter_map(|(x, _)| solver.solve(&asked[target], x, shift));
            solved.min_by(|a, b| a.total.total_cmp(&b.total))
        };
        let root = places.middle();
        let anchors = places.spread(ANCHORS);
        let mut solved: Vec<Option<Solved>> = vec![None; targets.len()];
        watch.go_on()?;
        solved[root] = anew(root, None);
        watch.advance(1);
        for level in places.levels(root) {
            watch.go_on()?;
            let one = |&(target, parent): &(usize, usize)| {
                let from = solved[parent].as_ref()?;
                let found = solver.solve(&asked[target], &from.x, Some(&from.shift));
                let deeper = anchors.contains(&target).then(|| anew(target, Some(&from.shift))).flatten();
                let deeper = deeper.filter(|it| found.as_ref().is_none_or(|found| it.total < DEEPER * found.total));
                deeper.or(found)
            };
            let found: Vec<_> = parallel::map_all(&level, one);
            for ((target, _), found) in level.iter().zip(found) {
                solved[*target] = found;
            }
            watch.advance(level.len() as u64);
        }
        let solved: Vec<Solved> = solved.into_iter().collect::<Option<_>>().ok_or_else(|| self.infeasible())?;
        watch.go_on()?;
        // Fits end in the nearest valley: a neighbour may stand in a deeper one.
        let again = |target: usize| {
            let own = &solved[target];
            if asked[target].is_far(own) {
                let found = anew(target, Some(&own.shift)).filter(|found| found.total < DEEPER * own.total);
                return found;
            }
            let of = |i: usize| (solver.borrowed(&asked[target], own, &solved[i].x), i);
            let best = places.neighbours(target, NEIGHBOURS).into_iter().map(of).min_by(|a, b| a.0.total_cmp(&b.0));
            let (_, neighbour) = best.filter(|(total, _)| *total < DEEPER * own.total)?;
            let found = solver.solve(&asked[target], &solved[neighbour].x, Some(&own.shift))?;
            (found.total < DEEPER * own.total).then_some(found)
        };
        let answer = |target: usize| {
            let found = again(target).unwrap_or_else(|| solved[target].clone());
            let (asked, found) = self.printable(&asked[target], found);
            self.answer(&asked, &found)
        };
        Ok(parallel::map(targets.len(), answer))
    }

    /// The answer without layers that are too thin: each is left out or made as thick as it must be, whichever the rest
    /// makes up for better.
    fn printable(&self, asked: &Asked, found: Solved) -> (Asked, Solved) {
        let solver = self.solver();
        let least_mm = self.min_layer_mm;
        let (mut asked, mut found) = (asked.clone(), found);
        while let Some(thin) = self.shape.thin_slot(&found.x, least_mm) {
            let ways = asked.without_or_with(thin, least_mm);
            let solved = ways.into_iter().filter_map(|asked| {
                let solved = solver.solve(&asked, &found.x, Some(&found.shift))?;
                Some((asked, solved))
            });
            // Where the limits allow neither, it stays thin.
            let Some(better) = solved.min_by(|a, b| a.1.total.total_cmp(&b.1.total)) else { break };
            (asked, found) = better;
        }
        (asked, found)
    }

    /// The stacking of given numbers, in the order of [`FamilyAnswer::parameters`], brought within the limits;
    /// layers that are too thin are left as they are.
    ///
    /// # Errors
    /// [`SearchError::Infeasible`] where nothing keeps the limits.
    pub fn stacking(&self, parameters: &[f64], part: &PartTarget) -> Result<Stack<Mixture>, SearchError> {
        let asked = Asked::new(part, &self.shape, &self.options).ok_or_else(|| self.infeasible())?;
        let mut x = asked.within(parameters).ok_or_else(|| self.infeasible())?;
        self.shape.tidy(&mut x);
        Ok(self.shape.stacking(&x, self.options.core))
    }

    fn answer(&self, asked: &Asked, found: &Solved) -> FamilyAnswer {
        FamilyAnswer {
            stacking: self.shape.stacking(&found.x, self.options.core),
            reflection: found.reflection.clone(),
            objective: found.objective,
            parameters: found.x.clone(),
            response: self.solver().response(asked, found),
        }
    }

    fn solver(&self) -> Solver<'_> {
        Solver { shape: &self.shape, cheap: &self.cheap, expensive: &self.expensive }
    }

    fn starts(&self) -> Vec<Vec<f64>> {
        shapes::starts(&self.shape)
    }

    fn check(&self, target: &SearchTarget) -> Result<(), SearchError> {
        let (expected_channels, expected_coefficients) = self.expensive.size();
        let unlike = target.channels.iter().find(|channel| channel.len() != expected_coefficients);
        if target.channels.len() != expected_channels || unlike.is_some() {
            return Err(SearchError::Target {
                channels: target.channels.len(),
                coefficients: unlike.or(target.channels.first()).map_or(0, Vec::len),
                expected_channels,
                expected_coefficients,
            });
        }
        for (channel, values) in target.channels.iter().enumerate() {
            if let Some(index) = values.iter().position(|value| !value.is_finite()) {
                let channel = ChannelId(channel);
                return Err(SearchError::TargetValue { channel, index, found: values[index] });
            }
        }
        Ok(())
    }

    fn infeasible(&self) -> SearchError {
        let SearchOptions { units, depth, .. } = self.options;
        SearchError::Infeasible { units, unit_mm: self.options.unit_mm(), depth }
    }
}

/// Whether the darkest and the lightest of the targets are far apart in some channel.
fn differ(targets: &[PartTarget]) -> bool {
    let channels = targets.first().map_or(0, |part| part.target.channels.len());
    let extremes = |channel: usize| {
        let albedos = targets.iter().filter_map(move |part| part.target.channels.get(channel)?.first());
        albedos.fold([f64::INFINITY, 0.0_f64], |[least, most], albedo| [least.min(*albedo), most.max(*albedo)])
    };
    far_miss((0..channels).map(extremes)).is_some()
}

/// What a family needs to know of a set.
struct Resins {
    /// Index `[resin][channel]`.
    volumes: Vec<Vec<VolumeCoefficients>>,
    background: Vec<bool>,
    grains: Grains,
    grid: FrequencyGrid,
}

impl Resins {
    fn new(set: &MaterialSet) -> Result<Self, SearchError> {
        let volumes =
            |resin: &Resin| resin.volumes().ok_or_else(|| SearchError::NoCoefficients { resin: resin.name.clone() });
        Ok(Self {
            volumes: set.resins.iter().map(volumes).collect::<Result<_, _>>()?,
            background: set.resins.iter().map(|resin| resin.print_as_background).collect(),
            grains: set.grains,
            grid: set.grid.clone(),
        })
    }
}

/// What both models of any shape are made of.
struct Models<'a> {
    resins: &'a Resins,
    core: Option<usize>,
}

impl Models<'_> {
    fn cheap(&self, shape: &Shape) -> Model {
        Model::new(shape, self.resins, self.core, Nodes::few(self.resins.grid.len()), CHEAP)
    }

    fn expensive(&self, shape: &Shape) -> Model {
        let nodes = Nodes::new(self.resins.grid.len());
        Model::new(shape, self.resins, self.core, nodes, TransportOptions::REFLECTION)
    }
}

/// How far a shape's stackings are from the targets: the mean root of what is minimised.
fn worth(shape: &Shape, cheap: &Model, options: &SearchOptions, targets: &[&PartTarget]) -> f64 {
    let starts = shapes::starts(shape);
    let one = |part: &&PartTarget| {
        let Some(asked) = Asked::new(part, shape, options) else { return f64::INFINITY };
        let ends = parallel::map_all(&starts, |start| roughly(shape, cheap, &asked, start, None));
        ends.into_iter().flatten().map(|(_, total)| total.sqrt()).fold(f64::INFINITY, f64::min)
    };
    let all: Vec<f64> = parallel::map_all(targets, one);
    all.iter().sum::<f64>() / all.len() as f64
}
