//! Resins: `materials`, and the class that every call about stacks takes.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use lumislice::{
    job::file::min_depth_limits,
    optics::{MaterialFile, MaterialSet, Mixture, OpticsError, ResinId, Stack},
    search::ResinLimit,
    watch::Watch,
};
use numpy::{IntoPyArray, PyArray1};
use pyo3::{
    prelude::*,
    types::{PyAny, PyDict},
};

use crate::watched::{InputError, raised, watched};

/// Resins of a printer, with what they do to light.
#[pyclass(frozen, module = "lumislice")]
pub struct Materials {
    set: Arc<MaterialSet>,
    /// Why resins have no coefficients, one line for each that has none.
    unfitted: Vec<String>,
}

fn read(name: &str, watch: &dyn Watch) -> Result<(MaterialSet, Vec<String>), OpticsError> {
    let (mut file, _) = MaterialFile::named(Path::new(name))?;
    let unfitted = file.fit(None, watch)?;
    Ok((file.into_set(watch)?, unfitted))
}

/// Reads a material file (TOML), or a built-in set by its name; fits coefficients to resins that are given by profiles.
#[pyfunction]
#[pyo3(signature = (name, *, progress = None))]
pub fn materials(py: Python<'_>, name: &str, progress: Option<Py<PyAny>>) -> PyResult<Materials> {
    let (set, unfitted) = watched(py, progress, |watch| read(name, watch))?;
    Ok(Materials { set: Arc::new(set), unfitted })
}

impl Materials {
    /// The resins themselves.
    pub fn set(&self) -> &Arc<MaterialSet> {
        &self.set
    }

    /// What `given` stands for: materials, or the name of some.
    pub fn of(given: &Bound<'_, PyAny>, progress: Option<&Py<PyAny>>) -> PyResult<Arc<MaterialSet>> {
        if let Ok(materials) = given.cast::<Materials>() {
            return Ok(materials.get().set.clone());
        }
        let name = given.str()?.to_string();
        let progress = progress.map(|progress| progress.clone_ref(given.py()));
        Ok(materials(given.py(), &name, progress)?.set)
    }
}

/// The resin of a name, if one is given.
pub fn core_of(set: &MaterialSet, core: Option<&str>) -> PyResult<Option<ResinId>> {
    let found = |name: &str| match set.resin(name) {
        Some((id, _)) => Ok(id),
        None => match set.mixture(name) {
            Err(error) => Err(raised(&error)),
            Ok(_) => Err(InputError::new_err(format!("core: found {name}, expected one resin"))),
        },
    };
    core.map(found).transpose()
}

/// Layers as text, `"white:0.5,support:1"`, or as pairs of a resin (or mixture) and mm.
pub fn stack_of(set: &MaterialSet, given: &Bound<'_, PyAny>, core: Option<&str>) -> PyResult<Stack<Mixture>> {
    let text = match given.extract::<String>() {
        Ok(text) => text,
        Err(_) => {
            let pairs: Vec<(String, f64)> = given.extract()?;
            pairs.iter().map(|(name, mm)| format!("{name}:{mm}")).collect::<Vec<_>>().join(",")
        }
    };
    let named: Stack<String> = text.parse().map_err(|error| InputError::new_err(format!("stack: {error}")))?;
    set.mixed_stack(&named.over(core.map(str::to_owned))).map_err(|error| raised(&error))
}

/// Depths that resins keep from the surface; support keeps its own unless it is given one.
pub fn limits_of(set: &MaterialSet, given: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<ResinLimit>> {
    let given: BTreeMap<String, f64> = given.map(|given| given.extract()).transpose()?.unwrap_or_default();
    for (name, mm) in &given {
        core_of(set, Some(name))?;
        if !(0.0..=100.0).contains(mm) {
            return Err(InputError::new_err(format!("min_depth_mm: {name}: found {mm}, expected mm, 0 to 100")));
        }
    }
    let names = set.resins.iter().map(|resin| resin.name.as_str());
    Ok(min_depth_limits(names, |name| given.get(name).copied()))
}

#[pymethods]
impl Materials {
    /// Name of the set.
    #[getter]
    fn name(&self) -> &str {
        &self.set.name
    }

    /// Where its numbers come from.
    #[getter]
    fn provenance(&self) -> &str {
        &self.set.provenance
    }

    /// Names of the channels.
    #[getter]
    fn channels(&self) -> Vec<String> {
        self.set.channels.clone()
    }

    /// Names of the resins.
    #[getter]
    fn resins(&self) -> Vec<String> {
        self.set.resins.iter().map(|resin| resin.name.clone()).collect()
    }

    /// What was done to the data of a file, and what was not.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.set.warnings.iter().chain(&self.unfitted).cloned().collect()
    }

    /// Spatial frequencies of all transforms, rad/mm.
    #[getter]
    fn k_rad_per_mm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.set.grid.as_slice().to_vec().into_pyarray(py)
    }

    /// Coefficients of a resin, arrays of one value for each channel: scattering_per_mm, absorption_per_mm, g; None
    /// where it has none. refractive_index is a number.
    fn coefficients<'py>(&self, py: Python<'py>, resin: &str) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(id) = core_of(&self.set, Some(resin))? else { return Ok(None) };
        let resin = &self.set[id];
        let Some(volumes) = resin.volumes() else { return Ok(None) };
        let found = PyDict::new(py);
        found.set_item("scattering_per_mm", volumes.iter().map(|v| v.sigma_s).collect::<Vec<_>>().into_pyarray(py))?;
        found.set_item("absorption_per_mm", volumes.iter().map(|v| v.sigma_a).collect::<Vec<_>>().into_pyarray(py))?;
        found.set_item("g", volumes.iter().map(|v| v.g).collect::<Vec<_>>().into_pyarray(py))?;
        found.set_item("refractive_index", resin.refractive_index)?;
        Ok(Some(found))
    }

    fn __repr__(&self) -> String {
        format!("Materials({:?}, resins={:?}, channels={:?})", self.set.name, self.resins(), self.set.channels)
    }
}
