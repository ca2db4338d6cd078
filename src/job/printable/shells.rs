//! Shells that leave nothing: bodies of an object so small or so thin that no voxel's centre lies within.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use crate::{
    disjoint_sets::DisjointSets,
    job::{Prepared, RunError},
    sdf::{InsideRows, SliceRuns},
    voxel::Lattice,
    watch::Watch,
};

/// Shells of an object that have no voxel.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct LostShells {
    /// How many.
    pub count: u64,
    /// Their volume, mm³.
    pub mm3: f64,
    /// The middle of the first in the mesh, mm in the lattice's frame.
    pub first_mm: Option<[f64; 3]>,
}

/// A body of so many voxels that is thicker than a voxel is long has some.
const ENOUGH_VOXELS: f64 = 8.0;

impl Prepared {
    /// Shells of an object that no voxel's centre lies in.
    pub(super) fn lost_shells(&self, object: usize, watch: &dyn Watch) -> Result<LostShells, RunError> {
        watch.go_on()?;
        Ok(LostShells::of(self.slicer().objects()[object].surface().triangles(), &self.lattice))
    }
}

impl LostShells {
    fn of(triangles: &[[DVec3; 3]], lattice: &Lattice) -> Self {
        let shells = shells(triangles);
        let lost: Vec<Option<(f64, DVec3)>> = shells.par_iter().map(|shell| lost(shell, lattice)).collect();
        lost.into_iter().flatten().fold(Self::default(), |mut found, (mm3, middle)| {
            found.count += 1;
            found.mm3 += mm3;
            found.first_mm.get_or_insert(middle.to_array());
            found
        })
    }
}

/// Triangles that share corners, shell by shell in the order of their first triangle.
fn shells(triangles: &[[DVec3; 3]]) -> Vec<Vec<[DVec3; 3]>> {
    let mut sets = DisjointSets::new(triangles.len());
    let mut first: HashMap<[u64; 3], u32> = HashMap::with_capacity(triangles.len() / 2);
    for (at, triangle) in (0..).zip(triangles) {
        for corner in triangle {
            // −0 is 0.
            let key = (*corner + 0.0).to_array().map(f64::to_bits);
            sets.join(*first.entry(key).or_insert(at), at);
        }
    }
    let mut place: HashMap<u32, usize> = HashMap::new();
    let mut shells: Vec<Vec<[DVec3; 3]>> = Vec::new();
    for (at, triangle) in (0..).zip(triangles) {
        let shell = *place.entry(sets.root(at)).or_insert(shells.len());
        if shell == shells.len() {
            shells.push(Vec::new());
        }
        shells[shell].push(*triangle);
    }
    shells
}

/// Volume and middle of a shell that no voxel's centre lies in; `None` of others, and of cavities.
fn lost(shell: &[[DVec3; 3]], lattice: &Lattice) -> Option<(f64, DVec3)> {
    let origin = shell[0][0];
    let [mut volume, mut area] = [0.0, 0.0];
    let [mut low, mut high] = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    for [a, b, c] in shell.iter().map(|corners| corners.map(|corner| corner - origin)) {
        volume += a.dot(b.cross(c)) / 6.0;
        area += (b - a).cross(c - a).length() / 2.0;
        low = low.min(a).min(b).min(c);
        high = high.max(a).max(b).max(c);
    }
    let thickness = 2.0 * volume / area.max(f64::MIN_POSITIVE);
    let is_small = volume < ENOUGH_VOXELS * lattice.voxel_volume() || thickness < lattice.pitch.max_element();
    if volume <= 0.0 || !is_small {
        return None;
    }
    // The voxels around it.
    let most = DVec3::from(lattice.dims.map(f64::from));
    let voxel = |place: DVec3| ((place + origin - lattice.origin) / lattice.pitch).clamp(DVec3::ZERO, most);
    let (first, end) = (voxel(low).floor(), voxel(high).ceil());
    let dims = (end - first).max(DVec3::ONE).to_array().map(|voxels| voxels as u32);
    let around = Lattice { origin: lattice.origin + first * lattice.pitch, dims, ..*lattice };
    let rows = InsideRows::of_triangles(shell.into(), around, dims[2]);
    let mut slice = SliceRuns::default();
    let has_voxels = (0..dims[2]).any(|k| {
        rows.fill_slice(k, &mut slice);
        (0..dims[1]).any(|j| !slice.row(j).is_empty())
    });
    (!has_voxels).then(|| (volume, origin + 0.5 * (low + high)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(low: [f64; 3], size: [f64; 3]) -> Vec<[DVec3; 3]> {
        let corner =
            |n: usize| DVec3::from(low) + DVec3::from(size) * DVec3::from([0, 1, 2].map(|axis| (n >> axis & 1) as f64));
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|face| face.map(corner)).collect()
    }

    #[test]
    fn what_lies_between_centres_is_lost() {
        let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::new(0.1, 0.2, 0.1), dims: [100, 50, 100] };
        let of = |bodies: &[([f64; 3], [f64; 3])]| {
            let triangles: Vec<_> = bodies.iter().flat_map(|&(low, size)| cuboid(low, size)).collect();
            LostShells::of(&triangles, &lattice)
        };
        let body = ([1.0, 1.0, 1.0], [3.0, 3.0, 3.0]);
        // Centres are at 0.05 + 0.1 n in x and z, at 0.1 + 0.2 n in y.
        let bead = ([5.06, 5.0, 5.0], [0.08, 1.0, 0.2]);
        let sheet = ([5.0, 5.0, 7.06], [4.0, 4.0, 0.08]);
        let sheet_with_voxels = ([5.0, 5.0, 9.0], [4.0, 4.0, 0.08]);
        assert_eq!(of(&[body, sheet_with_voxels]), LostShells::default());
        let lost = of(&[body, bead, sheet]);
        assert_eq!(lost.count, 2);
        assert!((lost.mm3 - (0.08 * 0.2 + 16.0 * 0.08)).abs() < 1e-9, "{lost:?}");
        let first = DVec3::from(lost.first_mm.unwrap());
        assert!((first - DVec3::new(5.10, 5.5, 5.1)).length() < 1e-9, "{first}");
        // A cavity is no body.
        let cavity: Vec<_> =
            cuboid([5.06, 5.0, 5.0], [0.03, 0.1, 0.1]).into_iter().map(|[a, b, c]| [a, c, b]).collect();
        assert_eq!(LostShells::of(&cavity, &lattice), LostShells::default());
    }
}
