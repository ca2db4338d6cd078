//! Does the printed slab look as promised? What each step from a measured BSSRDF to a print costs in appearance (Hašan et al.
//! 2010, figure 7).
//!
//! **In:** what `lumislice factor` wrote, finished jobs of slabs printed from it, and the dataset itself if it is at hand. **Out:** a [`Comparison`]: every stage
//! under even light, a shadow edge and a projected spot, as pictures and numbers.
//!
//! | stage | light by |
//! | --- | --- |
//! | original | the 4D data themselves |
//! | factored | equation 7 with the profile of each texel |
//! | clustered | equation 7 with the profiles of the clusters |
//! | predicted | equation 7 with what the transport model says of each cluster's stacking |
//! | printed | Monte Carlo through the voxels of the slices |
//!
//! Sides are mirrors for all of them. Photons meet nothing below the slab, where predictions reckon with endless core.

mod dataset;
mod lights;
mod numbers;
mod printed;
mod sheet;
mod texels;

use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use serde::Serialize;
use thiserror::Error;

use super::{
    Blame, Interrupt, Progress, RunError, factored::FactoredMap, manifest::GENERATOR, run::pretty, verify::VerifyError,
};
use crate::{
    optics::{
        FrequencyGrid, InverseHankel, Light, MaterialFile, MaterialSet, OpticsError, Prediction, Transport,
        TransportOptions,
        voxels::{Pattern, Photons, Sides, TexelGrid, VoxelScene},
    },
    plot::{Format, PlotError},
    slice::{Existing, OutputError, OutputFolder},
    target::{
        LocalProfiles, TexelRings,
        bssrdf::{BssrdfError, Channel, Dataset, LUMINANCE},
    },
};
use lights::{Lamp, lamps};
pub use numbers::Difference;
use printed::Printed;

/// What to compare.
#[derive(Debug, Clone)]
pub struct CompareRequest {
    /// Folder that `lumislice factor` wrote.
    pub map: PathBuf,
    /// Finished jobs of slabs, each covered by the map from edge to edge.
    pub jobs: Vec<PathBuf>,
    /// The measured dataset.
    pub dataset: Option<PathBuf>,
    /// The resins' file; `None`: the built-in set that the first job names.
    pub materials: Option<MaterialFile>,
    /// Photons for each light, channel and job; 0: no photons, predictions only.
    pub photons: u64,
    /// Seed of the photons.
    pub seed: u64,
}

/// Why there is no comparison.
#[derive(Debug, Error)]
pub enum CompareError {
    /// A job's folder.
    #[error("{}: found {found}, expected {expected}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What is there.
        found: String,
        /// What should be.
        expected: &'static str,
    },
    /// A slice.
    #[error("{}: found {found}, expected a slice of the job", path.display())]
    Slice {
        /// The slice.
        path: PathBuf,
        /// What is wrong with it.
        found: String,
    },
    /// Profiles of texels.
    #[error("{}: found {found}, expected what factored.json says of it", path.display())]
    Profiles {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        found: String,
    },
    /// A resin whose photons cannot be traced.
    #[error(
        "material set {set}: resin {resin}: found no coefficients, expected scattering-per-mm and absorption-per-mm to trace photons by"
    )]
    NoCoefficients {
        /// The set.
        set: String,
        /// The resin.
        resin: String,
    },
    /// The dataset is of another patch than the map.
    #[error("{}: found {found}, expected the dataset that the map was factored from", path.display())]
    OtherPatch {
        /// The dataset.
        path: PathBuf,
        /// Its size.
        found: String,
    },
    /// A job's folder without a manifest.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// The map.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The resins.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// The dataset.
    #[error(transparent)]
    Dataset(#[from] BssrdfError),
    /// The output folder.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A picture.
    #[error(transparent)]
    Plot(#[from] PlotError),
}

impl CompareError {
    /// Who is to blame.
    pub fn blame(&self) -> Blame {
        match self {
            Self::Optics(OpticsError::Cancelled) => Blame::Interrupt,
            Self::Output(error) if error.is_io() => Blame::Disk,
            Self::Verify(error) => error.blame(),
            Self::Run(error) => error.blame(),
            _ => Blame::Input,
        }
    }
}

/// A stage of the way from the data to the print.
#[derive(Debug, Clone, Serialize)]
pub struct Stage {
    /// Its name, with the job's where there are several.
    pub name: String,
    /// By how much its job scaled the target.
    pub scale: f64,
    /// Differences from the first stage under each light, mean over channels; empty for the first.
    pub differences: Vec<Difference>,
    /// Differences from other stages of the same job, by their names.
    pub against: Vec<(String, Vec<Difference>)>,
    /// Mean radiosity of each column under the shadow edge, mean over channels.
    pub edge: Vec<f64>,
    /// Radiosity `[channel][light][texel]`.
    #[serde(skip)]
    radiosity: Vec<Vec<Vec<f32>>>,
    /// One standard deviation of it, where it was counted.
    #[serde(skip)]
    noise: Option<Vec<Vec<Vec<f32>>>>,
}

/// All stages under all lights.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// Name of the map's folder.
    pub name: String,
    /// Texels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Distance between texels, mm.
    pub pitch_mm: f64,
    /// Keys of the lights, in the order of all differences.
    pub lights: Vec<&'static str>,
    /// From the data to the print.
    pub stages: Vec<Stage>,
    /// What the user should know.
    pub warnings: Vec<String>,
    #[serde(skip)]
    lamps: Vec<Lamp>,
}

/// Rings end where this share of the light of all clusters is within them…
const WITHIN: f64 = 0.99;
/// …but at this many texels at most: beyond, light is spread evenly.
const MAX_REACH: usize = 160;

/// The map and what is needed to carry light over it.
struct Patch {
    map: FactoredMap,
    rings: TexelRings,
    labels: Vec<u32>,
    grid: FrequencyGrid,
    /// Hankel transforms `[cluster][channel]`, not scaled.
    spectra: Vec<Vec<Vec<f64>>>,
    irradiances: Vec<Vec<f32>>,
}

impl Patch {
    fn local(&self, spectra: &[Vec<f64>]) -> LocalProfiles<'_> {
        let labels = self.labels.clone();
        LocalProfiles::from_spectra(&self.rings, spectra, &self.grid, labels, self.map.width as usize)
    }
}

/// Compares all stages.
///
/// # Errors
/// [`CompareError`]: files that are missing, damaged or do not fit each other; `interrupt` asked to stop.
pub fn compare(
    request: &CompareRequest,
    progress: &dyn Progress,
    interrupt: &Interrupt,
) -> Result<Comparison, CompareError> {
    let map = FactoredMap::read(&request.map)?;
    let (width, height) = (map.width as usize, map.height as usize);
    let size_mm = [width, height].map(|texels| texels as f64 * map.pitch_mm);
    let jobs = request.jobs.iter().map(|folder| Printed::read(folder, size_mm)).collect::<Result<Vec<_>, _>>()?;
    let materials = match (&request.materials, jobs.first()) {
        (Some(file), _) => Some(file.clone()),
        (None, Some(job)) => Some(MaterialFile::builtin(&job.manifest.material_set.name)?),
        (None, None) => None,
    };
    let channels = materials.as_ref().map_or(map.channels.as_slice(), MaterialFile::channels).to_vec();
    let grid = FrequencyGrid::default();
    let spectra = map.spectra(&channels, &grid)?;
    let lamps = lamps(width, height).to_vec();
    let patch = Patch {
        rings: TexelRings::new(map.pitch_mm, reach(&map, &spectra, &grid)),
        labels: map.labels.iter().map(|&label| u32::from(label)).collect(),
        irradiances: lamps.iter().map(|lamp| lamp.irradiance.clone()).collect(),
        map,
        grid,
        spectra,
    };
    let mut comparison = Comparison {
        name: request.map.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        width,
        height,
        pitch_mm: patch.map.pitch_mm,
        lights: lamps.iter().map(|lamp| lamp.key).collect(),
        stages: Vec::new(),
        warnings: Vec::new(),
        lamps,
    };
    progress.stage("equation 7", 0);
    let first_albedo: Vec<f64> = patch.spectra.iter().map(|channels| channels[0][0]).collect();
    let scale = jobs.first().map_or(1.0, |job| job.scale(&first_albedo));
    if let Some(path) = &request.dataset {
        let radiosity = original(path, &patch, channels.len())?;
        comparison.stages.push(Stage::new("original", 1.0, radiosity, None));
    }
    if let Some(radiosity) = factored(&request.map, &patch, channels.len())? {
        comparison.stages.push(Stage::new("factored", 1.0, radiosity, None));
    }
    let clustered = (0..channels.len()).map(|channel| {
        let spectra: Vec<_> = patch.spectra.iter().map(|cluster| cluster[channel].clone()).collect();
        patch.local(&spectra).radiosity(&patch.irradiances)
    });
    comparison.stages.push(Stage::new("clustered", 1.0, clustered.collect(), None));
    comparison.stages.iter_mut().for_each(|stage| stage.scale_by(scale));
    let goal = comparison.stages[0].clone();
    for stage in comparison.stages.iter_mut().skip(1) {
        stage.compare_with_goal(&goal);
    }
    if let Some(file) = &materials {
        let mut volumes = file.resin_names().filter_map(|resin| file.volume(resin)).flatten();
        if volumes.any(|volume| volume.refractive_index != 1.0) {
            comparison
                .warnings
                .push("photons meet no boundary of resin and air: refractive indices are left out".to_owned());
        }
        for job in &jobs {
            let scale = job.scale(&first_albedo);
            let name = if jobs.len() > 1 { format!("{}: ", job.manifest.name) } else { String::new() };
            job_stages(&mut comparison, &patch, request, file, job, (&name, scale), progress, interrupt)?;
        }
    }
    Ok(comparison)
}

/// Rings that hold most of the light of the map's clusters.
fn reach(map: &FactoredMap, spectra: &[Vec<Vec<f64>>], grid: &FrequencyGrid) -> usize {
    let radius = |spectrum: &Vec<f64>| InverseHankel::new(spectrum, grid).radius_of_energy(WITHIN);
    let widest = spectra.iter().flatten().map(|spectrum| radius(spectrum).unwrap_or(f64::MAX)).fold(0.0, f64::max);
    ((widest / map.pitch_mm).ceil() as usize).clamp(1, MAX_REACH)
}

/// Light by the 4D data, per channel of the resins.
fn original(path: &Path, patch: &Patch, wanted: usize) -> Result<Vec<Vec<Vec<f32>>>, CompareError> {
    let luminance = wanted == 1 && patch.map.channels.len() == 1;
    let stored = Dataset::open(path, false)?;
    let luminance = luminance && stored.channels.len() == 3;
    let dataset = if luminance { Dataset::open(path, true)? } else { stored };
    if (dataset.width, dataset.height) != (patch.map.width as usize, patch.map.height as usize) {
        let found = format!("{} × {} texels", dataset.width, dataset.height);
        return Err(CompareError::OtherPatch { path: path.to_owned(), found });
    }
    let held = if luminance { 1 } else { dataset.channels.len() };
    let channel = |c: usize| match (luminance, held) {
        (true, _) => (Channel::Luminance, 0),
        (false, held) => (Channel::Stored(c.min(held - 1)), c.min(held - 1)),
    };
    (0..wanted).map(|c| dataset::radiosity(&dataset, channel(c).0, channel(c).1, &patch.irradiances)).collect()
}

/// Light by the profile of each texel; `None` where they were not kept.
fn factored(folder: &Path, patch: &Patch, wanted: usize) -> Result<Option<Vec<Vec<Vec<f32>>>>, CompareError> {
    let path = folder.join("profiles.npy");
    let (map, held) = (&patch.map, patch.map.channels.len());
    if !path.exists() || map.ring_edges_mm.is_empty() {
        return Ok(None);
    }
    let (width, height) = (map.width as usize, map.height as usize);
    let channel = |c: usize| -> Result<Vec<Vec<f32>>, CompareError> {
        let mut weights = vec![0.0; held];
        if held == 3 && wanted == 1 {
            weights = LUMINANCE.to_vec();
        } else {
            weights[c.min(held - 1)] = 1.0;
        }
        let (within, albedo) =
            texels::within(&path, [height, width, held], &map.ring_edges_mm, &patch.rings, &weights)?;
        let own = (0..width * height).map(|texel| texel as u32).collect();
        Ok(LocalProfiles::new(&patch.rings, &within, &albedo, own, width).radiosity(&patch.irradiances))
    };
    (0..wanted).map(channel).collect::<Result<Vec<_>, _>>().map(Some)
}

/// What a job promises, and what its voxels do.
#[allow(clippy::too_many_arguments)]
fn job_stages(
    comparison: &mut Comparison,
    patch: &Patch,
    request: &CompareRequest,
    file: &MaterialFile,
    job: &Printed,
    (prefix, scale): (&str, f64),
    progress: &dyn Progress,
    interrupt: &Interrupt,
) -> Result<(), CompareError> {
    let channels = file.channels().len();
    let goal = comparison.stages[0].rescaled(scale);
    let mut predicted = Vec::new();
    for channel in 0..channels {
        let (stackings, core) = job.stackings(file, channel)?;
        if stackings.len() != patch.map.profiles.len() {
            let found = format!("{} stackings for {} clusters", stackings.len(), patch.map.profiles.len());
            let (folder, expected) = (job.folder.clone(), "a job with kind = \"bssrdf\" and this map");
            return Err(CompareError::Folder { folder, found, expected });
        }
        let spectrum = |layers: &Vec<_>| {
            let options = TransportOptions::REFLECTION;
            Transport { layers, base: Some(core), light: Light::Diffuse, options }.spectra(&patch.grid).reflection
        };
        let spectra: Vec<_> = stackings.iter().map(spectrum).collect();
        predicted.push(patch.local(&spectra).radiosity(&patch.irradiances));
    }
    let mut stage = Stage::new(format!("{prefix}predicted"), scale, predicted, None);
    stage.compare_with_goal(&goal);
    // The same by Kubelka–Munk, in numbers only: what it gets wrong of thin layers.
    let scalar = by_kubelka_munk(patch, file, job)?;
    let scalar = Stage::new(format!("{prefix}predicted by Kubelka–Munk"), scale, scalar, None);
    stage.compare_with(&scalar);
    comparison.stages.push(stage);
    if request.photons == 0 {
        return Ok(());
    }
    let texels = TexelGrid {
        origin_mm: [0.0; 2],
        pitch_mm: [patch.map.pitch_mm; 2],
        dims: [comparison.width, comparison.height],
    };
    let from_top = |values: &[f64]| -> Vec<f32> {
        values.chunks(comparison.width).rev().flatten().map(|&value| value as f32).collect()
    };
    progress.stage("photons", (channels * comparison.lamps.len()) as u64);
    let (mut seen, mut noise) = (Vec::new(), Vec::new());
    for channel in 0..channels {
        let media = job.media(file, channel)?;
        let scene = VoxelScene { grid: &job.grid, media: &media, sides: Sides::Mirrored, base: None };
        let (mut by_lamp, mut noise_by_lamp) = (Vec::new(), Vec::new());
        for (index, lamp) in comparison.lamps.iter().enumerate() {
            let irradiance = lamp.irradiance.chunks(comparison.width).rev().flatten().copied().collect();
            let seed = request.seed.wrapping_add((channel * comparison.lamps.len() + index) as u64);
            let photons = Photons { light: Light::Diffuse, count: request.photons, seed };
            let image = scene.image(&Pattern::Image { texels, irradiance }, texels, photons, |_| {
                if interrupt.requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })?;
            by_lamp.push(from_top(&image.radiosity));
            noise_by_lamp.push(from_top(&image.standard_error));
            progress.advance(1);
        }
        seen.push(by_lamp);
        noise.push(noise_by_lamp);
    }
    let mut stage = Stage::new(format!("{prefix}printed"), scale, seen, Some(noise));
    stage.compare_with_goal(&goal);
    if let Some(predicted) = comparison.stages.last() {
        stage.compare_with(predicted);
    }
    stage.compare_with(&scalar);
    comparison.stages.push(stage);
    Ok(())
}

fn by_kubelka_munk(patch: &Patch, file: &MaterialFile, job: &Printed) -> Result<Vec<Vec<Vec<f32>>>, CompareError> {
    let set: MaterialSet = file.clone().into_set(|_, _| ControlFlow::Continue(()))?;
    let index = |name: &str| -> Result<usize, OpticsError> { file.resin_index(name) };
    let Some(report) = job.manifest.stackings.first() else { return Ok(Vec::new()) };
    let core = index(&report.core)?;
    let mut spectra = vec![Vec::new(); set.channels.len()];
    for entry in &report.stackings {
        let layers = entry.layers.iter().map(|layer| Ok((index(&layer.resin)?, layer.thickness_mm)));
        let layers = layers.collect::<Result<Vec<_>, OpticsError>>()?;
        let light = Prediction::kubelka_munk(&set, &layers, Some(core)).light;
        spectra.iter_mut().zip(light).for_each(|(spectra, light)| spectra.push(light.reflection_hankel));
    }
    Ok(spectra.iter().map(|spectra| patch.local(spectra).radiosity(&patch.irradiances)).collect())
}

impl Stage {
    fn new(
        name: impl Into<String>,
        scale: f64,
        radiosity: Vec<Vec<Vec<f32>>>,
        noise: Option<Vec<Vec<Vec<f32>>>>,
    ) -> Self {
        let name = name.into();
        Self { name, scale, differences: Vec::new(), against: Vec::new(), edge: Vec::new(), radiosity, noise }
    }

    fn scale_by(&mut self, scale: f64) {
        let factor = (scale / self.scale) as f32;
        self.radiosity.iter_mut().flatten().flatten().for_each(|value| *value *= factor);
        self.scale = scale;
    }

    /// The same picture had its job scaled the target by `scale`.
    fn rescaled(&self, scale: f64) -> Self {
        let mut stage = self.clone();
        stage.scale_by(scale);
        stage
    }

    fn compare_with_goal(&mut self, goal: &Self) {
        self.differences = self.apart(goal);
    }

    fn compare_with(&mut self, other: &Self) {
        self.against.push((other.name.clone(), self.apart(other)));
    }

    /// Under each light, over the values of all channels together.
    fn apart(&self, other: &Self) -> Vec<Difference> {
        let all = |of: &Vec<Vec<Vec<f32>>>, lamp: usize| -> Vec<f32> {
            of.iter().flat_map(|channel| channel[lamp].iter().copied()).collect()
        };
        let lamps = self.radiosity.first().map_or(0, Vec::len);
        let apart = |lamp: usize| {
            let noise = self.noise.as_ref().map(|noise| all(noise, lamp));
            Difference::new(&all(&self.radiosity, lamp), &all(&other.radiosity, lamp), noise.as_deref())
        };
        (0..lamps).map(apart).collect()
    }
}

impl Comparison {
    /// The first stage's picture as `stage` is to be compared with it.
    fn goal_of(&self, stage: &Stage) -> Vec<Vec<Vec<f32>>> {
        self.stages[0].rescaled(stage.scale).radiosity
    }
}

/// Compares, and writes the sheet into `folder`: `sheet.html`, `sheet.png`, `edge.png` and `comparison.json`.
///
/// # Errors
/// As [`compare`], and a folder that may not or cannot be written.
pub fn compare_into(
    request: &CompareRequest,
    folder: &Path,
    existing: Existing,
    progress: &dyn Progress,
    interrupt: &Interrupt,
) -> Result<Comparison, CompareError> {
    let mut comparison = compare(request, progress, interrupt)?;
    let (width, height) = (comparison.width, comparison.height);
    for stage in &mut comparison.stages {
        let count = (stage.radiosity.len() * height) as f64;
        let column = |x: usize| {
            let rows =
                stage.radiosity.iter().flat_map(|lamps| lamps[1].chunks(width).map(move |row| f64::from(row[x])));
            rows.sum::<f64>() / count
        };
        stage.edge = (0..width).map(column).collect();
    }
    progress.stage("sheet", 0);
    let output = OutputFolder::create(folder, existing)?;
    output.write("sheet.png", &comparison.pictures().encode(Format::Png)?)?;
    output.write("edge.png", &comparison.edge_figure().encode(Format::Png)?)?;
    output.write("sheet.html", comparison.page()?.as_bytes())?;
    output.write("comparison.json", &pretty(&comparison))?;
    let list = serde_json::json!({ "generator": GENERATOR, "version": 1, "files": output.files() });
    output.finish(&pretty(&list))?;
    Ok(comparison)
}
