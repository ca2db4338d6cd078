//! The inputs of a job: read, digested, placed on the lattice, and refused where that needs no search.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glam::{DMat4, DVec3};

use super::{
    checks,
    factored::FactoredMap,
    image_checks,
    object::bounds,
    solids::{bodies, load_solids},
};
use crate::{
    job::{
        Job, RunError,
        file::{AlbedoSource, InputPath, MaterialSource, StackingModel, TargetSpec},
    },
    mesh::Solid,
    optics::{MaterialFile, MaterialSet, OpticsError},
    output::digest,
    voxel::Lattice,
    watch::{StopOnly, Watch},
};

/// A job with its meshes on the lattice and nothing searched.
pub(super) struct Placed {
    pub inputs: Inputs,
    pub draft: MaterialDraft,
    /// Its objects, each with the way from its file's coordinates to the lattice's.
    pub solids: Vec<(Solid, DMat4)>,
    /// Those that touch or share space, by their numbers.
    pub touching: Vec<Vec<usize>>,
    /// Those of them that are one body, which depth is measured from.
    pub bodies: Vec<Vec<usize>>,
    pub lattice: Lattice,
    pub warnings: Vec<String>,
}

impl Placed {
    /// Reads the inputs and refuses what can be refused without a search.
    pub fn new(job: &Job, watch: &dyn Watch) -> Result<Self, RunError> {
        let mut warnings = Vec::new();
        let mut inputs = read_inputs(job)?;
        let draft = read_materials(job)?;
        checks::resins(job, &checks::requested(job, &draft.resins()))?;
        if let MaterialSource::File(named) = &job.materials {
            for path in draft.file.profile_files() {
                add_input(&mut inputs, named.beside(path), path)?;
            }
        }
        image_checks::images(job, &mut warnings)?;
        watch.stage("meshes", job.objects.len() as u64);
        let (loaded, touching) = load_solids(job, &mut warnings, watch)?;
        let bodies = bodies(job, &touching);
        let mut solids = Vec::new();
        for (object, (solid, transform, companions)) in job.objects.iter().zip(loaded) {
            for path in companions {
                add_input(&mut inputs, object.mesh.beside(&path), &path)?;
            }
            solids.push((solid, transform));
        }
        let extent = solids.iter().fold(DVec3::ZERO, |extent, solid| extent.max(bounds(&solid.0)[1]));
        let lattice = Lattice::covering(extent, job.printer.pitch_mm)?;
        checks::formats(job, &lattice, &mut warnings)?;
        Ok(Self { inputs, draft, solids, touching, bodies, lattice, warnings })
    }
}

/// Digests of files and where they lie, by their paths as shown.
pub(super) type Inputs = BTreeMap<String, (String, PathBuf)>;

fn add_input(inputs: &mut Inputs, shown: String, path: &Path) -> Result<(), RunError> {
    if let std::collections::btree_map::Entry::Vacant(entry) = inputs.entry(shown) {
        let sha256 = digest(path).map_err(|source| OpticsError::File { file: path.to_path_buf(), source })?;
        entry.insert((sha256, path.to_path_buf()));
    }
    Ok(())
}

/// Digests of all files the job names; those that these name are added once they are read.
fn read_inputs(job: &Job) -> Result<Inputs, RunError> {
    let mut files = Inputs::new();
    let mut add = |shown: String, path: &Path| add_input(&mut files, shown, path);
    for object in &job.objects {
        add(object.mesh.shown(), object.mesh.as_ref())?;
        for path in object.target.files() {
            add(path.shown(), path.as_ref())?;
        }
        if let TargetSpec::Bssrdf { map, .. } = &object.target {
            for file in FactoredMap::files(map.as_ref())? {
                add(format!("{}/{file}", map.shown().trim_end_matches('/')), &map.as_ref().join(&file))?;
            }
        }
    }
    if let MaterialSource::File(path) = &job.materials {
        add(path.shown(), path.as_ref())?;
    }
    Ok(files)
}

/// Materials as far as they can be checked quickly.
pub(super) struct MaterialDraft {
    file: MaterialFile,
    built_in: bool,
}

/// Reads the materials and checks every resin that the job names.
pub(super) fn read_materials(job: &Job) -> Result<MaterialDraft, RunError> {
    let draft = match &job.materials {
        MaterialSource::Set(name) => {
            job.check_material_set(&MaterialSet::builtin_names().collect::<Vec<_>>())?;
            MaterialDraft { file: MaterialFile::builtin(name)?, built_in: true }
        }
        MaterialSource::File(path) => MaterialDraft { file: MaterialFile::read(path.as_ref())?, built_in: false },
    };
    let names: Vec<_> = draft.resins().into_iter().map(|resin| resin.0).collect();
    job.check_resins(&names)?;
    Ok(draft)
}

impl MaterialDraft {
    /// The resins' names, each with whether it is printed, as the background is not.
    fn resins(&self) -> Vec<(&str, bool)> {
        self.file.resins_printed().collect()
    }
}

/// Simulates the resins that come without profiles, and fits coefficients to those that come with nothing else if the
/// job's model asks for them.
pub(super) fn finish_materials(draft: MaterialDraft, job: &Job, watch: &dyn Watch) -> Result<MaterialSet, RunError> {
    let MaterialDraft { mut file, built_in } = draft;
    let watch = StopOnly(watch);
    if !built_in && job.stacking.model != StackingModel::KubelkaMunk {
        file.fit(None, &watch)?;
    }
    Ok(file.into_set(&watch)?)
}

impl TargetSpec {
    /// Files the target names.
    fn files(&self) -> Vec<&InputPath> {
        match self {
            Self::Stacking { .. } => Vec::new(),
            Self::Profile { paths } => paths.iter().collect(),
            Self::Texture(texture) => {
                let albedo = if let AlbedoSource::Texture(path) = &texture.albedo { Some(path) } else { None };
                albedo.into_iter().chain(&texture.mean_free_path).collect()
            }
            Self::Clusters { labels, profiles } => std::iter::once(labels).chain(profiles.iter().flatten()).collect(),
            Self::Bssrdf { .. } => Vec::new(), // a folder; see [`read_inputs`]
        }
    }
}
