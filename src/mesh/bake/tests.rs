//! Baked colours are what the mesh had, and what needs no baking stays.

use std::sync::Arc;

use glam::DVec3;

use super::*;
use crate::colour::srgb_to_linear as linear;
use crate::mesh::Texture;

/// One flat triangle.
fn triangle(uvs: [[f32; 2]; 3], material: SurfaceMaterial) -> TriangleMesh {
    TriangleMesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        triangles: vec![[0, 1, 2]],
        uvs: vec![uvs.map(Vec2::from)],
        materials: vec![material],
        ..TriangleMesh::default()
    }
}

fn material(texture: Option<Texture>, wrap: Wrap) -> SurfaceMaterial {
    SurfaceMaterial {
        base_color_texture: texture.map(Arc::new),
        wrap: [wrap; 2],
        ..SurfaceMaterial::plain("", [1.0; 4])
    }
}

/// Red on the left, blue on the right.
fn halves() -> Texture {
    let row = [[255, 0, 0, 255], [255, 0, 0, 255], [0, 0, 255, 255], [0, 0, 255, 255]];
    Texture { width: 4, height: 4, texels: row.repeat(4) }
}

/// Linear colour of the mesh's triangle `t` at a point, as who lays colours sees it.
fn seen(mesh: &TriangleMesh, t: usize, weights: [f32; 3]) -> [f32; 3] {
    let material = &mesh.materials[mesh.material_index(t)];
    assert_eq!(material.wrap.map(|_| Wrap::Repeat), [Wrap::Repeat; 2]);
    let uv = mesh.uvs[t].iter().zip(weights).map(|(uv, weight)| *uv * weight).sum();
    let [r, g, b, _] = material.base_color;
    (sample(material, uv) * Vec3::new(r, g, b)).to_array()
}

const POINTS: [[f32; 3]; 7] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.3, 0.3, 0.4],
    [0.1, 0.2, 0.7],
    [0.5, 0.5, 0.0],
    [0.6, 0.1, 0.3],
];

#[test]
fn what_repeats_and_is_white_stays_bit_for_bit() {
    let mut mesh = triangle([[1.05, 0.0], [3.45, 0.0], [1.45, 1.0]], material(Some(halves()), Wrap::Repeat));
    let before = mesh.clone();
    assert!(!mesh.bake_base_color(Some((64, 64))));
    assert_eq!((mesh.uvs, mesh.materials.len()), (before.uvs, 1));
    let mut inside = triangle([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], material(Some(halves()), Wrap::Clamp));
    assert!(!inside.bake_base_color(None));
}

#[test]
fn corners_in_three_colours_are_interpolated() {
    for colors in [
        [[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]],
        [[0.5, 0.5, 0.5], [0.5, 0.5, 0.5], [0.1, 0.1, 0.8]],
        [[0.5, 0.2, 0.5], [0.1, 0.1, 0.8], [0.5, 0.2, 0.5]],
    ] {
        let mut mesh = triangle([[0.0; 2]; 3], material(None, Wrap::Repeat));
        mesh.corner_colors = vec![colors];
        assert!(mesh.bake_base_color(None));
        assert!(mesh.corner_colors.is_empty() && mesh.materials.len() == 1);
        for weights in POINTS {
            for (c, found) in seen(&mesh, 0, weights).into_iter().enumerate() {
                let expected: f32 = colors.iter().zip(weights).map(|(color, weight)| color[c] * weight).sum();
                assert!((encoded(found) - encoded(expected)).abs() < 1.5 * STEP, "{weights:?}: {found} {expected}");
            }
        }
        for (corner, color) in colors.into_iter().enumerate() {
            let mut weights = [0.0; 3];
            weights[corner] = 1.0;
            assert_eq!(seen(&mesh, 0, weights).map(byte), color.map(byte));
        }
    }
}

#[test]
fn one_colour_all_over_is_a_material() {
    let mut mesh = triangle([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], material(Some(halves()), Wrap::Repeat));
    mesh.corner_colors = vec![[[0.3, 0.2, 0.1]; 3]];
    let uvs = mesh.uvs.clone();
    assert!(mesh.bake_base_color(None));
    assert_eq!((mesh.uvs, mesh.materials[0].base_color), (uvs, [0.3, 0.2, 0.1, 1.0]));
}

#[test]
fn mirrors_and_edges_are_painted() {
    // Left of the middle all over, in the mirror image.
    for (wrap, uvs) in [
        (Wrap::Mirror, [[1.05, 0.0], [1.45, 0.0], [1.45, 1.0]]),
        (Wrap::Clamp, [[1.05, 0.0], [1.45, 0.0], [1.45, 1.0]]),
        (Wrap::Clamp, [[0.55, -7.0], [9.0, 0.0], [40.0, 1.0]]),
    ] {
        let mut mesh = triangle(uvs, material(Some(halves()), wrap));
        assert!(mesh.bake_base_color(None));
        for weights in POINTS {
            assert_eq!(seen(&mesh, 0, weights).map(byte), [0, 0, 255], "{wrap:?} {weights:?}");
        }
    }
}

#[test]
fn more_colours_than_materials_share_a_texture() {
    let mut mesh = triangle([[0.0; 2]; 3], material(None, Wrap::Repeat));
    let color = |t: usize| [linear((t % 23) as f32 / 22.0), linear((t / 23) as f32 / 22.0), 0.0];
    mesh.triangles = vec![[0, 1, 2]; 500];
    mesh.uvs = vec![mesh.uvs[0]; 500];
    mesh.corner_colors = (0..500).map(|t| [color(t); 3]).collect();
    assert!(mesh.bake_base_color(None));
    assert_eq!(mesh.materials.len(), 1);
    for t in 0..500 {
        for weights in POINTS {
            assert_eq!(seen(&mesh, t, weights).map(byte), color(t).map(byte));
        }
    }
}

#[test]
fn texels_remember_where_they_were() {
    let uvs = [[0.1, 0.2], [0.7, 0.2], [0.1, 0.9]];
    let mut mesh = triangle(uvs, material(None, Wrap::Repeat));
    mesh.corner_colors = vec![[[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]]];
    assert!(mesh.bake_base_color(Some((64, 64))));
    let from = mesh.materials[0].baked_from.clone().unwrap();
    let texture = mesh.materials[0].base_color_texture.clone().unwrap();
    for weights in POINTS {
        let mean = |uvs: [Vec2; 3]| uvs.iter().zip(weights).map(|(uv, weight)| *uv * weight).sum::<Vec2>();
        let at = mean(mesh.uvs[0]) * Vec2::new(texture.width as f32, texture.height as f32);
        let found = from[at.x as usize + texture.width as usize * at.y as usize];
        assert!(found.distance(mean(uvs.map(Vec2::from))) < 1.0 / 64.0, "{found}");
    }
}

#[test]
fn huge_and_broken_coordinates_end() {
    let mut mesh = triangle([[-1e30, 0.0], [1e30, f32::NAN], [0.0, 1e9]], material(Some(halves()), Wrap::Mirror));
    mesh.corner_colors = vec![[[0.1; 3], [0.9; 3], [f32::NAN; 3]]];
    assert!(mesh.bake_base_color(None));
}
