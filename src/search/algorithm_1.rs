//! Algorithm 1 of Hašan et al. 2010 as printed: the reference the faster search is held against.
//!
//! Two things differ from the page. The too-dark bound uses 1 − R̂∩, as Algorithm 1 has it and equation 6 demands;
//! section 6.3's text misprints 1 − R̂∪. And the objective counts the core under the stacking and keeps the resins'
//! limits, neither of which the paper's bounds mind: the core is one more layer, and a limit only removes stackings.

use super::{BlockTable, Match, SearchError, SearchTarget};
use crate::optics::{Composite, KubelkaMunk, ResinId};

/// A partial stacking.
struct Node {
    /// (resin, units) of each block, top first.
    blocks: Vec<(usize, usize)>,
    /// Units in all.
    thickness: usize,
    /// Units of the bottommost resin in one piece.
    run: usize,
    /// Spectra per channel.
    stack: Vec<Composite>,
}

struct Search<'a> {
    table: &'a BlockTable,
    target: &'a SearchTarget,
    /// Weights of the coefficients, per channel.
    weights: Vec<Vec<f64>>,
    /// Half-space below, per channel.
    base: Vec<Vec<f64>>,
    /// (resin, units, spectra per channel), thickest first.
    blocks: Vec<(usize, usize, Vec<Composite>)>,
    optimal_objective: f64,
    optimal_node: Option<Vec<(usize, usize)>>,
    nodes: u64,
}

/// The best stacking for `target` by the paper's Algorithm 1. Slow: for checks and comparisons. Ignores `max_nodes`.
///
/// # Errors
/// A target unlike the table's resins; limits that leave no stacking.
pub(super) fn algorithm_1(table: &BlockTable, target: &SearchTarget) -> Result<Match, SearchError> {
    table.goal(target)?;
    let options = table.options();
    let base = match options.core {
        Some(core) => table.resins[core.0].iter().map(|channel| channel.half_space()).collect(),
        None => vec![vec![0.0; table.coefficients()]; table.channels()],
    };
    let blocks = table
        .sizes
        .iter()
        .rev()
        .flat_map(|&units| (0..table.resins.len()).map(move |resin| (resin, units)))
        .map(|(resin, units)| {
            let slab = |channel: &KubelkaMunk| channel.slab(units as f64 * options.unit_mm());
            (resin, units, table.resins[resin].iter().map(|channel| Composite::from_slab(&slab(channel))).collect())
        })
        .collect();
    let root = Node {
        blocks: Vec::new(),
        thickness: 0,
        run: 0,
        stack: vec![options.surface.surface(table.coefficients()); table.channels()],
    };
    let weights = target.channels.iter().map(|channel| options.objective.weights(channel)).collect();
    let mut search =
        Search { table, target, weights, base, blocks, optimal_objective: f64::INFINITY, optimal_node: None, nodes: 0 };
    for depth in 1..=options.depth {
        search.search(&root, depth);
    }
    let unit_mm = options.unit_mm();
    let infeasible = SearchError::Infeasible { units: options.units, unit_mm, depth: options.depth };
    let optimal = search.optimal_node.ok_or(infeasible)?;
    Ok(table.answer(table.stacking(optimal.into_iter()), target, search.nodes))
}

impl Search<'_> {
    fn search(&mut self, node: &Node, depth: usize) {
        self.nodes += 1;
        let here = self.objective(node);
        if here < self.optimal_objective {
            self.optimal_objective = here;
            self.optimal_node = Some(node.blocks.clone());
        }
        if depth == 0 || self.bound(node) > self.optimal_objective {
            return;
        }
        for index in 0..self.blocks.len() {
            let Some(child) = self.extend(node, index) else { continue };
            self.search(&child, depth - 1);
        }
    }

    /// The node with a block below it, unless ordering, thickness or a limit forbids.
    fn extend(&self, node: &Node, block: usize) -> Option<Node> {
        let (resin, units, spectra) = &self.blocks[block];
        let (resin, units) = (*resin, *units);
        let limits = &self.table.limits;
        let mut run = units;
        match node.blocks.last() {
            Some(&(bottom, bottom_units)) if bottom == resin => {
                if units >= bottom_units {
                    return None; // ordering constraint failed
                }
                run += node.run;
            }
            Some(&(bottom, _)) if node.run < limits[bottom].least => return None,
            _ if node.thickness < limits[resin].top => return None,
            _ => {}
        }
        if units + node.thickness > self.table.options().units {
            return None; // thickness constraint failed
        }
        if run > limits[resin].most {
            return None;
        }
        let mut blocks = node.blocks.clone();
        blocks.push((resin, units));
        let stack = node.stack.iter().zip(spectra).map(|(above, below)| above.over(below)).collect();
        Some(Node { blocks, thickness: node.thickness + units, run, stack })
    }

    fn objective(&self, node: &Node) -> f64 {
        let may_end = match node.blocks.last() {
            None => self.table.core_may_start(0),
            // The core's own resin may always end: it goes on below.
            Some(&(bottom, _)) if self.table.options().core == Some(ResinId(bottom)) => true,
            Some(&(bottom, _)) => self.table.may_end(bottom, node.run, node.thickness),
        };
        if !may_end {
            return f64::INFINITY;
        }
        let reflection: Vec<Vec<f64>> =
            node.stack.iter().zip(&self.base).map(|(stack, base)| stack.reflection_over(base)).collect();
        self.table.options().objective.of(&reflection, self.target)
    }

    fn bound(&self, node: &Node) -> f64 {
        let (mut too_bright, mut too_dark) = (0.0, 0.0);
        for ((stack, target), weights) in node.stack.iter().zip(&self.target.channels).zip(&self.weights) {
            let brightest = stack.reflection_over(&vec![1.0; target.len()]);
            for (i, (target, weight)) in target.iter().zip(weights).enumerate() {
                too_bright += weight * (stack.reflection_top[i] - target).max(0.0).powi(2);
                too_dark += weight * (target - brightest[i]).max(0.0).powi(2);
            }
        }
        f64::max(too_bright, too_dark)
    }
}
