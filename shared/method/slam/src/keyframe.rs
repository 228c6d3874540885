use bytemuck::{Pod, Zeroable};
use gyre_geometry::{SparsePoint, Twist, UncertainMotion, covariance, pose, xy_yaw};
use gyre_storage::{LogError, LogMagic, Record, RecordReader};
use nalgebra::Matrix3;

use crate::exact::split;

/// A scan whose pose is estimated, with all that loop closing and mapping need of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframe {
    /// The scan's number in the run, from 0 without gaps.
    pub seq: u64,
    /// The sensor's own number of the scan.
    pub scan: u64,
    /// Time of the scan, the middle of the sweep, ns since 1970 on the sensor's clock.
    pub stamp_ns: i64,
    /// The pose by odometry, in the frame of the first scan, with the covariance of (x, y, yaw) in
    /// that frame.
    pub pose: UncertainMotion,
    /// The motion by odometry from the keyframe before, with the covariance of its drift along that
    /// keyframe's axes; zero at the first one.
    pub motion: UncertainMotion,
    /// Covariance of the noise of the pose, along its own axes. It is in the covariance of the
    /// corrected pose, and in none of motions or loops. See
    /// [`OdometryMotion`](gyre_geometry::OdometryMotion).
    pub noise: Matrix3<f64>,
    pub twist: Twist,
    pub path_m: f64,
    /// The points of the scan as measured: with `twist` they are freed of motion and of the Doppler
    /// shift.
    pub points: Vec<SparsePoint>,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Fixed {
    seq: u64,
    scan: u64,
    stamp_ns: i64,
    path_m: f64,
    pose: [f64; 3],
    pose_covariance: covariance::Packed,
    motion: [f64; 3],
    motion_covariance: covariance::Packed,
    noise: covariance::Packed,
    /// x, y (m/s) and yaw (rad/s).
    twist: [f64; 3],
}

impl Keyframe {
    /// A keyframe of a sensor that has not moved, at time 0.
    pub fn standing(seq: u64, pose: UncertainMotion, points: Vec<SparsePoint>) -> Self {
        Self {
            seq,
            scan: seq,
            stamp_ns: 0,
            pose,
            motion: UncertainMotion::identity(),
            noise: Matrix3::zeros(),
            twist: Twist::default(),
            path_m: 0.0,
            points,
        }
    }

    /// Reads a keyframe without its points, which are a hundred times the rest. Its bytes are not
    /// checked: the checksum covers the whole record. Panics beyond the last keyframe.
    pub fn without_points(
        keyframes: &mut RecordReader<Self>,
        index: usize,
    ) -> Result<Self, LogError> {
        keyframes.read_start(index, size_of::<Fixed>())
    }

    /// Returns the length of the form in a file of a keyframe with so many points, bytes.
    pub const fn encoded_len(points: usize) -> usize {
        size_of::<Fixed>() + points * size_of::<SparsePoint>()
    }
}

/// Little-endian: the fields in their order, then the points.
impl Record for Keyframe {
    const FILE: &'static str = "keyframes.log";
    const MAGIC: LogMagic = *b"gyre keyframe 2\n";

    fn encode(&self, bytes: &mut Vec<u8>) {
        let fixed = Fixed {
            seq: self.seq,
            scan: self.scan,
            stamp_ns: self.stamp_ns,
            path_m: self.path_m,
            pose: xy_yaw(&self.pose.motion),
            pose_covariance: covariance::pack(&self.pose.covariance),
            motion: xy_yaw(&self.motion.motion),
            motion_covariance: covariance::pack(&self.motion.covariance),
            noise: covariance::pack(&self.noise),
            twist: [
                self.twist.vx_mps,
                self.twist.vy_mps,
                self.twist.yaw_rate_radps,
            ],
        };
        bytes.extend_from_slice(bytemuck::bytes_of(&fixed));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.points));
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (fixed, points) = split::<Fixed, SparsePoint>(bytes)?;
        let uncertain = |[x, y, yaw]: [f64; 3], packed| UncertainMotion {
            motion: pose(x, y, yaw),
            covariance: covariance::unpack(packed),
        };
        Some(Self {
            seq: fixed.seq,
            scan: fixed.scan,
            stamp_ns: fixed.stamp_ns,
            pose: uncertain(fixed.pose, &fixed.pose_covariance),
            motion: uncertain(fixed.motion, &fixed.motion_covariance),
            noise: covariance::unpack(&fixed.noise),
            twist: fixed.twist.into(),
            path_m: fixed.path_m,
            points: points.collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use gyre_storage::RecordLog;

    use super::*;

    fn uncertain() -> UncertainMotion {
        UncertainMotion {
            motion: pose(3.0, -4.0, 0.5),
            covariance: Matrix3::new(4.0, 0.1, 0.2, 0.1, 5.0, 0.3, 0.2, 0.3, 6.0),
        }
    }

    fn keyframe() -> Keyframe {
        Keyframe {
            scan: 9,
            stamp_ns: -5,
            motion: uncertain(),
            noise: uncertain().covariance,
            twist: [10.0, 0.1, -0.2].into(),
            path_m: 12.5,
            ..Keyframe::standing(7, uncertain(), vec![[1.0, 2.0, 0.1, 0.5, 0.04].into(); 3])
        }
    }

    #[test]
    fn a_keyframe_is_read_without_its_points() {
        let out = tempfile::tempdir().unwrap();
        let mut log = RecordLog::open(out.path()).unwrap();
        (0..3).for_each(|_| log.append(&keyframe()).unwrap());
        let mut reader = RecordReader::<Keyframe>::open(out.path()).unwrap();
        let whole = reader.read(1).unwrap();
        let without_points = Keyframe::without_points(&mut reader, 1).unwrap();
        assert_eq!(whole.points.len(), 3);
        assert_eq!(
            without_points,
            Keyframe {
                points: Vec::new(),
                ..whole
            }
        );
    }

    #[test]
    fn a_keyframe_is_decoded_as_it_was_encoded() {
        let (uncertain, keyframe) = (uncertain(), keyframe());
        let mut bytes = Vec::new();
        keyframe.encode(&mut bytes);
        assert_eq!(bytes.len(), Keyframe::encoded_len(3));
        let decoded = Keyframe::decode(&bytes).unwrap();
        assert!(
            (decoded.pose.motion.to_homogeneous() - uncertain.motion.to_homogeneous()).norm()
                < 1e-12
        );
        assert_eq!(decoded.points, keyframe.points);
        assert_eq!(decoded.motion.covariance, keyframe.motion.covariance);
        assert_eq!(decoded.noise, keyframe.noise);
        let mut again = Vec::new();
        decoded.encode(&mut again);
        assert_eq!(Keyframe::decode(&again).unwrap().twist, keyframe.twist);
        assert_eq!(Keyframe::decode(&bytes[1..]), None);
        assert_eq!(Keyframe::decode(&bytes[..8]), None);
    }
}
