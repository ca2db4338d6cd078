//! `gamut`: what a set of resins can reach.

use lumislice::{
    optics::{MaterialSet, ResinId},
    search::{ChannelGamut, Gamut, Judge, MatchOptions, RefineOptions, SearchOptions},
};
use numpy::{IntoPyArray, PyArray2};
use pyo3::{
    prelude::*,
    types::{PyAny, PyDict},
};

use crate::{
    resins::{Materials, core_of, limits_of},
    stacks::{layers_of, one_of},
    watched::watched,
};

/// Albedos and half-energy radii that stackings of one resin a layer can reach: a dict of model, and channels, a list
/// of dicts: channel, albedo (least, greatest), narrow and wide, the outlines (n × 2: albedo, radius in mm), and of
/// stackings spread over all of it point_albedo and point_half_energy_radius_mm (m), point_place (narrow, wide or
/// inside) and point_stack (pairs of resin and mm). `model` is transport, or km where a resin has no coefficients.
#[pyfunction]
#[pyo3(signature = (materials, *, core = None, max_thickness_mm = 5.0, min_depth_mm = None, depth = 6, model = None,
                    min_layer_mm = None, layer_step_mm = None, progress = None))]
#[allow(clippy::too_many_arguments)]
pub fn gamut<'py>(
    py: Python<'py>,
    materials: &Bound<'py, PyAny>,
    core: Option<&str>,
    max_thickness_mm: f64,
    min_depth_mm: Option<&Bound<'py, PyDict>>,
    depth: usize,
    model: Option<&str>,
    min_layer_mm: Option<f64>,
    layer_step_mm: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let set = Materials::of(materials, progress.as_ref())?;
    let known = set.resins.iter().all(|resin| resin.volumes().is_some());
    let model = model.unwrap_or(if known { "transport" } else { "km" });
    let judge = one_of("model", model, &[("transport", Judge::Transport), ("km", Judge::KubelkaMunk)])?;
    let layers = layers_of(min_layer_mm, layer_step_mm)?;
    let whole = (judge == Judge::KubelkaMunk).then_some(layers.min_layer_mm);
    let search = SearchOptions {
        max_thickness_mm,
        depth,
        limits: limits_of(&set, min_depth_mm)?,
        core: core_of(&set, core)?,
        ..SearchOptions::default()
    };
    let layers = RefineOptions { step_mm: layers.step_mm.or(whole), ..layers };
    let options = MatchOptions { search, judge, layers, mixtures: false };
    let found = watched(py, progress, |watch| {
        watch.stage("gamut", 0);
        Gamut::explore(&set, &options, watch)
    })?;
    let channels = set.channels.iter().zip(&found.channels).map(|(name, found)| channel(py, &set, name, found));
    let document = PyDict::new(py);
    document.set_item("model", model)?;
    document.set_item("channels", channels.collect::<PyResult<Vec<_>>>()?)?;
    Ok(document)
}

fn channel<'py>(py: Python<'py>, set: &MaterialSet, name: &str, found: &ChannelGamut) -> PyResult<Bound<'py, PyDict>> {
    let outline = |places: &[[f64; 2]]| -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(PyArray2::from_vec2(py, &places.iter().map(|place| place.to_vec()).collect::<Vec<_>>())?)
    };
    let layer = |(resin, mm): (&ResinId, f64)| (set[*resin].name.clone(), mm);
    let each = |value: fn(&lumislice::search::GamutPoint) -> f64| {
        found.points.iter().map(value).collect::<Vec<_>>().into_pyarray(py)
    };
    let places: Vec<_> = found.points.iter().map(|point| found.side(point).name()).collect();
    let stacks: Vec<Vec<_>> = found.points.iter().map(|point| point.stacking.pairs().map(layer).collect()).collect();
    let document = PyDict::new(py);
    document.set_item("channel", name)?;
    document.set_item("albedo", found.boundary.albedo().to_vec().into_pyarray(py))?;
    document.set_item("narrow", outline(found.boundary.narrow())?)?;
    document.set_item("wide", outline(found.boundary.wide())?)?;
    document.set_item("point_albedo", each(|point| point.albedo))?;
    document.set_item("point_half_energy_radius_mm", each(|point| point.half_energy_radius_mm))?;
    document.set_item("point_place", places)?;
    document.set_item("point_stack", stacks)?;
    Ok(document)
}
