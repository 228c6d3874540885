//! Configurations.

use std::path::PathBuf;

use gyre_configuration::{
    MethodConfig, automatic,
    paths::{Named, resolve},
    strict,
};
use gyre_datasets::Format;
use pyo3::{
    prelude::*,
    types::{PyMapping, PyTuple},
};
use toml::Table;

use crate::{errors, values};

/// The settings of the method and the constants of a radar: the sections `dataset`, `raster`,
/// `points`, `masking`, `search`, `rotation`, `translation`, `exhaustive`, `refinement` and `slam`
/// of a configuration of `gyre run`, with the same keys and defaults.
///
/// `Config()` has the defaults, and `Config({"masking": {"threshold": 70}})` differs from them in
/// one key. Unknown keys and values out of their bounds raise ConfigError. A key with the value
/// `None` stands for the default. A configuration never changes, and can be pickled.
#[pyclass(module = "gyre", frozen, eq)]
pub struct Config {
    method: MethodConfig,
    note: Option<String>,
}

/// Configurations are equal if their settings are, wherever these are from.
impl PartialEq for Config {
    fn eq(&self, other: &Self) -> bool {
        self.method == other.method
    }
}

impl Config {
    /// Returns the settings, the defaults where there is no configuration.
    pub fn method(config: Option<&Bound<'_, Self>>) -> MethodConfig {
        config.map_or_else(MethodConfig::default, |config| config.get().method.clone())
    }

    fn from_table(mut table: Table, note: Option<String>) -> PyResult<Self> {
        resolve(&mut table).map_err(errors::config)?;
        let method = MethodConfig::take(&mut table).map_err(errors::config)?;
        if let Some(key) = table.keys().next() {
            let unknown = strict::unknown("the configuration", key, &MethodConfig::sections());
            return Err(errors::config(unknown));
        }
        MethodConfig::check(&method.odometry, &method.gnss).map_err(errors::config)?;
        method.dataset.check().map_err(errors::config)?;
        Ok(Self { method, note })
    }
}

#[pymethods]
impl Config {
    #[new]
    #[pyo3(signature = (sections=None))]
    fn new(sections: Option<&Bound<'_, PyMapping>>) -> PyResult<Self> {
        let table = sections.map(values::table).transpose()?;
        Self::from_table(table.unwrap_or_default(), None)
    }

    /// Reads a TOML file, or one of Gyre's configurations by its name as `oxford`, as `gyre run`
    /// does. Relative paths in it start at its folder; Gyre's own files, as `models/gyre-255.toml`,
    /// are found too. `note` receives a sentence with the place of a file if that is not clear. Its
    /// sections `run`, `source`, `simulation`, `budget`, `record` and `stages`, which are for a run
    /// of processes, are ignored. `overrides` replaces keys: `{"masking.kind": "none"}`.
    #[staticmethod]
    #[pyo3(signature = (path, overrides=None))]
    fn read(path: PathBuf, overrides: Option<&Bound<'_, PyMapping>>) -> PyResult<Self> {
        let named = Named::read(&path).map_err(errors::config)?;
        let mut table = named.table.clone();
        table.retain(|section, _| !MethodConfig::SECTIONS_OF_A_RUN.contains(&section));
        values::set_all(&mut table, overrides)?;
        let notes = named.notes(&table);
        let note = (!notes.is_empty()).then(|| notes.join("; "));
        Self::from_table(table, note)
    }

    /// Finds the settings of a recording, as `gyre run RECORDING` does without a configuration: the
    /// radar's constants come from its format or its `dataset.toml`, and eight of its scans give
    /// the threshold and the sizes of cells and beams. `note` receives a sentence with the
    /// findings. `overrides` replaces keys.
    #[staticmethod]
    #[pyo3(signature = (data, overrides=None))]
    fn of(
        py: Python<'_>,
        data: PathBuf,
        overrides: Option<&Bound<'_, PyMapping>>,
    ) -> PyResult<Self> {
        let mut wished = Table::new();
        values::set_all(&mut wished, overrides)?;
        let wished = Self::from_table(wished, None)?.method.dataset;
        let found = py.detach(|| automatic(&data, &wished));
        let mut found = found.map_err(errors::automatic)?;
        values::set_all(&mut found.table, overrides)?;
        Self::from_table(found.table, Some(found.sentence))
    }

    /// The settings that `Config.of` found in the recording, in a sentence; None for other
    /// configurations.
    #[getter]
    fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// Returns all settings as a dictionary of sections, which `Config` takes.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::dictionary(py, &self.method)
    }

    /// Returns how `pickle` makes the configuration again, without its note.
    fn __reduce__<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let settings = this.get().to_dict(this.py())?;
        (this.get_type(), (settings,)).into_pyobject(this.py())
    }

    /// Returns all settings as TOML, which `Config.read` and `gyre run` read.
    fn __str__(&self) -> PyResult<String> {
        toml::to_string(&self.method).map_err(errors::config)
    }

    fn __repr__(&self) -> String {
        let odometry = &self.method.odometry;
        let (kind, threshold) = (odometry.masking.kind, odometry.masking.threshold);
        let format = self.method.dataset.format;
        let format = format.map_or("any format", Format::name);
        format!("<gyre.Config {format}, masking.kind={kind:?}, masking.threshold={threshold}>")
    }
}
