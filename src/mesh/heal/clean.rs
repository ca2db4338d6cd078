//! Triangles that say nothing, or say it twice.
//!
//! A triangle with a repeated corner goes. Of triangles with the same three corners, those of equal orientation keep
//! the first; of unequal numbers either way the majority keeps one. Equal numbers either way are a *pair*, which is one
//! of two things: a wall between two closed parts, where both must go (the wall is inside the solid, no depth is
//! measured from it), or a surface written from both sides, where one must stay. The neighbours tell: around a wall the
//! surface is closed without it, so the edges on the rim of a patch of pairs have an even number of other triangles;
//! where one is missing, an odd number. The majority of the rim decides; a patch without rim (a wholly double-sided
//! mesh) stays.

use super::edges::{Edges, triangle_of};
use super::{HealthReport, TriangleMesh};
use crate::disjoint_sets::DisjointSets;

pub(super) fn clean(mesh: &mut TriangleMesh, health: &mut HealthReport) {
    let before = mesh.triangles.len();
    let proper: Vec<bool> = mesh.triangles.iter().map(|&[a, b, c]| a != b && b != c && c != a).collect();
    if proper.contains(&false) {
        mesh.keep(|t| proper[t]);
    }
    health.degenerate_triangles += before - mesh.triangles.len();
    let (mut keep, pairs) = find_doubles(mesh);
    if !pairs.is_empty() {
        settle_pairs(mesh, &pairs, &mut keep);
    }
    let doubled = keep.iter().filter(|&&keep| !keep).count();
    health.doubled_triangles += doubled;
    if doubled > 0 {
        mesh.keep(|t| keep[t]);
    }
}

/// Which triangles to keep, and the pairs of opposite ones (both kept for now) still to be judged.
fn find_doubles(mesh: &TriangleMesh) -> (Vec<bool>, Vec<[u32; 2]>) {
    let mut keep = vec![true; mesh.triangles.len()];
    let mut pairs = Vec::new();
    // Rotated so that the lowest vertex leads, equal sets differ at most in the order of the other two.
    let turned = |t: usize| {
        let [a, b, c] = mesh.triangles[t];
        if a < b && a < c {
            [a, b, c]
        } else if b < c {
            [b, c, a]
        } else {
            [c, a, b]
        }
    };
    let mut starts = vec![0u32; mesh.positions.len() + 1];
    for t in 0..keep.len() {
        starts[turned(t)[0] as usize + 1] += 1;
    }
    for v in 0..mesh.positions.len() {
        starts[v + 1] += starts[v];
    }
    let mut fill = starts.clone();
    let mut buckets = vec![([0u32; 2], 0u32); keep.len()];
    for t in 0..keep.len() {
        let [a, b, c] = turned(t);
        let slot = &mut fill[a as usize];
        buckets[*slot as usize] = ([b.min(c), b.max(c)], t as u32);
        *slot += 1;
    }
    for v in 0..mesh.positions.len() {
        let bucket = &mut buckets[starts[v] as usize..starts[v + 1] as usize];
        bucket.sort_unstable();
        for group in bucket.chunk_by(|x, y| x.0 == y.0).filter(|group| group.len() > 1) {
            let positive = |t: u32| turned(t as usize)[1] == group[0].0[0];
            let (front, back): (Vec<u32>, Vec<u32>) = group.iter().map(|&(_, t)| t).partition(|&t| positive(t));
            for &(_, t) in group {
                keep[t as usize] = false;
            }
            let (more, fewer) = if front.len() >= back.len() { (&front, &back) } else { (&back, &front) };
            keep[more[0] as usize] = true;
            if more.len() == fewer.len() {
                keep[fewer[0] as usize] = true;
                pairs.push([more[0].min(fewer[0]), more[0].max(fewer[0])]);
            }
        }
    }
    (keep, pairs)
}

/// Decides per connected patch of pairs whether one or none of each stays.
fn settle_pairs(mesh: &TriangleMesh, pairs: &[[u32; 2]], keep: &mut [bool]) {
    const NONE: u32 = u32::MAX;
    let mut pair_of = vec![NONE; mesh.triangles.len()];
    for (i, pair) in pairs.iter().enumerate() {
        pair.iter().for_each(|&t| pair_of[t as usize] = i as u32);
    }
    let edges = Edges::new(mesh.positions.len(), &mesh.triangles);
    let mut patches = DisjointSets::new(pairs.len());
    // Rim edges with an odd and with an even number of other triangles, per pair.
    let mut odd = vec![0usize; pairs.len()];
    let mut even = vec![0usize; pairs.len()];
    for edge in edges.iter() {
        let here = || edge.half_edges.iter().map(|&h| triangle_of(h)).filter(|&t| keep[t]);
        let mut paired = here().map(|t| pair_of[t]).filter(|&p| p != NONE);
        let Some(first) = paired.next() else { continue };
        let others = here().filter(|&t| pair_of[t] == NONE).count();
        if others == 0 {
            paired.for_each(|p| patches.join(first, p));
        } else if others % 2 == 1 {
            odd[first as usize] += 1;
        } else {
            even[first as usize] += 1;
        }
    }
    let mut votes = vec![(0, 0); pairs.len()];
    for i in 0..pairs.len() {
        let vote = &mut votes[patches.root(i as u32) as usize];
        *vote = (vote.0 + odd[i], vote.1 + even[i]);
    }
    for (i, &[first, second]) in pairs.iter().enumerate() {
        let (odd, even) = votes[patches.root(i as u32) as usize];
        keep[second as usize] = false;
        keep[first as usize] = odd >= even;
    }
}
