//! Odometry.

use std::sync::Mutex;

use gyre_odometry::OdometryError;
use pyo3::prelude::*;

use crate::{
    config::Config, errors, lock, masker, registered::Registered, scan::Scan,
    trajectory::Trajectory,
};

/// Radar odometry: registers scan after scan against the previous ones.
///
/// `Odometry(config)` takes the settings of `gyre run`, and finds its motions to the last bit. Two threads can each have their own.
#[pyclass(module = "gyre", frozen)]
pub struct Odometry(Mutex<State>);

struct State {
    odometry: gyre_odometry::Odometry,
    trajectory: gyre_radar::Trajectory,
}

impl State {
    fn register(&mut self, scan: &gyre_radar::PolarScan<'_>) -> Result<Registered, OdometryError> {
        let registered = self.odometry.register(scan)?;
        let stamp_ns = scan.geometry.stamp_ns;
        let stamps = self.trajectory.stamp_ns.get_or_insert_default();
        stamps.push(stamp_ns);
        self.trajectory.poses.push(registered.pose.motion);
        Ok(Registered {
            registered,
            stamp_ns,
        })
    }
}

#[pymethods]
impl Odometry {
    #[new]
    #[pyo3(signature = (config=None))]
    fn new(py: Python<'_>, config: Option<&Bound<'_, Config>>) -> PyResult<Self> {
        let config = Config::method(config).odometry;
        let odometry = py.detach(|| gyre_odometry::Odometry::new(&config));
        Ok(Self(Mutex::new(State {
            odometry: odometry.map_err(errors::config)?,
            trajectory: gyre_radar::Trajectory::default(),
        })))
    }

    /// Registers the next scan: estimates its motion from the previous scan, and its pose.
    ///
    /// A scan that is not later than the previous one, or by more than 10 s, starts a new chain of motions. A scan that cannot be used
    /// raises ScanError and is left out: the next one is registered against the scan before it.
    fn register(&self, py: Python<'_>, scan: &Bound<'_, Scan>) -> PyResult<Registered> {
        let borrowed = scan.get().borrowed(py)?;
        let scan = borrowed.view()?;
        lock::with(py, &self.0, |state| state.register(&scan)).map_err(errors::scan)
    }

    /// Starts a new chain of motions with the next scan; the pose stays.
    fn restart(&self, py: Python<'_>) {
        lock::with(py, &self.0, |state| state.odometry.restart());
    }

    /// The poses of all registered scans, in the frame of the first one, up to now.
    #[getter]
    fn trajectory(&self, py: Python<'_>) -> Trajectory {
        Trajectory(lock::with(py, &self.0, |state| state.trajectory.clone()))
    }

    /// The sparse points of the last registered scan, a copy: see `Masked.points`.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let points = lock::with(py, &self.0, |state| {
            bytemuck::cast_slice(state.odometry.points()).to_vec()
        });
        let count = points.len() / masker::FIELDS.len();
        masker::points(&numpy::PyArray1::from_vec(py, points), count)
    }
}
