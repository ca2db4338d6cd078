//! How far light may fly before it must ask again what lies around it.
//!
//! Delta tracking (Woodcock et al. 1965) draws flights as if one density filled space and then asks whether a collision
//! is real. One density for a whole print is expensive where air or clear resin lies beside white: most collisions are
//! not real there. So every brick has a **class**, the density that bounds all of its voxels, and a **radius**: within
//! so many bricks around it nothing is denser. A flight goes through that cube of bricks at once. In air the bound is 0
//! and the cube is left in one step, however large; in the densest resin the cube has no end and nothing is asked.
//!
//! Bounds only decide the work, never the result: any bound gives an estimate without bias.

use rayon::prelude::*;

use super::Volume;
use crate::voxel::Tile;

/// Density bounds of the bricks of a volume in one channel.
#[derive(Debug, Clone)]
pub(super) struct Strides {
    /// σt of each class, per mm, ascending, the first one 0.
    pub sigma: Vec<f64>,
    /// Class and radius of each brick.
    pub of: Vec<[u8; 2]>,
}

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
        let class = |brick: usize| match volume.tile(brick) {
            Tile::Uniform(id) => class_of[usize::from(id.0)],
            Tile::Dense(ids) => ids.iter().map(|id| class_of[usize::from(*id)]).max().unwrap_or(0),
        };
        let classes: Vec<u8> = (0..bricks.iter().product()).into_par_iter().map(class).collect();
        let mut of: Vec<[u8; 2]> = classes.iter().map(|class| [*class, u8::MAX]).collect();
        let densest = classes.iter().copied().max().unwrap_or(0);
        for level in 0..densest {
            if !classes.contains(&level) {
                continue;
            }
            let steps = steps_to(&classes, bricks, |class| class > level);
            for (stride, steps) in of.iter_mut().zip(steps).filter(|(stride, _)| stride[0] == level) {
                stride[1] = steps - 1; // it is not denser than itself, so at least one step off
            }
        }
        Self { sigma, of }
    }
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
