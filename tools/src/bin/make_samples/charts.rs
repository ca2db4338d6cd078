//! Cutting a surface into charts that lie flat with little distortion: variational shape approximation
//! (Cohen-Steiner, Alliez, Desbrun 2004) with the L²·¹ metric, and a cone that no normal of a chart may leave.
//!
//! A chart is projected along its axis. Inside the cone that stretches lengths by at most 1/cos 50° = 1.56 and turns
//! no triangle over; whether distant parts of a chart overlap is checked when texels are assigned.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::{DVec2, DVec3};

use crate::meshing::Mesh;

/// Cosine of the angle between a chart's axis and any of its normals: 50°.
const CONE_COSINE: f64 = 0.643;
/// Floods with refitted axes after the charts cover everything; their borders move no more after about eight.
const REFITS: usize = 10;

/// One flat piece of the atlas.
pub struct Chart {
    /// Indices into the mesh's triangles.
    pub triangles: Vec<usize>,
    /// The triangles' corners in the chart's plane, mm, x right and y up as seen from outside.
    pub corners: Vec<[DVec2; 3]>,
}

/// What the segmentation needs to know of each triangle.
struct Faces {
    normals: Vec<DVec3>,
    areas: Vec<f64>,
    neighbours: Vec<[usize; 3]>,
}

impl Faces {
    fn of(mesh: &Mesh) -> Self {
        let vectors: Vec<DVec3> = (0..mesh.triangles.len()).map(|t| mesh.area_vector(t)).collect();
        let mut edges: Vec<([u32; 2], usize, usize)> = Vec::new();
        for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            let sides = [[a, b], [b, c], [c, a]];
            edges.extend(sides.iter().enumerate().map(|(side, &[u, v])| ([u.min(v), u.max(v)], t, side)));
        }
        edges.sort_unstable();
        let mut neighbours = vec![[usize::MAX; 3]; mesh.triangles.len()];
        for pair in edges.chunk_by(|a, b| a.0 == b.0) {
            if let &[(_, s, i), (_, t, j)] = pair {
                neighbours[s][i] = t;
                neighbours[t][j] = s;
            }
        }
        Self {
            normals: vectors.iter().map(|v| v.normalize_or_zero()).collect(),
            areas: vectors.iter().map(|v| v.length()).collect(),
            neighbours,
        }
    }

    /// Mean normal of some triangles, weighted by area.
    fn axis(&self, triangles: &[usize]) -> DVec3 {
        triangles.iter().map(|&t| self.normals[t] * self.areas[t]).sum::<DVec3>().normalize_or(DVec3::Y)
    }

    /// Grows charts from (seed, axis) pairs, best fitting triangles first. Unreached triangles keep `usize::MAX`.
    fn flood(&self, seeds: &[(usize, DVec3)]) -> Vec<usize> {
        let mut chart_of = vec![usize::MAX; self.normals.len()];
        // Misfit 1 − n·axis is at least 0, so its bits sort like the number.
        let key = |t: usize, chart: usize| {
            Reverse(((1.0 - self.normals[t].dot(seeds[chart].1)).max(0.0).to_bits(), t, chart))
        };
        let mut queue: BinaryHeap<_> = seeds.iter().enumerate().map(|(chart, &(t, _))| key(t, chart)).collect();
        while let Some(Reverse((_, t, chart))) = queue.pop() {
            if chart_of[t] != usize::MAX {
                continue;
            }
            chart_of[t] = chart;
            for &n in &self.neighbours[t] {
                if n != usize::MAX && chart_of[n] == usize::MAX && self.normals[n].dot(seeds[chart].1) > CONE_COSINE {
                    queue.push(key(n, chart));
                }
            }
        }
        chart_of
    }

    /// The seed and the axis that suit a chart best.
    fn refit(&self, triangles: &[usize]) -> Option<(usize, DVec3)> {
        let axis = self.axis(triangles);
        let best = triangles
            .iter()
            .max_by(|&&a, &&b| self.normals[a].dot(axis).total_cmp(&self.normals[b].dot(axis)).then(b.cmp(&a)))?;
        Some((*best, axis))
    }

    /// One triangle of every connected piece that no chart covers.
    fn gaps(&self, chart_of: &[usize]) -> Vec<usize> {
        let mut seen: Vec<bool> = chart_of.iter().map(|&c| c != usize::MAX).collect();
        let mut firsts = Vec::new();
        for start in 0..seen.len() {
            if seen[start] {
                continue;
            }
            firsts.push(start);
            let mut stack = vec![start];
            while let Some(t) = stack.pop() {
                if t != usize::MAX && !std::mem::replace(&mut seen[t], true) {
                    stack.extend(self.neighbours[t]);
                }
            }
        }
        firsts
    }
}

fn members(chart_of: &[usize], charts: usize) -> Vec<Vec<usize>> {
    let mut members = vec![Vec::new(); charts];
    for (t, &chart) in chart_of.iter().enumerate().filter(|(_, c)| **c != usize::MAX) {
        members[chart].push(t);
    }
    members
}

/// Cuts `mesh` into charts; every triangle is in exactly one.
pub fn charts(mesh: &Mesh) -> Vec<Chart> {
    let faces = Faces::of(mesh);
    let mut seeds: Vec<(usize, DVec3)> = Vec::new();
    let mut refits = 0;
    let chart_of = loop {
        let chart_of = faces.flood(&seeds);
        let gaps = faces.gaps(&chart_of);
        if gaps.is_empty() && refits >= REFITS {
            break chart_of;
        }
        refits += usize::from(gaps.is_empty());
        if refits < REFITS {
            let members = merge(&faces, &chart_of, members(&chart_of, seeds.len()));
            seeds = members.iter().filter_map(|triangles| faces.refit(triangles)).collect();
        }
        seeds.extend(gaps.iter().map(|&t| (t, faces.normals[t])));
    };
    let members = members(&chart_of, seeds.len());
    members.iter().zip(&seeds).map(|(triangles, &(_, axis))| flatten(mesh, triangles, axis)).collect()
}

/// Joins neighbouring charts, small ones first, while one cone holds both.
fn merge(faces: &Faces, chart_of: &[usize], mut members: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
    let mut into: Vec<usize> = (0..members.len()).collect();
    let mut order = into.clone();
    let area = |triangles: &[usize]| triangles.iter().map(|&t| faces.areas[t]).sum::<f64>();
    order.sort_by(|&a, &b| area(&members[a]).total_cmp(&area(&members[b])).then(a.cmp(&b)));
    for chart in order {
        let mut around: Vec<usize> = members[chart]
            .iter()
            .flat_map(|&t| faces.neighbours[t])
            .filter(|&n| n != usize::MAX && chart_of[n] != usize::MAX)
            .map(|n| into[chart_of[n]])
            .filter(|&c| c != chart)
            .collect();
        around.sort_unstable();
        around.dedup();
        for other in around {
            let union: Vec<usize> = members[chart].iter().chain(&members[other]).copied().collect();
            let axis = faces.axis(&union);
            if union.iter().all(|&t| faces.normals[t].dot(axis) > CONE_COSINE) {
                members[other] = union;
                members[chart].clear();
                into.iter_mut().filter(|c| **c == chart).for_each(|c| *c = other);
                break;
            }
        }
    }
    members.retain(|triangles| !triangles.is_empty());
    members
}

/// Projects a chart along its axis and turns it so that its bounding box is smallest.
fn flatten(mesh: &Mesh, triangles: &[usize], axis: DVec3) -> Chart {
    let (right, up) = axis.any_orthonormal_pair();
    // Make (right, up, axis) right-handed, so that the chart is seen from outside.
    let up = if right.cross(up).dot(axis) < 0.0 { -up } else { up };
    let flat: Vec<[DVec2; 3]> =
        triangles.iter().map(|&t| mesh.corners(t).map(|p| DVec2::new(p.dot(right), p.dot(up)))).collect();
    let turned = |degrees: f64| {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        let turn = DVec2::new(cos, sin);
        flat.iter().map(|corners| corners.map(|p| turn.rotate(p))).collect::<Vec<_>>()
    };
    let corners = (0..30)
        .map(|step| turned(f64::from(step) * 3.0))
        .min_by(|a, b| extent(a).element_product().total_cmp(&extent(b).element_product()))
        .unwrap_or_default();
    Chart { triangles: triangles.to_vec(), corners }
}

/// Width and height of the corners' bounding box.
fn extent(corners: &[[DVec2; 3]]) -> DVec2 {
    let all = || corners.iter().flatten();
    all().fold(DVec2::MIN, |m, p| m.max(*p)) - all().fold(DVec2::MAX, |m, p| m.min(*p))
}
