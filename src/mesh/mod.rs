//! Triangle meshes: reading them, judging their health, closing them.
//!
//! **In:** a path to an OBJ, GLB/glTF, STL, PLY or 3MF file and its unit. **Out:** a [`Solid`]: triangles in
//! millimetres, z up, with UVs and textures, coherently oriented, plus the caps that close its holes for the inside
//! test, and a [`HealthReport`] that says what was found and what was done.
//!
//! ```no_run
//! use lumislice::mesh::{LoadOptions, Placement, Size, close, load, place};
//!
//! let loaded = load("rabbit.glb".as_ref(), &LoadOptions::default())?;
//! let placement = Placement { size: Size::HeightMm(30.0), ..Placement::default() };
//! let (mesh, mesh_to_lattice) = place(loaded.mesh, &placement)?;
//! let mut solid = close(mesh)?;
//! let file_to_lattice = solid.settle(&placement) * mesh_to_lattice * loaded.file_to_mesh;
//! # Ok::<(), lumislice::mesh::MeshError>(())
//! ```

mod bake;
mod error;
mod heal;
mod place;
mod project;
mod read;

use std::sync::Arc;

pub use error::MeshError;
pub use heal::{InCommon, MAX_CAP_FRACTION, close, unite};
pub use place::{Placement, Size, place};
pub(crate) use read::fill_holes;
pub use read::{LoadOptions, Loaded, MAX_EXTENT_MM, MAX_TRIANGLES, MIN_EXTENT_MM, Unit, extensions, load};

use glam::{DVec3, Vec2};

/// Triangles with optional texture coordinates and surface materials.
#[derive(Debug, Clone, Default)]
pub struct TriangleMesh {
    /// Vertex positions in mm; after loading in the file's own frame turned to z up.
    pub positions: Vec<DVec3>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates of each triangle's corners; empty when the file has none.
    /// (0, 0) is the image's upper left corner (glTF's convention), v grows downwards.
    pub uvs: Vec<[Vec2; 3]>,
    /// Linear RGB of each triangle's corners, which multiplies what its material says; empty when all are white.
    pub corner_colors: Vec<[[f32; 3]; 3]>,
    /// Index into `materials` per triangle; empty means material 0 everywhere.
    pub material_of: Vec<u16>,
    /// Triangles with equal numbers were one chart before they were cut: nothing but a cut parts them. Empty where none
    /// was cut.
    pub patch_of: Vec<u32>,
    /// Surface materials in file order; may be empty.
    pub materials: Vec<SurfaceMaterial>,
}

/// The base colour of a surface as its file states it.
#[derive(Debug, Clone)]
pub struct SurfaceMaterial {
    /// The file's name for it.
    pub name: String,
    /// Linear RGBA factor.
    pub base_color: [f32; 4],
    /// sRGB-encoded texture that multiplies the factor.
    pub base_color_texture: Option<Arc<Texture>>,
    /// How the texture goes on beyond [0, 1], along u and v.
    pub wrap: [Wrap; 2],
    /// For a texture that [`TriangleMesh::bake_base_color`] made: the texture coordinates that each of its texels had
    /// before.
    pub baked_from: Option<Arc<[Vec2]>>,
    /// For a texture that [`TriangleMesh::bake_projection`] laid out: where each of its texels lies.
    pub projected: Option<Arc<[Projected]>>,
    /// Mean free path of red, green and blue light within, mm: 1/σt of the isotropic medium that looks alike; `None`
    /// where the file says nothing of what is below the surface. It grows with the mesh.
    pub mean_free_path_mm: Option<[f64; 3]>,
}

impl SurfaceMaterial {
    /// One colour all over, linear RGBA.
    pub fn plain(name: impl Into<String>, base_color: [f32; 4]) -> Self {
        Self {
            name: name.into(),
            base_color,
            base_color_texture: None,
            wrap: [Wrap::Repeat; 2],
            baked_from: None,
            projected: None,
            mean_free_path_mm: None,
        }
    }
}

/// A texel on the surface, as images are projected onto it along the axes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Projected {
    /// Coordinates of the images that come along x, y and z, in their widths; v grows downwards.
    pub uvs: [Vec2; 3],
    /// Share of each in what is seen; together 1.
    pub shares: [f32; 3],
}

/// How a texture goes on beyond its edges.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Wrap {
    /// It begins anew.
    #[default]
    Repeat,
    /// It goes on as its mirror image.
    Mirror,
    /// Its last texel goes on.
    Clamp,
}

/// An 8-bit RGBA image, row 0 on top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Texture {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width · height` texels, encoded as in the file (sRGB for colours).
    pub texels: Vec<[u8; 4]>,
}

/// A mesh fit for slicing: coherently oriented, its holes capped for the inside test.
#[derive(Debug, Clone)]
pub struct Solid {
    /// The surface that depth is measured from.
    pub mesh: TriangleMesh,
    /// Triangles that close the mesh's boundary, as positions. They count for inside/outside only, never for depth.
    /// Together with `mesh` every directed edge is balanced by its reverse, so winding numbers are integers.
    pub caps: Vec<[DVec3; 3]>,
    /// The surface with its caps before faces, and parts of them, were left out because both their sides are inside;
    /// `None` where none were. It tells inside from outside in place of `mesh` and `caps`.
    pub whole: Option<Vec<[DVec3; 3]>>,
    /// What was found and done.
    pub health: HealthReport,
}

impl Solid {
    /// The closed surface that tells inside from outside.
    pub fn outline(&self) -> impl Iterator<Item = [DVec3; 3]> + '_ {
        let (mesh, caps, whole) = match &self.whole {
            Some(whole) => (None, None, Some(whole)),
            None => (Some(&self.mesh), Some(&self.caps), None),
        };
        mesh.into_iter().flat_map(TriangleMesh::corners).chain(caps.or(whole).into_iter().flatten().copied())
    }

    /// Every position that it is made of, of the surface and of what closes it.
    fn positions_mut(&mut self) -> impl Iterator<Item = &mut DVec3> {
        let Self { mesh, caps, whole, health: _ } = self;
        let closing = caps.iter_mut().chain(whole.iter_mut().flatten()).flatten();
        mesh.positions.iter_mut().chain(closing)
    }

    /// Moves all of it.
    pub(crate) fn translate(&mut self, by: DVec3) {
        self.positions_mut().for_each(|p| *p += by);
    }

    fn outline_bounds(&self) -> (DVec3, DVec3) {
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.outline().flatten().fold(start, |(low, high), p| (low.min(p), high.max(p)))
    }

    /// Whether it is a box along the axes, by its volume.
    pub fn is_box(&self) -> bool {
        let (low, high) = self.outline_bounds();
        let volume = (high - low).element_product();
        (self.health.volume_mm3 - volume).abs() <= BOX_TOLERANCE * volume
    }

    /// Has depth measured from the triangles that look up alone, those whose normal is within 45° of +z: below a level
    /// top it is height, as of a slab seen from above. The others still tell inside from outside, as caps do. Says
    /// whether any look up.
    pub fn measure_from_top(&mut self) -> bool {
        let mesh = &mut self.mesh;
        let corners = |triangle: &[u32; 3]| triangle.map(|v| mesh.positions[v as usize]);
        let looks_up = |[a, b, c]: [DVec3; 3]| {
            let normal = (b - a).cross(c - a);
            normal.z > normal.length() * std::f64::consts::FRAC_1_SQRT_2
        };
        let up: Vec<bool> = mesh.triangles.iter().map(|triangle| looks_up(corners(triangle))).collect();
        let others = mesh.triangles.iter().zip(&up).filter(|(_, up)| !**up).map(|(triangle, _)| corners(triangle));
        self.caps.extend(others);
        mesh.keep(|t| up[t]);
        !mesh.triangles.is_empty()
    }
}

/// By what share of its volume a box may miss the one around it.
const BOX_TOLERANCE: f64 = 1e-6;

/// What a mesh suffers from, and what was done about it.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct HealthReport {
    /// Triangles in the file.
    pub triangles: usize,
    /// Edges that bound only one triangle.
    pub open_edges: usize,
    /// Closed loops of edges whose triangles do not balance: holes, and seams of non-manifold or twisted surfaces.
    pub holes: usize,
    /// Triangles that close them.
    pub caps: usize,
    /// Area of those triangles in mm².
    pub cap_area_mm2: f64,
    /// Edges shared by more than two triangles.
    pub non_manifold_edges: usize,
    /// Triangles turned to agree with their neighbours.
    pub flipped_triangles: usize,
    /// Edges whose two triangles cannot be made to agree: the surface is one-sided.
    pub twisted_edges: usize,
    /// Triangles dropped because another has the same corners.
    pub doubled_triangles: usize,
    /// Triangles dropped because they have no area (those with three distinct corners live on among the caps).
    pub degenerate_triangles: usize,
    /// Corners joined with others that they missed by rounding.
    #[serde(skip_serializing_if = "is_zero")]
    pub joined_corners: usize,
    /// Open edges split at corners of other pieces that lie on them.
    #[serde(skip_serializing_if = "is_zero")]
    pub split_edges: usize,
    /// Sheets without thickness that were dropped from beside a solid.
    #[serde(skip_serializing_if = "is_zero")]
    pub dropped_sheets: usize,
    /// What those sheets would hold if they were closed, mm³.
    #[serde(skip_serializing_if = "is_nothing")]
    pub dropped_sheet_volume_mm3: f64,
    /// Triangles of those sheets.
    #[serde(skip_serializing_if = "is_zero")]
    pub dropped_sheet_triangles: usize,
    /// Pairs of triangles that cross each other; `None` where the check was too expensive.
    pub self_intersections: Option<usize>,
    /// Area in mm² of faces, and parts of faces, that were left out because they are no surface: both their sides are
    /// inside, or others lie on them.
    #[serde(skip_serializing_if = "is_nothing")]
    pub buried_area_mm2: f64,
    /// Whether a part of the surface that crosses itself goes round space the wrong way: that space is left out.
    pub inside_out: bool,
    /// Connected pieces.
    pub shells: usize,
    /// Pieces that faced inwards and were turned.
    pub turned_shells: usize,
    /// Pieces that face inwards and were too many to decide whether they are cavities.
    pub unjudged_shells: usize,
    /// Pieces that are open by more than [`MAX_CAP_FRACTION`], but for those below.
    pub open_shells: usize,
    /// Open pieces that sit on others: their openings are buried.
    #[serde(skip_serializing_if = "is_zero")]
    pub seated_shells: usize,
    /// Pieces whose rims run along those of others, with which they are one body.
    #[serde(skip_serializing_if = "is_zero")]
    pub joint_shells: usize,
    /// How far such rims are apart at most, mm.
    #[serde(skip_serializing_if = "is_nothing")]
    pub rim_gap_mm: f64,
    /// Enclosed volume in mm³, positive.
    pub volume_mm3: f64,
    /// Surface area in mm².
    pub area_mm2: f64,
}

/// Corners of the bounding box; inverted and infinite for no positions.
pub(crate) fn bounds(positions: &[DVec3]) -> (DVec3, DVec3) {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    positions.iter().fold(start, |(low, high), &p| (low.min(p), high.max(p)))
}

fn is_nothing(length: &f64) -> bool {
    *length == 0.0
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_shapes::{box_triangles, indexed};

    #[test]
    fn a_box_fills_its_bounds() {
        let solid = |triangles: &[[DVec3; 3]], volume_mm3: f64| {
            let (positions, faces) = indexed(triangles);
            let mesh = TriangleMesh { positions, triangles: faces, ..TriangleMesh::default() };
            Solid { mesh, caps: Vec::new(), whole: None, health: HealthReport { volume_mm3, ..Default::default() } }
        };
        let triangles = box_triangles(DVec3::ZERO, DVec3::new(3.0, 2.0, 1.0));
        assert!(solid(&triangles, 6.0 - 1e-9).is_box() && !solid(&triangles, 5.9).is_box());
        let mut seen_from_above = solid(&triangles, 6.0);
        assert!(seen_from_above.measure_from_top() && seen_from_above.is_box());
    }

    /// What decides inside from outside moves with the surface, whichever of the three it is.
    #[test]
    fn a_solid_moves_as_a_whole() {
        let triangles = box_triangles(DVec3::ZERO, DVec3::ONE);
        let (positions, faces) = indexed(&triangles[..10]);
        let mesh = TriangleMesh { positions, triangles: faces, ..TriangleMesh::default() };
        let (caps, health) = (triangles[10..].to_vec(), HealthReport::default());
        let capped = Solid { mesh, caps, whole: None, health };
        let united = Solid { whole: Some(triangles), ..capped.clone() };
        for mut solid in [capped, united] {
            let by = DVec3::new(3.0, -2.0, 0.5);
            let before: Vec<_> = solid.outline().collect();
            solid.translate(by);
            assert!(solid.outline().eq(before.iter().map(|t| t.map(|p| p + by))));
            assert_eq!(solid.mesh.positions[0], by);
            assert_eq!(solid.caps[0][0], by + box_triangles(DVec3::ZERO, DVec3::ONE)[10][0]);
        }
    }
}
