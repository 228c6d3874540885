//! What viewers draw of a message, in Foxglove's schemas.
//!
//! | channel | schema | content |
//! |---|---|---|
//! | `/scan`, `/masked` | `RawImage` | the image of the message: [`image`](crate::image) |
//! | `/rotation`, `/motion`, `/refined` | `PoseInFrame` | the motion, in the frame of the scan before |
//! | `/pose` | `PoseInFrame` | the pose in the frame of the first scan, `odometry` |
//! | `/trajectory` | `PosesInFrame` | the last poses, once a second of the sensor's time |
//! | `/tf` | `FrameTransform` | `odometry` to `radar` |
//! | `/correction` | `FrameTransform` | `map` to `odometry`: later than the poses, so on a channel of its own, which is in order |
//! | `/loop` | `PoseInFrame` | the later keyframe in the frame of the earlier one |
//! | `/fix` | `PoseInFrame` | a keyframe in the map of the earlier drive |
//! | `/log` | `Log` | a line of `log.jsonl` |

use std::collections::VecDeque;

use foxglove::{
    Encode, Schema,
    messages::{
        FrameTransform, Log, Pose, PoseInFrame, PosesInFrame, Quaternion, RawImage, Timestamp,
        Vector3, log::Level,
    },
};
use gyre_messages::{
    Correction, CorrectionHeader, Fix, FixHeader, Item, Loop, LoopHeader, Message, Motion,
    MotionHeader, PoseHeader, Refined, Rotation, RotationHeader,
};

use crate::image::{Rows, read};

/// Poses of `/trajectory`: at four scans a second two minutes, in 14 kB.
const TRAJECTORY: usize = 500;
/// Time between two of them, ns.
const TRAJECTORY_PERIOD_NS: i64 = 1_000_000_000;
/// The frame of the first scan.
const ODOMETRY: &str = "odometry";
/// The frame of the radar at its last scan.
const RADAR: &str = "radar";
/// The frame of the scan before, for motions.
const PREVIOUS: &str = "previous_scan";
/// The channel of log lines.
pub(crate) const LOG: &str = "/log";

/// A line of the log of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogLine {
    /// When it was written, ns since 1970 on the clock of the machine.
    pub written_ns: i64,
    /// `ERROR`, `WARN`, `INFO` or `DEBUG`.
    pub level: String,
    /// The process.
    pub stage: String,
    /// The message with its fields.
    pub message: String,
}

/// An encoded message for viewers.
pub(crate) struct View {
    pub channel: &'static str,
    pub schema: fn() -> Option<Schema>,
    pub data: Vec<u8>,
}

impl View {
    fn of<M: Encode>(channel: &'static str, message: &M) -> Self {
        let mut data = Vec::with_capacity(message.encoded_len().unwrap_or_default());
        // A vector grows as it must, so there is no error.
        let _ = message.encode(&mut data);
        Self {
            channel,
            schema: M::get_schema,
            data,
        }
    }

    /// Returns the image of a message.
    pub fn image(channel: &'static str, rows: &Rows, image: Vec<u8>, stamp_ns: i64) -> Self {
        let message = RawImage {
            timestamp: Some(timestamp(stamp_ns)),
            frame_id: RADAR.to_owned(),
            width: (rows.width / rows.cell) as u32,
            height: rows.count as u32,
            encoding: rows.encoding.to_owned(),
            step: rows.width as u32,
            data: image.into(),
        };
        Self::of(channel, &message)
    }

    pub fn log(line: &LogLine) -> Self {
        let level = match line.level.as_str() {
            "ERROR" => Level::Error,
            "WARN" => Level::Warning,
            "INFO" => Level::Info,
            "DEBUG" | "TRACE" => Level::Debug,
            _ => Level::Unknown,
        };
        let message = Log {
            timestamp: Some(timestamp(line.written_ns)),
            level: level.into(),
            message: line.message.clone(),
            name: line.stage.clone(),
            ..Log::default()
        };
        Self::of(LOG, &message)
    }
}

/// Makes the views of messages, one after the other.
#[derive(Default)]
pub(crate) struct Views {
    recent: VecDeque<Pose>,
    /// When the next trajectory is due on the sensor's clock, ns.
    trajectory_due_ns: Option<i64>,
}

impl Views {
    /// Returns what viewers draw of a message beside its image.
    pub fn of(&mut self, topic: &str, header: &[u8]) -> Vec<View> {
        let views = match topic {
            Rotation::TOPIC => read(header).map(rotation),
            Motion::TOPIC => read(header).map(|header| motion("/motion", &header)),
            Refined::TOPIC => read(header).map(|header| motion("/refined", &header)),
            gyre_messages::Pose::TOPIC => read(header).map(|header| self.pose(&header)),
            Loop::TOPIC => read(header).map(closed),
            Correction::TOPIC => read(header).map(correction),
            Fix::TOPIC => read(header).map(fix),
            _ => None,
        };
        views.unwrap_or_default()
    }

    fn pose(&mut self, header: &PoseHeader) -> Vec<View> {
        let PoseHeader {
            item,
            x_m,
            y_m,
            yaw_rad,
            ..
        } = header;
        let mut views = vec![
            in_frame("/pose", ODOMETRY, item, [*x_m, *y_m, *yaw_rad]),
            transform("/tf", ODOMETRY, RADAR, item, [*x_m, *y_m, *yaw_rad]),
        ];
        if self.recent.len() == TRAJECTORY {
            self.recent.pop_front();
        }
        self.recent.push_back(pose([*x_m, *y_m, *yaw_rad]));
        if self
            .trajectory_due_ns
            .is_none_or(|due_ns| item.stamp_ns >= due_ns)
        {
            self.trajectory_due_ns = Some(item.stamp_ns.saturating_add(TRAJECTORY_PERIOD_NS));
            let trajectory = PosesInFrame {
                timestamp: Some(timestamp(item.stamp_ns)),
                frame_id: ODOMETRY.to_owned(),
                poses: self.recent.iter().copied().collect(),
            };
            views.push(View::of("/trajectory", &trajectory));
        }
        views
    }
}

fn rotation(header: RotationHeader) -> Vec<View> {
    let place = [0.0, 0.0, header.rotation.angle_rad];
    vec![in_frame("/rotation", PREVIOUS, &header.item, place)]
}

fn motion(channel: &'static str, header: &MotionHeader) -> Vec<View> {
    let motion = &header.motion;
    let place = [motion.x_m, motion.y_m, motion.yaw_rad];
    vec![in_frame(channel, PREVIOUS, &header.item, place)]
}

fn closed(header: LoopHeader) -> Vec<View> {
    let place = [header.x_m, header.y_m, header.yaw_rad];
    vec![in_frame("/loop", "earlier_keyframe", &header.item, place)]
}

fn correction(header: CorrectionHeader) -> Vec<View> {
    let place = [header.x_m, header.y_m, header.yaw_rad];
    vec![transform(
        "/correction",
        "map",
        ODOMETRY,
        &header.item,
        place,
    )]
}

fn fix(header: FixHeader) -> Vec<View> {
    let place = [header.x_m, header.y_m, header.yaw_rad];
    let found = header
        .pose()
        .map(|_| in_frame("/fix", "earlier_map", &header.item, place));
    found.into_iter().collect()
}

fn in_frame(channel: &'static str, frame: &str, item: &Item, place: [f64; 3]) -> View {
    let message = PoseInFrame {
        timestamp: Some(timestamp(item.stamp_ns)),
        frame_id: frame.to_owned(),
        pose: Some(pose(place)),
    };
    View::of(channel, &message)
}

fn transform(
    channel: &'static str,
    parent: &str,
    child: &str,
    item: &Item,
    place: [f64; 3],
) -> View {
    let Pose {
        position,
        orientation,
    } = pose(place);
    let message = FrameTransform {
        timestamp: Some(timestamp(item.stamp_ns)),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: position,
        rotation: orientation,
    };
    View::of(channel, &message)
}

/// A place of x, y (m) and yaw (rad) in three dimensions.
fn pose([x, y, yaw_rad]: [f64; 3]) -> Pose {
    let (z, w) = (yaw_rad / 2.0).sin_cos();
    Pose {
        position: Some(Vector3 { x, y, z: 0.0 }),
        orientation: Some(Quaternion {
            x: 0.0,
            y: 0.0,
            z,
            w,
        }),
    }
}

fn timestamp(ns: i64) -> Timestamp {
    let ns = ns.max(0);
    let seconds = u32::try_from(ns / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (ns % 1_000_000_000) as u32)
}
