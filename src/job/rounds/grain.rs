//! What lies right below a point of the surface, beside what was meant to.
//!
//! A mixture is laid of whole voxels, and so is a boundary between two layers. Below a spot of half a millimetre there
//! are some hundred voxels that light meets first, and a resin's share in them differs from what was meant by a percent
//! or so: prints of balls and cubes of albedo 0.2 are 1.5% lighter or darker for it from spot to spot, of which 0.5%
//! would be left if what these shares do were taken off. Walks tell it too slowly, for each spot would need ten
//! thousand and more of its own; voxels can be counted. What a share too much of a resin does is the same all over an
//! object and is fitted together with what shapes do ([`ByShape`](super::shape::ByShape)).
//!
//! What is laid against it is smoothed by points, nodes and spots, so that a round takes off a third of it, and lays
//! some other voxels: after four rounds 1.0 to 1.3% are left in place of 1.5%. Against what of it is left, laid and
//! counted again without walks until shares are as they were meant to 0.5%, spots are off by no less. In three channels
//! and seven inks next to nothing is gained, for there it counts how single voxels lie to one another: nothing is
//! counted.

use glam::DVec3;

use crate::{
    job::Prepared,
    look::{Site, Volume},
    optics::{Mixture, OpticsError, Stack},
    slice::ObjectField,
};

/// Depth, mm, in which what counts below the surface falls to 1/e: of albedo 0.2, shares within 0.06 mm tell what
/// spots are off by to 0.5%, within 0.03 or 0.12 mm to 0.7%. And within four times that, for brighter prints.
const SHALLOW_MM: f64 = 0.05;
const DEPTHS_MM: [f64; 2] = [SHALLOW_MM, 4.0 * SHALLOW_MM];
/// What lies deeper than this below the plane of a point is left out, and what lies higher than this above it: the
/// surface is bent, and voxels are steps.
const DEEPEST_MM: f64 = 0.4;
const ABOVE_MM: f64 = 0.1;
/// What lies beside a point counts within so many radii of its spot, by (1 − d²/reach²)²: as much as a disc of the
/// spot's size and what light travels beside it.
const REACH: f64 = 1.5;
/// Every so many sites of a spot stand for what was meant there.
const SITES_APART: usize = 4;

/// What shares of the resins labels mean to have below the surface, by label, depth and resin.
pub(super) struct Meant {
    labels: Vec<Vec<f64>>,
    resins: usize,
}

impl Meant {
    /// Of the labels of an object.
    pub fn of(prepared: &Prepared, object: usize) -> Result<Self, OpticsError> {
        let (materials, report) = (&prepared.materials, &prepared.objects[object].stackings);
        let resins = materials.resins.len();
        let shares = |stack: Stack<String>| Ok(shares_of(&materials.mixed_stack(&stack)?, resins));
        Ok(Self { labels: report.stacks_of_labels().map(shares).collect::<Result<_, OpticsError>>()?, resins })
    }

    /// How many numbers [`Self::beside`] has.
    pub fn numbers(&self) -> usize {
        DEPTHS_MM.len() * self.resins
    }

    /// Shares of the resins below a spot of `radius_mm` less those that were meant there, by depth and resin; zeros
    /// where there are no resins.
    pub fn beside(&self, volume: &Volume, field: &ObjectField, sites: &[Site], radius_mm: f64) -> Vec<f64> {
        let Some(mut found) = self.laid(volume, &sites[0], radius_mm) else { return vec![0.0; self.numbers()] };
        let surface = field.surface();
        let some = sites.iter().step_by(SITES_APART);
        let each = 1.0 / some.len() as f64;
        for site in some {
            let nearest = surface.closest(site.point);
            for shared in field.shares(nearest.triangle, nearest.point) {
                let Some(meant) = self.labels.get(usize::from(shared.stacking)) else { continue };
                let weight = each * f64::from(shared.share);
                found.iter_mut().zip(meant).for_each(|(found, meant)| *found -= weight * meant);
            }
        }
        found
    }

    /// Shares of the resins below a spot, by depth and resin; `None` where there are none.
    fn laid(&self, volume: &Volume, middle: &Site, radius_mm: f64) -> Option<Vec<f64>> {
        let mut shares = vec![0.0; self.numbers()];
        let mut sums = [0.0; DEPTHS_MM.len()];
        let lattice = volume.lattice();
        let below = Below { normal: middle.normal, reach_mm: REACH * radius_mm };
        let [low, high] =
            below.box_of().map(|corner| ((middle.point + corner - lattice.origin) / lattice.pitch - 0.5).to_array());
        let range = |axis: usize| low[axis].ceil() as i64..=high[axis].floor() as i64;
        for (j, k) in range(2).flat_map(|k| range(1).map(move |j| (j, k))) {
            let row = lattice.origin + lattice.pitch * (DVec3::new(0.0, j as f64, k as f64) + 0.5) - middle.point;
            let Some([from, to]) = below.stretch(row, lattice.pitch.x) else { continue };
            for i in from.ceil() as i64..=to.floor() as i64 {
                let resin = volume.voxel([i, j, k]).resin().filter(|&resin| resin < self.resins);
                let Some(resin) = resin else { continue };
                let [shallow, deep] = below.weights(row + DVec3::X * (lattice.pitch.x * i as f64));
                for (n, weight) in [shallow, deep].into_iter().enumerate() {
                    sums[n] += weight;
                    shares[n * self.resins + resin] += weight;
                }
            }
        }
        for (of_depth, sum) in shares.chunks_mut(self.resins.max(1)).zip(sums) {
            of_depth.iter_mut().for_each(|share| *share /= sum);
        }
        sums.iter().all(|sum| *sum > 0.0).then_some(shares)
    }
}

/// Shares of the resins below the surface of a stack, by depth and resin.
fn shares_of(stack: &Stack<Mixture>, resins: usize) -> Vec<f64> {
    let mut shares = vec![0.0; DEPTHS_MM.len() * resins];
    for (of_depth, depth) in shares.chunks_mut(resins.max(1)).zip(DEPTHS_MM) {
        let left_at = |mm: f64| libm::exp(-mm.min(DEEPEST_MM) / depth);
        let mut add = |mixture: &Mixture, from: f64, to: f64| {
            let weight = left_at(from) - left_at(to);
            mixture.parts().iter().for_each(|(resin, share)| of_depth[resin.0] += weight * share);
        };
        let mut top = 0.0;
        for layer in &stack.layers {
            add(&layer.resin, top, top + layer.thickness_mm);
            top += layer.thickness_mm;
        }
        stack.core.iter().for_each(|core| add(core, top, f64::INFINITY));
        let all: f64 = of_depth.iter().sum();
        of_depth.iter_mut().for_each(|share| *share /= all.max(f64::MIN_POSITIVE));
    }
    shares
}

/// What counts below a point of the surface: a cylinder along its normal. Positions are ways from the point.
struct Below {
    normal: DVec3,
    reach_mm: f64,
}

impl Below {
    /// The box around it.
    fn box_of(&self) -> [DVec3; 2] {
        let [deepest, above] = [self.normal * -DEEPEST_MM, self.normal * ABOVE_MM];
        let sideways = (DVec3::ONE - self.normal * self.normal).max(DVec3::ZERO).map(f64::sqrt) * self.reach_mm;
        [deepest.min(above) - sideways, deepest.max(above) + sideways]
    }

    /// From which to which step along x the row of steps of `pitch` mm from `start` lies within.
    fn stretch(&self, start: DVec3, pitch: f64) -> Option<[f64; 2]> {
        let (height, rise) = (start.dot(self.normal), pitch * self.normal.x);
        // (start + pitch t x)² − (height + rise t)² ≤ reach²
        let a = pitch * pitch - rise * rise;
        let b = pitch * start.x - height * rise;
        let c = start.length_squared() - height * height - self.reach_mm * self.reach_mm;
        let [mut from, mut to] = [f64::NEG_INFINITY, f64::INFINITY];
        if a > 1e-12 * pitch * pitch {
            let discriminant = b * b - a * c;
            if discriminant < 0.0 {
                return None;
            }
            let root = discriminant.sqrt();
            [from, to] = [(-b - root) / a, (-b + root) / a];
        } else if c > 0.0 {
            return None;
        }
        if rise != 0.0 {
            let ends = [-DEEPEST_MM, ABOVE_MM].map(|end| (end - height) / rise);
            [from, to] = [from.max(ends[0].min(ends[1])), to.min(ends[0].max(ends[1]))];
        } else if !(-DEEPEST_MM..=ABOVE_MM).contains(&height) {
            return None;
        }
        (from <= to).then_some([from, to])
    }

    /// What a voxel counts, by depth.
    fn weights(&self, way: DVec3) -> [f64; DEPTHS_MM.len()] {
        let height = way.dot(self.normal);
        let bell = (1.0 - (way.length_squared() - height * height) / (self.reach_mm * self.reach_mm)).max(0.0);
        let fall = libm::exp(height.min(0.0) / DEPTHS_MM[1]);
        let squared = fall * fall;
        [bell * bell * squared * squared, bell * bell * fall]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        optics::{Layer, ResinId},
        voxel::Lattice,
    };

    fn lattice() -> Lattice {
        Lattice { origin: DVec3::new(-1.0, -1.0, -1.0), pitch: DVec3::new(0.0423, 0.0847, 0.027), dims: [48, 24, 75] }
    }

    /// Every voxel of a lattice around a point, or those that the stretches of its rows hold: the same.
    #[test]
    fn stretches_of_rows_are_the_cylinder() {
        let lattice = lattice();
        for normal in [DVec3::X, -DVec3::Y, DVec3::Z, DVec3::new(0.3, -0.5, 0.8), DVec3::new(0.99, 0.1, 0.0)] {
            let below = Below { normal: normal.normalize(), reach_mm: 0.375 };
            let mut inside = 0;
            for (j, k) in (0..24).flat_map(|j| (0..75).map(move |k| (j, k))) {
                let row = lattice.centre([0, j, k]);
                let held = below.stretch(row, lattice.pitch.x);
                for i in 0..48 {
                    let way = lattice.centre([i, j, k]);
                    let height = way.dot(below.normal);
                    let aside = (way - below.normal * height).length();
                    let wanted = (-DEEPEST_MM..=ABOVE_MM).contains(&height) && aside <= below.reach_mm;
                    let found = held.is_some_and(|[from, to]| (from..=to).contains(&f64::from(i)));
                    assert_eq!(found, wanted, "{normal} {i} {j} {k}");
                    inside += u32::from(wanted);
                    let [low, high] = below.box_of();
                    assert!(!wanted || way.cmpge(low - 1e-9).all() && way.cmple(high + 1e-9).all());
                }
            }
            assert!(inside > 1000, "{normal}: {inside}");
        }
    }

    /// Slices of one resin over another: what is laid is what the stack means.
    #[test]
    fn what_is_laid_in_whole_slices_is_what_was_meant() {
        let mut volume = Volume::new(lattice()).unwrap();
        for first in (0..75).step_by(Volume::LAYER as usize) {
            let slices = first..75.min(first + Volume::LAYER);
            volume.add_slices(slices, |_, k, row| row.fill(if k >= 71 { 1 } else { 2 }));
        }
        let top = lattice().origin.z + 75.0 * 0.027;
        let middle = Site { point: DVec3::new(0.0, 0.0, top), normal: DVec3::Z };
        let layer = Layer { resin: Mixture::from(ResinId(0)), thickness_mm: 4.0 * 0.027 };
        let stack = Stack { layers: vec![layer], core: Some(Mixture::from(ResinId(1))) };
        let meant = Meant { labels: vec![shares_of(&stack, 2)], resins: 2 };
        let laid = meant.laid(&volume, &middle, 0.25).unwrap();
        for (laid, meant) in laid.iter().zip(&meant.labels[0]) {
            assert!((laid - meant).abs() < 0.01, "{laid} {meant}");
        }
        assert!(laid.chunks(2).all(|of_depth| (of_depth.iter().sum::<f64>() - 1.0).abs() < 1e-12));
        let nowhere = Site { point: middle.point + DVec3::Z * 5.0, ..middle };
        assert!(meant.laid(&volume, &nowhere, 0.25).is_none());
    }
}
