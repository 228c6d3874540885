//! The exceptions of `package/gyre/errors.py`, with the sentences of the libraries.

use std::{ffi::CString, fmt::Display};

use gyre_configuration::AutomaticError;
use gyre_datasets::{LogError, OpenError};
use gyre_masking::MaskError;
use gyre_matching::odometry::OdometryError;
use gyre_radar::NoDoppler;
use pyo3::{prelude::*, sync::PyOnceLock, types::PyType};

/// Returns a function that makes exceptions of one type.
macro_rules! exception {
    ($name:ident, $class:literal) => {
        pub fn $name(reason: impl Display) -> PyErr {
            static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
            Python::attach(|py| match CLASS.import(py, "gyre.errors", $class) {
                Ok(class) => PyErr::from_type(class.clone(), reason.to_string()),
                Err(error) => error,
            })
        }
    };
}

exception!(other, "Error");
exception!(config, "ConfigError");
exception!(read, "ReadError");
exception!(write, "WriteError");
exception!(scan, "ScanError");
exception!(trajectory, "TrajectoryError");
exception!(run, "RunError");

/// A recording that cannot be opened, or options that it cannot have.
pub fn open(error: OpenError) -> PyErr {
    match error {
        OpenError::BadOption { .. } => config(error),
        error => read(error),
    }
}

/// A log of a gyro or of wheels.
pub fn log(error: LogError) -> PyErr {
    match error {
        LogError::None { .. } | LogError::Live { .. } => config(error),
        error => read(error),
    }
}

/// The radar reports no velocity by Doppler.
pub fn doppler(error: NoDoppler) -> PyErr {
    config(format!("doppler.kind is `auto`, but {error}"))
}

/// A recording whose settings cannot be found.
pub fn automatic(error: AutomaticError) -> PyErr {
    match error {
        AutomaticError::Open(error) => open(error),
        AutomaticError::Read(_) | AutomaticError::Empty => read(error),
        AutomaticError::Configuration(_) => config(error),
    }
}

/// A scan that cannot be used, or a network or a search that fails, which is not the scan's fault.
pub fn registration(error: OdometryError) -> PyErr {
    match error {
        OdometryError::Scan(_) | OdometryError::Mask(MaskError::Raster(_) | MaskError::Scan(_)) => {
            scan(error)
        }
        error => other(error),
    }
}

pub fn warn_of_skipped(py: Python<'_>, reason: impl Display) -> PyResult<()> {
    let class = py.import("gyre.errors")?.getattr("SkippedScanWarning")?;
    let sentence = CString::new(format!("skipped: {reason}").replace('\0', ""))?;
    PyErr::warn(py, &class, &sentence, 1)
}
