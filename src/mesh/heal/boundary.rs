//! The boundary of a surface, as closed loops.
//!
//! The boundary is a chain: every undirected edge counts the triangles that run along it one way minus those that run
//! the other. It closes by itself (the boundary of a boundary is nothing), at every vertex as much comes in as goes
//! out, so walking along it never strands. Whenever the walk meets itself the loop just closed is cut off; the loops
//! are therefore simple, and holes that touch in a vertex come apart. This holds for flipped, doubled and non-manifold
//! triangles alike.

use std::collections::HashMap;

use super::TriangleMesh;
use super::edges::{Edges, direction, triangle_of};

/// A simple loop of vertices, in the direction in which the *cap* runs along it: against the mesh.
pub(super) struct Hole {
    pub(super) shell: u32,
    pub(super) vertices: Vec<u32>,
}

/// All loops, by shell, then in order of their edges.
pub(super) fn loops(mesh: &TriangleMesh, edges: &Edges, shell_of: &[u32]) -> Vec<Hole> {
    // (shell, from, to), as the caps have to run.
    let mut missing: Vec<(u32, u32, u32)> = Vec::new();
    for edge in edges.iter() {
        let [low, high] = edge.ends;
        let ups = edge.half_edges.iter().filter(|&&h| direction(&mesh.triangles, h)[0] == low).count();
        let downs = edge.half_edges.len() - ups;
        let Some(&h) = edge.half_edges.first() else { continue };
        let shell = shell_of[triangle_of(h)];
        let (from, to) = if ups > downs { (high, low) } else { (low, high) };
        missing.extend(std::iter::repeat_n((shell, from, to), ups.abs_diff(downs)));
    }
    missing.sort_unstable();
    missing.chunk_by(|a, b| a.0 == b.0).flat_map(decompose).collect()
}

/// Cuts one shell's balanced edges, sorted by origin, into simple loops.
fn decompose(edges: &[(u32, u32, u32)]) -> Vec<Hole> {
    let shell = edges[0].0;
    // Next unused edge of every origin, by the index of its first one.
    let mut next_of: HashMap<u32, usize> = HashMap::new();
    for (i, &(_, from, _)) in edges.iter().enumerate() {
        next_of.entry(from).or_insert(i);
    }
    let mut holes = Vec::new();
    let mut path: Vec<u32> = Vec::new();
    let mut on_path: HashMap<u32, usize> = HashMap::new();
    for &(_, start, _) in edges {
        let mut at = start;
        // Ends back at the start, where nothing is left to walk.
        while let Some(&(_, _, to)) = next_of.get(&at).and_then(|&i| edges.get(i)).filter(|edge| edge.1 == at) {
            if let Some(i) = next_of.get_mut(&at) {
                *i += 1;
            }
            on_path.insert(at, path.len());
            path.push(at);
            if let Some(&first) = on_path.get(&to) {
                let vertices = path.split_off(first);
                vertices.iter().for_each(|v| {
                    on_path.remove(v);
                });
                holes.push(Hole { shell, vertices });
            }
            at = to;
        }
    }
    holes
}
