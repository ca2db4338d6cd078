//! `manifest.json`: what a finished job is, and every file of it.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{
    Prepared, StackingReport,
    record::{LookSummary, ROUNDS, RoundRecord},
};
use crate::output::{FileEntry, GENERATOR, Owner, TIMINGS};

/// Version of the manifest's form; raised when readers must change.
pub const MANIFEST_VERSION: u32 = 1;

/// Name of the file that holds the stackings.
pub const STACKINGS: &str = "stackings.json";
/// Name of the file that holds a look.
pub const LOOK: &str = "look.json";
/// The page's name in the output folder.
pub const REPORT: &str = "report.html";
/// Name of the table of colours and resins.
pub const MAPPING: &str = "mapping.txt";

/// What `slice` writes.
pub const OWNER: Owner = Owner {
    command: "slice",
    names: &[
        "slices/", "masks/", "meshes/", "heights/", "exports/", "bmp/", "preview/", "look/", LOOK, STACKINGS, ROUNDS,
        REPORT, TIMINGS, MAPPING,
    ],
};

/// A finished job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Program and version that wrote it.
    pub generator: String,
    /// The command, `slice`.
    #[serde(default = "slice")]
    pub command: String,
    /// [`MANIFEST_VERSION`].
    pub version: u32,
    /// Name of the job.
    pub name: String,
    /// The job with every default spelt out.
    pub job: Value,
    /// Files that were read.
    pub inputs: Vec<Value>,
    /// Objects in the order of the job.
    pub objects: Vec<ObjectRecord>,
    /// The voxels.
    pub lattice: LatticeRecord,
    /// Slices written: first, and one past the last.
    pub slices: [u32; 2],
    /// Name and provenance of the material set.
    pub material_set: MaterialSetRecord,
    /// Resins in the order of the set.
    pub materials: Vec<MaterialRecord>,
    /// Stackings of each object.
    pub stackings: Vec<StackingReport>,
    /// How far the print was from what was asked for, round by round of correction.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rounds: Vec<RoundRecord>,
    /// Material meshes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub meshes: Vec<MeshRecord>,
    /// How the job looks; `None` where it was not looked at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look: Option<LookSummary>,
    /// Every other file of the folder but the timings.
    pub files: Vec<FileEntry>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// How many of the warnings tell of what will not print well.
    #[serde(default)]
    pub print_warnings: usize,
}

/// An object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectRecord {
    /// Mesh file as the job writes it.
    pub mesh: String,
    /// 4×4, rows: mesh file coordinates to lattice frame, mm.
    pub transform: [[f64; 4]; 4],
    /// Least and greatest corner of the bounding box, mm.
    pub bounds_mm: [[f64; 3]; 2],
    /// State of the mesh.
    pub health: Value,
}

/// A lattice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LatticeRecord {
    /// Lower corner of voxel (0, 0, 0), mm.
    pub origin_mm: [f64; 3],
    /// Voxel size, mm.
    pub pitch_mm: [f64; 3],
    /// Voxels per axis.
    pub dims: [u32; 3],
}

/// A material set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaterialSetRecord {
    /// Its name.
    pub name: String,
    /// Where its numbers come from.
    pub provenance: String,
    /// Its channels.
    pub channels: Vec<String>,
    /// What was assumed, ignored or extrapolated when its data were read.
    #[serde(default)]
    pub notes: Vec<String>,
}

/// A resin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaterialRecord {
    /// Id in voxels, from 1.
    pub id: u8,
    /// Name.
    pub name: String,
    /// Colour in slices; all 0 for what prints as background.
    pub rgba: [u8; 4],
    /// Voxels of the slices written.
    pub voxels: u64,
    /// Their volume, mm³.
    pub volume_mm3: f64,
    /// Their mass, g.
    pub mass_g: f64,
    /// What that costs, in the currency of the material file; `None` where it has no price.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<f64>,
}

/// A material mesh.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeshRecord {
    /// Resin.
    pub material: String,
    /// Triangles.
    pub triangles: u64,
    /// Enclosed volume, mm³.
    pub volume_mm3: f64,
    /// Distance of the nodes it was made from, mm.
    pub pitch_mm: f64,
    /// How far its triangles may be from those on the nodes, mm.
    #[serde(default)]
    pub error_mm: f64,
}

/// Manifests did not tell their command once.
fn slice() -> String {
    OWNER.command.to_owned()
}

/// What slicing adds to what was prepared.
pub(super) struct Outcome {
    pub slices: [u32; 2],
    pub counts: [u64; 256],
    pub meshes: Vec<MeshRecord>,
    pub warnings: Vec<String>,
    /// How many of them tell of what will not print well.
    pub print_warnings: usize,
}

/// `value` as JSON; what lumislice writes always has a form in it.
pub(super) fn json(value: &impl Serialize) -> Value {
    serde_json::to_value(value).unwrap_or(Value::Null)
}

impl Manifest {
    /// The manifest of a job, its list of files still empty.
    pub(super) fn new(prepared: &Prepared, outcome: Outcome) -> Self {
        let lattice = &prepared.lattice;
        let objects = prepared.objects.iter().map(|object| ObjectRecord {
            mesh: object.mesh.clone(),
            transform: object.transform.transpose().to_cols_array_2d(),
            bounds_mm: object.bounds.map(|corner| corner.to_array()),
            health: json(&object.health),
        });
        Self {
            generator: GENERATOR.to_owned(),
            command: slice(),
            version: MANIFEST_VERSION,
            name: prepared.job.name.clone(),
            job: json(&prepared.job.resolved()),
            inputs: prepared.inputs.iter().map(json).collect(),
            objects: objects.collect(),
            lattice: LatticeRecord {
                origin_mm: lattice.origin.to_array(),
                pitch_mm: lattice.pitch.to_array(),
                dims: lattice.dims,
            },
            slices: outcome.slices,
            material_set: MaterialSetRecord {
                name: prepared.materials.name.clone(),
                provenance: prepared.materials.provenance.clone(),
                channels: prepared.materials.channels.clone(),
                notes: prepared.materials.warnings.clone(),
            },
            materials: prepared.material_records(&outcome.counts, lattice.voxel_volume()),
            stackings: prepared.objects.iter().map(|object| object.stackings.clone()).collect(),
            rounds: prepared.rounds.as_ref().map(|rounds| rounds.rounds.clone()).unwrap_or_default(),
            meshes: outcome.meshes,
            look: None,
            files: Vec::new(),
            warnings: outcome.warnings,
            print_warnings: outcome.print_warnings,
        }
    }
}

impl Prepared {
    /// Every resin with its share of voxels of `voxel_mm3` each.
    pub fn material_records(&self, counts: &[u64; 256], voxel_mm3: f64) -> Vec<MaterialRecord> {
        let record = |(index, resin): (usize, &crate::optics::Resin)| {
            let id = crate::voxel::MaterialId::from_resin(index).0;
            let voxels = counts[usize::from(id)];
            let volume_mm3 = voxels as f64 * voxel_mm3;
            let mass_g = volume_mm3 * 1e-3 * resin.density_g_per_cm3;
            MaterialRecord {
                id,
                name: resin.name.clone(),
                rgba: self.palette[usize::from(id)],
                voxels,
                volume_mm3,
                mass_g,
                cost: resin.price_per_kg.map(|price| mass_g * 1e-3 * price),
            }
        };
        self.materials.resins.iter().enumerate().map(record).collect()
    }
}
