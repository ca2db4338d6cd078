//! From what an object should look like to the layers that do it.

use super::{
    AlbedoSource, DepthFrom, GamutMapEntry, InputPath, Interrupt, Job, LayerEntry, OutputFormat, Progress, RunError,
    SearchEntry, StackingEntry, StackingModel, StackingReport, TargetSpec, TransportEntry,
    factored::FactoredMap,
    heights::LayerMaps,
    images::{read_labels, read_picture, srgb_to_linear, to_channels},
};
use glam::DVec3;

use crate::{
    mesh::Solid,
    optics::{Light, MaterialSet, ProfileFile, Transport, TransportOptions, VolumeCoefficients},
    search::{
        BlockTable, Gamut, GamutMap, Match, Move, RefineOptions, Refined, Refiner, ResinLimit, SearchError,
        SearchOptions, SearchTarget, Stacking, match_targets, reflection_of,
    },
    target::{
        self, AlignedStackings, AppearancePage, Atlas, HeightFields, LabelMap, LayerField, LayerStack,
        NormalizedDiffusion, SlotTable, TexturedLayers, align, cluster, distinct_appearances,
    },
    voxel::MaterialId,
};

/// What a search found, refined or not.
struct Found {
    search: Match,
    refined: Option<Refined>,
}

impl Found {
    fn stacking(&self) -> &Stacking {
        self.refined.as_ref().map_or(&self.search.stacking, |refined| &refined.stacking)
    }

    fn reflection(&self) -> &[Vec<f64>] {
        self.refined.as_ref().map_or(&self.search.reflection, |refined| &refined.reflection)
    }
}

/// What a target is turned into layers with.
pub(super) struct TargetContext<'a> {
    pub job: &'a Job,
    pub materials: &'a MaterialSet,
    /// Texture coordinates are there, if only as zeros.
    pub solid: &'a Solid,
    /// Whether the mesh file has texture coordinates.
    pub has_uvs: bool,
    pub object: usize,
    pub progress: &'a dyn Progress,
    pub interrupt: &'a Interrupt,
}

/// What an object asks for, before any search.
pub(super) struct Wanted {
    kind: &'static str,
    pub targets: Vec<SearchTarget>,
    /// Share of the surface that wants each.
    pub shares: Vec<f64>,
    /// How far the spectra of each cluster are from their mean; `None` where nothing was clustered.
    rms: Vec<Option<f64>>,
    surface: Surface,
}

/// Where which target is wanted.
enum Surface {
    Uniform,
    Labelled { atlas: Atlas, labels: Vec<LabelMap> },
}

/// Turns the target of an object into its layers.
pub(super) fn object_layers(
    context: &TargetContext<'_>,
    target: &TargetSpec,
    warnings: &mut Vec<String>,
) -> Result<(LayerField, StackingReport), RunError> {
    let core = context.core()?;
    if let TargetSpec::Stacking { layers } = target {
        let layers = layers.iter().filter_map(|(name, t)| Some((context.materials.resin(name)?.0, *t)));
        let stacking = Stacking::from_layers(layers);
        let entry = context.entry(&stacking, 1.0, &reflection(context, &stacking, core)?);
        return Ok(context.uniform("stacking", &stacking, core, entry));
    }
    let wanted = wanted(context, target, warnings)?;
    let map = context.gamut_map(core, &wanted, warnings)?;
    let targets = map.as_ref().map_or_else(|| wanted.targets.clone(), |map| context.mapped(map, &wanted.targets));
    let matches = context.search(core, &targets)?;
    let mut entries = Vec::with_capacity(matches.len());
    for (index, found) in matches.iter().enumerate() {
        let mut entry = context.matched_entry(found, &targets[index], wanted.shares[index], wanted.rms[index]);
        if let Some(map) = &map {
            entry.target_albedo = Some(wanted.targets[index].channels.iter().map(|channel| channel[0]).collect());
            let asked = context.job.stacking.objective.of(found.reflection(), &wanted.targets[index]);
            entry.gamut_map = Some(GamutMapEntry::new(&map.moves[index], asked));
        }
        entries.push(entry);
    }
    match &wanted.surface {
        Surface::Uniform => {
            let entry = entries.remove(0);
            Ok(context.uniform(wanted.kind, matches[0].stacking(), core, entry))
        }
        Surface::Labelled { atlas, labels } => context.textured(wanted.kind, atlas, labels, &matches, entries, core),
    }
}

/// What `target` asks for; nothing where it gives a stacking.
pub(super) fn wanted(
    context: &TargetContext<'_>,
    target: &TargetSpec,
    warnings: &mut Vec<String>,
) -> Result<Wanted, RunError> {
    match target {
        TargetSpec::Stacking { .. } => Ok(Wanted {
            kind: "stacking",
            targets: Vec::new(),
            shares: Vec::new(),
            rms: Vec::new(),
            surface: Surface::Uniform,
        }),
        TargetSpec::Profile { paths } => Ok(Wanted {
            kind: "profile",
            targets: vec![context.profile_target("target.profile", paths)?],
            shares: vec![1.0],
            rms: vec![None],
            surface: Surface::Uniform,
        }),
        TargetSpec::Clusters { labels, profiles } => {
            let (width, height, labels_of) = read_labels(labels.as_ref())?;
            if let Some(odd) = labels_of.iter().find(|&&label| usize::from(label) >= profiles.len()) {
                return Err(RunError::Texture {
                    path: labels.path.clone(),
                    found: format!("label {odd} with {} profiles", profiles.len()),
                    expected: "labels from 0 to one less than the number of profiles",
                });
            }
            context.require_uvs("target.labels")?;
            let targets = profiles.iter().map(|paths| context.profile_target("target.profiles", paths));
            let targets = targets.collect::<Result<Vec<_>, _>>()?;
            Ok(labelled(context, "clusters", (width, height), labels_of, targets, None))
        }
        TargetSpec::Texture { albedo, mean_free_path, mean_free_path_mm, max_albedo } => {
            let pages = context.appearance(albedo, mean_free_path.as_ref())?;
            texture_wanted(context, pages, *mean_free_path_mm, *max_albedo, warnings)
        }
        TargetSpec::Bssrdf { map, max_albedo } => {
            context.require_uvs("target.map")?;
            let map = FactoredMap::read(map.as_ref())?;
            let channels = &context.materials.channels;
            let targets = map.spectra(channels, &context.materials.grid)?;
            let targets = targets.into_iter().map(|channels| SearchTarget { channels }).collect();
            Ok(labelled(context, "bssrdf", (map.width, map.height), map.labels, targets, *max_albedo))
        }
    }
}

/// `targets`, wanted where `labels` name them; `max_albedo` rescales them all as [`rescale`] says.
fn labelled(
    context: &TargetContext<'_>,
    kind: &'static str,
    size: (u32, u32),
    labels: Vec<u16>,
    mut targets: Vec<SearchTarget>,
    max_albedo: Option<f64>,
) -> Wanted {
    let atlas = Atlas::new(&context.solid.mesh, &[size], &[]);
    let mut texels = vec![0_u64; targets.len()];
    for texel in atlas.pages()[0].covered() {
        texels[usize::from(labels[texel])] += 1;
    }
    if let Some(most) = max_albedo {
        rescale(&mut targets, &texels, most);
    }
    let total: u64 = texels.iter().sum();
    Wanted {
        kind,
        shares: texels.iter().map(|&texels| texels as f64 / total.max(1) as f64).collect(),
        rms: vec![None; targets.len()],
        targets,
        surface: Surface::Labelled { atlas, labels: vec![LabelMap(labels)] },
    }
}

/// Scales all profiles by one factor, so that the largest albedo of any that is laid somewhere becomes `most`.
fn rescale(targets: &mut [SearchTarget], shares: &[u64], most: f64) {
    let laid = targets.iter().zip(shares).filter(|(_, share)| **share > 0);
    let brightest = laid.flat_map(|(target, _)| &target.channels).map(|spectrum| spectrum[0]).fold(0.0, f64::max);
    let scale = most / brightest.max(f64::MIN_POSITIVE);
    for spectrum in targets.iter_mut().flat_map(|target| &mut target.channels) {
        spectrum.iter_mut().for_each(|value| *value *= scale);
    }
}

fn reflection(context: &TargetContext<'_>, stacking: &Stacking, core: usize) -> Result<Vec<Vec<f64>>, RunError> {
    if context.job.stacking.model == StackingModel::KubelkaMunk {
        return Ok(reflection_of(&context.parameters(), stacking, Some(core)));
    }
    let volumes = context.volumes()?;
    let channel = |channel: usize| {
        let layers: Vec<_> =
            stacking.layers.iter().map(|layer| (volumes[layer.resin][channel], layer.thickness_mm)).collect();
        let base = Some(volumes[core][channel]);
        let model = Transport { layers: &layers, base, light: Light::Diffuse, options: TransportOptions::REFLECTION };
        model.spectra(&context.materials.grid).reflection
    };
    Ok((0..context.materials.channels.len()).map(channel).collect())
}

/// Pages of appearance with the page of every triangle.
struct Appearance {
    pages: Vec<AppearancePage>,
    page_of: Vec<u16>,
}

fn texture_wanted(
    context: &TargetContext<'_>,
    appearance: Appearance,
    mean_free_path_mm: f64,
    max_albedo: Option<f64>,
    warnings: &mut Vec<String>,
) -> Result<Wanted, RunError> {
    let channels = context.materials.channels.len();
    context.progress.stage("clusters", 0);
    let sizes: Vec<_> = appearance.pages.iter().map(|page| (page.width, page.height)).collect();
    let atlas = Atlas::new(&context.solid.mesh, &sizes, &appearance.page_of);
    let scale =
        max_albedo.map_or(1.0, |most| most / brightest(&atlas, &appearance.pages, channels).max(f64::MIN_POSITIVE));
    let appearances = distinct_appearances(&atlas, &appearance.pages, channels, scale);
    let coefficients = context.materials.grid.len();
    let mut spectra = Vec::with_capacity(appearances.distinct.len() * channels * coefficients);
    for appearance in &appearances.distinct {
        for &albedo in &appearance.albedo {
            let model = NormalizedDiffusion::new(albedo, appearance.mean_free_path * mean_free_path_mm)
                .map_err(|error| context.refuse("target", error, "an albedo and a mean free path"))?;
            spectra.extend(model.spectrum(&context.materials.grid));
        }
    }
    let weights: Vec<_> = appearances.distinct.iter().map(|appearance| appearance.texels as f64).collect();
    let options = target::ClusterOptions {
        k: context.job.clusters.k,
        seed: context.job.clusters.seed,
        coefficients,
        objective: context.job.stacking.objective,
        ..Default::default()
    };
    let clusters = cluster(&spectra, &weights, &options)
        .map_err(|error| context.refuse("clusters", error, "profiles that can be grouped"))?;
    context.stop_if_interrupted()?;
    let count = clusters.centroids.len();
    // One appearance everywhere is what a constant target is, not a lack of clusters.
    if count < clusters.requested && appearances.distinct.len() > 1 {
        warnings.push(format!(
            "object {}: its {} distinct appearances make {count} clusters, not the {} asked for",
            context.object + 1,
            appearances.distinct.len(),
            clusters.requested,
        ));
    }
    let target =
        |centroid: &Vec<f64>| SearchTarget { channels: centroid.chunks(coefficients).map(<[f64]>::to_vec).collect() };
    let total: f64 = weights.iter().sum();
    let rms = |fit: &target::ClusterFit| Some(fit.rms / ((channels * coefficients) as f64).sqrt());
    let label = |&appearance: &u32| clusters.labels[appearance as usize] as u16; // k is at most 65,535
    let labels = appearances.index.iter().map(|page| LabelMap(page.iter().map(label).collect())).collect();
    Ok(Wanted {
        kind: "texture",
        targets: clusters.centroids.iter().map(target).collect(),
        shares: clusters.fits.iter().map(|fit| fit.weight / total).collect(),
        rms: clusters.fits.iter().map(rms).collect(),
        surface: Surface::Labelled { atlas, labels },
    })
}

/// The largest albedo of any covered texel and channel.
fn brightest(atlas: &Atlas, pages: &[AppearancePage], channels: usize) -> f64 {
    let texels = atlas.pages().iter().zip(pages).flat_map(|(map, page)| {
        map.covered().flat_map(move |texel| &page.albedo[texel * channels..(texel + 1) * channels])
    });
    f64::from(texels.copied().fold(0.0, f32::max))
}

impl TargetContext<'_> {
    /// The resin of the core.
    fn core(&self) -> Result<usize, RunError> {
        let found = self.materials.resin(self.job.stacking.core_name());
        found.map(|(index, _)| index).ok_or_else(|| self.job.refuse_core().into())
    }

    fn refuse(&self, key: &str, found: impl ToString, expected: &str) -> RunError {
        self.job.refuse(key, found.to_string(), expected).into()
    }

    fn stop_if_interrupted(&self) -> Result<(), RunError> {
        if self.interrupt.requested() { Err(RunError::Interrupted) } else { Ok(()) }
    }

    fn require_uvs(&self, key: &str) -> Result<(), RunError> {
        if !self.has_uvs {
            let mesh = self.job.objects[self.object].mesh.shown();
            return Err(self.refuse(key, format!("{mesh} without texture coordinates"), "a mesh that has them"));
        }
        Ok(())
    }

    fn parameters(&self) -> Vec<Vec<crate::optics::KubelkaMunk>> {
        self.materials.resins.iter().map(|resin| resin.kubelka_munk.clone()).collect()
    }

    fn limits(&self) -> Vec<ResinLimit> {
        let names: Vec<_> = self.materials.resins.iter().map(|resin| resin.name.as_str()).collect();
        self.job.stacking.resin_limits(&names)
    }

    /// The id a resin has in voxels: its own, or that of the resin the job prints in place of the background.
    fn id(&self, resin: usize) -> MaterialId {
        let mapped = self.job.output.map_background.as_deref().and_then(|name| self.materials.resin(name));
        match mapped {
            Some((mapped, _)) if self.materials.resins[resin].print_as_background => MaterialId::from_resin(mapped),
            _ => MaterialId::from_resin(resin),
        }
    }

    /// Coefficients of all resins, index `[resin][channel]`.
    fn volumes(&self) -> Result<Vec<Vec<VolumeCoefficients>>, RunError> {
        let volumes = self.materials.resins.iter().map(|resin| {
            resin.volume.clone().ok_or_else(|| {
                let found = format!("\"transport\" with resin {}, which is given by profiles", resin.name);
                self.refuse("stacking.model", found, "resins given by coefficients, or \"km\"")
            })
        });
        volumes.collect()
    }

    fn refiner(&self, options: &SearchOptions) -> Result<Option<Refiner>, RunError> {
        let StackingModel::Transport { min_layer_mm, layer_step_mm } = self.job.stacking.model else { return Ok(None) };
        let refine = RefineOptions {
            min_layer_mm: min_layer_mm.unwrap_or(self.job.printer.pitch_mm.z),
            step_mm: layer_step_mm,
            ..RefineOptions::default()
        };
        Ok(Some(Refiner::new(&self.volumes()?, &self.materials.grid, options, refine)))
    }

    fn search_options(&self, core: usize) -> SearchOptions {
        let stacking = &self.job.stacking;
        SearchOptions {
            max_thickness_mm: stacking.max_thickness_mm,
            units: stacking.units,
            depth: stacking.depth,
            objective: stacking.objective,
            limits: self.limits(),
            core: Some(core),
            max_nodes: None,
        }
    }

    fn search_fault(&self, source: SearchError) -> RunError {
        RunError::Search { object: self.job.objects[self.object].mesh.shown(), source }
    }

    /// Where the object's targets go, if the job asks for that; says what it does.
    fn gamut_map(
        &self,
        core: usize,
        wanted: &Wanted,
        warnings: &mut Vec<String>,
    ) -> Result<Option<GamutMap>, RunError> {
        if !self.job.objects[self.object].gamut_map {
            return Ok(None);
        }
        self.progress.stage("gamut", 0);
        let volumes = match self.job.stacking.model {
            StackingModel::KubelkaMunk => None,
            StackingModel::Transport { .. } => Some(self.volumes()?),
        };
        let stacking = &self.job.stacking;
        let slice_mm = self.job.printer.pitch_mm.z;
        let step_mm = match stacking.model {
            StackingModel::KubelkaMunk => slice_mm,
            StackingModel::Transport { min_layer_mm, layer_step_mm } => {
                layer_step_mm.or(min_layer_mm).unwrap_or(slice_mm)
            }
        };
        // What a printer can lay, but not finer than tells anything apart.
        let units = (stacking.max_thickness_mm / step_mm.max(FINEST_STEP_MM)).ceil() as usize;
        let (grid, options) = (&self.materials.grid, SearchOptions { units, ..self.search_options(core) });
        let gamut = Gamut::explore(&self.parameters(), volumes.as_deref(), grid, &options);
        let map =
            GamutMap::new(&gamut.map_err(|fault| self.search_fault(fault))?, &wanted.targets, &wanted.shares, grid);
        warnings.push(format!("object {}: gamut-map: {}", self.object + 1, map_in_words(&map, &wanted.shares)));
        Ok(Some(map))
    }

    fn mapped(&self, map: &GamutMap, targets: &[SearchTarget]) -> Vec<SearchTarget> {
        map.moves.iter().zip(targets).map(|(moved, target)| moved.apply(target, &self.materials.grid)).collect()
    }

    fn search(&self, core: usize, targets: &[SearchTarget]) -> Result<Vec<Found>, RunError> {
        self.progress.stage("stackings", targets.len() as u64);
        let options = self.search_options(core);
        let fault = |source| self.search_fault(source);
        let table = BlockTable::new(&self.parameters(), &options).map_err(fault)?;
        let refiner = self.refiner(&options)?;
        // In batches, so that the user sees progress and can stop.
        let mut found = Vec::with_capacity(targets.len());
        for batch in targets.chunks(SEARCH_BATCH) {
            self.stop_if_interrupted()?;
            match &refiner {
                None => {
                    let matches = match_targets(&table, batch).map_err(fault)?;
                    found.extend(matches.into_iter().map(|search| Found { search, refined: None }));
                }
                Some(refiner) => {
                    let matches = refiner.match_targets(&table, batch).map_err(fault)?;
                    found.extend(matches.into_iter().map(|(search, refined)| Found { search, refined: Some(refined) }));
                }
            }
            self.progress.advance(batch.len() as u64);
        }
        Ok(found)
    }

    fn profile_target(&self, key: &str, paths: &[InputPath]) -> Result<SearchTarget, RunError> {
        let channels = self.materials.channels.len();
        if paths.len() != 1 && paths.len() != channels {
            let expected = format!("one path, or one for each of {channels} channels");
            return Err(self.refuse(key, format!("{} paths", paths.len()), &expected));
        }
        let spectrum = |path: &InputPath| -> Result<Vec<f64>, RunError> {
            let Some(reflection) = ProfileFile::read(path.as_ref())?.reflection else {
                let found = format!("{} without reflection_per_mm2", path.path.display());
                return Err(self.refuse(key, found, "a profile with a column of reflection"));
            };
            Ok(reflection.hankel(&self.materials.grid).values)
        };
        let spectra = paths.iter().map(spectrum).collect::<Result<Vec<_>, _>>()?;
        Ok(SearchTarget { channels: (0..channels).map(|c| spectra[c.min(spectra.len() - 1)].clone()).collect() })
    }

    /// Reads the textures of a texture target.
    fn appearance(&self, albedo: &AlbedoSource, mean_free_path: Option<&InputPath>) -> Result<Appearance, RunError> {
        let channels = self.materials.channels.len();
        let mean_free_path = mean_free_path.map(|path| read_picture(path.as_ref())).transpose()?;
        if mean_free_path.is_some() {
            self.require_uvs("target.mean-free-path")?;
        }
        let decode = |rgb: [f32; 3]| rgb.map(srgb_to_linear);
        // Linear colour at (u, v) and the size of the texture behind it, one per page.
        type Colour<'a> = Box<dyn Fn(f32, f32) -> [f32; 3] + 'a>;
        let mut sources: Vec<(u32, u32, Colour<'_>)> = Vec::new();
        let mut page_of = Vec::new();
        match albedo {
            AlbedoSource::Constant(albedo) => {
                let albedo = *albedo as f32;
                sources.push((1, 1, Box::new(move |_, _| [albedo; 3])));
            }
            AlbedoSource::Texture(path) => {
                self.require_uvs("target.albedo")?;
                let picture = read_picture(path.as_ref())?;
                sources.push((picture.width, picture.height, Box::new(move |u, v| decode(picture.nearest(u, v)))));
            }
            AlbedoSource::MeshBaseColor => {
                let mesh = &self.solid.mesh;
                if mesh.materials.is_empty() {
                    let name = self.job.objects[self.object].mesh.shown();
                    let found = format!("{name} without a base colour of its own");
                    return Err(self.refuse("target", found, "an albedo or an albedo-value"));
                }
                page_of = mesh.material_of.clone();
                for material in &mesh.materials {
                    let [r, g, b, _] = material.base_color;
                    match &material.base_color_texture {
                        None => sources.push((1, 1, Box::new(move |_, _| [r, g, b]))),
                        Some(texture) => sources.push((
                            texture.width,
                            texture.height,
                            Box::new(move |u, v| {
                                let texel = |at: f32, size: u32| ((at * size as f32) as u32).min(size - 1) as usize;
                                let index = texel(u, texture.width) + texture.width as usize * texel(v, texture.height);
                                let [tr, tg, tb, _] =
                                    texture.texels[index].map(|c| srgb_to_linear(f32::from(c) / 255.0));
                                [tr * r, tg * g, tb * b]
                            }),
                        )),
                    }
                }
            }
        }
        let pages = sources.into_iter().map(|(width, height, colour)| {
            let (width, height) = match &mean_free_path {
                Some(picture) => (width.max(picture.width), height.max(picture.height)),
                None => (width, height),
            };
            let mut page = AppearancePage { width, height, albedo: Vec::new(), mean_free_path: Vec::new() };
            for y in 0..height {
                for x in 0..width {
                    let (u, v) = ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
                    to_channels(colour(u, v), channels, &mut page.albedo);
                    page.mean_free_path.push(mean_free_path.as_ref().map_or(1.0, |picture| picture.nearest(u, v)[0]));
                }
            }
            page
        });
        Ok(Appearance { pages: pages.collect(), page_of })
    }

    fn entry(&self, stacking: &Stacking, share: f64, reflection: &[Vec<f64>]) -> StackingEntry {
        let layer = |layer: &crate::search::Layer| LayerEntry {
            resin: self.materials.resins[layer.resin].name.clone(),
            thickness_mm: layer.thickness_mm,
        };
        StackingEntry {
            layers: stacking.layers.iter().map(layer).collect(),
            share,
            target_albedo: None,
            predicted_albedo: reflection.iter().map(|channel| channel[0]).collect(),
            search: None,
            cluster_rms: None,
            gamut_map: None,
        }
    }

    fn matched_entry(&self, found: &Found, target: &SearchTarget, share: f64, rms: Option<f64>) -> StackingEntry {
        let coefficients: usize = target.channels.iter().map(Vec::len).sum();
        let rms_of = |objective: f64| (objective / coefficients as f64).sqrt();
        let Found { search, refined } = found;
        StackingEntry {
            target_albedo: Some(target.channels.iter().map(|channel| channel[0]).collect()),
            search: Some(SearchEntry {
                objective: search.objective,
                rms: rms_of(search.objective),
                bound: search.bound,
                proven: search.proven,
                nodes: search.nodes,
                transport: refined.as_ref().map(|refined| TransportEntry {
                    objective: refined.objective,
                    rms: rms_of(refined.objective),
                    unrefined: refined.unrefined,
                }),
            }),
            cluster_rms: rms,
            ..self.entry(found.stacking(), share, found.reflection())
        }
    }

    fn uniform(
        &self,
        kind: &'static str,
        stacking: &Stacking,
        core: usize,
        entry: StackingEntry,
    ) -> (LayerField, StackingReport) {
        let layers = stacking.layers.iter().map(|layer| (self.id(layer.resin), layer.thickness_mm));
        let ids = layers.clone().map(|layer| layer.0).chain([self.id(core)]).collect();
        let report = StackingReport {
            kind: kind.to_owned(),
            sequence: Vec::new(),
            stackings: vec![entry],
            core: self.materials.resins[core].name.clone(),
            ids,
            maps: LayerMaps::default(),
        };
        (LayerField::Uniform(LayerStack::new(layers, self.id(core))), report)
    }

    fn textured(
        &self,
        kind: &'static str,
        atlas: &Atlas,
        labels: &[LabelMap],
        matches: &[Found],
        entries: Vec<StackingEntry>,
        core: usize,
    ) -> Result<(LayerField, StackingReport), RunError> {
        self.progress.stage("layers", 0);
        let stackings: Vec<_> = matches.iter().map(|found| found.stacking().clone()).collect();
        let aligned = align(&stackings);
        let ids: Vec<_> = aligned.sequence.iter().map(|&resin| self.id(resin)).collect();
        let slots = SlotTable::new(&ids, &aligned, &self.limits(), self.id(core)).ok_or_else(|| {
            let found = format!("stackings that need {} slots", aligned.sequence.len());
            self.refuse("stacking.depth", found, "stackings that align within 64 slots: a smaller depth")
        })?;
        let layers = TexturedLayers::new(&self.solid.mesh, atlas, labels, slots);
        let report = StackingReport {
            kind: kind.to_owned(),
            sequence: aligned.sequence.iter().map(|&resin| self.materials.resins[resin].name.clone()).collect(),
            stackings: entries,
            core: self.materials.resins[core].name.clone(),
            ids: ids.into_iter().chain([self.id(core)]).collect(),
            maps: self.maps(&aligned, atlas, labels),
        };
        Ok((LayerField::Textured(Box::new(layers)), report))
    }
}

impl TargetContext<'_> {
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

/// One sentence: how many targets move, and how far.
fn map_in_words(map: &GamutMap, shares: &[f64]) -> String {
    let moved = || map.moves.iter().filter(|moved| moved.moves());
    let range = |factor: fn(&Move) -> f64| {
        let (low, high) = moved().map(factor).fold((f64::INFINITY, 0.0_f64), |(l, h), f| (l.min(f), h.max(f)));
        format!("{low:.3} to {high:.3}")
    };
    let outside = map.moves.iter().filter(|moved| !moved.inside).count();
    let all = map.moves.len();
    if map.moved() == 0 {
        return format!("moved none of {all} targets, {outside} lie outside of the gamut");
    }
    let share: f64 = map.moves.iter().zip(shares).filter(|(moved, _)| moved.moves()).map(|(_, share)| share).sum();
    format!(
        "moved {} of {all} targets ({:.0}% of the surface; {outside} lay outside of the gamut): albedo by factors of {}, width by {}",
        map.moved(),
        100.0 * share,
        range(|moved| moved.albedo_factor),
        range(|moved| moved.width_factor),
    )
}

/// Steps of layers in a gamut, at least.
const FINEST_STEP_MM: f64 = 0.025;

/// Searches between two looks at the clock.
const SEARCH_BATCH: usize = 16;
