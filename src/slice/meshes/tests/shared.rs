//! Real meshes, where they are at hand.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use super::*;
use crate::{
    mesh::{LoadOptions, close, load},
    slice::meshes::write_stl,
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
