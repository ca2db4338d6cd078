//! A mesh in layers of resin, voxel by voxel in memory: `cargo run --release --example slice_mesh -- samples/slab.stl`

use std::path::PathBuf;

use lumislice::{
    appearance::{LayerField, LayerStack},
    glam::DVec3,
    mesh::{LoadOptions, close, load},
    slice::{ObjectField, Slicer},
    voxel::{Lattice, MaterialId},
};

#[allow(clippy::print_stdout)] // a program answers on stdout
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).map_or(PathBuf::from("samples/slab.stl"), PathBuf::from);
    let solid = close(load(&path, &LoadOptions::default())?.mesh)?;
    let far = solid.mesh.positions.iter().fold(DVec3::ZERO, |far, p| far.max(*p));
    let lattice = Lattice::covering(far, DVec3::splat(0.1))?;
    // Half a millimetre of the first resin over a core of the second.
    let [shell, core] = [0, 1].map(MaterialId::from_resin);
    let layers = LayerField::Uniform(LayerStack::new([(shell, 0.5)], core));
    let object = ObjectField::new(&solid, lattice, layers).ok_or("a mesh without triangles")?;
    let mut voxels = [0_u64; 3];
    let mut row = vec![0; lattice.dims[0] as usize];
    Slicer::new(lattice, vec![object]).for_each_slab(0..lattice.dims[2], |slab| {
        for k in slab.slices() {
            for j in 0..lattice.dims[1] {
                slab.read_row(j, k, &mut row);
                row.iter().for_each(|&id| voxels[usize::from(id)] += 1);
            }
        }
        Ok::<(), std::convert::Infallible>(())
    })?;
    println!("{} voxels of shell, {} of core", voxels[1], voxels[2]);
    Ok(())
}
