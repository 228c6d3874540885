//! The description of a recording.

use std::path::PathBuf;

use gyre_datasets::InspectedLogs;
use pyo3::prelude::*;

use crate::{config::Config, errors, values};

/// Examines a recording: its contents and its apparent faults. The section `dataset` of `config`
/// determines how the recording is opened; without `config`, the format does. Raises ReadError.
#[pyfunction]
#[pyo3(signature = (data, config=None))]
pub fn inspect(
    py: Python<'_>,
    data: PathBuf,
    config: Option<&Bound<'_, Config>>,
) -> PyResult<Report> {
    let method = Config::method(config);
    let options = method.dataset;
    let logs = InspectedLogs {
        gnss_topic: method.gnss.topic,
        m_per_tick: method.odometry.sensors.wheels.m_per_tick,
    };
    let report = py.detach(|| {
        let dataset = gyre_recording::open(&data, &options)?;
        Ok(gyre_datasets::inspect_dataset(
            &data, dataset, &options, &logs,
        ))
    });
    report.map(Report).map_err(errors::open)
}

/// The content of a recording. `str(report)` is a text, and `to_dict()` has every figure.
#[pyclass(module = "gyre", frozen)]
pub struct Report(gyre_datasets::Report);

#[pymethods]
impl Report {
    /// The problems that were found: whole sentences.
    #[getter]
    fn findings(&self) -> Vec<String> {
        self.0.findings.clone()
    }

    /// Returns all figures, by the names of `gyre inspect --json`.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::dictionary(py, &self.0)
    }

    fn __str__(&self) -> String {
        self.0.to_string()
    }

    fn __repr__(&self) -> String {
        let (root, format, scans) = (self.0.root.display(), self.0.format, self.0.scans);
        format!("<gyre.Report {root}: {format}, {scans} scans>")
    }
}
