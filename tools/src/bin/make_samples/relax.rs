//! From a dense mesh of an implicit solid to one as fine as the shape asks for: vertices glide along the surface,
//! those on creases along their crease, short edges collapse, and edges flip.
//!
//! The edge lengths follow Dunyach, Vanderhaeghe, Barthe, Botsch 2013, *Adaptive Remeshing for Real-Time Mesh
//! Deformation*, equation 1: an edge of length L on a surface of curvature κ stays within ε of it for
//! L = √(6ε/κ − 3ε²).

use glam::DVec3;
use rayon::prelude::*;

use crate::crease::crease_point;
use crate::meshing::Mesh;
use crate::remesh::{collapse_short_edges, flip_edges};
use crate::shape::Figure;

/// Rounds of collapsing, flipping and gliding; the smallest angle stops growing after about twenty.
const ROUNDS: usize = 24;
/// Part of the way to the neighbours' mean that a vertex goes in a round.
const STRIDE: f64 = 0.6;
/// ε in mm: on a print 30 mm high, 5 µm.
const DEVIATION: f64 = 0.015;
/// Edge lengths in mm that the sizing keeps to, and how much longer they may get per mm of way.
const EDGE_LENGTHS: (f64, f64) = (0.5, 1.4);
const GRADING: f64 = 0.3;
/// Edges shorter than this part of their due length collapse (Botsch and Kobbelt 2004).
const TOO_SHORT: f64 = 0.8;
/// Vertices this close to the base plane, in grid steps, are meant to lie in it: a crease is found to 1/64.
const FLATNESS: f64 = 0.02;

/// Turns `mesh`, made on a grid of `step`, into one whose vertices lie on the surface of `figure`.
pub fn relax(figure: &Figure, mesh: &mut Mesh, step: f64) {
    // A vertex belongs to a crease if the crease passes its own cell, whose half diagonal is 0.87 steps.
    let mut creased: Vec<bool> = mesh
        .positions
        .par_iter_mut()
        .map(|p| {
            let crease = crease_point(figure, *p, 0.87 * step).filter(|c| (*c - *p).abs().max_element() < 0.6 * step);
            *p = crease.unwrap_or_else(|| figure.project(*p, 1e-4));
            crease.is_some()
        })
        .collect();
    for round in 0..ROUNDS {
        for _ in 0..3 {
            let due = due_lengths(figure, mesh, &creased);
            collapse_short_edges(mesh, &mut creased, &due, TOO_SHORT);
        }
        flip_edges(mesh, &creased);
        let tolerance = if round + 1 < ROUNDS { 1e-4 } else { 1e-9 };
        glide(figure, mesh, &creased, tolerance);
    }
    flip_edges(mesh, &creased);
    for p in &mut mesh.positions {
        if p.y.abs() < FLATNESS * step {
            p.y = 0.0;
        }
    }
}

/// Each vertex with each of its neighbours, sorted.
fn links(mesh: &Mesh) -> Vec<[u32; 2]> {
    let mut links: Vec<[u32; 2]> = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    links.sort_unstable();
    links
}

/// Edge length due at every vertex.
fn due_lengths(figure: &Figure, mesh: &Mesh, creased: &[bool]) -> Vec<f64> {
    let normals: Vec<DVec3> = mesh.positions.par_iter().map(|&p| figure.normal(p)).collect();
    let links = links(mesh);
    let mut due = vec![EDGE_LENGTHS.1; mesh.positions.len()];
    for &[a, b] in &links {
        let (a, b) = (a as usize, b as usize);
        // Across a crease normals jump; only the sides' own curvature counts.
        if !creased[a] && !creased[b] {
            let curvature = normals[a].distance(normals[b]) / mesh.positions[a].distance(mesh.positions[b]).max(1e-6);
            let length = (6.0 * DEVIATION / curvature.max(1e-6) - 3.0 * DEVIATION * DEVIATION).max(0.0).sqrt();
            due[a] = due[a].min(length.max(EDGE_LENGTHS.0));
        }
    }
    for _ in 0..4 {
        for &[a, b] in &links {
            let (a, b) = (a as usize, b as usize);
            let way = mesh.positions[a].distance(mesh.positions[b]);
            due[b] = due[b].min(due[a] + GRADING * way);
        }
    }
    due
}

/// Moves every vertex towards its neighbours' mean, along the surface or along its crease.
fn glide(figure: &Figure, mesh: &mut Mesh, creased: &[bool], tolerance: f64) {
    let links = links(mesh);
    let positions = &mesh.positions;
    mesh.positions = (0..positions.len())
        .into_par_iter()
        .map(|v| {
            let own = &links[links.partition_point(|l| (l[0] as usize) < v)..];
            let neighbours = own.iter().take_while(|l| l[0] as usize == v).map(|l| l[1] as usize);
            let p = positions[v];
            if creased[v] {
                let along: Vec<DVec3> = neighbours.filter(|&n| creased[n]).map(|n| positions[n]).collect();
                // Ends and junctions of creases stay.
                let [a, b] = along[..] else { return p };
                let aim = p.lerp((a + b) / 2.0, STRIDE);
                crease_point(figure, aim, 0.2 * a.distance(b)).unwrap_or(p)
            } else {
                let (mut sum, mut count) = (DVec3::ZERO, 0.0);
                for n in neighbours {
                    sum += positions[n];
                    count += 1.0;
                }
                let pull = (sum / count - p) * STRIDE;
                let normal = figure.normal(p);
                figure.project(p + pull - normal * pull.dot(normal), tolerance)
            }
        })
        .collect();
}
