//! The table `[output]`: what is written, and what formats hold.

use super::error::JobError;
use super::ranges as range;
use super::read::{Result, Table, Value};
use crate::words::quoted_list;

/// A kind of output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum OutputFormat {
    /// 32-bit RGBA PNG per slice.
    Png,
    /// 1-bit PNG per slice and material.
    Masks,
    /// STL mesh per material.
    Stl,
    /// 3MF assembly of the meshes.
    ThreeMf,
    /// Pictures and a report.
    Preview,
    /// Layer maps: an image of depths per layer.
    Heights,
    /// GrabCAD Print's voxel container.
    Gcvf,
    /// Bitmaps of one bit per slice and material, for Objet printers.
    Bmp,
    /// Ids of voxels for ParaView.
    Vti,
    /// Ids of voxels for napari and 3D Slicer.
    Nrrd,
    /// Grids of OpenVDB.
    Vdb,
}

impl OutputFormat {
    /// Every format and its name in jobs.
    pub const ALL: [(&'static str, Self); 11] = [
        ("png", Self::Png),
        ("masks", Self::Masks),
        ("stl", Self::Stl),
        ("3mf", Self::ThreeMf),
        ("preview", Self::Preview),
        ("heights", Self::Heights),
        ("gcvf", Self::Gcvf),
        ("bmp", Self::Bmp),
        ("vti", Self::Vti),
        ("nrrd", Self::Nrrd),
        ("vdb", Self::Vdb),
    ];

    /// Whether the format holds voxels, one by one, and so mixtures too.
    pub fn holds_voxels(self) -> bool {
        !matches!(self, Self::Masks | Self::Stl | Self::ThreeMf | Self::Heights)
    }

    /// Whether the format is a volume of ids, support among them, for other programs.
    pub fn is_volume(self) -> bool {
        matches!(self, Self::Vti | Self::Nrrd | Self::Vdb)
    }

    /// Whether the format is one file of the whole job.
    pub fn is_one_file(self) -> bool {
        self == Self::Gcvf || self.is_volume()
    }

    /// Whether the format is one file of the whole job, or a set of files that only make sense together.
    pub fn holds_whole_jobs(self) -> bool {
        self.is_one_file() || self == Self::Bmp
    }

    /// Its name in jobs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Masks => "masks",
            Self::Stl => "stl",
            Self::ThreeMf => "3mf",
            Self::Preview => "preview",
            Self::Heights => "heights",
            Self::Gcvf => "gcvf",
            Self::Bmp => "bmp",
            Self::Vti => "vti",
            Self::Nrrd => "nrrd",
            Self::Vdb => "vdb",
        }
    }
}

/// Formats that are planned; asking for one is answered so, not with "unknown".
pub(super) const PLANNED_FORMATS: &[&str] = &["svx"];

/// What volumes hold of the resins in a voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum VolumeValues {
    /// The one that is printed.
    #[default]
    Voxels,
    /// The fraction of each, which printed voxels are drawn by.
    Fractions,
}

impl VolumeValues {
    /// All, with their names in jobs.
    pub const ALL: [(&'static str, Self); 2] = [("voxels", Self::Voxels), ("fractions", Self::Fractions)];
}

/// What is written.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputOptions {
    /// Formats in the job's order, each once, at least one; default png and preview.
    pub formats: Vec<OutputFormat>,
    /// Voxel size that material meshes are made at, mm, 0.001 to 10; `None`: the mesher's choice.
    pub mesh_pitch_mm: Option<f64>,
    /// How far fewer, larger triangles of material meshes may be off, mm, 0 to 1; 0 leaves them as they are; `None`:
    /// the mesher's choice.
    pub mesh_error_mm: Option<f64>,
    /// What volumes hold of resins; default voxels.
    pub volumes: VolumeValues,
    /// Resin that is printed where a stacking has the background (support) resin; `None`: nothing is, and the
    /// printer fills the void with support.
    pub map_background: Option<String>,
}

pub(super) const OUTPUT_KEYS: &[&str] = &["formats", "volumes", "mesh-pitch-mm", "mesh-error-mm", "background-as"];

pub(super) fn read_output(table: &Table<'_>) -> Result<OutputOptions> {
    table.allow_only(OUTPUT_KEYS)?;
    let formats = match table.get("formats") {
        None => vec![OutputFormat::Png, OutputFormat::Preview],
        Some(value) => read_formats(&value)?,
    };
    let volumes = table.get("volumes").map_or(Ok(VolumeValues::default()), |value| value.choice(&VolumeValues::ALL))?;
    if let Some(value) = table.get("volumes").filter(|_| !formats.iter().any(|format| format.is_volume())) {
        let names = OutputFormat::ALL.iter().filter(|(_, format)| format.is_volume()).map(|(name, _)| *name);
        return Err(value.refuse_as(
            "values of volumes that are not written",
            format!("one of {} among formats", quoted_list(names)),
        ));
    }
    Ok(OutputOptions {
        formats,
        volumes,
        mesh_pitch_mm: table.get("mesh-pitch-mm").map(|value| value.number(range::PITCH)).transpose()?,
        mesh_error_mm: table.get("mesh-error-mm").map(|value| value.number(range::MESH_ERROR)).transpose()?,
        map_background: table.name("background-as", "a resin")?,
    })
}

fn read_formats(value: &Value<'_>) -> Result<Vec<OutputFormat>> {
    let names: Vec<&str> = OutputFormat::ALL.iter().map(|&(name, _)| name).collect();
    let expected = format!("an array of formats from {}", quoted_list(names.iter().copied()));
    let mut formats = Vec::new();
    for element in value.list(&expected)? {
        if let Ok(name) = element.text("")
            && PLANNED_FORMATS.contains(&name)
        {
            return Err(JobError::NotBuilt {
                place: element.place(),
                key: element.key().to_owned(),
                found: name.to_owned(),
                expected: format!("one of {}", quoted_list(names.iter().copied())),
            });
        }
        let format = element.choice(&OutputFormat::ALL)?;
        if formats.contains(&format) {
            return Err(element.refuse_as(format!("\"{}\" a second time", format.name()), "each format once"));
        }
        formats.push(format);
    }
    if formats.is_empty() { Err(value.refuse(expected)) } else { Ok(formats) }
}
