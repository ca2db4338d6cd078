//! The lattice of nodes that material meshes are marched on, as sparse bricks.
//!
//! ```text
//!   layer   all bricks of one height, 8 nodes high     three are held at a time
//!   brick   8 × 8 × 8 nodes                            one label for all, or a record for each
//! ```
//!
//! Nodes lie at (index + ½) · pitch, as voxel centres of an isotropic lattice would, so that a face at a multiple of
//! the pitch falls between two of them. The outermost nodes are outside of every object.

use glam::DVec3;

use crate::voxel::{BRICK, BRICK_VOXELS, Lattice};

/// Owner of a node outside of all objects; greater than every object's number.
pub const NO_OBJECT: u16 = u16::MAX;

/// Label of what is not meshed: air, and the resins that print as voids.
pub const VOID: u8 = 0;

/// The node lattice and its bricks.
#[derive(Debug, Clone, Copy)]
pub struct NodeGrid {
    /// Nodes as voxel centres.
    pub lattice: Lattice,
    /// Bricks per axis.
    pub bricks: [usize; 3],
}

/// What is known of one node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Material id, or [`VOID`].
    pub label: u8,
    /// Number of the object the node is in, or [`NO_OBJECT`].
    pub owner: u16,
    /// Number of the object that `nearest` speaks of, or [`NO_OBJECT`] where it was not needed.
    pub measured: u16,
    /// The nearest surface point.
    pub nearest: Nearest,
}

/// The surface point nearest to a node.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Nearest {
    /// Unsigned distance, mm.
    pub distance: f32,
    /// Its triangle.
    pub triangle: u32,
}

impl Node {
    /// A node in air.
    pub const OUTSIDE: Self = Self::unmeasured(VOID, NO_OBJECT);

    const fn unmeasured(label: u8, owner: u16) -> Self {
        let nearest = Nearest { distance: 0.0, triangle: 0 };
        Self { label, owner, measured: NO_OBJECT, nearest }
    }
}

/// The nodes of one brick; x runs fastest, then y, then z.
#[derive(Debug, Clone)]
pub enum NodeBrick {
    /// All alike, none measured.
    Uniform {
        /// See [`Node::label`].
        label: u8,
        /// See [`Node::owner`].
        owner: u16,
    },
    /// One by one.
    Dense(Box<[Node; BRICK_VOXELS]>),
}

impl NodeBrick {
    /// A brick in air.
    pub const OUTSIDE: Self = Self::Uniform { label: VOID, owner: NO_OBJECT };

    /// Node `index` of the brick.
    #[inline]
    pub fn node(&self, index: usize) -> Node {
        match self {
            Self::Uniform { label, owner } => Node::unmeasured(*label, *owner),
            Self::Dense(nodes) => nodes[index],
        }
    }

    #[inline]
    fn label(&self, index: usize) -> u8 {
        match self {
            Self::Uniform { label, .. } => *label,
            Self::Dense(nodes) => nodes[index].label,
        }
    }

    /// The nodes for writing; a uniform brick is unfolded first.
    pub fn dense_mut(&mut self) -> &mut [Node; BRICK_VOXELS] {
        if let Self::Uniform { label, owner } = *self {
            *self = Self::Dense(Box::new([Node::unmeasured(label, owner); BRICK_VOXELS]));
        }
        match self {
            Self::Dense(nodes) => nodes,
            Self::Uniform { .. } => unreachable!("it has just been unfolded"),
        }
    }
}

impl NodeGrid {
    /// The grid at `pitch` mm that has a node outside of `low..high` on every side, or the number of nodes along the
    /// axis that has more than `most`.
    pub fn around(low: DVec3, high: DVec3, pitch: f64, most: u32) -> Result<Self, (usize, f64)> {
        let first = (low / pitch).floor() - 1.0;
        let nodes = (high / pitch).ceil() + 1.0 - first;
        if let Some(axis) = (0..3).find(|&axis| nodes[axis].is_nan() || nodes[axis] > f64::from(most)) {
            return Err((axis, nodes[axis]));
        }
        let dims = [nodes.x as u32, nodes.y as u32, nodes.z as u32];
        let lattice = Lattice { origin: first * pitch, pitch: DVec3::splat(pitch), dims };
        Ok(Self { lattice, bricks: dims.map(|n| (n as usize).div_ceil(BRICK)) })
    }

    /// Bricks in a layer.
    pub fn layer_bricks(&self) -> usize {
        self.bricks[0] * self.bricks[1]
    }
}

/// Nodes per axis that the cells of one brick touch.
const SPAN: usize = BRICK + 1;

/// The labels of all nodes that the cells of one brick touch: its own and the first ones of its upper neighbours.
#[derive(Debug, Clone)]
pub struct Labels([u8; SPAN * SPAN * SPAN]);

/// Two layers of bricks, one above the other; what lies beside them is air.
#[derive(Debug, Clone, Copy)]
pub struct TwoLayers<'a> {
    /// The grid.
    pub grid: &'a NodeGrid,
    /// Number of the lower layer.
    pub layer: usize,
    /// The lower layer, rows of x.
    pub lower: &'a [NodeBrick],
    /// The upper layer.
    pub upper: &'a [NodeBrick],
}

impl<'a> TwoLayers<'a> {
    /// The brick in column (x, y) of the lower (0) or upper (1) layer.
    #[inline]
    fn brick(&self, [x, y, z]: [usize; 3]) -> &'a NodeBrick {
        let bricks = if z == 0 { self.lower } else { self.upper };
        if x < self.grid.bricks[0] && y < self.grid.bricks[1] {
            &bricks[x + self.grid.bricks[0] * y]
        } else {
            &NodeBrick::OUTSIDE
        }
    }

    /// The node at an index whose z counts from the bottom of the lower layer, and its position.
    pub fn node(&self, [x, y, z]: [usize; 3]) -> (Node, DVec3) {
        let brick = self.brick([x / BRICK, y / BRICK, z / BRICK]);
        let node = brick.node(x % BRICK + BRICK * (y % BRICK + BRICK * (z % BRICK)));
        (node, self.grid.lattice.centre([x as u32, y as u32, (self.layer * BRICK + z) as u32]))
    }

    /// The labels around the cells of brick (x, y) of the lower layer; `None` where they are all the same.
    pub fn labels(&self, [x, y]: [usize; 2]) -> Option<Labels> {
        let around: [&NodeBrick; 8] = std::array::from_fn(|n| self.brick([x + (n & 1), y + (n >> 1 & 1), n >> 2 & 1]));
        if let NodeBrick::Uniform { label, .. } = around[0] {
            let same = |brick: &NodeBrick| matches!(brick, NodeBrick::Uniform { label: other, .. } if other == label);
            if around.iter().all(|brick| same(brick)) {
                return None;
            }
        }
        let mut labels = [VOID; SPAN * SPAN * SPAN];
        for (n, label) in labels.iter_mut().enumerate() {
            let at = [n % SPAN, n / SPAN % SPAN, n / (SPAN * SPAN)];
            let brick = at[0] / BRICK + 2 * (at[1] / BRICK) + 4 * (at[2] / BRICK);
            *label = around[brick].label(at[0] % BRICK + BRICK * (at[1] % BRICK + BRICK * (at[2] % BRICK)));
        }
        labels.iter().any(|&label| label != labels[0]).then_some(Labels(labels))
    }
}

impl Labels {
    /// The label of node (x, y, z), each 0 to 8, in the brick.
    #[inline]
    pub fn at(&self, [x, y, z]: [usize; 3]) -> u8 {
        self.0[x + SPAN * (y + SPAN * z)]
    }

    /// The labels of the corners of cell (x, y, z), each 0 to 7: corner c at x + (c & 1), y + (c >> 1 & 1), z + (c >>
    /// 2).
    #[inline]
    pub fn cell(&self, [x, y, z]: [usize; 3]) -> [u8; 8] {
        let first = x + SPAN * (y + SPAN * z);
        std::array::from_fn(|c| self.0[first + (c & 1) + SPAN * ((c >> 1 & 1) + SPAN * (c >> 2))])
    }

    /// Whether there are more than two different ones.
    pub fn more_than_two(&self) -> bool {
        let first = self.0[0];
        let mut second = None;
        self.0.iter().any(|&label| label != first && *second.get_or_insert(label) != label)
    }
}
