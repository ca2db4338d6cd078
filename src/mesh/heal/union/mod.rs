//! What is surface where bodies overlap, touch or lie in each other: the boundary of their union.
//!
//! **A face, or the part of one, with inside on both sides is no surface.** Inside is what the slicer's test says: a
//! winding number of at least 1, of one of the bodies. Triangles are cut along the lines where others meet them
//! ([`contact`], [`cut`]), the winding numbers of every piece are asked on both sides ([`soup`]), and what has inside
//! behind it and none before it stays; of faces that lie on each other the first. Triangles that meet none are judged
//! together with their neighbours.
//!
//! Both sides are a little off the face, so that faces which touch but for rounding count as touching; the gap is that
//! of [`super::join`]. What tells inside from outside stays the whole surface as it was, whose winding numbers are
//! integers by its combinatorics: no rounding of a cut can open it. So pieces need not meet corner to corner, and one
//! narrower than the gap is not judged at all but goes with what it was cut from.
//!
//! Why no kernel of Booleans: boolmesh and manifold take solids that are manifold and do not cross themselves, one for
//! each operand, and give back one mesh with neither the second winding nor the caps of a mended scan; here one body
//! that crosses itself is the common case. manifold is the oracle instead (`scripts/union-check`).

mod contact;
mod cut;
mod judge;
mod soup;

use glam::DVec3;

pub(super) use self::{
    contact::{Frame, Tolerance},
    soup::{Boxes, Soup, outer_box},
};
use self::{
    cut::Piece,
    judge::{Judge, Verdict},
};
use super::{
    HealthReport, TriangleMesh, area,
    edges::{Edges, triangle_of},
    join::GAP,
};
use crate::{disjoint_sets::DisjointSets, mesh::Solid};

/// Lengths below this times the extent are rounding: 2²⁰ steps of double precision.
const ROUNDING: f64 = 1e-10;

/// The tolerances for things between these corners.
pub(super) fn tolerance((low, high): (DVec3, DVec3)) -> Tolerance {
    let extent = (high - low).max_element().max(0.0);
    Tolerance { touch: GAP * extent, rounding: ROUNDING * extent }
}

/// Leaves of `mesh` what is surface; with `caps` it is closed. Says what both were before, if that is not all of them.
pub(super) fn bare(mesh: &mut TriangleMesh, caps: &[[DVec3; 3]], health: &mut HealthReport) -> Option<Vec<[DVec3; 3]>> {
    let faces = mesh.triangles.len();
    let mut corners: Vec<[DVec3; 3]> = mesh.corners().collect();
    corners.extend_from_slice(caps);
    let (low, high) = mesh.corner_bounds();
    let soup = Soup::new(corners, vec![0; faces + caps.len()]);
    let judge = Judge {
        rank: &|u| if u < faces { u as u32 } else { u32::MAX },
        skips: &|t, u| t == u,
        ..Judge::new(&soup, tolerance((low, high)))
    };
    let verdicts = judge.verdicts(&soup.corners, mesh, |t| t as u32);
    if verdicts[..faces].iter().all(|verdict| matches!(verdict, Verdict::Stays)) {
        return None;
    }
    let before: f64 = mesh.corners().map(area).sum();
    health.inside_out = judge.is_inside_out();
    health.volume_mm3 = volume(&soup.corners, &verdicts, 0.5 * (low + high));
    replace(mesh, &verdicts);
    health.area_mm2 = mesh.corners().map(area).sum();
    health.buried_area_mm2 += (before - health.area_mm2).max(0.0);
    Some(soup.corners)
}

/// What solids have in common, by their numbers, ascending.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct InCommon {
    /// The pairs that share space; those that only touch do not.
    pub space: Vec<[usize; 2]>,
    /// Those that are one body, for they touch or share space; each is in one of these at most.
    pub bodies: Vec<Vec<usize>>,
}

/// Leaves of every solid what is surface of the union of all: faces that lie within another, or on one, go.
pub fn unite(solids: &mut [&mut Solid]) -> InCommon {
    let boxes: Vec<_> = solids.iter().map(|solid| solid.outline_bounds()).collect();
    let extent = boxes.iter().map(|(low, high)| (*high - *low).max_element()).fold(0.0, f64::max);
    let tolerance = tolerance((DVec3::ZERO, DVec3::splat(extent)));
    let mut near = DisjointSets::new(solids.len());
    for (a, (low, high)) in boxes.iter().enumerate() {
        for (b, other) in boxes[..a].iter().enumerate() {
            if (low.max(other.0) - tolerance.touch).cmple(high.min(other.1)).all() {
                near.join(b as u32, a as u32);
            }
        }
    }
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); solids.len()];
    (0..solids.len()).for_each(|object| groups[near.root(object as u32) as usize].push(object));
    let mut found = InCommon::default();
    let mut bodies = DisjointSets::new(solids.len());
    for group in groups.iter().filter(|group| group.len() > 1) {
        unite_group(solids, group, tolerance, &mut found.space, &mut bodies);
    }
    found.space.sort_unstable();
    found.space.dedup();
    let mut of_root: Vec<Vec<usize>> = vec![Vec::new(); solids.len()];
    (0..solids.len()).for_each(|object| of_root[bodies.root(object as u32) as usize].push(object));
    found.bodies = of_root.into_iter().filter(|body| body.len() > 1).collect();
    found
}

fn unite_group(
    solids: &mut [&mut Solid],
    group: &[usize],
    tolerance: Tolerance,
    shared: &mut Vec<[usize; 2]>,
    bodies: &mut DisjointSets,
) {
    let mut corners = Vec::new();
    let mut body_of = Vec::new();
    for (body, &object) in (0_u16..).zip(group) {
        corners.extend(solids[object].outline());
        body_of.resize(corners.len(), body);
    }
    let soup = Soup::new(corners, body_of);
    // Surfaces are judged by outlines, so that it does not matter which of them is cut first.
    for (body, &object) in (0_u16..).zip(group) {
        let mesh = &solids[object].mesh;
        let corners: Vec<_> = mesh.corners().collect();
        let judge = Judge {
            rank: &|u| u32::from(soup.body_of[u]),
            skips: &|_, u| soup.body_of[u] == body,
            knows_neighbours: false,
            ..Judge::new(&soup, tolerance)
        };
        let verdicts = judge.verdicts(&corners, mesh, |_| u32::from(body));
        let others = (0_u16..).zip(group).filter(|(other, _)| *other != body && judge.is_behind(*other));
        shared.extend(others.map(|(_, &other)| [object.min(other), object.max(other)]));
        for (other, &number) in (0_u16..).zip(group) {
            if other != body && judge.is_beside(other) {
                bodies.join(number as u32, object as u32);
            }
        }
        if verdicts.iter().any(|verdict| !matches!(verdict, Verdict::Stays)) {
            let solid = &mut *solids[object];
            if solid.whole.is_none() {
                solid.whole = Some(solid.outline().collect());
            }
            replace(&mut solid.mesh, &verdicts);
            solid.health.area_mm2 = solid.mesh.corners().map(area).sum();
        }
    }
}

/// Puts what stays of every triangle in its place; new corners get their attributes by their weights.
fn replace(mesh: &mut TriangleMesh, verdicts: &[Verdict]) {
    if mesh.patch_of.is_empty() {
        mesh.patch_of = patches(mesh);
    }
    let mut old = std::mem::take(mesh);
    let mut new = TriangleMesh {
        positions: std::mem::take(&mut old.positions),
        materials: std::mem::take(&mut old.materials),
        ..TriangleMesh::default()
    };
    for (t, verdict) in verdicts[..old.triangles.len()].iter().enumerate() {
        let triangle = old.triangles[t];
        match verdict {
            Verdict::Goes => {}
            Verdict::Stays => new.push_part(&old, t, triangle, None),
            Verdict::Parts(pieces) => {
                let corners = triangle.map(|v| new.positions[v as usize]);
                for piece in pieces {
                    let ends: Vec<u32> = piece
                        .iter()
                        .map(|corner| match (0..3).find(|&i| corner.weights[i] == 1.0) {
                            Some(i) => triangle[i],
                            None => {
                                new.positions.push(point(&corners, corner.weights));
                                new.positions.len() as u32 - 1
                            }
                        })
                        .collect();
                    for i in 1..piece.len() - 1 {
                        let fan = [0, i, i + 1];
                        if !super::is_needle(fan.map(|i| new.positions[ends[i] as usize])) {
                            let weights = fan.map(|i| piece[i].weights);
                            new.push_part(&old, t, fan.map(|i| ends[i]), Some(weights));
                        }
                    }
                }
            }
        }
    }
    crate::mesh::read::weld(&mut new.positions, &mut new.triangles);
    *mesh = new;
}

fn point(corners: &[DVec3; 3], weights: DVec3) -> DVec3 {
    corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z
}

/// Triangles that lie on one chart: joined by edges with the same texture coordinates and material on both sides.
fn patches(mesh: &TriangleMesh) -> Vec<u32> {
    let mut patches = DisjointSets::new(mesh.triangles.len());
    let end = |half_edge: u32, corner: usize| {
        let t = triangle_of(half_edge);
        let corner = (half_edge as usize + corner) % 3;
        let uv = mesh.uvs.get(t).map(|uvs| uvs[corner].to_array().map(f32::to_bits));
        (mesh.triangles[t][corner], uv)
    };
    // The half-edge's corners are those of its triangle from `half_edge % 3` on.
    let ends = |half_edge: u32| {
        let (a, b) = (end(half_edge, 0), end(half_edge, 1));
        ([a.min(b), a.max(b)], mesh.material_of.get(triangle_of(half_edge)))
    };
    for edge in Edges::new(mesh.positions.len(), &mesh.triangles).iter() {
        for (i, &a) in edge.half_edges.iter().enumerate() {
            for &b in &edge.half_edges[..i] {
                if ends(a) == ends(b) {
                    patches.join(triangle_of(a) as u32, triangle_of(b) as u32);
                }
            }
        }
    }
    (0..mesh.triangles.len() as u32).map(|t| patches.root(t)).collect()
}

/// Volume within what stays, seen from `middle`.
fn volume(corners: &[[DVec3; 3]], verdicts: &[Verdict], middle: DVec3) -> f64 {
    let tetrahedron = |[a, b, c]: [DVec3; 3]| (a - middle).dot((b - middle).cross(c - middle)) / 6.0;
    let parts = corners.iter().zip(verdicts).map(|(corners, verdict)| match verdict {
        Verdict::Goes => 0.0,
        Verdict::Stays => tetrahedron(*corners),
        Verdict::Parts(pieces) => {
            let fan = |piece: &Piece| {
                let at = |i: usize| point(corners, piece[i].weights);
                (1..piece.len() - 1).map(|i| tetrahedron([at(0), at(i), at(i + 1)])).sum::<f64>()
            };
            pieces.iter().map(fan).sum()
        }
    });
    parts.sum()
}
