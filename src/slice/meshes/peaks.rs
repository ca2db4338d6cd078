//! Edges and corners of the surface within cells: Kobbelt, Botsch, Schwanecke and Seidel 2001, *Feature sensitive
//! surface extraction from volume data*.
//!
//! A loop whose vertices have different tangent planes is filled around the point nearest to all planes, which is moved
//! onto the level set. So every cell on an edge of the surface has a vertex on it, but between two such cells the
//! loops' common segment still cuts the edge: it is flipped, and joins the two vertices.
//!
//! ```text
//!     ╱│╲             ╱ ╲
//!    c │ d    ──►    c───d      c, d on the edge of the surface; the segment lies in the face between two cells
//!     ╲│╱             ╲ ╱
//! ```
//!
//! Planes are known where a boundary is a level set of the exact distance ([`super::crossing`]). Where it is not
//! (texture, Lp, layers below the pitch, cells of three materials), edges stay cut.

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::{
    crossing::Tangent,
    interfaces::{Facet, Interfaces},
    march::March,
};

/// A loop gets a vertex of its own if its vertices' mean is off one of their planes by more than this share of the
/// pitch, four fifths of the default error at 0.2 mm.
const LEAST_HEIGHT: f64 = 0.02;

/// Weight that draws the point to the vertices' mean along directions that no plane decides. At planes 5° apart it
/// keeps 5% of the height; the second round leaves a twentieth of that.
const DRAW: f64 = 1e-4;

/// Steps that move the point onto the level set.
const STEPS: usize = 3;

/// The point is on the level set if it is off by no more than this share of the pitch.
const ON_LEVEL: f64 = 1e-3;

/// It is not further than this many pitches from the vertices' mean.
const REACH: f64 = 1.5;

/// The least height of a triangle, as a share of its longest edge.
const LEAST_ALTITUDE: f64 = 1e-3;

/// A vertex of a loop.
#[derive(Debug, Clone, Copy)]
pub struct Corner {
    /// Its place, mm.
    pub position: DVec3,
    /// The surface there.
    pub tangent: Tangent,
}

impl Default for Corner {
    fn default() -> Self {
        Self { position: DVec3::ZERO, tangent: Tangent::UNKNOWN }
    }
}

/// The vertex to fill a loop around, if an edge or a corner of the surface passes it.
pub fn peak(contour: &[Corner], march: &March<'_>) -> Option<Corner> {
    let pitch = march.grid.lattice.pitch.x;
    let level = contour[0].tangent.level;
    if !contour.iter().all(|corner| corner.tangent.is_known() && corner.tangent.level == level) {
        return None;
    }
    let normal = |corner: &Corner| corner.tangent.normal.as_dvec3();
    let mean = contour.iter().map(|corner| corner.position).sum::<DVec3>() / contour.len() as f64;
    let height = |corner: &Corner| normal(corner).dot(mean - corner.position).abs();
    if contour.iter().map(height).fold(0.0, f64::max) < LEAST_HEIGHT * pitch {
        return None;
    }
    let mut matrix = DMat3::from_diagonal(DVec3::splat(DRAW * contour.len() as f64));
    for corner in contour {
        let n = normal(corner);
        matrix += DMat3::from_cols(n * n.x, n * n.y, n * n.z);
    }
    let inverse = matrix.inverse();
    let mut point = mean;
    for _ in 0..2 {
        let pull: DVec3 = contour.iter().map(|it| normal(it) * normal(it).dot(it.position - point)).sum();
        point += inverse * pull;
    }
    let object = &march.objects[usize::from(level.object)];
    let likely = contour[0].tangent.triangle;
    let mut found = object.above_level(level.boundary, point, &[likely])?;
    for _ in 0..STEPS {
        if found.off < 0.1 * ON_LEVEL * pitch {
            break;
        }
        point -= found.above * found.normal;
        found = object.above_level(level.boundary, point, &[found.triangle])?;
    }
    let position = point.clamp(march.bounds.0, march.bounds.1);
    let near = found.off <= ON_LEVEL * pitch && position.distance(mean) < REACH * pitch;
    let tangent = Tangent { normal: Vec3::ZERO, level, triangle: found.triangle };
    (near && faces_as_its_planes(contour, position)).then_some(Corner { position, tangent })
}

/// Whether every triangle of the fan around `point` has area and faces to the side that the tangent planes at its ends
/// face to.
fn faces_as_its_planes(contour: &[Corner], point: DVec3) -> bool {
    let turn = |n: usize| {
        let (p, q) = (&contour[n], &contour[(n + 1) % contour.len()]);
        let (a, b) = (p.position - point, q.position - point);
        let area = a.cross(b);
        let longest = a.length().max(b.length()).max((a - b).length());
        let [along_p, along_q] = [p, q].map(|corner| area.dot(corner.tangent.normal.as_dvec3()));
        let facing = if along_p.abs() > along_q.abs() { along_p } else { along_q };
        (area.length() > LEAST_ALTITUDE * longest * longest).then(|| facing.signum())
    };
    let first = turn(0);
    first.is_some() && (1..contour.len()).all(|n| turn(n) == first)
}

/// Flips the segments between cells that both have a peak where that joins the peaks along an edge of the surface.
pub fn join_peaks(interfaces: &mut Interfaces, tangents: &[Tangent], peaks: &[u32]) {
    let Interfaces { positions, facets } = interfaces;
    // A fan's triangles have the vertex they were filled around last.
    let mut sides: Vec<(u64, u32)> = facets
        .iter()
        .enumerate()
        .filter(|(_, facet)| peaks.binary_search(&facet.corners[2]).is_ok())
        .map(|(index, facet)| {
            let [a, b, _] = facet.corners.map(u64::from);
            (a.min(b) << 32 | a.max(b), index as u32)
        })
        .collect();
    sides.par_sort_unstable();
    let at = |vertex: u32| DVec3::from(positions[vertex as usize].map(f64::from));
    let mut pairs: Vec<(u64, [u32; 2])> = sides
        .chunk_by(|p, q| p.0 == q.0)
        .filter_map(|pair| {
            let &[(_, first), (_, second)] = pair else { return None };
            let [p, q] = [first, second].map(|index| facets[index as usize]);
            let ([a, b, c], [other, _, d]) = (p.corners, q.corners);
            let joined = other == b && p.sides() == q.sides() && c != d;
            (joined && flattens([a, b, c, d], &at, tangents)).then(|| {
                let [c, d] = [c, d].map(u64::from);
                (c.min(d) << 32 | c.max(d), [first, second])
            })
        })
        .collect();
    pairs.sort_unstable();
    for group in pairs.chunk_by(|p, q| p.0 == q.0) {
        // Two loops that meet in two segments would be joined twice.
        let &[(_, [first, second])] = group else { continue };
        let (p, q) = (facets[first as usize], facets[second as usize]);
        let ([a, b, c], [_, _, d]) = (p.corners, q.corners);
        facets[first as usize] = Facet { corners: [a, d, c], ..p };
        facets[second as usize] = Facet { corners: [b, c, d], ..q };
    }
}

/// Whether the triangles (a, b, c) and (b, a, d) lie nearer to the tangent planes at a and b as (a, d, c) and (b, c,
/// d), which have area and do not fold.
fn flattens([a, b, c, d]: [u32; 4], at: &impl Fn(u32) -> DVec3, tangents: &[Tangent]) -> bool {
    let off = |vertex: u32, other: u32| {
        let normal = tangents[vertex as usize].normal.as_dvec3();
        normal.dot(at(other) - at(vertex)).abs()
    };
    let before = off(a, b).max(off(b, a));
    let after = off(a, c).max(off(a, d)).max(off(b, c)).max(off(b, d));
    let area = |[p, q, r]: [u32; 3]| (at(q) - at(p)).cross(at(r) - at(p));
    let [before_1, before_2, after_1, after_2] = [[a, b, c], [b, a, d], [a, d, c], [b, c, d]].map(area);
    let facing = before_1 + before_2;
    let longest = [at(c) - at(d), at(a) - at(c), at(a) - at(d), at(b) - at(c), at(b) - at(d)]
        .into_iter()
        .fold(0.0, |longest, edge| f64::max(longest, edge.length_squared()));
    let whole = |area: DVec3| area.length() > LEAST_ALTITUDE * longest && area.dot(facing) > 0.0;
    after < before && whole(after_1) && whole(after_2)
}
