//! Jobs: what to print, on which printer, from which resins, to look like what.
//!
//! **In:** a job file, TOML. **Out:** a [`Job`]: typed, with every default filled in, every number in its range, every
//! input file found; or a [`JobError`] that says in one line where the job is wrong, what was found and what was
//! expected. Nothing slow happens here and nothing is read but the job: whether the resins it names exist is asked
//! later ([`Job::check_resins`]), when the materials are known. `docs/job.md` lists every key.

mod appearance;
mod error;
mod object;
mod options;
mod output;
mod paths;
mod quick;
mod ranges;
mod read;
mod resolved;
mod rules;
mod schema;
mod target;
#[cfg(test)]
mod tests;
mod texture;

use std::io::Read;
use std::path::{Path, PathBuf};

use toml::de::DeTable;

pub use appearance::AppearanceOptions;
pub use error::JobError;
pub use object::{DepthFrom, ObjectJob, Scaling};
pub use options::{
    ClusterOptions, Distance, FieldOptions, MaterialSource, NamedLimit, Overlap, SUPPORT, SUPPORT_MIN_DEPTH_MM,
    StackingModel, StackingOptions, min_depth_limits,
};
pub use output::{OutputFormat, OutputOptions, VolumeValues};
pub use paths::InputPath;
pub use resolved::ResolvedJob;
pub use schema::schema;
pub use target::TargetSpec;
pub use texture::{AlbedoSource, Projection, TextureTarget};

pub use crate::{mesh::Unit, toml_reader::Place};

use crate::encoding;
use crate::optics::{Mixture, SHARES};
use crate::regular_file;
use crate::search::{Norm, SearchCache};
use crate::toml_reader::{Found, Places, Source};
use crate::voxel::Printer;
use crate::words::{excerpt, hint, path_line};

/// Largest job file that is read, bytes. A job that lists 10 000 profiles stays below it.
pub const MAX_JOB_BYTES: u64 = 1 << 20;

/// A checked job.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// The job file's stem, fit to be part of a file name: no separators, never empty, `.` or `..`.
    pub name: String,
    /// The job file as it was named.
    pub path: PathBuf,
    /// Objects on the tray, at least one.
    pub objects: Vec<ObjectJob>,
    /// The machine.
    pub printer: Printer,
    /// The resins.
    pub materials: MaterialSource,
    /// Grouping of texels.
    pub clusters: ClusterOptions,
    /// Search for stackings.
    pub stacking: StackingOptions,
    /// What is done so that the print looks as asked on any shape.
    pub appearance: AppearanceOptions,
    /// Measure of depth.
    pub field: FieldOptions,
    /// What is written.
    pub output: OutputOptions,
    /// What becomes of objects that share space.
    pub overlap: Overlap,
    /// Gap between objects that are set side by side on the tray, mm, 0 to 100; `None`: they stand where the job says.
    pub arrange_gap_mm: Option<f64>,
    /// Where searches are looked up that were made before; `None`, as a file leaves it: nowhere. No result depends on
    /// it.
    pub search_cache: Option<SearchCache>,
    /// Whether objects that do not fit the printer are refused before anything slow; else an estimate lists them.
    pub must_fit: bool,
    /// Whether it was made coarse for a first look ([`Job::quick`]).
    pub is_coarse: bool,
    /// Where each key stands, for errors found later.
    places: Places,
}

/// Whether a layer's name is that of a mixture.
fn is_mixture(name: &str) -> bool {
    Mixture::parts_of_name(name).is_none_or(|parts| parts.len() > 1)
}

fn quoted(name: &str) -> String {
    format!("\"{}\"", excerpt(name))
}

/// The tables of a job.
const ROOT_KEYS: &[&str] = &[
    "object",
    "printer",
    "materials",
    "target",
    "clusters",
    "stacking",
    "appearance",
    "field",
    "output",
    "overlap",
    "arrange",
    "gap-mm",
];

impl Job {
    /// Reads and checks the job at `path`. Its paths are relative to its folder.
    ///
    /// # Errors
    /// [`JobError`]: the file cannot be read or is larger than [`MAX_JOB_BYTES`], or anything of
    /// [`Job::from_toml`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self, JobError> {
        let path = path.as_ref();
        let file_name = || path_line(path);
        let unreadable = |found: String| JobError::Unreadable { file: file_name(), found };
        let disk = |error: std::io::Error| match error.kind() {
            std::io::ErrorKind::NotFound => unreadable("no such file".to_owned()),
            _ => unreadable(excerpt(&error.to_string())),
        };
        let metadata = std::fs::metadata(path).map_err(disk)?;
        if metadata.is_dir() {
            return Err(unreadable("a folder".to_owned()));
        }
        if !metadata.is_file() {
            return Err(unreadable("something that is not a regular file".to_owned()));
        }
        let mut bytes = Vec::new();
        regular_file::open(path).and_then(|file| file.take(MAX_JOB_BYTES + 1).read_to_end(&mut bytes)).map_err(disk)?;
        if bytes.len() as u64 > MAX_JOB_BYTES {
            let found = metadata.len().max(bytes.len() as u64);
            return Err(JobError::TooLarge { file: file_name(), found, limit: MAX_JOB_BYTES });
        }
        let text = encoding::text(&bytes).map_err(unreadable)?;
        Self::from_toml(&text, path, path.parent().unwrap_or(Path::new("")))
    }

    /// Checks a job's text. `path` names it in errors and gives it its name; relative paths in it start from
    /// `base_dir`.
    ///
    /// # Errors
    /// [`JobError`]: the text is no TOML or too long, a key is unknown, missing, of the wrong type or out of range, or
    /// an input file is not there. The first mistake found is reported, unknown keys before others of their table.
    pub fn from_toml(text: &str, path: impl AsRef<Path>, base_dir: impl AsRef<Path>) -> Result<Self, JobError> {
        let path = path.as_ref();
        if text.len() as u64 > MAX_JOB_BYTES {
            let (file, found) = (path_line(path), text.len() as u64);
            return Err(JobError::TooLarge { file, found, limit: MAX_JOB_BYTES });
        }
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let source = Source::new(path, base_dir.as_ref(), text, Found::AsWritten);
        let document = source.parse()?;
        let root = read::Table::root(&source, &document);
        root.allow_only(ROOT_KEYS)?;
        // A table with defaults reads the same whether it is empty or left out.
        let empty = toml::Spanned::new(0..0, DeTable::new());
        let table = |key: &str| root.get(key).map_or_else(|| Ok(read::Table::root(&source, &empty)), |t| t.table());
        let common = root.get("target").map(|target| target::read_with_map(&target.table()?)).transpose()?;
        let arrange_gap_mm = options::read_arrange(&root)?;
        let objects = object::read_all(&root, common.as_ref(), arrange_gap_mm.is_some())?;
        let printer = options::read_printer(&root)?;
        let materials = options::read_materials(&root)?;
        let clusters = options::read_clusters(&table("clusters")?)?;
        let stacking = options::read_stacking(&table("stacking")?)?;
        let appearance = appearance::read_appearance(&table("appearance")?, &stacking)?;
        let field = options::read_field(&table("field")?)?;
        let output = output::read_output(&table("output")?)?;
        let overlap = options::read_overlap(&root)?;
        let (name, path) = (paths::job_name(path), path.to_owned());
        let places = source.into_places();
        let job = Self {
            name,
            path,
            objects,
            printer,
            materials,
            clusters,
            stacking,
            appearance,
            field,
            output,
            overlap,
            arrange_gap_mm,
            search_cache: None,
            must_fit: false,
            is_coarse: false,
            places,
        };
        job.check_mixtures()?;
        Ok(job)
    }

    /// Whether stackings that are searched for may have layers that are mixtures: as the job says, else where transport
    /// judges thicknesses of any size by another objective than the paper's, and only voxels and pictures are written.
    pub fn allows_mixtures(&self) -> bool {
        self.stacking.mixtures.unwrap_or_else(|| {
            !self.whole_layers()
                && self.stacking.objective.norm != Norm::L2
                && self.output.formats.iter().all(|format| format.holds_voxels())
        })
    }

    /// Whether stackings are searched for in whole steps, which no mixtures have.
    fn whole_layers(&self) -> bool {
        !matches!(self.stacking.model, StackingModel::Transport { layer_step_mm: None, .. })
    }

    /// Whether boundaries between the layers of an object are dithered: as the job says, else where its layers may be
    /// mixtures.
    pub fn dithers(&self, object: usize) -> bool {
        self.field.dither.unwrap_or_else(|| {
            let target = self.objects.get(object).map(|object| &object.target);
            let mixed = match target {
                Some(TargetSpec::Stacking { stack }) => stack.pairs().any(|(name, _)| is_mixture(name)),
                _ => self.allows_mixtures(),
            };
            mixed && self.field.distance == Distance::Exact
        })
    }

    /// Refuses mixtures in formats that cannot hold them, unless the job says how they are to be written there.
    fn check_mixtures(&self) -> Result<(), JobError> {
        let given = self.objects.iter().any(|object| match &object.target {
            TargetSpec::Stacking { stack } => stack.pairs().any(|(name, _)| is_mixture(name)),
            _ => false,
        });
        if !given && self.stacking.mixtures != Some(true) {
            return Ok(());
        }
        if self.stacking.mixtures == Some(true) && self.whole_layers() {
            let expected = "model = \"transport\" without layer-step-mm: no other search knows mixtures";
            return Err(self.refuse("stacking.mixtures", "true".to_owned(), expected));
        }
        for format in &self.output.formats {
            let expected = match format {
                format if format.holds_voxels() => continue,
                OutputFormat::Masks if self.stacking.mixtures == Some(true) => continue,
                OutputFormat::Masks => "stacking.mixtures = true, for masks of dithered voxels",
                _ => "formats of voxels, as \"png\": a layer that is a mixture has grains, no mesh or map",
            };
            let found = format!("\"{}\" of layers that are mixtures", format.name());
            return Err(self.refuse("output.formats", found, expected));
        }
        Ok(())
    }

    /// Checks that every resin the job names is one of `names`: in stacks, limits, core and background.
    ///
    /// # Errors
    /// [`JobError::UnknownName`] for the first that is not, with the nearest name.
    pub fn check_resins(&self, names: &[&str]) -> Result<(), JobError> {
        for (index, object) in self.objects.iter().enumerate() {
            if let TargetSpec::Stacking { stack } = &object.target {
                let own = format!("object[{index}].target.stack");
                let key = if self.places.contains_key(&own) { own } else { "target.stack".to_owned() };
                for (name, _) in stack.pairs() {
                    let parts = Mixture::parts_of_name(name).ok_or_else(|| self.refuse(&key, quoted(name), SHARES))?;
                    parts.iter().try_for_each(|(resin, _)| self.check_name("resin", &key, resin, names))?;
                    let even = (parts.iter().map(|part| part.1).sum::<f64>() - 1.0).abs() <= 1e-6;
                    if !even || parts.iter().any(|part| part.1 < 0.0) {
                        return Err(self.refuse(&key, quoted(name), SHARES));
                    }
                    if parts.len() > 1 && parts.iter().any(|part| part.0 == SUPPORT) {
                        return Err(self.refuse(&key, quoted(name), "support by itself: its grains would wash off"));
                    }
                }
            }
        }
        for (index, limit) in self.stacking.limits.iter().enumerate() {
            let key = format!("stacking.limit[{index}].resin");
            // Support's default limit stands in no job, and a set without support has no use for it.
            if self.places.contains_key(&key) {
                self.check_name("resin", &key, &limit.resin, names)?;
            }
        }
        let core = self.stacking.core_name();
        if self.places.contains_key("stacking.core") {
            self.check_name("resin", "stacking.core", core, names)?;
        } else if !names.contains(&core) {
            return Err(self.refuse_core());
        }
        let mut background = self.output.map_background.iter();
        background.try_for_each(|resin| self.check_name("resin", "output.background-as", resin, names))
    }

    /// The error of a job that leaves the core to its default where there is no such resin.
    pub(super) fn refuse_core(&self) -> JobError {
        let found = format!("no core, and no resin called `{}` to stand in for it", self.stacking.core_name());
        self.refuse("stacking.core", found, "the resin that fills the inside below the stacking")
    }

    /// Checks that the built-in set the job asks for, if it does, is one of `names`.
    ///
    /// # Errors
    /// [`JobError::UnknownName`] with the nearest name.
    pub fn check_material_set(&self, names: &[&str]) -> Result<(), JobError> {
        match &self.materials {
            MaterialSource::Set(set) => self.check_name("material set", "materials.set", set, names),
            MaterialSource::File(_) => Ok(()),
        }
    }

    fn check_name(&self, kind: &'static str, key: &str, name: &str, names: &[&str]) -> Result<(), JobError> {
        if names.contains(&name) {
            return Ok(());
        }
        let hint = hint(name, names.iter().copied());
        Err(JobError::UnknownName { place: self.place(key), key: key.to_owned(), kind, found: excerpt(name), hint })
    }

    /// Where `key` (as `output.mesh-pitch-mm` or `object[0].mesh`) stands in the job file; for one that the job leaves
    /// to its default the nearest table around it, else the file's start.
    pub fn place(&self, key: &str) -> Place {
        let mut around = key;
        loop {
            if let Some(place) = self.places.get(around) {
                return place.clone();
            }
            match around.rfind(['.', '[']) {
                Some(end) => around = &around[..end],
                None => return Place { file: path_line(&self.path).into(), line: 1, column: 1 },
            }
        }
    }

    /// An error about `key` that shows only once the inputs are read, as a mesh too large for the tray.
    pub fn refuse(&self, key: &str, found: impl Into<String>, expected: impl Into<String>) -> JobError {
        JobError::Value { place: self.place(key), key: key.to_owned(), found: found.into(), expected: expected.into() }
    }

    /// The job with every default spelt out, for the manifest. Paths stay as written; an absolute one is shown by its
    /// file name alone.
    pub fn resolved(&self) -> ResolvedJob {
        resolved::resolve(self)
    }
}
