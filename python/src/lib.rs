//! The extension module of the Python package `gyre`: the libraries of `shared/`, with scans,
//! rasters and points as numpy arrays.
//!
//! Reading order: `config`, `dataset`, `scan` (whose memory is numpy's), `odometry` and
//! `registered`, `masker`, `slam`, `trajectory`, `evaluation`; `run`, for running runs; `errors`
//! and `values` convert errors and values between Rust and Python. `package/` holds the part that
//! is written in Python.
//!
//! The GIL is released while scans are decoded and computed. Each object of Rust that changes is
//! behind a lock, which is taken without the GIL: two threads that share one wait for each other,
//! and never block the interpreter.

mod config;
mod dataset;
mod errors;
mod evaluation;
mod inspect;
mod lock;
mod masker;
mod numpy_arrays;
mod odometry;
mod opened;
mod pose;
mod registered;
mod run;
mod scan;
mod slam;
mod trajectory;
mod values;

use std::path::Path;

use gyre_masking::networks::runtime::search_packages;
use pyo3::{prelude::*, types::PyModule};

/// The part of the package that is written in Rust.
#[pymodule]
mod _gyre {
    #[pymodule_export]
    use super::{
        config::Config,
        dataset::{Dataset, find_ground_truth, open},
        evaluation::{Evaluation, evaluate},
        inspect::{Report, inspect},
        masker::{Masked, Masker},
        odometry::Odometry,
        pose::Pose,
        registered::Registered,
        run::{Message, Messages, Run},
        scan::Scan,
        slam::{Loop, Slam},
        trajectory::Trajectory,
    };

    use super::*;

    /// Learned masks find ONNX Runtime where pip has installed it, beside this package.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let file = module.filename()?;
        if let Some(packages) = Path::new(file.to_str()?).ancestors().nth(2) {
            search_packages(packages.to_owned());
        }
        Ok(())
    }

    /// The version of the package.
    #[pymodule_export]
    #[allow(non_upper_case_globals)] // The name that Python gives it.
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
