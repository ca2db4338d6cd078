//! What a page is made of.

use crate::{
    optics::{Mixture, Stack},
    preview::{FilmStrip, ReportLabel},
};

/// What the page says. All texts are plain; the page escapes them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportData {
    /// Name of the job.
    pub job: String,
    /// What wrote it, such as `lumislice 0.1.0`.
    pub generator: String,
    /// Name of the printer or preset.
    pub printer: String,
    /// Voxels per axis.
    pub dims: [u32; 3],
    /// Edges of a voxel, mm.
    pub pitch_mm: [f64; 3],
    /// More lines for the head of the page: name, value.
    pub facts: Vec<(String, String)>,
    /// Materials in the order of their ids.
    pub materials: Vec<ReportMaterial>,
    /// A sentence under the materials, such as where their optics come from.
    pub materials_note: String,
    /// One stacking per cluster.
    pub stackings: Vec<ReportStacking>,
    /// What the predicted error measures, as a column heading; `error` if empty.
    pub error_name: String,
    /// Warnings of the job.
    pub warnings: Vec<String>,
    /// What was found in the meshes.
    pub health: Vec<ReportHealth>,
    /// What the job comes to, a sentence or two each, the most telling first: what the page opens with.
    pub verdict: Vec<String>,
    /// What the numbers of the look say, a sentence each.
    pub look: Vec<String>,
    /// Points of the surface, with the stackings there.
    pub labels: Vec<ReportLabel>,
    /// Area of the surface, mm².
    pub area_mm2: f64,
    /// Pictures in the order they are shown.
    pub pictures: Vec<ReportPicture>,
    /// Slices to leaf through.
    pub film: Option<ReportFilm>,
}

/// A row of the table of materials.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportMaterial {
    /// Its name.
    pub name: String,
    /// sRGB colour and alpha; alpha 0 is hatched: the printer fills it.
    pub rgba: [u8; 4],
    /// Voxels made of it.
    pub voxels: u64,
    /// Their volume, mm³.
    pub volume_mm3: f64,
    /// Their mass; `None` if the density is not known.
    pub grams: Option<f64>,
}

/// Layers of one cluster.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportStacking {
    /// What it is for, such as `cluster 3`.
    pub name: String,
    /// Its object and cluster, from 1 and from 0.
    pub origin: [usize; 2],
    /// Layers of the materials or of mixtures of them, over their core.
    pub stack: Stack<Mixture>,
    /// Part of the surface it is for, 0 to 1, if known.
    pub share: Option<f64>,
    /// The albedo that is asked for and the one that is predicted, as sRGB, if known.
    pub albedo: [Option<[u8; 3]>; 2],
    /// Predicted error, if known.
    pub error: Option<f64>,
}

/// What was found in one mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportHealth {
    /// The object or its file.
    pub object: String,
    /// Finding, value.
    pub findings: Vec<(String, String)>,
}

/// A picture of the job.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportPicture {
    /// Path relative to the page, with forward slashes.
    pub path: String,
    /// A sentence below it.
    pub caption: String,
    /// The file; if it is empty, the page shows what lies at its path.
    pub png: Vec<u8>,
    /// What it shows side by side, by name, if it is to be shown one by one.
    pub panels: Vec<(&'static str, Vec<u8>)>,
}

/// Slices to leaf through.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportFilm {
    /// How they lie in the picture.
    pub layout: FilmStrip,
    /// The picture.
    pub png: Vec<u8>,
}
