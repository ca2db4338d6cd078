//! Ids of voxels, or fractions of resins, for napari, 3D Slicer and NumPy: a `.nrrd`, a text header and one gzip
//! stream.
//!
//! The format's definition (teem, "Definition of NRRD File Format", version 5). Slices are compressed side by side,
//! each ended on a whole byte, and joined to one stream as `pigz` does: readers that stop after the first of several
//! gzip members read all of it. Samples lie at the centres of voxels. Fractions have the resins as a first axis, so
//! that a voxel's lie side by side: what can be written slice by slice, and what 3D Slicer and ITK take for a volume of
//! several components. They are compressed row by row, for a slice of all resins may be hundreds of megabytes.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
};

use super::{
    Container, ContainerError, Content, Counts, SliceImage, Voxels,
    deflate::{END_OF_STREAM, GZIP_HEADER, Part},
    for_rows_of_fractions, slice_ids,
};
use crate::parallel;
use crate::voxel::MaterialId;
use crate::watch::Watch;

/// What a file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Values {
    /// Of every voxel its id.
    Ids,
    /// Of every voxel the fraction of every resin, 0 to 1.
    Fractions,
}

/// The header, with the empty line that ends it.
pub fn header(content: &Content, values: Values) -> String {
    let lattice = &content.lattice;
    let [nx, ny, nz] = lattice.dims;
    let [px, py, pz] = lattice.pitch.to_array();
    let [ox, oy, oz] = (lattice.origin + 0.5 * lattice.pitch).to_array();
    let count = content.resins.len();
    let (kind, sizes, directions, kinds) = match values {
        Values::Ids => ("# ids of resins, by lumislice\ntype: uint8\ndimension: 3", String::new(), "", ""),
        Values::Fractions => (
            "# volume fractions of resins, by lumislice\ntype: float\nendian: little\ndimension: 4",
            format!("{count} "),
            "none ",
            "list ",
        ),
    };
    let mut text = format!(
        "NRRD0005\n{kind}\nspace dimension: 3\n\
         sizes: {sizes}{nx} {ny} {nz}\nspace directions: {directions}({px},0,0) (0,{py},0) (0,0,{pz})\n\
         kinds: {kinds}domain domain domain\nencoding: gzip\n\
         space units: \"mm\" \"mm\" \"mm\"\nspace origin: ({ox},{oy},{oz})\n"
    );
    for (place, resin) in content.resins.iter().enumerate() {
        let name: String = resin.name.chars().map(|c| if c.is_control() || c == '\\' { '?' } else { c }).collect();
        text += &match values {
            Values::Ids => format!("material {}:={name}\n", resin.id.0),
            Values::Fractions => format!("resin {place}:={name}\n"),
        };
    }
    text + "\n"
}

/// A file being written.
pub struct Nrrd {
    out: BufWriter<File>,
    checksum: crc32fast::Hasher,
    length: u64,
    /// Whose fractions it holds; none where it holds ids.
    resins: Vec<MaterialId>,
}

impl Nrrd {
    /// Begins one in `file`.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn new(file: File, content: &Content, values: Values) -> io::Result<Self> {
        let mut out = BufWriter::with_capacity(1 << 20, file);
        out.write_all(header(content, values).as_bytes())?;
        out.write_all(&GZIP_HEADER)?;
        let resins = match values {
            Values::Ids => Vec::new(),
            Values::Fractions => content.resins.iter().map(|resin| resin.id).collect(),
        };
        Ok(Self { out, checksum: crc32fast::Hasher::new(), length: 0, resins })
    }
}

impl Container for Nrrd {
    fn take(&mut self, voxels: &dyn Voxels, _: &[SliceImage], watch: &dyn Watch) -> Result<(), ContainerError> {
        let slices = voxels.slices();
        let resins = &self.resins;
        let encode = |buffer: &mut Vec<u8>, n: usize| {
            let k = slices.start + n as u32;
            let mut part = Part::new();
            let mut checksum = crc32fast::Hasher::new();
            let mut length = 0;
            let mut take = |plain: &[u8]| {
                length += plain.len() as u64;
                checksum.update(plain);
                part.push(plain)
            };
            match resins.is_empty() {
                true => take(slice_ids(voxels, k, buffer))?,
                false => for_rows_of_fractions(voxels, resins, k, buffer, take)?,
            }
            Ok((part.finish()?, checksum, length))
        };
        let parts: Vec<io::Result<_>> = parallel::map_in(slices.len(), Vec::new, encode);
        for part in parts {
            let (bytes, checksum, length) = part?;
            self.out.write_all(&bytes)?;
            self.checksum.combine(&checksum);
            self.length += length;
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
