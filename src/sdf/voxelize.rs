//! Which cells of the lattice a triangle passes through: separating axes, after Akenine-Möller, *Fast 3D triangle-box
//! overlap testing* (2001).
//!
//! A triangle and a box are apart iff one of 13 axes tells them apart: the box's 3, the triangle's normal, and the 9
//! products of an edge with a box axis. Boxes of cells are halved as long as they touch, so a large triangle costs
//! about as many tests as it has cells.
//!
//! Guarantee: every cell that holds a point of the triangle is found, a point on a face counting for both sides. A cell
//! further than [`SLACK`] from the triangle is never found.

use glam::{DVec3, IVec3};

use crate::voxel::Lattice;

/// How far beside a cell a triangle may pass and still count, mm: above the rounding of coordinates up to 10⁴ mm.
const SLACK: f64 = 1e-9;

/// A box of cells, `low` inclusive, `high` exclusive. Indices beyond the lattice are allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cells {
    /// First cell.
    pub low: IVec3,
    /// One past the last cell.
    pub high: IVec3,
}

impl Cells {
    /// The cells in both.
    pub fn intersection(&self, other: &Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.min(other.high) }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.high.cmple(self.low).any()
    }

    /// The cells that may hold a point of the box from `low` to `high` (mm), and some around them.
    pub fn around(lattice: &Lattice, low: DVec3, high: DVec3) -> Self {
        let cell = |p: DVec3| ((p - lattice.origin) / lattice.pitch).floor().as_ivec3();
        Self { low: cell(low) - IVec3::ONE, high: cell(high) + IVec3::splat(2) }
    }

    /// Halves the longest edge, in cells.
    fn halves(&self) -> [Self; 2] {
        let size = self.high - self.low;
        let longest = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
        let mut halves = [*self; 2];
        halves[0].high[longest] = self.low[longest] + size[longest] / 2;
        halves[1].low[longest] = halves[0].high[longest];
        halves
    }
}

/// Centre of a cell, on the lattice or beside it, mm.
#[inline]
pub fn cell_centre(lattice: &Lattice, cell: IVec3) -> DVec3 {
    lattice.origin + (cell.as_dvec3() + 0.5) * lattice.pitch
}

/// Visits the cells among `within` that `triangle` passes through. A box of cells is looked into only if `keep` says
/// so; it gets the cells' centres' range, low and high, mm.
pub fn for_cells(
    lattice: &Lattice,
    triangle: &[DVec3; 3],
    within: &Cells,
    mut keep: impl FnMut(DVec3, DVec3) -> bool,
    mut visit: impl FnMut(IVec3),
) {
    let [a, b, c] = triangle;
    let bounds = Cells::around(lattice, a.min(*b).min(*c), a.max(*b).max(*c)).intersection(within);
    if bounds.is_empty() {
        return;
    }
    let separators = Separators::new(triangle);
    let mut stack = vec![bounds];
    while let Some(cells) = stack.pop() {
        let low = lattice.origin + cells.low.as_dvec3() * lattice.pitch;
        let high = lattice.origin + cells.high.as_dvec3() * lattice.pitch;
        let half_cell = lattice.pitch / 2.0;
        if separators.part((low + high) / 2.0, (high - low) / 2.0) || !keep(low + half_cell, high - half_cell) {
            continue;
        }
        if cells.high - cells.low == IVec3::ONE {
            visit(cells.low);
        } else {
            let halves = cells.halves();
            stack.extend([halves[1], halves[0]]);
        }
    }
}

/// The axes that can tell a triangle from a box, with the triangle's extent along each.
struct Separators([(DVec3, f64, f64); 13]);

impl Separators {
    fn new(triangle: &[DVec3; 3]) -> Self {
        let edges: [DVec3; 3] = std::array::from_fn(|i| triangle[(i + 1) % 3] - triangle[i]);
        let axis = |n: usize| match n {
            0..3 => DVec3::AXES[n],
            3 => edges[0].cross(edges[1]),
            _ => edges[(n - 4) / 3].cross(DVec3::AXES[(n - 4) % 3]),
        };
        Self(std::array::from_fn(|n| {
            let axis = axis(n);
            let [a, b, c] = triangle.map(|corner| axis.dot(corner));
            let slack = SLACK * axis.length();
            (axis, a.min(b).min(c) - slack, a.max(b).max(c) + slack)
        }))
    }

    fn part(&self, centre: DVec3, half: DVec3) -> bool {
        self.0.iter().any(|&(axis, low, high)| {
            let (middle, reach) = (axis.dot(centre), axis.abs().dot(half));
            middle - reach > high || middle + reach < low
        })
    }
}
