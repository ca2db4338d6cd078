//! Inside or outside, for whole rows of voxels: signed crossings, counted exactly.
//!
//! A plane z = const cuts a closed, oriented surface into closed, directed polygons; a row y = const cuts those into
//! crossings that alternate between entering and leaving. The sum of the crossings to the left of a position is its
//! **winding number**, and a position is inside where it is at least 1. So nested shells wound outwards are one solid,
//! inner shells wound inwards are cavities, and overlapping shells are their union.
//!
//! The count is combinatorially exact: a vertex is either above a plane (z ≥ plane) or below, an edge crosses iff its
//! ends differ, and the crossing point of an edge is computed from the same end by both of its triangles, bit for bit.
//! Hence the directed polygons always close and every row's crossings sum to 0, whatever the rounding. Needs a surface
//! without boundary: [`crate::mesh::Solid`] brings caps that close its holes.
//!
//! Where a vertex lies exactly in the plane or a crossing exactly on the row, both readings of "above" are taken and
//! the union kept, so that the surface itself (depth 0) is inside. A tip or a ridge that only touches the row has no
//! crossing in either reading; vertices and edges on the row are inside by themselves.

use std::sync::Arc;

use glam::DVec3;

use crate::parallel;
use crate::{mesh::Solid, voxel::Lattice};

/// The closed surface of a solid, sorted into the slabs of a lattice.
#[derive(Debug)]
pub struct InsideRows {
    triangles: Arc<[[DVec3; 3]]>,
    /// Triangles that reach into slab s: `members[starts[s]..starts[s + 1]]`.
    starts: Vec<usize>,
    members: Vec<u32>,
    slab_height: u32,
    lattice: Lattice,
}

/// The inside voxels of one slice: for every row j, runs of voxel indices, half-open, ascending, disjoint.
#[derive(Debug, Default, Clone)]
pub struct SliceRuns {
    starts: Vec<u32>,
    runs: Vec<[u32; 2]>,
    scratch: Vec<Crossing>,
}

impl SliceRuns {
    /// Runs of inside voxels in row `j`.
    #[inline]
    pub fn row(&self, j: u32) -> &[[u32; 2]] {
        match self.starts.get(j as usize..j as usize + 2) {
            Some(range) => &self.runs[range[0] as usize..range[1] as usize],
            None => &[],
        }
    }

    /// Adds the runs of another body in the same slice.
    pub fn add(&mut self, other: &Self) {
        let (mut starts, mut runs) = (vec![0], Vec::with_capacity(self.runs.len() + other.runs.len()));
        for row in 0..self.starts.len().max(other.starts.len()).saturating_sub(1) as u32 {
            let first = runs.len();
            runs.extend(self.row(row).iter().chain(other.row(row)));
            merge_runs(&mut runs, first);
            starts.push(runs.len() as u32);
        }
        (self.starts, self.runs) = (starts, runs);
    }
}

#[derive(Debug, Clone, Copy)]
struct Crossing {
    row: u32,
    /// Which of the readings of "above" found it; readings are counted apart.
    reading: u8,
    /// +1 entering, −1 leaving, in the direction of +x.
    turn: i8,
    x: f64,
}

/// The reading of what only touches a row; 0 to 3 are those of crossings.
const TOUCHING: u8 = 4;

/// How a vertex exactly in the plane, and a crossing exactly on the row, is read.
#[derive(Clone, Copy)]
enum Above {
    Inclusive,
    Exclusive,
}

impl Above {
    #[inline]
    fn is(self, value: f64, level: f64) -> bool {
        match self {
            Self::Inclusive => value >= level,
            Self::Exclusive => value > level,
        }
    }
}

impl InsideRows {
    /// Sorts the outline of `solid` into slabs of `slab_height` slices.
    pub fn new(solid: &Solid, lattice: Lattice, slab_height: u32) -> Self {
        Self::sorted(solid.outline().collect(), lattice, slab_height)
    }

    /// Sorts a closed surface into slabs of `slab_height` slices.
    pub(crate) fn of_triangles(triangles: Arc<[[DVec3; 3]]>, lattice: Lattice, slab_height: u32) -> Self {
        Self::sorted(triangles, lattice, slab_height)
    }

    /// The same surface sorted into the slabs of another lattice.
    pub fn resampled(&self, lattice: Lattice, slab_height: u32) -> Self {
        Self::sorted(Arc::clone(&self.triangles), lattice, slab_height)
    }

    /// The surface and the caps.
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    fn sorted(triangles: Arc<[[DVec3; 3]]>, lattice: Lattice, slab_height: u32) -> Self {
        let slabs = lattice.dims[2].div_ceil(slab_height) as usize;
        let height = f64::from(slab_height) * lattice.pitch.z;
        // One slab more than the plain quotient on both sides: rounding can then not lose a triangle.
        let reach = |t: &[DVec3; 3]| {
            let slab = |z: f64| ((z - lattice.origin.z) / height).floor();
            let low = slab(t[0].z.min(t[1].z).min(t[2].z) - lattice.pitch.z).max(0.0) as usize;
            let high = slab(t[0].z.max(t[1].z).max(t[2].z) + lattice.pitch.z);
            low..if high < 0.0 { 0 } else { (high as usize + 1).min(slabs) }
        };
        let mut starts = vec![0; slabs + 1];
        for triangle in triangles.iter() {
            for slab in reach(triangle) {
                starts[slab + 1] += 1;
            }
        }
        for slab in 0..slabs {
            starts[slab + 1] += starts[slab];
        }
        let (mut next, mut members) = (starts.clone(), vec![0; starts[slabs]]);
        for (index, triangle) in (0..).zip(triangles.iter()) {
            for slab in reach(triangle) {
                members[next[slab]] = index;
                next[slab] += 1;
            }
        }
        Self { triangles, starts, members, slab_height, lattice }
    }

    /// Computes the runs of the slices `first..first + slices.len()`, in parallel; buffers are reused.
    pub fn fill(&self, first: u32, slices: &mut [SliceRuns]) {
        parallel::rows(slices, 1, |n, slice| self.fill_slice(first + n as u32, &mut slice[0]));
    }

    /// Computes the runs of slice `k`.
    pub fn fill_slice(&self, k: u32, slice: &mut SliceRuns) {
        let z = self.lattice.coordinate(2, k);
        let slab = (k / self.slab_height) as usize;
        let members = &self.members[self.starts[slab]..self.starts[slab + 1]];
        let mut crossings = std::mem::take(&mut slice.scratch);
        crossings.clear();
        let mut touched = false;
        for &member in members {
            let triangle = &self.triangles[member as usize];
            touched |= triangle.iter().any(|v| v.z == z);
            self.cross(triangle, z, Above::Inclusive, 0, &mut crossings);
        }
        if touched {
            for &member in members {
                let triangle = &self.triangles[member as usize];
                self.cross(triangle, z, Above::Exclusive, 2, &mut crossings);
                self.touch(triangle, z, &mut crossings);
            }
        }
        // Ties in x only reorder crossings of the same place; entering first keeps touching solids together.
        crossings.sort_unstable_by(|a, b| {
            (a.row, a.reading).cmp(&(b.row, b.reading)).then(a.x.total_cmp(&b.x)).then(b.turn.cmp(&a.turn))
        });
        self.collect_runs(&crossings, slice);
        slice.scratch = crossings;
    }

    /// Cuts a triangle with the plane at height `z` and the segment with the rows it spans.
    fn cross(&self, triangle: &[DVec3; 3], z: f64, above: Above, reading: u8, crossings: &mut Vec<Crossing>) {
        let is_above = triangle.map(|v| above.is(v.z, z));
        let (mut upward, mut downward) = (None, None);
        for corner in 0..3 {
            let next = (corner + 1) % 3;
            match (is_above[corner], is_above[next]) {
                (false, true) => upward = Some(edge_at(triangle[corner], triangle[next], z)),
                (true, false) => downward = Some(edge_at(triangle[corner], triangle[next], z)),
                _ => {}
            }
        }
        let (Some(start), Some(end)) = (upward, downward) else { return };
        let (low, high) = if start[1] < end[1] { (start[1], end[1]) } else { (end[1], start[1]) };
        let (origin, pitch) = (self.lattice.origin.y, self.lattice.pitch.y);
        let last = f64::from(self.lattice.dims[1]) - 1.0;
        let first_row = ((low - origin) / pitch - 1.5).floor().clamp(0.0, last) as u32;
        let last_row = ((high - origin) / pitch + 0.5).ceil().clamp(0.0, last) as u32;
        for row in first_row..=last_row {
            let y = self.lattice.coordinate(1, row);
            let mut push = |above: Above, reading: u8| {
                let turn = match (above.is(start[1], y), above.is(end[1], y)) {
                    (false, true) => 1,
                    (true, false) => -1,
                    _ => return,
                };
                crossings.push(Crossing { row, reading, turn, x: crossing_at(start, end, y) });
            };
            push(Above::Inclusive, reading);
            push(Above::Exclusive, reading + 1);
        }
    }

    /// Adds what of a triangle's edges lies on a row, a vertex at least, as a reading of its own: in and out again.
    fn touch(&self, triangle: &[DVec3; 3], z: f64, crossings: &mut Vec<Crossing>) {
        for corner in 0..3 {
            let (from, to) = (triangle[corner], triangle[(corner + 1) % 3]);
            let row = ((from.y - self.lattice.origin.y) / self.lattice.pitch.y - 0.5).round();
            if from.z != z || !(row >= 0.0 && row < f64::from(self.lattice.dims[1])) {
                continue;
            }
            let row = row as u32;
            if self.lattice.coordinate(1, row) == from.y {
                let end = if to.z == z && to.y == from.y { to.x } else { from.x };
                let (low, high) = if from.x <= end { (from.x, end) } else { (end, from.x) };
                crossings.push(Crossing { row, reading: TOUCHING, turn: 1, x: low });
                crossings.push(Crossing { row, reading: TOUCHING, turn: -1, x: high });
            }
        }
    }

    /// Turns sorted crossings into runs of voxels whose centres lie in the closed inside intervals.
    fn collect_runs(&self, crossings: &[Crossing], slice: &mut SliceRuns) {
        slice.starts.clear();
        slice.runs.clear();
        slice.starts.push(0);
        let mut rest = crossings;
        for row in 0..self.lattice.dims[1] {
            let first = slice.runs.len();
            while let Some(head) = rest.first().filter(|c| c.row == row) {
                let count = rest.iter().take_while(|c| c.row == row && c.reading == head.reading).count();
                let (reading, later) = rest.split_at(count);
                rest = later;
                let (mut winding, mut entered) = (0_i32, 0.0);
                for crossing in reading {
                    let before = winding;
                    winding += i32::from(crossing.turn);
                    if before < 1 && winding >= 1 {
                        entered = crossing.x;
                    } else if before >= 1 && winding < 1 {
                        let run = self.voxels_between(entered, crossing.x);
                        if run[0] < run[1] {
                            slice.runs.push(run);
                        }
                    }
                }
            }
            merge_runs(&mut slice.runs, first);
            slice.starts.push(slice.runs.len() as u32);
        }
    }

    /// Voxels of a row whose centres lie in [from, to].
    fn voxels_between(&self, from: f64, to: f64) -> [u32; 2] {
        let dims = self.lattice.dims[0];
        let guess = |x: f64| {
            ((x - self.lattice.origin.x) / self.lattice.pitch.x - 0.5).ceil().clamp(0.0, f64::from(dims)) as u32
        };
        let mut start = guess(from);
        while start > 0 && self.lattice.coordinate(0, start - 1) >= from {
            start -= 1;
        }
        while start < dims && self.lattice.coordinate(0, start) < from {
            start += 1;
        }
        let mut end = guess(to);
        while end > 0 && self.lattice.coordinate(0, end - 1) > to {
            end -= 1;
        }
        while end < dims && self.lattice.coordinate(0, end) <= to {
            end += 1;
        }
        [start, end]
    }
}

/// Where edge (p, q) meets the plane at height `z`: (x, y), the same bits whichever way the edge is given.
#[inline]
fn edge_at(p: DVec3, q: DVec3, z: f64) -> [f64; 2] {
    let ordered = (p.z, p.y, p.x) <= (q.z, q.y, q.x);
    let (p, q) = if ordered { (p, q) } else { (q, p) };
    if z == q.z {
        return [q.x, q.y]; // p + (q − p) need not be q
    }
    let t = (z - p.z) / (q.z - p.z);
    [p.x + t * (q.x - p.x), p.y + t * (q.y - p.y)]
}

/// Where the segment (p, q) in a plane meets the row at `y`: x, the same bits whichever way the segment is given.
#[inline]
fn crossing_at(p: [f64; 2], q: [f64; 2], y: f64) -> f64 {
    let (p, q) = if (p[1], p[0]) <= (q[1], q[0]) { (p, q) } else { (q, p) };
    if y == q[1] { q[0] } else { p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0]) }
}

/// Sorts and joins the runs from index `first` on.
pub(crate) fn merge_runs(runs: &mut Vec<[u32; 2]>, first: usize) {
    if runs.len() - first < 2 {
        return;
    }
    runs[first..].sort_unstable();
    let mut last = first;
    for next in first + 1..runs.len() {
        if runs[next][0] <= runs[last][1] {
            runs[last][1] = runs[last][1].max(runs[next][1]);
        } else {
            last += 1;
            runs[last] = runs[next];
        }
    }
    runs.truncate(last + 1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_that_touch_are_one() {
        let mut runs = vec![[7, 8], [5, 9], [0, 3], [3, 4], [8, 12], [20, 21]];
        merge_runs(&mut runs, 1);
        assert_eq!(runs, [[7, 8], [0, 4], [5, 12], [20, 21]]);
        merge_runs(&mut runs, 0);
        assert_eq!(runs, [[0, 4], [5, 12], [20, 21]]);
        merge_runs(&mut Vec::new(), 0);
    }
}
