//! The Python module `freeplay_ema._freeplay`: the rows of the command `freeplay`, through Arrow's C interface.
//!
//! Nothing is computed here. Settings, logs and tables go to the lower layers, whose results become tables and
//! whose diagnostics become exceptions; the lower layers run without Python's global lock (GIL).

mod arrow_capsule;
mod config;
mod error;
mod functions;
mod numpy_input;
mod spark_worker;
mod store_results;
mod table;

#[pyo3::pymodule]
mod _freeplay {
    #[pymodule_export]
    use crate::config::Config;
    #[pymodule_export]
    use crate::functions::{check, estimate_arrays, estimate_logs, normalize, run, trace};
    #[pymodule_export]
    use crate::numpy_input::data_pointer;
    #[pymodule_export]
    use crate::spark_worker::{process_task, run_distributed};
    #[pymodule_export]
    use crate::store_results::{backtest_forecasts, diff, explain, followed, records, report, trend, work};
    #[pymodule_export]
    use crate::table::Table;

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "Python reads this name")]
    const __version__: &str = crate::config::VERSION;
}
