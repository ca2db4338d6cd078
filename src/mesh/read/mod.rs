//! Reading mesh files: one parser a format, one set of checks for all.
//!
//! OBJ, MTL, STL, PLY and 3MF are parsed here rather than by crates. Those we tried, on the inputs that our tests are
//! made of, fail where it hurts:
//!
//! - tobj 4.0.5 panics on `Kd 0.5`, refuses `v 0 0 0 # corner`, loses the first line after a byte order mark, hands `-s
//!   0.5 1 1 wood.png` on as the texture's name, knows keywords in one case alone, folds concave polygons over
//!   themselves, and says no line.
//! - stl_io 0.11.0 drops every solid after the first, reads no triangle of a file whose header counts 0, and refuses
//!   `end solid`.
//! - ply-rs-bw 4.0.1 refuses `1.`, a byte order mark, lone returns and elements that go on in the next line, and fills
//!   memory on an element without properties.
//! - threemf2 0.4 reads a malformed coordinate or index as 0 without a word.
//!
//! glTF's JSON goes through the gltf crate, its binary accessors through [`accessor`], which checks every range before
//! it reads.
//!
//! What is read, ignored and refused of each format stands in [`support`], and in docs/formats.md, which a test holds
//! against it.
//!
//! Memory is bounded by the file: a parser compares every count with the bytes that are left before it reserves room.

mod accessor;
mod gltf;
mod gltf_container;
mod gltf_document;
mod gltf_instances;
mod gltf_interior;
mod gltf_mask;
mod gltf_material;
mod gltf_shape;
mod gltf_tidy;
mod mtl;
mod obj;
mod ply;
mod ply_header;
mod ply_surface;
mod polygon;
mod raw;
mod stl;
mod support;
mod surface;
mod text;
mod texture;
mod threemf;
mod threemf_model;
mod threemf_package;
mod threemf_parts;
mod threemf_tag;
mod weld;

pub(crate) use texture::fill_holes;
pub(super) use weld::weld;

use std::{
    cell::RefCell,
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use glam::{DMat4, DVec3};

use self::raw::RawMesh;
use super::TriangleMesh;
use super::error::{Fault, MeshError, Parsed, quote};
use crate::{
    machine::{self, Shortage},
    regular_file,
    words::one_line,
};

/// Longest side of a mesh that is believed, in mm. No printer's tray is a thousandth of it.
pub const MAX_EXTENT_MM: f64 = 1e6;
/// Longest side below which a mesh is not believed, in mm: a ten-thousandth of the finest voxel.
pub const MIN_EXTENT_MM: f64 = 1e-6;
/// Most triangles of one mesh, so that a nest of instances in a small file cannot fill memory.
pub const MAX_TRIANGLES: usize = 100_000_000;

/// The length that 1 stands for in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Micrometre.
    Um,
    /// Millimetre.
    Mm,
    /// Centimetre.
    Cm,
    /// Metre.
    M,
    /// 25.4 mm.
    Inch,
}

impl Unit {
    /// Every unit and its name in jobs.
    pub const ALL: [(&'static str, Self); 5] =
        [("mm", Self::Mm), ("cm", Self::Cm), ("m", Self::M), ("inch", Self::Inch), ("um", Self::Um)];

    /// Its name in jobs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Um => "um",
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::M => "m",
            Self::Inch => "inch",
        }
    }

    /// Millimetres per unit.
    pub fn mm(self) -> f64 {
        match self {
            Self::Um => 1e-3,
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::M => 1000.0,
            Self::Inch => 25.4,
        }
    }
}

/// What a job may say about a mesh file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LoadOptions {
    /// Overrides the unit of the file or of its format (mm for OBJ, STL and PLY, m for glTF).
    pub unit: Option<Unit>,
}

/// A mesh file's contents.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// Triangles in mm, z up, bit-identical positions shared.
    pub mesh: TriangleMesh,
    /// Maps the file's coordinates (glTF: of the scene, 3MF: of the build) to `mesh.positions`: unit and axes.
    pub file_to_mesh: DMat4,
    /// What was missing, skipped or odd, a sentence each.
    pub warnings: Vec<String>,
    /// The first of the warnings that is about a base colour that could not be had: what the surface shows then is not
    /// what its maker meant. `None` if there is no such warning.
    pub lost_color: Option<String>,
    /// Other files that were read: material libraries, buffers, textures; those that could not be are warnings.
    pub companions: Vec<PathBuf>,
}

/// Reads a mesh file, with its materials and textures.
///
/// The format follows the extension; a file without a known one is recognised by its first bytes. Missing materials and
/// textures are warnings.
///
/// # Errors
/// The file cannot be read, is of no known format, contradicts itself, holds no triangle or a position that is not
/// finite, or is longer than [`MAX_EXTENT_MM`] or shorter than [`MIN_EXTENT_MM`].
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, MeshError> {
    let bytes = read_file(path)?;
    let companions = RefCell::default();
    let source = Source { path, bytes: &bytes, companions: &companions };
    let format = Format::of(&source)?;
    if bytes.is_empty() {
        return Err(Fault::new("byte 0", "an empty file", "a mesh").in_file(path));
    }
    let raw = format.parse(&source).map_err(|fault| fault.in_file(path))?;
    let companions = companions.take().into_iter().collect();
    finish(raw, path, options).map(|loaded| Loaded { companions, ..loaded })
}

/// A mesh file's bytes, and its path to find companions by.
pub(super) struct Source<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    /// Other files that were read.
    companions: &'a RefCell<BTreeSet<PathBuf>>,
}

impl Source<'_> {
    /// The bytes of a companion, or a phrase that says why there are none.
    fn read(&self, companion: &Path) -> Result<Vec<u8>, String> {
        let bytes = regular_file::read(companion, MAX_MESH_BYTES).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
            _ => one_line(error),
        })?;
        self.companions.borrow_mut().insert(companion.to_owned());
        Ok(bytes)
    }

    /// Path of a file that this one mentions, relative to it; backslashes of Windows exporters separate folders too.
    /// What is not where it is said to be, as after a move from another machine, may lie beside this file under the
    /// same name, in any case.
    fn companion(&self, name: &str) -> PathBuf {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let verbatim = folder.join(name);
        let bare = name.strip_prefix('"').and_then(|name| name.strip_suffix('"'));
        if let Some(bare) = bare.filter(|_| !verbatim.exists()) {
            return self.companion(bare);
        }
        if verbatim.exists() {
            return verbatim;
        }
        let slashed = name.replace('\\', "/");
        let told = folder.join(&slashed);
        let last = slashed.rsplit('/').next().filter(|last| !last.is_empty());
        last.filter(|_| !told.exists()).and_then(|last| only_alike(folder, last)).unwrap_or(told)
    }
}

/// The only entry of a folder that has this name, or failing that has it in another case.
fn only_alike(folder: &Path, name: &str) -> Option<PathBuf> {
    let exact = folder.join(name);
    if exact.exists() {
        return Some(exact);
    }
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    let mut alike = entries
        .filter(|entry| entry.file_name().to_str().is_some_and(|other| other.to_lowercase() == name.to_lowercase()));
    let found = alike.next()?;
    alike.next().is_none().then(|| found.path())
}

#[derive(Clone, Copy)]
enum Format {
    Obj,
    Gltf,
    Stl,
    Ply,
    ThreeMf,
}

/// Extensions of mesh files, in lower case.
const EXTENSIONS: [(&str, Format); 6] = [
    ("glb", Format::Gltf),
    ("gltf", Format::Gltf),
    ("obj", Format::Obj),
    ("stl", Format::Stl),
    ("ply", Format::Ply),
    ("3mf", Format::ThreeMf),
];

/// Extensions that mesh files are known by, in lower case.
pub fn extensions() -> impl Iterator<Item = &'static str> {
    EXTENSIONS.iter().map(|(extension, _)| *extension)
}

impl Format {
    fn of(source: &Source) -> Result<Self, MeshError> {
        let extension = source.path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        Ok(match EXTENSIONS.iter().find(|(known, _)| *known == extension) {
            Some((_, format)) => *format,
            None => match source.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(source.bytes) {
                [b'g', b'l', b'T', b'F', ..] => Self::Gltf,
                [b'p', b'l', b'y', b'\n' | b'\r', ..] => Self::Ply,
                [b'P', b'K', 3, 4, ..] => Self::ThreeMf,
                [b's', b'o', b'l', b'i', b'd', ..] => Self::Stl,
                head => {
                    let start = quote(&head[..head.len().min(16)]);
                    let found = format!("extension `{}` and first bytes {start}", extension.escape_debug());
                    return Err(MeshError::UnknownFormat { file: source.path.to_owned(), found });
                }
            },
        })
    }

    fn parse(self, source: &Source) -> Parsed<RawMesh> {
        match self {
            Self::Obj => obj::parse(source),
            Self::Gltf => gltf::parse(source),
            Self::Stl => stl::parse(source),
            Self::Ply => ply::parse(source),
            Self::ThreeMf => threemf::parse(source),
        }
    }
}

/// Longest mesh, texture or buffer that is read, bytes: some 80 million triangles.
const MAX_MESH_BYTES: u64 = 4 << 30;

fn read_file(path: &Path) -> Result<Vec<u8>, MeshError> {
    regular_file::read(path, MAX_MESH_BYTES).map_err(|source| MeshError::Read { file: path.to_owned(), source })
}

/// Bytes that reading and closing take for a triangle and for a position, at their peak: a sphere of 1.4 million
/// triangles took 390 a triangle as an STL and as a PLY, with a copy of the mesh.
const TRIANGLE_BYTES: u64 = 340;
const POSITION_BYTES: u64 = 40;

/// Refuses more triangles than a mesh may have, or than the machine has memory for, before room is made for them.
fn check_memory(place: impl Fn() -> String, triangles: u64, positions: u64) -> Parsed<()> {
    if triangles > MAX_TRIANGLES as u64 || positions > 3 * MAX_TRIANGLES as u64 {
        let found = format!("{triangles} triangles between {positions} corners");
        return Err(Fault::new(place(), found, format!("at most {MAX_TRIANGLES} triangles")));
    }
    match machine::short_of(triangles * TRIANGLE_BYTES + positions * POSITION_BYTES) {
        Some(Shortage { needs, expected }) => {
            Err(Fault::new(place(), format!("{triangles} triangles, {needs}"), expected))
        }
        None => Ok(()),
    }
}

/// Checks what every format must fulfil, shares equal positions and converts to millimetres and z up.
fn finish(mut raw: RawMesh, path: &Path, options: &LoadOptions) -> Result<Loaded, MeshError> {
    if raw.triangles.is_empty() {
        let found = match raw.besides.split_last() {
            None => "no triangles".to_owned(),
            Some((last, [])) => format!("no triangles, but {last}"),
            Some((last, others)) => format!("no triangles, but {} and {last}", others.join(", ")),
        };
        return Err(Fault::new("the whole file", found, "a surface of triangles or polygons").in_file(path));
    }
    check_memory(|| "the whole file".to_owned(), raw.triangles.len() as u64, raw.positions.len() as u64)
        .map_err(|fault| fault.in_file(path))?;
    surface::settle(&mut raw);
    weld(&mut raw.positions, &mut raw.triangles);
    let mm = options.unit.map_or(raw.mm_per_unit, Unit::mm);
    let turn = if raw.y_up {
        DMat4::from_cols(DVec3::X.extend(0.0), DVec3::Z.extend(0.0), DVec3::NEG_Y.extend(0.0), glam::DVec4::W)
    } else {
        DMat4::IDENTITY
    };
    for p in &mut raw.positions {
        // Not by the matrix: its sums of products would turn −0 into +0 and cost an ulp.
        *p = if raw.y_up { DVec3::new(p.x, -p.z, p.y) } else { *p } * mm;
    }
    for path in raw.materials.iter_mut().filter_map(|material| material.mean_free_path_mm.as_mut()) {
        *path = path.map(|length| length * mm);
    }
    check_extent(&raw.positions, path)?;
    Ok(Loaded {
        mesh: TriangleMesh {
            positions: raw.positions,
            triangles: raw.triangles,
            uvs: raw.uvs,
            corner_colors: raw.corner_colors,
            material_of: raw.material_of,
            patch_of: Vec::new(),
            materials: raw.materials,
        },
        file_to_mesh: DMat4::from_scale(DVec3::splat(mm)) * turn,
        warnings: raw.warnings,
        lost_color: raw.lost_color,
        companions: Vec::new(),
    })
}

fn check_extent(positions: &[DVec3], path: &Path) -> Result<(), MeshError> {
    let (low, high) = super::bounds(positions);
    let extent_mm = (high - low).max_element();
    let hint = if extent_mm == 0.0 {
        "all its points are one"
    } else if !(MIN_EXTENT_MM..).contains(&extent_mm) {
        "is the file in metres? try unit = \"m\""
    } else if extent_mm > MAX_EXTENT_MM {
        "is the file in a smaller unit? try unit = \"um\""
    } else {
        return Ok(());
    };
    Err(MeshError::Extent { file: path.to_owned(), extent_mm, min_mm: MIN_EXTENT_MM, max_mm: MAX_EXTENT_MM, hint })
}
