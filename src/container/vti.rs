//! Ids of voxels for ParaView and VTK, and the fractions of resins: a `.vti`, XML with its data appended, compressed
//! slice by slice.
//!
//! VTK's XML format as its documentation has it ("XML File Formats", image data): cell data, so that a voxel is a cell
//! and lies where it is printed; `vtkZLibDataCompressor` blocks of a slice each, so that slices are compressed side by
//! side and memory is theirs; the blocks' sizes stand before them and are filled in at the end. Arrays stand one after
//! the other, so all but the first grow in files of their own until then. Lengths are mm.

use std::{
    fs::File,
    io::{self, BufWriter, Seek, SeekFrom, Write},
};

use quick_xml::escape::escape;

use super::{
    Container, ContainerError, Content, Counts, SliceImage, Voxels,
    deflate::{zlib, zlib_of_rows},
    for_rows_of_fractions, slice_ids,
};
use crate::parallel;
use crate::voxel::MaterialId;
use crate::watch::Watch;

/// The name of the ids, where no resin has it.
pub const ARRAY: &str = "material";

/// What an array holds of every voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Values {
    /// Its id, a byte.
    Ids,
    /// A resin's fraction, 0 to 1, in single precision.
    Fraction(MaterialId),
}

impl Values {
    /// Bytes of a voxel.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Ids => 1,
            Self::Fraction(_) => 4,
        }
    }
}

/// The arrays of a file, in their order.
pub fn arrays(content: &Content) -> Vec<Values> {
    let fractions = content.resins.iter().filter(|_| content.fractions).map(|resin| Values::Fraction(resin.id));
    std::iter::once(Values::Ids).chain(fractions).collect()
}

/// What stands before the data; `offsets` are those of the arrays after the first, from its beginning.
pub fn preamble(content: &Content, offsets: &[u64]) -> String {
    let lattice = &content.lattice;
    let [nx, ny, nz] = lattice.dims;
    let [ox, oy, oz] = lattice.origin.to_array();
    let [px, py, pz] = lattice.pitch.to_array();
    // A text for every id, the background's first: character codes, each text ended by 0.
    let names = std::iter::once("background").chain(content.resins.iter().map(|resin| resin.name.as_str()));
    let codes: String =
        names.map(|name| name.bytes().map(|byte| format!("{byte} ")).collect::<String>() + "0 ").collect();
    let extent = format!("0 {nx} 0 {ny} 0 {nz}");
    let ids = content.free_name(ARRAY);
    let ids = escape(&ids);
    // As long before offsets are known as after.
    let fraction = |(resin, offset): (&super::ContentResin, &u64)| {
        let name = escape(&resin.name);
        format!("\n<DataArray type=\"Float32\" Name=\"{name}\" format=\"appended\" offset=\"{offset:020}\"/>")
    };
    let fractions: String = content.resins.iter().zip(offsets).map(fraction).collect();
    format!(
        r#"<?xml version="1.0"?>
<!-- {} by lumislice: ids of resins, lengths in mm -->
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64"
compressor="vtkZLibDataCompressor">
<ImageData WholeExtent="{extent}" Origin="{ox} {oy} {oz}" Spacing="{px} {py} {pz}">
<FieldData><Array type="String" Name="resins" NumberOfTuples="{}" format="ascii">{codes}</Array></FieldData>
<Piece Extent="{extent}"><PointData></PointData>
<CellData Scalars="{ids}"><DataArray type="UInt8" Name="{ids}" format="appended" offset="0"/>{fractions}</CellData>
</Piece></ImageData>
<AppendedData encoding="raw">
_"#,
        escape(content.name.replace("--", "-")),
        content.resins.len() + 1,
    )
}

/// What stands after them.
pub const END: &str = "\n</AppendedData>\n</VTKFile>\n";

/// What stands before an array's blocks and their sizes: how many there are, bytes of each before compression, bytes of
/// a shorter last one, of which there is none.
pub fn block_header(content: &Content, values: Values) -> [u64; 3] {
    let [nx, ny, nz] = content.lattice.dims.map(u64::from);
    [nz, nx * ny * values.bytes(), 0]
}

/// An array being written.
struct Array {
    values: Values,
    sizes: Vec<u64>,
    /// Its blocks, but for the first array's, which go where they belong.
    blocks: Option<BufWriter<File>>,
}

impl Array {
    /// Bytes before its blocks.
    fn header_bytes(content: &Content) -> u64 {
        24 + 8 * u64::from(content.lattice.dims[2])
    }

    fn write_header(&self, content: &Content, out: &mut impl Write) -> io::Result<()> {
        let numbers = block_header(content, self.values);
        numbers.iter().chain(&self.sizes).try_for_each(|number| out.write_all(&number.to_le_bytes()))
    }
}

/// A file being written.
pub struct Vti {
    out: BufWriter<File>,
    content: Content,
    arrays: Vec<Array>,
}

impl Vti {
    /// Begins one in `file`; `aside` makes a file for blocks that wait for those before them.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn new(file: File, content: &Content, mut aside: impl FnMut() -> io::Result<File>) -> io::Result<Self> {
        let mut out = BufWriter::with_capacity(1 << 20, file);
        let mut arrays = Vec::new();
        for values in self::arrays(content) {
            let blocks = (values != Values::Ids).then(&mut aside).transpose()?.map(BufWriter::new);
            arrays.push(Array { values, sizes: Vec::new(), blocks });
        }
        out.write_all(preamble(content, &vec![0; arrays.len() - 1]).as_bytes())?;
        out.write_all(&vec![0; Array::header_bytes(content) as usize])?;
        Ok(Self { out, content: content.clone(), arrays })
    }
}

impl Container for Vti {
    fn take(&mut self, voxels: &dyn Voxels, _: &[SliceImage], watch: &dyn Watch) -> Result<(), ContainerError> {
        let slices = voxels.slices();
        for Array { values, sizes, blocks } in &mut self.arrays {
            let encode = |buffer: &mut Vec<u8>, n: usize| {
                let k = slices.start + n as u32;
                match *values {
                    Values::Ids => zlib(slice_ids(voxels, k, buffer)),
                    Values::Fraction(resin) => {
                        zlib_of_rows(|take| for_rows_of_fractions(voxels, &[resin], k, buffer, take))
                    }
                }
            };
            let encoded: Vec<io::Result<Vec<u8>>> = parallel::map_in(slices.len(), Vec::new, encode);
            for block in encoded {
                let block = block?;
                sizes.push(block.len() as u64);
                blocks.as_mut().unwrap_or(&mut self.out).write_all(&block)?;
            }
            watch.go_on()?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>, _: &Counts, watch: &dyn Watch) -> Result<(), ContainerError> {
        let Self { out, content, arrays } = &mut *self;
        let (mut end, mut offsets) = (0, Vec::new());
        for array in arrays.iter_mut() {
            if let Some(blocks) = array.blocks.take() {
                watch.go_on()?;
                offsets.push(end);
                array.write_header(content, out)?;
                let mut blocks = blocks.into_inner().map_err(io::IntoInnerError::into_error)?;
                blocks.rewind()?;
                io::copy(&mut blocks, out)?;
            }
            end += Array::header_bytes(content) + array.sizes.iter().sum::<u64>();
        }
        out.write_all(END.as_bytes())?;
        out.seek(SeekFrom::Start(0))?;
        out.write_all(preamble(content, &offsets).as_bytes())?;
        if let Some(ids) = arrays.first() {
            ids.write_header(content, out)?;
        }
        Ok(out.flush()?)
    }
}
