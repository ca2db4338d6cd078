//! Edge collapses and edge flips that take slivers out of a closed mesh without changing its shape.

use glam::DVec3;

use crate::meshing::Mesh;

/// Neither operation may turn a triangle by more (cosine of 25° for flips, of 60° for collapses).
const FLIP_COSINE: f64 = 0.906;
const COLLAPSE_COSINE: f64 = 0.5;
/// A triangle with an angle below 14° and its three corners on a crease runs along that crease.
const CAP_COSINE: f64 = 0.97;

/// Merges the ends of edges shorter than `part` of the length due at them; a crease keeps its vertex.
pub fn collapse_short_edges(mesh: &mut Mesh, creased: &mut Vec<bool>, due: &[f64], part: f64) {
    let mut fans = vec![Vec::new(); mesh.positions.len()];
    for (t, corners) in mesh.triangles.iter().enumerate() {
        corners.iter().for_each(|&v| fans[v as usize].push(t));
    }
    let mut edges: Vec<(f64, u32, u32)> = mesh
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .filter(|(a, b)| a < b)
        .map(|(a, b)| {
            let length = mesh.positions[a as usize].distance(mesh.positions[b as usize]);
            (length / due[a as usize].min(due[b as usize]), a, b)
        })
        .filter(|edge| edge.0 < part)
        .collect();
    edges.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    // Each collapse locks the vertices round it, so that every decision sees the mesh as it is.
    let mut locked = vec![false; mesh.positions.len()];
    let mut dropped = vec![false; mesh.triangles.len()];
    for (_, a, b) in edges {
        let (keep, gone) = if creased[b as usize] && !creased[a as usize] { (b, a) } else { (a, b) };
        let ring: Vec<u32> =
            [keep, gone].iter().flat_map(|&v| &fans[v as usize]).flat_map(|&t| mesh.triangles[t]).collect();
        if ring.iter().any(|&v| locked[v as usize]) || !may_collapse(mesh, &fans, creased, keep, gone) {
            continue;
        }
        for &t in &fans[gone as usize] {
            if mesh.triangles[t].contains(&keep) {
                dropped[t] = true;
            }
            mesh.triangles[t] = mesh.triangles[t].map(|v| if v == gone { keep } else { v });
        }
        ring.iter().for_each(|&v| locked[v as usize] = true);
    }
    let mut index = 0;
    mesh.triangles.retain(|_| {
        index += 1;
        !dropped[index - 1]
    });
    drop_unused_vertices(mesh, creased);
}

/// The link condition (Dey et al. 1999: just two common neighbours), and no triangle turned over.
fn may_collapse(mesh: &Mesh, fans: &[Vec<usize>], creased: &[bool], keep: u32, gone: u32) -> bool {
    let neighbours = |v: u32| {
        let mut ring: Vec<u32> = fans[v as usize].iter().flat_map(|&t| mesh.triangles[t]).filter(|&w| w != v).collect();
        ring.sort_unstable();
        ring.dedup();
        ring
    };
    let theirs = neighbours(gone);
    let common = neighbours(keep).into_iter().filter(|v| theirs.binary_search(v).is_ok()).count();
    let both_creased = creased[keep as usize] && creased[gone as usize];
    common == 2
        && fans[gone as usize].iter().map(|&t| mesh.triangles[t]).filter(|t| !t.contains(&keep)).all(|triangle| {
            let normal = |of: u32| {
                let [a, b, c] = triangle.map(|v| mesh.positions[if v == gone { of } else { v } as usize]);
                (b - a).cross(c - a).normalize_or_zero()
            };
            // Along a crease a sliver may stand at any angle: only what it becomes matters there.
            both_creased || normal(gone).dot(normal(keep)) > COLLAPSE_COSINE
        })
}

fn drop_unused_vertices(mesh: &mut Mesh, creased: &mut Vec<bool>) {
    let mut index_of = vec![u32::MAX; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&v| index_of[v as usize] = 0);
    for (next, index) in index_of.iter_mut().filter(|index| **index == 0).enumerate() {
        *index = next as u32;
    }
    let mut at = 0;
    mesh.positions.retain(|_| {
        at += 1;
        index_of[at - 1] != u32::MAX
    });
    at = 0;
    creased.retain(|_| {
        at += 1;
        index_of[at - 1] != u32::MAX
    });
    mesh.triangles.iter_mut().flatten().for_each(|v| *v = index_of[*v as usize]);
}

/// Flips edges between triangles that lie nearly in a plane, never across a crease.
pub fn flip_edges(mesh: &mut Mesh, creased: &[bool]) {
    // (low vertex, high vertex, triangle): the two triangles of an edge become neighbours in the list.
    let mut edges: Vec<[u32; 3]> = Vec::with_capacity(mesh.triangles.len() * 3);
    for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        edges.extend([[a, b], [b, c], [c, a]].map(|[u, v]| [u.min(v), u.max(v), t as u32]));
    }
    edges.sort_unstable();
    let mut links: Vec<[u32; 2]> = edges.iter().map(|e| [e[0], e[1]]).collect();
    links.dedup();
    let mut touched = vec![false; mesh.triangles.len()];
    let mut made: Vec<[u32; 2]> = Vec::new();
    for pair in edges.chunk_by(|a, b| a[..2] == b[..2]) {
        let [[u, v, s], [_, _, t]] = *pair else { continue };
        let (s, t) = (s as usize, t as usize);
        if touched[s] || touched[t] {
            continue;
        }
        // `s` holds the edge as a→b, `t` as b→a; c and d are their third corners.
        let Some(at) = (0..3).find(|&i| ![u, v].contains(&mesh.triangles[s][i])) else { continue };
        let [c, a, b] = [0, 1, 2].map(|i| mesh.triangles[s][(at + i) % 3]);
        let Some(&d) = mesh.triangles[t].iter().find(|w| ![u, v].contains(w)) else { continue };
        let flipped = [c.min(d), c.max(d)];
        if links.binary_search(&flipped).is_ok() || made.contains(&flipped) {
            continue;
        }
        let [pa, pb, pc, pd] = [a, b, c, d].map(|w| mesh.positions[w as usize]);
        let (old, new) = ([[pa, pb, pc], [pb, pa, pd]], [[pc, pd, pb], [pd, pc, pa]]);
        let normals = [old[0], old[1], new[0], new[1]].map(|[p, q, r]| (q - p).cross(r - p).normalize_or_zero());
        // Three crease vertices in a row make a cap without a normal of its own, and its long edge is no crease.
        let cap = [(c, old[0]), (d, old[1])].map(|(apex, t)| creased[apex as usize] && largest_cosine(&t) > CAP_COSINE);
        let crease = creased[a as usize] && creased[b as usize];
        let may_turn = match (crease, cap) {
            (true, [false, false]) => false,
            (true, [true, _]) => normals[1..].iter().all(|n| n.dot(normals[1]) > FLIP_COSINE),
            (true, [false, true]) => [2, 3].iter().all(|&i| normals[i].dot(normals[0]) > FLIP_COSINE),
            (false, _) => normals.iter().all(|n| n.dot(normals[0]) > FLIP_COSINE),
        };
        if may_turn && smallest_cosine_gain(&old, &new) {
            mesh.triangles[s] = [c, d, b];
            mesh.triangles[t] = [d, c, a];
            (touched[s], touched[t]) = (true, true);
            made.push(flipped);
        }
    }
}

/// Whether `new` has the larger smallest angle.
fn smallest_cosine_gain(old: &[[DVec3; 3]; 2], new: &[[DVec3; 3]; 2]) -> bool {
    let largest = |pair: &[[DVec3; 3]; 2]| pair.iter().map(largest_cosine).fold(-1.0, f64::max);
    largest(new) < largest(old) - 1e-9
}

/// Cosine of a triangle's smallest angle.
pub fn largest_cosine(&[a, b, c]: &[DVec3; 3]) -> f64 {
    [(a, b, c), (b, c, a), (c, a, b)]
        .into_iter()
        .map(|(p, q, r)| (q - p).normalize_or_zero().dot((r - p).normalize_or_zero()))
        .fold(-1.0, f64::max)
}
