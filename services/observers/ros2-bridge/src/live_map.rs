//! The map of a run with SLAM while it works.

use std::{
    error::Error,
    path::Path,
    time::{Duration, Instant},
};

use gyre_client::{Run, clock};
use gyre_geometry::Pose;
use gyre_ros2_messages::{frames::occupancy_grid, nav_msgs::OccupancyGrid};
use gyre_slam::{
    Keyframe, Query, RecordReader, TrajectoryEstimator,
    mapping::{Evidence, grid},
};

use crate::{
    MapSettings, RunSettings,
    outlet::Outlet,
    run_state::{POLL_INTERVAL, Shared},
};

const INTERVAL: Duration = Duration::from_secs(5);
/// The pause before the next map, as a multiple of the time for drawing the last map.
const PAUSE_FACTOR: u32 = 9;

type LiveMapError = Box<dyn Error>;

struct LiveMap {
    settings: MapSettings,
    keyframes: RecordReader<Keyframe>,
    queries: RecordReader<Query>,
    estimator: TrajectoryEstimator,
    /// The pose of the radar on the vehicle: the map is drawn along the vehicle's axes, since Nav2
    /// ignores the rotation of a grid.
    radar: Pose,
    evidence: Evidence,
    seqs: Vec<u64>,
    closed: usize,
}

/// Publishes the map of a run when it has new keyframes, until the run ends.
pub fn follow(
    shared: &Shared,
    run: &Run,
    settings: &Result<RunSettings, String>,
    maps: &mut Outlet<OccupancyGrid>,
) {
    let settings = settings.as_ref().map_err(|error| error.as_str().into());
    let map = settings.and_then(|it| it.map.as_ref().ok_or("slam.kind is none".into()));
    // Not tried again: that would read all keyframes each time.
    if let Err(error) = map.and_then(|settings| publish(shared, run, settings, maps)) {
        shared.state().notice = Some(format!("the map is not published: {error}"));
    }
}

fn publish(
    shared: &Shared,
    run: &Run,
    settings: &MapSettings,
    maps: &mut Outlet<OccupancyGrid>,
) -> Result<(), LiveMapError> {
    let (out, vehicle) = (&shared.settings.out, &shared.settings.vehicle);
    let mut map = LiveMap::open(out, settings, *vehicle.mounting.radar())?;
    let mut due = Instant::now();
    // A last time when the logs are complete.
    let mut ended = false;
    while !ended && !shared.is_stopping() {
        ended = run.has_ended() || map.has_ended();
        if !ended && (Instant::now() < due || !shared.is_active()) {
            std::thread::sleep(POLL_INTERVAL);
            continue;
        }
        let begun = Instant::now();
        if shared.is_active() && map.update(out)? {
            let grid = grid(&mut map.evidence)?;
            let is_sent = maps.send(occupancy_grid(
                clock::since_1970_ns(),
                &vehicle.frames.map,
                grid.cell_m,
                [grid.columns, grid.rows],
                grid.corner_m,
                grid.values,
            ));
            shared.state().maps += u64::from(is_sent);
        }
        due = Instant::now() + INTERVAL.max(begun.elapsed() * PAUSE_FACTOR);
    }
    Ok(())
}

impl LiveMap {
    fn open(out: &Path, settings: &MapSettings, radar: Pose) -> Result<Self, LiveMapError> {
        Ok(Self {
            settings: settings.clone(),
            keyframes: RecordReader::open(out)?,
            queries: RecordReader::open(out)?,
            estimator: TrajectoryEstimator::new(settings.estimator),
            radar,
            evidence: Evidence::new(&settings.options, &std::env::temp_dir())?,
            seqs: Vec::new(),
            closed: 0,
        })
    }

    fn has_ended(&self) -> bool {
        self.queries.has_ended() && self.keyframes.has_ended()
    }

    /// Reads new keyframes, and draws those that are new or have moved; true if there are any.
    fn update(&mut self, out: &Path) -> Result<bool, LiveMapError> {
        self.keyframes.refresh()?;
        self.queries.refresh()?;
        // Records that were read have been cut off after a power failure or a crash.
        if self.keyframes.unchanged() < self.seqs.len() || self.queries.unchanged() < self.closed {
            *self = Self::open(out, &self.settings.clone(), self.radar)?;
        }
        self.read()?;
        self.draw()
    }

    fn read(&mut self) -> Result<(), LiveMapError> {
        for index in self.seqs.len()..self.keyframes.len() {
            let keyframe = Keyframe::without_points(&mut self.keyframes, index)?;
            self.estimator.push(&keyframe)?;
            self.seqs.push(keyframe.seq);
        }
        let closed = self.closed;
        while self.closed < self.queries.len() {
            let query = self.queries.read(self.closed)?;
            // The keyframe of the query is read the next time.
            if query.keyframe >= self.seqs.len() {
                break;
            }
            self.estimator.close(&query)?;
            self.closed += 1;
        }
        if self.closed > closed {
            self.estimator.update()?;
        }
        Ok(())
    }

    fn draw(&mut self) -> Result<bool, LiveMapError> {
        let mut has_changed = false;
        for (index, pose) in self.estimator.poses().iter().enumerate() {
            let pose = self.radar * pose;
            if self.evidence.has_moved(self.seqs[index], &pose) {
                let keyframe = self.keyframes.read(index)?;
                self.evidence.draw(&keyframe, &pose)?;
                has_changed = true;
            }
        }
        Ok(has_changed)
    }
}
