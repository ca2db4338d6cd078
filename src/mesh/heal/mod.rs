//! From a mesh as it was drawn to a solid: clean, orient, cap, judge.
//!
//! 1. [`clean`]: triangles without area and doubled ones go; [`join`]: corners that miss each other by rounding are
//!    one; [`split`]: edges are split at corners of other pieces that lie on them.
//! 2. [`orient`]: neighbours are made to agree; [`walls`] within a body go; [`sheets`]: what has no thickness beside a
//!    solid goes, but not what sits on it ([`seat`]) or belongs to it ([`rims`]).
//! 3. [`boundary`] and [`fill`]: what is open is capped, so that mesh and caps together have no boundary. The
//!    generalised winding number (Jacobson, Kavan, Sorkine-Hornung, *Robust inside-outside segmentation*, SIGGRAPH
//!    2013, eq. 5) of such a surface is an integer everywhere off it.
//! 4. [`nesting`]: shells turn outwards, cavities stay cavities.
//! 5. The shape is refused if it is a sheet or holds no volume.
//! 6. [`crossing`] tells whether anything overlaps or touches; if so, [`union`] leaves what is surface of all together.

mod boundary;
mod clean;
mod crossing;
mod edges;
mod fill;
mod join;
mod nesting;
mod orient;
mod report;
mod rims;
mod seat;
mod sheets;
mod split;
mod union;
mod walls;

use std::ops::{Add, Mul};

use glam::{DVec3, Vec3};

use self::edges::Edges;
pub use self::union::{InCommon, unite};
use super::{HealthReport, MeshError, Solid, TriangleMesh};

/// Largest cap area, as a fraction of the mesh area, that still counts as mending.
///
/// Holes of scans stay far below: the Stanford bunny's five take 1.9%. Shapes that are open by design lie above: a
/// hemispherical bowl needs 50%, a box without lid 20%, a cylindrical cup twice as high as wide 11%. Filling
/// those would print a block where the user drew a wall.
pub const MAX_CAP_FRACTION: f64 = 0.10;

/// Least volume over area^(3/2). A sphere has 0.094, a plate 100 mm square and 0.1 mm thick 3.5e-4; what lies below
/// this is thinner than a thousandth of the finest voxel.
const MIN_COMPACTNESS: f64 = 1e-6;

/// Height over longest edge below which a triangle has no usable normal: coordinates of 1e3 mm carry 2e-13 mm of
/// rounding.
const NEEDLE_ASPECT: f64 = 1e-12;

/// Makes a mesh fit for slicing and reports its health.
///
/// The triangles of the result keep their order and attributes; a flipped one has its second and third corner
/// exchanged. Where bodies overlap, touch or lie in each other, what has inside on both sides is left out, and
/// triangles that are surface in part are replaced by those parts, whose attributes are interpolated. Needles (distinct
/// corners, no area) take part in everything but end among the caps: depth is never measured from them.
///
/// # Errors
/// No surface is left ([`MeshError::NoSurface`]), closing it takes more than [`MAX_CAP_FRACTION`] of its area
/// ([`MeshError::OpenSheet`]), an open piece beside others faces inwards ([`MeshError::Facing`]), or it holds no volume
/// ([`MeshError::NoVolume`]).
pub fn close(mut mesh: TriangleMesh) -> Result<Solid, MeshError> {
    let mut health = HealthReport { triangles: mesh.triangles.len(), ..HealthReport::default() };
    clean::clean(&mut mesh, &mut health);
    if mesh.triangles.is_empty() {
        return Err(MeshError::NoSurface { triangles: health.triangles });
    }
    let mut edges = Edges::new(mesh.positions.len(), &mesh.triangles);
    if join::join(&mut mesh, &edges, &mut health) {
        clean::clean(&mut mesh, &mut health);
        if mesh.triangles.is_empty() {
            return Err(MeshError::NoSurface { triangles: health.triangles });
        }
        edges = Edges::new(mesh.positions.len(), &mesh.triangles);
    }
    if split::split(&mut mesh, &edges, &mut health) {
        clean::clean(&mut mesh, &mut health);
        edges = Edges::new(mesh.positions.len(), &mesh.triangles);
    }
    edges = orient::orient(&mut mesh, edges, &mut health);
    if walls::drop(&mut mesh, &edges, &mut health) {
        edges = Edges::new(mesh.positions.len(), &mesh.triangles);
        edges = orient::orient(&mut mesh, edges, &mut health);
    }
    let mut shells = nesting::Shells::new(&mesh, &edges);
    let mut holes = boundary::loops(&mesh, &edges, &shells.of_triangle);
    let mut caps = fill::fill(&mesh.positions, &holes);
    shells.measure(&mesh, &caps);
    let dropped = sheets::drop(&mut mesh, &edges, &shells, &mut health);
    if dropped.changed {
        edges = Edges::new(mesh.positions.len(), &mesh.triangles);
        shells = nesting::Shells::new(&mesh, &edges);
        holes = boundary::loops(&mesh, &edges, &shells.of_triangle);
        caps = fill::fill(&mesh.positions, &holes);
        shells.measure(&mesh, &caps);
    }
    shells.seat(&dropped.seated);
    let bodies = rims::Bodies::new(&mesh, &shells, &holes);
    health.shells = shells.len();
    health.open_edges = edges.iter().filter(|edge| edge.half_edges.len() == 1).count();
    health.non_manifold_edges = edges.iter().filter(|edge| edge.half_edges.len() > 2).count();
    health.holes = holes.len();
    drop(edges);
    health.area_mm2 = shells.all.iter().map(|shell| shell.area).sum();
    health.cap_area_mm2 = shells.all.iter().map(|shell| shell.cap_area).sum();
    health.seated_shells = shells.all.iter().filter(|shell| shell.is_seated).count();
    health.joint_shells = bodies.joint();
    health.rim_gap_mm = bodies.miss.iter().copied().fold(0.0, f64::max);
    let is_guess =
        |shell: usize| shells.all[shell].is_open() && !shells.all[shell].is_seated && !bodies.is_joint(shell);
    health.open_shells = (0..shells.len()).filter(|&shell| is_guess(shell)).count();
    // What is buried is no guess, nor is what closes one curve twice.
    let is_sure = |&shell: &usize| shells.all[shell].is_seated || bodies.is_met[shell];
    let sure: f64 = (0..shells.len()).filter(is_sure).map(|shell| shells.all[shell].cap_area).sum();
    if health.cap_area_mm2 - sure > MAX_CAP_FRACTION * health.area_mm2 {
        return Err(MeshError::OpenSheet {
            holes: health.holes,
            open_edges: health.open_edges,
            percent: 100.0 * health.cap_area_mm2 / health.area_mm2,
            limit_percent: 100.0 * MAX_CAP_FRACTION,
            unjoined_rim_gap_mm: bodies.unjoined_miss,
        });
    }
    let mut caps = shells.turn_outwards(&mut mesh, caps, &bodies, &mut health)?;
    health.volume_mm3 = shells.all.iter().map(|shell| shell.volume).sum();
    if health.volume_mm3 <= MIN_COMPACTNESS * libm::pow(health.area_mm2, 1.5) {
        return Err(MeshError::NoVolume { volume_mm3: health.volume_mm3, area_mm2: health.area_mm2 });
    }
    health.caps = caps.len();
    set_needles_aside(&mut mesh, &mut caps, &mut health);
    let tolerance = union::tolerance(mesh.corner_bounds());
    let meetings = crossing::find(&mesh, tolerance);
    health.self_intersections = Some(meetings.crossings);
    let may_be_buried = meetings.any() || health.non_manifold_edges > 0;
    let whole = if may_be_buried || shells.may_meet(tolerance.touch) {
        union::bare(&mut mesh, &caps, &mut health)
    } else {
        None
    };
    if mesh.triangles.is_empty() {
        return Err(MeshError::NoVolume { volume_mm3: health.volume_mm3, area_mm2: health.area_mm2 });
    }
    if mesh.triangles.len() < health.triangles || health.joined_corners + health.split_edges > 0 {
        super::read::weld(&mut mesh.positions, &mut mesh.triangles);
    }
    Ok(Solid { mesh, caps, whole, health })
}

/// Moves triangles without area to the caps, where they keep the boundary closed and disturb no distance.
fn set_needles_aside(mesh: &mut TriangleMesh, caps: &mut Vec<[DVec3; 3]>, health: &mut HealthReport) {
    let flat: Vec<bool> = mesh.triangles.iter().map(|t| is_needle(t.map(|i| mesh.positions[i as usize]))).collect();
    caps.extend(mesh.corners().zip(&flat).filter(|(_, flat)| **flat).map(|(corners, _)| corners));
    health.degenerate_triangles += flat.iter().filter(|&&flat| flat).count();
    mesh.keep(|t| !flat[t]);
}

fn is_needle([a, b, c]: [DVec3; 3]) -> bool {
    let longest_squared = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    (b - a).cross(c - a).length() <= NEEDLE_ASPECT * longest_squared
}

impl TriangleMesh {
    /// Positions of every triangle's corners.
    pub fn corners(&self) -> impl Iterator<Item = [DVec3; 3]> + '_ {
        self.triangles.iter().map(|t| t.map(|i| self.positions[i as usize]))
    }

    /// Corners of the box around the triangles.
    pub(super) fn corner_bounds(&self) -> (DVec3, DVec3) {
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.corners().flatten().fold(start, |(low, high), p| (low.min(p), high.max(p)))
    }

    /// Exchanges two corners of a triangle, which turns it inside out.
    fn flip(&mut self, t: usize) {
        self.triangles[t].swap(1, 2);
        if let Some(uv) = self.uvs.get_mut(t) {
            uv.swap(1, 2);
        }
        if let Some(colors) = self.corner_colors.get_mut(t) {
            colors.swap(1, 2);
        }
    }

    /// Adds a part of triangle `t` of `old` between `corners` with its attributes: those of all of it, or by each
    /// corner's weights of the triangle's.
    fn push_part(&mut self, old: &Self, t: usize, corners: [u32; 3], weights: Option<[DVec3; 3]>) {
        self.triangles.push(corners);
        self.uvs.extend(old.uvs.get(t).map(|uvs| at_weights(*uvs, weights)));
        let colors = old.corner_colors.get(t).map(|colors| at_weights(colors.map(Vec3::from), weights));
        self.corner_colors.extend(colors.map(|colors| colors.map(|color| color.to_array())));
        self.material_of.extend(old.material_of.get(t));
        self.patch_of.extend(old.patch_of.get(t));
    }

    /// Drops triangles by index, with their attributes.
    pub(super) fn keep(&mut self, keep: impl Fn(usize) -> bool) {
        fn retain<T>(list: &mut Vec<T>, keep: &impl Fn(usize) -> bool) {
            let mut t = 0;
            list.retain(|_| {
                t += 1;
                keep(t - 1)
            });
        }
        retain(&mut self.triangles, &keep);
        retain(&mut self.uvs, &keep);
        retain(&mut self.corner_colors, &keep);
        retain(&mut self.material_of, &keep);
        retain(&mut self.patch_of, &keep);
    }
}

/// Values of a triangle's corners, or of points within it.
fn at_weights<V: Copy + Add<Output = V> + Mul<f32, Output = V>>(
    corners: [V; 3],
    weights: Option<[DVec3; 3]>,
) -> [V; 3] {
    let Some(weights) = weights else { return corners };
    weights.map(|weight| match (0..3).find(|&i| weight[i] == 1.0) {
        Some(i) => corners[i],
        None => {
            let [a, b, c] = weight.to_array().map(|weight| weight as f32);
            corners[0] * a + corners[1] * b + corners[2] * c
        }
    })
}

/// Area of a triangle.
fn area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}
