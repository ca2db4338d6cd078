//! From a job to objects on a lattice: everything that is done before the first slice.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use glam::DMat4;
use serde::Serialize;

use super::{
    CHANNELS, ObjectPlan, checks,
    context::TargetContext,
    object::{PreparedObject, bounds},
    placed::{Placed, finish_materials},
    solids::complete_uvs,
    stackings::{ObjectLayers, object_layers},
};
use crate::{
    job::{
        Job, RunError,
        file::{DepthFrom, Distance, MaterialSource, ObjectJob, OutputFormat, StackingModel, TargetSpec},
        record::Rounds,
    },
    mesh::Solid,
    optics::{Grains, MaterialSet, ResinId},
    sdf::Surface,
    slice::{DistanceKind, ObjectField, Palette, Slicer, join},
    voxel::{Lattice, MaterialId, ThresholdMask},
    watch::Watch,
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

/// What objects are laid by.
struct Ground<'a> {
    job: &'a Job,
    materials: &'a MaterialSet,
    bodies: &'a [Vec<usize>],
    lattice: Lattice,
    watch: &'a dyn Watch,
}

/// Objects with their layers, and what these can be corrected from.
#[derive(Default)]
struct Laid {
    objects: Vec<PreparedObject>,
    fields: Vec<ObjectField>,
    plans: Vec<ObjectPlan>,
}

impl Ground<'_> {
    /// Whether stackings are searched for among mixtures.
    fn mixes(&self) -> bool {
        let searched = |object: &ObjectJob| !matches!(object.target, TargetSpec::Stacking { .. });
        self.job.allows_mixtures() && self.job.objects.iter().any(searched)
    }

    /// Finds the layers of all objects.
    fn lay(&self, solids: Vec<(Solid, DMat4)>, warnings: &mut Vec<String>) -> Result<Laid, RunError> {
        let &Self { job, materials, bodies, lattice, watch } = self;
        let mut laid = Laid::default();
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
            let context = TargetContext { job, materials, solid: &solid, body, has_uvs, object: index, watch };
            let ObjectLayers { layers, report: stackings, asked, plan } =
                object_layers(&context, &object.target, warnings)?;
            watch.go_on()?;
            let field = ObjectField::new(plan.as_ref().map_or(&solid, |plan| plan.solid()), lattice, layers)
                .ok_or_else(|| job.refuse(&format!("object[{index}].mesh"), "no triangles", "a solid"))?;
            laid.fields.push(field);
            let (mesh, health) = (object.mesh.shown(), solid.health);
            laid.plans.extend(plan);
            laid.objects.push(PreparedObject { mesh, transform, health, bounds, is_patch, stackings, asked });
        }
        Ok(laid)
    }
}

impl Prepared {
    /// Reads the inputs of `job`, searches the stackings, builds the fields: a job as it is before its print was looked
    /// at, see [`Prepared::new`].
    ///
    /// # Errors
    /// Any input that cannot be used; see [`RunError`].
    pub fn draft(mut job: Job, watch: &dyn Watch) -> Result<Self, RunError> {
        let started = Instant::now();
        let Placed { inputs, draft, solids, touching, bodies, lattice, mut warnings } = Placed::new(&job, watch)?;
        if job.must_fit {
            let sizes =
                solids.iter().zip(&job.objects).map(|((solid, _), object)| (object.mesh.shown(), bounds(solid)));
            checks::refuse_misfits(&job, &checks::misfits(&job, &sizes.collect::<Vec<_>>()))?;
        }
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
        let ground = Ground { job: &job, materials: &materials, bodies: &bodies, lattice, watch };
        // Making the mask of thresholds and reading textures take as long, and neither runs in parallel.
        let (laid, _mask) = rayon::join(
            || ground.lay(solids, &mut warnings),
            || ground.mixes().then(|| ThresholdMask::shared(lattice.pitch)),
        );
        let Laid { objects, mut fields, plans } = laid?;
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
        warnings.extend(checks::whole_fractions(&job, &slicer));
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
        let Placed { solids, lattice, mut warnings, .. } = Placed::new(job, watch)?;
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

/// The faces of all objects of a body.
fn faces_of(body: &[usize], solids: &[(Solid, DMat4)]) -> Option<Surface> {
    Surface::of_triangles(body.iter().flat_map(|&object| solids[object].0.mesh.corners()).collect())
}

/// Colours of the ids; a resin that prints as background is transparent.
fn palette(materials: &MaterialSet) -> Palette {
    let mut palette = [[0; 4]; 256];
    for (index, resin) in materials.resins.iter().enumerate().filter(|(_, resin)| !resin.print_as_background) {
        palette[usize::from(MaterialId::from_resin(index).0)] = resin.rgba;
    }
    palette
}

impl Job {
    /// Whether the job asks for `format`.
    pub fn wants(&self, format: OutputFormat) -> bool {
        self.output.formats.contains(&format)
    }
}
