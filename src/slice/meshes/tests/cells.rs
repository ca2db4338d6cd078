//! Random labels: every material is closed, and neighbours share triangles, whatever meets in a cell.

use std::collections::HashMap;

use glam::Vec3;
use proptest::prelude::*;

use super::{
    super::cell::{CellOutput, EDGE_START, FacePattern, face_pattern, fill_cell},
    assert_closed,
};

/// Nodes along an edge of the block of random labels; one more layer of air lies around it.
const SIDE: usize = 5;
const NODES: usize = SIDE + 2;

/// An edge or face: its lowest node, its axis, and whether it is a face.
type Place = ([usize; 3], usize, bool);

#[derive(Default)]
struct Collected {
    numbers: HashMap<Place, u32>,
    positions: Vec<Vec3>,
    triangles: Vec<(u8, u8, [u32; 3])>,
}

impl CellOutput for Collected {
    fn vertex(&mut self, position: Vec3) -> u32 {
        self.positions.push(position);
        self.positions.len() as u32 - 1
    }

    fn triangle(&mut self, behind: u8, front: u8, corners: [u32; 3]) {
        self.triangles.push((behind, front, corners));
    }
}

fn place(cell: [usize; 3], point: usize) -> Place {
    let corner = |bits: usize| [cell[0] + (bits & 1), cell[1] + (bits >> 1 & 1), cell[2] + (bits >> 2)];
    if point < 12 {
        (corner(EDGE_START[point]), point / 4, false)
    } else {
        let (axis, side) = ((point - 12) / 2, (point - 12) % 2);
        (corner(side << axis), axis, true)
    }
}

/// A position on an edge or face that depends on nothing else.
fn position((node, axis, face): Place, shares: &[f32]) -> Vec3 {
    let share = shares[(node[0] * 31 + node[1] * 17 + node[2] * 7 + axis) % shares.len()];
    let mut p = Vec3::from(node.map(|n| n as f32));
    for other in 0..3 {
        if face && other != axis {
            p[other] += 0.5;
        }
        if !face && other == axis {
            p[other] += share;
        }
    }
    p
}

fn march(labels: &[u8], shares: &[f32]) -> Collected {
    let label = |at: [usize; 3]| {
        let inside = at.iter().all(|&n| (1..=SIDE).contains(&n));
        if inside { labels[at[0] - 1 + SIDE * (at[1] - 1 + SIDE * (at[2] - 1))] } else { 0 }
    };
    let mut out = Collected::default();
    for n in 0..(NODES - 1).pow(3) {
        let cell = [n % (NODES - 1), n / (NODES - 1) % (NODES - 1), n / (NODES - 1).pow(2)];
        let corners: [u8; 8] =
            std::array::from_fn(|c| label([cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)]));
        if corners == [corners[0]; 8] {
            continue;
        }
        // Numbers are given beforehand, as the march does.
        for point in 0..18 {
            let place = place(cell, point);
            if !out.numbers.contains_key(&place) {
                let number = out.vertex(position(place, shares));
                out.numbers.insert(place, number);
            }
        }
        let numbers: [u32; 18] = std::array::from_fn(|point| out.numbers[&place(cell, point)]);
        fill_cell(&corners, |point| numbers[point], |point| position(place(cell, point), shares), &mut out);
    }
    out
}

fn check(labels: &[u8], shares: &[f32]) -> Result<(), TestCaseError> {
    let out = march(labels, shares);
    for material in 0..4 {
        let triangles = out.triangles.iter().filter_map(|&(behind, front, [a, b, c])| {
            if behind == material { Some([a, b, c]) } else { (front == material).then_some([a, c, b]) }
        });
        assert_closed(triangles, &format!("material {material}"));
    }
    let volume: f32 = out
        .triangles
        .iter()
        .filter(|(behind, front, _)| *behind == 0 || *front == 0)
        .map(|&(behind, _, corners)| {
            let [a, b, c] = corners.map(|v| out.positions[v as usize]);
            a.dot(b.cross(c)) / 6.0 * if behind == 0 { -1.0 } else { 1.0 }
        })
        .sum();
    prop_assert!(volume >= 0.0);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn two_materials_close(
        labels in prop::collection::vec(0_u8..2, SIDE.pow(3)),
        shares in prop::collection::vec(0.01_f32..0.99, 97),
    ) {
        check(&labels, &shares)?;
    }

    #[test]
    fn four_materials_close(
        labels in prop::collection::vec(0_u8..4, SIDE.pow(3)),
        shares in prop::collection::vec(0.01_f32..0.99, 97),
    ) {
        check(&labels, &shares)?;
    }

    /// With every vertex in the middle all ties are ties.
    #[test]
    fn ties_are_broken_alike(labels in prop::collection::vec(0_u8..3, SIDE.pow(3))) {
        check(&labels, &[0.5])?;
    }
}

#[test]
fn a_lone_node_is_an_octahedron() {
    let mut labels = vec![0; SIDE.pow(3)];
    labels[SIDE.pow(3) / 2] = 2;
    let out = march(&labels, &[0.5]);
    assert_eq!(out.triangles.len(), 8);
    let volume: f32 = out
        .triangles
        .iter()
        .map(|&(behind, _, corners)| {
            let [a, b, c] = corners.map(|v| out.positions[v as usize]);
            a.dot(b.cross(c)) / 6.0 * if behind == 2 { 1.0 } else { -1.0 }
        })
        .sum();
    assert!((volume - 1.0 / 6.0).abs() < 1e-5, "{volume}"); // half diagonals of 1/2
}

#[test]
fn faces_are_cut_the_same_from_both_sides() {
    for n in 0..256_usize {
        let labels: [u8; 4] = std::array::from_fn(|corner| (n >> (2 * corner) & 3) as u8);
        let reversed = [labels[0], labels[3], labels[2], labels[1]];
        let (pattern, mirrored) = (face_pattern(labels), face_pattern(reversed));
        // Seen from the other side edge i is edge 3 − i, and even corners stay even.
        let expected = match pattern {
            FacePattern::Segment(a, b) => FacePattern::Segment(3 - b, 3 - a),
            same => same,
        };
        assert_eq!(mirrored, expected, "{labels:?}");
    }
}
