//! The layers that a browser asks for, and the messages to it in JSON.

use gyre_contract::{Object, ObjectsHeader, PoseHeader, SampleHealth, WitnessCounts, outcome};
use serde::Serialize;
use serde_json::{Value, json};

use crate::{processes::Process, track::Vertex};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Powers as measured.
    Scan,
    Raster,
    Points,
    Objects,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Missed {
    pub pose: u64,
    pub scan: u64,
    pub masked: u64,
    pub objects: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RunState {
    #[default]
    Waiting,
    Working,
    Finishing,
    Complete,
    Interrupted,
}

impl RunState {
    pub fn is_up(self) -> bool {
        matches!(self, Self::Working | Self::Finishing)
    }
}

#[derive(Clone, Debug, Default, Serialize)]
#[serde(tag = "kind", rename = "run")]
pub struct RunInfo {
    pub id: String,
    pub out: String,
    /// The digest of the program, its beginning.
    #[serde(skip)]
    pub build: String,
    pub state: RunState,
    pub live: bool,
    /// Pace relative to the sensor's clock; none: as fast as it goes.
    pub rate: Option<f64>,
    pub window: usize,
    pub objects: bool,
}

#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename = "health")]
pub struct HealthReport {
    #[serde(flatten)]
    pub counts: RunCounts,
    pub scans_per_s: f64,
    pub distance_m: f64,
    pub delays: Value,
    /// The part of gyro, wheels and Doppler in the last motions, and the rates of their samples, in
    /// words; none without them.
    pub others: Option<String>,
    pub notice: Option<String>,
    pub processes: Vec<Process>,
}

pub const OUTCOMES: usize = outcome::PREDICTED as usize + 1;

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RunCounts {
    pub published: u64,
    pub poses: u64,
    pub dropped: u64,
    /// Scans that were published and have no pose yet.
    pub in_flight: u64,
    pub missed: Missed,
    /// The basis of the motions, from the first of the run on.
    pub witnesses: WitnessCounts,
    /// The motions by their outcome.
    #[serde(skip)]
    pub outcomes: [u64; OUTCOMES],
    /// Time since the newest pose; 0 before the first one.
    #[serde(skip)]
    pub pose_age_s: f64,
    /// The samples of gyro and wheels, since this observer has come.
    pub samples: SampleHealth,
}

/// Returns the objects at the time of a scan, in the frame of the first one: x, y (m), yaw (rad) of
/// each centre, the velocity along x and y (m/s), length and width (m).
pub fn objects(header: &ObjectsHeader) -> Value {
    let object = |object: &Object| {
        json!({
            "id": object.id,
            "pose": [object.x_m, object.y_m, object.yaw_rad],
            "velocity": [object.vx_mps, object.vy_mps],
            "size": [object.length_m, object.width_m],
            "moving": object.is_moving(),
        })
    };
    json!({
        "kind": "objects",
        "seq": header.item.seq,
        "pose": [header.x_m, header.y_m, header.yaw_rad],
        "count": header.objects,
        "objects": header.list().iter().map(object).collect::<Vec<_>>(),
    })
}

/// Returns the newest pose, with the outcome of its match and the basis of its motion in words.
pub fn pose(pose: &PoseHeader) -> Value {
    let (motion, record) = (&pose.motion, &pose.motion.refinement);
    let interval_s = motion.interval_ns as f64 * 1e-9;
    // The chain starts with a motion of no duration.
    let per_s = |value: f64| match interval_s > 0.0 {
        true => value / interval_s,
        false => 0.0,
    };
    json!({
        "seq": pose.item.seq,
        "scan": pose.item.scan,
        "vertex": Vertex::of(pose),
        "speed_mps": per_s(motion.x_m.hypot(motion.y_m)),
        "yaw_rate_radps": per_s(motion.yaw_rad),
        "stationary": record.is_stationary(),
        "outcome": outcome::name(record.outcome),
        // Mean of the map under the scan's points, 0 to 1.
        "overlap": record.overlap,
        "basis": record.basis().name(),
    })
}
