//! Support in slices that do not tell it from the background.
//!
//! A printer's slices show the support as background. In a folder we read it back as what the object encloses: first
//! within each slice, exactly, then in the volume, where a hollow that opens upwards is told from one that does not.
//!
//! Cells that a hollow's wall crosses keep what they were counted to hold, which moves the wall of an open one by up to
//! half a cell. It fails where the object is open: support that reaches the surface is taken for background. A closed
//! cavity of the mesh is taken for support, which is what the printer fills it with.

use super::{collect::PreviewBuilder, section::plane_axes};
use crate::disjoint_sets::DisjointSets;

/// Part of a hollow's faces that may look at the outside before the hollow counts as open. A wall thinner than a cell
/// leaks through a few of them.
const LEAK: f64 = 0.01;

/// Gives the background pixels that no path of background pixels (over edges, not corners) joins to the image's border
/// the id `mark`.
pub(super) fn mark_enclosed(ids: &mut [u8], width: usize, mark: u8) {
    // Runs of background, row by row; node 0 is the border.
    struct Run {
        start: usize,
        end: usize,
    }
    let height = ids.len() / width.max(1);
    let mut sets = DisjointSets::new(1);
    let mut runs: Vec<Run> = Vec::new();
    let mut above = 0..0;
    for y in 0..height {
        let first = runs.len();
        let mut x = 0;
        for run in ids[y * width..(y + 1) * width].chunk_by(|a, b| (*a == 0) == (*b == 0)) {
            let (start, end) = (x, x + run.len());
            x = end;
            if run[0] == 0 {
                runs.push(Run { start, end });
                let node = sets.push();
                if start == 0 || end == width || y == 0 || y + 1 == height {
                    sets.join(node, 0);
                }
            }
        }
        let mut upper = above.clone();
        for lower in first..runs.len() {
            while upper.start < upper.end && runs[upper.start].end <= runs[lower].start {
                upper.start += 1;
            }
            for touching in upper.clone().take_while(|&n| runs[n].start < runs[lower].end) {
                sets.join(touching as u32 + 1, lower as u32 + 1);
            }
        }
        above = first..runs.len();
    }
    let mut next = 0;
    for y in 0..height {
        let row = &mut ids[y * width..(y + 1) * width];
        let mut x = 0;
        while x < width {
            if row[x] != 0 {
                x += 1;
                continue;
            }
            // Runs come in the order they were found.
            let run = &runs[next];
            next += 1;
            if sets.root(next as u32) != 0 {
                row[run.start..run.end].fill(mark);
            }
            x = run.end;
        }
    }
}

/// Turns hollows that are open to the outside back into background: in the volume and in all sections.
pub(super) fn open_hollows(builder: &mut PreviewBuilder, mark: u8) {
    let volume = &mut builder.volume;
    let n = volume.n;
    let mut seen = vec![false; volume.ids.len()];
    let mut open = vec![false; volume.ids.len()];
    let mut hollow = Vec::new();
    for first in 0..volume.ids.len() {
        if seen[first] || volume.ids[first] != mark {
            continue;
        }
        seen[first] = true;
        hollow.clear();
        hollow.push(first);
        let (mut faces, mut outside, mut next) = (0_u64, 0_u64, 0);
        while let Some(&cell) = hollow.get(next) {
            next += 1;
            let at = [cell % n[0], cell / n[0] % n[1], cell / (n[0] * n[1])];
            for axis in 0..3 {
                for up in [false, true] {
                    let mut beside = at;
                    beside[axis] = if up { at[axis] + 1 } else { at[axis].wrapping_sub(1) };
                    let beside = (beside[axis] < n[axis]).then(|| volume.index(beside));
                    match beside {
                        Some(cell) if volume.ids[cell] == mark => {
                            if !seen[cell] {
                                seen[cell] = true;
                                hollow.push(cell);
                            }
                        }
                        Some(cell) => {
                            faces += 1;
                            outside += u64::from(volume.ids[cell] == 0);
                        }
                        None => {
                            faces += 1;
                            outside += 1;
                        }
                    }
                }
            }
        }
        if outside as f64 > LEAK * faces as f64 {
            hollow.iter().for_each(|&cell| open[cell] = true);
        }
    }
    if !open.contains(&true) {
        return;
    }
    for (cell, _) in open.iter().enumerate().filter(|(_, open)| **open) {
        volume.clear(cell);
    }
    let (edge, index) = (volume.edge, |at: [usize; 3]| at[0] + n[0] * (at[1] + n[1] * at[2]));
    let pitch = builder.lattice().pitch;
    for section in builder.sections_mut() {
        let [right, up] = plane_axes(section.normal);
        let [width, height] = section.pixels;
        let mut place = [0.0; 3];
        place[section.normal] = (f64::from(section.index) + 0.5) * pitch[section.normal];
        for y in 0..height {
            for x in 0..width {
                if section.ids[x + width * y] != mark {
                    continue;
                }
                place[right] = (x as f64 + 0.5) / width as f64 * section.size_mm[0];
                place[up] = (1.0 - (y as f64 + 0.5) / height as f64) * section.size_mm[1];
                // A pixel beside a wall may lie in a cell of the wall: any open cell around it decides.
                let range = |axis: usize| {
                    let cell = (place[axis] / edge[axis]) as usize;
                    cell.saturating_sub(1)..(cell + 2).min(n[axis])
                };
                let near = range(2).any(|z| range(1).any(|y| range(0).any(|x| open[index([x, y, z])])));
                if near {
                    section.ids[x + width * y] = 0;
                }
            }
        }
    }
}
