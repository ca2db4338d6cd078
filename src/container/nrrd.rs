//! Ids of voxels for napari, 3D Slicer and NumPy: a `.nrrd`, a text header and one gzip stream.
//!
//! The format's definition (teem, "Definition of NRRD File Format", version 5). Slices are compressed side by side,
//! each ended on a whole byte, and joined to one stream as `pigz` does: readers that stop after the first of several
//! gzip members read all of it. Samples lie at the centres of voxels.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
};

use super::{
    Container, ContainerError, Content, Counts, SliceImage, Voxels,
    deflate::{END_OF_STREAM, GZIP_HEADER, part},
    slice_ids,
};
use crate::parallel;
use crate::watch::Watch;

/// The header, with the empty line that ends it.
pub fn header(content: &Content) -> String {
    let lattice = &content.lattice;
    let [nx, ny, nz] = lattice.dims;
    let [px, py, pz] = lattice.pitch.to_array();
    let [ox, oy, oz] = (lattice.origin + 0.5 * lattice.pitch).to_array();
    let mut text = format!(
        "NRRD0005\n# ids of resins, by lumislice\ntype: uint8\ndimension: 3\nspace dimension: 3\n\
         sizes: {nx} {ny} {nz}\nspace directions: ({px},0,0) (0,{py},0) (0,0,{pz})\nkinds: domain domain \
         domain\nencoding: gzip\n\
         space units: \"mm\" \"mm\" \"mm\"\nspace origin: ({ox},{oy},{oz})\n"
    );
    for resin in &content.resins {
        let name: String = resin.name.chars().map(|c| if c.is_control() || c == '\\' { '?' } else { c }).collect();
        text += &format!("material {}:={name}\n", resin.id.0);
    }
    text + "\n"
}

/// A file being written.
pub struct Nrrd {
    out: BufWriter<File>,
    checksum: crc32fast::Hasher,
    length: u64,
}

impl Nrrd {
    /// Begins one in `file`.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn new(file: File, content: &Content) -> io::Result<Self> {
        let mut out = BufWriter::with_capacity(1 << 20, file);
        out.write_all(header(content).as_bytes())?;
        out.write_all(&GZIP_HEADER)?;
        Ok(Self { out, checksum: crc32fast::Hasher::new(), length: 0 })
    }
}

impl Container for Nrrd {
    fn take(&mut self, voxels: &dyn Voxels, _: &[SliceImage], watch: &dyn Watch) -> Result<(), ContainerError> {
        let slices = voxels.slices();
        let encode = |ids: &mut Vec<u8>, n: usize| {
            let ids = slice_ids(voxels, slices.start + n as u32, ids);
            let mut checksum = crc32fast::Hasher::new();
            checksum.update(ids);
            Ok((part(ids)?, checksum))
        };
        let parts: Vec<io::Result<_>> = parallel::map_in(slices.len(), Vec::new, encode);
        for part in parts {
            let (bytes, checksum) = part?;
            self.out.write_all(&bytes)?;
            self.checksum.combine(&checksum);
            let [nx, ny, _] = voxels.lattice().dims.map(u64::from);
            self.length += nx * ny;
        }
        Ok(watch.go_on()?)
    }

    fn finish(mut self: Box<Self>, _: &Counts, _: &dyn Watch) -> Result<(), ContainerError> {
        self.out.write_all(&END_OF_STREAM)?;
        self.out.write_all(&self.checksum.finalize().to_le_bytes())?;
        // The length modulo 2³², as gzip has it.
        self.out.write_all(&(self.length as u32).to_le_bytes())?;
        Ok(self.out.flush()?)
    }
}
