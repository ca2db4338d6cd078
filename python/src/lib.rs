//! lumislice for Python: the library's calls with NumPy arrays in and out, progress, Ctrl-C, and its words as
//! exceptions.

mod gamut;
mod jobs;
mod resins;
mod stacks;
mod watched;

use pyo3::prelude::*;

#[pymodule]
fn _lumislice(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("InputError", module.py().get_type::<watched::InputError>())?;
    module.add_class::<resins::Materials>()?;
    module.add_function(wrap_pyfunction!(resins::materials, module)?)?;
    module.add_function(wrap_pyfunction!(stacks::predict, module)?)?;
    module.add_function(wrap_pyfunction!(stacks::match_, module)?)?;
    module.add_function(wrap_pyfunction!(gamut::gamut, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::slice, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::look, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::factor, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::measure, module)?)?;
    Ok(())
}
