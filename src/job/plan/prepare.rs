//! From a job to objects on a lattice: everything that is done before the first slice.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use glam::{DMat4, DVec3};
use serde::Serialize;

use super::{
    CHANNELS, ObjectPlan,
    arrange::arrange,
    checks,
    context::TargetContext,
    factored::FactoredMap,
    images::picture_size,
    object::{PreparedObject, bounds},
    stackings::{ObjectLayers, object_layers},
};
use crate::{
    job::{
        Job, RunError,
        file::{
            AlbedoSource, DepthFrom, Distance, InputPath, MaterialSource, ObjectJob, OutputFormat, Overlap, Projection,
            Scaling, StackingModel, TargetSpec,
        },
        record::Rounds,
    },
    mesh::{self, InCommon, LoadOptions, Placement, Size, Solid},
    optics::{Grains, MaterialFile, MaterialSet, OpticsError, ResinId},
    output::digest,
    sdf::Surface,
    slice::{DistanceKind, ObjectField, Palette, Slicer, join},
    voxel::{Lattice, MaterialId},
    watch::{StopOnly, Watch},
    words::{counted, short},
};

/// A job with everything read, matched and placed; slicing can begin.
#[derive(Debug)]
pub struct Prepared {
    /// The job.
    pub job: Job,
    /// Its resins.
    pub materials: MaterialSet,
    /// Its voxels.
    pub lattice: Lattice,
    /// Its objects, in the order of the job.
    pub objects: Vec<PreparedObject>,
    /// Colour of every material id in slices; the background and what prints as background are transparent.
    pub palette: Palette,
    /// Files that were read.
    pub inputs: Vec<InputFile>,
    /// What the user should know, a sentence each.
    pub warnings: Vec<String>,
    /// What rounds of correction found; `None` where there were none.
    pub rounds: Option<Rounds>,
    /// What the objects are laid from that can still be corrected.
    pub(in crate::job) plans: Vec<ObjectPlan>,
    /// What preparing took.
    pub(in crate::job) took: Took,
    /// Objects that touch or share space, by their numbers; each is in one of these at most.
    pub(in crate::job) touching: Vec<Vec<usize>>,
    slicer: Slicer,
}

/// What preparing took; results do not depend on it.
#[derive(Debug, Clone, Default)]
pub(in crate::job) struct Took {
    /// All of it, the rounds among it.
    pub whole: Duration,
    /// Each round of correction: voxels, light, new layers.
    pub rounds: Vec<Duration>,
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct InputFile {
    /// As the job writes it.
    pub path: String,
    /// Lower-case hexadecimal digest.
    pub sha256: String,
    /// Where it was read.
    #[serde(skip)]
    pub file: PathBuf,
}

impl Prepared {
    /// Reads the inputs of `job`, searches the stackings, builds the fields: a job as it is before its print was looked
    /// at, see [`Prepared::new`].
    ///
    /// # Errors
    /// Any input that cannot be used; see [`RunError`].
    pub fn draft(mut job: Job, watch: &dyn Watch) -> Result<Self, RunError> {
        let started = Instant::now();
        let Placed { inputs, draft, solids, touching, bodies, lattice, mut warnings } = place(&job, watch)?;
        watch.stage("materials", 0);
        let mut materials = finish_materials(draft, &job, watch)?;
        materials.grains = Grains::of_voxels(job.printer.pitch_mm.to_array());
        // What was done to the data of a built-in set is the same in every job, and stands in the manifest.
        if let MaterialSource::File(_) = job.materials {
            warnings.extend(materials.warnings.iter().map(|warning| format!("materials: {warning}")));
        }
        if let Some(resin) = materials.resins.iter().find(|resin| resin.volumes().is_none())
            && job.stacking.model != StackingModel::KubelkaMunk
        {
            warnings.push(format!(
                "stacking.model: \"km\" in place of \"transport\", which does not know resin {}",
                resin.name
            ));
            job.stacking.model = StackingModel::KubelkaMunk;
        }
        let distance = match job.field.distance {
            Distance::Exact => DistanceKind::Exact,
            Distance::Grid => DistanceKind::Grid,
            Distance::Lp { exponent } => DistanceKind::Lp { exponent },
        };
        if distance == DistanceKind::Grid && (job.wants(OutputFormat::Stl) || job.wants(OutputFormat::ThreeMf)) {
            warnings.push("material meshes use the exact distance: the grid's has steps".to_owned());
        }
        let mut objects = Vec::new();
        let mut fields = Vec::new();
        let mut plans = Vec::new();
        let faces: Vec<_> = bodies.iter().map(|body| faces_of(body, &solids)).collect();
        for (index, ((mut solid, transform), object)) in solids.into_iter().zip(&job.objects).enumerate() {
            let bounds = bounds(&solid);
            if object.depth_from == DepthFrom::Top && !solid.measure_from_top() {
                let found = "\"top\" of a mesh of which nothing looks up";
                return Err(job
                    .refuse(&format!("object[{index}].depth-from"), found, "a level or nearly level top")
                    .into());
            }
            let is_patch = job.is_patch(index, &solid);
            let has_uvs = complete_uvs(&mut solid, &object.target)?;
            let body = bodies.iter().position(|body| body.contains(&index)).and_then(|body| faces[body].as_ref());
            let context =
                TargetContext { job: &job, materials: &materials, solid: &solid, body, has_uvs, object: index, watch };
            let ObjectLayers { layers, report: stackings, asked, plan } =
                object_layers(&context, &object.target, &mut warnings)?;
            watch.go_on()?;
            let field = ObjectField::new(plan.as_ref().map_or(&solid, |plan| plan.solid()), lattice, layers)
                .ok_or_else(|| job.refuse(&format!("object[{index}].mesh"), "no triangles", "a solid"))?;
            fields.push(field);
            let (mesh, health) = (object.mesh.shown(), solid.health);
            plans.extend(plan);
            objects.push(PreparedObject { mesh, transform, health, bounds, is_patch, stackings, asked });
        }
        join(&mut fields, &bodies);
        let measured = |(index, field): (usize, ObjectField)| {
            let field = field.with_distance(distance);
            if job.dithers(index) { field.with_dithered_boundaries() } else { field }
        };
        let fields = fields.into_iter().enumerate().map(measured).collect();
        let sizes: Vec<_> = objects.iter().map(|object| (object.mesh.clone(), object.bounds)).collect();
        checks::tiny_objects(&job, &sizes, &lattice, &mut warnings)?;
        warnings.extend(checks::thin_layers(&job, &objects, &lattice));
        warnings.extend(checks::few_slices(&job, &lattice));
        let inputs = inputs.into_iter().map(|(path, (sha256, file))| InputFile { path, sha256, file }).collect();
        let palette = palette(&materials);
        let slicer = Slicer::new(lattice, fields);
        let took = Took { whole: started.elapsed(), rounds: Vec::new() };
        let prepared = Self {
            job,
            materials,
            lattice,
            objects,
            palette,
            inputs,
            warnings,
            rounds: None,
            plans,
            took,
            touching,
            slicer,
        };
        checks::resins(&prepared.job, &prepared.laid_resins())?;
        prepared.check_meshes()?;
        Ok(prepared)
    }

    /// Does what is quick of [`Prepared::draft`], all of it before the search: whatever is refused there, but for what
    /// stackings that were found come to. What comes back are warnings.
    ///
    /// # Errors
    /// As [`Prepared::draft`].
    pub fn check(job: &Job, watch: &dyn Watch) -> Result<Vec<String>, RunError> {
        let Placed { solids, lattice, mut warnings, .. } = place(job, watch)?;
        let sizes = solids.iter().zip(&job.objects).map(|((solid, _), object)| (object.mesh.shown(), bounds(solid)));
        let sizes: Vec<_> = sizes.collect();
        checks::tiny_objects(job, &sizes, &lattice, &mut warnings)?;
        checks::refuse_misfits(job, &checks::misfits(job, &sizes))?;
        warnings.extend(checks::few_slices(job, &lattice));
        Ok(warnings)
    }

    /// Lays an object anew, its albedo corrected by the logarithms of factors at the points of its plan. What comes
    /// back is by how much each label beside the clusters' own falls short of its factor.
    pub(in crate::job) fn lay_again(
        &mut self,
        plan: &ObjectPlan,
        ln_factors: &[[f64; CHANNELS]],
        watch: &dyn Watch,
    ) -> Result<Vec<[f64; CHANNELS]>, RunError> {
        let context = TargetContext {
            job: &self.job,
            materials: &self.materials,
            solid: plan.solid(),
            body: None,
            has_uvs: plan.has_uvs(),
            object: plan.object,
            watch,
        };
        let laid = plan.lay(self.job.thin_parts(), ln_factors, &self.objects[plan.object].asked, watch)?;
        let entries = self.objects[plan.object].stackings.stackings.clone();
        let (layers, report) = context.laid(plan, &laid, entries)?;
        let short = laid.short();
        self.objects[plan.object].stackings = report;
        let slicer = std::mem::replace(&mut self.slicer, Slicer::new(self.lattice, Vec::new()));
        let mut fields = slicer.into_objects();
        let field = fields.remove(plan.object).with_layers(layers, &plan.solid().mesh.uvs);
        fields.insert(plan.object, field);
        self.slicer = Slicer::new(self.lattice, fields);
        Ok(short)
    }

    /// The slicer.
    pub fn slicer(&self) -> &Slicer {
        &self.slicer
    }

    /// What of the job does not fit the printer, a sentence each; empty if everything does.
    pub fn misfits(&self) -> Vec<String> {
        let sizes: Vec<_> = self.objects.iter().map(|object| (object.mesh.clone(), object.bounds)).collect();
        checks::misfits(&self.job, &sizes)
    }

    /// Refuses what does not fit the printer.
    pub(in crate::job) fn refuse_misfits(&self) -> Result<(), RunError> {
        Ok(checks::refuse_misfits(&self.job, &self.misfits())?)
    }

    /// Names of the printed resins that may occur in stackings.
    fn laid_resins(&self) -> Vec<&str> {
        let used: Vec<_> = self.objects.iter().flat_map(|object| object.stackings.materials()).collect();
        let printed = self.printed().filter(|(id, _)| used.contains(id));
        printed.map(|(_, resin)| self.materials[resin].name.as_str()).collect()
    }

    /// Ids that stand for a printed resin, with that: all but the background and what prints as background.
    pub fn printed(&self) -> impl Iterator<Item = (MaterialId, ResinId)> {
        let ids = self.materials.ids().map(|resin| (MaterialId::from_resin(resin.0), resin));
        ids.filter(|(id, _)| self.palette[usize::from(id.0)][3] != 0)
    }
}

/// A job with its meshes on the lattice and nothing searched.
struct Placed {
    inputs: Inputs,
    draft: MaterialDraft,
    solids: Vec<(Solid, DMat4)>,
    /// Those that touch or share space, by their numbers.
    touching: Vec<Vec<usize>>,
    /// Those of them that are one body, which depth is measured from.
    bodies: Vec<Vec<usize>>,
    lattice: Lattice,
    warnings: Vec<String>,
}

/// Reads the inputs and refuses what can be refused without a search.
fn place(job: &Job, watch: &dyn Watch) -> Result<Placed, RunError> {
    let mut warnings = Vec::new();
    let mut inputs = read_inputs(job)?;
    let draft = read_materials(job)?;
    checks::resins(job, &checks::requested(job, &draft.resins()))?;
    if let MaterialSource::File(named) = &job.materials {
        for path in draft.file.profile_files() {
            add_input(&mut inputs, named.beside(path), path)?;
        }
    }
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
    Ok(Placed { inputs, draft, solids, touching, bodies, lattice, warnings })
}

/// The faces of all objects of a body.
fn faces_of(body: &[usize], solids: &[(Solid, DMat4)]) -> Option<Surface> {
    Surface::of_triangles(body.iter().flat_map(|&object| solids[object].0.mesh.corners()).collect())
}

/// Digests of files and where they lie, by their paths as shown.
type Inputs = BTreeMap<String, (String, PathBuf)>;

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

/// Objects of a body that are named.
const NAMED: usize = 2;

/// Objects read and placed: the solid, file coordinates to the lattice's, files read beside the mesh.
type Loaded = Vec<(Solid, DMat4, Vec<PathBuf>)>;

/// Reads all objects and leaves of them what is surface of their union; and which of them touch or share space, by
/// their numbers.
pub(super) fn load_solids(
    job: &Job,
    warnings: &mut Vec<String>,
    watch: &dyn Watch,
) -> Result<(Loaded, Vec<Vec<usize>>), RunError> {
    let mut loaded = Vec::new();
    for (index, object) in job.objects.iter().enumerate() {
        loaded.push(load_solid(job, index, object, warnings)?);
        watch.advance(1);
        watch.go_on()?;
    }
    if let Some(gap_mm) = job.arrange_gap_mm {
        arrange(job, gap_mm, &mut loaded);
    }
    let mut solids: Vec<&mut Solid> = loaded.iter_mut().map(|(solid, ..)| solid).collect();
    let InCommon { space: shared, bodies: touching } = mesh::unite(&mut solids);
    let name = |index: usize| format!("object {} ({})", index + 1, job.objects[index].mesh.shown());
    if let (Some(&[first, second]), Overlap::Refuse) = (shared.first(), job.overlap) {
        let found = format!("{} and {} at the same place", name(first), name(second));
        let expected = "objects that share no space, or overlap = \"union\"";
        return Err(job.refuse(&format!("object[{second}].position-mm"), found, expected).into());
    }
    for &[first, second] in &shared {
        warnings.push(format!(
            "{} and {} share space: they are one body, and a voxel is laid by the one whose face is nearest",
            name(first),
            name(second)
        ));
    }
    for body in bodies(job, &touching) {
        let said = |object: &usize| shared.iter().flatten().any(|other| other == object);
        if !body.iter().all(said) {
            let more = body.len().saturating_sub(NAMED);
            let names: Vec<_> = body.iter().take(NAMED).map(|&object| name(object)).collect();
            let names = if more == 0 { names.join(" and ") } else { names.join(", ") };
            let more = if more == 0 { String::new() } else { format!(" and {}", counted(more, "other")) };
            warnings.push(format!(
                "{names}{more} touch: they are one body, and a voxel is laid by the one whose face is nearest"
            ));
        }
    }
    if let Some(buried) = solids.iter().position(|solid| solid.mesh.triangles.is_empty()) {
        let found = format!("{}, which lies wholly within others", name(buried));
        let expected = "an object some of which can be seen";
        return Err(job.refuse(&format!("object[{buried}].mesh"), found, expected).into());
    }
    Ok((loaded, touching))
}

/// Of objects that touch those that depth is measured from together. Depth from the top is of an object by itself.
fn bodies(job: &Job, touching: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let from_surface = |&object: &usize| job.objects[object].depth_from == DepthFrom::Surface;
    let bodies = touching.iter().map(|body| body.iter().copied().filter(from_surface).collect::<Vec<_>>());
    bodies.filter(|body| body.len() > 1).collect()
}

fn load_solid(
    job: &Job,
    index: usize,
    object: &ObjectJob,
    warnings: &mut Vec<String>,
) -> Result<(Solid, DMat4, Vec<PathBuf>), RunError> {
    let loaded = mesh::load(object.mesh.as_ref(), &LoadOptions { unit: object.unit })?;
    let own_color =
        matches!(&object.target, TargetSpec::Texture(texture) if texture.albedo == AlbedoSource::MeshBaseColor);
    if let Some(lost) = loaded.lost_color.filter(|_| own_color) {
        let found = format!("{}: {lost}", object.mesh.shown());
        return Err(job
            .refuse("target", found, "the mesh's own base colour, or an albedo or albedo-value in its place")
            .into());
    }
    let mut warn = |warning: String| warnings.push(format!("{}: {warning}", object.mesh.shown()));
    // Texture files that the mesh names do not matter where the job brings its own.
    loaded.warnings.into_iter().for_each(&mut warn);
    let placement = Placement {
        size: match object.scaling {
            Scaling::Scale(scale) => Size::Scale(scale),
            Scaling::HeightMm(height) => Size::HeightMm(height),
        },
        rotate_deg: DVec3::from(object.rotate_deg),
        position_mm: DVec3::from(object.position_mm),
    };
    let in_file = |source| RunError::Shape { file: object.mesh.as_ref().to_owned(), source };
    let (placed, to_lattice) = mesh::place(loaded.mesh, &placement).map_err(in_file)?;
    let low = placed.positions.iter().fold(DVec3::MAX, |low, p| low.min(*p));
    if low.min_element() < 0.0 {
        let key = format!("object[{index}].position-mm");
        let found = format!("an object from ({}) mm", low.to_array().map(short).join(", "));
        return Err(job.refuse(&key, found, "a position on the tray, 0 or more in x, y and z").into());
    }
    let mut solid = mesh::close(placed).map_err(in_file)?;
    let settled = solid.settle(&placement);
    solid.health.warnings().into_iter().for_each(&mut warn);
    Ok((solid, settled * to_lattice * loaded.file_to_mesh, loaded.companions))
}

/// Gives a mesh without texture coordinates some, for nothing varies within a page then and any will do; whether it had
/// its own. Where the target is made of the mesh's colour, what is not a repeating texture becomes one.
pub(super) fn complete_uvs(solid: &mut Solid, target: &TargetSpec) -> Result<bool, RunError> {
    let had = !solid.mesh.uvs.is_empty();
    solid.mesh.uvs.resize(solid.mesh.triangles.len(), Default::default());
    let TargetSpec::Texture(texture) = target else { return Ok(had) };
    let size = |path: &InputPath| picture_size(path.as_ref());
    let detail = texture.mean_free_path.as_ref().map(size).transpose()?;
    if let Projection::Triplanar { tile_mm } = texture.projection {
        let albedo = if let AlbedoSource::Texture(path) = &texture.albedo { Some(size(path)?) } else { None };
        let widest = detail.into_iter().chain(albedo).map(|(width, _)| width).max();
        let has_albedo = texture.albedo != AlbedoSource::MeshBaseColor || !solid.mesh.materials.is_empty();
        if let Some(widest) = widest.filter(|_| has_albedo) {
            let [low, high] = bounds(solid);
            let tile_mm = tile_mm.unwrap_or((high - low).max_element());
            solid.mesh.bake_projection(tile_mm, f64::from(widest) / tile_mm);
            return Ok(had);
        }
    }
    if texture.albedo == AlbedoSource::MeshBaseColor {
        solid.mesh.bake_base_color(detail);
    }
    Ok(had)
}

/// Colours of the ids; a resin that prints as background is transparent.
fn palette(materials: &MaterialSet) -> Palette {
    let mut palette = [[0; 4]; 256];
    for (index, resin) in materials.resins.iter().enumerate().filter(|(_, resin)| !resin.print_as_background) {
        palette[usize::from(MaterialId::from_resin(index).0)] = resin.rgba;
    }
    palette
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

impl Job {
    /// Whether the job asks for `format`.
    pub fn wants(&self, format: OutputFormat) -> bool {
        self.output.formats.contains(&format)
    }
}
