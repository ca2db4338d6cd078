//! `slice`, `look`, `factor` and `measure`: what works on files.

use std::path::{Path, PathBuf};

use lumislice::{
    appearance::bssrdf::{ClusterCount, FactorOptions},
    glam::DVec3,
    job::{
        self, Finished, Job, Prepared, RunError, RunOptions,
        factor::{FactorRequest, factor_into},
        look::{LookError, LookOptions, PictureOptions, look_at, scene_for},
    },
    measure::{Capture, measure as measure_capture},
    output::{Existing, OutputFolder},
    watch::Watch,
};
use pyo3::{
    prelude::*,
    types::{PyAny, PyDict},
};
use serde::Serialize;

use crate::watched::{InputError, raised, watched};

/// A document as Python has it.
fn document<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|error| InputError::new_err(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

fn existing(overwrite: bool, resume: bool) -> PyResult<Existing> {
    match (overwrite, resume) {
        (true, true) => Err(InputError::new_err("overwrite: found it beside resume, expected one of them")),
        (_, true) => Ok(Existing::Resume),
        (overwrite, false) => Ok(Existing::overwrite(overwrite)),
    }
}

/// Slices a job into `output`, ./<job name>-out by default; the manifest as a dict. `slices` = (a, b) writes slices a
/// to b−1 only.
#[pyfunction]
#[pyo3(signature = (job, output = None, *, overwrite = false, resume = false, slices = None, progress = None))]
pub fn slice<'py>(
    py: Python<'py>,
    job: PathBuf,
    output: Option<PathBuf>,
    overwrite: bool,
    resume: bool,
    slices: Option<(u32, u32)>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let existing = existing(overwrite, resume)?;
    let manifest = watched(py, progress, move |watch| -> Result<_, RunError> {
        let job = Job::load(&job)?;
        let folder = output.unwrap_or_else(|| PathBuf::from(format!("{}-out", job.name)));
        OutputFolder::check(&folder, &job::OWNER, existing)?;
        let prepared = Prepared::for_folders(job, &[&folder], watch)?;
        let options = RunOptions { existing, slices: slices.map(|(start, end)| start..end) };
        let Finished { manifest, .. } = job::run(&prepared, &folder, &options, watch)?;
        Ok(manifest)
    })?;
    document(py, &manifest)
}

/// Light through the voxels of a job, or through the slices in `folder` it was sliced into: look.json as a dict. With
/// `output`, pictures and look.json are written there.
#[pyfunction]
#[pyo3(signature = (job, folder = None, *, spots = 100, at = Vec::new(), photons = 10_000, seed = 1, output = None,
                    overwrite = false, size = 640, samples = 64, progress = None))]
#[allow(clippy::too_many_arguments)]
pub fn look<'py>(
    py: Python<'py>,
    job: PathBuf,
    folder: Option<PathBuf>,
    spots: usize,
    at: Vec<[f64; 3]>,
    photons: u64,
    seed: u64,
    output: Option<PathBuf>,
    overwrite: bool,
    size: usize,
    samples: u32,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    if photons < 2 {
        return Err(InputError::new_err(format!("photons: found {photons}, expected 2 or more")));
    }
    if !(16..=4096).contains(&size) || samples == 0 {
        return Err(InputError::new_err(format!(
            "size: found {size} pixels of {samples} samples, expected 16 to 4096, and a sample at least"
        )));
    }
    if let Some([x, y, z]) = at.iter().find(|at| at.iter().any(|value| !value.is_finite())) {
        return Err(InputError::new_err(format!("at: found {x}, {y}, {z}, expected three numbers of mm")));
    }
    let existing = existing(overwrite, false)?;
    let pictures = output.is_some().then_some(PictureOptions { size, samples, seed, ..PictureOptions::default() });
    let at = at.into_iter().map(DVec3::from).collect();
    let options = LookOptions { spots, at, walks: photons, seed, pictures, ..LookOptions::default() };
    let look = watched(py, progress, move |watch| -> Result<_, LookError> {
        let job = Job::load(&job).map_err(RunError::from)?;
        if let Some(output) = &output {
            OutputFolder::check(output, &job::look::OWNER, existing).map_err(RunError::from)?;
        }
        let prepared = match &folder {
            Some(folder) => Prepared::for_folders(job, &[folder], watch),
            None => Prepared::new(job, watch),
        }?;
        let scene = scene_for(&prepared, folder.as_deref(), watch)?;
        let look = look_at(&prepared, &scene, &options, watch)?;
        if let Some(output) = &output {
            look.write(output, existing, &prepared.files()).map_err(RunError::from)?;
        }
        Ok(look)
    })?;
    document(py, &look)
}

/// Factors a measured BSSRDF into profiles for each texel, and clusters of them, in `output`; what was found as a dict.
#[pyfunction]
#[pyo3(signature = (dataset, output, *, luminance = false, clusters = None, max_rms = None, seed = 1, dc_weight = 1.0,
                    rounds = None, roughness = None, compare = false, overwrite = false, progress = None))]
#[allow(clippy::too_many_arguments)]
pub fn factor<'py>(
    py: Python<'py>,
    dataset: PathBuf,
    output: PathBuf,
    luminance: bool,
    clusters: Option<usize>,
    max_rms: Option<f64>,
    seed: u64,
    dc_weight: f64,
    rounds: Option<usize>,
    roughness: Option<f64>,
    compare: bool,
    overwrite: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let existing = existing(overwrite, false)?;
    let default = FactorOptions::default();
    let options = FactorOptions {
        rounds: rounds.unwrap_or(default.rounds),
        roughness: roughness.unwrap_or(default.roughness),
        ..default
    };
    let count = clusters.map(ClusterCount::Fixed).or(max_rms.map(ClusterCount::Within));
    let request = FactorRequest { dataset, luminance, options, count, seed, dc_weight, compare };
    let factored = watched(py, progress, |watch| factor_into(&request, &output, existing, watch))?;
    document(py, &factored)
}

/// Measures a resin from the photographs that a capture file names: a dict of files (texts by name, the material file
/// among them) and notes. Nothing is written.
#[pyfunction]
#[pyo3(signature = (capture, *, stem = "material", progress = None))]
pub fn measure<'py>(
    py: Python<'py>,
    capture: PathBuf,
    stem: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let capture = Capture::read(Path::new(&capture)).map_err(|error| raised(&error))?;
    let measured = watched(py, progress, |watch: &dyn Watch| measure_capture(capture, watch))?;
    let mut notes = Vec::new();
    for channel in &measured.channels {
        let prefix = measured.prefix(channel);
        notes.extend(channel.all_findings().map(|(series, finding)| format!("{prefix}{series}: {finding}")));
    }
    let files = PyDict::new(py);
    for (name, content) in measured.files(stem) {
        files.set_item(name, content)?;
    }
    let found = PyDict::new(py);
    found.set_item("files", files)?;
    found.set_item("notes", notes)?;
    Ok(found)
}
