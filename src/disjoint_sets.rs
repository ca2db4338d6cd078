//! Sets that are joined and never parted (union–find with path halving). The lowest member stands for its set, so that
//! nothing depends on the order of joining.

/// Items from 0 up, each in one set.
pub(crate) struct DisjointSets(Vec<u32>);

impl DisjointSets {
    /// So many items, each alone.
    pub fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// Adds an item that is alone, and gives it back.
    pub fn push(&mut self) -> u32 {
        let item = self.0.len() as u32;
        self.0.push(item);
        item
    }

    /// The lowest item of the set that `item` is in.
    pub fn root(&mut self, mut item: u32) -> u32 {
        while self.0[item as usize] != item {
            let above = self.0[self.0[item as usize] as usize];
            self.0[item as usize] = above;
            item = above;
        }
        item
    }

    /// Makes one set of two.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_stands_for_all_in_any_order() {
        let pairs = [[7, 3], [3, 9], [9, 1], [4, 5], [1, 7]];
        for turn in 0..pairs.len() {
            let mut sets = DisjointSets::new(9);
            assert_eq!(sets.push(), 9);
            for k in 0..pairs.len() {
                let [a, b] = pairs[(k + turn) % pairs.len()];
                sets.join(a, b);
            }
            let roots: Vec<u32> = (0..10).map(|item| sets.root(item)).collect();
            assert_eq!(roots, [0, 1, 2, 1, 4, 4, 6, 1, 8, 1]);
        }
    }
}
