//! The file around trees: header, metadata, grids with their transform and where they lie.

use std::{
    fs::File,
    io::{self, BufWriter, Seek, SeekFrom, Write},
};

use sha2::{Digest, Sha256};

use super::{
    Content,
    tree::{Active, Tree},
};
use crate::{output::GENERATOR, parallel, watch::Watch, words::hex};

/// " BDV", and four bytes of 0.
const MAGIC: i64 = 0x5644_4220;
/// Version of the format: multipass input, unchanged since OpenVDB 5.
const VERSION: u32 = 224;
/// Version of the library whose sources this follows.
const LIBRARY: [u32; 2] = [10, 0];
/// Zip, and values of active voxels only.
const COMPRESSION: u32 = 1 | 2;

/// A value of metadata.
#[derive(Clone)]
pub(super) enum Value {
    Text(String),
    Long(i64),
    Float(f32),
    Index([i32; 3]),
    Truth(bool),
}

/// A grid.
pub(super) struct Grid<'a> {
    pub(super) name: String,
    /// As OpenVDB names the type of its tree.
    pub(super) kind: &'static str,
    pub(super) metadata: Vec<(String, Value)>,
    pub(super) tree: &'a Tree,
}

/// Writes a whole file.
pub(super) fn write_file(
    out: &mut BufWriter<File>,
    content: &Content,
    grids: &[Grid<'_>],
    ones: &[Vec<u8>],
    watch: &dyn Watch,
) -> io::Result<()> {
    out.write_all(&MAGIC.to_le_bytes())?;
    for number in [VERSION, LIBRARY[0], LIBRARY[1]] {
        out.write_all(&number.to_le_bytes())?;
    }
    // Grids can be found by their offsets.
    out.write_all(&[1])?;
    let active = parallel::map_all(grids, |grid| grid.tree.active());
    out.write_all(identity(content, grids, &active).as_bytes())?;
    write_metadata(out, &[("creator".to_owned(), Value::Text(GENERATOR.to_owned()))])?;
    out.write_all(&(grids.len() as u32).to_le_bytes())?;
    for (grid, active) in grids.iter().zip(active) {
        write_grid(out, content, grid, active, ones, watch)?;
    }
    Ok(())
}

/// A UUID that is the same for the same content: the name, the lattice and the number of active voxels.
fn identity(content: &Content, grids: &[Grid<'_>], active: &[Active]) -> String {
    let counts: Vec<_> = grids.iter().zip(active).map(|(grid, (count, _))| (&grid.name, *count)).collect();
    let text = hex(&Sha256::digest(format!("{} {:?} {counts:?}", content.name, content.lattice)));
    format!("{}-{}-4{}-8{}-{}", &text[..8], &text[8..12], &text[13..16], &text[17..20], &text[20..32])
}

fn write_grid(
    out: &mut BufWriter<File>,
    content: &Content,
    grid: &Grid<'_>,
    (count, [low, high]): Active,
    ones: &[Vec<u8>],
    watch: &dyn Watch,
) -> io::Result<()> {
    write_text(out, &grid.name)?;
    write_text(out, grid.kind)?;
    write_text(out, "")?; // no instance of another grid
    let offsets_at = out.stream_position()?;
    out.write_all(&[0; 24])?;
    let grid_at = out.stream_position()?;
    out.write_all(&COMPRESSION.to_le_bytes())?;
    let mut metadata = vec![("file_voxel_count".to_owned(), Value::Long(count as i64))];
    if count > 0 {
        metadata.push(("file_bbox_min".to_owned(), Value::Index(low)));
        metadata.push(("file_bbox_max".to_owned(), Value::Index(high)));
    }
    metadata.push(("is_saved_as_half_float".to_owned(), Value::Truth(grid.tree.is_signed())));
    metadata.extend(grid.metadata.iter().map(|(name, value)| (name.clone(), value.clone())));
    write_metadata(out, &metadata)?;
    write_transform(out, content)?;
    grid.tree.write_topology(out, watch)?;
    let values_at = out.stream_position()?;
    grid.tree.write_values(out, ones, watch)?;
    let end = out.stream_position()?;
    out.seek(SeekFrom::Start(offsets_at))?;
    for offset in [grid_at, values_at, end] {
        out.write_all(&(offset as i64).to_le_bytes())?;
    }
    out.seek(SeekFrom::Start(end))?;
    Ok(())
}

/// A scale for each axis and a shift: index to mm, whole indices to the centres of voxels.
fn write_transform(out: &mut impl Write, content: &Content) -> io::Result<()> {
    let pitch = content.lattice.pitch;
    write_text(out, "ScaleTranslateMap")?;
    let rows = [
        content.lattice.origin + 0.5 * pitch,
        pitch,
        pitch, // the size of a voxel
        pitch.recip(),
        (pitch * pitch).recip(),
        (2.0 * pitch).recip(),
    ];
    rows.iter().flat_map(|row| row.to_array()).try_for_each(|value| out.write_all(&value.to_le_bytes()))
}

fn write_metadata(out: &mut impl Write, metadata: &[(String, Value)]) -> io::Result<()> {
    out.write_all(&(metadata.len() as u32).to_le_bytes())?;
    for (name, value) in metadata {
        write_text(out, name)?;
        let (kind, bytes) = match value {
            Value::Text(text) => ("string", text.as_bytes().to_vec()),
            Value::Long(number) => ("int64", number.to_le_bytes().to_vec()),
            Value::Float(number) => ("float", number.to_le_bytes().to_vec()),
            Value::Index(index) => ("vec3i", index.iter().flat_map(|value| value.to_le_bytes()).collect()),
            Value::Truth(truth) => ("bool", vec![u8::from(*truth)]),
        };
        write_text(out, kind)?;
        out.write_all(&(bytes.len() as u32).to_le_bytes())?;
        out.write_all(&bytes)?;
    }
    Ok(())
}

fn write_text(out: &mut impl Write, text: &str) -> io::Result<()> {
    out.write_all(&(text.len() as u32).to_le_bytes())?;
    out.write_all(text.as_bytes())
}
