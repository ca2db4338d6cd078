//! Whether a mesh is closed, coherently oriented and manifold.

use crate::meshing::Mesh;

/// What [`audit`] may find; each case names the first offender.
#[derive(Debug, thiserror::Error)]
pub enum MeshFault {
    #[error("edge {0}–{1} has {2} triangles in this direction and {3} in the other, expected one each")]
    Edge(u32, u32, usize, usize),
    #[error("vertex {0} joins {1} triangles, but only {2} lie in one fan round it")]
    Vertex(u32, usize, usize),
}

/// Checks that every edge has one triangle on either side and every vertex one fan.
pub fn audit(mesh: &Mesh) -> Result<(), MeshFault> {
    let mut edges: Vec<[u32; 2]> = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    edges.sort_unstable();
    let count = |edge: [u32; 2]| edges.partition_point(|&e| e <= edge) - edges.partition_point(|&e| e < edge);
    for &[a, b] in &edges {
        let (there, back) = (count([a, b]), count([b, a]));
        if (there, back) != (1, 1) {
            return Err(MeshFault::Edge(a, b, there, back));
        }
    }
    // Links of every vertex: (vertex, next, previous) of each corner, walked from one neighbour to the next.
    let mut links: Vec<[u32; 3]> =
        mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]]).collect();
    links.sort_unstable();
    for fan in links.chunk_by(|a, b| a[0] == b[0]) {
        let (mut at, mut walked) = (0, 0);
        loop {
            walked += 1;
            at = fan.partition_point(|link| link[1] < fan[at][2]);
            if at == 0 || walked > fan.len() {
                break;
            }
        }
        if walked != fan.len() {
            return Err(MeshFault::Vertex(fan[0][0], fan.len(), walked));
        }
    }
    Ok(())
}
