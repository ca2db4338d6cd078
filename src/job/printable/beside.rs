//! Objects that print as one piece though their meshes do not touch: no voxel's centre lies between them.

use crate::{job::PreparedObject, sdf::SliceRuns, voxel::Lattice};

/// Pairs of objects whose voxels may share faces, and those that do.
pub(super) struct Beside {
    open: Vec<[usize; 2]>,
    glued: Vec<[usize; 2]>,
    /// The last slice, by object; of none there are no voxels.
    below: Vec<SliceRuns>,
}

impl Beside {
    /// Those that lie within a voxel of each other, but for those of one of `bodies`, by their numbers.
    pub fn new(objects: &[PreparedObject], bodies: &[Vec<usize>], lattice: &Lattice) -> Self {
        let mut order: Vec<usize> = (0..objects.len()).collect();
        let low = |object: usize| objects[object].bounds[0];
        let high = |object: usize| objects[object].bounds[1] + lattice.pitch;
        order.sort_by(|&a, &b| low(a).x.total_cmp(&low(b).x));
        let mut open = Vec::new();
        for (at, &a) in order.iter().enumerate() {
            for &b in order[at + 1..].iter().take_while(|&&b| low(b).x <= high(a).x) {
                let near = low(a).cmple(high(b)).all() && low(b).cmple(high(a)).all();
                if near && !bodies.iter().any(|body| body.contains(&a) && body.contains(&b)) {
                    open.push([a.min(b), a.max(b)]);
                }
            }
        }
        Self { open, glued: Vec::new(), below: Vec::new() }
    }

    /// Looks at the next slices, by object; each has `rows` rows.
    pub fn add(&mut self, objects: &[Vec<SliceRuns>], rows: u32) {
        if self.open.is_empty() {
            return;
        }
        let Self { open, glued, below } = self;
        let slices = objects.first().map_or(0, Vec::len);
        for k in 0..slices {
            let under = |object: usize| match k {
                0 => below.get(object),
                k => objects[object].get(k - 1),
            };
            open.retain(|&[a, b]| {
                let [here, there] = [a, b].map(|object| &objects[object][k]);
                let row = |slice: Option<&SliceRuns>, j: u32, runs: &[[u32; 2]]| {
                    slice.is_some_and(|slice| meet(slice.row(j), runs, 0))
                };
                let touch = (0..rows).any(|j| {
                    meet(here.row(j), there.row(j), 1)
                        || meet(here.row(j), there.row(j + 1), 0)
                        || meet(here.row(j + 1), there.row(j), 0)
                        || row(under(a), j, there.row(j))
                        || row(under(b), j, here.row(j))
                });
                if touch {
                    glued.push([a, b]);
                }
                !touch
            });
        }
        *below = objects.iter().filter_map(|slices| slices.last().cloned()).collect();
    }

    /// The pairs that share faces, ascending.
    pub fn finish(mut self) -> Vec<[usize; 2]> {
        self.glued.sort_unstable();
        self.glued
    }
}

/// Whether runs of one row and those of another have a place in common, or, within `reach`, places that are as near.
/// Both ascend.
fn meet(one: &[[u32; 2]], other: &[[u32; 2]], reach: u32) -> bool {
    let (mut a, mut b) = (0, 0);
    while let (Some(this), Some(that)) = (one.get(a), other.get(b)) {
        if this[1] + reach <= that[0] {
            a += 1;
        } else if that[1] + reach <= this[0] {
            b += 1;
        } else {
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::meet;

    #[test]
    fn runs_meet_where_they_share_a_place_or_lie_side_by_side() {
        let runs = [[2, 5], [9, 12]];
        for (other, shared, beside) in [
            (vec![], false, false),
            (vec![[0, 2]], false, true),
            (vec![[5, 9]], false, true),
            (vec![[6, 8]], false, false),
            (vec![[0, 1], [11, 20]], true, true),
            (vec![[13, 14]], false, false),
        ] {
            assert_eq!([0, 1].map(|reach| meet(&runs, &other, reach)), [shared, beside], "{other:?}");
            assert_eq!([0, 1].map(|reach| meet(&other, &runs, reach)), [shared, beside], "{other:?}");
        }
    }
}
