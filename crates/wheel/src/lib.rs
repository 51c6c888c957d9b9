//! The Python module `freeplay._freeplay`: the command's own rows, through Arrow's C interface.
//!
//! Nothing is computed here. Settings, logs and tables go to the floors below, whose answers become tables and
//! whose diagnostics become exceptions; work is done without Python's lock.

mod capsule;
mod door;
mod error;
mod numbers;
mod settings;
mod spark;
mod table;

use pyo3::prelude::*;

/// The version written into every record.
const VERSION: &str = env!("CARGO_PKG_VERSION");

#[pymodule]
fn _freeplay(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", VERSION)?;
    module.add_class::<settings::Config>()?;
    module.add_class::<table::Table>()?;
    module.add_function(wrap_pyfunction!(door::estimate, module)?)?;
    module.add_function(wrap_pyfunction!(door::estimate_arrays, module)?)?;
    module.add_function(wrap_pyfunction!(door::trace, module)?)?;
    module.add_function(wrap_pyfunction!(door::trend, module)?)?;
    module.add_function(wrap_pyfunction!(door::records, module)?)?;
    module.add_function(wrap_pyfunction!(door::normalize, module)?)?;
    module.add_function(wrap_pyfunction!(door::run, module)?)?;
    module.add_function(wrap_pyfunction!(numbers::address, module)?)?;
    module.add_function(wrap_pyfunction!(spark::answer, module)?)?;
    module.add_function(wrap_pyfunction!(spark::no_answer, module)?)?;
    module.add_function(wrap_pyfunction!(spark::run_elsewhere, module)?)?;
    Ok(())
}
