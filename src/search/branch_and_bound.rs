//! The default search: the optimum of Algorithm 1 (Hašan et al. 2010, section 6) from far fewer nodes.
//!
//! Same space, same blocks, same ordering constraint; five changes, none of which can lose the optimum:
//! 1. The too-bright and too-dark bounds touch disjoint coefficients, so they are summed.
//! 2. In place of R′ = 0 and R′ = 1 stand the darkest and the brightest thing the remaining thickness can be
//!    ([`super::envelope`]).
//! 3. A child is bounded before it is composed, and children are visited in the order of their bounds.
//! 4. The last two blocks are sought together, in a tree of boxes ([`super::endings`]).
//! 5. No iterative deepening: in that order the search meets good stackings early enough. Evidence: searching short
//!    stackings first saves no time, see docs/performance.md.
//!
//! Depth-first, on one stack of preallocated spectra; a whole search allocates nothing per node.

use super::endings::{Content, EndingBox};
use super::kernels::{self, Goal, PartialStack};
use super::{BlockTable, Match, SearchError, SearchTarget};
use crate::parallel;
use crate::watch::Watch;

/// A block under a partial stacking.
#[derive(Debug, Clone, Copy)]
struct Child {
    bound: f64,
    resin: usize,
    size: usize,
}

/// The state of a partial stacking beside its spectra.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// Blocks so far.
    level: usize,
    /// Units so far.
    total: usize,
    /// Resin of the bottommost layer, its units, and the index of its last block's size.
    bottom: Option<(usize, usize, usize)>,
}

struct Search<'a> {
    table: &'a BlockTable,
    goal: Goal,
    /// Spectra of the current stacking's first 0, 1, 2 … blocks.
    stacks: Vec<PartialStack>,
    /// Surviving children per level.
    children: Vec<Vec<Child>>,
    /// Blocks of the current stacking: (resin, size index).
    path: Vec<(usize, usize)>,
    /// The best stackings so far, best first, at most `keep`.
    best: Vec<(f64, Vec<(usize, usize)>)>,
    keep: usize,
    /// Of one sequence of resins only the best is kept.
    one_per_sequence: bool,
    nodes: u64,
    max_nodes: u64,
    /// Least bound among the nodes the budget left unexplored.
    unexplored: f64,
    watch: &'a dyn Watch,
    /// At how many nodes the watch is looked at again.
    next_look: u64,
}

/// Nodes between two looks at the watch: less than a millisecond of search.
const NODES_BETWEEN_LOOKS: u64 = 256;

/// The best stacking for `target` in the table's space.
///
/// # Errors
/// A target unlike the table's resins; limits that leave no stacking; a node budget too small to find one;
/// [`SearchError::Stopped`].
pub(super) fn match_target(table: &BlockTable, target: &SearchTarget, watch: &dyn Watch) -> Result<Match, SearchError> {
    let mut best = match_candidates(table, target, 1, watch)?;
    Ok(best.swap_remove(0))
}

/// The `count` best stackings for `target`, best first, all different: for a judge more exact than Kubelka–Munk to
/// choose from. Fewer where the space holds fewer. `proven` means that none is missing.
///
/// # Errors
/// As [`match_target`].
pub(super) fn match_candidates(
    table: &BlockTable,
    target: &SearchTarget,
    count: usize,
    watch: &dyn Watch,
) -> Result<Vec<Match>, SearchError> {
    candidates(table, target, Search::new(table, table.goal(target)?, count.max(1), watch))
}

/// The best stacking of each of the `count` best sequences of resins, best first: starts for refining. The sequence is
/// that of the blocks, so two may differ in a last layer of the core's own resin only, which is not listed. `proven`
/// means that no sequence is missing.
///
/// # Errors
/// As [`match_target`].
pub(super) fn match_sequences(
    table: &BlockTable,
    target: &SearchTarget,
    count: usize,
    watch: &dyn Watch,
) -> Result<Vec<Match>, SearchError> {
    let search = Search::new(table, table.goal(target)?, count.max(1), watch);
    candidates(table, target, Search { one_per_sequence: true, ..search })
}

fn candidates(table: &BlockTable, target: &SearchTarget, mut search: Search<'_>) -> Result<Vec<Match>, SearchError> {
    let options = table.options();
    search.run();
    search.watch.go_on()?;
    if search.best.is_empty() {
        return Err(match search.unexplored.is_finite() {
            true => SearchError::Budget { nodes: search.max_nodes },
            false => SearchError::Infeasible { units: options.units, unit_mm: options.unit_mm(), depth: options.depth },
        });
    }
    let (unexplored, nodes) = (search.unexplored, search.nodes);
    let proven = unexplored.is_infinite();
    let blocks = |path: Vec<(usize, usize)>| path.into_iter().map(|(resin, size)| (resin, table.sizes[size]));
    let mut matches: Vec<Match> = std::mem::take(&mut search.best)
        .into_iter()
        .map(|(_, path)| table.answer(table.stacking(blocks(path)), target, nodes))
        .collect();
    for found in &mut matches {
        found.proven = proven;
        found.bound = if proven { found.objective } else { unexplored.min(found.objective) };
    }
    Ok(matches)
}

/// One match per target, in parallel over the targets; the answers do not depend on the number of threads.
///
/// # Errors
/// The first error in the order of the targets.
pub(super) fn match_targets(
    table: &BlockTable,
    targets: &[SearchTarget],
    watch: &dyn Watch,
) -> Result<Vec<Match>, SearchError> {
    let one = |target| match_target(table, target, watch);
    let answers: Vec<_> = parallel::map_all(targets, one);
    answers.into_iter().collect()
}

impl<'a> Search<'a> {
    fn new(table: &'a BlockTable, goal: Goal, keep: usize, watch: &'a dyn Watch) -> Self {
        let depth = table.options().depth;
        Self {
            table,
            goal,
            stacks: vec![PartialStack::empty(table.options().surface, table.lanes()); depth],
            children: vec![Vec::with_capacity(table.resins.len() * table.sizes.len()); depth],
            path: Vec::with_capacity(depth),
            best: Vec::with_capacity(keep + 1),
            keep,
            one_per_sequence: false,
            nodes: 0,
            max_nodes: table.options().max_nodes.unwrap_or(u64::MAX),
            unexplored: f64::INFINITY,
            watch,
            next_look: NODES_BETWEEN_LOOKS,
        }
    }

    fn run(&mut self) {
        let root = Node { level: 0, total: 0, bottom: None };
        if self.table.core_may_start(0) {
            let nothing = kernels::objective(&self.stacks[0], &self.table.base, &self.goal, f64::INFINITY);
            self.offer(nothing, &[]);
        }
        self.expand(root, 0.0);
    }

    /// Whether the budget is spent, or a stop was asked for, which spends it.
    fn exhausted(&mut self) -> bool {
        if self.nodes >= self.next_look {
            self.next_look = self.nodes + NODES_BETWEEN_LOOKS;
            if self.watch.stop_requested() {
                self.max_nodes = 0;
            }
        }
        self.nodes >= self.max_nodes
    }

    /// The objective to beat.
    fn to_beat(&self) -> f64 {
        if self.best.len() < self.keep { f64::INFINITY } else { self.best[self.keep - 1].0 }
    }

    /// Enters the current path, with the blocks `last` below it, among the best.
    fn offer(&mut self, objective: f64, last: &[(usize, usize)]) {
        if objective >= self.to_beat() {
            return;
        }
        let path: Vec<_> = self.path.iter().chain(last).copied().collect();
        if self.one_per_sequence
            && let Some(known) = self.best.iter().position(|(_, other)| sequence(other).eq(sequence(&path)))
        {
            if objective >= self.best[known].0 {
                return;
            }
            self.best.remove(known);
        }
        let at = self.best.partition_point(|known| known.0 <= objective);
        self.best.insert(at, (objective, path));
        self.best.truncate(self.keep);
    }

    /// Units of the bottommost layer if a block of (`resin`, `size`) is put below `node`, where that is allowed.
    #[inline]
    fn run_with(&self, node: &Node, resin: usize, size: usize) -> Option<usize> {
        let limits = &self.table.limits;
        let units = self.table.sizes[size];
        let run = match node.bottom {
            Some((bottom, run, last)) if bottom == resin => {
                if size >= last {
                    return None; // ordering: 3 is 2 + 1, never 1 + 2
                }
                run + units
            }
            Some((bottom, run, _)) if run < limits[bottom].least => return None,
            _ if node.total < limits[resin].top => return None,
            _ => units,
        };
        (node.total + units <= self.table.options().units && run <= limits[resin].most).then_some(run)
    }

    /// Looks at everything below `node`, whose spectra are `stacks[node.level]` and whose objective is at least
    /// `bound`.
    fn expand(&mut self, node: Node, bound: f64) {
        let remaining = self.table.options().depth - node.level;
        let table = self.table;
        if remaining == 2
            && let Some(all) = table.endings.boxes.len().checked_sub(1)
        {
            return self.end(&node, all, bound);
        }
        self.children[node.level].clear();
        for size in (0..table.sizes.len()).rev() {
            for resin in 0..table.resins.len() {
                let Some(run) = self.run_with(&node, resin, size) else { continue };
                let total = node.total + table.sizes[size];
                let may_end = table.may_end(resin, run, total);
                if remaining == 1 && !may_end {
                    continue;
                }
                self.nodes += 1;
                let to_beat = self.to_beat();
                if remaining > 1 {
                    let left = table.options().units - total;
                    let bound = kernels::bound(
                        &self.stacks[node.level],
                        &table.blocks[resin][size],
                        &table.darkest[left],
                        &table.brightest[left],
                        &self.goal,
                        to_beat,
                    );
                    if bound >= to_beat {
                        continue;
                    }
                    self.children[node.level].push(Child { bound, resin, size });
                }
                if may_end {
                    let below = &table.block_over_base[resin][size];
                    let objective = kernels::objective(&self.stacks[node.level], below, &self.goal, to_beat);
                    self.offer(objective, &[(resin, size)]);
                }
            }
        }
        if remaining == 1 {
            return;
        }
        let mut children = std::mem::take(&mut self.children[node.level]);
        children.sort_by(|a, b| a.bound.total_cmp(&b.bound));
        for child in &children {
            if child.bound >= self.to_beat() {
                break;
            }
            if self.exhausted() {
                self.unexplored = self.unexplored.min(child.bound);
                break;
            }
            let Some(run) = self.run_with(&node, child.resin, child.size) else { continue };
            let (above, below) = self.stacks.split_at_mut(node.level + 1);
            kernels::extend(&above[node.level], &table.blocks[child.resin][child.size], &mut below[0]);
            self.path.push((child.resin, child.size));
            let total = node.total + table.sizes[child.size];
            let bottom = Some((child.resin, run, child.size));
            self.expand(Node { level: node.level + 1, total, bottom }, child.bound);
            self.path.pop();
        }
        self.children[node.level] = children;
    }
}

impl Search<'_> {
    /// Looks at all endings of a box under `node`, whose spectra are `stacks[node.level]`; `bound` is the box's.
    fn end(&mut self, node: &Node, index: usize, bound: f64) {
        if bound >= self.to_beat() {
            return;
        }
        if self.exhausted() {
            self.unexplored = self.unexplored.min(bound);
            return;
        }
        let table = self.table;
        match &table.endings.boxes[index].content {
            Content::Endings(range) => {
                for ending in &table.endings.endings[range.clone()] {
                    self.nodes += 1;
                    let to_beat = self.to_beat();
                    let objective = kernels::objective(&self.stacks[node.level], &ending.r, &self.goal, to_beat);
                    if objective < to_beat && self.may_follow(node, &ending.blocks) {
                        self.offer(objective, &ending.blocks);
                    }
                }
            }
            &Content::Boxes(a, b) => {
                let mut bounds = [a, b].map(|inner| {
                    let EndingBox { darkest, brightest, thinnest, .. } = &table.endings.boxes[inner];
                    if node.total + thinnest > table.options().units {
                        return (f64::INFINITY, inner);
                    }
                    self.nodes += 1;
                    let stack = &self.stacks[node.level];
                    (kernels::range_bound(stack, darkest, brightest, &self.goal, self.to_beat()), inner)
                });
                if bounds[1].0 < bounds[0].0 {
                    bounds.swap(0, 1);
                }
                for (bound, inner) in bounds {
                    self.end(node, inner, bound);
                }
            }
        }
    }

    /// Whether `blocks` may lie below `node` and end the stacking.
    fn may_follow(&self, node: &Node, blocks: &[(usize, usize)]) -> bool {
        let mut below = *node;
        for &(resin, size) in blocks {
            let Some(run) = self.run_with(&below, resin, size) else { return false };
            below.total += self.table.sizes[size];
            below.bottom = Some((resin, run, size));
        }
        below.bottom.is_some_and(|(resin, run, _)| self.table.may_end(resin, run, below.total))
    }
}

/// The resins of a path, neighbours of one kind as one.
fn sequence(path: &[(usize, usize)]) -> impl Iterator<Item = usize> {
    let starts = path.iter().enumerate().filter(|&(i, block)| i == 0 || path[i - 1].0 != block.0);
    starts.map(|(_, block)| block.0)
}
