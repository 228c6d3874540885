//! Poses, motions and maps in the plane as odometry, transforms and grids.
//!
//! Frames follow REP-105: `map` -> `odom` -> `base_link` -> `radar`. `odom` is the vehicle's frame
//! at the first scan, and `map` is where loops have corrected it to be. All follow REP-103, as
//! Gyre's own frames do, so that no axis is turned.

use std::str::FromStr;

use gyre_contract::{FixHeader, PoseHeader, flag, outcome};
use gyre_geometry::{Pose, Twist, UncertainMotion, pose as planar, samples::Evidence, xy_yaw};
use nalgebra::{Matrix3, Rotation2, Vector2};

use crate::{
    builtin_interfaces::Time,
    geometry_msgs::{
        self, Covariance, Point, PoseWithCovariance, PoseWithCovarianceStamped, Quaternion,
        Transform, TransformStamped, TwistWithCovarianceStamped, Vector3,
    },
    nav_msgs::{MapMetaData, OccupancyGrid, Odometry},
    std_msgs::Header,
    tf2_msgs::TFMessage,
};

/// Variance of the quantities that planar odometry does not measure: z, roll and pitch, and their
/// velocities. So large that no filter uses it; zero would mean that they are known exactly. ROS
/// 2's `diff_drive_controller` uses the same value.
pub const UNKNOWN: f64 = 1e6;

/// The frame of the map of an earlier drive: its first keyframe.
pub const SAVED_MAP: &str = "saved_map";

/// Where x, y and yaw are among x, y, z, roll, pitch and yaw.
const PLANAR: [usize; 3] = [0, 1, 5];

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frames {
    /// The frame that loops correct.
    pub map: String,
    /// The frame of continuous odometry.
    pub odom: String,
    pub base: String,
    pub radar: String,
}

impl FromStr for Frames {
    type Err = String;

    /// Parses four names, as in `map,odom,base_link,radar`.
    fn from_str(text: &str) -> Result<Self, String> {
        let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
        let is_name = |name: &String| !name.is_empty() && !name.starts_with('/');
        match <[String; 4]>::try_from(names) {
            Ok(names) if names.iter().all(is_name) => {
                let [map, odom, base, radar] = names;
                Ok(Self {
                    map,
                    odom,
                    base,
                    radar,
                })
            }
            _ => Err(
                "four names without `/` before them are needed, as in map,odom,base_link,radar"
                    .to_owned(),
            ),
        }
    }
}

/// The pose of the radar in the frame of the vehicle. Written as `X,Y,YAW`: m forward, m to the
/// left, degrees counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting(Pose);

const NEEDED: &str =
    "three numbers are needed: m forward, m to the left, degrees counter-clockwise, as in 1.2,0,90";

impl FromStr for Mounting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|it| it.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[x_m, y_m, yaw_deg]) if [x_m, y_m, yaw_deg].iter().all(|it| it.is_finite()) => {
                Ok(Self(planar(x_m, y_m, yaw_deg.to_radians())))
            }
            _ => Err(NEEDED.to_owned()),
        }
    }
}

impl Mounting {
    pub fn radar(&self) -> &Pose {
        &self.0
    }

    /// Returns the motion of the vehicle, in its own earlier frame, from the motion of the radar:
    /// `B M B^-1` with the radar's pose `B`.
    pub fn of_vehicle(&self, of_radar: &Pose) -> Pose {
        self.0 * of_radar * self.0.inverse()
    }

    /// Returns the motion of the radar from the motion of the vehicle: the inverse of
    /// [`of_vehicle`](Self::of_vehicle).
    fn of_radar(&self, of_vehicle: &Pose) -> Pose {
        self.0.inverse() * of_vehicle * self.0
    }

    /// Returns the motion of the vehicle with its covariance: the displacement is turned by the
    /// mounting, and an error in yaw moves the vehicle as far as the radar is from its origin.
    pub fn of_vehicle_uncertain(&self, of_radar: &UncertainMotion) -> UncertainMotion {
        let motion = self.of_vehicle(&of_radar.motion);
        let at = self.0.translation.vector;
        let moved = -(motion.rotation * Vector2::new(-at.y, at.x));
        let mut jacobian: Matrix3<f64> = self.0.rotation.to_homogeneous();
        (jacobian[(0, 2)], jacobian[(1, 2)]) = (moved.x, moved.y);
        UncertainMotion {
            motion,
            covariance: jacobian * of_radar.covariance * jacobian.transpose(),
        }
    }
}

/// The vehicle that carries the radar: the messages of a run's poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Vehicle {
    pub frames: Frames,
    pub mounting: Mounting,
}

impl Vehicle {
    /// Returns the place of the radar on the vehicle.
    pub fn mounted(&self, stamp_ns: i64) -> TFMessage {
        let (base, radar) = (&self.frames.base, &self.frames.radar);
        let mounted = transform(stamp_ns, base, radar, self.mounting.radar());
        TFMessage {
            transforms: vec![mounted],
        }
    }

    /// Returns a pose of the radar as odometry of the vehicle.
    pub fn odometry(&self, stamp_ns: i64, pose: &PoseHeader) -> Odometry {
        let motion = pose.motion.motion().alone();
        let since = Interval {
            motion: self.mounting.of_vehicle_uncertain(&motion),
            duration_ns: pose.motion.interval_ns,
            is_measured: pose.motion.refinement.outcome != outcome::PREDICTED,
        };
        let since = (!pose.item.is(flag::BREAK)).then_some(&since);
        let vehicle = self.mounting.of_vehicle_uncertain(&pose.pose());
        odometry(stamp_ns, &self.frames, &vehicle, since)
    }

    /// Returns a pose of the radar as the transform of odometry, and with SLAM the correction by
    /// loops as the transform of the map, which is dated ahead.
    pub fn transforms(
        &self,
        stamp_ns: i64,
        pose: &PoseHeader,
        map_from_odometry: Option<&Pose>,
        ahead_ns: i64,
    ) -> TFMessage {
        let Frames {
            map, odom, base, ..
        } = &self.frames;
        let vehicle = self.mounting.of_vehicle(&pose.pose().motion);
        let mut transforms = vec![transform(stamp_ns, odom, base, &vehicle)];
        transforms.extend(map_from_odometry.map(|correction| {
            let correction = self.mounting.of_vehicle(correction);
            transform(stamp_ns.saturating_add(ahead_ns), map, odom, &correction)
        }));
        TFMessage { transforms }
    }

    /// Returns the pose of a keyframe in the map of an earlier drive; `None` unless it was
    /// measured.
    pub fn fix(&self, stamp_ns: i64, fix: &FixHeader) -> Option<PoseWithCovarianceStamped> {
        let fix = self.mounting.of_vehicle_uncertain(&fix.measured()?);
        Some(PoseWithCovarianceStamped {
            header: Header::new(stamp_ns, SAVED_MAP),
            pose: PoseWithCovariance {
                pose: pose(&fix.motion),
                covariance: covariance(Some(&fix.covariance)),
            },
        })
    }

    /// Returns a given pose of the vehicle as the pose of the radar, and the standard deviations of
    /// its place, m, and of its yaw, rad; 0 where the message has none.
    pub fn given(&self, message: &PoseWithCovarianceStamped) -> (Pose, [f64; 2]) {
        let (place, turn) = (message.pose.pose.position, message.pose.pose.orientation);
        let yaw_rad = 2.0 * turn.z.atan2(turn.w);
        let pose = self.mounting.of_radar(&planar(place.x, place.y, yaw_rad));
        let variance =
            |k: usize| message.pose.covariance.elements()[k * (geometry_msgs::VALUES + 1)];
        let [x, y, yaw] = PLANAR.map(variance);
        (pose, [(0.5 * (x + y)).sqrt(), yaw.sqrt()])
    }

    /// Returns the velocity of the radar, ahead and to the left, that Doppler has measured.
    pub fn doppler(&self, stamp_ns: i64, velocity: &Evidence) -> TwistWithCovarianceStamped {
        let [xx, xy, yy] = velocity.covariance;
        let known = Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, UNKNOWN);
        let mut message = TwistWithCovarianceStamped {
            header: Header::new(stamp_ns, &self.frames.radar),
            ..TwistWithCovarianceStamped::default()
        };
        message.twist.covariance = covariance(Some(&known));
        let linear = &mut message.twist.twist.linear;
        [linear.x, linear.y] = velocity.value;
        message
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Interval {
    /// The motion from the previous scan, with the covariance of its (x, y, yaw) along the axes of
    /// the earlier frame.
    motion: UncertainMotion,
    duration_ns: i64,
    /// True if it was measured, not predicted from earlier motions.
    is_measured: bool,
}

/// Returns a pose in the odometry frame, and the velocity that led to it, as odometry.
///
/// The covariance of the pose is along the axes of `odom`, as `robot_localization` expects it. The
/// velocity assumes constant motion since the previous scan, in the frame of the vehicle, with the
/// covariance that follows from the motion's. The velocity of a predicted motion has the variance
/// [`UNKNOWN`], since it is no measurement. Without a motion (at the first scan) the velocity is
/// zero, with the same variance.
fn odometry(
    stamp_ns: i64,
    frames: &Frames,
    pose: &UncertainMotion,
    since: Option<&Interval>,
) -> Odometry {
    let mut odometry = Odometry {
        header: Header::new(stamp_ns, &frames.odom),
        child_frame_id: frames.base.clone(),
        ..Odometry::default()
    };
    odometry.pose.pose = self::pose(&pose.motion);
    odometry.pose.covariance = covariance(Some(&pose.covariance));
    let since = since.filter(|since| since.duration_ns > 0);
    let measured = since.filter(|since| since.is_measured);
    odometry.twist.covariance = covariance(measured.map(velocity_covariance).as_ref());
    if let Some(since) = since {
        let twist = Twist::from_motion(&since.motion.motion, seconds(since));
        odometry.twist.twist.linear.x = twist.vx_mps;
        odometry.twist.twist.linear.y = twist.vy_mps;
        odometry.twist.twist.angular.z = twist.yaw_rate_radps;
    }
    odometry
}

/// Returns the covariance of (x, y, yaw) in ROS's order. [`UNKNOWN`] is the variance of the other
/// axes, and of all six without a covariance.
pub fn covariance(planar: Option<&Matrix3<f64>>) -> Covariance {
    let mut covariance = Covariance::default();
    for value in 0..geometry_msgs::VALUES {
        covariance.set(value, value, UNKNOWN);
    }
    let Some(planar) = planar else {
        return covariance;
    };
    for (row, to_row) in PLANAR.into_iter().enumerate() {
        for (column, to_column) in PLANAR.into_iter().enumerate() {
            covariance.set(to_row, to_column, planar[(row, column)]);
        }
    }
    covariance
}

fn velocity_covariance(since: &Interval) -> Matrix3<f64> {
    let jacobian = twist_jacobian(&since.motion.motion, seconds(since));
    jacobian * since.motion.covariance * jacobian.transpose()
}

/// Returns the Jacobian of [`Twist::from_motion`] with respect to x, y and yaw of the motion.
fn twist_jacobian(motion: &Pose, dt_s: f64) -> Matrix3<f64> {
    let half = 0.5 * motion.rotation.angle();
    let twist = Twist::from_motion(motion, dt_s);
    let (stretch, growth) = match half.abs() < 1e-2 {
        // Series to the rounding of numbers: the terms below cancel, or divide by zero.
        true => {
            let square = half * half;
            let stretch = 1.0 + square / 6.0 + square * square * (7.0 / 360.0);
            (stretch, half * (1.0 / 3.0 + square / 45.0))
        }
        false => (half / half.sin(), 1.0 / half - 1.0 / half.tan()),
    };
    let mut jacobian = Rotation2::new(-half).to_homogeneous() * (stretch / dt_s);
    // The yaw scales the chord to the arc, and turns it back by its half.
    jacobian[(0, 2)] = 0.5 * (growth * twist.vx_mps + twist.vy_mps);
    jacobian[(1, 2)] = 0.5 * (growth * twist.vy_mps - twist.vx_mps);
    jacobian[(2, 2)] = 1.0 / dt_s;
    jacobian
}

fn seconds(since: &Interval) -> f64 {
    since.duration_ns as f64 * 1e-9
}

/// Returns the pose of the frame `inner` in the frame `outer`.
fn transform(stamp_ns: i64, outer: &str, inner: &str, pose: &Pose) -> TransformStamped {
    let geometry_msgs::Pose {
        position: Point { x, y, z },
        orientation: rotation,
    } = self::pose(pose);
    TransformStamped {
        header: Header::new(stamp_ns, outer),
        child_frame_id: inner.to_owned(),
        transform: Transform {
            translation: Vector3 { x, y, z },
            rotation,
        },
    }
}

/// Returns a pose in the plane as one in space.
pub fn pose(pose: &Pose) -> geometry_msgs::Pose {
    let [x, y, yaw_rad] = xy_yaw(pose);
    let (z, w) = (0.5 * yaw_rad).sin_cos();
    geometry_msgs::Pose {
        position: Point { x, y, z: 0.0 },
        orientation: Quaternion {
            x: 0.0,
            y: 0.0,
            z,
            w,
        },
    }
}

/// Returns a map as a grid of `[columns, rows]` cells of `cell_m` metres, whose lowest x and y is
/// `corner_m` and whose axes are parallel to `frame`.
pub fn occupancy_grid(
    stamp_ns: i64,
    frame: &str,
    cell_m: f64,
    [columns, rows]: [usize; 2],
    corner_m: Vector2<f64>,
    data: Vec<u8>,
) -> OccupancyGrid {
    OccupancyGrid {
        header: Header::new(stamp_ns, frame),
        info: MapMetaData {
            map_load_time: Time::from_ns(stamp_ns),
            resolution: cell_m as f32,
            width: columns as u32,
            height: rows as u32,
            origin: pose(&planar(corner_m.x, corner_m.y, 0.0)),
        },
        data,
    }
}

#[cfg(test)]
mod tests;
