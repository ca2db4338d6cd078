//! Layers that vary over the surface, some of them down to nothing.

use glam::DVec3;

use super::*;
use crate::appearance::{Atlas, ClusterId, LabelMap, TexturedLayers};

/// A sphere with three stackings in patches: interpolated thicknesses, layers that end, another core's neighbourhood.
pub(super) fn patched_sphere(labels: impl Fn(u32, u32) -> u16) -> Slicer {
    const SIZE: (u32, u32) = (8, 6);
    let ball = sphere(DVec3::splat(5.0), 5.0, 48);
    let atlas = Atlas::new(&ball, &[SIZE], &[]);
    let map = LabelMap((0..SIZE.0 * SIZE.1).map(|n| ClusterId(labels(n % SIZE.0, n / SIZE.0))).collect());
    let layers = LayerField::Textured(Box::new(TexturedLayers::new(&ball, &atlas, &[map], three_stackings())));
    slicer(vec![(ball, layers)], DVec3::splat(10.0), 0.08)
}

/// Texels of 4 mm and stackings that share no layer: most layers taper to nothing somewhere. At 0.2 mm, half the
/// thinnest layer, the worst is off by 1.2%, at 0.08 mm by 0.3%.
#[test]
fn textured_layers_are_closed_and_keep_their_volumes() {
    let slicer = patched_sphere(|x, y| ((x * 5 + y * 7) % 3) as u16);
    let meshes = mesh(&slicer, 0.16, &[WHITE, SUPPORT, BLACK, CYAN]);
    assert_sound(&meshes);
    assert_closed(outer_triangles(&meshes), "the outer surface");
    assert_volumes(&meshes, &slicer, 0.01);
}

/// But for what a uniform stack alone gets, vertices on the exact boundary and on edges: at this coarse pitch volumes
/// differ by up to 0.28%. Vertices on a ball of radius R inscribe it: its volume comes out less by up to about h²/4R²
/// of it, 0.23% of the core at a pitch of 0.25 mm.
#[test]
fn a_texture_of_one_stacking_is_a_uniform_stack() {
    let patched = patched_sphere(|_, _| 0);
    let layers = stack(&[(WHITE, 0.4), (SUPPORT, 1.2), (WHITE, 0.6)], CYAN);
    let uniform = slicer(vec![(sphere(DVec3::splat(5.0), 5.0, 48), layers)], DVec3::splat(10.0), 0.08);
    let ids = [WHITE, SUPPORT, CYAN];
    let [patched, exact] = [&patched, &uniform].map(|slicer| mesh(slicer, 0.25, &ids));
    assert_volumes(&exact, &uniform, 2.5e-3);
    for (a, b) in patched.parts.iter().zip(&exact.parts) {
        assert!((a.volume_mm3 - b.volume_mm3).abs() <= 4e-3 * b.volume_mm3, "{} {}", a.volume_mm3, b.volume_mm3);
    }
}
