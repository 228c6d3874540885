//! Trajectories and their files.

use std::{io, path::PathBuf};

use gyre_datasets::{read_trajectory, write_kitti, write_tum};
use gyre_geometry::{Pose, pose, xy_yaw};
use gyre_results::evaluation::plot::path_svg;
use ndarray::{Array2, Ix2};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::{prelude::*, types::PyTuple};

use crate::{
    errors,
    numpy_arrays::{converted, readable, sliceable},
    pose,
};

/// Poses of the sensor over time.
///
/// stamp_ns: int64 (poses,), ns, not decreasing; None for poses without times. poses: float64
/// (poses, 3), x forward and y left in m, yaw counter-clockwise in rad; or a sequence of Pose.
#[pyclass(module = "gyre", frozen)]
pub struct Trajectory(pub gyre_radar::Trajectory);

impl Trajectory {
    fn write(
        &self,
        path: &std::path::Path,
        write: impl FnOnce(&gyre_radar::Trajectory, &mut Vec<u8>) -> io::Result<()>,
    ) -> PyResult<()> {
        let mut text = Vec::new();
        write(&self.0, &mut text).map_err(errors::trajectory)?;
        gyre_storage::write(path, text).map_err(errors::write)
    }
}

fn poses(given_poses: &Bound<'_, PyAny>) -> PyResult<Vec<Pose>> {
    const EXPECTED: &str = "float64 with shape (poses, 3), or a sequence of gyre.Pose";
    if let Ok(poses) = given_poses.extract::<Vec<Bound<'_, pose::Pose>>>() {
        return Ok(poses.iter().map(|pose| pose.get().0.motion).collect());
    }
    let array = sliceable::<f64>(given_poses)?;
    let array = readable::<f64, Ix2>(&array, "poses", EXPECTED)?;
    let columns = array.shape()[1];
    if columns != 3 {
        return Err(errors::trajectory(format!(
            "poses has {columns} columns, expected {EXPECTED}"
        )));
    }
    let (rows, _) = array.as_slice()?.as_chunks::<3>();
    let pose_of = |(row, values): (usize, &[f64; 3])| match values.map(f64::is_finite) {
        [true, true, true] => Ok(pose(values[0], values[1], values[2])),
        _ => Err(errors::trajectory(format!("pose {row} is not finite"))),
    };
    rows.iter().enumerate().map(pose_of).collect()
}

#[pymethods]
impl Trajectory {
    #[new]
    fn new(stamp_ns: Option<&Bound<'_, PyAny>>, poses: &Bound<'_, PyAny>) -> PyResult<Self> {
        let poses = self::poses(poses)?;
        let stamps = |stamps| converted::<i64>(stamps, "stamp_ns", "one int64 for each pose, ns");
        let stamps = stamp_ns.map(stamps).transpose()?;
        let stamp_ns = stamps.map(|stamps| stamps.to_vec()).transpose()?;
        if let Some(stamps) = &stamp_ns {
            if stamps.len() != poses.len() {
                let (stamps, poses) = (stamps.len(), poses.len());
                return Err(errors::trajectory(format!(
                    "there are {stamps} stamps and {poses} poses"
                )));
            }
            if let Some(earlier) = stamps.windows(2).position(|pair| pair[1] < pair[0]) {
                return Err(errors::trajectory(format!(
                    "the stamps decrease at pose {}",
                    earlier + 1
                )));
            }
        }
        Ok(Self(gyre_radar::Trajectory { stamp_ns, poses }))
    }

    /// Reads a file of TUM, KITTI, Oxford, Boreas or MulRan, and converts it to x forward, y left.
    /// Raises ReadError.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = py.detach(|| read_trajectory(&path));
        read.map(Self).map_err(errors::read)
    }

    /// The time of each pose, int64 (poses,), ns; None for poses without times.
    #[getter]
    fn stamp_ns<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<i64>>> {
        let stamps = self.0.stamp_ns.as_deref();
        stamps.map(|stamps| PyArray1::from_slice(py, stamps))
    }

    /// The poses, float64 (poses, 3): x forward and y left in m, yaw counter-clockwise in rad.
    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let values: Vec<[f64; 3]> = self.0.poses.iter().map(xy_yaw).collect();
        let element = |(row, column): (usize, usize)| values[row][column];
        PyArray2::from_owned_array(py, Array2::from_shape_fn((values.len(), 3), element))
    }

    /// The length of the path, m.
    #[getter]
    fn path_m(&self) -> f64 {
        self.0.path_length_m()
    }

    /// Writes the poses as TUM: s, m and a quaternion.
    fn write_tum(&self, path: PathBuf) -> PyResult<()> {
        self.write(&path, write_tum)
    }

    /// Writes the poses as KITTI: 3 x 4 matrices, row by row, without times.
    fn write_kitti(&self, path: PathBuf) -> PyResult<()> {
        self.write(&path, write_kitti)
    }

    /// Draws the trajectory from above into an SVG file.
    fn plot(&self, path: PathBuf) -> PyResult<()> {
        gyre_storage::write(&path, self._repr_svg_()?).map_err(errors::write)
    }

    /// Returns how `pickle` makes the trajectory again.
    fn __reduce__<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, trajectory) = (this.py(), this.get());
        let arguments = (trajectory.stamp_ns(py), trajectory.poses(py));
        (this.get_type(), arguments).into_pyobject(py)
    }

    /// Returns the drawing, which notebooks show.
    fn _repr_svg_(&self) -> PyResult<String> {
        path_svg(&self.0.poses, self.0.len(), self.path_m()).map_err(errors::trajectory)
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __repr__(&self) -> String {
        let (poses, path_m) = (self.0.len(), self.path_m());
        format!("<gyre.Trajectory {poses} poses, {path_m:.1} m>")
    }
}
