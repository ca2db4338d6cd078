//! Every way to end a stacking in at most two blocks, in a tree of boxes: the last two levels of the search at once.
//!
//! Two levels from the bottom the resins' freedom is small: a few thousand endings, each a spectrum of its reflection
//! on the core. The envelope ([`super::envelope`]) lets every coefficient of every channel choose resins of its own,
//! which in colour is nearly everything between black and white. A box around a few like endings is far smaller, and
//! the same bound holds for it: nothing in the box reflects less than its darkest or more than its brightest,
//! coefficient by coefficient. So under a partial stacking the tree is descended, nearer box first, and whole boxes of
//! endings are dropped at once.

use super::BlockTable;
use crate::optics::ResinId;

/// Endings in a box that is not divided further: a box costs two looks at an ending, and memory. Not tuned.
const LEAF: usize = 4;

/// More endings than this are not listed: 90 blocks have 8,100, and 20,000 in three channels take 120 MB. The search
/// then goes on block by block.
const MOST: usize = 20_000;

/// One way to end.
pub(super) struct Ending {
    /// (resin, size index), top first; one or two blocks.
    pub blocks: Vec<(usize, usize)>,
    /// R̂ on the core, by lane.
    pub r: Vec<f64>,
}

/// Endings that are alike.
pub(super) struct EndingBox {
    /// Least R̂ in the box, by lane.
    pub darkest: Vec<f64>,
    /// Greatest R̂.
    pub brightest: Vec<f64>,
    /// Units of the thinnest.
    pub thinnest: usize,
    /// What is in it.
    pub content: Content,
}

/// What a box holds.
pub(super) enum Content {
    /// Indices of two smaller boxes.
    Boxes(usize, usize),
    /// A stretch of endings.
    Endings(std::ops::Range<usize>),
}

/// The tree. The last box holds all; there is none where nothing may end, or too much.
pub(super) struct Endings {
    /// In the order of the leaves.
    pub endings: Vec<Ending>,
    /// Children before their parents.
    pub boxes: Vec<EndingBox>,
}

impl Endings {
    /// All endings that `table`'s ordering, thickness and core allow.
    pub(super) fn new(table: &BlockTable) -> Self {
        let mut endings = Vec::new();
        if (table.resins.len() * table.sizes.len()).pow(2) > MOST {
            return Self { endings, boxes: Vec::new() };
        }
        let may_end = |resin: usize| table.options().core != Some(ResinId(resin));
        for last in (0..table.resins.len()).filter(|&resin| may_end(resin)) {
            for size in 0..table.sizes.len() {
                let r = &table.block_over_base[last][size];
                endings.push(Ending { blocks: vec![(last, size)], r: r.clone() });
                for above in 0..table.resins.len() {
                    for above_size in 0..table.sizes.len() {
                        let ordered = above != last || size < above_size;
                        if ordered && table.sizes[size] + table.sizes[above_size] <= table.options().units {
                            let r = table.over(above, above_size, r);
                            endings.push(Ending { blocks: vec![(above, above_size), (last, size)], r });
                        }
                    }
                }
            }
        }
        let mut tree = Self { endings: Vec::with_capacity(endings.len()), boxes: Vec::new() };
        if !endings.is_empty() {
            tree.divide(table, endings);
        }
        tree
    }

    /// Makes a box of `endings` and the boxes in it; its index.
    fn divide(&mut self, table: &BlockTable, mut endings: Vec<Ending>) -> usize {
        let lanes = endings[0].r.len();
        let (mut darkest, mut brightest) = (vec![f64::INFINITY; lanes], vec![f64::NEG_INFINITY; lanes]);
        for ending in &endings {
            darkest.iter_mut().zip(&ending.r).for_each(|(least, r)| *least = least.min(*r));
            brightest.iter_mut().zip(&ending.r).for_each(|(most, r)| *most = most.max(*r));
        }
        let units = |ending: &Ending| ending.blocks.iter().map(|block| table.sizes[block.1]).sum();
        let thinnest = endings.iter().map(units).min().unwrap_or(0);
        let content = if endings.len() <= LEAF {
            let start = self.endings.len();
            self.endings.append(&mut endings);
            Content::Endings(start..self.endings.len())
        } else {
            let spread = |lane: &usize| brightest[*lane] - darkest[*lane];
            let widest = (0..lanes).max_by(|a, b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
            // Stable, so that the order is the same on every machine.
            endings.sort_by(|a, b| a.r[widest].total_cmp(&b.r[widest]));
            let bright = endings.split_off(endings.len() / 2);
            Content::Boxes(self.divide(table, endings), self.divide(table, bright))
        };
        self.boxes.push(EndingBox { darkest, brightest, thinnest, content });
        self.boxes.len() - 1
    }
}
