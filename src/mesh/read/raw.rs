//! What every parser fills: a mesh in the file's own coordinates.

use glam::{DVec3, Vec2};

use super::MAX_TRIANGLES;
use crate::mesh::SurfaceMaterial;
use crate::mesh::error::{Fault, Parsed};
use crate::words::counted;

/// Texture coordinates that the file does not give; settled once the materials are known.
pub(super) const NO_UV: Vec2 = Vec2::NAN;

/// A colour that multiplies without effect.
pub(super) const WHITE: [f32; 3] = [1.0; 3];

/// A mesh as it stands in the file.
pub(super) struct RawMesh {
    pub(super) positions: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Parallel to `triangles` or empty; v grows downwards; [`NO_UV`] at corners without.
    pub(super) uvs: Vec<[Vec2; 3]>,
    /// Linear RGB of each triangle's corners; as long as `triangles`, or shorter where the rest is white.
    pub(super) corner_colors: Vec<[[f32; 3]; 3]>,
    /// Parallel to `triangles` or empty.
    pub(super) material_of: Vec<u16>,
    pub(super) materials: Vec<SurfaceMaterial>,
    /// First triangle and corners of every polygon with more than three, which stands as a fan.
    pub(super) fans: Vec<[u32; 2]>,
    pub(super) warnings: Vec<String>,
    /// What the file holds besides triangles, phrases: what is said where it has none.
    pub(super) besides: Vec<String>,
    /// The first warning about a base colour that could not be had.
    pub(super) lost_color: Option<String>,
    pub(super) mm_per_unit: f64,
    pub(super) y_up: bool,
}

impl RawMesh {
    pub(super) fn new(mm_per_unit: f64) -> Self {
        Self {
            positions: Vec::new(),
            triangles: Vec::new(),
            uvs: Vec::new(),
            corner_colors: Vec::new(),
            material_of: Vec::new(),
            materials: Vec::new(),
            fans: Vec::new(),
            warnings: Vec::new(),
            besides: Vec::new(),
            lost_color: None,
            mm_per_unit,
            y_up: false,
        }
    }

    /// Adds a triangle; `uv` is kept only once some triangle has one, so that a mesh without UVs carries none.
    pub(super) fn push(&mut self, place: impl Fn() -> String, corners: [u32; 3], uv: Option<[Vec2; 3]>) -> Parsed<()> {
        if self.triangles.len() == MAX_TRIANGLES {
            return Err(Fault::new(place(), "another triangle", format!("at most {MAX_TRIANGLES} triangles")));
        }
        if let Some(uv) = uv {
            self.uvs.resize(self.triangles.len(), [NO_UV; 3]);
            self.uvs.push(uv);
        } else if !self.uvs.is_empty() {
            self.uvs.push([NO_UV; 3]);
        }
        self.triangles.push(corners);
        Ok(())
    }

    /// Adds positions, or of many those that `corners` use; says what the new index of each is.
    pub(super) fn add_positions<I>(&mut self, all: &[DVec3], corners: I) -> impl Fn(u32) -> u32 + use<I>
    where
        I: ExactSizeIterator<Item = u32>,
    {
        let base = self.positions.len() as u32;
        let mut renamed = Vec::new();
        if all.len() <= corners.len() {
            self.positions.extend_from_slice(all);
        } else {
            const UNUSED: u32 = u32::MAX;
            renamed.resize(all.len(), UNUSED);
            for corner in corners {
                let name = &mut renamed[corner as usize];
                if *name == UNUSED {
                    *name = self.positions.len() as u32;
                    self.positions.push(all[corner as usize]);
                }
            }
        }
        move |corner| renamed.get(corner as usize).copied().unwrap_or(base + corner)
    }

    /// Gives the triangle added last its corners' colours; others are white.
    pub(super) fn color_last(&mut self, colors: [[f32; 3]; 3]) {
        self.corner_colors.resize(self.triangles.len() - 1, [WHITE; 3]);
        self.corner_colors.push(colors);
    }

    /// Notes that the triangles from `first` on are the fan of one polygon of `corners` corners.
    pub(super) fn end_polygon(&mut self, first: usize, corners: usize) {
        if corners > 3 {
            self.fans.push([first as u32, corners as u32]);
        }
    }

    /// Notes that the file holds so many of something besides triangles.
    pub(super) fn note_besides(&mut self, count: usize, noun: &str) {
        if count > 0 {
            self.besides.push(counted(count, noun));
        }
    }

    /// Material of a triangle.
    pub(super) fn material(&self, triangle: usize) -> usize {
        self.material_of.get(triangle).copied().unwrap_or(0).into()
    }

    /// Warns of a base colour that cannot be had.
    pub(super) fn lose_color(&mut self, warning: String) {
        self.lost_color.get_or_insert_with(|| warning.clone());
        self.warnings.push(warning);
    }

    /// Adds a material and returns its index.
    pub(super) fn add_material(&mut self, place: impl Fn() -> String, material: SurfaceMaterial) -> Parsed<u16> {
        let index = u16::try_from(self.materials.len()).map_err(|_| {
            Fault::new(place(), "another material", format!("at most {} materials", u16::MAX as u32 + 1))
        })?;
        self.materials.push(material);
        Ok(index)
    }
}

/// A material of plain colour.
pub(super) fn plain(name: impl Into<String>, base_color: [f32; 4]) -> SurfaceMaterial {
    SurfaceMaterial::plain(name, base_color)
}

/// Refuses NaN and infinities.
pub(super) fn finite(p: DVec3, place: impl Fn() -> String) -> Parsed<DVec3> {
    if p.is_finite() {
        return Ok(p);
    }
    Err(Fault::new(place(), format!("position ({}, {}, {})", p.x, p.y, p.z), "finite coordinates"))
}

/// A texture coordinate that may be used: what is not finite becomes 0.
pub(super) fn uv_or_zero(uv: Vec2) -> Vec2 {
    if uv.is_finite() { uv } else { Vec2::ZERO }
}
