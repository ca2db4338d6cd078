//! What is left of a print once support is washed off: everything that is printed, and the support that water does not
//! come to.
//!
//! ```text
//!      ███████████████          ███████████████
//!      ░░░░░░░░░░░░░░░          █░░░░░░░░░░░░░█        ░ what prints as background
//!      ███████████████          ███████████████
//!    comes out at the sides    is closed in: it stays, and holds
//!    and leaves two sheets     what it lies between
//! ```
//!
//! Runs of voxels along rows, printed ones and the others alike, are gathered in sets as in [`super::pieces`]; a set of
//! background that reaches the lattice's sides is washed off, and any other joins what it touches.

use serde::Serialize;

use super::{
    Walls,
    pieces::{LoosePiece, Part, Pieces},
};
use crate::{
    disjoint_sets::DisjointSets,
    job::{Prepared, RunError, file::DepthFrom},
    watch::Watch,
};

/// What is left where support is washed off.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Washed {
    /// Pieces, but for crumbs.
    pub pieces: u64,
    /// Those that are no object's largest, the first 256, from below.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub loose: Vec<LoosePiece>,
}

/// A run with the set it is in, and whether it is printed.
#[derive(Debug, Clone, Copy)]
struct Run {
    start: u32,
    end: u32,
    label: u32,
    printed: bool,
}

/// Sets of printed voxels and of others, that grow slice by slice.
struct Washing {
    dims: [u32; 3],
    sets: DisjointSets,
    parts: Vec<(Part, bool)>,
    /// Pairs of sets, one printed and the other not, that touch.
    touching: Vec<[u32; 2]>,
    /// Runs of the slice below, row by row.
    below: Vec<Vec<Run>>,
}

impl Washing {
    fn new(dims: [u32; 3]) -> Self {
        let below = vec![Vec::new(); dims[1] as usize];
        Self { dims, sets: DisjointSets::new(0), parts: Vec::new(), touching: Vec::new(), below }
    }

    /// Adds the next slice; `fill` says for every voxel of a row whether it is printed.
    fn add(&mut self, k: u32, mut fill: impl FnMut(u32, &mut [bool])) {
        let mut before: Vec<Run> = Vec::new();
        let mut row = vec![false; self.dims[0] as usize];
        for j in 0..self.dims[1] {
            fill(j, &mut row);
            let under = std::mem::take(&mut self.below[j as usize]);
            let mut here: Vec<Run> = Vec::new();
            let mut starts = [0, 0];
            let mut start = 0;
            for of_run in row.chunk_by(|a, b| a == b) {
                let (end, printed) = (start + of_run.len() as u32, of_run[0]);
                let mut label = None;
                let mut others = Vec::new();
                for (neighbours, first) in [&before, &under].into_iter().zip(&mut starts) {
                    while neighbours.get(*first).is_some_and(|run| run.end <= start) {
                        *first += 1;
                    }
                    for run in neighbours[*first..].iter().take_while(|run| run.start < end) {
                        match label {
                            _ if run.printed != printed => others.push(run.label),
                            None => label = Some(run.label),
                            Some(known) => self.sets.join(known, run.label),
                        }
                    }
                }
                others.extend(here.last().map(|run| run.label));
                let part = Part { voxels: u64::from(end - start), low: [start, j, k], high: [end, j + 1, k + 1] };
                let label = label.unwrap_or_else(|| {
                    self.parts.push((Part { voxels: 0, ..part }, printed));
                    self.sets.push()
                });
                self.parts[label as usize].0.add(&part);
                let pair = |other: u32| if printed { [label, other] } else { [other, label] };
                self.touching.extend(others.into_iter().map(pair));
                here.push(Run { start, end, label, printed });
                start = end;
            }
            self.below[j as usize] = here.clone();
            before = here;
        }
        // Most touch along many runs.
        for pair in &mut self.touching {
            *pair = pair.map(|label| self.sets.root(label));
        }
        self.touching.sort_unstable();
        self.touching.dedup();
    }

    /// What every set comes to, at its root.
    fn gathered(&mut self) -> Vec<Option<(Part, bool)>> {
        let mut gathered: Vec<Option<(Part, bool)>> = vec![None; self.parts.len()];
        for label in 0..self.parts.len() as u32 {
            let (part, printed) = self.parts[label as usize];
            match &mut gathered[self.sets.root(label) as usize] {
                Some((sum, of_any)) => {
                    sum.add(&part);
                    *of_any |= printed;
                }
                empty => *empty = Some((part, printed)),
            }
        }
        gathered
    }

    /// What is left, in pieces.
    fn finish(mut self) -> Vec<Part> {
        let dims = self.dims;
        let is_open = |part: &Part| (0..3).any(|axis| part.low[axis] == 0 || part.high[axis] == dims[axis]);
        let gathered = self.gathered();
        let stays = |label: u32| gathered[label as usize].is_some_and(|(part, printed)| printed || !is_open(&part));
        for [print, other] in std::mem::take(&mut self.touching) {
            let [print, other] = [print, other].map(|label| self.sets.root(label));
            // A root that was joined before stays, or it were none.
            if stays(other) {
                self.sets.join(print, other);
            }
        }
        let printed = |(part, printed): (Part, bool)| printed.then_some(part);
        self.gathered().into_iter().flatten().filter_map(printed).collect()
    }
}

impl Prepared {
    /// What is left where support is washed off; `None` where water comes to none, for it lies nowhere bare: closed in
    /// on all sides where depth is measured from the whole surface, and at the sides where it is from the top.
    pub(super) fn washed(&self, walls: &[Walls], watch: &dyn Watch) -> Result<Option<Washed>, RunError> {
        let comes_out = |object: usize| {
            let layers = || self.objects[object].stackings.stacks_of_labels().flat_map(|stack| stack.layers);
            let from_top = self.job.objects[object].depth_from == DepthFrom::Top;
            walls[object].bare_share > 0.0 || from_top && layers().any(|layer| self.is_background(&layer.resin))
        };
        if !(0..self.objects.len()).any(comes_out) {
            return Ok(None);
        }
        let lattice = &self.lattice;
        let mut washing = Washing::new(lattice.dims);
        let mut ids = vec![0; lattice.dims[0] as usize];
        self.slicer().for_each_slab(0..lattice.dims[2], |slab| {
            for k in slab.slices() {
                washing.add(k, |j, row| {
                    slab.read_row(j, k, &mut ids);
                    for (printed, &id) in row.iter_mut().zip(&ids) {
                        *printed = self.palette[usize::from(id)][3] != 0;
                    }
                });
            }
            watch.go_on()
        })?;
        let Pieces { count, crumbs, loose, .. } = Pieces::of(washing.finish(), lattice, &self.boxes_of_objects());
        Ok(Some(Washed { pieces: count - crumbs, loose }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Voxels of every piece that is left of slices of rows of text, `#` printed.
    fn left(slices: &[&[&str]]) -> Vec<u64> {
        let dims = [slices[0][0].len(), slices[0].len(), slices.len()].map(|count| count as u32);
        let mut washing = Washing::new(dims);
        for (k, slice) in (0..).zip(slices) {
            washing.add(k, |j, row| {
                let text = slice[j as usize].as_bytes();
                row.iter_mut().zip(text).for_each(|(printed, sign)| *printed = *sign == b'#');
            });
        }
        let mut left: Vec<_> = washing.finish().iter().map(|part| part.voxels).collect();
        left.sort_unstable();
        left
    }

    #[test]
    fn what_is_closed_in_stays_and_holds() {
        let (full, open): (&[&str], &[&str]) = (&["#####"; 5], &["....."; 5]);
        // A sheet that comes out at the sides.
        assert_eq!(left(&[full, open, full]), [25, 25]);
        // One that is closed in, alone and around a core.
        let closed: &[&str] = &["#####", "#...#", "#...#", "#...#", "#####"];
        let core: &[&str] = &["#####", "#...#", "#.#.#", "#...#", "#####"];
        assert_eq!(left(&[full, closed, full]), [75]);
        assert_eq!(left(&[full, closed, core, closed, full]), [125]);
        // A hole in the rim lets water in: the core falls out of its shell.
        let hole: &[&str] = &["#####", "#....", "#...#", "#...#", "#####"];
        assert_eq!(left(&[full, closed, core, hole, full]), [1, 97]);
        assert!(left(&[open, open]).is_empty());
    }
}
