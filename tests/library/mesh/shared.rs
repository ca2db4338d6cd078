//! The meshes that lie beside the project, if they do.

use std::path::{Path, PathBuf};
use std::time::Instant;

use lumislice::mesh::{LoadOptions, Loaded, Placement, Size, close, load, place};

fn shared(name: &str) -> Option<PathBuf> {
    crate::common::shared(&format!("meshes/{name}"))
}

fn timed<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    println!("{what}: {:.3} s", start.elapsed().as_secs_f64());
    result
}

fn loaded(path: &Path) -> Loaded {
    timed("load", || load(path, &LoadOptions::default())).unwrap()
}

#[test]
fn spot_is_sound_and_textured() {
    let Some(path) = shared("spot/spot_triangulated.obj") else { return };
    let loaded = loaded(&path);
    assert_eq!(loaded.mesh.triangles.len(), 5856);
    assert_eq!(loaded.mesh.uvs.len(), 5856);
    let solid = close(loaded.mesh).unwrap();
    assert_eq!(solid.caps.len(), 0);
    assert_eq!(solid.health.warnings(), Vec::<String>::new());
    assert_eq!(solid.health.shells, 1);
}

#[test]
fn the_bunny_as_scanned_has_five_holes() {
    let Some(path) = shared("stanford-bunny.obj") else { return };
    let loaded = loaded(&path);
    assert_eq!(loaded.mesh.triangles.len(), 69_451);
    let placement = Placement { size: Size::HeightMm(60.0), ..Placement::default() };
    let (mesh, _) = timed("place", || place(loaded.mesh, &placement)).unwrap();
    let solid = timed("close", || close(mesh)).unwrap();
    println!("{:#?}\n{:?}", solid.health, solid.health.warnings());
    assert_eq!(solid.health.holes, 5);
    assert_eq!(solid.health.open_edges, 223);
    assert_eq!(solid.health.flipped_triangles, 0);
    assert!(solid.health.cap_area_mm2 < 0.05 * solid.health.area_mm2);
}

#[test]
fn the_repaired_bunny_is_closed() {
    let Some(path) = shared("bunny_60mm_watertight.ply") else { return };
    let loaded = loaded(&path);
    assert_eq!(loaded.mesh.triangles.len(), 69_674);
    let solid = timed("close", || close(loaded.mesh)).unwrap();
    println!("{:#?}", solid.health);
    assert_eq!(solid.health.open_edges, 0);
    assert_eq!(solid.health.holes, 0);
    assert_eq!(solid.caps.len(), 0);
    // Three pairs of its triangles cross: the pocket behind them is cut from the surface, not from what tells inside.
    assert_eq!(solid.outline().count(), 69_674);
    assert!((solid.health.buried_area_mm2 - 1.17).abs() < 0.01);
    assert!((solid.mesh.triangles.len() as i64 - 69_674).abs() < 20);
}
