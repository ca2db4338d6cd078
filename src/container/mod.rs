//! Files that hold a whole job: what printers' software takes in one piece, and volumes for other programs.
//!
//! **In:** ids of materials, bottom up ([`Voxels`]), from slabs as the slicer makes them or from the slices of a
//! finished folder, and what to say of them ([`Content`]). **Out:** one file. Memory is a few slices, whatever the
//! height; a `.vdb` holds what is not of one material, and distances around the boundary, until it is written.
//!
//! | file | what it does |
//! | --- | --- |
//! | `voxels`  | the two sources of voxels, by rows and by bricks |
//! | `bmp`     | one slice of one resin for Objet printers, and their text |
//! | `gcvf`    | GrabCAD's container: slices, `ConfigFile.xml`, and `relief`'s outline and heights |
//! | `relief`  | heights and a coarse surface of what is printed |
//! | `mapping` | which colour is which resin, for people |
//! | `vti`     | volumes of ids and of fractions for ParaView |
//! | `nrrd`    | the same for napari and 3D Slicer |
//! | `vdb`     | the same for Blender and Houdini, with distances |
//! | `deflate` | compression |

pub mod bmp;
mod deflate;
pub mod gcvf;
mod mapping;
pub mod nrrd;
mod relief;
pub mod vdb;
mod voxels;
pub mod vti;

use std::io;

pub use mapping::mapping_text;
pub use voxels::{Drawn, SliceBatch, VolumeLayer, Voxels};

use crate::{
    voxel::{Lattice, MaterialId, WHOLE},
    watch::{Stopped, Watch},
};

/// Voxels by material id.
pub type Counts = [u64; 256];

/// What a container says of the job it holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    /// The job's name.
    pub name: String,
    /// Its voxels.
    pub lattice: Lattice,
    /// Its resins, in the order of their ids, from 1.
    pub resins: Vec<ContentResin>,
    /// Resins the printer takes besides the background, where that is known.
    pub max_colors: Option<usize>,
    /// Whether volumes hold the fractions of resins too.
    pub fractions: bool,
}

/// A resin of a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ContentResin {
    /// Its id in voxels.
    pub id: MaterialId,
    /// Its name.
    pub name: String,
    /// Its colour in slices; all 0 for what prints as background.
    pub rgba: [u8; 4],
}

impl Content {
    /// Resins that are printed, which the background is not.
    pub fn printed(&self) -> impl Iterator<Item = &ContentResin> {
        self.resins.iter().filter(|resin| resin.rgba[3] != 0)
    }

    /// Printed resins that occur, with their voxels.
    pub fn occurring<'a>(&'a self, counts: &'a Counts) -> impl Iterator<Item = (&'a ContentResin, u64)> {
        self.printed().map(|resin| (resin, counts[usize::from(resin.id.0)])).filter(|(_, voxels)| *voxels > 0)
    }

    /// A name for what is no resin's, unlike those of all resins.
    fn free_name(&self, name: &str) -> String {
        let mut name = name.to_owned();
        while self.resins.iter().any(|resin| resin.name == name) {
            name.push('_');
        }
        name
    }

    /// Whether voxels of an id are printed, by id.
    fn printed_ids(&self) -> [bool; 256] {
        let mut printed = [false; 256];
        self.printed().for_each(|resin| printed[usize::from(resin.id.0)] = true);
        printed
    }
}

/// The ids of slice `k`, x fastest, then y from the lowest on.
fn slice_ids<'a>(voxels: &dyn Voxels, k: u32, ids: &'a mut Vec<u8>) -> &'a [u8] {
    let [width, height, _] = voxels.lattice().dims.map(|dim| dim as usize);
    ids.resize(width * height, 0);
    for (j, row) in (0..).zip(ids.chunks_mut(width)) {
        voxels.read_row(j, k, row);
    }
    ids
}

/// A fraction in units of 1 / [`WHOLE`] as a number from 0 to 1.
fn unit(fraction: u16) -> f32 {
    f32::from(fraction) / f32::from(WHOLE)
}

/// Hands on the fractions of `resins` in slice `k`, row by row, as little-endian single-precision numbers from 0 to 1:
/// those of a voxel side by side, voxels as in [`slice_ids`].
fn for_rows_of_fractions(
    voxels: &dyn Voxels,
    resins: &[MaterialId],
    k: u32,
    bytes: &mut Vec<u8>,
    mut take: impl FnMut(&[u8]) -> io::Result<()>,
) -> io::Result<()> {
    let [width, height, _] = voxels.lattice().dims;
    let mut row = vec![0; width as usize];
    bytes.resize(4 * resins.len() * row.len(), 0);
    for j in 0..height {
        let numbers = bytes.as_chunks_mut::<4>().0;
        for (n, resin) in resins.iter().enumerate() {
            voxels.read_fractions(*resin, j, k, &mut row);
            for (number, fraction) in numbers[n..].iter_mut().step_by(resins.len()).zip(&row) {
                *number = unit(*fraction).to_le_bytes();
            }
        }
        take(bytes)?;
    }
    Ok(())
}

/// The image of a slice, as `slices/` has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SliceImage {
    /// The slice.
    pub slice: u32,
    /// A PNG.
    pub png: Vec<u8>,
}

/// Why a container was not written.
#[derive(Debug, thiserror::Error)]
pub enum ContainerError {
    /// The disk.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The watch asked to stop.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl crate::blame::Blamed for ContainerError {
    fn blame(&self) -> crate::blame::Blame {
        match self {
            Self::Io(_) => crate::blame::Blame::Disk,
            Self::Stopped(stopped) => stopped.blame(),
        }
    }
}

/// A file of a whole job being written.
pub trait Container: Send {
    /// Takes in the next voxels, bottom up, with the images of their slices where the container wants them.
    ///
    /// # Errors
    /// [`ContainerError`].
    fn take(&mut self, voxels: &dyn Voxels, images: &[SliceImage], watch: &dyn Watch) -> Result<(), ContainerError>;

    /// Whether [`Self::take`] needs images.
    fn wants_images(&self) -> bool {
        false
    }

    /// Ends the file; `counts` are the voxels of all ids.
    ///
    /// # Errors
    /// [`ContainerError`].
    fn finish(self: Box<Self>, counts: &Counts, watch: &dyn Watch) -> Result<(), ContainerError>;
}
