//! Real meshes, where they are at hand.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use super::*;
use crate::{
    appearance::{Atlas, ClusterId, LabelMap, TexturedLayers},
    mesh::{LoadOptions, Placement, Size, close, load, place},
    slice::meshes::{write_3mf, write_stl},
};

/// A file of the shared folder, or `None` with a message.
fn shared(relative: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let path = std::env::var_os("LUMISLICE_SHARED").map_or_else(beside, PathBuf::from).join(relative);
    if !path.exists() {
        println!("skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}

/// Writes the STL files of a test below the folder that `LUMISLICE_MESHES_OUT` names, for `scripts/check-meshes`.
fn keep(meshes: &MaterialMeshes, name: &str) {
    let Some(folder) = std::env::var_os("LUMISLICE_MESHES_OUT") else { return };
    let folder = PathBuf::from(folder).join(name).join("meshes");
    std::fs::create_dir_all(&folder).unwrap();
    for part in &meshes.parts {
        let file = std::fs::File::create(folder.join(format!("{}.stl", part.name))).unwrap();
        write_stl(meshes, part, file).unwrap();
    }
    let file = std::fs::File::create(folder.join("assembly.3mf")).unwrap();
    write_3mf(meshes, &[[200, 100, 50, 255]; 256], file).unwrap();
}

fn bunny(pitch_mm: f64) {
    let Some(path) = shared("meshes/bunny_60mm_watertight.ply") else { return };
    let mut solid = close(load(&path, &LoadOptions::default()).unwrap().mesh).unwrap();
    let positions = &mut solid.mesh.positions;
    let low = positions.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
    positions.iter_mut().for_each(|p| *p -= low);
    let high = positions.iter().fold(DVec3::ZERO, |high, p| high.max(*p));
    let lattice = Lattice::covering(high, DVec3::splat(pitch_mm)).unwrap();
    let layers = stack(&[(WHITE, 2.0 * pitch_mm), (SUPPORT, 1.0), (WHITE, 0.5)], BLACK);
    let slicer = Slicer::new(lattice, vec![ObjectField::new(&solid, lattice, layers).unwrap()]);
    let start = Instant::now();
    let meshes = mesh(&slicer, pitch_mm, &[WHITE, SUPPORT, BLACK]);
    println!(
        "{pitch_mm} mm: {:.2} s, {} vertices, {} nodes",
        start.elapsed().as_secs_f64(),
        meshes.positions.len(),
        lattice.voxels()
    );
    let start = Instant::now();
    assert_volumes(&meshes, &slicer, 0.01);
    println!("voxels: {:.2} s", start.elapsed().as_secs_f64());
    keep(&meshes, "bunny");
    assert_sound(&meshes);
}

/// A mesh with charts, in patches of stackings that share no layer.
#[test]
#[ignore = "some 10 s, most for the checks"]
fn the_cow_in_patches() {
    let Some(path) = shared("meshes/spot/spot_triangulated.obj") else { return };
    let placement = Placement { size: Size::HeightMm(40.0), rotate_deg: DVec3::X * 90.0, ..Default::default() };
    let (cow, _) = place(load(&path, &LoadOptions::default()).unwrap().mesh, &placement).unwrap();
    let solid = close(cow).unwrap();
    let high = solid.mesh.positions.iter().fold(DVec3::ZERO, |high, p| high.max(*p));
    let lattice = Lattice::covering(high, DVec3::splat(0.1)).unwrap();
    let atlas = Atlas::new(&solid.mesh, &[(64, 64)], &[]);
    let labels = LabelMap((0..64 * 64).map(|n: u32| ClusterId(((n % 64 / 8 * 5 + n / 512 * 7) % 3) as u16)).collect());
    let layers = TexturedLayers::new(&solid.mesh, &atlas, &[labels], three_stackings());
    let layers = LayerField::Textured(Box::new(layers));
    let slicer = Slicer::new(lattice, vec![ObjectField::new(&solid, lattice, layers).unwrap()]);
    let start = Instant::now();
    let meshes = mesh(&slicer, 0.2, &[WHITE, SUPPORT, BLACK, CYAN]);
    println!("{:.2} s", start.elapsed().as_secs_f64());
    assert_volumes(&meshes, &slicer, 0.01);
    keep(&meshes, "cow");
    assert_sound(&meshes);
    assert_closed(outer_triangles(&meshes), "the outer surface");
}

#[test]
#[ignore = "some 10 s, half of them for the checks"]
fn the_bunny_at_a_fifth_of_a_millimetre() {
    bunny(0.2);
}

#[test]
#[ignore = "about a minute and 3 GB, most for the checks"]
fn the_bunny_at_a_tenth_of_a_millimetre() {
    bunny(0.1);
}
