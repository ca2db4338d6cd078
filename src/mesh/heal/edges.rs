//! Which triangles meet at which edge.
//!
//! Half-edge 3t + c runs from corner c of triangle t to the next. Half-edges are grouped by a counting sort on their
//! lower vertex, so building is linear and the order of edges follows the vertices', whatever the thread count.

/// Half-edges by the undirected edge they lie on.
pub(super) struct Edges {
    starts: Vec<u32>,
    half_edges: Vec<u32>,
    /// Edge of every half-edge.
    of: Vec<u32>,
    /// Higher and lower vertex of every edge.
    ends: Vec<[u32; 2]>,
}

/// One undirected edge.
pub(super) struct Edge<'a> {
    /// Its vertices, the lower index first.
    pub(super) ends: [u32; 2],
    /// The half-edges on it, ascending.
    pub(super) half_edges: &'a [u32],
}

/// Triangle of a half-edge.
pub(super) fn triangle_of(half_edge: u32) -> usize {
    half_edge as usize / 3
}

/// Vertices of a half-edge in its direction.
pub(super) fn direction(triangles: &[[u32; 3]], half_edge: u32) -> [u32; 2] {
    let triangle = triangles[triangle_of(half_edge)];
    let c = half_edge as usize % 3;
    [triangle[c], triangle[(c + 1) % 3]]
}

impl Edges {
    pub(super) fn new(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        let half_edge_count = 3 * triangles.len();
        let mut ends_at = vec![0u32; vertices + 1];
        for h in 0..half_edge_count as u32 {
            let [a, b] = direction(triangles, h);
            ends_at[a.min(b) as usize + 1] += 1;
        }
        for v in 0..vertices {
            ends_at[v + 1] += ends_at[v];
        }
        // Ascending h keeps each bucket sorted by half-edge; filling advances every start to its end.
        let mut fill = ends_at.clone();
        let mut buckets = vec![(0u32, 0u32); half_edge_count];
        for h in 0..half_edge_count as u32 {
            let [a, b] = direction(triangles, h);
            let slot = &mut fill[a.min(b) as usize];
            buckets[*slot as usize] = (a.max(b), h);
            *slot += 1;
        }
        let mut edges = Self {
            starts: Vec::with_capacity(half_edge_count / 2 + 1),
            half_edges: Vec::with_capacity(half_edge_count),
            of: vec![0; half_edge_count],
            ends: Vec::with_capacity(half_edge_count / 2),
        };
        for v in 0..vertices {
            let bucket = &mut buckets[ends_at[v] as usize..ends_at[v + 1] as usize];
            bucket.sort_unstable();
            let mut last = None;
            for &(other, h) in bucket.iter() {
                if last != Some(other) {
                    edges.starts.push(edges.half_edges.len() as u32);
                    edges.ends.push([v as u32, other]);
                    last = Some(other);
                }
                edges.of[h as usize] = edges.ends.len() as u32 - 1;
                edges.half_edges.push(h);
            }
        }
        edges.starts.push(half_edge_count as u32);
        edges
    }

    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    pub(super) fn edge(&self, e: usize) -> Edge<'_> {
        let range = self.starts[e] as usize..self.starts[e + 1] as usize;
        Edge { ends: self.ends[e], half_edges: &self.half_edges[range] }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = Edge<'_>> {
        (0..self.len()).map(|e| self.edge(e))
    }

    /// The edge a half-edge lies on.
    pub(super) fn on(&self, half_edge: u32) -> Edge<'_> {
        self.edge(self.of[half_edge as usize] as usize)
    }
}
