//! SLAM: loops, and the trajectory corrected by them.

use std::{convert::Infallible, error::Error};

use gyre_geometry::{Pose, SparsePoint, UncertainMotion};
use gyre_slam::{
    Keyframe, KeyframeBuilder, LoopCloser, SUBMAP_REACH_M, ScanPose, TrajectoryEstimator,
};
use pyo3::prelude::*;

use crate::{
    config::Config, errors, lock::Guarded, masker, pose, registered::Registered,
    trajectory::Trajectory,
};

/// Points of a keyframe are this near, m: the bound of `points.max_range_m`.
const MAX_RANGE_M: f32 = 1e4;

/// Finds the places that a drive comes back to, and corrects its trajectory by them.
///
/// `config` has `slam.kind` `graph` or `filter`. Give each registered scan to `add`, and call
/// `finish` after the last one. Odometry does not depend on it. The points of keyframes are kept in
/// memory, 20 bytes each.
#[pyclass(module = "gyre", frozen)]
pub struct Slam {
    state: Guarded<State>,
    capacity: usize,
}

/// Two scans of the same place.
#[pyclass(module = "gyre", frozen)]
pub struct Loop {
    /// The earlier scan, counted from 0.
    #[pyo3(get)]
    earlier: u64,
    /// The later scan, counted from 0.
    #[pyo3(get)]
    later: u64,
    motion: UncertainMotion,
    /// `used`, `contradicts odometry`, `contradicts loops` or `redundant`.
    #[pyo3(get)]
    verdict: String,
    /// The weight in the graph, 0 to 1; 0 if the loop is not used.
    #[pyo3(get)]
    weight: f64,
}

struct State {
    builder: KeyframeBuilder,
    closer: LoopCloser,
    estimator: TrajectoryEstimator,
    /// With their points.
    keyframes: Vec<Keyframe>,
    /// The poses of all scans by odometry.
    odometry: gyre_radar::Trajectory,
    is_finished: bool,
    is_solved: bool,
}

type Failure = Box<dyn Error + Send + Sync>;

impl State {
    /// Takes the next scan. Returns whether it is a keyframe.
    fn add(
        &mut self,
        scan: &Registered,
        points: impl FnOnce() -> Vec<SparsePoint>,
    ) -> Result<bool, Failure> {
        if self.is_finished {
            return Err("the drive is finished: no scan comes after Slam.finish".into());
        }
        let (registered, stamp_ns) = (&scan.registered, scan.stamp_ns);
        let seq = self.odometry.len() as u64;
        let keyframe = self.builder.next(&ScanPose {
            seq,
            scan: seq,
            stamp_ns,
            pose: registered.pose,
            motion: registered.motion,
            interval_s: registered.interval_ns as f64 * 1e-9,
        });
        let stamps = self.odometry.stamp_ns.get_or_insert_default();
        stamps.push(stamp_ns);
        self.odometry.poses.push(registered.pose.motion);
        let Some(mut keyframe) = keyframe else {
            return Ok(false);
        };
        keyframe.points = points();
        self.closer.push(&keyframe)?;
        self.estimator.push(&keyframe)?;
        self.keyframes.push(keyframe);
        self.is_solved = false;
        self.close()?;
        Ok(true)
    }

    /// Closes the loops of keyframes whose surroundings are known.
    fn close(&mut self) -> Result<(), Failure> {
        let keyframes = &self.keyframes;
        let mut read = |index: usize| Ok::<_, Infallible>(keyframes[index].clone());
        while self.closer.describe(&mut read)?.is_some() {}
        while let Some(query) = self.closer.close(&mut read)? {
            self.is_solved = false;
            self.estimator.close(&query)?;
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Failure> {
        self.is_finished = true;
        self.closer.finish();
        self.close()
    }

    /// Moves the keyframes to where they fit best to odometry and loops.
    fn solve(&mut self) -> Result<(), Failure> {
        if !self.is_solved {
            self.estimator.solve()?;
            self.is_solved = true;
        }
        Ok(())
    }

    fn loops(&mut self) -> Result<Vec<Loop>, Failure> {
        self.solve()?;
        let seq = |keyframe: usize| self.keyframes[keyframe].seq;
        let judged = self.estimator.loops().iter().map(|judged| Loop {
            earlier: seq(judged.constraint.from),
            later: seq(judged.constraint.to),
            motion: judged.constraint.motion,
            verdict: judged.verdict.to_string(),
            weight: judged.weight,
        });
        Ok(judged.collect())
    }

    fn corrected(&mut self) -> Result<gyre_radar::Trajectory, Failure> {
        self.solve()?;
        let correction = self.estimator.correction();
        let poses = (0..).zip(&self.odometry.poses);
        let poses = poses.map(|(seq, pose)| correction.correct(seq, pose));
        let poses: Vec<Pose> = poses.collect();
        let stamp_ns = self.odometry.stamp_ns.clone();
        Ok(gyre_radar::Trajectory { stamp_ns, poses })
    }
}

#[pymethods]
impl Slam {
    #[new]
    fn new(config: &Bound<'_, Config>) -> PyResult<Self> {
        let config = Config::method(Some(config));
        let kind = config.slam.kind.estimator();
        let kind = kind.ok_or_else(|| {
            errors::config("slam.kind is none: set it to graph or filter to close loops")
        })?;
        if config.slam.is_localised() {
            return Err(errors::config(
                "slam.map: keyframes are found in a map by `gyre run` alone; leave the key out",
            ));
        }
        let capacity = config.odometry.points.capacity;
        let closer = LoopCloser::new(SUBMAP_REACH_M, &config.odometry.refinement, capacity);
        let state = State {
            builder: KeyframeBuilder::default(),
            closer: closer.map_err(errors::config)?,
            estimator: TrajectoryEstimator::new(kind),
            keyframes: Vec::new(),
            odometry: gyre_radar::Trajectory::default(),
            is_finished: false,
            is_solved: true,
        };
        Ok(Self {
            state: Guarded::new("Slam", state),
            capacity,
        })
    }

    /// Takes the next scan with its points, `Odometry.points`, and closes the loops that it
    /// completes. Returns whether the scan is a keyframe.
    fn add(
        &self,
        py: Python<'_>,
        registered: &Bound<'_, Registered>,
        points: &Bound<'_, PyAny>,
    ) -> PyResult<bool> {
        let fields = masker::fields_of(points)?;
        let points: &[SparsePoint] = bytemuck::cast_slice(fields.as_slice()?);
        if points.len() > self.capacity {
            let (count, capacity) = (points.len(), self.capacity);
            return Err(errors::scan(format!(
                "there are {count} points, but points.capacity is {capacity}"
            )));
        }
        let near = |value: f32| value.abs() <= MAX_RANGE_M;
        if let Some(index) = points.iter().position(|point| {
            let fields: [f32; 5] = (*point).into();
            !fields.into_iter().all(near)
        }) {
            return Err(errors::scan(format!(
                "point {index} is not finite, or farther than {MAX_RANGE_M} m"
            )));
        }
        let registered = registered.get();
        let added = self
            .state
            .with(py, |state| state.add(registered, || points.to_vec()))?;
        added.map_err(errors::other)
    }

    /// Ends the stream after the last scan, and closes the last loops.
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        self.state.with(py, State::finish)?.map_err(errors::other)
    }

    /// The loops so far, with their verdicts.
    #[getter]
    fn loops(&self, py: Python<'_>) -> PyResult<Vec<Loop>> {
        self.state.with(py, State::loops)?.map_err(errors::other)
    }

    /// The poses of all scans, corrected by the loops so far, in the frame of the first one.
    #[getter]
    fn trajectory(&self, py: Python<'_>) -> PyResult<Trajectory> {
        let corrected = self.state.with(py, State::corrected)?;
        corrected.map(Trajectory).map_err(errors::other)
    }
}

#[pymethods]
impl Loop {
    fn __repr__(&self) -> String {
        let (earlier, later, verdict) = (self.earlier, self.later, &self.verdict);
        format!("<gyre.Loop {earlier} to {later}, {verdict}>")
    }

    /// The pose of the later scan in the frame of the earlier one.
    #[getter]
    fn motion(&self) -> pose::Pose {
        pose::Pose(self.motion)
    }
}
