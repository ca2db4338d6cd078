//! Where on the tray an object stands.

use glam::{DMat3, DMat4, DVec3};

use super::{MAX_EXTENT_MM, MIN_EXTENT_MM, MeshError, Solid, TriangleMesh, bounds};
use crate::words::short;

/// How large an object becomes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Size {
    /// Times this factor; a negative one mirrors at the origin and keeps the inside inside.
    Scale(f64),
    /// So that the rotated object is this high in z, in mm.
    HeightMm(f64),
}

/// Scale, then rotation about the fixed axes x, y, z in that order, then the bounding box's minimum to a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// How large it becomes.
    pub size: Size,
    /// Degrees about x, then y, then z; counter-clockwise seen from the axis' tip.
    pub rotate_deg: DVec3,
    /// Where the minimum of the bounding box goes, mm.
    pub position_mm: DVec3,
}

impl Default for Placement {
    fn default() -> Self {
        Self { size: Size::Scale(1.0), rotate_deg: DVec3::ZERO, position_mm: DVec3::ZERO }
    }
}

/// Moves a mesh into the lattice frame; the 4×4 maps its former positions there (multiply by
/// [`super::Loaded::file_to_mesh`] on the right to start from file coordinates).
///
/// # Errors
/// A scale of 0, a height that is not positive or of a mesh that is flat in z, a result beyond [`MAX_EXTENT_MM`] or
/// below [`MIN_EXTENT_MM`], and anything that is not finite.
pub fn place(mut mesh: TriangleMesh, placement: &Placement) -> Result<(TriangleMesh, DMat4), MeshError> {
    let fault = |name, found: String, expected| Err(MeshError::Placement { name, found, expected });
    let Placement { size, rotate_deg, position_mm } = *placement;
    if !rotate_deg.is_finite() {
        return fault("rotate-deg", rotate_deg.to_string(), "three finite angles");
    }
    if !position_mm.is_finite() || position_mm.abs().max_element() > MAX_EXTENT_MM {
        return fault("position-mm", position_mm.to_string(), "three numbers up to 1e6 mm");
    }
    let [x, y, z] = rotate_deg.to_array().map(rotation_parts);
    let rotation = about(2, z) * about(1, y) * about(0, x);
    let scale = match size {
        Size::Scale(scale) if scale.is_finite() && scale != 0.0 => scale,
        Size::Scale(scale) => return fault("scale", scale.to_string(), "a finite number other than 0"),
        Size::HeightMm(height) if height.is_finite() && height > 0.0 => {
            let row = rotation.row(2);
            let (low, high) = mesh
                .positions
                .iter()
                .map(|p| row.dot(*p))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)));
            if high - low < MIN_EXTENT_MM {
                return fault(
                    "height-mm",
                    format!("a mesh {} mm high", short((high - low).max(0.0))),
                    "a mesh that is not flat in z",
                );
            }
            height / (high - low)
        }
        Size::HeightMm(height) => return fault("height-mm", height.to_string(), "a positive number"),
    };
    let linear = rotation * scale;
    for p in &mut mesh.positions {
        *p = linear * *p;
    }
    mesh.scale_paths(scale.abs());
    let (low, high) = bounds(&mesh.positions);
    let extent = (high - low).max_element();
    if !mesh.positions.is_empty() && !(MIN_EXTENT_MM..=MAX_EXTENT_MM).contains(&extent) {
        return fault("scale", format!("an object {} mm long", short(extent)), "1e-6 to 1000000 mm");
    }
    let low = if mesh.positions.is_empty() { DVec3::ZERO } else { low };
    for p in &mut mesh.positions {
        // In this order the minimum lands on the position exactly.
        *p = (*p - low) + position_mm;
    }
    if scale < 0.0 {
        mesh.reverse();
    }
    let transform = DMat4::from_translation(position_mm - low) * DMat4::from_mat3(linear);
    Ok((mesh, transform))
}

impl Solid {
    /// Places anew what was measured with sheets, triangles without area and parts that are inside out, which closing
    /// has dropped since: the size and the position are of what is left. The 4×4 maps the former positions to those
    /// now.
    pub fn settle(&mut self, placement: &Placement) -> DMat4 {
        /// Corners that closing joined may have moved by less than this share of the extent.
        const MOVED: f64 = 1e-5;
        let (low, high) = self.mesh.corner_bounds();
        let height = high.z - low.z;
        let scale = match placement.size {
            Size::HeightMm(wanted) if (wanted - height).abs() > MOVED * wanted => wanted / height,
            _ => 1.0,
        };
        let is_off = (low - placement.position_mm).abs().max_element() > MOVED * (high - low).max_element();
        let health = &self.health;
        let has_dropped = health.dropped_sheet_triangles + health.degenerate_triangles > 0 || health.inside_out;
        if !has_dropped || !is_off && scale == 1.0 {
            return DMat4::IDENTITY;
        }
        self.positions_mut().for_each(|p| *p = (*p - low) * scale + placement.position_mm);
        self.mesh.scale_paths(scale);
        let health = &mut self.health;
        health.volume_mm3 *= scale.powi(3);
        health.dropped_sheet_volume_mm3 *= scale.powi(3);
        for area in [&mut health.area_mm2, &mut health.cap_area_mm2, &mut health.buried_area_mm2] {
            *area *= scale * scale;
        }
        health.rim_gap_mm *= scale;
        DMat4::from_translation(placement.position_mm)
            * DMat4::from_scale(DVec3::splat(scale))
            * DMat4::from_translation(-low)
    }
}

impl TriangleMesh {
    /// Scales the mean free paths of its materials, which are lengths in it.
    fn scale_paths(&mut self, scale: f64) {
        for path in self.materials.iter_mut().filter_map(|material| material.mean_free_path_mm.as_mut()) {
            *path = path.map(|length| length * scale);
        }
    }

    /// Turns every triangle inside out.
    pub(super) fn reverse(&mut self) {
        self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        self.uvs.iter_mut().for_each(|uv| uv.swap(1, 2));
        self.corner_colors.iter_mut().for_each(|colors| colors.swap(1, 2));
    }
}

/// Sine and cosine of an angle in degrees, exact at multiples of 90 so that boxes stay boxes.
fn rotation_parts(degrees: f64) -> (f64, f64) {
    let degrees = degrees.rem_euclid(360.0);
    match degrees {
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => libm::sincos(degrees.to_radians()),
    }
}

fn about(axis: usize, (sin, cos): (f64, f64)) -> DMat3 {
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut m = [[0.0; 3]; 3];
    m[axis][axis] = 1.0;
    (m[a][a], m[a][b]) = (cos, sin);
    (m[b][a], m[b][b]) = (-sin, cos);
    DMat3::from_cols_array_2d(&m)
}
