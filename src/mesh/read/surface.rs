//! What holds for the colours of every format: textures need coordinates, black swallows them, colours alike are one.

use glam::Vec2;

use super::raw::{RawMesh, WHITE};
use crate::words::counted;

/// Full value of encoded colours that are written as numbers of any kind: 255 where they are bytes, else 1. One value
/// beyond 1 is rounding, or light; bytes are whole numbers well beyond, or, where averages were taken, mostly beyond.
pub(super) fn full_value(values: impl Iterator<Item = f32>) -> f32 {
    const SURELY_BYTES: f32 = 10.0;
    let (mut greatest, mut all, mut beyond, mut whole) = (0.0f32, 0usize, 0usize, true);
    for value in values.filter(|value| value.is_finite() && *value > 0.0) {
        greatest = greatest.max(value);
        all += 1;
        beyond += usize::from(value > 1.0);
        whole &= value.fract() == 0.0;
    }
    if greatest > SURELY_BYTES && (whole || 2 * beyond > all) { 255.0 } else { 1.0 }
}

/// Settles coordinates and colours once all triangles and materials are known.
pub(super) fn settle(raw: &mut RawMesh) {
    if !raw.corner_colors.is_empty() {
        raw.corner_colors.resize(raw.triangles.len(), [WHITE; 3]);
    }
    super::polygon::settle(raw);
    let mut triangles = vec![0usize; raw.materials.len()];
    let mut bare = vec![0usize; raw.materials.len()];
    for t in 0..raw.triangles.len() {
        let material = raw.material(t);
        if let Some(count) = triangles.get_mut(material) {
            *count += 1;
            bare[material] += usize::from(raw.uvs.get(t).is_none_or(|uvs| uvs.iter().any(|uv| uv.is_nan())));
        }
    }
    for (material, (&all, &bare)) in triangles.iter().zip(&bare).enumerate().filter(|(_, (all, _))| **all > 0) {
        let looks = &raw.materials[material];
        if looks.base_color_texture.is_none() {
            continue;
        }
        let name = looks.name.clone();
        if looks.base_color[..3] == [0.0; 3] {
            raw.warnings
                .push(format!("material `{name}` multiplies its texture by black: it stays black, as its file says"));
        }
        if bare > 0 {
            raw.lose_color(format!(
                "{} of {} with the texture of material `{name}` have no texture coordinates",
                bare,
                counted(all, "triangle")
            ));
        }
    }
    raw.uvs.iter_mut().flatten().filter(|uv| uv.is_nan()).for_each(|uv| *uv = Vec2::ZERO);
    fold_constant_colors(raw);
}

/// Colours that are the same all over a material become its own, exactly.
fn fold_constant_colors(raw: &mut RawMesh) {
    if raw.corner_colors.is_empty() {
        return;
    }
    let mut color_of: Vec<Option<[f32; 3]>> = vec![None; raw.materials.len()];
    for (t, colors) in raw.corner_colors.iter().enumerate() {
        let Some(known) = color_of.get_mut(raw.material(t)) else { return };
        let known = known.get_or_insert(colors[0]);
        if colors.iter().any(|color| color != known) {
            return;
        }
    }
    for (material, color) in raw.materials.iter_mut().zip(color_of) {
        let [r, g, b] = color.unwrap_or(WHITE);
        let [kr, kg, kb, alpha] = material.base_color;
        material.base_color = [kr * r, kg * g, kb * b, alpha];
    }
    raw.corner_colors = Vec::new();
}
