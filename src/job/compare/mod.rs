//! Does the print look as promised? What each step from a measured BSSRDF to a print costs in appearance (Hašan
//! et al. 2010, figure 7).
//!
//! **In:** what `lumislice factor` wrote, finished jobs of slabs printed from it, and the dataset itself if it is at
//! hand. **Out:** a [`Comparison`]: every stage under even light, a shadow edge and a projected spot, as pictures and
//! numbers.
//!
//! | stage | light by |
//! | --- | --- |
//! | original | the 4D data themselves |
//! | factored | equation 7 with the profile of each texel |
//! | clustered | equation 7 with the profiles of the clusters |
//! | predicted | equation 7 with what the transport model says of each cluster's stacking |
//! | printed | Monte Carlo through the voxels of the slices |
//!
//! Sides are mirrors for all of them. Photons meet nothing below the slab, where predictions assume an endless core.
//! On objects of any shape (`object`) the last three stages are a camera's pictures. Photons go by the one walker of
//! [`crate::look`] in both.

mod dataset;
mod error;
mod lights;
mod numbers;
mod object;
mod patch;
mod places;
mod printed;
mod promise;
mod sheet;
mod stage;
mod texels;

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Serialize;

use super::plan::FactoredMap;
use crate::{
    optics::MaterialFile,
    output::{Existing, OutputFolder, Owner, pretty},
    plot::Format,
    watch::{StopOnly, Watch},
};
pub use error::CompareError;
use lights::{Lamp, lamps};
pub use numbers::Difference;
pub use object::{ObjectRequest, compare_object};
use patch::Patch;
use printed::Printed;
use promise::Promise;
pub use promise::{JobFit, Spread};
pub use stage::Stage;

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

/// All stages under all lights.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// Name of the map's folder.
    pub name: String,
    /// Texels per row, or pixels of a camera.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Distance between texels or pixels, mm.
    pub pitch_mm: f64,
    /// Names of the channels.
    pub channels: Vec<String>,
    /// Keys of the lights, in the order of all differences.
    pub lights: Vec<&'static str>,
    /// From the data to the print.
    pub stages: Vec<Stage>,
    /// How well each job's stackings fit the clusters.
    pub jobs: Vec<JobFit>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Azimuth and elevation of the camera, degrees; `None`: a slab's texels, seen from above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub view_deg: Option<[f64; 2]>,
    #[serde(skip)]
    lamps: Vec<Lamp>,
    /// Where on an object each pixel looks, mm; `None`: a slab.
    #[serde(skip)]
    surface: Option<Vec<Option<DVec3>>>,
}

/// Profiles of texels that differ so much from the data under even light, rms, are other data's: their own leave 1 or
/// 2%, noise and all.
const OTHER_SAMPLE: f64 = 0.1;

/// Compares all stages.
///
/// # Errors
/// [`CompareError`]: files that are missing, damaged or do not fit each other; a stop.
pub fn compare(request: &CompareRequest, watch: &dyn Watch) -> Result<Comparison, CompareError> {
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
    let lamps = lamps(width, height).to_vec();
    let patch = Patch::new(map, &channels, lamps.iter().map(|lamp| lamp.irradiance.clone()).collect())?;
    let mut comparison = Comparison {
        name: request.map.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        width,
        height,
        pitch_mm: patch.map.pitch_mm,
        channels: channels.clone(),
        lights: lamps.iter().map(|lamp| lamp.key).collect(),
        stages: Vec::new(),
        jobs: Vec::new(),
        warnings: Vec::new(),
        view_deg: None,
        lamps,
        surface: None,
    };
    watch.stage("equation 7", 0);
    let first_albedo: Vec<f64> = patch.spectra.iter().map(|channels| channels[0][0]).collect();
    let scale = jobs.first().map_or(1.0, |job| job.scale(&first_albedo));
    if let Some(path) = &request.dataset {
        comparison.stages.push(Stage::new("original", 1.0, patch.original(path, channels.len())?, None));
    }
    if let Some(radiosity) = patch.factored(&request.map, channels.len())? {
        comparison.stages.push(Stage::new("factored", 1.0, radiosity, None));
    }
    let clustered = (0..channels.len()).map(|channel| {
        let spectra: Vec<_> = patch.spectra.iter().map(|cluster| cluster[channel].clone()).collect();
        patch.radiosity(&spectra)
    });
    comparison.stages.push(Stage::new("clustered", 1.0, clustered.collect(), None));
    comparison.stages.iter_mut().for_each(|stage| stage.scale_by(scale));
    let goal = comparison.stages[0].clone();
    for stage in comparison.stages.iter_mut().skip(1) {
        stage.compare_with_goal(&goal);
    }
    let factored = comparison.stages.iter().find(|stage| stage.name == "factored");
    let apart = factored.and_then(|stage| stage.differences.first()).map_or(0.0, |area| area.relative_rms);
    if let Some(path) = request.dataset.as_ref().filter(|_| apart > OTHER_SAMPLE) {
        comparison.warnings.push(format!(
            "{}: under even light its texels are {:.0}% off the map's, rms: was the map factored from other data?",
            path.display(),
            100.0 * apart
        ));
    }
    if let Some(file) = &materials {
        let mut volumes = file.resin_names().filter_map(|resin| file.volume(resin)).flatten();
        if volumes.any(|volume| volume.refractive_index != 1.0) {
            comparison
                .warnings
                .push("photons meet no boundary of resin and air: refractive indices are left out".to_owned());
        }
        if jobs.is_empty() {
            return Ok(comparison);
        }
        let set = file.clone().into_set(&StopOnly(watch))?;
        for job in &jobs {
            let prefix = if jobs.len() > 1 { format!("{}: ", job.manifest.name) } else { String::new() };
            let promise = Promise { patch: &patch, file, set: &set, job, scale: job.scale(&first_albedo), prefix };
            promise.add_to(&mut comparison, request, watch)?;
        }
    }
    Ok(comparison)
}

impl Comparison {
    /// The first stage's picture as `stage` is to be compared with it.
    fn goal_of(&self, stage: &Stage) -> Vec<Vec<Vec<f32>>> {
        self.stages[0].rescaled(stage.scale).radiosity
    }
}

/// What `compare` writes.
pub const OWNER: Owner = Owner {
    command: "compare",
    names: &["sheet.png", "edge.png", "sheet.html", "comparison.json", "radiosity.npy", "noise.npy", "places.csv"],
};

/// Compares, and writes the sheet into `folder`: `sheet.html`, `sheet.png`, `edge.png`, `comparison.json`, and the
/// numbers behind the pictures: `radiosity.npy`, `noise.npy` and `places.csv`.
///
/// # Errors
/// As [`compare`], and a folder that may not or cannot be written.
pub fn compare_into(
    request: &CompareRequest,
    folder: &Path,
    existing: Existing,
    watch: &dyn Watch,
) -> Result<Comparison, CompareError> {
    let mut comparison = compare(request, watch)?;
    let [width, height] = [comparison.width, comparison.height];
    comparison.stages.iter_mut().for_each(|stage| stage.read_edge(width, height));
    let inputs = request.jobs.iter().chain([&request.map]).chain(&request.dataset).cloned().collect::<Vec<_>>();
    comparison.write(folder, existing, &inputs, watch)?;
    Ok(comparison)
}

/// Compares on objects, and writes the same sheet into `folder`, but for `edge.png`: no column of an object is like
/// another.
///
/// # Errors
/// As [`compare_object`], and a folder that may not or cannot be written.
pub fn compare_object_into(
    request: &ObjectRequest<'_>,
    folder: &Path,
    existing: Existing,
    watch: &dyn Watch,
) -> Result<Comparison, CompareError> {
    let comparison = compare_object(request, watch)?;
    let mut inputs = request.prepared.files();
    inputs.extend([Some(request.map), request.folder].into_iter().flatten().map(Path::to_owned));
    comparison.write(folder, existing, &inputs, watch)?;
    Ok(comparison)
}

impl Comparison {
    fn write(
        &self,
        folder: &Path,
        existing: Existing,
        inputs: &[PathBuf],
        watch: &dyn Watch,
    ) -> Result<(), CompareError> {
        watch.stage("sheet", 0);
        let output = OutputFolder::create(folder, &OWNER, existing, inputs)?;
        output.write("sheet.png", &self.pictures().encode(Format::Png)?)?;
        if self.surface.is_none() {
            output.write("edge.png", &self.edge_figure().encode(Format::Png)?)?;
        }
        output.write("sheet.html", self.page()?.as_bytes())?;
        output.write("radiosity.npy", &self.radiosity_npy())?;
        output.write("noise.npy", &self.noise_npy())?;
        output.write("places.csv", self.places_csv().as_bytes())?;
        output.write("comparison.json", &pretty(self))?;
        output.finish_with_list(&OWNER, 1)?;
        Ok(())
    }
}
