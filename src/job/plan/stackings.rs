//! From what an object should look like to the layers that do it.

use glam::DVec3;

use super::{
    GamutMapEntry, LayerMaps, SearchEntry, StackingEntry, StackingReport, TransportEntry,
    answers::Answers,
    asked::{AskedMap, Surface, wanted},
    context::TargetContext,
    gamut_mapping::Mapped,
    lattice::CHANNELS,
    on_surface::{Laid, ObjectPlan},
};
use crate::{
    appearance::{
        AlignedStackings, Atlas, HeightFields, LabelMap, LayerField, LayerStack, SlotTable, TexturedLayers,
        align_mixtures,
    },
    job::{
        Job, RunError,
        file::{DepthFrom, OutputFormat, StackingModel, TargetSpec},
    },
    numeric::rounding::{four_digits, rounded},
    optics::{Mixture, OpticsError, ResinId, Stack},
    parallel,
    search::{Found, Matcher, RefineOptions, SearchTarget, far_glow, far_miss},
};

/// Share of a surface whose glow must be far off for a warning.
const OTHER_GLOW: f64 = 0.05;

/// What an object's target became.
pub(super) struct ObjectLayers {
    pub layers: LayerField,
    pub report: StackingReport,
    pub asked: AskedMap,
    /// What it is laid from where its layers depend on more than its texture.
    pub plan: Option<ObjectPlan>,
}

/// Turns the target of an object into its layers, with what was asked for where.
pub(super) fn object_layers(
    context: &TargetContext<'_>,
    target: &TargetSpec,
    warnings: &mut Vec<String>,
) -> Result<ObjectLayers, RunError> {
    let core = context.core()?;
    if let TargetSpec::Stacking { stack } = target {
        let stacking = context.materials.mixed_stack(stack)?;
        let stacking = Stack::joined(stacking.layers.into_iter().map(|layer| (layer.resin, layer.thickness_mm)));
        let stacking = stacking.over(Mixture::from(core));
        let entry = context.entry(&stacking, 1.0, &reflection(context, &stacking)?);
        let (layers, report) = context.uniform("stacking", &stacking, core, entry);
        return Ok(ObjectLayers { layers, report, asked: AskedMap::default(), plan: None });
    }
    let wanted = wanted(context, target, warnings)?;
    let mut mapped = context.gamut_map(core, &wanted, warnings)?;
    let found = mapped.as_mut().and_then(|mapped| mapped.found.take());
    let targets = mapped.as_ref().map_or(&wanted.targets, |mapped| &mapped.targets);
    let matches = found.map_or_else(|| context.search(core, targets), Ok)?;
    let told = parallel::map(matches.len(), |index| {
        let (found, asked) = (&matches[index], &wanted.targets[index]);
        let glow = (wanted.shares[index], asked.far_radius(found.reflection(), &context.materials.grid));
        let mut entry = context.matched_entry(found, &targets[index], wanted.shares[index], wanted.rms[index]);
        if let Some(Mapped { map, .. }) = &mapped {
            entry.target_albedo = Some(asked.channels.iter().map(|channel| channel[0]).collect());
            let objective = context.job.stacking.objective.of(found.reflection(), asked);
            entry.gamut_map = Some(GamutMapEntry::new(&map.moves[index], objective));
        }
        (glow, entry)
    });
    let (glows, mut entries): (Vec<_>, Vec<_>) = told.into_iter().unzip();
    let is_mapped = context.job.objects[context.object].gamut_map;
    let misses = out_of_reach(&entries, is_mapped).into_iter().chain(other_glow(&glows, is_mapped));
    warnings.extend(misses.map(|words| format!("object {}: {words}", context.object + 1)));
    let mut asked = wanted.map;
    asked.targets = wanted.targets;
    if let (true, Surface::Labelled { atlas, labels }) = (context.follows_patch(), &wanted.surface) {
        context.watch.stage("light between texels", 0);
        asked.show_by_equation_7(atlas, labels, &context.solid.mesh, &context.materials.grid);
        context.watch.go_on()?;
    }
    let stackings: Vec<_> = matches.iter().map(Found::stacking).collect();
    if context.follows_the_surface(&asked) {
        let answers = Answers::new(context, &stackings)?;
        let solid = context.solid.clone();
        let plan = ObjectPlan::new(context, solid, wanted.kind, wanted.surface, &mut asked, answers)?;
        if let Some(plan) = plan {
            let context = TargetContext { solid: plan.solid(), ..*context };
            let none = vec![[0.0; CHANNELS]; plan.points.points().len()];
            let laid = plan.lay(context.job.thin_parts(), &none, &asked, context.watch)?;
            let (layers, report) = context.laid(&plan, &laid, entries)?;
            return Ok(ObjectLayers { layers, report, asked, plan: Some(plan) });
        }
        return Err(context.refuse("object", "no triangles", "a solid"));
    }
    let (layers, report) = match &wanted.surface {
        Surface::Uniform => {
            let entry = entries.remove(0);
            context.uniform(wanted.kind, &stackings[0], core, entry)
        }
        Surface::Labelled { atlas, labels } => {
            let (layers, report) = context.textured(wanted.kind, atlas, labels, &stackings, entries, core)?;
            (context.parted(layers, &report), report)
        }
    };
    Ok(ObjectLayers { layers, report, asked, plan: None })
}

/// How much of the surface comes out lighter or darker than asked, if any does.
fn out_of_reach(entries: &[StackingEntry], is_mapped: bool) -> Option<String> {
    let off = |entry: &StackingEntry| {
        let asked = entry.target_albedo.iter().flatten();
        far_miss(asked.zip(&entry.predicted_albedo).map(|(asked, found)| [*asked, *found]))
    };
    let far: Vec<_> = entries.iter().filter_map(|entry| Some((entry.share, off(entry)?))).collect();
    let share: f64 = far.iter().map(|(share, _)| share).sum();
    let [asked, found] = far_miss(far.into_iter().map(|(_, pair)| pair))?;
    Some(format!(
        "{:.0}% of the surface comes out with another albedo than asked, at most {found:.2} in place of {asked:.2}: \
         the resins reach no nearer, {}",
        100.0 * share,
        cure(is_mapped)
    ))
}

/// What helps where resins reach no nearer.
fn cure(is_mapped: bool) -> &'static str {
    match is_mapped {
        true => "after gamut-map too: see the job's gamut, other resins, and dc-weight",
        false => "see the job's gamut, gamut-map and dc-weight",
    }
}

/// How much of the surface glows wider or narrower than asked, if more than [`OTHER_GLOW`] does: `glows` are shares
/// of the surface with the half-energy radii, mm, asked for and found that are far apart.
fn other_glow(glows: &[(f64, Option<[f64; 2]>)], is_mapped: bool) -> Option<String> {
    let far: Vec<_> = glows.iter().filter_map(|(share, radii)| Some((share, (*radii)?))).collect();
    let share: f64 = far.iter().map(|(share, _)| *share).sum();
    let is_narrower = |(_, [asked, found]): &(&f64, [f64; 2])| found < asked;
    let how = match far.iter().filter(|glow| is_narrower(glow)).count() {
        0 => "wider",
        narrower if narrower == far.len() => "narrower",
        _ => "wider or narrower",
    };
    let [asked, found] = far_glow(far.into_iter().map(|(_, radii)| radii))?;
    (share > OTHER_GLOW).then(|| {
        format!(
            "{:.0}% of the surface glows {how} than asked, at most with a half-energy radius of {found:.2} mm in place of \
             {asked:.2} mm: beside the albedo the resins reach no nearer, {}",
            100.0 * share,
            cure(is_mapped)
        )
    })
}

/// R̂ per channel of a stacking that was given.
fn reflection(context: &TargetContext<'_>, stacking: &Stack<Mixture>) -> Result<Vec<Vec<f64>>, RunError> {
    let found = context.job.stacking.judge().reflection(context.materials, stacking);
    found.map_err(|error| match error {
        OpticsError::NoCoefficients { resin } => context.lacks_coefficients(&resin),
        error => error.into(),
    })
}

/// Thinnest layer of whole slices in a gamut.
const FINEST_STEP_MM: f64 = 0.025;

impl Job {
    /// The layers that the stackings of an object may have: by transport at least as thick as a voxel is long in any
    /// direction that a surface faces, unless the job says otherwise or dithers their boundaries; by Kubelka–Munk whole
    /// slices, though not finer than tells anything apart.
    pub fn layer_options(&self, object: usize) -> RefineOptions {
        let pitch = self.printer.pitch_mm;
        let from_top = self.objects.get(object).is_some_and(|object| object.depth_from == DepthFrom::Top);
        let (min_layer_mm, step_mm) = match self.stacking.model {
            StackingModel::KubelkaMunk => {
                let slice_mm = pitch.z.max(FINEST_STEP_MM);
                (slice_mm, Some(slice_mm))
            }
            StackingModel::Transport { min_layer_mm, layer_step_mm } => {
                let voxel_mm = if from_top { pitch.z } else { pitch.max_element() };
                (min_layer_mm.unwrap_or(voxel_mm), layer_step_mm)
            }
        };
        let stated = matches!(self.stacking.model, StackingModel::Transport { min_layer_mm: Some(_), .. });
        // A quick look says the minimum itself, by its larger voxels.
        let thin_below_mixtures = self.dithers(object) && (self.is_coarse || !stated);
        RefineOptions { min_layer_mm, step_mm, thin_below_mixtures, side_by_side: true, ..RefineOptions::default() }
    }
}

impl TargetContext<'_> {
    /// One stacking for each target.
    pub(super) fn search(&self, core: ResinId, targets: &[SearchTarget]) -> Result<Vec<Found>, RunError> {
        self.watch.stage("stackings", targets.len() as u64);
        let (options, cache) = (self.match_options(core), self.job.search_cache.as_ref());
        let found = Matcher::matched(self.materials, &options, targets, self.watch, cache);
        found.map_err(|source| self.search_fault(source))
    }

    /// Whether the layers of the object depend on how thick it is, or on how its print looks.
    fn follows_the_surface(&self, asked: &AskedMap) -> bool {
        let judged = self.job.stacking.model != StackingModel::KubelkaMunk;
        // Layer maps are of the texture that the job has.
        let free = !self.job.wants(OutputFormat::Heights);
        let follows = match self.job.objects[self.object].depth_from {
            DepthFrom::Surface => self.job.thin_parts() || self.job.rounds() > 0,
            // What profiles side by side are to show must be known.
            DepthFrom::Top => self.follows_patch() && (!self.target().is_of_profiles() || asked.is_shown()),
        };
        judged && free && follows
    }

    /// Whether it is a patch, and is to be corrected.
    fn follows_patch(&self) -> bool {
        self.job.is_patch(self.object, self.solid) && self.job.rounds() > 0
    }

    fn target(&self) -> &TargetSpec {
        &self.job.objects[self.object].target
    }

    /// The layers that a plan lays; `entries` are those of its clusters.
    pub(super) fn laid(
        &self,
        plan: &ObjectPlan,
        laid: &Laid,
        entries: Vec<StackingEntry>,
    ) -> Result<(LayerField, StackingReport), RunError> {
        let stackings: Vec<_> = plan.stackings().chain(laid.stackings().cloned()).collect();
        let core = self.core()?;
        if let ([stacking], [entry]) = (&stackings[..], &entries[..]) {
            return Ok(self.uniform(plan.kind, stacking, core, entry.clone()));
        }
        let (layers, report) = self.textured(plan.kind, plan.atlas(), &laid.labels, &stackings, entries, core)?;
        let report = StackingReport { variants: laid.variants(plan, self), ..report };
        Ok((self.parted(layers, &report), report))
    }

    fn entry(&self, stacking: &Stack<Mixture>, share: f64, reflection: &[Vec<f64>]) -> StackingEntry {
        // A slot that a stacking skips is no layer of it.
        let laid = Stack::joined(stacking.pairs().map(|(mixture, mm)| (mixture.clone(), mm)));
        StackingEntry {
            layers: self.materials.named(&laid).layers,
            share,
            target_albedo: None,
            predicted_albedo: reflection.iter().map(|channel| rounded(channel[0])).collect(),
            search: None,
            cluster_rms: None,
            gamut_map: None,
        }
    }

    fn matched_entry(&self, found: &Found, target: &SearchTarget, share: f64, rms: Option<f64>) -> StackingEntry {
        let coefficients: usize = target.channels.iter().map(Vec::len).sum();
        let rms_of = |objective: f64| four_digits((objective / coefficients as f64).sqrt());
        let Found { search, refined, .. } = found;
        // Of whole units, where such were searched.
        let objective = search.as_ref().map_or(found.objective(), |search| search.objective);
        StackingEntry {
            target_albedo: Some(target.channels.iter().map(|channel| rounded(channel[0])).collect()),
            search: Some(SearchEntry {
                objective: four_digits(objective),
                rms: rms_of(objective),
                bound: search.as_ref().map(|search| four_digits(search.bound)),
                proven: search.as_ref().map(|search| search.proven),
                nodes: search.as_ref().map(|search| search.nodes),
                transport: refined.as_ref().map(|refined| TransportEntry {
                    objective: four_digits(refined.objective),
                    rms: rms_of(refined.objective),
                    unrefined: four_digits(refined.unrefined),
                }),
            }),
            cluster_rms: rms,
            ..self.entry(&found.stacking(), share, found.reflection())
        }
    }

    fn uniform(
        &self,
        kind: &'static str,
        stacking: &Stack<Mixture>,
        core: ResinId,
        entry: StackingEntry,
    ) -> (LayerField, StackingReport) {
        let parts = |mixture: &Mixture| mixture.parts().iter().map(|&(resin, share)| (self.id(resin), share)).collect();
        let layers: Vec<(Vec<_>, f64)> = stacking.pairs().map(|(mixture, mm)| (parts(mixture), mm)).collect();
        let ids = layers.iter().flat_map(|layer| &layer.0).map(|part| part.0).chain([self.id(core)]).collect();
        let report = StackingReport {
            kind: kind.to_owned(),
            sequence: Vec::new(),
            stackings: vec![entry],
            variants: Vec::new(),
            core: self.materials[core].name.clone(),
            ids,
            maps: LayerMaps::default(),
        };
        (LayerField::Uniform(LayerStack::with_mixtures(layers, self.id(core))), report)
    }

    /// The layers of `labels`, each of which has a stacking.
    fn textured(
        &self,
        kind: &'static str,
        atlas: &Atlas,
        labels: &[LabelMap],
        stackings: &[Stack<Mixture>],
        entries: Vec<StackingEntry>,
        core: ResinId,
    ) -> Result<(LayerField, StackingReport), RunError> {
        self.watch.stage("layers", 0);
        let aligned = align_mixtures(stackings);
        let id = |resin| self.id(resin);
        let slots = SlotTable::with_mixtures(id, &aligned, &self.limits(), self.id(core)).ok_or_else(|| {
            let found = format!("stackings that need {} slots", aligned.sequence.len());
            self.refuse("stacking.depth", found, "stackings that align within 64 slots: a smaller depth")
        })?;
        let layers = TexturedLayers::new(&self.solid.mesh, atlas, labels, slots);
        let report = StackingReport {
            kind: kind.to_owned(),
            sequence: slots_of(&aligned).map(|resins| self.names(resins)).collect(),
            stackings: entries,
            variants: Vec::new(),
            core: self.materials[core].name.clone(),
            ids: slots_of(&aligned).flatten().map(|&resin| self.id(resin)).chain([self.id(core)]).collect(),
            maps: self.maps(&aligned, atlas, labels),
        };
        Ok((LayerField::Textured(Box::new(layers)), report))
    }

    /// Layers of profiles side by side, with borders where these differ much. Layer maps know none.
    fn parted(&self, layers: LayerField, report: &StackingReport) -> LayerField {
        let LayerField::Textured(layers) = layers else { return layers };
        if !self.target().is_of_profiles() || self.job.wants(OutputFormat::Heights) {
            return LayerField::Textured(layers);
        }
        let labels = report.stackings.len() + report.variants.len();
        let entry = |label: usize| report.stackings.get(usize::from(report.cluster_of(label as u16)));
        let asked = |label: usize| entry(label).and_then(|entry| entry.target_albedo.clone()).unwrap_or_default();
        LayerField::Textured(Box::new(layers.parted(&(0..labels).map(asked).collect::<Vec<_>>())))
    }
}

/// The resins of every slot.
fn slots_of(aligned: &AlignedStackings) -> impl Iterator<Item = &[ResinId]> {
    (0..aligned.sequence.len()).map(|slot| aligned.resins(slot))
}

impl TargetContext<'_> {
    /// Resins in words.
    fn names(&self, resins: &[ResinId]) -> String {
        resins.iter().map(|&resin| self.materials[resin].name.as_str()).collect::<Vec<_>>().join(" + ")
    }

    /// The layers as height fields, if the job wants them.
    fn maps(&self, aligned: &AlignedStackings, atlas: &Atlas, labels: &[LabelMap]) -> LayerMaps {
        if !self.job.wants(OutputFormat::Heights) {
            return LayerMaps::default();
        }
        let limits = self.limits();
        let pages = atlas
            .pages()
            .iter()
            .zip(labels)
            .map(|(page, labels)| HeightFields::new(aligned, &limits, &labels.0, page.width as usize, 1));
        // A slab seen from above: the map lies over it.
        let flat = self.job.objects[self.object].depth_from == DepthFrom::Top;
        let pitch_mm = atlas.pages().first().filter(|_| flat).map(|page| {
            let size = self
                .solid
                .mesh
                .positions
                .iter()
                .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(*p), high.max(*p)]);
            let size = size[1] - size[0];
            [size.x / f64::from(page.width), size.y / f64::from(page.height)]
        });
        let resins = self.materials.resins.iter().map(|resin| resin.name.clone()).collect();
        LayerMaps { pages: pages.collect(), resins, pitch_mm }
    }
}
