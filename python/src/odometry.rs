//! Odometry.

use gyre_geometry::samples::Sample;
use gyre_matching::odometry::OdometryError;
use pyo3::prelude::*;

use crate::{
    config::Config, errors, lock::Guarded, masker, registered::Registered, scan::Scan,
    trajectory::Trajectory,
};

/// Radar odometry: registers scan after scan against the previous ones.
///
/// `Odometry(config)` takes the settings of `gyre run`, and finds its motions to the last bit. Two
/// threads can each have their own.
#[pyclass(module = "gyre", frozen)]
pub struct Odometry(Guarded<State>);

struct State {
    odometry: gyre_matching::odometry::Odometry,
    trajectory: gyre_radar::Trajectory,
}

impl State {
    fn register(
        &mut self,
        scan: &gyre_geometry::PolarScan<'_>,
        samples: &[Sample],
    ) -> Result<Registered, OdometryError> {
        let mut registered = self.odometry.register(scan, samples)?;
        // Numbering is the same as in a run, which continues to count where a new chain starts.
        registered.seq = self.trajectory.len() as u64;
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
        let odometry = py.detach(|| gyre_matching::odometry::Odometry::new(&config));
        let state = State {
            odometry: odometry.map_err(errors::config)?,
            trajectory: gyre_radar::Trajectory::default(),
        };
        Ok(Self(Guarded::new("Odometry", state)))
    }

    /// Registers the next scan: estimates its motion from the previous scan, and its pose.
    ///
    /// A scan that is not later than the previous one, or by more than 10 s, starts a new chain of
    /// motions. The samples of gyro and wheels, `scan.gyro` and `scan.wheels`, are used with the
    /// noise in the sections `gyro` and `wheels`. A scan that cannot be used raises ScanError and
    /// is left out: the next one is registered against the scan before it. A network that fails
    /// raises Error.
    fn register(&self, py: Python<'_>, scan: &Bound<'_, Scan>) -> PyResult<Registered> {
        let borrowed = scan.get().borrowed(py)?;
        let (view, samples) = (borrowed.view()?, scan.get().samples());
        let registered = self.0.with(py, |state| state.register(&view, samples))?;
        registered.map_err(errors::registration)
    }

    /// Starts a new chain of motions with the next scan; the pose stays.
    fn restart(&self, py: Python<'_>) -> PyResult<()> {
        self.0.with(py, |state| state.odometry.restart())
    }

    /// The poses of all registered scans, in the frame of the first one, up to now.
    #[getter]
    fn trajectory(&self, py: Python<'_>) -> PyResult<Trajectory> {
        let trajectory = self.0.with(py, |state| state.trajectory.clone())?;
        Ok(Trajectory(trajectory))
    }

    /// The sparse points of the last registered scan, a copy: see `Masked.points`.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let points = self.0.with(py, |state| {
            bytemuck::cast_slice(state.odometry.points()).to_vec()
        })?;
        let count = points.len() / masker::FIELDS.len();
        masker::points(&numpy::PyArray1::from_vec(py, points), count)
    }
}
