//! Configuration class: `pipeline.toml`, read and validated once, with its installations table.
#![expect(clippy::needless_pass_by_value, reason = "Python hands values over")]

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use records::Installations;

use crate::error::{ExceptionClass, to_exception, to_run_exception};

/// The version written into every record.
pub(crate) const VERSION: &str = env!("CARGO_PKG_VERSION");

/// A checked configuration. Keys of later files override those of earlier ones, as with `--config A --config B`.
#[pyclass(frozen, module = "freeplay_ema")]
pub(crate) struct Config {
    pub(crate) inner: job::Config,
    files: Vec<PathBuf>,
    installations: OnceLock<Installations>,
}

#[pymethods]
impl Config {
    /// Reads and checks the files.
    #[new]
    fn new(py: Python<'_>, files: Vec<PathBuf>) -> PyResult<Self> {
        // Workers and other folders must find the same files.
        let absolute = |file: &PathBuf| std::path::absolute(file).unwrap_or_else(|_| file.clone());
        let whole: Vec<PathBuf> = files.iter().map(absolute).collect();
        let inner = py
            .detach(|| job::Config::read_layers(&files))
            .map_err(|diagnostics| to_exception(py, ExceptionClass::Config, &diagnostics))?;
        Ok(Self { inner, files: whole, installations: OnceLock::new() })
    }

    /// Reads and checks a text whose relative paths start from a folder.
    #[staticmethod]
    fn parse(py: Python<'_>, text: &str, folder: PathBuf) -> PyResult<Self> {
        let inner = job::Config::parse(text, Path::new("configuration"), &folder)
            .map_err(|diagnostics| to_exception(py, ExceptionClass::Config, &diagnostics))?;
        Ok(Self { inner, files: Vec::new(), installations: OnceLock::new() })
    }

    /// A configuration without logs: defaults, to assess tables that other programs made.
    #[staticmethod]
    fn without_logs() -> Self {
        let installations = OnceLock::from(Installations::default());
        Self { inner: job::Config::default(), files: Vec::new(), installations }
    }

    /// The files it was read from, absolute; none when it was read from a text.
    #[getter]
    fn files(&self) -> Vec<PathBuf> {
        self.files.clone()
    }

    /// The folder of the results.
    #[getter]
    fn store(&self) -> PathBuf {
        self.inner.store()
    }

    /// The part numbers it knows.
    #[getter]
    fn parts(&self) -> Vec<String> {
        self.inner.parts.keys().map(ToString::to_string).collect()
    }

    /// Copy with other logs, another store, or a limit in m for parts without one.
    #[pyo3(signature = (logs=None, store=None, limit_m=None))]
    fn replaced(
        &self,
        logs: Option<Vec<String>>,
        store: Option<String>,
        limit_m: Option<f64>,
    ) -> PyResult<Self> {
        let mut inner = self.inner.clone();
        if let Some(logs) = logs {
            inner.document.logs.files = logs;
        }
        if let Some(store) = store {
            inner.document.store.path = store;
        }
        if let Some(limit_m) = limit_m {
            let limit_m = job::config::limits::plausible_limit_m(limit_m).map_err(PyValueError::new_err)?;
            inner.document.trend.limit_m = Some(limit_m);
        }
        Ok(Self { inner, files: self.files.clone(), installations: self.installations.clone() })
    }

    /// BLAKE3 digest of program version, configuration files and tables; workers must have the same.
    fn digest(&self) -> PyResult<String> {
        let mut hash = blake3::Hasher::new();
        let logs = &self.inner.document.logs;
        let tables = std::iter::once(&logs.installations).chain(&logs.flights);
        let files = self.files.iter().cloned().chain(tables.map(|table| self.inner.path(table)));
        hash.update(VERSION.as_bytes());
        for file in files {
            let bytes = std::fs::read(&file)?;
            hash.update(&(bytes.len() as u64).to_le_bytes());
            hash.update(&bytes);
        }
        Ok(hash.finalize().to_hex().to_string())
    }
}

impl Config {
    /// Installations table, read on first use.
    pub(crate) fn installations(&self, py: Python<'_>) -> PyResult<&Installations> {
        if let Some(known) = self.installations.get() {
            return Ok(known);
        }
        let read = py.detach(|| pipeline::run::scheduler::installations(&self.inner));
        let read = read.map_err(|error| to_run_exception(py, error))?;
        Ok(self.installations.get_or_init(|| read))
    }

    /// Result of work on the configuration and its installations table, done without Python's lock.
    pub(crate) fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&job::Config, &Installations) -> Result<T, pipeline::Error> + Send,
    ) -> PyResult<T> {
        let installations = self.installations(py)?;
        py.detach(|| work(&self.inner, installations)).map_err(|error| to_run_exception(py, error))
    }
}
