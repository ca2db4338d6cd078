//! Agreement between neighbours: breadth-first over edges with exactly two triangles.
//!
//! Two triangles agree if they run along their common edge in opposite directions. A patch is what such edges connect;
//! within it the fewer triangles give way, so the orientation that most of the file has survives. A patch that cannot
//! be oriented (a Möbius strip) keeps edges where neighbours disagree; their boundary is capped like any other.

use super::edges::{Edges, direction, triangle_of};
use super::{HealthReport, TriangleMesh};

/// Flips triangles of the mesh; the edges that come back follow.
pub(super) fn orient(mesh: &mut TriangleMesh, mut edges: Edges, health: &mut HealthReport) -> Edges {
    const UNSEEN: u8 = 2;
    let mut flipped = vec![UNSEEN; mesh.triangles.len()];
    let mut queue = Vec::new();
    for seed in 0..mesh.triangles.len() {
        if flipped[seed] != UNSEEN {
            continue;
        }
        flipped[seed] = 0;
        queue.clear();
        queue.push(seed);
        let mut next = 0;
        while next < queue.len() {
            let t = queue[next];
            next += 1;
            for h in 3 * t as u32..3 * t as u32 + 3 {
                let &[a, b] = edges.on(h).half_edges else { continue };
                let neighbour = triangle_of(if a == h { b } else { a });
                if flipped[neighbour] == UNSEEN {
                    flipped[neighbour] = flipped[t] ^ u8::from(same_direction(mesh, a, b));
                    queue.push(neighbour);
                }
            }
        }
        let minority = queue.iter().filter(|&&t| flipped[t] == 1).count();
        if 2 * minority > queue.len() {
            queue.iter().for_each(|&t| flipped[t] ^= 1);
        }
    }
    for t in (0..flipped.len()).filter(|&t| flipped[t] == 1) {
        mesh.flip(t);
        health.flipped_triangles += 1;
    }
    if health.flipped_triangles > 0 {
        // A flipped triangle's half-edges change places.
        edges = Edges::new(mesh.positions.len(), &mesh.triangles);
    }
    health.twisted_edges =
        edges.iter().filter(|edge| matches!(*edge.half_edges, [a, b] if same_direction(mesh, a, b))).count();
    edges
}

fn same_direction(mesh: &TriangleMesh, a: u32, b: u32) -> bool {
    direction(&mesh.triangles, a)[0] == direction(&mesh.triangles, b)[0]
}
