//! T-junctions between shells: two patches that meet along a rim which each splits differently, as CAD writers leave
//! them. No area is missing, but no edge of one is an edge of the other.
//!
//! An open edge is split where corners of another shell's rim lie on it, so that both run along the same edges; its
//! triangle goes into as many pieces, whose attributes are interpolated. Only if less of the rims' length is open then,
//! so that a mesh without such junctions stays as it is. Within one shell they are holes without area, which caps
//! close.

use glam::DVec3;

use super::edges::{Edges, direction, triangle_of};
use super::join::{self, GAP};
use super::nesting::Shells;
use super::union::{Boxes, outer_box};
use super::{HealthReport, TriangleMesh};
use crate::mesh::bounds;

/// Splits open edges at the corners that lie on them; says whether any were.
pub(super) fn split(mesh: &mut TriangleMesh, edges: &Edges, health: &mut HealthReport) -> bool {
    let shells = Shells::new(mesh, edges);
    if shells.len() < 2 || edges.iter().all(|edge| edge.half_edges.len() != 1) {
        return false;
    }
    let (low, high) = bounds(&mesh.positions);
    let gap = GAP * (high - low).max_element();
    // Corners that miss each other count as one, even where that closes no edge by itself.
    let joined = join::renamed(mesh, edges);
    let before = open_length(&mesh.positions, edges);
    let mut parts = mesh.clone();
    let mut renewed = None;
    if let Some((triangles, _)) = &joined {
        parts.triangles.clone_from(triangles);
        renewed = Some(Edges::new(parts.positions.len(), &parts.triangles));
    }
    let cuts = cuts(&parts, renewed.as_ref().unwrap_or(edges), &shells.of_triangle, gap);
    if cuts.is_empty() {
        return false;
    }
    apply(&mut parts, &cuts);
    if open_length(&parts.positions, &Edges::new(parts.positions.len(), &parts.triangles)) >= before - gap {
        return false;
    }
    *mesh = parts;
    health.split_edges = cuts.chunk_by(|a, b| a.half_edge == b.half_edge).count();
    health.joined_corners += joined.map_or(0, |(_, count)| count);
    true
}

fn open_length(positions: &[DVec3], edges: &Edges) -> f64 {
    let open = edges.iter().filter(|edge| edge.half_edges.len() == 1);
    open.map(|edge| positions[edge.ends[0] as usize].distance(positions[edge.ends[1] as usize])).sum()
}

/// A corner on an open edge.
struct Cut {
    half_edge: u32,
    /// Where it lies, as a share of the way along the half-edge.
    at: f64,
    vertex: u32,
}

/// All corners of rims on open edges of other shells, by half-edge, then along it.
fn cuts(mesh: &TriangleMesh, edges: &Edges, shell_of: &[u32], gap: f64) -> Vec<Cut> {
    let open: Vec<u32> =
        edges.iter().filter(|edge| edge.half_edges.len() == 1).map(|edge| edge.half_edges[0]).collect();
    let ends = |h: u32| direction(&mesh.triangles, h).map(|v| mesh.positions[v as usize]);
    let mut rim: Vec<(u32, u32)> =
        open.iter().map(|&h| (direction(&mesh.triangles, h)[0], shell_of[triangle_of(h)])).collect();
    rim.sort_unstable();
    rim.dedup();
    let boxes = Boxes::new(open.iter().map(|&h| ends(h)).map(|[a, b]| outer_box(&[a, b, b], gap)).collect());
    let mut cuts = Vec::new();
    for (vertex, shell) in rim {
        let p = mesh.positions[vertex as usize];
        boxes.near(outer_box(&[p; 3], 0.0), |edge| {
            let half_edge = open[edge];
            let [a, b] = ends(half_edge);
            let (along, from) = (b - a, p - a);
            let at = from.dot(along) / along.length_squared();
            let is_between = at > 0.0 && at < 1.0 && p.distance(a) > gap && p.distance(b) > gap;
            if shell_of[triangle_of(half_edge)] != shell && is_between && (from - at * along).length() <= gap {
                cuts.push(Cut { half_edge, at, vertex });
            }
        });
    }
    cuts.sort_unstable_by(|a, b| {
        (a.half_edge, a.vertex).cmp(&(b.half_edge, b.vertex)).then_with(|| a.at.total_cmp(&b.at))
    });
    cuts.dedup_by_key(|cut| (cut.half_edge, cut.vertex));
    cuts.sort_by(|a, b| a.half_edge.cmp(&b.half_edge).then_with(|| a.at.total_cmp(&b.at)));
    cuts
}

/// A corner of a piece: its vertex, and its weights of the corners of the triangle that it is a piece of.
type Corner = (u32, DVec3);

/// Puts pieces in the place of every triangle with cuts, which are sorted.
fn apply(mesh: &mut TriangleMesh, cuts: &[Cut]) {
    let mut old = std::mem::take(mesh);
    mesh.positions = std::mem::take(&mut old.positions);
    mesh.materials = std::mem::take(&mut old.materials);
    let mut rest = cuts;
    for (t, triangle) in old.triangles.iter().enumerate() {
        let count = rest.iter().take_while(|cut| triangle_of(cut.half_edge) == t).count();
        let (here, after) = rest.split_at(count);
        rest = after;
        for piece in pieces(*triangle, here) {
            mesh.push_part(&old, t, piece.map(|(vertex, _)| vertex), Some(piece.map(|(_, weights)| weights)));
        }
    }
}

/// Pieces of a triangle with corners on its edges: split at the first, and so on in both halves.
fn pieces(triangle: [u32; 3], cuts: &[Cut]) -> Vec<[Corner; 3]> {
    let corner = |c: usize| (triangle[c], DVec3::AXES[c]);
    let on = |c: usize| {
        let (from, to) = (DVec3::AXES[c], DVec3::AXES[(c + 1) % 3]);
        cuts.iter()
            .filter(move |cut| cut.half_edge as usize % 3 == c)
            .map(move |cut| (cut.vertex, from + cut.at * (to - from)))
            .collect::<Vec<Corner>>()
    };
    let mut done = Vec::new();
    let mut open = vec![([corner(0), corner(1), corner(2)], [on(0), on(1), on(2)])];
    while let Some(([a, b, c], [ab, bc, ca])) = open.pop() {
        let Some((&first, later)) = ab.split_first() else {
            if bc.is_empty() && ca.is_empty() {
                done.push([a, b, c]);
            } else {
                open.push(([b, c, a], [bc, ca, ab]));
            }
            continue;
        };
        open.push(([first, b, c], [later.to_vec(), bc, Vec::new()]));
        open.push(([a, first, c], [Vec::new(), Vec::new(), ca]));
    }
    done
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    #[test]
    fn pieces_cover_their_triangle() {
        let cut = |half_edge: u32, at: f64, vertex: u32| Cut { half_edge, at, vertex };
        let cuts = [cut(0, 0.25, 7), cut(0, 0.5, 8), cut(1, 0.5, 9), cut(2, 0.125, 10)];
        let found = pieces([0, 1, 2], &cuts);
        assert_eq!(found.len(), 5);
        let flat = |share: DVec3| Vec2::new(share.y as f32, share.z as f32);
        let area = |piece: &[Corner; 3]| {
            let [a, b, c] = piece.map(|(_, share)| flat(share));
            0.5 * (b - a).perp_dot(c - a)
        };
        assert!(found.iter().all(|piece| area(piece) > 0.0));
        assert!((found.iter().map(area).sum::<f32>() - 0.5).abs() < 1e-6);
    }
}
