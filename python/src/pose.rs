//! Poses and motions.

use std::fmt;

use gyre_geometry::{UncertainMotion, xy_yaw};
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::numpy_arrays;

/// The pose of a frame in another frame, with its covariance: x forward and y left in m, yaw
/// counter-clockwise in rad.
///
/// A motion is the pose of the later scan in the frame of the earlier one.
#[pyclass(module = "gyre", frozen)]
pub struct Pose(pub UncertainMotion);

#[pymethods]
impl Pose {
    /// Forward, m.
    #[getter]
    fn x_m(&self) -> f64 {
        xy_yaw(&self.0.motion)[0]
    }

    /// To the left, m.
    #[getter]
    fn y_m(&self) -> f64 {
        xy_yaw(&self.0.motion)[1]
    }

    /// Counter-clockwise, rad in (-pi, pi].
    #[getter]
    fn yaw_rad(&self) -> f64 {
        xy_yaw(&self.0.motion)[2]
    }

    /// The covariance of (x, y, yaw) along the axes of the reference frame, float64 (3, 3): m^2, m
    /// rad and rad^2.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        numpy_arrays::matrix(py, &self.0.covariance)
    }

    /// The homogeneous matrix, float64 (3, 3): it maps points (x, y, 1), m, into the reference
    /// frame.
    #[getter]
    fn matrix<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        numpy_arrays::matrix(py, &self.0.motion.to_homogeneous())
    }

    fn __repr__(&self) -> String {
        self.to_string()
    }
}

impl fmt::Display for Pose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x_m, y_m, yaw_rad] = xy_yaw(&self.0.motion);
        write!(f, "Pose(x_m={x_m:.3}, y_m={y_m:.3}, yaw_rad={yaw_rad:.5})")
    }
}
