//! `predict` and `match`: what stacks of layers do to light.

use std::sync::Arc;

use lumislice::{
    appearance::material_target,
    optics::{
        FrequencyGrid, Light, MaterialSet, Mixture, Model, PredictedRing, Stack, TransportOptions,
        predict as predict_stack,
    },
    search::{
        Judge, Judged, MatchOptions, Matcher, Norm, Objective, RefineOptions, SearchError, SearchOptions, SearchTarget,
    },
};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArrayDyn};
use pyo3::{
    prelude::*,
    types::{PyAny, PyDict, PyList},
};

use crate::{
    resins::{Materials, core_of, limits_of, stack_of},
    watched::{InputError, raised, watched},
};

fn rows<'py>(py: Python<'py>, rows: &[Vec<f64>]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    Ok(PyArray2::from_vec2(py, rows)?)
}

pub fn one_of<T: Copy>(what: &str, found: &str, known: &[(&str, T)]) -> PyResult<T> {
    let names: Vec<_> = known.iter().map(|(name, _)| *name).collect();
    let unknown = || InputError::new_err(format!("{what}: found {found}, expected one of {}", names.join(", ")));
    known.iter().find(|(name, _)| *name == found).map(|(_, value)| *value).ok_or_else(unknown)
}

/// How fine layers may be.
pub fn layers_of(min_layer_mm: Option<f64>, layer_step_mm: Option<f64>) -> PyResult<RefineOptions> {
    for (name, found) in [("min_layer_mm", min_layer_mm), ("layer_step_mm", layer_step_mm)] {
        if let Some(found) = found.filter(|mm| !(0.001..=10.0).contains(mm)) {
            return Err(InputError::new_err(format!("{name}: found {found}, expected 0.001 to 10 mm")));
        }
    }
    let default = RefineOptions::default();
    Ok(RefineOptions { min_layer_mm: min_layer_mm.unwrap_or(default.min_layer_mm), step_mm: layer_step_mm, ..default })
}

/// What a stack does to light: a dict of channels, k_rad_per_mm (n), and by channel reflection and transmission (c),
/// reflection_hankel and transmission_hankel (c × n), glint and half_energy_radius_mm (c, NaN where there is none).
/// With `profiles` a list more, one dict for each channel: r_mm, reflection_per_mm2, transmission_per_mm2.
#[pyfunction]
#[pyo3(signature = (materials, stack, *, core = None, model = "transport", light = "diffuse", accuracy = 3e-4,
                    photons = None, seed = None, profiles = false, progress = None))]
#[allow(clippy::too_many_arguments)]
pub fn predict<'py>(
    py: Python<'py>,
    materials: &Bound<'py, PyAny>,
    stack: &Bound<'py, PyAny>,
    core: Option<&str>,
    model: &str,
    light: &str,
    accuracy: f64,
    photons: Option<u64>,
    seed: Option<u64>,
    profiles: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let set = Materials::of(materials, progress.as_ref())?;
    let stack = stack_of(&set, stack, core)?;
    let light = one_of("light", light, &[("diffuse", Light::Diffuse), ("normal", Light::Normal)])?;
    if !(3e-5..=1e-3).contains(&accuracy) {
        return Err(InputError::new_err(format!("accuracy: found {accuracy}, expected 3e-5 to 1e-3")));
    }
    let (count, seed) = (photons.unwrap_or(Model::DEFAULT_PHOTONS), seed.unwrap_or(Model::DEFAULT_SEED));
    if count < 2 {
        return Err(InputError::new_err(format!("photons: found {count}, expected 2 or more")));
    }
    let options = TransportOptions::for_accuracy(accuracy, light);
    let model = one_of(
        "model",
        model,
        &[
            ("km", Model::KubelkaMunk),
            ("transport", Model::Transport { light, options }),
            ("monte-carlo", Model::MonteCarlo { light, photons: count, seed }),
        ],
    )?;
    if model == Model::KubelkaMunk && light == Light::Normal {
        return Err(InputError::new_err("light: found normal, expected diffuse: Kubelka-Munk knows no other"));
    }
    let found = watched(py, progress, |watch| predict_stack(&set, &stack, &model, watch))?;
    let spectra = |of: fn(&lumislice::optics::ChannelPrediction) -> &Vec<f64>| -> Vec<Vec<f64>> {
        found.light.iter().map(|light| of(light).clone()).collect()
    };
    let (reflection, transmission) =
        (spectra(|light| &light.reflection_hankel), spectra(|light| &light.transmission_hankel));
    let first = |spectra: &[Vec<f64>]| -> Bound<'py, PyArray1<f64>> {
        spectra
            .iter()
            .map(|spectrum| spectrum.first().copied().unwrap_or(f64::NAN))
            .collect::<Vec<_>>()
            .into_pyarray(py)
    };
    let radius = |light: &lumislice::optics::ChannelPrediction| light.radius_of_energy_mm(0.5).unwrap_or(f64::NAN);
    let document = PyDict::new(py);
    document.set_item("channels", &found.channels)?;
    document.set_item("reflection", first(&reflection))?;
    document.set_item("transmission", first(&transmission))?;
    document.set_item("k_rad_per_mm", found.grid.as_slice().to_vec().into_pyarray(py))?;
    document.set_item("reflection_hankel", rows(py, &reflection)?)?;
    document.set_item("transmission_hankel", rows(py, &transmission)?)?;
    document.set_item("glint", found.light.iter().map(|light| light.glint).collect::<Vec<_>>().into_pyarray(py))?;
    document.set_item("half_energy_radius_mm", found.light.iter().map(radius).collect::<Vec<_>>().into_pyarray(py))?;
    if profiles {
        let profiles = found.light.iter().map(|light| profile(py, &light.rings()));
        document.set_item("profiles", profiles.collect::<PyResult<Vec<_>>>()?)?;
    }
    Ok(document)
}

/// Light over the distance from where it fell in, ring by ring.
fn profile<'py>(py: Python<'py>, rings: &[PredictedRing]) -> PyResult<Bound<'py, PyDict>> {
    let document = PyDict::new(py);
    let columns: [(&str, fn(&PredictedRing) -> f64); 3] = [
        ("r_mm", |ring| ring.r_mm),
        ("reflection_per_mm2", |ring| ring.reflection_per_mm2),
        ("transmission_per_mm2", |ring| ring.transmission_per_mm2),
    ];
    for (name, of) in columns {
        document.set_item(name, rings.iter().map(of).collect::<Vec<_>>().into_pyarray(py))?;
    }
    Ok(document)
}

/// One row for each target, of one value or one for each channel.
fn table(what: &str, given: &Bound<'_, PyAny>, channels: usize) -> PyResult<Vec<Vec<f64>>> {
    if let Ok(number) = given.extract::<f64>() {
        return Ok(vec![vec![number]]);
    }
    let array: PyReadonlyArrayDyn<'_, f64> = given
        .py()
        .import("numpy")?
        .call_method1("asarray", (given, "float64"))?
        .extract()
        .map_err(|_| InputError::new_err(format!("{what}: found no numbers, expected numbers")))?;
    let array = array.as_array();
    match array.shape() {
        [_] => Ok(array.iter().map(|value| vec![*value]).collect()),
        [_, each] if *each == 1 || *each == channels => {
            Ok(array.outer_iter().map(|row| row.iter().copied().collect()).collect())
        }
        shape => Err(InputError::new_err(format!(
            "{what}: found an array of shape {shape:?}, expected a number, (targets,) or (targets, {channels})"
        ))),
    }
}

/// The stacks that reflect most like targets, a list of dicts: stack (pairs of resin and mm), objective (by model), and
/// by channel albedo_asked, albedo (c), reflection_hankel (c × n). `albedo` and `mean_free_path_mm` are numbers, arrays
/// of one value for each target, or (targets × channels); or `reflection_hankel` is (targets × n) or (targets ×
/// channels × n) on `Materials.k_rad_per_mm`.
#[pyfunction]
#[pyo3(name = "match")]
#[pyo3(signature = (materials, *, albedo = None, mean_free_path_mm = None, reflection_hankel = None, core = None,
                    max_thickness_mm = 5.0, min_depth_mm = None, units = 64, depth = 6, objective = "natural",
                    dc_weight = 1.0, model = "transport", min_layer_mm = None, layer_step_mm = None, mixtures = true,
                    progress = None))]
#[allow(clippy::too_many_arguments)]
pub fn match_<'py>(
    py: Python<'py>,
    materials: &Bound<'py, PyAny>,
    albedo: Option<&Bound<'py, PyAny>>,
    mean_free_path_mm: Option<&Bound<'py, PyAny>>,
    reflection_hankel: Option<&Bound<'py, PyAny>>,
    core: Option<&str>,
    max_thickness_mm: f64,
    min_depth_mm: Option<&Bound<'py, PyDict>>,
    units: usize,
    depth: usize,
    objective: &str,
    dc_weight: f64,
    model: &str,
    min_layer_mm: Option<f64>,
    layer_step_mm: Option<f64>,
    mixtures: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyList>> {
    let set = Materials::of(materials, progress.as_ref())?;
    let targets = match (albedo, mean_free_path_mm, reflection_hankel) {
        (Some(albedo), Some(path), None) => by_material(&set, albedo, path)?,
        (None, None, Some(spectra)) => by_spectra(&set, spectra)?,
        _ => {
            return Err(InputError::new_err(
                "target: expected albedo and mean_free_path_mm, or reflection_hankel alone",
            ));
        }
    };
    let norms =
        [("natural", Norm::Natural), ("l2", Norm::L2), ("spatial", Norm::Spatial), ("relative", Norm::Relative)];
    let norm = one_of("objective", objective, &norms)?;
    let judge = one_of("model", model, &[("transport", Judge::Transport), ("km", Judge::KubelkaMunk)])?;
    let layers = layers_of(min_layer_mm, layer_step_mm)?;
    let objective = Objective { norm, dc_weight };
    let search = SearchOptions {
        max_thickness_mm,
        units,
        depth,
        objective: objective.clone(),
        limits: limits_of(&set, min_depth_mm)?,
        core: core_of(&set, core)?,
        ..SearchOptions::default()
    };
    let mixtures = mixtures && norm != Norm::L2 && layer_step_mm.is_none();
    let options = MatchOptions { search, judge, layers, mixtures };
    let judged = watched(py, progress, |watch| -> Result<Vec<Judged>, SearchError> {
        watch.stage("search", targets.len() as u64);
        let found = Matcher::new(&set, &options)?.match_targets(&targets, watch)?;
        Ok(found.iter().zip(&targets).map(|(found, target)| found.judged(&set, target, &objective)).collect())
    })?;
    let answers = judged.iter().zip(&targets).map(|(judged, target)| answer(py, &set, judged, target));
    PyList::new(py, answers.collect::<PyResult<Vec<_>>>()?)
}

fn by_material(set: &MaterialSet, albedo: &Bound<'_, PyAny>, path: &Bound<'_, PyAny>) -> PyResult<Vec<SearchTarget>> {
    let channels = set.channels.len();
    let albedos = table("albedo", albedo, channels)?;
    let paths = table("mean_free_path_mm", path, channels)?;
    let count = albedos.len().max(paths.len());
    for (name, found) in [("albedo", albedos.len()), ("mean_free_path_mm", paths.len())] {
        if found != 1 && found != count {
            return Err(InputError::new_err(format!("{name}: found {found} targets, expected 1 or {count}")));
        }
    }
    let target = |n: usize| {
        let [albedo, path] = [&albedos, &paths].map(|table| &table[if table.len() == 1 { 0 } else { n }]);
        material_target(albedo, path, channels, &set.grid).map_err(|error| raised(&error))
    };
    (0..count).map(target).collect()
}

fn by_spectra(set: &MaterialSet, given: &Bound<'_, PyAny>) -> PyResult<Vec<SearchTarget>> {
    let (channels, n) = (set.channels.len(), FrequencyGrid::default().as_slice().len());
    let array: PyReadonlyArrayDyn<'_, f64> =
        given.py().import("numpy")?.call_method1("asarray", (given, "float64"))?.extract()?;
    let array = array.as_array();
    let values: Vec<f64> = array.iter().copied().collect();
    let per_target = match array.shape() {
        [_, m] if *m == n => n,
        [_, c, m] if *m == n && *c == channels => channels * n,
        shape => {
            return Err(InputError::new_err(format!(
                "reflection_hankel: found an array of shape {shape:?}, expected (targets, {n}) or (targets, \
                 {channels}, {n})"
            )));
        }
    };
    if let Some(found) = values.iter().find(|value| !value.is_finite()) {
        return Err(InputError::new_err(format!("reflection_hankel: found {found}, expected finite numbers")));
    }
    let target = |values: &[f64]| {
        let given: Vec<Vec<f64>> = values.chunks(n).map(<[f64]>::to_vec).collect();
        SearchTarget { channels: (0..channels).map(|c| given[c.min(given.len() - 1)].clone()).collect() }
    };
    Ok(values.chunks(per_target).map(target).collect())
}

fn answer<'py>(
    py: Python<'py>,
    set: &Arc<MaterialSet>,
    judged: &Judged,
    target: &SearchTarget,
) -> PyResult<Bound<'py, PyDict>> {
    let layers = |stack: &Stack<Mixture>| -> Vec<(String, f64)> {
        let there = stack.pairs().filter(|(_, mm)| *mm > 0.0);
        there.map(|(mixture, mm)| (set.mixture_name(mixture), mm)).collect()
    };
    let first = |spectra: &[Vec<f64>]| spectra.iter().map(|spectrum| spectrum[0]).collect::<Vec<_>>().into_pyarray(py);
    let objective = PyDict::new(py);
    objective.set_item("km", judged.kubelka_munk)?;
    objective.set_item("transport", judged.transport)?;
    let found = PyDict::new(py);
    found.set_item("stack", layers(&judged.stacking))?;
    found.set_item("objective", objective)?;
    found.set_item("albedo_asked", first(&target.channels))?;
    found.set_item("albedo", first(&judged.reflection))?;
    found.set_item("reflection_hankel", rows(py, &judged.reflection)?)?;
    Ok(found)
}
