//! Shapes, brute force and slicing for the proofs of the geometry.

use std::path::PathBuf;

use glam::{DMat3, DVec3};
use lumislice::{
    appearance::{LayerField, LayerStack},
    mesh::{Solid, TriangleMesh, close},
    sdf::closest_point,
    slice::{ObjectField, Slicer},
    voxel::{Lattice, MM_PER_INCH, MaterialId},
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use crate::common::indexed;
pub use crate::common::{Triangles, box_triangles, corners, reversed, sphere, winding};

/// The pitch of a J750 in its 27 µm modes, mm.
pub fn j750() -> DVec3 {
    DVec3::new(MM_PER_INCH / 600.0, MM_PER_INCH / 300.0, 0.027)
}

/// A stream of numbers that is the same on every machine.
pub struct Random(Xoshiro256PlusPlus);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    /// From 0 to 1, 1 excluded.
    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// From 0 to `end` − 1.
    pub fn below(&mut self, end: usize) -> usize {
        ((self.unit() * end as f64) as usize).min(end - 1)
    }

    /// Every coordinate in −1…1.
    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }

    pub fn rotation(&mut self) -> DMat3 {
        let angle = |random: &mut Self| random.between(0.0, std::f64::consts::TAU);
        let (x, y, z) = (angle(self), angle(self), angle(self));
        DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x)
    }
}

/// An octahedron that faces outwards; its vertices are `reach` away from `center` along the axes.
pub fn octahedron(center: DVec3, reach: f64) -> Triangles {
    let vertex = |axis: usize, sign: f64| center + DVec3::AXES[axis] * (sign * reach);
    let mut triangles = Vec::new();
    for signs in 0..8 {
        let sign = |axis: usize| if signs >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let mut triangle = [0, 1, 2].map(|axis| vertex(axis, sign(axis)));
        if sign(0) * sign(1) * sign(2) < 0.0 {
            triangle.swap(1, 2);
        }
        triangles.push(triangle);
    }
    triangles
}

/// Triangles to a mesh with shared vertices, in order of first use.
pub fn mesh_of(triangles: &[[DVec3; 3]]) -> TriangleMesh {
    let (positions, triangles) = indexed(triangles);
    TriangleMesh { positions, triangles, ..TriangleMesh::default() }
}

pub fn solid_of(triangles: &[[DVec3; 3]]) -> Solid {
    close(mesh_of(triangles)).unwrap()
}

/// Material n + 1 for layer n, each with its thickness in mm, and the next for the core.
pub fn stack(thicknesses: &[f64]) -> LayerStack {
    let layers = thicknesses.iter().enumerate().map(|(n, &thickness)| (MaterialId(n as u8 + 1), thickness));
    LayerStack::new(layers, MaterialId(thicknesses.len() as u8 + 1))
}

pub fn slicer_of(solid: &Solid, lattice: Lattice, layers: LayerStack) -> Slicer {
    Slicer::new(lattice, vec![ObjectField::new(solid, lattice, LayerField::Uniform(layers)).unwrap()])
}

/// Material ids of all voxels, x fastest, then y, then z.
pub fn voxels(slicer: &Slicer) -> Vec<u8> {
    let dims = slicer.lattice().dims;
    let mut ids = Vec::new();
    voxels_of(slicer, 0..dims[2], |_, _, row| ids.extend_from_slice(row));
    ids
}

/// Hands the rows (j, k, ids) of some slices to `visit`, bottom up.
pub fn voxels_of(slicer: &Slicer, slices: std::ops::Range<u32>, mut visit: impl FnMut(u32, u32, &[u8])) {
    let dims = slicer.lattice().dims;
    let mut row = vec![0; dims[0] as usize];
    let done: Result<(), std::convert::Infallible> = slicer.for_each_slab(slices.clone(), |slab| {
        for k in slab.slices().filter(|k| slices.contains(k)) {
            for j in 0..dims[1] {
                slab.read_row(j, k, &mut row);
                visit(j, k, &row);
            }
        }
        Ok(())
    });
    let Ok(()) = done;
}

/// All indices in the order of [`voxels`].
pub fn indices(lattice: &Lattice) -> impl Iterator<Item = [u32; 3]> {
    let [nx, ny, nz] = lattice.dims;
    (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])))
}

/// Distance to the nearest of all triangles.
pub fn distance(surface: &[[DVec3; 3]], p: DVec3) -> f64 {
    surface.iter().map(|t| closest_point(p, t).distance_squared).fold(f64::INFINITY, f64::min).sqrt()
}

/// A mesh that lies beside the project, if it does.
pub fn shared_mesh(name: &str) -> Option<PathBuf> {
    crate::common::shared(&format!("meshes/{name}"))
}
