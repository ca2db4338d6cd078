//! Walls within a body that share their rims with it, each drawn as one face, and faces drawn once more on others with
//! which they share their rims: no surface, for both their sides are inside, or another lies there.
//!
//! Where such a patch meets the body an odd number of triangles share the edge, so that the body with it has a
//! boundary and without it has none. It goes if the mesh is better closed without it, and it cannot be seen from
//! outside, or lies on or in what is left. Where open sheets hang on the same edges, as a brim on a can, they go later
//! ([`sheets`]), and no face of the body for them, if that takes less surface away or makes less up.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::edges::{Edges, triangle_of};
use super::union::{Soup, tolerance};
use super::{HealthReport, TriangleMesh, area, orient, sheets};
use crate::disjoint_sets::DisjointSets;

/// Directions that each side of a patch is looked at from.
const VIEWS: u32 = 96;
/// Patches looked at: about a second.
const MAX_PATCHES: usize = 2_000;
/// Points that patches are looked at from, all together, but for one of each: another second.
const MAX_POINTS: usize = 4_000;
/// Triangles that a search may look through, patch by patch: about two seconds. There are up to three: for walls, for
/// what is attached to the body, and for walls without that.
const BUDGET: usize = 4_000_000;

/// Drops such patches; says whether there were any.
pub(super) fn drop(mesh: &mut TriangleMesh, edges: &Edges, health: &mut HealthReport) -> bool {
    if Faults::of(edges).odd == 0 {
        return false;
    }
    let before = mesh.triangles.len();
    let area_before: f64 = mesh.corners().map(area).sum();
    let mut is_out = within(mesh, edges);
    if is_out.contains(&true) {
        let is_attached = attached(mesh, edges);
        if is_attached.contains(&true) {
            let body = sheets::without(mesh, |t| is_attached[t]);
            let walls = within(&body, &Edges::new(body.positions.len(), &body.triangles));
            let mut is_wall = vec![false; before];
            let of_body = (0..before).filter(|&t| !is_attached[t]);
            of_body.zip(walls).for_each(|(t, wall)| is_wall[t] = wall);
            // Without the sheets less surface is lost, or made up, than without what seems to be walls.
            let without: Vec<bool> =
                is_wall.iter().zip(&is_attached).map(|(wall, attached)| *wall || *attached).collect();
            if cost(mesh, &without) < cost(mesh, &is_out) {
                is_out = is_wall;
            }
        }
    }
    mesh.keep(|t| !is_out[t]);
    health.buried_area_mm2 += area_before - mesh.corners().map(area).sum::<f64>();
    mesh.triangles.len() < before
}

/// Area of what is left out, and of what closes the rest, mm².
fn cost(mesh: &TriangleMesh, is_out: &[bool]) -> f64 {
    let lost: f64 = mesh.corners().zip(is_out).filter(|(_, is_out)| **is_out).map(|(corners, _)| area(corners)).sum();
    let mut rest = sheets::without(mesh, |t| is_out[t]);
    let edges = Edges::new(rest.positions.len(), &rest.triangles);
    orient::orient(&mut rest, edges, &mut HealthReport::default());
    lost + sheets::cap_area(&rest)
}

/// Triangles of open patches that hang on the rest by edges of an odd number of triangles, and leave no opening there:
/// a brim around a can. The edges are odd for them, and not for a face of the can that ends there.
fn attached(mesh: &TriangleMesh, edges: &Edges) -> Vec<bool> {
    let faults = Faults::of(edges);
    let mut is_attached = vec![false; mesh.triangles.len()];
    let mut patches = sheets::patches(mesh.triangles.len(), edges);
    let rims = Rim::of_patches(&mut patches, mesh.triangles.len(), edges);
    let roots: Vec<usize> = (0..rims.len()).filter(|&root| rims[root].has_odd && rims[root].open > 0).collect();
    let mut spent = 0;
    for root in roots {
        spent += mesh.triangles.len();
        if spent > BUDGET {
            break;
        }
        let is_of: Vec<bool> = (0..mesh.triangles.len()).map(|t| patches.root(t as u32) as usize == root).collect();
        let own_open = rims[root].open;
        if faults.without(mesh, &is_of).is_some_and(|rest| rest.open + own_open == faults.open) {
            is_of.iter().zip(&mut is_attached).filter(|(is_of, _)| **is_of).for_each(|(_, is)| *is = true);
        }
    }
    is_attached
}

/// Which triangles are walls within a body.
fn within(mesh: &TriangleMesh, edges: &Edges) -> Vec<bool> {
    let before = mesh.triangles.len();
    let mut is_out = vec![false; before];
    let mut faults = Faults::of(edges);
    if faults.odd == 0 {
        return is_out;
    }
    let candidates = Patch::all(mesh, edges);
    if candidates.len() > MAX_PATCHES {
        return is_out;
    }
    let soup = Soup::new(mesh.corners().collect(), vec![0; before]);
    let off = tolerance(mesh.corner_bounds()).touch;
    let most = (MAX_POINTS / candidates.len().max(1)).max(1);
    let is_buried = |patch: &&Patch| {
        let is_seen = |at: DVec3, normal: DVec3, side: f64| {
            let p = at + side * off * normal;
            views().filter(|view| side * view.dot(normal) > 0.0).any(|view| soup.is_free(p, view))
        };
        // A part of it may lie in another body.
        patch.points(&soup.corners, most).all(|(at, normal)| !is_seen(at, normal, 1.0) && !is_seen(at, normal, -1.0))
    };
    let buried: Vec<&Patch> = candidates.iter().filter(is_buried).collect();
    buried.iter().flat_map(|patch| &patch.triangles).for_each(|&t| is_out[t] = true);
    match faults.without(mesh, &is_out) {
        Some(better) => faults = better,
        None => is_out.fill(false),
    }
    // The smaller before the larger, which are more likely to be what others lie on.
    let mut spent = 0;
    for patch in &candidates {
        if is_out[patch.triangles[0]] {
            continue;
        }
        spent += before;
        if faults.odd == 0 || spent > BUDGET {
            break;
        }
        let mut tried = is_out.clone();
        patch.triangles.iter().for_each(|&t| tried[t] = true);
        let Some(better) = faults.without(mesh, &tried) else { continue };
        let mut rest = sheets::without(mesh, |t| tried[t]);
        let rest_edges = Edges::new(rest.positions.len(), &rest.triangles);
        orient::orient(&mut rest, rest_edges, &mut HealthReport::default());
        let count = rest.triangles.len();
        let rest = Soup::new(rest.corners().collect(), vec![0; count]);
        let is_in = |p: DVec3| rest.winding(p, |_| 1) != 0;
        let mut points = patch.points(&soup.corners, most);
        if points.all(|(at, normal)| is_in(at + off * normal) || is_in(at - off * normal)) {
            (is_out, faults) = (tried, better);
        }
    }
    is_out
}

/// What keeps a mesh from being closed.
struct Faults {
    /// Edges of one triangle.
    open: usize,
    /// Edges of an odd number of triangles, but for those.
    odd: usize,
}

impl Faults {
    fn of(edges: &Edges) -> Self {
        let count = |is: &dyn Fn(usize) -> bool| edges.iter().filter(|edge| is(edge.half_edges.len())).count();
        Self { open: count(&|count| count == 1), odd: count(&is_odd) }
    }

    /// The faults of what is left, if they are fewer.
    fn without(&self, mesh: &TriangleMesh, is_out: &[bool]) -> Option<Self> {
        let rest = sheets::without(mesh, |t| is_out[t]);
        let faults = Self::of(&Edges::new(rest.positions.len(), &rest.triangles));
        let is_better = !rest.triangles.is_empty() && faults.open <= self.open && faults.odd < self.odd;
        is_better.then_some(faults)
    }
}

fn is_odd(count: usize) -> bool {
    count > 2 && count % 2 == 1
}

/// The edges that bound a patch (what edges with two triangles connect).
#[derive(Clone, Default)]
struct Rim {
    /// Whether there are edges of an odd number of triangles, more than one.
    has_odd: bool,
    /// How many have no other triangle.
    open: usize,
}

impl Rim {
    /// By the root of each patch.
    fn of_patches(patches: &mut DisjointSets, triangles: usize, edges: &Edges) -> Vec<Self> {
        let mut rims = vec![Self::default(); triangles];
        for edge in edges.iter() {
            for &half_edge in edge.half_edges {
                let rim = &mut rims[patches.root(triangle_of(half_edge) as u32) as usize];
                rim.has_odd |= is_odd(edge.half_edges.len());
                rim.open += usize::from(edge.half_edges.len() == 1);
            }
        }
        rims
    }
}

/// A patch that edges of an odd number of triangles bound, and no open ones.
struct Patch {
    /// The largest first.
    triangles: Vec<usize>,
    area: f64,
}

impl Patch {
    /// Points on it and their normals, at most so many: the middle of each triangle, and one near each of its corners.
    fn points<'a>(&'a self, corners: &'a [[DVec3; 3]], most: usize) -> impl Iterator<Item = (DVec3, DVec3)> + 'a {
        /// Weight of a corner in the point near it, of that and the middle.
        const NEAR: f64 = 0.85;
        let of = |&t: &usize| {
            let [a, b, c] = corners[t];
            let normal = (b - a).cross(c - a).try_normalize();
            let middle = (a + b + c) / 3.0;
            let points = [middle, middle.lerp(a, NEAR), middle.lerp(b, NEAR), middle.lerp(c, NEAR)];
            points.into_iter().filter_map(move |at| normal.map(|normal| (at, normal)))
        };
        self.triangles.iter().flat_map(of).take(most)
    }

    /// All of a mesh, the smallest first.
    fn all(mesh: &TriangleMesh, edges: &Edges) -> Vec<Self> {
        let count = mesh.triangles.len();
        let mut patches = sheets::patches(count, edges);
        let rims = Rim::of_patches(&mut patches, count, edges);
        let mut members = vec![Vec::new(); count];
        for t in 0..count {
            let root = patches.root(t as u32) as usize;
            if rims[root].has_odd && rims[root].open == 0 {
                members[root].push(t);
            }
        }
        let corners: Vec<[DVec3; 3]> = mesh.corners().collect();
        let of = |mut triangles: Vec<usize>| {
            triangles.sort_by(|&s, &t| area(corners[t]).total_cmp(&area(corners[s])));
            let [a, b, c] = corners[*triangles.first()?];
            (b - a).cross(c - a).try_normalize()?;
            let area = triangles.iter().map(|&t| area(corners[t])).sum();
            Some(Self { triangles, area })
        };
        let mut all: Vec<Self> = members.into_iter().filter_map(of).collect();
        all.sort_by(|a, b| a.area.total_cmp(&b.area));
        all
    }
}

/// Directions spread evenly over the sphere, along a spiral.
fn views() -> impl Iterator<Item = DVec3> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    (0..VIEWS).map(move |i| {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(VIEWS);
        let (sin, cos) = libm::sincos((f64::from(i) * golden) % TAU);
        let around = (1.0 - z * z).sqrt();
        DVec3::new(around * cos, around * sin, z)
    })
}
