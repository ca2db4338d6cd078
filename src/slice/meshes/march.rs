//! Layer after layer of bricks: nodes, then vertices, then triangles.
//!
//! The vertices of a layer of bricks need the nodes of the next one, its triangles the vertices of the next one. So the
//! walk holds three layers, and a slab of nodes that was filled at once; what stays is the output. Bricks are worked on
//! in parallel and gathered in order, which numbers vertices and triangles the same way whatever the thread count.

use std::collections::VecDeque;

use glam::Vec3;
use rayon::prelude::*;

use super::{
    Bounds, MaterialMeshes, MeshingError, PartOf,
    cell::{CellOutput, EDGE_START, fill_cell},
    crossing::Crossings,
    nodes::{NodeBrick, NodeGrid, TwoLayers},
    object::{BLOCK, BLOCK_BRICKS, BLOCK_NODES, BlockScratch, NodeObject},
    vertices::{BrickVertices, step},
};
use crate::{
    sdf::SliceRuns,
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
    /// Which part of the output has the triangles of a material id.
    pub part_of: &'a PartOf,
}

/// The triangles of one brick.
struct BrickTriangles<'a> {
    part_of: &'a PartOf,
    inner: Vec<Vec3>,
    triangles: Vec<(u16, [u32; 3])>,
}

impl CellOutput for BrickTriangles<'_> {
    fn vertex(&mut self, position: Vec3) -> u32 {
        self.inner.push(position);
        INNER | (self.inner.len() - 1) as u32
    }

    fn triangle(&mut self, behind: u8, front: u8, [a, b, c]: [u32; 3]) {
        if let Some(part) = self.part_of[usize::from(behind)] {
            self.triangles.push((part, [a, b, c]));
        }
        if let Some(part) = self.part_of[usize::from(front)] {
            self.triangles.push((part, [a, c, b]));
        }
    }
}

impl March<'_> {
    /// Fills `meshes`, whose parts exist.
    pub fn run(&self, meshes: &mut MaterialMeshes, watch: &dyn Watch) -> Result<(), MeshingError> {
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
                self.add_vertices(&mut layers, next - front, next, meshes)?;
                if next > front {
                    self.add_triangles(&layers, front, meshes)?;
                    layers.pop_front();
                    front += 1;
                    watch.advance(1);
                    watch.go_on()?;
                }
                next += 1;
            }
        }
        Ok(())
    }

    fn air(&self) -> Layer {
        Layer { nodes: vec![NodeBrick::OUTSIDE; self.grid.layer_bricks()], vertices: Vec::new() }
    }

    /// The nodes of [`BLOCK`] layers of bricks.
    fn fill_slab(&self, slab: usize) -> Vec<Layer> {
        let first = (slab * BLOCK_NODES) as u32;
        let height = (self.grid.lattice.dims[2] - first).min(BLOCK_NODES as u32);
        let runs: Vec<Vec<SliceRuns>> = self
            .objects
            .iter()
            .map(|object| {
                let mut slices = vec![SliceRuns::default(); height as usize];
                object.fill_inside(first, &mut slices);
                slices
            })
            .collect();
        let blocks = [0, 1].map(|axis| self.grid.bricks[axis].div_ceil(BLOCK));
        let fill = |scratch: &mut BlockScratch, block: usize| {
            let corner = [block % blocks[0], block / blocks[0]].map(|n| (n * BLOCK_NODES) as u32);
            let mut bricks = vec![NodeBrick::OUTSIDE; BLOCK_BRICKS];
            for (object, slices) in self.objects.iter().zip(&runs) {
                object.fill_block([corner[0], corner[1], first], slices, &mut bricks, scratch);
            }
            bricks
        };
        let filled: Vec<_> = (0..blocks[0] * blocks[1]).into_par_iter().map_init(BlockScratch::default, fill).collect();
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

    fn columns(&self) -> impl IndexedParallelIterator<Item = [usize; 2]> {
        let width = self.grid.bricks[0];
        (0..self.grid.layer_bricks()).into_par_iter().map(move |n| [n % width, n / width])
    }

    /// Computes the vertices of `layers[at]`, which is layer `layer` of the grid.
    fn add_vertices(
        &self,
        layers: &mut VecDeque<Layer>,
        at: usize,
        layer: usize,
        meshes: &mut MaterialMeshes,
    ) -> Result<(), MeshingError> {
        let two = self.two(layers, at, layer);
        let crossings = || Crossings::new(self.objects, self.bounds, self.grid.lattice.pitch.x);
        let mut vertices: Vec<_> = self
            .columns()
            .map_init(crossings, |crossings, column| {
                let labels = two.labels(column)?;
                Some(BrickVertices::new(&two, column, &labels, crossings))
            })
            .collect();
        for brick in vertices.iter_mut().flatten() {
            brick.first = next_vertex(meshes, brick.positions.len())?;
            meshes.positions.append(&mut brick.positions);
            brick.positions = Vec::new();
        }
        layers[at].vertices = vertices;
        Ok(())
    }

    /// Computes the triangles in the cells of `layers[0]`, which is layer `layer` of the grid.
    fn add_triangles(
        &self,
        layers: &VecDeque<Layer>,
        layer: usize,
        meshes: &mut MaterialMeshes,
    ) -> Result<(), MeshingError> {
        let two = self.two(layers, 0, layer);
        let positions = &meshes.positions;
        let filled: Vec<_> = self.columns().map(|column| self.fill_brick(&two, layers, column, positions)).collect();
        for brick in filled.into_iter().flatten() {
            let first = next_vertex(meshes, brick.inner.len())?;
            meshes.positions.extend(brick.inner.iter().map(|position| position.to_array()));
            for (part, corners) in brick.triangles {
                let number = |corner| if corner & INNER != 0 { first + (corner & !INNER) } else { corner };
                meshes.parts[usize::from(part)].triangles.push(corners.map(number));
            }
        }
        Ok(())
    }

    fn fill_brick(
        &self,
        two: &TwoLayers,
        layers: &VecDeque<Layer>,
        column: [usize; 2],
        positions: &[[f32; 3]],
    ) -> Option<BrickTriangles<'_>> {
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
        let mut out = BrickTriangles { part_of: self.part_of, inner: Vec::new(), triangles: Vec::new() };
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
            let position = |point: usize| Vec3::from(positions[vertex(point) as usize]);
            fill_cell(&corners, vertex, position, &mut out);
        }
        Some(out)
    }
}

/// The number that the next of `count` further vertices gets.
fn next_vertex(meshes: &MaterialMeshes, count: usize) -> Result<u32, MeshingError> {
    if meshes.positions.len() + count > INNER as usize {
        return Err(MeshingError::TooManyVertices { max: INNER });
    }
    Ok(meshes.positions.len() as u32)
}
