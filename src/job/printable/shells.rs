//! Shells that leave nothing: closed parts of an object so small or so thin that no voxel's centre lies within.
//!
//! Told by the outline, holes closed and all bodies before their union, as inside is told from outside.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use glam::DVec3;
use serde::Serialize;

use super::pieces::MOST_BOXES;
use crate::{
    disjoint_sets::DisjointSets,
    job::{Prepared, RunError},
    parallel,
    sdf::{InsideRows, SliceRuns},
    voxel::Lattice,
    watch::{Stopped, Watch},
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
    /// Corners of the boxes around them, the first [`MOST_BOXES`], for the picture.
    #[serde(skip)]
    pub(in crate::job) boxes: Vec<[DVec3; 2]>,
}

/// A shell of so many voxels that is thicker than a voxel is long has some.
const ENOUGH_VOXELS: f64 = 8.0;
/// Shells between two looks at the watch.
const AT_ONCE: usize = 256;

/// A shell by what it measures.
#[derive(Debug, Clone)]
struct Shell {
    /// Of its triangles the first, which volumes are summed from.
    origin: DVec3,
    volume: f64,
    area: f64,
    low: DVec3,
    high: DVec3,
}

impl Prepared {
    /// Shells of an object that no voxel's centre lies in.
    pub(super) fn lost_shells(&self, object: usize, watch: &dyn Watch) -> Result<LostShells, RunError> {
        let inside = self.slicer().objects()[object].inside();
        Ok(LostShells::of(inside, &self.lattice, watch)?)
    }
}

impl LostShells {
    fn of(inside: &InsideRows, lattice: &Lattice, watch: &dyn Watch) -> Result<Self, Stopped> {
        watch.go_on()?;
        let triangles = inside.triangles();
        let (of_triangle, shells) = shells(triangles);
        // Only those are taken apart that may be lost.
        let mut members: BTreeMap<usize, Vec<[DVec3; 3]>> = BTreeMap::new();
        let is_doubtful: Vec<bool> = shells.iter().map(|shell| shell.is_doubtful(lattice)).collect();
        for (triangle, shell) in triangles.iter().zip(&of_triangle) {
            if is_doubtful[*shell] {
                members.entry(*shell).or_default().push(*triangle);
            }
        }
        let doubtful: Vec<_> = members.into_iter().collect();
        let mut found = Self::default();
        for doubtful in doubtful.chunks(AT_ONCE) {
            watch.go_on()?;
            let lost: Vec<&Shell> = parallel::map_all(doubtful, |(shell, members)| {
                let shell = &shells[*shell];
                (!shell.has_voxels(members, lattice)).then_some(shell)
            })
            .into_iter()
            .flatten()
            .collect();
            let buried = buried(&lost, inside, lattice);
            for (shell, _) in lost.iter().zip(buried).filter(|(_, buried)| !buried) {
                found.count += 1;
                found.mm3 += shell.volume;
                found.first_mm.get_or_insert(shell.middle().to_array());
                if found.boxes.len() < MOST_BOXES {
                    found.boxes.push([shell.low, shell.high]);
                }
            }
        }
        Ok(found)
    }
}

/// The shell of every triangle, and the shells in the order of their first triangles: those that share corners hang
/// together.
fn shells(triangles: &[[DVec3; 3]]) -> (Vec<usize>, Vec<Shell>) {
    let mut sets = DisjointSets::new(triangles.len());
    let mut first: HashMap<[u64; 3], u32> = HashMap::with_capacity(triangles.len() / 2);
    for (at, triangle) in (0..).zip(triangles) {
        for corner in triangle {
            // −0 is 0.
            let key = (*corner + 0.0).to_array().map(f64::to_bits);
            sets.join(*first.entry(key).or_insert(at), at);
        }
    }
    let mut shells: Vec<Shell> = Vec::new();
    // The lowest stands for its set, so that it comes first.
    let mut of_triangle: Vec<usize> = Vec::with_capacity(triangles.len());
    for (at, triangle) in (0..).zip(triangles) {
        let root = sets.root(at);
        if root == at {
            of_triangle.push(shells.len());
            shells.push(Shell {
                origin: triangle[0],
                volume: 0.0,
                area: 0.0,
                low: DVec3::INFINITY,
                high: DVec3::NEG_INFINITY,
            });
        } else {
            of_triangle.push(of_triangle[root as usize]);
        }
        shells[of_triangle[at as usize]].add(triangle);
    }
    (of_triangle, shells)
}

impl Shell {
    fn add(&mut self, triangle: &[DVec3; 3]) {
        let [a, b, c] = triangle.map(|corner| corner - self.origin);
        self.volume += a.dot(b.cross(c)) / 6.0;
        self.area += (b - a).cross(c - a).length() / 2.0;
        for corner in triangle {
            self.low = self.low.min(*corner);
            self.high = self.high.max(*corner);
        }
    }

    fn middle(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    /// Whether it is a body, no cavity, so small or so thin that it may have no voxel.
    fn is_doubtful(&self, lattice: &Lattice) -> bool {
        let thickness = 2.0 * self.volume / self.area.max(f64::MIN_POSITIVE);
        let is_small = self.volume < ENOUGH_VOXELS * lattice.voxel_volume();
        self.volume > 0.0 && (is_small || thickness < lattice.pitch.max_element())
    }

    /// Whether a voxel's centre lies inside of the shell alone.
    fn has_voxels(&self, triangles: &[[DVec3; 3]], lattice: &Lattice) -> bool {
        let most = DVec3::from(lattice.dims.map(f64::from));
        let voxel = |place: DVec3| ((place - lattice.origin) / lattice.pitch).clamp(DVec3::ZERO, most);
        let (first, end) = (voxel(self.low).floor(), voxel(self.high).ceil());
        let dims = (end - first).max(DVec3::ONE).to_array().map(|voxels| voxels as u32);
        let around = Lattice { origin: lattice.origin + first * lattice.pitch, dims, ..*lattice };
        let rows = InsideRows::of_triangles(triangles.into(), around, dims[2]);
        let mut slice = SliceRuns::default();
        (0..dims[2]).any(|k| {
            rows.fill_slice(k, &mut slice);
            (0..dims[1]).any(|j| !slice.row(j).is_empty())
        })
    }
}

/// Whether the voxel at the middle of each shell belongs to another: then nothing is missing there.
fn buried(shells: &[&Shell], inside: &InsideRows, lattice: &Lattice) -> Vec<bool> {
    let last = DVec3::from(lattice.dims.map(|voxels| f64::from(voxels.saturating_sub(1))));
    let voxels: Vec<[u32; 3]> = shells
        .iter()
        .map(|shell| ((shell.middle() - lattice.origin) / lattice.pitch).floor().clamp(DVec3::ZERO, last))
        .map(|voxel| voxel.to_array().map(|index| index as u32))
        .collect();
    let slices: BTreeSet<u32> = voxels.iter().map(|voxel| voxel[2]).collect();
    let mut is_buried = vec![false; shells.len()];
    let mut slice = SliceRuns::default();
    for k in slices {
        inside.fill_slice(k, &mut slice);
        for ([i, j, _], buried) in voxels.iter().zip(&mut is_buried).filter(|(voxel, _)| voxel[2] == k) {
            *buried = slice.row(*j).iter().any(|[start, end]| (start..end).contains(&i));
        }
    }
    is_buried
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::Unwatched;

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
            let inside = InsideRows::of_triangles(triangles.into(), lattice, lattice.dims[2]);
            LostShells::of(&inside, &lattice, &Unwatched).unwrap()
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
        // Within a body nothing is missing, be it a bead or a cavity.
        let mut within = cuboid(body.0, body.1);
        within.extend(cuboid([2.06, 2.0, 2.0], [0.08, 1.0, 0.2]));
        within.extend(cuboid([3.06, 2.0, 2.0], [0.03, 0.1, 0.1]).into_iter().map(|[a, b, c]| [a, c, b]));
        let inside = InsideRows::of_triangles(within.into(), lattice, lattice.dims[2]);
        assert_eq!(LostShells::of(&inside, &lattice, &Unwatched), Ok(LostShells::default()));
    }
}
