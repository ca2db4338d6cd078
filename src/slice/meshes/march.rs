//! Layer after layer of bricks: nodes, then vertices, then triangles.
//!
//! The vertices of a layer of bricks need the nodes of the next one, its triangles the vertices of the next one. So the
//! walk holds three layers, and a slab of nodes that was filled at once; what stays is the output. Bricks are worked on
//! in parallel and gathered in order, which numbers vertices and triangles the same way whatever the thread count.

use std::collections::VecDeque;

use glam::Vec3;

use super::{
    Bounds, MeshingError,
    cell::{CellOutput, EDGE_START, fill_cell},
    crossing::{Crossings, Tangent},
    interfaces::{Facet, Interfaces},
    nodes::{NodeBrick, NodeGrid, TwoLayers},
    object::{BLOCK, BLOCK_BRICKS, BLOCK_NODES, BlockScratch, NodeObject},
    peaks::{Corner, peak},
    vertices::{BrickVertices, step},
};
use crate::{
    parallel,
    sdf::SliceRuns,
    slice::joined::runs_of,
    voxel::{BRICK, BRICK_VOXELS},
    watch::Watch,
};

/// Marks a vertex number that counts the brick's own inner vertices.
const INNER: u32 = 1 << 31;

/// One layer of bricks.
struct Layer {
    nodes: Vec<NodeBrick>,
    vertices: Vec<Option<Box<BrickVertices>>>,
}

/// Everything that stays the same during a walk.
pub struct March<'a> {
    /// The node lattice.
    pub grid: &'a NodeGrid,
    /// The objects on it.
    pub objects: &'a [NodeObject<'a>],
    /// Bounds of the objects, mm.
    pub bounds: Bounds,
}

/// What a walk makes.
#[derive(Debug, Default)]
pub struct Marched {
    /// The boundaries.
    pub interfaces: Interfaces,
    /// Of every vertex.
    pub tangents: Vec<Tangent>,
    /// The vertices on edges and corners of the surface, ascending.
    pub peaks: Vec<u32>,
}

/// The triangles of one brick.
#[derive(Default)]
struct BrickTriangles {
    inner: Vec<Vec3>,
    /// Those of `inner` that are on edges and corners of the surface, and what surface that is.
    peaks: Vec<(u32, Tangent)>,
    triangles: Vec<Facet>,
}

/// The triangles of a brick, as one cell fills them.
struct CellTriangles<'a, F> {
    brick: &'a mut BrickTriangles,
    /// Place and tangent of a point of the cell.
    corner: F,
    march: &'a March<'a>,
}

impl<F: Fn(usize) -> Corner> CellOutput for CellTriangles<'_, F> {
    fn vertex(&mut self, position: Vec3) -> u32 {
        self.brick.inner.push(position);
        INNER | (self.brick.inner.len() - 1) as u32
    }

    fn triangle(&mut self, behind: u8, front: u8, corners: [u32; 3]) {
        self.brick.triangles.push(Facet { corners, behind, front });
    }

    fn peak(&mut self, points: &[u8]) -> Option<u32> {
        let mut contour = [Corner::default(); 12];
        for (corner, &point) in contour.iter_mut().zip(points) {
            *corner = (self.corner)(usize::from(point));
        }
        let Corner { position, tangent } = peak(&contour[..points.len()], self.march)?;
        self.brick.peaks.push((self.brick.inner.len() as u32, tangent));
        Some(self.vertex(position.as_vec3()))
    }
}

impl March<'_> {
    /// Walks all layers.
    pub fn run(&self, watch: &dyn Watch) -> Result<Marched, MeshingError> {
        let mut marched = Marched::default();
        let all = self.grid.bricks[2];
        let mut layers = VecDeque::new();
        // Number of the layer at the front of `layers`, and of the next one to get vertices.
        let (mut front, mut next) = (0, 0);
        for slab in 0..=all.div_ceil(BLOCK) {
            if slab * BLOCK < all {
                layers.extend(self.fill_slab(slab).into_iter().take(all - slab * BLOCK));
            } else {
                // Air above the highest layer, twice, so that it too gets vertices and triangles.
                layers.extend([self.air(), self.air()]);
            }
            while front + layers.len() >= next + 2 {
                self.add_vertices(&mut layers, next - front, next, &mut marched)?;
                if next > front {
                    self.add_triangles(&layers, front, &mut marched)?;
                    layers.pop_front();
                    front += 1;
                    watch.advance(1);
                    watch.go_on()?;
                }
                next += 1;
            }
        }
        Ok(marched)
    }

    fn air(&self) -> Layer {
        Layer { nodes: vec![NodeBrick::OUTSIDE; self.grid.layer_bricks()], vertices: Vec::new() }
    }

    /// The nodes of [`BLOCK`] layers of bricks.
    fn fill_slab(&self, slab: usize) -> Vec<Layer> {
        let first = (slab * BLOCK_NODES) as u32;
        let height = (self.grid.lattice.dims[2] - first).min(BLOCK_NODES as u32);
        let inside = |object: &NodeObject<'_>| {
            let mut slices = vec![SliceRuns::default(); height as usize];
            object.fill_inside(first, &mut slices);
            slices
        };
        // Of a body of several objects by the first of them.
        let runs: Vec<Vec<SliceRuns>> = (0..)
            .zip(self.objects)
            .map(|(n, object)| match object.members() {
                None => inside(object),
                Some(members) if members[0] == n => {
                    runs_of(members.iter().map(|&member| inside(&self.objects[member])))
                }
                Some(_) => Vec::new(),
            })
            .collect();
        let blocks = [0, 1].map(|axis| self.grid.bricks[axis].div_ceil(BLOCK));
        let fill = |scratch: &mut BlockScratch, block: usize| {
            let corner = [block % blocks[0], block / blocks[0]].map(|n| (n * BLOCK_NODES) as u32);
            let mut bricks = vec![NodeBrick::OUTSIDE; BLOCK_BRICKS];
            for (n, object) in self.objects.iter().enumerate() {
                let slices = &runs[object.members().map_or(n, |members| members[0])];
                object.fill_block([corner[0], corner[1], first], slices, &mut bricks, scratch);
            }
            bricks
        };
        let filled: Vec<_> = parallel::map_in(blocks[0] * blocks[1], BlockScratch::default, fill);
        let mut layers: Vec<_> = (0..BLOCK).map(|_| self.air()).collect();
        for (block, bricks) in filled.into_iter().enumerate() {
            let corner = [block % blocks[0] * BLOCK, block / blocks[0] * BLOCK];
            for (n, brick) in bricks.into_iter().enumerate() {
                let [x, y] = [corner[0] + n % BLOCK, corner[1] + n / BLOCK % BLOCK];
                if x < self.grid.bricks[0] && y < self.grid.bricks[1] {
                    layers[n / (BLOCK * BLOCK)].nodes[x + self.grid.bricks[0] * y] = brick;
                }
            }
        }
        layers
    }

    fn two<'l>(&'l self, layers: &'l VecDeque<Layer>, at: usize, layer: usize) -> TwoLayers<'l> {
        TwoLayers { grid: self.grid, layer, lower: &layers[at].nodes, upper: &layers[at + 1].nodes }
    }

    /// The place of a brick in its layer.
    fn column(&self, brick: usize) -> [usize; 2] {
        [brick % self.grid.bricks[0], brick / self.grid.bricks[0]]
    }

    /// Computes the vertices of `layers[at]`, which is layer `layer` of the grid.
    fn add_vertices(
        &self,
        layers: &mut VecDeque<Layer>,
        at: usize,
        layer: usize,
        marched: &mut Marched,
    ) -> Result<(), MeshingError> {
        let two = self.two(layers, at, layer);
        let crossings = || Crossings::new(self.objects, self.bounds, self.grid.lattice.pitch.x);
        let mut vertices: Vec<_> = parallel::map_in(self.grid.layer_bricks(), crossings, |crossings, brick| {
            let column = self.column(brick);
            let labels = two.labels(column)?;
            Some(BrickVertices::new(&two, column, &labels, crossings))
        });
        for brick in vertices.iter_mut().flatten() {
            brick.first = next_vertex(marched, brick.positions.len())?;
            marched.interfaces.positions.append(&mut brick.positions);
            marched.tangents.append(&mut brick.tangents);
            (brick.positions, brick.tangents) = Default::default();
        }
        layers[at].vertices = vertices;
        Ok(())
    }

    /// Computes the triangles in the cells of `layers[0]`, which is layer `layer` of the grid.
    fn add_triangles(&self, layers: &VecDeque<Layer>, layer: usize, marched: &mut Marched) -> Result<(), MeshingError> {
        let two = self.two(layers, 0, layer);
        let known = &*marched;
        let filled: Vec<_> =
            parallel::map(self.grid.layer_bricks(), |brick| self.fill_brick(&two, layers, self.column(brick), known));
        for brick in filled.into_iter().flatten() {
            let first = next_vertex(marched, brick.inner.len())?;
            let Marched { interfaces: Interfaces { positions, facets }, tangents, peaks } = marched;
            positions.extend(brick.inner.iter().map(|position| position.to_array()));
            tangents.resize(positions.len(), Tangent::UNKNOWN);
            for (peak, tangent) in brick.peaks {
                tangents[(first + peak) as usize] = tangent;
                peaks.push(first + peak);
            }
            let number = |corner| if corner & INNER != 0 { first + (corner & !INNER) } else { corner };
            facets.extend(brick.triangles.iter().map(|&facet| Facet { corners: facet.corners.map(number), ..facet }));
        }
        Ok(())
    }

    fn fill_brick(
        &self,
        two: &TwoLayers,
        layers: &VecDeque<Layer>,
        column: [usize; 2],
        known: &Marched,
    ) -> Option<BrickTriangles> {
        let labels = two.labels(column)?;
        let width = self.grid.bricks[0];
        // The bricks that own the vertices of this one's cells; beyond the grid there are none.
        let owners: [Option<&BrickVertices>; 8] = std::array::from_fn(|n| {
            let (x, y) = (column[0] + (n & 1), column[1] + (n >> 1 & 1));
            let inside = x < width && y < self.grid.bricks[1];
            let vertices = &layers[n >> 2].vertices;
            if inside { vertices.get(x + width * y)?.as_deref() } else { None }
        });
        // The brick that owns node `at`, each 0 to 8, and the node in it.
        let owner = |at: [usize; 3]| {
            let brick = at[0] / BRICK + 2 * (at[1] / BRICK) + 4 * (at[2] / BRICK);
            (owners[brick], at.map(|n| n % BRICK))
        };
        let mut brick = BrickTriangles::default();
        for n in 0..BRICK_VOXELS {
            let at = [n % BRICK, n / BRICK % BRICK, n / (BRICK * BRICK)];
            let corners = labels.cell(at);
            if corners == [corners[0]; 8] {
                continue;
            }
            let vertex = |point: usize| {
                if point < 12 {
                    let start = EDGE_START[point];
                    let (brick, node) = owner([at[0] + (start & 1), at[1] + (start >> 1 & 1), at[2] + (start >> 2)]);
                    brick.map_or(0, |brick| brick.edge(node, point / 4))
                } else {
                    let (axis, side) = ((point - 12) / 2, (point - 12) % 2);
                    let (brick, node) = owner(if side == 1 { step(at, axis) } else { at });
                    brick.and_then(|brick| brick.face(node, axis)).unwrap_or(0)
                }
            };
            let position = |point: usize| Vec3::from(known.interfaces.positions[vertex(point) as usize]);
            let corner = |point: usize| Corner {
                position: position(point).as_dvec3(),
                tangent: known.tangents[vertex(point) as usize],
            };
            fill_cell(&corners, vertex, position, &mut CellTriangles { brick: &mut brick, corner, march: self });
        }
        Some(brick)
    }
}

/// The number that the next of `count` further vertices gets.
fn next_vertex(marched: &Marched, count: usize) -> Result<u32, MeshingError> {
    let positions = &marched.interfaces.positions;
    if positions.len() + count > INNER as usize {
        return Err(MeshingError::TooManyVertices { max: INNER });
    }
    Ok(positions.len() as u32)
}
