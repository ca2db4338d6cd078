//! Layers that vary over the surface, some of them down to nothing.

use glam::DVec3;

use super::*;
use crate::{
    search::Stacking,
    target::{Atlas, LabelMap, SlotTable, TexturedLayers, align},
};

/// A sphere with three stackings in patches: interpolated thicknesses, layers that end, another core's neighbourhood.
fn patched_sphere(labels: impl Fn(u32, u32) -> u16) -> Slicer {
    const SIZE: (u32, u32) = (8, 6);
    let ball = sphere(DVec3::splat(5.0), 5.0, 48);
    // Resins by index: 0 white, 1 support, 2 black.
    let stackings = align(&[
        Stacking::from_layers([(0, 0.4), (1, 1.2), (0, 0.6)]),
        Stacking::from_layers([(0, 0.8), (2, 0.7)]),
        Stacking::from_layers([(2, 0.5), (1, 0.5)]),
    ]);
    let ids: Vec<_> = stackings.sequence.iter().map(|&resin| MaterialId::from_resin(resin)).collect();
    let slots = SlotTable::new(&ids, &stackings, &[], CYAN).unwrap();
    let atlas = Atlas::new(&ball, &[SIZE], &[]);
    let map = LabelMap((0..SIZE.0 * SIZE.1).map(|n| labels(n % SIZE.0, n / SIZE.0)).collect());
    let layers = LayerField::Textured(Box::new(TexturedLayers::new(&ball, &atlas, &[map], slots)));
    slicer(vec![(ball, layers)], DVec3::splat(10.0), 0.08)
}

#[test]
fn textured_layers_are_closed_and_keep_their_volumes() {
    let slicer = patched_sphere(|x, y| ((x * 5 + y * 7) % 3) as u16);
    // Between patches layers taper to nothing, thinner than any pitch: at 0.16 mm that costs white 1.07%.
    let meshes = mesh(&slicer, 0.12, &[WHITE, SUPPORT, BLACK, CYAN]);
    assert_sound(&meshes);
    assert_closed(outer_triangles(&meshes), "the outer surface");
    assert_volumes(&meshes, &slicer, 0.01);
}

#[test]
fn a_texture_of_one_stacking_is_a_uniform_stack() {
    let patched = patched_sphere(|_, _| 0);
    let layers = stack(&[(WHITE, 0.4), (SUPPORT, 1.2), (WHITE, 0.6)], CYAN);
    let uniform = slicer(vec![(sphere(DVec3::splat(5.0), 5.0, 48), layers)], DVec3::splat(10.0), 0.08);
    let ids = [WHITE, SUPPORT, BLACK, CYAN];
    let [patched, uniform] = [patched, uniform].map(|slicer| mesh(&slicer, 0.25, &ids));
    for (a, b) in patched.parts.iter().zip(&uniform.parts) {
        assert_eq!(a.triangles.len(), b.triangles.len());
        assert!((a.volume_mm3 - b.volume_mm3).abs() <= 1e-4 * b.volume_mm3, "{} {}", a.volume_mm3, b.volume_mm3);
    }
}
