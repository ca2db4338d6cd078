//! Sheets without thickness beside a solid: fins, walls drawn as faces, both sides of nothing. Both sides of such a
//! face are inside, or both outside, so it is no surface, and it goes.
//!
//! A sheet is a patch (what edges with two triangles connect) that is open and would take more than
//! [`MAX_CAP_FRACTION`] of its area to close, or a closed shell that holds no volume. It goes only if what stays is
//! closed without it: a lid that lies loosely on a cup is a surface after all. Where the mesh would be refused
//! otherwise, it is enough if what stays is not.
//!
//! No sheet is a patch whose rim runs along another's ([`super::rims`]), nor one that is seated: its rim lies in or on
//! what stays and the rest of it outside, as a dome's on a roof or an eye's on a head. Its cap is buried.

use glam::DVec3;

use super::edges::{Edges, triangle_of};
use super::nesting::{Shell, Shells};
use super::rims::Bodies;
use super::seat::Ground;
use super::{HealthReport, MAX_CAP_FRACTION, MIN_COMPACTNESS, TriangleMesh, boundary, fill, is_needle};
use crate::disjoint_sets::DisjointSets;

/// An open patch whose holes take less than this share of its area, and that would enclose more than this times its
/// area^(3/2), holds something: a cube without a lid has 0.2 and 0.068, a sphere cut in halves 0.5.
const HOLLOW_CAP: f64 = 0.4;
const HOLLOW: f64 = 0.02;

/// What [`drop`] did.
#[derive(Default)]
pub(super) struct Dropped {
    /// Whether triangles went or turned.
    pub(super) changed: bool,
    /// Of the triangles left, those of seated patches; empty where there are none.
    pub(super) seated: Vec<bool>,
}

/// Drops sheets, and turns seated patches outwards. `shells` are measured, caps included.
pub(super) fn drop(mesh: &mut TriangleMesh, edges: &Edges, shells: &Shells, health: &mut HealthReport) -> Dropped {
    if edges.iter().all(|edge| edge.half_edges.len() > 1) && !shells.all.iter().any(Shell::is_flat) {
        return Dropped::default();
    }
    let patches = OpenPatches::of(mesh, edges);
    let mut is_sheet = patches.sheets(mesh);
    let solids = || shells.all.iter().filter(|shell| !shell.is_flat());
    if solids().next().is_some() && shells.all.iter().any(|shell| shell.is_flat() && shell.cap_area == 0.0) {
        for (sheet, &shell) in is_sheet.iter_mut().zip(&shells.of_triangle) {
            let shell = &shells.all[shell as usize];
            *sheet |= shell.is_flat() && shell.cap_area == 0.0;
        }
    }
    let seated = patches.seated(mesh, &is_sheet);
    let mut dropped = Dropped::default();
    for (t, seat) in seated.iter().enumerate() {
        is_sheet[t] &= seat.is_none();
        if *seat == Some(Seat::Inwards) {
            mesh.flip(t);
            dropped.changed = true;
        }
    }
    let is_seated: Vec<bool> = seated.iter().map(Option::is_some).collect();
    if is_sheet.contains(&true) && (0..is_sheet.len()).any(|t| !is_sheet[t]) {
        let rest = without(mesh, |t| is_sheet[t] || is_seated[t]);
        let survey = Survey::of(&rest);
        let (area, cap_area) = (survey.area(), survey.cap_area());
        let refused = shells.all.iter().map(|shell| shell.cap_area).sum::<f64>()
            > MAX_CAP_FRACTION * shells.all.iter().map(|shell| shell.area).sum::<f64>();
        let closed = survey.holes.is_empty();
        let volume: f64 = survey.shells.all.iter().map(|shell| shell.volume.abs()).sum();
        let is_solid = cap_area <= MAX_CAP_FRACTION * area && volume > MIN_COMPACTNESS * libm::pow(area, 1.5);
        if is_solid && (closed || refused) {
            health.dropped_sheets = count_patches(mesh, edges, &is_sheet);
            health.dropped_sheet_volume_mm3 = patches.volume(&is_sheet);
            health.dropped_sheet_triangles = is_sheet.iter().filter(|&&sheet| sheet).count();
            mesh.keep(|t| !is_sheet[t]);
            dropped.changed = true;
            dropped.seated = is_seated.iter().zip(&is_sheet).filter(|(_, sheet)| !**sheet).map(|(s, _)| *s).collect();
            return dropped;
        }
    }
    if is_seated.contains(&true) {
        dropped.seated = is_seated;
    }
    dropped
}

/// The triangles that are not left out, without their attributes.
pub(super) fn without(mesh: &TriangleMesh, left_out: impl Fn(usize) -> bool) -> TriangleMesh {
    let mut rest = TriangleMesh { positions: mesh.positions.clone(), ..TriangleMesh::default() };
    rest.triangles = (0..mesh.triangles.len()).filter(|&t| !left_out(t)).map(|t| mesh.triangles[t]).collect();
    rest
}

/// Area of what closes a mesh, mm².
pub(super) fn cap_area(mesh: &TriangleMesh) -> f64 {
    Survey::of(mesh).cap_area()
}

/// Shells of a mesh with their measures.
struct Survey {
    shells: Shells,
    holes: Vec<boundary::Hole>,
    caps: Vec<fill::Cap>,
}

impl Survey {
    fn of(mesh: &TriangleMesh) -> Self {
        let edges = Edges::new(mesh.positions.len(), &mesh.triangles);
        let mut shells = Shells::new(mesh, &edges);
        let holes = boundary::loops(mesh, &edges, &shells.of_triangle);
        let caps = fill::fill(&mesh.positions, &holes);
        shells.measure(mesh, &caps);
        Self { shells, holes, caps }
    }

    fn area(&self) -> f64 {
        self.shells.all.iter().map(|shell| shell.area).sum()
    }

    fn cap_area(&self) -> f64 {
        self.shells.all.iter().map(|shell| shell.cap_area).sum()
    }
}

/// Patches, by a union over edges with two triangles.
pub(super) fn patches(triangles: usize, edges: &Edges) -> DisjointSets {
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

/// Which way a seated patch faced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Seat {
    Outwards,
    Inwards,
}

/// The open patches of a mesh, each with vertices of its own, so that they are shells that can be measured.
struct OpenPatches {
    alone: TriangleMesh,
    /// The mesh's triangle of every triangle.
    members: Vec<usize>,
    survey: Survey,
}

impl OpenPatches {
    fn of(mesh: &TriangleMesh, edges: &Edges) -> Self {
        let mut patches = patches(mesh.triangles.len(), edges);
        let mut alone = TriangleMesh::default();
        let mut members = Vec::new();
        // Of one patch nothing would stay.
        if (0..mesh.triangles.len() as u32).any(|t| patches.root(t) != 0) {
            let mut is_open = vec![false; mesh.triangles.len()];
            for edge in edges.iter().filter(|edge| edge.half_edges.len() == 1) {
                is_open[patches.root(triangle_of(edge.half_edges[0]) as u32) as usize] = true;
            }
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
        }
        let survey = Survey::of(&alone);
        Self { alone, members, survey }
    }

    /// Triangles of patches that are sheets by themselves.
    fn sheets(&self, mesh: &TriangleMesh) -> Vec<bool> {
        let mut is_sheet = vec![false; mesh.triangles.len()];
        let Survey { shells, holes, .. } = &self.survey;
        let has_partner = Bodies::new(&self.alone, shells, holes).hold(shells);
        let mut has_area = vec![false; shells.len()];
        for (corners, &shell) in self.alone.corners().zip(&shells.of_triangle) {
            has_area[shell as usize] |= !is_needle(corners);
        }
        for (&t, &s) in self.members.iter().zip(&shells.of_triangle) {
            let shell = &shells.all[s as usize];
            // A box without its lid is no sheet, but a solid that is not closed.
            let compactness = shell.volume.abs() / libm::pow(shell.area + shell.cap_area, 1.5);
            let is_hollow = shell.cap_area < HOLLOW_CAP * shell.area && compactness > HOLLOW;
            is_sheet[t] = !has_area[s as usize] || shell.is_open() && !is_hollow && !has_partner[s as usize];
        }
        is_sheet
    }

    /// What the patches among these triangles would hold if they were closed.
    fn volume(&self, among: &[bool]) -> f64 {
        let Survey { shells, .. } = &self.survey;
        let mut counts = vec![false; shells.len()];
        self.members.iter().zip(&shells.of_triangle).for_each(|(&t, &shell)| counts[shell as usize] |= among[t]);
        shells.all.iter().zip(counts).filter(|(_, counts)| *counts).map(|(shell, _)| shell.volume.abs()).sum()
    }

    /// Seats of the mesh's triangles on what is neither sheet nor open.
    fn seated(&self, mesh: &TriangleMesh, is_sheet: &[bool]) -> Vec<Option<Seat>> {
        let mut seats = vec![None; mesh.triangles.len()];
        let Survey { shells, holes, caps } = &self.survey;
        let mut rims = vec![Vec::new(); shells.len()];
        for hole in holes {
            rims[hole.shell as usize].extend(hole.vertices.iter().map(|&v| self.alone.positions[v as usize]));
        }
        let mut waiting: Vec<u32> = (0..shells.len() as u32)
            .filter(|&s| shells.all[s as usize].is_open() && !shells.all[s as usize].is_flat())
            .collect();
        if waiting.is_empty() {
            return seats;
        }
        let mut surfaces = vec![Vec::new(); shells.len()];
        for (corners, &shell) in self.alone.corners().zip(&shells.of_triangle) {
            surfaces[shell as usize].push(corners);
        }
        let mut waits = vec![false; shells.len()];
        waiting.iter().for_each(|&shell| waits[shell as usize] = true);
        let mut is_out = is_sheet.to_vec();
        for (&t, &shell) in self.members.iter().zip(&shells.of_triangle) {
            is_out[t] |= waits[shell as usize];
        }
        let ground = without(mesh, |t| is_out[t]);
        let capped = Survey::of(&ground);
        let outline = ground.corners().chain(capped.caps.iter().map(|cap| cap.corners)).collect();
        let mut ground = Ground::new(outline);
        // Eyes may sit on a head that sits on a body.
        loop {
            let before = waiting.len();
            waiting.retain(|&shell| {
                let s = shell as usize;
                let corners: Vec<DVec3> = surfaces[s].iter().flatten().copied().collect();
                if !ground.holds(&rims[s], &corners) {
                    return true;
                }
                let is_inwards = shells.all[s].volume < 0.0;
                let cap = caps.iter().filter(|cap| cap.shell == shell).map(|cap| cap.corners);
                ground.add(surfaces[s].iter().copied().chain(cap), is_inwards);
                for (&t, _) in self.members.iter().zip(&shells.of_triangle).filter(|(_, of)| **of == shell) {
                    seats[t] = Some(if is_inwards { Seat::Inwards } else { Seat::Outwards });
                }
                false
            });
            if waiting.is_empty() || waiting.len() == before {
                return seats;
            }
        }
    }
}
