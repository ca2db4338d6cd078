//! Shapes, brute force and slicing for the proofs of the geometry.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

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

pub type Triangles = Vec<[DVec3; 3]>;

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

/// A box of 12 triangles that faces outwards.
pub fn box_triangles(low: DVec3, high: DVec3) -> Triangles {
    // Corner i has bit 0 for x, bit 1 for y, bit 2 for z.
    let corner = |i: u32| DVec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|t| t.map(corner)).collect()
}

/// A sphere by latitude and longitude that faces outwards.
pub fn sphere(center: DVec3, radius: f64, rings: usize) -> Triangles {
    let around = 2 * rings;
    let at = |i: usize, j: usize| {
        if i == 0 || i == rings {
            return center + DVec3::new(0.0, 0.0, if i == 0 { radius } else { -radius });
        }
        let (st, ct) = (std::f64::consts::PI * i as f64 / rings as f64).sin_cos();
        let (sp, cp) = (std::f64::consts::TAU * (j % around) as f64 / around as f64).sin_cos();
        center + radius * DVec3::new(st * cp, st * sp, ct)
    };
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..around {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if i + 1 < rings {
                triangles.push([a, b, c]);
            }
            if i > 0 {
                triangles.push([a, c, d]);
            }
        }
    }
    triangles
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

/// The same surface seen from the other side.
pub fn reversed(triangles: &[[DVec3; 3]]) -> Triangles {
    triangles.iter().map(|&[a, b, c]| [a, c, b]).collect()
}

/// Triangles to a mesh with shared vertices, in order of first use.
pub fn mesh_of(triangles: &[[DVec3; 3]]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut known: HashMap<[u64; 3], u32> = HashMap::new();
    for triangle in triangles {
        mesh.triangles.push(triangle.map(|p| {
            // −0 and 0 are one place.
            *known.entry((p + DVec3::ZERO).to_array().map(f64::to_bits)).or_insert_with(|| {
                mesh.positions.push(p);
                (mesh.positions.len() - 1) as u32
            })
        }));
    }
    mesh
}

pub fn solid_of(triangles: &[[DVec3; 3]]) -> Solid {
    close(mesh_of(triangles)).unwrap()
}

/// Corners of every triangle.
pub fn corners(mesh: &TriangleMesh) -> Triangles {
    mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).collect()
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

/// Winding number of a surface around a point, as a real number (van Oosterom and Strackee 1983, eq. 8).
pub fn winding(surface: &[[DVec3; 3]], p: DVec3) -> f64 {
    let angle = |t: &[DVec3; 3]| {
        let [a, b, c] = t.map(|q| q - p);
        let [la, lb, lc] = [a.length(), b.length(), c.length()];
        let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(denominator)
    };
    surface.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Distance to the nearest of all triangles.
pub fn distance(surface: &[[DVec3; 3]], p: DVec3) -> f64 {
    surface.iter().map(|t| closest_point(p, t).distance_squared).fold(f64::INFINITY, f64::min).sqrt()
}

/// A mesh that lies beside the project, if it does.
pub fn shared_mesh(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("LUMISLICE_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let path = folder.join("meshes").join(name);
    if !path.exists() {
        println!("skipped: {name} is not there");
        return None;
    }
    Some(path)
}
