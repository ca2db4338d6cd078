//! Ids of voxels for ParaView and VTK: a `.vti`, XML with its data appended, compressed slice by slice.
//!
//! VTK's XML format as its documentation has it ("XML File Formats", image data): cell data, so that a voxel is a cell
//! and lies where it is printed; `vtkZLibDataCompressor` blocks of a slice each, so that slices are compressed side by
//! side and memory is theirs; the blocks' sizes stand before them and are filled in at the end. Lengths are mm.

use std::{
    fs::File,
    io::{self, BufWriter, Seek, SeekFrom, Write},
};

use quick_xml::escape::escape;

use super::{Container, ContainerError, Content, Counts, SliceImage, Voxels, deflate::zlib, slice_ids};
use crate::parallel;
use crate::watch::Watch;

/// The name of the ids.
pub const ARRAY: &str = "material";

/// What stands before the data.
pub fn preamble(content: &Content) -> String {
    let lattice = &content.lattice;
    let [nx, ny, nz] = lattice.dims;
    let [ox, oy, oz] = lattice.origin.to_array();
    let [px, py, pz] = lattice.pitch.to_array();
    // A text for every id, the background's first: character codes, each text ended by 0.
    let names = std::iter::once("background").chain(content.resins.iter().map(|resin| resin.name.as_str()));
    let codes: String =
        names.map(|name| name.bytes().map(|byte| format!("{byte} ")).collect::<String>() + "0 ").collect();
    let extent = format!("0 {nx} 0 {ny} 0 {nz}");
    format!(
        r#"<?xml version="1.0"?>
<!-- {} by lumislice: ids of resins, lengths in mm -->
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64"
compressor="vtkZLibDataCompressor">
<ImageData WholeExtent="{extent}" Origin="{ox} {oy} {oz}" Spacing="{px} {py} {pz}">
<FieldData><Array type="String" Name="resins" NumberOfTuples="{}" format="ascii">{codes}</Array></FieldData>
<Piece Extent="{extent}"><PointData></PointData>
<CellData Scalars="{ARRAY}"><DataArray type="UInt8" Name="{ARRAY}" format="appended" offset="0"/></CellData>
</Piece></ImageData>
<AppendedData encoding="raw">
_"#,
        escape(content.name.replace("--", "-")),
        content.resins.len() + 1,
    )
}

/// What stands after them.
pub const END: &str = "\n</AppendedData>\n</VTKFile>\n";

/// A file being written.
pub struct Vti {
    out: BufWriter<File>,
    /// Where the sizes of the blocks stand.
    sizes_at: u64,
    sizes: Vec<u64>,
}

impl Vti {
    /// Begins one in `file`.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn new(file: File, content: &Content) -> io::Result<Self> {
        let [nx, ny, nz] = content.lattice.dims.map(u64::from);
        let mut out = BufWriter::with_capacity(1 << 20, file);
        let preamble = preamble(content);
        out.write_all(preamble.as_bytes())?;
        // Number of blocks, bytes of each before compression, bytes of a shorter last one: there is none.
        for number in [nz, nx * ny, 0] {
            out.write_all(&number.to_le_bytes())?;
        }
        out.write_all(&vec![0; 8 * nz as usize])?;
        Ok(Self { out, sizes_at: preamble.len() as u64 + 24, sizes: Vec::new() })
    }
}

impl Container for Vti {
    fn take(&mut self, voxels: &dyn Voxels, _: &[SliceImage], watch: &dyn Watch) -> Result<(), ContainerError> {
        let slices = voxels.slices();
        let blocks: Vec<io::Result<Vec<u8>>> =
            parallel::map_in(slices.len(), Vec::new, |ids, n| zlib(slice_ids(voxels, slices.start + n as u32, ids)));
        for block in blocks {
            let block = block?;
            self.sizes.push(block.len() as u64);
            self.out.write_all(&block)?;
        }
        Ok(watch.go_on()?)
    }

    fn finish(mut self: Box<Self>, _: &Counts, _: &dyn Watch) -> Result<(), ContainerError> {
        self.out.write_all(END.as_bytes())?;
        self.out.seek(SeekFrom::Start(self.sizes_at))?;
        for size in &self.sizes {
            self.out.write_all(&size.to_le_bytes())?;
        }
        Ok(self.out.flush()?)
    }
}
