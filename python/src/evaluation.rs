//! Trajectories against ground truth.

use std::{num::NonZeroUsize, path::PathBuf};

use gyre_results::evaluation::plot::{errors_svg, trajectory_svg};
use pyo3::{exceptions::PyValueError, prelude::*};

use crate::{errors, trajectory::Trajectory, values};

/// Compares an estimated trajectory with the ground truth: by time, or pose by pose where one of
/// them has no times.
///
/// `step` is the number of poses from the start of a segment of KITTI and seg to the start of the
/// next; published figures use 10 or 4. Raises TrajectoryError if they cannot be compared.
#[pyfunction]
#[pyo3(signature = (estimate, truth, step=10))]
pub fn evaluate(
    py: Python<'_>,
    estimate: &Bound<'_, Trajectory>,
    truth: &Bound<'_, Trajectory>,
    step: usize,
) -> PyResult<Evaluation> {
    let step = NonZeroUsize::new(step);
    let step = step.ok_or_else(|| PyValueError::new_err("step is 0, but must be 1 or more"))?;
    let (estimate, truth) = (&estimate.get().0, &truth.get().0);
    let evaluation = py.detach(|| gyre_results::evaluation::evaluate(estimate, truth, step));
    evaluation.map(Evaluation).map_err(errors::trajectory)
}

/// The errors of a trajectory against ground truth. `str(evaluation)` is a table, and `to_dict()`
/// has every figure.
#[pyclass(module = "gyre", frozen)]
pub struct Evaluation(gyre_results::evaluation::Evaluation);

#[pymethods]
impl Evaluation {
    /// The path length of the ground truth over the compared poses, m.
    #[getter]
    fn path_m(&self) -> f64 {
        self.0.path_m
    }

    /// The absolute trajectory error: the RMS distance of positions after SE(2) alignment, m.
    #[getter]
    fn ate_m(&self) -> f64 {
        self.0.ate.rmse_m
    }

    /// The translation error of KITTI, %; None for a path up to 100 m or a ground truth without
    /// heading.
    #[getter]
    fn translation_percent(&self) -> Option<f64> {
        self.0.kitti.as_ref().map(|kitti| kitti.translation_percent)
    }

    /// The rotation error of KITTI, degrees in 100 m; None as `translation_percent`.
    #[getter]
    fn rotation_deg_per_100m(&self) -> Option<f64> {
        let kitti = self.0.kitti.as_ref();
        kitti.map(|kitti| kitti.rotation_deg_per_100m)
    }

    /// The error of segments that are aligned by themselves, % of their length; None for a path up
    /// to 100 m.
    #[getter]
    fn seg_percent(&self) -> Option<f64> {
        self.0.seg.as_ref().map(|seg| seg.percent)
    }

    /// Returns all figures, by the names of `gyre evaluate --json`.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::dictionary(py, &self.0)
    }

    /// Draws the aligned estimate over the ground truth into an SVG file.
    fn plot(&self, path: PathBuf) -> PyResult<()> {
        gyre_storage::write(&path, self._repr_svg_()?).map_err(errors::write)
    }

    /// Draws the errors over the length of segments into an SVG file; over the distance travelled
    /// where the path is too short for KITTI.
    fn plot_errors(&self, path: PathBuf) -> PyResult<()> {
        let svg = errors_svg(&self.0).map_err(errors::trajectory)?;
        gyre_storage::write(&path, svg).map_err(errors::write)
    }

    /// Returns the drawing of `plot`, which notebooks show.
    fn _repr_svg_(&self) -> PyResult<String> {
        trajectory_svg(&self.0.matched).map_err(errors::trajectory)
    }

    fn __str__(&self) -> String {
        format!("{:#}", self.0)
    }

    fn __repr__(&self) -> String {
        let (ate_m, path_m) = (self.ate_m(), self.path_m());
        format!("<gyre.Evaluation ate_m={ate_m:.3} over {path_m:.1} m>")
    }
}
