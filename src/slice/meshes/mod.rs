//! Material meshes: the surfaces that enclose each resin, for printers that take one mesh per resin.
//!
//! **In:** objects ([`ObjectField`]) and the resins to mesh. **Out:** [`MaterialMeshes`], closed and oriented outwards,
//! as binary STL files or one 3MF assembly. Hašan et al. 2010, section 7.2, with exact distances in place of a distance
//! transform and all materials marched at once rather than two surfaces a layer, so that neighbours share their
//! boundary.
//!
//! | file | what it does |
//! | --- | --- |
//! | `nodes`    | the lattice of nodes as sparse bricks |
//! | `object`   | one object into one block of nodes |
//! | `taper`    | layers thinner than the pitch, rounded |
//! | `crossing` | where a boundary crosses an edge |
//! | `vertices` | the vertices one brick owns |
//! | `exact` | how places lie to exact boundaries |
//! | `cell`     | marching cubes for many materials, one cell |
//! | `peaks`    | edges and corners of the surface within cells |
//! | `march`    | layer after layer of bricks |
//! | `interfaces` | what that makes: every triangle between two materials once |
//! | `simplify` | fewer and larger triangles within a stated error |
//! | `stl`, `threemf` | writers |
//!
//! Layers thinner than the pitch are rounded to the pitch or to nothing (`taper`). At half the thinnest layer, volumes
//! are within 0.4% of the voxels' on a slab, a sphere, the 60 mm bunny and a textured cow whose layers taper off. Edges
//! are kept where a boundary is a level set of the exact distance: the outer surface, and layers that are the same
//! everywhere and as thick as the pitch. Elsewhere they are cut by up to 0.35, corners by 0.6 of the pitch, and what is
//! thinner than the pitch is seen by chance anywhere. Depth is the exact or the Lp-averaged distance, as the object has
//! it; the grid's has steps, and the exact one stands in for it.

mod cell;
mod crossing;
mod exact;
mod interfaces;
mod march;
mod nodes;
mod object;
mod peaks;
mod simplify;
mod stl;
mod taper;
#[cfg(test)]
mod tests;
mod threemf;
mod vertices;

use glam::DVec3;
use thiserror::Error;

pub use stl::write_stl;
pub use threemf::write_3mf;

use self::{
    exact::Exact,
    interfaces::Facet,
    march::{March, Marched},
    nodes::{NO_OBJECT, NodeGrid},
    object::NodeObject,
    peaks::join_peaks,
    simplify::simplify,
};
use super::ObjectField;
use crate::{
    blame::{Blame, Blamed},
    parallel,
    voxel::MaterialId,
    watch::{Stopped, Watch},
};

/// Why there are no material meshes.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MeshingError {
    /// The pitch is not a positive length.
    #[error("the mesh pitch is {found} mm, expected a positive length")]
    Pitch {
        /// What was asked for.
        found: f64,
    },
    /// The pitch is too fine for the objects.
    #[error(
        "a mesh pitch of {} mm makes {nodes:.0} nodes along {axis}, expected at most {max}",
        crate::words::short(*pitch_mm)
    )]
    TooFine {
        /// What was asked for.
        pitch_mm: f64,
        /// x, y or z.
        axis: char,
        /// Nodes it takes.
        nodes: f64,
        /// The most there may be.
        max: u32,
    },
    /// The meshes have too many vertices to be numbered.
    #[error("the material meshes have more than {max} vertices, expected fewer; a coarser mesh pitch makes fewer")]
    TooManyVertices {
        /// The most there may be.
        max: u32,
    },
    /// Too many objects.
    #[error("found {found} objects, expected at most {max} for material meshes")]
    Objects {
        /// How many there are.
        found: usize,
        /// The most there may be.
        max: usize,
    },
    /// The watch asked to stop.
    #[error("meshing was interrupted")]
    Stopped(#[from] Stopped),
}

impl Blamed for MeshingError {
    fn blame(&self) -> Blame {
        match self {
            Self::Stopped(_) => Blame::Interrupt,
            _ => Blame::Input,
        }
    }
}

/// Which part has the triangles of a material id; `None` for voids.
type PartOf = [Option<u16>; 256];

/// Makes material meshes at a pitch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaterialMesher {
    /// Distance of nodes along every axis, mm.
    pub pitch_mm: f64,
    /// How far fewer and larger triangles may be from those on the nodes, mm; 0 keeps these.
    pub error_mm: f64,
}

/// Meshes over one pool of vertices: where two materials meet, both use the same ones.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MaterialMeshes {
    /// Vertices in mm, in the frame of the lattice of voxels.
    pub positions: Vec<[f32; 3]>,
    /// One per resin that was asked for, in that order.
    pub parts: Vec<MaterialPart>,
}

/// The mesh of one resin.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialPart {
    /// The resin.
    pub id: MaterialId,
    /// Its name.
    pub name: String,
    /// Indices into [`MaterialMeshes::positions`], counter-clockwise seen from outside; empty where the resin is not
    /// used.
    pub triangles: Vec<[u32; 3]>,
    /// Enclosed volume, mm³.
    pub volume_mm3: f64,
}

impl MaterialMesher {
    /// Coarsest pitch taken without being asked, mm: a chord of a 10 mm sphere then misses it by 1 µm, a crease is cut
    /// by 70 µm.
    const COARSEST_MM: f64 = 0.2;
    /// Largest error taken without being asked, mm.
    const COARSEST_ERROR_MM: f64 = 0.005;
    /// Most nodes along an axis: 2¹⁵ of the 2²⁴ steps of single precision leave 512 to a pitch, to tell vertices apart
    /// by.
    const MAX_NODES: u32 = 1 << 15;

    /// The pitch for a job that states none: half the thinnest layer, so that no layer is lost; but not finer than two
    /// of the shortest voxel edges (the mesh would have several triangles for every printed voxel, and a 60 mm object
    /// gigabytes), nor coarser than 0.2 mm, or the voxels themselves where those are coarser.
    pub fn default_pitch_mm(thinnest_layer_mm: Option<f64>, voxel_pitch_mm: DVec3) -> f64 {
        let edge = voxel_pitch_mm.min_element();
        let half = 0.5 * thinnest_layer_mm.unwrap_or(f64::INFINITY);
        half.max(2.0 * edge).min(Self::COARSEST_MM.max(edge))
    }

    /// The error for a job that states none: 5 µm, far below a voxel, or a 40th of the pitch where that is less.
    pub fn default_error_mm(pitch_mm: f64) -> f64 {
        f64::min(Self::COARSEST_ERROR_MM, pitch_mm / 40.0)
    }

    /// Whether the pitch suits these objects.
    ///
    /// # Errors
    /// As [`Self::mesh`], but for what only meshing shows.
    pub fn check(&self, objects: &[ObjectField]) -> Result<(), MeshingError> {
        self.grid(objects).map(|_| ())
    }

    /// The nodes and the bounds of all objects; `None` where there is no object.
    fn grid(&self, objects: &[ObjectField]) -> Result<Option<(NodeGrid, Bounds)>, MeshingError> {
        let pitch_mm = self.pitch_mm;
        if !(pitch_mm.is_finite() && pitch_mm > 0.0) {
            return Err(MeshingError::Pitch { found: pitch_mm });
        }
        if objects.len() >= usize::from(NO_OBJECT) {
            return Err(MeshingError::Objects { found: objects.len(), max: usize::from(NO_OBJECT) - 1 });
        }
        let bounds = bounds(objects);
        if !(bounds.0.is_finite() && bounds.1.is_finite()) {
            return Ok(None);
        }
        let grid = NodeGrid::around(bounds.0, bounds.1, pitch_mm, Self::MAX_NODES).map_err(|(axis, nodes)| {
            MeshingError::TooFine { pitch_mm, axis: ['x', 'y', 'z'][axis], nodes, max: Self::MAX_NODES }
        })?;
        Ok(Some((grid, bounds)))
    }

    /// Meshes the `resins` (id and name, each id once) of `objects`; everything else in them is a void. Where objects
    /// overlap, the earlier one owns the space. `watch` hears of every layer of bricks.
    ///
    /// Memory is that of the triangles on the nodes, before fewer are made of them, plus a few layers of nodes.
    ///
    /// # Errors
    /// A pitch that is not positive or too fine for the extent, and more than 2³¹ vertices or 65,534 objects.
    pub fn mesh(
        &self,
        objects: &[ObjectField],
        resins: &[(MaterialId, String)],
        watch: &dyn Watch,
    ) -> Result<MaterialMeshes, MeshingError> {
        let found = self.grid(objects)?;
        let mut meshes = MaterialMeshes::default();
        let mut part_of: PartOf = [None; 256];
        for (part, (id, name)) in (0..).zip(resins) {
            if *id != MaterialId::BACKGROUND {
                part_of[usize::from(id.0)] = Some(part);
            }
            let part = MaterialPart { id: *id, name: name.clone(), triangles: Vec::new(), volume_mm3: 0.0 };
            meshes.parts.push(part);
        }
        let Some((grid, bounds)) = found else { return Ok(meshes) };
        let objects: Vec<_> =
            (0..).zip(objects).map(|(number, field)| NodeObject::new(field, number, &grid, &part_of)).collect();
        let Marched { mut interfaces, tangents, peaks } =
            March { grid: &grid, objects: &objects, bounds }.run(watch)?;
        join_peaks(&mut interfaces, &tangents, &peaks);
        drop(peaks);
        if self.error_mm > 0.0 {
            let exact = Exact { objects: &objects, tangents };
            interfaces = simplify(interfaces, exact, self.error_mm, self.pitch_mm, watch)?;
        }
        for &Facet { corners: [a, b, c], behind, front } in &interfaces.facets {
            if let Some(part) = part_of[usize::from(behind)] {
                meshes.parts[usize::from(part)].triangles.push([a, b, c]);
            }
            if let Some(part) = part_of[usize::from(front)] {
                meshes.parts[usize::from(part)].triangles.push([a, c, b]);
            }
        }
        meshes.positions = interfaces.positions;
        let MaterialMeshes { positions, parts } = &mut meshes;
        for part in parts {
            part.volume_mm3 = volume(positions, &part.triangles);
        }
        Ok(meshes)
    }
}

/// Lowest and highest corner of a box, mm.
type Bounds = (DVec3, DVec3);

/// Corners of the box around all objects, their caps included.
fn bounds(objects: &[ObjectField]) -> Bounds {
    let corners = objects.iter().flat_map(|object| object.inside().triangles()).flatten();
    corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)))
}

/// Volume enclosed by a closed mesh: the divergence theorem over x, after Gauss.
fn volume(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> f64 {
    /// Sums run over chunks of fixed size, so that they do not depend on the thread count.
    const CHUNK: usize = 1 << 16;
    let tetrahedron = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|v| DVec3::from(positions[v as usize].map(f64::from)));
        // Each triangle is a prism down to the plane x = 0.
        (a.x + b.x + c.x) * (b - a).cross(c - a).x / 6.0
    };
    let chunks: Vec<_> = triangles.chunks(CHUNK).collect();
    let sums: Vec<f64> = parallel::map_all(&chunks, |chunk| chunk.iter().map(tetrahedron).sum());
    sums.iter().sum()
}
