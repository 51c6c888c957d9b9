//! The Python module `freeplay_ema._freeplay`: the command's own rows, through Arrow's C interface.
//!
//! Nothing is computed here. Settings, logs and tables go to the lower layers, whose results become tables and
//! whose diagnostics become exceptions; work is done without Python's lock.

mod arrow_capsule;
mod config;
mod error;
mod functions;
mod numpy_input;
mod spark_worker;
mod store_results;
mod table;

use pyo3::prelude::*;

/// The version written into every record.
const VERSION: &str = env!("CARGO_PKG_VERSION");

#[pymodule]
fn _freeplay(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", VERSION)?;
    module.add_class::<config::Config>()?;
    module.add_class::<table::Table>()?;
    module.add_function(wrap_pyfunction!(functions::estimate_logs, module)?)?;
    module.add_function(wrap_pyfunction!(functions::estimate_arrays, module)?)?;
    module.add_function(wrap_pyfunction!(functions::trace, module)?)?;
    module.add_function(wrap_pyfunction!(store_results::trend, module)?)?;
    module.add_function(wrap_pyfunction!(store_results::records, module)?)?;
    module.add_function(wrap_pyfunction!(functions::normalize, module)?)?;
    module.add_function(wrap_pyfunction!(functions::run, module)?)?;
    module.add_function(wrap_pyfunction!(store_results::followed, module)?)?;
    module.add_function(wrap_pyfunction!(store_results::backtest_forecasts, module)?)?;
    module.add_function(wrap_pyfunction!(store_results::diff, module)?)?;
    module.add_function(wrap_pyfunction!(store_results::explain, module)?)?;
    module.add_function(wrap_pyfunction!(store_results::report, module)?)?;
    module.add_function(wrap_pyfunction!(store_results::work, module)?)?;
    module.add_function(wrap_pyfunction!(functions::check, module)?)?;
    module.add_function(wrap_pyfunction!(numpy_input::data_pointer, module)?)?;
    module.add_function(wrap_pyfunction!(spark_worker::process_task, module)?)?;
    module.add_function(wrap_pyfunction!(spark_worker::run_distributed, module)?)?;
    Ok(())
}
