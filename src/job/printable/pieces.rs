//! What hangs together: voxels inside of objects that share a face, counted by runs along rows.
//!
//! ```text
//!   slice k − 1, row j     ████      ███
//!   slice k, row j − 1        ████████        a run joins the sets of those that it overlaps in the row before it and
//!   slice k, row j         ███     ██         in the same row of the slice below
//! ```
//!
//! Voxels that touch along an edge only are not held together: a drop of resin is.

use glam::DVec3;
use serde::Serialize;

use super::beside::Beside;
use crate::{
    disjoint_sets::DisjointSets,
    job::{Prepared, RunError},
    parallel,
    sdf::{SliceRuns, merge_runs},
    slice::ObjectField,
    voxel::{BlockShape, Lattice},
    watch::Watch,
};

/// Pieces of a print.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Pieces {
    /// How many there are, crumbs among them.
    pub count: u64,
    /// Those of less than a cubic millimetre.
    pub crumbs: u64,
    /// Their volume, mm³.
    pub crumbs_mm3: f64,
    /// The middle of the lowest, mm in the lattice's frame.
    pub first_crumb_mm: Option<[f64; 3]>,
    /// Other pieces that begin above the lowest slice.
    pub in_the_air: u64,
    /// Pieces besides crumbs that are no object's largest, the first [`MOST_LOOSE`], from below.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub loose: Vec<LoosePiece>,
    /// Pairs of objects, by their numbers from 0, whose voxels share faces though their meshes do not touch.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub glued: Vec<[usize; 2]>,
    /// Corners of the boxes around crumbs, the first [`MOST_BOXES`], for the picture.
    #[serde(skip)]
    pub(in crate::job) boxes: Vec<[DVec3; 2]>,
}

/// A piece that holds to nothing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LoosePiece {
    /// Its volume, mm³.
    pub mm3: f64,
    /// Least corner of the box around it, mm in the lattice's frame.
    pub low_mm: [f64; 3],
    /// Greatest corner.
    pub high_mm: [f64; 3],
}

impl LoosePiece {
    /// Corners of the box around it.
    pub(super) fn corners(&self) -> [DVec3; 2] {
        [self.low_mm, self.high_mm].map(DVec3::from)
    }

    /// How large it is and where.
    pub(super) fn words(&self) -> String {
        let [low, high] = self.corners();
        let size = high - low;
        format!(
            "{:.1} mm³ within {:.1} × {:.1} × {:.1} mm at {}",
            self.mm3,
            size.x,
            size.y,
            size.z,
            super::words::at((0.5 * (low + high)).to_array())
        )
    }
}

/// What is smaller is a crumb, mm³.
const CRUMB_MM3: f64 = 1.0;
/// Boxes that are kept.
pub(super) const MOST_BOXES: usize = 4096;
/// Loose pieces that are kept.
pub(super) const MOST_LOOSE: usize = 256;

/// What is known of a set of runs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    pub voxels: u64,
    pub low: [u32; 3],
    pub high: [u32; 3],
}

impl Part {
    pub fn add(&mut self, other: &Self) {
        self.voxels += other.voxels;
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(other.low[axis]);
            self.high[axis] = self.high[axis].max(other.high[axis]);
        }
    }
}

/// A run with the set it is in.
type Labelled = ([u32; 2], u32);

/// Sets that grow slice by slice.
struct Growing {
    sets: DisjointSets,
    parts: Vec<Part>,
    /// Runs of the slice below, row by row.
    below: Vec<Vec<Labelled>>,
}

impl Growing {
    fn new(rows: u32) -> Self {
        Self { sets: DisjointSets::new(0), parts: Vec::new(), below: vec![Vec::new(); rows as usize] }
    }

    /// Adds the next slice; `row` gives the runs of a row, ascending and apart.
    fn add(&mut self, k: u32, mut row: impl FnMut(u32, &mut Vec<[u32; 2]>)) {
        let mut before: Vec<Labelled> = Vec::new();
        let mut runs = Vec::new();
        for j in 0..self.below.len() as u32 {
            runs.clear();
            row(j, &mut runs);
            let under = std::mem::take(&mut self.below[j as usize]);
            let mut here = Vec::with_capacity(runs.len());
            let mut starts = [0, 0];
            for &[start, end] in &runs {
                let mut label = None;
                for (neighbours, first) in [&before, &under].into_iter().zip(&mut starts) {
                    while neighbours.get(*first).is_some_and(|(run, _)| run[1] <= start) {
                        *first += 1;
                    }
                    let touching = neighbours[*first..].iter().take_while(|(run, _)| run[0] < end);
                    for &(_, other) in touching {
                        match label {
                            None => label = Some(other),
                            Some(known) => self.sets.join(known, other),
                        }
                    }
                }
                let part = Part { voxels: u64::from(end - start), low: [start, j, k], high: [end, j + 1, k + 1] };
                let label = label.unwrap_or_else(|| {
                    self.parts.push(Part { voxels: 0, ..part });
                    self.sets.push()
                });
                self.parts[label as usize].add(&part);
                here.push(([start, end], label));
            }
            // What is before the next row is this one; it goes below when the next slice comes.
            self.below[j as usize] = here.clone();
            before = here;
        }
    }

    fn finish(mut self) -> Vec<Part> {
        for label in (0..self.parts.len() as u32).rev() {
            let root = self.sets.root(label);
            if root != label {
                let part = self.parts[label as usize];
                self.parts[root as usize].add(&part);
                self.parts[label as usize].voxels = 0;
            }
        }
        self.parts.retain(|part| part.voxels > 0);
        self.parts
    }
}

impl Prepared {
    /// The pieces of all objects together, and the voxels inside of each for itself.
    pub(super) fn pieces(&self, watch: &dyn Watch) -> Result<(Pieces, u64), RunError> {
        let lattice = &self.lattice;
        let height = BlockShape::for_lattice(lattice).voxels()[2];
        let slabs: Vec<u32> = (0..lattice.dims[2]).step_by(height as usize).collect();
        let mut growing = Growing::new(lattice.dims[1]);
        let mut beside = Beside::new(&self.objects, &self.touching, lattice);
        let mut inside = 0;
        // A slab a thread: runs of more are more than all that slicing holds.
        for slabs in slabs.chunks(rayon::current_num_threads()) {
            watch.go_on()?;
            let fill = |&first: &u32| -> Vec<Vec<SliceRuns>> {
                let slices = height.min(lattice.dims[2] - first) as usize;
                let of = |object: &ObjectField| {
                    let mut runs = vec![SliceRuns::default(); slices];
                    object.fill_inside(first, &mut runs);
                    runs
                };
                self.slicer().objects().iter().map(of).collect()
            };
            let filled: Vec<_> = parallel::map_all(slabs, fill);
            for (&first, objects) in slabs.iter().zip(&filled) {
                beside.add(objects, lattice.dims[1]);
                for k in 0..height.min(lattice.dims[2] - first) {
                    growing.add(first + k, |j, row| {
                        objects.iter().for_each(|slices| row.extend(slices[k as usize].row(j)));
                        inside += row.iter().map(|[start, end]| u64::from(end - start)).sum::<u64>();
                        if objects.len() > 1 {
                            merge_runs(row, 0);
                        }
                    });
                }
            }
        }
        let pieces = Pieces::of(growing.finish(), lattice, &self.boxes_of_objects());
        Ok((Pieces { glued: beside.finish(), ..pieces }, inside))
    }
}

impl Prepared {
    /// Least and greatest corners of the objects, mm.
    pub(super) fn boxes_of_objects(&self) -> Vec<[DVec3; 2]> {
        self.objects.iter().map(|object| object.bounds).collect()
    }
}

impl Pieces {
    /// What `parts` come to, of objects within `boxes`.
    pub(super) fn of(mut parts: Vec<Part>, lattice: &Lattice, boxes: &[[DVec3; 2]]) -> Self {
        parts.sort_unstable_by_key(|part| (part.low[2], part.low[1], part.low[0], part.voxels));
        let corner = |index: [u32; 3]| lattice.origin + DVec3::from(index.map(f64::from)) * lattice.pitch;
        let mm3 = |part: &Part| part.voxels as f64 * lattice.voxel_volume();
        let mut found = Self { count: parts.len() as u64, ..Self::default() };
        // A job that is smaller than a crumb by itself has none.
        let largest = parts.iter().map(|part| part.voxels).max().unwrap_or(0);
        let ends_of = |part: &Part| [corner(part.low), corner(part.high)];
        let is_crumb = |part: &Part| mm3(part) < CRUMB_MM3 && part.voxels < largest;
        // What fills its box is the object itself, else the largest that reaches into it: of objects that touch one
        // piece is both.
        let own = |[low, high]: &[DVec3; 2]| {
            let fills = |part: &Part| {
                let [least, most] = ends_of(part);
                let off = (least - low).abs().max((most - high).abs());
                off.cmple(1.5 * lattice.pitch).all()
            };
            let reaches = |part: &Part| {
                let [least, most] = ends_of(part);
                !is_crumb(part) && least.cmplt(*high).all() && most.cmpgt(*low).all()
            };
            let reaching = (0..parts.len()).filter(|&at| reaches(&parts[at]));
            reaching.max_by_key(|&at| (fills(&parts[at]), parts[at].voxels, std::cmp::Reverse(at)))
        };
        let own: Vec<usize> = boxes.iter().filter_map(own).collect();
        for (at, part) in parts.iter().enumerate() {
            let ends = ends_of(part);
            if !is_crumb(part) && !own.contains(&at) && found.loose.len() < MOST_LOOSE {
                let [low_mm, high_mm] = ends.map(|end| end.to_array());
                found.loose.push(LoosePiece { mm3: mm3(part), low_mm, high_mm });
            }
            if is_crumb(part) {
                found.crumbs += 1;
                found.crumbs_mm3 += mm3(part);
                found.first_crumb_mm.get_or_insert((0.5 * (ends[0] + ends[1])).to_array());
                if found.boxes.len() < MOST_BOXES {
                    found.boxes.push(ends);
                }
            } else if part.low[2] > 0 {
                found.in_the_air += 1;
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slices of rows of text, `#` inside.
    fn parts(slices: &[&[&str]]) -> Vec<(u64, [u32; 3], [u32; 3])> {
        let mut growing = Growing::new(slices[0].len() as u32);
        for (k, slice) in (0..).zip(slices) {
            growing.add(k, |j, runs| {
                let row = slice[j as usize].as_bytes();
                let inside = (0..row.len() as u32).filter(|&i| row[i as usize] == b'#');
                runs.extend(inside.map(|i| [i, i + 1]));
                merge_runs(runs, 0);
            });
        }
        let mut parts: Vec<_> = growing.finish().iter().map(|part| (part.voxels, part.low, part.high)).collect();
        parts.sort_unstable();
        parts
    }

    #[test]
    fn what_is_no_objects_largest_is_loose() {
        let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::splat(1.0), dims: [40, 20, 20] };
        let part = |voxels, low, high| Part { voxels, low, high };
        let parts =
            vec![part(500, [0, 0, 0], [10, 10, 5]), part(8, [2, 2, 8], [4, 4, 10]), part(300, [20, 0, 0], [30, 10, 3])];
        let boxes = [[0.0, 10.0], [20.0, 30.0]].map(|[x, end]| [DVec3::new(x, 0.0, 0.0), DVec3::new(end, 10.0, 10.0)]);
        let found = Pieces::of(parts.clone(), &lattice, &boxes);
        let loose = LoosePiece { mm3: 8.0, low_mm: [2.0, 2.0, 8.0], high_mm: [4.0, 4.0, 10.0] };
        assert_eq!((found.loose.as_slice(), found.in_the_air), ([loose].as_slice(), 1));
        assert_eq!(loose.words(), "8.0 mm³ within 2.0 × 2.0 × 2.0 mm at (3.0, 3.0, 9.0) mm");
        // Of one object that fills the same box all but the largest are.
        let whole = [[DVec3::ZERO, DVec3::new(30.0, 10.0, 10.0)]];
        assert_eq!(Pieces::of(parts, &lattice, &whole).loose.len(), 2);
        // A ball in a bowl is an object of its own, though the bowl reaches into its box too.
        let [bowl, ball] = [part(5000, [0, 0, 0], [30, 20, 20]), part(500, [10, 5, 5], [20, 15, 15])];
        let boxes = [bowl, ball].map(|part| [part.low, part.high].map(|end| DVec3::from(end.map(f64::from))));
        assert!(Pieces::of(vec![bowl, ball], &lattice, &boxes).loose.is_empty());
    }

    #[test]
    fn what_shares_a_face_hangs_together() {
        let u = parts(&[&["##.##", "#...#", "#####"]]);
        assert_eq!(u, [(11, [0, 0, 0], [5, 3, 1])]);
        // Over an edge only, it does not.
        let diagonal = parts(&[&["##...", "..##."], &["....#", "....."]]);
        assert_eq!(diagonal.len(), 3);
        // Two columns that meet in the third slice.
        let arch = parts(&[&["#.#"], &["#.#"], &["###"]]);
        assert_eq!(arch, [(7, [0, 0, 0], [3, 1, 3])]);
        assert_eq!(parts(&[&["#.#"], &["#.#"], &["#.#"]]).len(), 2);
        assert_eq!(parts(&[&["..."]]), []);
    }
}
