//! The scans of a run with their poses and points, logged before those poses are journalled: for
//! followers that need each scan, and not only keyframes.

use std::path::Path;

use bytemuck::{Pod, Zeroable};
use gyre_contract::PoseHeader;
use gyre_geometry::{Pose, SparsePoint, Twist, pose, xy_yaw};
use gyre_slam::split;
use gyre_storage::{LogError, LogMagic, Record, RecordLog, RecordReader, records_path};

use crate::PoseLog;

#[derive(Clone, Debug, PartialEq)]
pub struct LoggedScan {
    /// The scan's number in the run, from 0 without gaps, which is its record's number.
    pub seq: u64,
    pub scan: u64,
    /// Time of the scan, the middle of the sweep, ns.
    pub stamp_ns: i64,
    /// The pose by odometry, in the frame of the first scan.
    pub pose: Pose,
    /// Velocity of the sensor, from the motion into the scan; zero where the chain starts.
    pub twist: Twist,
    pub points: Vec<SparsePoint>,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Fixed {
    seq: u64,
    scan: u64,
    stamp_ns: i64,
    pose: [f64; 3],
    /// x, y (m/s) and yaw (rad/s).
    twist: [f64; 3],
}

impl LoggedScan {
    pub fn of(header: &PoseHeader, points: Vec<SparsePoint>) -> Self {
        let interval_s = header.motion.interval_ns as f64 * 1e-9;
        Self {
            seq: header.item.seq,
            scan: header.item.scan,
            stamp_ns: header.item.stamp_ns,
            pose: header.pose().motion,
            twist: match interval_s > 0.0 {
                true => Twist::from_chord(&header.motion.motion().motion, interval_s),
                false => Twist::default(),
            },
            points,
        }
    }
}

/// Little-endian: the fields in their order, then the points.
impl Record for LoggedScan {
    const FILE: &'static str = "scans.log";
    const MAGIC: LogMagic = *b"gyre scans 1   \n";

    fn encode(&self, bytes: &mut Vec<u8>) {
        let twist = &self.twist;
        let fixed = Fixed {
            seq: self.seq,
            scan: self.scan,
            stamp_ns: self.stamp_ns,
            pose: xy_yaw(&self.pose),
            twist: [twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps],
        };
        bytes.extend_from_slice(bytemuck::bytes_of(&fixed));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.points));
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (fixed, points) = split::<Fixed, SparsePoint>(bytes)?;
        let ([x, y, yaw], [vx_mps, vy_mps, yaw_rate_radps]) = (fixed.pose, fixed.twist);
        Some(Self {
            seq: fixed.seq,
            scan: fixed.scan,
            stamp_ns: fixed.stamp_ns,
            pose: pose(x, y, yaw),
            twist: Twist {
                vx_mps,
                vy_mps,
                yaw_rate_radps,
            },
            points: points.collect(),
        })
    }
}

#[derive(Debug)]
pub struct Scans {
    log: RecordLog<LoggedScan>,
    /// The last scan that was appended, whose memory the next one takes.
    points: Vec<SparsePoint>,
}

impl Scans {
    /// Opens or creates the log of the run that writes to `out`, whose journal has `poses` poses,
    /// and perhaps the end of the stream. Scans beyond them are cut off.
    /// Appending allocates nothing for scans of up to `points` points.
    pub fn open(out: &Path, poses: u64, ended: bool, points: usize) -> Result<Self, LogError> {
        let mut log = RecordLog::open(out)?;
        log.reserve(size_of::<Fixed>() + points * size_of::<SparsePoint>());
        let scans = log.len() as u64;
        if scans < poses {
            let path = records_path::<LoggedScan>(out);
            return Err(LogError::Missing(format!(
                "{} has {scans} scans of {poses} poses: the same command computes them again",
                path.display()
            )));
        }
        // The end of the scans is before the end of the journal.
        if !ended {
            log.cut(usize::try_from(poses).unwrap_or(usize::MAX))?;
        }
        Ok(Self {
            log,
            points: Vec::with_capacity(points),
        })
    }
}

impl PoseLog for Scans {
    fn add(&mut self, pose: &PoseHeader, points: &[SparsePoint]) -> Result<bool, LogError> {
        let mut memory = std::mem::take(&mut self.points);
        memory.clear();
        memory.extend_from_slice(points);
        let scan = LoggedScan::of(pose, memory);
        let appended = self.log.append(&scan);
        self.points = scan.points;
        appended?;
        Ok(true)
    }

    fn end(&mut self) -> Result<(), LogError> {
        self.log.end()
    }

    fn sync(&self) -> Result<(), LogError> {
        self.log.sync()
    }
}

/// Returns how many of the first `poses` poses of the journal have their scans. After a death all
/// of them have; a power failure can take the last scans. Changes nothing.
pub fn complete_scans(out: &Path, poses: u64) -> Result<u64, LogError> {
    let reader = RecordReader::<LoggedScan>::open(out)?;
    Ok(poses.min(reader.len() as u64))
}

#[cfg(test)]
mod tests {
    use gyre_contract::{Item, MotionEstimate};

    use super::*;

    fn header(seq: u64) -> PoseHeader {
        PoseHeader {
            item: Item {
                seq,
                scan: seq + 7,
                stamp_ns: seq as i64 * 250_000_000,
                ..Item::default()
            },
            x_m: 1.5 * seq as f64,
            motion: MotionEstimate {
                x_m: 1.5,
                interval_ns: 250_000_000,
                ..MotionEstimate::default()
            },
            ..PoseHeader::default()
        }
    }

    #[test]
    fn scans_are_read_as_they_were_logged_and_those_beyond_the_journal_are_cut_off() {
        let out = tempfile::tempdir().unwrap();
        let points = [SparsePoint::from([10.0, 2.0, 0.1, 0.5, 0.04]); 3];
        let mut scans = Scans::open(out.path(), 0, false, 3).unwrap();
        (0..4).for_each(|seq| assert!(scans.add(&header(seq), &points).unwrap()));
        drop(scans);
        let mut reader = RecordReader::<LoggedScan>::open(out.path()).unwrap();
        let read = reader.read(2).unwrap();
        assert_eq!((read.seq, read.scan, read.points.len()), (2, 9, 3));
        assert_eq!(read.points[0], points[0]);
        assert!((read.twist.vx_mps - 6.0).abs() < 1e-12 && read.pose.translation.x == 3.0);
        drop(Scans::open(out.path(), 3, false, 3).unwrap());
        assert_eq!(reader.refresh().unwrap(), 3);
        assert_eq!(complete_scans(out.path(), 9).unwrap(), 3);
        let missing = Scans::open(out.path(), 5, false, 3).map(drop).unwrap_err();
        assert!(
            missing.to_string().contains("has 3 scans of 5 poses"),
            "{missing}"
        );
    }
}
