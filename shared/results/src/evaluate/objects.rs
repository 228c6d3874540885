//! `gyre evaluate --objects`: the objects of a run against true ones.

use std::{collections::BTreeMap, path::Path};

use gyre_configuration::terminal::Failure;
use gyre_datasets::ground_truth::read_trajectory;
use gyre_geometry::{Pose, pose};
use gyre_radar::Trajectory;
use nalgebra::{Matrix2, Point2, Vector2};
use serde::{Deserialize, de::DeserializeOwned};

use crate::{
    evaluation::{ObjectErrors, ObjectScan, TrackedObject, TrueObject, object_errors},
    table,
};

/// An object is visible if its strongest echo reaches this many counts, the threshold of the masks.
const SEEN_COUNTS: f64 = 60.0;

#[derive(Deserialize)]
struct TrackedRow {
    scan: u64,
    object: u64,
    x_m: f64,
    y_m: f64,
    yaw_rad: f64,
    vx_m_s: f64,
    vy_m_s: f64,
    moving: u8,
    cov_vxvx: f64,
    cov_vxvy: f64,
    cov_vyvy: f64,
}

/// A row of a simulated recording's `objects.csv`.
#[derive(Deserialize)]
struct TrueRow {
    stamp_ns: i64,
    object: u64,
    kind: String,
    x_m: f64,
    y_m: f64,
    yaw_rad: f64,
    vx_m_s: f64,
    vy_m_s: f64,
    counts: f64,
}

#[derive(Deserialize)]
struct PoseRow {
    scan: u64,
    stamp_ns: i64,
    x_m: f64,
    y_m: f64,
    yaw_rad: f64,
}

/// Compares the `objects.csv` of a run with the `objects.csv` of the simulated recording in
/// `truth`, in the frame of the sensor: by the run's own poses, and the recording's
/// `ground_truth.tum`.
pub fn evaluate(run: &Path, truth: &Path) -> Result<ObjectErrors, Failure> {
    let poses: Vec<PoseRow> = rows(&run.join("poses.csv"))?;
    let (folder, truth) = match truth.is_dir() {
        true => (truth, truth.join("objects.csv")),
        false => (truth.parent().unwrap_or(truth), truth.to_owned()),
    };
    let true_poses = read_trajectory(&folder.join("ground_truth.tum"))?;
    let mut tracked: BTreeMap<u64, Vec<TrackedRow>> = BTreeMap::new();
    for row in rows::<TrackedRow>(&run.join("objects.csv"))? {
        tracked.entry(row.scan).or_default().push(row);
    }
    let mut true_objects: BTreeMap<i64, Vec<TrueRow>> = BTreeMap::new();
    for row in rows::<TrueRow>(&truth)? {
        true_objects.entry(row.stamp_ns).or_default().push(row);
    }
    let mut scans = Vec::with_capacity(poses.len());
    for row in &poses {
        let Some(sensor) = true_poses.near(row.stamp_ns, Trajectory::ROUNDING_NS) else {
            let truth = folder.display();
            return Err(format!(
                "{truth} has no pose at {} ns, a scan of the run: name the recording that was run",
                row.stamp_ns
            )
            .into());
        };
        let rounding_ns = Trajectory::ROUNDING_NS.cast_signed();
        let near = row.stamp_ns - rounding_ns..=row.stamp_ns + rounding_ns;
        let there = true_objects.range(near).flat_map(|(_, rows)| rows);
        let found = tracked.get(&row.scan).into_iter().flatten();
        let own = pose(row.x_m, row.y_m, row.yaw_rad).inverse();
        scans.push(ObjectScan {
            truth: there.map(|row| row.seen_from(&sensor.inverse())).collect(),
            tracked: found.map(|row| row.seen_from(&own)).collect(),
        });
    }
    Ok(object_errors(&scans))
}

/// Reads a table as CSV by the names of its columns.
fn rows<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, Failure> {
    let rows: Result<Vec<T>, csv::Error> = table::open(path)?.deserialize().collect();
    rows.map_err(|error| format!("{}: {error}", path.display()).into())
}

impl TrackedRow {
    fn seen_from(&self, sensor: &Pose) -> TrackedObject {
        let turn = sensor.rotation.to_rotation_matrix();
        let covariance = Matrix2::new(self.cov_vxvx, self.cov_vxvy, self.cov_vxvy, self.cov_vyvy);
        TrackedObject {
            id: self.object,
            position: sensor * Point2::new(self.x_m, self.y_m),
            velocity: turn * Vector2::new(self.vx_m_s, self.vy_m_s),
            velocity_covariance: turn.matrix() * covariance * turn.matrix().transpose(),
            yaw_rad: self.yaw_rad + turn.angle(),
            moving: self.moving != 0,
        }
    }
}

impl TrueRow {
    fn seen_from(&self, sensor: &Pose) -> TrueObject {
        TrueObject {
            id: self.object,
            position: sensor * Point2::new(self.x_m, self.y_m),
            velocity: Some(sensor.rotation * Vector2::new(self.vx_m_s, self.vy_m_s)),
            yaw_rad: self.yaw_rad + sensor.rotation.angle(),
            is_vehicle: !matches!(self.kind.as_str(), "cyclist" | "pedestrian"),
            is_seen: self.counts >= SEEN_COUNTS,
        }
    }
}
