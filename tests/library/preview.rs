//! Previews of a real job, to look at and to time.

use std::{fs, path::PathBuf, time::Instant};

use glam::DVec3;
use lumislice::{
    appearance::{LayerField, LayerStack},
    mesh::{LoadOptions, Placement, Solid, load, place},
    preview::{PreviewBuilder, PreviewFile, PreviewMaterial, from_folder},
    slice::{ObjectField, Slicer},
    voxel::{Lattice, MaterialId},
    watch::Unwatched,
};
use rayon::prelude::*;

fn materials() -> Vec<PreviewMaterial> {
    let material = |id, name: &str, rgba| PreviewMaterial { id: MaterialId(id), name: name.into(), rgba };
    vec![
        material(1, "white", [255, 255, 255, 255]),
        material(2, "support", [0, 0, 0, 0]),
        material(3, "black", [24, 24, 26, 255]),
    ]
}

/// `LUMISLICE_PREVIEW_OUT` names a folder for the pictures.
#[test]
#[ignore = "slices 1.8 G voxels twice; for looking at and timing"]
fn bunny() {
    let Some(file) = crate::common::shared("meshes/bunny_60mm_watertight.ply") else { return };
    let mesh = load(&file, &LoadOptions::default()).unwrap().mesh;
    let (mesh, _) = place(mesh, &Placement::default()).unwrap();
    let extent = mesh.positions.iter().fold(DVec3::ZERO, |high, &p| high.max(p));
    let lattice = Lattice::covering(extent, DVec3::new(25.4 / 600.0, 25.4 / 300.0, 0.027)).unwrap();
    let [white, support, black] = [1, 2, 3].map(MaterialId);
    let layers = [(white, 0.5), (support, 2.0), (white, 1.0), (black, 1.5)];
    let stack = LayerField::Uniform(LayerStack::new(layers, white));
    let solid = Solid { mesh, caps: Vec::new(), whole: None, health: Default::default() };
    let slicer = Slicer::new(lattice, vec![ObjectField::new(&solid, lattice, stack).unwrap()]);

    let (mut builder, mut observing) = (PreviewBuilder::new(&lattice, &materials()), 0.0);
    let start = Instant::now();
    slicer
        .for_each_slab::<()>(0..lattice.dims[2], |slab| {
            let start = Instant::now();
            builder.observe(slab);
            observing += start.elapsed().as_secs_f64();
            Ok(())
        })
        .unwrap();
    let slicing = start.elapsed().as_secs_f64() - observing;
    let start = Instant::now();
    let pictures = builder.finish(None).unwrap();
    let drawing = start.elapsed().as_secs_f64();
    println!("{:?}: slicing {slicing:.2} s, observing {observing:.2} s, drawing {drawing:.2} s", lattice.dims);

    let Some(out) = std::env::var_os("LUMISLICE_PREVIEW_OUT").map(PathBuf::from) else { return };
    write(&out.join("streamed"), &pictures);
    let folder = out.join("folder");
    fs::create_dir_all(folder.join("slices")).unwrap();
    let mut palette = [[0; 4]; 256];
    for material in materials().iter().filter(|material| material.rgba[3] > 0) {
        palette[usize::from(material.id.0)] = material.rgba;
    }
    slicer
        .for_each_slab::<()>(0..lattice.dims[2], |slab| {
            slab.slices().into_par_iter().for_each(|k| {
                let (mut counts, mut png) = ([0; 256], Vec::new());
                let buffers = &mut Default::default();
                lumislice::slice::encode_rgba(slab, k, &palette, buffers, &mut counts, &mut png).unwrap();
                fs::write(folder.join(format!("slices/slice_{k}.png")), png).unwrap();
            });
            Ok(())
        })
        .unwrap();
    let start = Instant::now();
    let pictures = from_folder(&folder, &lattice, &materials(), 0..lattice.dims[2], &Unwatched).unwrap();
    println!("from the folder {:.2} s", start.elapsed().as_secs_f64());
    write(&folder, &pictures);
}

fn write(out: &std::path::Path, pictures: &[PreviewFile]) {
    for picture in pictures {
        let path = out.join(&picture.path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, &picture.png).unwrap();
    }
}
