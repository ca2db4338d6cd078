//! What can go wrong with a mesh, by whom is to blame: the file, the parameter, or the shape itself.

use std::path::{Path, PathBuf};

use crate::words::{counted, short};

/// Why a mesh cannot be read, placed or closed. Each message is one line with place, found and expected.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file cannot be opened or read.
    #[error("{}: cannot be read: {source}", file.display())]
    Read {
        /// The mesh file or a file it needs.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Neither the file's name nor its first bytes tell a format we read.
    #[error("{}: found {found}, expected an OBJ, GLB, glTF, STL, PLY or 3MF file", file.display())]
    UnknownFormat {
        /// The mesh file.
        file: PathBuf,
        /// Its extension or first bytes.
        found: String,
    },
    /// The file contradicts its format or itself.
    #[error("{}: {place}: found {found}, expected {expected}", file.display())]
    Malformed {
        /// The mesh file.
        file: PathBuf,
        /// Line, vertex, element or part.
        place: String,
        /// What stands there.
        found: String,
        /// What should stand there.
        expected: String,
    },
    /// The mesh is absurdly large or small, which nearly always is a matter of its unit.
    #[error(
        "{}: the mesh is {} mm long, expected {} to {} mm: {hint}",
        file.display(), short(*extent_mm), short(*min_mm), short(*max_mm)
    )]
    Extent {
        /// The mesh file.
        file: PathBuf,
        /// Longest side of the bounding box after unit conversion.
        extent_mm: f64,
        /// Shortest length accepted.
        min_mm: f64,
        /// Longest length accepted.
        max_mm: f64,
        /// What to do about it.
        hint: &'static str,
    },
    /// A placement parameter that has no meaning.
    #[error("{name}: found {found}, expected {expected}")]
    Placement {
        /// The parameter as the job calls it.
        name: &'static str,
        /// Its value.
        found: String,
        /// The values it may have.
        expected: &'static str,
    },
    /// Nothing is left of the mesh once triangles without area are dropped.
    #[error(
        "the mesh has no surface: all of its {triangles} triangles have no area or cancel each other, expected a \
            closed surface"
    )]
    NoSurface {
        /// Triangles before cleaning.
        triangles: usize,
    },
    /// A surface with so large an opening that closing it would be a guess.
    #[error(
        "the mesh is an open sheet: closing its {} ({}) takes {percent:.1}% of its surface area, expected at most \
         {limit_percent:.0}%: {}",
        counted(*.holes, "hole"), counted(*.open_edges, "open edge"), closing_advice(*.unjoined_rim_gap_mm)
    )]
    OpenSheet {
        /// Boundary loops.
        holes: usize,
        /// Edges with one triangle only.
        open_edges: usize,
        /// Cap area in percent of the mesh area.
        percent: f64,
        /// [`super::MAX_CAP_FRACTION`] in percent.
        limit_percent: f64,
        /// How far rims of its pieces that run along each other, and are too far apart for one curve, are apart at
        /// most, mm; 0 where there are none.
        unjoined_rim_gap_mm: f64,
    },
    /// An open piece beside others that faces inwards.
    #[error(
        "an open piece of {triangles} triangles faces inwards, and closing it takes {percent:.1}% of its surface area, \
         expected at most {limit_percent:.0}%: whether it is the wall of a hole or a body turned inside out cannot be \
         told: join its rims with what it belongs to, or close it in a modeller"
    )]
    Facing {
        /// Its triangles.
        triangles: usize,
        /// Cap area in percent of its own.
        percent: f64,
        /// [`super::MAX_CAP_FRACTION`] in percent.
        limit_percent: f64,
    },
    /// A closed surface around nothing.
    #[error(
        "the mesh encloses {volume_mm3:.3} mm³ under {area_mm2:.3} mm² of surface, expected a solid: is it a flat or \
            double-sided sheet, or does it cross itself so that half of it is inside out?"
    )]
    NoVolume {
        /// Enclosed volume.
        volume_mm3: f64,
        /// Surface area.
        area_mm2: f64,
    },
}

impl crate::blame::Blamed for MeshError {}

fn closing_advice(unjoined_rim_gap_mm: f64) -> String {
    match unjoined_rim_gap_mm > 0.0 {
        true => format!(
            "rims of its pieces run along each other, up to {unjoined_rim_gap_mm:.3} mm apart, too far for one curve: \
             join them in a modeller (merge by distance), or close each piece"
        ),
        false => "give the sheet a thickness or close it in a modeller".to_owned(),
    }
}

/// A parser's complaint before it knows which file it reads.
#[derive(Debug)]
pub(super) struct Fault {
    place: String,
    found: String,
    expected: String,
}

impl Fault {
    pub(super) fn new(place: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { place: place.into(), found: found.into(), expected: expected.into() }
    }

    pub(super) fn in_file(self, file: &Path) -> MeshError {
        MeshError::Malformed { file: file.to_owned(), place: self.place, found: self.found, expected: self.expected }
    }
}

/// A parser's result.
pub(super) type Parsed<T> = Result<T, Fault>;

/// Bytes of a file made fit for an error message: quoted, on one line, at most 40 characters.
pub(super) fn quote(bytes: &[u8]) -> String {
    const MAX_CHARS: usize = 40;
    let head = &bytes[..bytes.len().min(4 * MAX_CHARS)];
    let text = String::from_utf8_lossy(head);
    let mut quoted: String = text.trim().chars().take(MAX_CHARS).collect();
    if quoted.len() < text.trim().len() || head.len() < bytes.len() {
        quoted.push('…');
    }
    format!("`{}`", quoted.escape_debug())
}
