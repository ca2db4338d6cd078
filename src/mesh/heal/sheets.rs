//! Sheets without thickness beside a solid: fins, walls drawn as faces, both sides of nothing. Both sides of such a
//! face are inside, or both outside, so it is no surface, and it goes.
//!
//! A sheet is a patch (what edges with two triangles connect) that is open and would take more than
//! [`MAX_CAP_FRACTION`] of its area to close, or a closed shell that holds no volume. It goes only if what stays is
//! closed without it: a lid that lies loosely on a cup is a surface after all. Where the mesh would be refused
//! otherwise, it is enough if what stays is not.

use super::edges::{Edges, triangle_of};
use super::nesting::{Shell, Shells};
use super::{HealthReport, MAX_CAP_FRACTION, MIN_COMPACTNESS, TriangleMesh, boundary, fill};
use crate::disjoint_sets::DisjointSets;

/// An open patch whose holes take less than this share of its area, and that would enclose more than this times its
/// area^(3/2), holds something: a cube without a lid has 0.2 and 0.068, a sphere cut in halves 0.5.
const HOLLOW_CAP: f64 = 0.4;
const HOLLOW: f64 = 0.02;

/// Drops sheets; says whether there were any. `shells` are measured, caps included.
pub(super) fn drop(mesh: &mut TriangleMesh, edges: &Edges, shells: &Shells, health: &mut HealthReport) -> bool {
    if edges.iter().all(|edge| edge.half_edges.len() > 1) && !shells.all.iter().any(Shell::is_flat) {
        return false;
    }
    let mut is_sheet = open_patches(mesh, edges);
    let solids = || shells.all.iter().filter(|shell| !shell.is_flat());
    if solids().next().is_some() && shells.all.iter().any(|shell| shell.is_flat() && shell.cap_area == 0.0) {
        for (sheet, &shell) in is_sheet.iter_mut().zip(&shells.of_triangle) {
            let shell = &shells.all[shell as usize];
            *sheet |= shell.is_flat() && shell.cap_area == 0.0;
        }
    }
    if !is_sheet.contains(&true) || !is_sheet.contains(&false) {
        return false;
    }
    let mut rest = TriangleMesh { positions: mesh.positions.clone(), ..TriangleMesh::default() };
    rest.triangles = mesh.triangles.iter().zip(&is_sheet).filter(|(_, sheet)| !**sheet).map(|(t, _)| *t).collect();
    let survey = Survey::of(&rest);
    let (area, cap_area) = (survey.area(), survey.cap_area());
    let refused = shells.all.iter().map(|shell| shell.cap_area).sum::<f64>()
        > MAX_CAP_FRACTION * shells.all.iter().map(|shell| shell.area).sum::<f64>();
    let closed = survey.holes == 0;
    let volume: f64 = survey.shells.all.iter().map(|shell| shell.volume).sum();
    let is_solid = cap_area <= MAX_CAP_FRACTION * area && volume.abs() > MIN_COMPACTNESS * libm::pow(area, 1.5);
    if !is_solid || !(closed || refused) {
        return false;
    }
    health.dropped_sheets = count_patches(mesh, edges, &is_sheet);
    health.dropped_sheet_triangles = is_sheet.iter().filter(|&&sheet| sheet).count();
    mesh.keep(|t| !is_sheet[t]);
    true
}

/// Shells of a mesh with their measures.
struct Survey {
    shells: Shells,
    holes: usize,
}

impl Survey {
    fn of(mesh: &TriangleMesh) -> Self {
        let edges = Edges::new(mesh.positions.len(), &mesh.triangles);
        let mut shells = Shells::new(mesh, &edges);
        let holes = boundary::loops(mesh, &edges, &shells.of_triangle);
        shells.measure(mesh, &fill::fill(&mesh.positions, &holes));
        Self { shells, holes: holes.len() }
    }

    fn area(&self) -> f64 {
        self.shells.all.iter().map(|shell| shell.area).sum()
    }

    fn cap_area(&self) -> f64 {
        self.shells.all.iter().map(|shell| shell.cap_area).sum()
    }
}

/// Patches, by a union over edges with two triangles.
fn patches(triangles: usize, edges: &Edges) -> DisjointSets {
    let mut patches = DisjointSets::new(triangles);
    for edge in edges.iter() {
        if let [a, b] = *edge.half_edges {
            patches.join(triangle_of(a) as u32, triangle_of(b) as u32);
        }
    }
    patches
}

fn count_patches(mesh: &TriangleMesh, edges: &Edges, among: &[bool]) -> usize {
    let mut patches = patches(mesh.triangles.len(), edges);
    (0..mesh.triangles.len()).filter(|&t| among[t] && patches.root(t as u32) == t as u32).count()
}

/// Triangles of patches that are sheets by themselves.
fn open_patches(mesh: &TriangleMesh, edges: &Edges) -> Vec<bool> {
    let mut is_sheet = vec![false; mesh.triangles.len()];
    let mut patches = patches(mesh.triangles.len(), edges);
    // Of one patch nothing would stay.
    if (0..mesh.triangles.len() as u32).all(|t| patches.root(t) == 0) {
        return is_sheet;
    }
    let mut is_open = vec![false; mesh.triangles.len()];
    for edge in edges.iter().filter(|edge| edge.half_edges.len() == 1) {
        is_open[patches.root(triangle_of(edge.half_edges[0]) as u32) as usize] = true;
    }
    // The open patches alone, each with vertices of its own, are shells that can be measured.
    let mut alone = TriangleMesh::default();
    let mut members = Vec::new();
    let mut copies = std::collections::HashMap::new();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let patch = patches.root(t as u32);
        if is_open[patch as usize] {
            members.push(t);
            alone.triangles.push(triangle.map(|v| {
                *copies.entry((patch, v)).or_insert_with(|| {
                    alone.positions.push(mesh.positions[v as usize]);
                    alone.positions.len() as u32 - 1
                })
            }));
        }
    }
    if members.is_empty() {
        return is_sheet;
    }
    let survey = Survey::of(&alone);
    for (&t, &shell) in members.iter().zip(&survey.shells.of_triangle) {
        let shell = &survey.shells.all[shell as usize];
        let is_open = shell.cap_area > MAX_CAP_FRACTION * shell.area;
        // A box without its lid is no sheet, but a solid that is not closed.
        let compactness = shell.volume.abs() / libm::pow(shell.area + shell.cap_area, 1.5);
        let is_hollow = shell.cap_area < HOLLOW_CAP * shell.area && compactness > HOLLOW;
        is_sheet[t] = is_open && !is_hollow;
    }
    is_sheet
}
