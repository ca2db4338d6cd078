//! What colours a mesh shows, and on how much of it: as who lays colours on a surface sees them, after baking.

use std::collections::BTreeMap;

use glam::Vec2;
use lumislice::mesh::{Loaded, TriangleMesh};

/// Points of a triangle by their weights: the middles of the 16 triangles that its sides' quarters make.
fn points() -> impl Iterator<Item = [f32; 3]> {
    let rows = (0..4).flat_map(|i| (0..4 - i).map(move |j| (i, j, 1)));
    let turned = (0..3).flat_map(|i| (0..3 - i).map(move |j| (i, j, 2)));
    rows.chain(turned).map(|(i, j, thirds)| {
        let (a, b) = (i as f32 + thirds as f32 / 3.0, j as f32 + thirds as f32 / 3.0);
        [a / 4.0, b / 4.0, 1.0 - (a + b) / 4.0]
    })
}

/// Linear colour at a point of triangle `t`, of a mesh whose textures all repeat and whose corners have no colours.
pub fn color_at(mesh: &TriangleMesh, t: usize, weights: [f32; 3]) -> [f32; 3] {
    assert!(mesh.corner_colors.is_empty());
    let material = &mesh.materials[usize::from(mesh.material_of.get(t).copied().unwrap_or(0))];
    let [r, g, b, _] = material.base_color;
    let Some(texture) = &material.base_color_texture else { return [r, g, b] };
    let uv: Vec2 = mesh.uvs[t].iter().zip(weights).map(|(uv, weight)| *uv * weight).sum();
    let texel = |at: f32, size: u32| ((at.rem_euclid(1.0) * size as f32) as u32).min(size - 1) as usize;
    let index = texel(uv.x, texture.width) + texture.width as usize * texel(uv.y, texture.height);
    let [tr, tg, tb, _] = texture.texels[index];
    [tr, tg, tb].map(|c| linear(f32::from(c) / 255.0)).iter().zip([r, g, b]).map(|(t, f)| t * f).collect::<Vec<_>>()[..]
        .try_into()
        .unwrap()
}

/// Share of the area by colour, encoded in bytes.
pub fn shares(loaded: &Loaded) -> BTreeMap<[u8; 3], f64> {
    let mut mesh = loaded.mesh.clone();
    mesh.bake_base_color(None);
    let mut shares = BTreeMap::new();
    let area = |t: usize| {
        let [a, b, c] = mesh.triangles[t].map(|v| mesh.positions[v as usize]);
        0.5 * (b - a).cross(c - a).length()
    };
    let total: f64 = (0..mesh.triangles.len()).map(area).sum();
    for t in 0..mesh.triangles.len() {
        for weights in points() {
            let color = color_at(&mesh, t, weights).map(byte);
            *shares.entry(color).or_insert(0.0) += area(t) / total / 16.0;
        }
    }
    shares
}

/// Whether a mesh shows these colours (encoded, within a level or two) on these shares of its area, and no others.
pub fn assert_shares(loaded: &Loaded, expected: &[([u8; 3], f64)]) {
    let found = shares(loaded);
    for (color, share) in expected {
        let near = |other: &[u8; 3]| color.iter().zip(other).all(|(a, b)| a.abs_diff(*b) <= 2);
        let sum: f64 = found.iter().filter(|(other, _)| near(other)).map(|(_, share)| share).sum();
        assert!((sum - share).abs() < 1e-6, "{color:?} covers {sum}, not {share}: {found:?}");
    }
}

pub fn linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

pub fn byte(c: f32) -> u8 {
    let encoded = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}
