//! Reads `odometry.csv` back, by the names in its header: other columns may be added or removed.

use std::{io::Read, path::Path};

use gyre_configuration::terminal::Failure;
use gyre_geometry::{OdometryMotion, covariance::unpack, pose};
use serde::Deserialize;

use crate::{evaluation::TimedMotion, table};

const COLUMNS: &str =
    "stamp_ns interval_ns x_m y_m yaw_rad cov_xx cov_xy cov_xyaw cov_yy cov_yyaw cov_yawyaw";

/// The fields of [`COLUMNS`], and the correlation of the errors of motions: zero if it is missing.
#[derive(Deserialize)]
struct MotionRow {
    stamp_ns: i64,
    interval_ns: i64,
    x_m: f64,
    y_m: f64,
    yaw_rad: f64,
    cov_xx: Option<f64>,
    cov_xy: Option<f64>,
    cov_xyaw: Option<f64>,
    cov_yy: Option<f64>,
    cov_yyaw: Option<f64>,
    cov_yawyaw: Option<f64>,
    drift_share: Option<f64>,
    scale_sigma: Option<f64>,
}

/// Reads the motions of an `odometry.csv`. A covariance that is left empty becomes NaN: the motion
/// has none.
pub fn read(path: &Path) -> Result<Vec<TimedMotion>, Failure> {
    parse(table::open(path)?).map_err(|reason| format!("{}: {reason}", path.display()).into())
}

fn parse(mut reader: csv::Reader<impl Read>) -> Result<Vec<TimedMotion>, Failure> {
    let header = reader.headers()?;
    let missing = |name: &&str| header.iter().all(|column| column != *name);
    if let Some(name) = COLUMNS.split(' ').find(missing) {
        return Err(format!("not an odometry.csv: its header has no column {name}").into());
    }
    let rows = reader.deserialize();
    rows.map(|row| MotionRow::motion(&row?)).collect()
}

impl MotionRow {
    fn motion(&self) -> Result<TimedMotion, Failure> {
        let from_ns = self.stamp_ns.checked_sub(self.interval_ns);
        let share = |value: Option<f64>, default| {
            let value = value.unwrap_or(default);
            (0.0..=1.0).contains(&value).then_some(value)
        };
        let covariance = [
            self.cov_xx,
            self.cov_xy,
            self.cov_xyaw,
            self.cov_yy,
            self.cov_yyaw,
            self.cov_yawyaw,
        ];
        Ok(TimedMotion {
            from_ns: from_ns.ok_or("interval_ns is out of range")?,
            to_ns: self.stamp_ns,
            estimate: OdometryMotion {
                motion: pose(self.x_m, self.y_m, self.yaw_rad),
                covariance: unpack(&covariance.map(|value| value.unwrap_or(f64::NAN))),
                drift_share: share(self.drift_share, 1.0).ok_or("drift_share is not 0 to 1")?,
                scale_sigma: share(self.scale_sigma, 0.0).ok_or("scale_sigma is not 0 to 1")?,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use gyre_contract::{
        Item, MotionEstimate, PoseHeader, RefinementRecord, initial_guess, outcome,
    };

    use super::*;
    use crate::odometry::{HEADER, motion, write_row};

    fn csv(poses: &[PoseHeader]) -> String {
        let mut text = HEADER.to_owned();
        poses.iter().for_each(|pose| write_row(pose, &mut text));
        text
    }

    fn parsed(text: &str) -> Result<Vec<TimedMotion>, Failure> {
        parse(table::reader(text.as_bytes()))
    }

    fn motions(poses: &[PoseHeader]) -> Vec<TimedMotion> {
        poses.iter().filter_map(motion).collect()
    }

    fn poses() -> Vec<PoseHeader> {
        let pose = |k: i64| PoseHeader {
            item: Item::recorded(0, 0, 1_549_986_608_000_000_007 + 250_000_000 * k),
            motion: MotionEstimate {
                x_m: 1.5,
                y_m: -0.25,
                yaw_rad: 0.125 * k as f64,
                covariance: [0.04, 0.001, 0.002, 0.05, 0.003, 0.006],
                drift_share: 0.25,
                scale_sigma: 0.01,
                interval_ns: 250_000_000,
                refinement: RefinementRecord {
                    outcome: outcome::REFINED,
                    initial_guess: initial_guess::YAW_OFFSET,
                    stationary: 1,
                    ..RefinementRecord::default()
                },
                ..MotionEstimate::default()
            },
            ..PoseHeader::default()
        };
        (1..4).map(pose).collect()
    }

    #[test]
    fn what_was_written_is_read_whatever_columns_are_beside_it() {
        let (poses, text) = (poses(), csv(&poses()));
        assert!(text.contains(",refined,yaw-offset,"));
        assert!(text.ends_with(",1,0.250000000,0.010000000\n"));
        assert_eq!(parsed(&text).unwrap(), motions(&poses));
        let wider = text.lines().map(|line| format!("new,{line},newer\n"));
        let wider: String = wider.collect();
        assert_eq!(parsed(&wider).unwrap(), motions(&poses));
    }

    #[test]
    fn an_empty_covariance_is_none_and_the_motion_stays() {
        let read = parsed(&csv(&poses()).replace("0.040000000000", "")).unwrap();
        assert_eq!(read.len(), 3);
        assert!(read[0].estimate.motion == motions(&poses())[0].estimate.motion);
        assert!(!read[0].estimate.alone().has_covariance());
    }

    #[test]
    fn an_interval_before_the_beginning_of_time_is_refused() {
        let text = csv(&poses()).replace(",250000000,", ",-9223372036854775808,");
        let refused = parsed(&text).unwrap_err().to_string();
        assert!(refused.contains("interval_ns"), "{refused}");
    }
}
