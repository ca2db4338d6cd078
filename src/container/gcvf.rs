//! GrabCAD Print's voxel container: a zip of the slices and of what is needed to show them.
//!
//! Its parts are publicly known from files that others wrote and read: `ConfigFile.xml` (version 2) and slices of one
//! prefix, numbered from `StartIndex`. Of `Mesh.stl`, `MeshBbx.ktn` and `Zbuffer.png` only their kinds are known: they
//! are a surface, six little-endian numbers of its box and 16-bit heights, for the tray's picture and for placing. Ours
//! are the coarse surface of the voxels, the box of the voxels in mm (least x, y, z, greatest x, y, z), and the number
//! of slices up to the highest printed voxel of each column.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
};

use quick_xml::escape::escape;
use zip::{CompressionMethod, DateTime, ZipWriter, write::SimpleFileOptions};

use super::{Container, ContainerError, Content, Counts, SliceImage, Voxels, relief::Relief};
use crate::{
    voxel::{Lattice, MM_PER_INCH},
    watch::Watch,
};

/// How names of slices begin.
pub const PREFIX: &str = "slice_";
/// The description.
pub const CONFIG: &str = "ConfigFile.xml";
/// The surface.
pub const MESH: &str = "Mesh.stl";
/// Its box.
pub const BOX: &str = "MeshBbx.ktn";
/// The heights.
pub const HEIGHTS: &str = "Zbuffer.png";
/// Colours that the voxel utility takes besides the background.
pub const MAX_COLORS: usize = 6;
/// Fewest slices that it takes.
pub const MIN_SLICES: u32 = 30;

/// Dots per inch along x and y, and nanometres of a slice, as the description has them: whole numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resolution {
    /// Dots per inch along x and y.
    pub dpi: [u32; 2],
    /// Thickness of a slice, nm.
    pub slice_nm: u32,
}

impl Resolution {
    /// The resolution of a lattice; `None` if it is not one of whole numbers, to a millionth.
    pub fn of(lattice: &Lattice) -> Option<Self> {
        let whole = |number: f64| {
            let near = number.round();
            ((number / near - 1.0).abs() < 1e-6 && near >= 1.0 && near < f64::from(u32::MAX)).then_some(near as u32)
        };
        Some(Self {
            dpi: [whole(MM_PER_INCH / lattice.pitch.x)?, whole(MM_PER_INCH / lattice.pitch.y)?],
            slice_nm: whole(lattice.pitch.z * 1e6)?,
        })
    }

    /// What to say where it is none that the machines have which GrabCAD Voxel Print is for: 600 × 300 dpi, and slices
    /// of 14 or 27 µm.
    pub fn warning(self) -> Option<String> {
        let Self { dpi: [x, y], slice_nm } = self;
        let is_known = [x, y] == [600, 300] && matches!(slice_nm, 14_000 | 27_000);
        (!is_known).then(|| {
            format!(
                "gcvf: {x} × {y} dpi and slices of {} µm, where GrabCAD Voxel Print is known to take 600 × 300 dpi and \
                 14 or 27 µm",
                f64::from(slice_nm) / 1e3
            )
        })
    }
}

/// What the format cannot hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unfit {
    /// Fewer slices than [`MIN_SLICES`]: so many.
    FewSlices(u32),
    /// A pitch that is not one of whole numbers, see [`Resolution::of`].
    Pitch,
}

/// The resolution of a lattice that the format holds.
///
/// # Errors
/// [`Unfit`].
pub fn fit(lattice: &Lattice) -> Result<Resolution, Unfit> {
    let slices = lattice.dims[2];
    if slices < MIN_SLICES {
        return Err(Unfit::FewSlices(slices));
    }
    Resolution::of(lattice).ok_or(Unfit::Pitch)
}

/// Name of a slice.
pub fn slice_name(k: u32) -> String {
    format!("{PREFIX}{k}.png")
}

/// The description of a job of whole numbers.
pub fn config(content: &Content, resolution: Resolution, counts: &Counts) -> String {
    let Resolution { dpi: [x, y], slice_nm } = resolution;
    let [width, height, slices] = content.lattice.dims;
    let colors = content.max_colors.unwrap_or(MAX_COLORS);
    let mut text = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<GCVF>
    <Version>2</Version>
    <Resolution>
        <XDpi>{x}</XDpi>
        <YDpi>{y}</YDpi>
        <SliceThicknessNanoMeter>{slice_nm}</SliceThicknessNanoMeter>
    </Resolution>
    <SliceDimensions>
        <SliceWidth>{width}</SliceWidth>
        <SliceHeight>{height}</SliceHeight>
    </SliceDimensions>
    <SliceRange>
        <StartIndex>0</StartIndex>
        <NumberOfSlices>{slices}</NumberOfSlices>
    </SliceRange>
    <BitDepth>4</BitDepth>
    <MaxNumberOfColors>{colors}</MaxNumberOfColors>
    <DataSemantics>Materials</DataSemantics>
    <CreationMode>MODEL_ONLY</CreationMode>
    <ImageFilePrefix>{PREFIX}</ImageFilePrefix>
    <MaterialList>
        <BackGroundMaterialRGBA>0 0 0 0</BackGroundMaterialRGBA>
"#
    );
    for (resin, voxels) in content.occurring(counts) {
        let ([r, g, b, a], name) = (resin.rgba, escape(&resin.name));
        text += &format!(
            "        <Material>\n            <Name>{name}</Name>\n            <RGBA>{r} {g} {b} {a}</RGBA>\n\
             \x20           <VoxelCount>{voxels}</VoxelCount>\n        </Material>\n"
        );
    }
    text + "    </MaterialList>\n</GCVF>\n"
}

/// A container being written.
pub struct Gcvf {
    zip: ZipWriter<BufWriter<File>>,
    content: Content,
    resolution: Resolution,
    relief: Relief,
}

impl Gcvf {
    /// Begins one in `file`.
    pub fn new(file: File, content: Content, resolution: Resolution) -> Self {
        let relief = Relief::new(&content);
        Self { zip: ZipWriter::new(BufWriter::with_capacity(1 << 20, file)), content, resolution, relief }
    }

    fn entry(&mut self, name: &str, bytes: &[u8], method: CompressionMethod) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(method)
            .last_modified_time(DateTime::default())
            .unix_permissions(0o644);
        self.zip.start_file(name, options)?;
        self.zip.write_all(bytes)
    }
}

impl Container for Gcvf {
    fn wants_images(&self) -> bool {
        true
    }

    fn take(&mut self, voxels: &dyn Voxels, images: &[SliceImage], watch: &dyn Watch) -> Result<(), ContainerError> {
        self.relief.take(voxels);
        for image in images {
            watch.go_on()?;
            // Images are compressed as they are.
            self.entry(&slice_name(image.slice), &image.png, CompressionMethod::Stored)?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>, counts: &Counts, watch: &dyn Watch) -> Result<(), ContainerError> {
        watch.go_on()?;
        let text = config(&self.content, self.resolution, counts);
        self.entry(CONFIG, text.as_bytes(), CompressionMethod::Deflated)?;
        let mesh = self.relief.surface_stl();
        self.entry(MESH, &mesh, CompressionMethod::Deflated)?;
        let corners = self.relief.bounds_mm().map(|corner| corner.map(|value| (value as f32).to_le_bytes()));
        self.entry(BOX, corners.as_flattened().as_flattened(), CompressionMethod::Stored)?;
        let heights = self.relief.heights_png()?;
        self.entry(HEIGHTS, &heights, CompressionMethod::Stored)?;
        self.zip.finish().map_err(io::Error::from)?.flush()?;
        Ok(())
    }
}
