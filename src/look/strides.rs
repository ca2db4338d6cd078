//! How far light may fly before it must ask again what lies around it.
//!
//! Delta tracking (Woodcock et al. 1965) draws flights as if one density filled space and then asks whether a collision
//! is real. One density for a whole print is expensive where air or clear resin lies beside white: most collisions are
//! not real there. So every brick has a **class**, the density that bounds all of its voxels, and for each octant of
//! directions the edge of a cube of bricks that begins with it and in which nothing is denser. A flight goes through
//! that cube at once. In air the bound is 0 and the cube is left in one step, however large; in the densest resin the
//! cube has no end and nothing is asked.
//!
//! ```text
//!   ┌───┬───┬───┐   edge 3 for flights up and to the right from B: beyond the cube comes something denser, or its
//!   │   │   │   │   edge would be larger
//!   ├───┼───┼───┤
//!   │   │   │   │   beyond the lattice is air: a cube that reaches there goes on
//!   ├───┼───┼───┤
//!   │ B │   │   │
//!   └───┴───┴───┘
//! ```
//!
//! Bounds only decide the work, never the result: any bound gives an estimate without bias.

use glam::DVec3;

use super::Volume;
use crate::parallel;
use crate::voxel::{BRICK_VOXELS, Tile};

/// Density bounds of the bricks of a volume in one channel.
#[derive(Debug, Clone)]
pub(super) struct Strides {
    /// σt of each class, per mm, ascending, the first one 0.
    pub sigma: Vec<f64>,
    /// What is known of each brick.
    pub of: Vec<Stride>,
}

/// A brick's class, and how far nothing is denser.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stride {
    pub class: u8,
    /// Edges of cubes of bricks in which nothing is denser, at least 1: bits 0, 1 and 2 of the index say that the cube
    /// goes down along x, y and z.
    pub edges: [u8; 8],
}

impl Stride {
    /// Within so many bricks on every side nothing is denser.
    pub fn radius(&self) -> u8 {
        self.edges.iter().fold(FAR, |least, edge| least.min(*edge)) - 1
    }
}

/// Which octant a direction lies in.
#[inline(always)]
pub(super) fn octant(step: DVec3) -> usize {
    usize::from(step.x < 0.0) | usize::from(step.y < 0.0) << 1 | usize::from(step.z < 0.0) << 2
}

/// The largest edge of a cube.
const FAR: u8 = u8::MAX - 1;

/// Most classes; resins of more densities share the next larger one.
pub(super) const MAX_CLASSES: usize = 8;

impl Strides {
    /// `sigma_t` by id, per mm; `present` tells which ids there are.
    pub fn new(volume: &Volume, sigma_t: &[f64; 256], present: &[bool; 256]) -> Self {
        let mut sigma: Vec<f64> = (0..256).filter(|&id| present[id]).map(|id| sigma_t[id]).collect();
        sigma.push(0.0);
        sigma.sort_by(f64::total_cmp);
        sigma.dedup();
        while sigma.len() > MAX_CLASSES {
            // The two that are most alike share the larger; air stays apart.
            let step = |at: &usize| sigma[at + 1] / sigma[*at];
            let least = (1..sigma.len() - 1).min_by(|a, b| step(a).total_cmp(&step(b))).unwrap_or(1);
            sigma.remove(least);
        }
        let class_of: [u8; 256] =
            std::array::from_fn(|id| sigma.partition_point(|class| *class < sigma_t[id]).min(sigma.len() - 1) as u8);
        let bricks = volume.bricks();
        let class = |brick: usize| match volume.tile(brick, &mut [0; BRICK_VOXELS]) {
            Tile::Uniform(id) => class_of[usize::from(id.0)],
            Tile::Dense(ids) => ids.iter().map(|id| class_of[usize::from(*id)]).max().unwrap_or(0),
        };
        let classes: Vec<u8> = parallel::map(bricks.iter().product(), class);
        let mut of: Vec<Stride> = classes.iter().map(|class| Stride { class: *class, edges: [FAR; 8] }).collect();
        let densest = classes.iter().copied().max().unwrap_or(0);
        for level in 0..densest {
            if !classes.contains(&level) {
                continue;
            }
            let edges: Vec<Vec<u8>> = parallel::map(8, |octant| cubes(&classes, bricks, level, octant));
            for (brick, stride) in of.iter_mut().enumerate().filter(|(_, stride)| stride.class == level) {
                stride.edges = std::array::from_fn(|octant| edges[octant][brick]);
            }
        }
        Self { sigma, of }
    }
}

/// Edges of the largest cubes of bricks that begin with each brick, go on into an octant, and hold nothing above
/// `level`; 0 where the brick itself does. A cube is one brick and what is common to the cubes of its seven neighbours
/// there.
fn cubes(classes: &[u8], [nx, ny, nz]: [usize; 3], level: u8, octant: usize) -> Vec<u8> {
    let mut edges = vec![0_u8; classes.len()];
    let down = [0, 1, 2].map(|axis| octant >> axis & 1 == 1);
    // From the far end of the octant backwards.
    let from_far = |n: usize, down: bool| (0..n).map(move |at| if down { at } else { n - 1 - at });
    let beyond =
        |at: usize, n: usize, down: bool| if down { at.checked_sub(1) } else { Some(at + 1).filter(|at| *at < n) };
    for z in from_far(nz, down[2]) {
        for y in from_far(ny, down[1]) {
            for x in from_far(nx, down[0]) {
                let brick = x + nx * (y + ny * z);
                if classes[brick] > level {
                    continue;
                }
                let [xs, ys, zs] = [(x, nx, down[0]), (y, ny, down[1]), (z, nz, down[2])]
                    .map(|(at, n, down)| [Some(at), beyond(at, n, down)]);
                let mut least = FAR - 1;
                for (i, j, k) in (1..8).map(|corner| (xs[corner & 1], ys[corner >> 1 & 1], zs[corner >> 2])) {
                    // Beyond the lattice there is air.
                    if let (Some(x), Some(y), Some(z)) = (i, j, k) {
                        least = least.min(edges[x + nx * (y + ny * z)]);
                    }
                }
                edges[brick] = least + 1;
            }
        }
    }
    edges
}

/// Steps of a king in three dimensions from every brick to the nearest that is `denser`, at most 255.
pub(super) fn steps_to(classes: &[u8], [nx, ny, nz]: [usize; 3], denser: impl Fn(u8) -> bool) -> Vec<u8> {
    let mut steps: Vec<u8> = classes.iter().map(|class| if denser(*class) { 0 } else { u8::MAX }).collect();
    // Over the 13 neighbours that come before in the order of bricks, then over those that come after: exact for this
    // distance (Rosenfeld and Pfaltz 1966).
    let before: Vec<[i64; 3]> =
        (-1..=1).flat_map(|z| (-1..=1).flat_map(move |y| (-1..=1).map(move |x| [x, y, z]))).take(13).collect();
    for sign in [1, -1] {
        let offsets: Vec<[i64; 3]> = before.iter().map(|offset| offset.map(|step| sign * step)).collect();
        let visit = |brick: usize, steps: &mut Vec<u8>| {
            if steps[brick] == 0 {
                return;
            }
            let at = [brick % nx, brick / nx % ny, brick / (nx * ny)].map(|at| at as i64);
            let mut least = steps[brick];
            for [x, y, z] in &offsets {
                let [x, y, z] = [at[0] + x, at[1] + y, at[2] + z];
                if x >= 0 && y >= 0 && z >= 0 && x < nx as i64 && y < ny as i64 && z < nz as i64 {
                    let beside = steps[x as usize + nx * (y as usize + ny * z as usize)];
                    least = least.min(beside.saturating_add(1));
                }
            }
            steps[brick] = least;
        };
        if sign == 1 {
            (0..steps.len()).for_each(|brick| visit(brick, &mut steps));
        } else {
            (0..steps.len()).rev().for_each(|brick| visit(brick, &mut steps));
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every cube by looking into it: nothing above the level is in it, and something is in the next larger one.
    #[test]
    fn cubes_end_where_something_denser_comes() {
        let n = [7_i64, 5, 6];
        let classes: Vec<u8> = (0..210).map(|brick: usize| (brick * brick % 61 % 37 / 18) as u8).collect();
        let holds_denser = |at: [i64; 3], edge: i64, octant: usize, level: u8| {
            let along = |axis: usize, step: i64| at[axis] + if octant >> axis & 1 == 1 { -step } else { step };
            (0..edge.pow(3)).any(|cell| {
                let [x, y, z] = [along(0, cell % edge), along(1, cell / edge % edge), along(2, cell / (edge * edge))];
                let inside = [x, y, z].iter().zip(n).all(|(at, n)| (0..n).contains(at));
                inside && classes[(x + n[0] * (y + n[1] * z)) as usize] > level
            })
        };
        let mut ends = 0;
        for (level, octant) in (0..2).flat_map(|level| (0..8).map(move |octant| (level, octant))) {
            for (brick, edge) in (0..).zip(cubes(&classes, n.map(|n| n as usize), level, octant)) {
                let at = [brick % n[0], brick / n[0] % n[1], brick / (n[0] * n[1])];
                let edge = i64::from(edge);
                // Wider than the whole lattice: no end.
                let seen = edge.min(8);
                assert!(edge == 0 || !holds_denser(at, seen, octant, level), "{at:?} {octant} {edge}");
                assert!(edge > 8 || holds_denser(at, edge + 1, octant, level), "{at:?} {octant} {edge}");
                ends += usize::from((1..8).contains(&edge));
            }
        }
        assert!(ends > 300, "{ends} cubes with an end test little");
    }

    #[test]
    fn steps_are_those_of_a_king() {
        let n = [7, 5, 6];
        let classes: Vec<u8> = (0..210).map(|brick| u8::from(brick % 97 == 13)).collect();
        let at = |brick: usize| [brick % 7, brick / 7 % 5, brick / 35].map(|at| at as i64);
        for (brick, steps) in steps_to(&classes, n, |class| class > 0).into_iter().enumerate() {
            let distance = |other: usize| (0..3).map(|axis| (at(brick)[axis] - at(other)[axis]).abs()).max();
            let nearest = (0..210).filter(|&other| classes[other] > 0).filter_map(distance).min();
            assert_eq!(Some(i64::from(steps)), nearest);
        }
    }
}
