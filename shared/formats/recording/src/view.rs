//! Messages as viewers draw them, in Foxglove's schemas: see [`CHANNELS`].
//!
//! Motions are in the frame of the scan before, poses and objects in that of the first scan, loops
//! in that of the earlier keyframe, fixes in the map of the earlier drive. `/points` is not
//! recorded: the wire message has them. `/correction` is later than the poses, so it is on a
//! channel of its own beside `/tf`, which is in order.

use std::collections::VecDeque;

use foxglove::{
    Encode, Schema,
    messages::{
        ArrowPrimitive, Color, CubePrimitive, FrameTransform, Log, PackedElementField, PointCloud,
        Pose, PoseInFrame, PosesInFrame, Quaternion, RawImage, SceneEntity, SceneUpdate,
        TextPrimitive, Timestamp, Vector3, log::Level, packed_element_field::NumericType,
    },
};
use gyre_contract::{
    Correction, CorrectionHeader, Fix, FixHeader, Item, ListedObject, Loop, LoopHeader, Masked,
    MaskedHeader, Message, Motion, MotionHeader, Objects, ObjectsHeader, PoseHeader, Refined,
    Rotation, RotationHeader, Scan,
};
use gyre_geometry::SparsePoint;

use crate::image::{Rows, read};

/// Poses of a recorded trajectory: at four scans a second two minutes, in 14 kB.
const RECENT: usize = 500;
/// Time between two of them, ns.
const TRAJECTORY_PERIOD_NS: i64 = 1_000_000_000;
/// The frame of the first scan.
const ODOMETRY: &str = "odometry";
/// The frame of the radar at its last scan.
const RADAR: &str = "radar";
/// The frame of the scan before, for motions.
const PREVIOUS: &str = "previous_scan";
/// Display height of objects, m: a radar in the plane does not measure it.
const OBJECT_HEIGHT_M: f64 = 1.6;
const ARROW_HEAD_M: f64 = 1.0;
pub const LOG: &str = "/log";
pub const TRAJECTORY: &str = "/trajectory";
pub const POINTS: &str = "/points";

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogLine {
    /// When it was written, ns since 1970 on the clock of the machine.
    pub written_ns: i64,
    /// `ERROR`, `WARN`, `INFO` or `DEBUG`.
    pub level: String,
    pub stage: String,
    pub message: String,
}

#[derive(Clone, Debug)]
pub struct View {
    pub channel: &'static str,
    pub schema: fn() -> Option<Schema>,
    /// The message in protobuf.
    pub data: Vec<u8>,
}

pub struct Channel {
    /// The topic that it is made of; [`LOG`] is made of no topic.
    pub topic: Option<&'static str>,
    pub name: &'static str,
    pub schema: fn() -> Option<Schema>,
}

/// All channels, in the order of the stream.
pub const CHANNELS: [Channel; 14] = [
    channel::<RawImage>(Some(Scan::TOPIC), "/scan"),
    channel::<RawImage>(Some(Masked::TOPIC), "/masked"),
    channel::<PointCloud>(Some(Masked::TOPIC), POINTS),
    channel::<PoseInFrame>(Some(Rotation::TOPIC), "/rotation"),
    channel::<PoseInFrame>(Some(Motion::TOPIC), "/motion"),
    channel::<PoseInFrame>(Some(Refined::TOPIC), "/refined"),
    channel::<PoseInFrame>(Some(gyre_contract::Pose::TOPIC), "/pose"),
    channel::<FrameTransform>(Some(gyre_contract::Pose::TOPIC), "/tf"),
    channel::<PosesInFrame>(Some(gyre_contract::Pose::TOPIC), TRAJECTORY),
    channel::<PoseInFrame>(Some(Loop::TOPIC), "/loop"),
    channel::<FrameTransform>(Some(Correction::TOPIC), "/correction"),
    channel::<PoseInFrame>(Some(Fix::TOPIC), "/fix"),
    channel::<SceneUpdate>(Some(Objects::TOPIC), "/objects"),
    channel::<Log>(None, LOG),
];

const fn channel<M: Encode>(topic: Option<&'static str>, name: &'static str) -> Channel {
    Channel {
        topic,
        name,
        schema: M::get_schema,
    }
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

    /// Returns the image of a message of a topic that has one; `None` if the payload is shorter
    /// than the header requires.
    pub fn image_of(topic: &str, header: &[u8], payload: &[u8], stamp_ns: i64) -> Option<Self> {
        let rows = Rows::of(topic, header)?;
        let (image, _) = rows.split(payload)?;
        Some(Self::image(image_channel(topic)?, &rows, image, stamp_ns))
    }

    pub(crate) fn image(channel: &'static str, rows: &Rows, image: Vec<u8>, stamp_ns: i64) -> Self {
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

    /// Returns the points of a scan, motion-compensated as its raster is. A point without weight is
    /// left out.
    pub fn points(points: &[SparsePoint], header: &MaskedHeader) -> Self {
        let values = header
            .deskewed(points)
            .flat_map(|([x, y], weight)| [x as f32, y as f32, weight]);
        let data: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
        let fields = ["x", "y", "weight"].into_iter().zip([0, 4, 8]);
        let field = |(name, offset): (&str, u32)| PackedElementField {
            name: name.to_owned(),
            offset,
            r#type: NumericType::Float32.into(),
        };
        let message = PointCloud {
            timestamp: Some(timestamp(header.item.stamp_ns)),
            frame_id: RADAR.to_owned(),
            pose: Some(pose([0.0; 3])),
            point_stride: 12,
            fields: fields.map(field).collect(),
            data: data.into(),
        };
        Self::of(POINTS, &message)
    }

    /// Returns a trajectory of places: x, y (m) and yaw (rad).
    pub fn trajectory(places: impl Iterator<Item = [f64; 3]>, stamp_ns: i64) -> Self {
        let message = PosesInFrame {
            timestamp: Some(timestamp(stamp_ns)),
            frame_id: ODOMETRY.to_owned(),
            poses: places.map(pose).collect(),
        };
        Self::of(TRAJECTORY, &message)
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

/// Returns what viewers draw of a message beside its image, its points and the trajectory.
pub fn views(topic: &str, header: &[u8]) -> Vec<View> {
    views_of(topic, header).unwrap_or_default()
}

fn views_of(topic: &str, header: &[u8]) -> Option<Vec<View>> {
    Some(match topic {
        Rotation::TOPIC => {
            let it: RotationHeader = read(header)?;
            let place = [0.0, 0.0, it.rotation.angle_rad];
            vec![in_frame("/rotation", PREVIOUS, &it.item, place)]
        }
        Motion::TOPIC => vec![motion("/motion", &read(header)?)],
        Refined::TOPIC => vec![motion("/refined", &read(header)?)],
        gyre_contract::Pose::TOPIC => {
            let it: PoseHeader = read(header)?;
            let place = [it.x_m, it.y_m, it.yaw_rad];
            vec![
                in_frame("/pose", ODOMETRY, &it.item, place),
                transform("/tf", [ODOMETRY, RADAR], &it.item, place),
            ]
        }
        Loop::TOPIC => {
            let it: LoopHeader = read(header)?;
            let place = [it.x_m, it.y_m, it.yaw_rad];
            vec![in_frame("/loop", "earlier_keyframe", &it.item, place)]
        }
        Correction::TOPIC => {
            let it: CorrectionHeader = read(header)?;
            let place = [it.x_m, it.y_m, it.yaw_rad];
            vec![transform("/correction", ["map", ODOMETRY], &it.item, place)]
        }
        Fix::TOPIC => {
            let it: FixHeader = read(header)?;
            it.pose()?;
            let place = [it.x_m, it.y_m, it.yaw_rad];
            vec![in_frame("/fix", "earlier_map", &it.item, place)]
        }
        Objects::TOPIC => vec![objects(&read(header)?)],
        _ => return None,
    })
}

#[derive(Default)]
pub(crate) struct Recent {
    places: VecDeque<[f64; 3]>,
    /// When the next trajectory is due on the sensor's clock, ns.
    due_ns: Option<i64>,
}

impl Recent {
    /// Adds a message if it is a pose, and returns the trajectory if it is due.
    pub fn add(&mut self, topic: &str, header: &[u8]) -> Option<View> {
        let header: PoseHeader = (topic == gyre_contract::Pose::TOPIC).then(|| read(header))??;
        if self.places.len() == RECENT {
            self.places.pop_front();
        }
        self.places
            .push_back([header.x_m, header.y_m, header.yaw_rad]);
        let stamp_ns = header.item.stamp_ns;
        if self.due_ns.is_some_and(|due_ns| stamp_ns < due_ns) {
            return None;
        }
        self.due_ns = Some(stamp_ns.saturating_add(TRAJECTORY_PERIOD_NS));
        Some(View::trajectory(self.places.iter().copied(), stamp_ns))
    }
}

fn motion(channel: &'static str, header: &MotionHeader) -> View {
    let motion = &header.motion;
    let place = [motion.x_m, motion.y_m, motion.yaw_rad];
    in_frame(channel, PREVIOUS, &header.item, place)
}

/// Returns the objects as one entity, which replaces the entity of the scan before.
fn objects(header: &ObjectsHeader) -> View {
    let listed = header.list();
    let moving = listed.iter().filter(|it| it.is_moving());
    let entity = SceneEntity {
        timestamp: Some(timestamp(header.item.stamp_ns)),
        frame_id: ODOMETRY.to_owned(),
        id: Objects::TOPIC.to_owned(),
        cubes: listed.iter().map(cube).collect(),
        arrows: moving.map(arrow).collect(),
        texts: listed.iter().map(name).collect(),
        ..SceneEntity::default()
    };
    let message = SceneUpdate {
        deletions: Vec::new(),
        entities: vec![entity],
    };
    View::of("/objects", &message)
}

fn cube(object: &ListedObject) -> CubePrimitive {
    CubePrimitive {
        pose: lifted(object, object.yaw_rad, 0.5 * OBJECT_HEIGHT_M),
        size: Some(Vector3 {
            x: object.length_m,
            y: object.width_m,
            z: OBJECT_HEIGHT_M,
        }),
        color: Some(object_colour(object, 0.5)),
    }
}

fn arrow(object: &ListedObject) -> ArrowPrimitive {
    let (way_m, heading_rad) = (object.speed_mps(), object.vy_mps.atan2(object.vx_mps));
    ArrowPrimitive {
        pose: lifted(object, heading_rad, OBJECT_HEIGHT_M),
        shaft_length: (way_m - ARROW_HEAD_M).max(0.0),
        shaft_diameter: 0.3,
        head_length: ARROW_HEAD_M.min(way_m),
        head_diameter: 0.9,
        color: Some(object_colour(object, 1.0)),
    }
}

fn name(object: &ListedObject) -> TextPrimitive {
    TextPrimitive {
        pose: lifted(object, 0.0, OBJECT_HEIGHT_M + 1.0),
        billboard: true,
        font_size: 1.2,
        scale_invariant: false,
        color: Some(object_colour(object, 1.0)),
        text: object.id.to_string(),
    }
}

/// Orange if it moves, grey if it stands.
fn object_colour(object: &ListedObject, a: f64) -> Color {
    let [r, g, b] = match object.is_moving() {
        true => [1.0, 0.55, 0.1],
        false => [0.6, 0.65, 0.7],
    };
    Color { r, g, b, a }
}

fn lifted(object: &ListedObject, yaw_rad: f64, height_m: f64) -> Option<Pose> {
    let mut pose = pose([object.x_m, object.y_m, yaw_rad]);
    pose.position.as_mut()?.z = height_m;
    Some(pose)
}

fn in_frame(channel: &'static str, frame: &str, item: &Item, place: [f64; 3]) -> View {
    let message = PoseInFrame {
        timestamp: Some(timestamp(item.stamp_ns)),
        frame_id: frame.to_owned(),
        pose: Some(pose(place)),
    };
    View::of(channel, &message)
}

/// The pose of the second frame in the first.
fn transform(channel: &'static str, frames: [&str; 2], item: &Item, place: [f64; 3]) -> View {
    let [parent_frame_id, child_frame_id] = frames.map(str::to_owned);
    let pose = pose(place);
    let message = FrameTransform {
        timestamp: Some(timestamp(item.stamp_ns)),
        parent_frame_id,
        child_frame_id,
        translation: pose.position,
        rotation: pose.orientation,
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

pub(crate) fn image_channel(topic: &str) -> Option<&'static str> {
    match topic {
        Scan::TOPIC => Some("/scan"),
        Masked::TOPIC => Some("/masked"),
        _ => None,
    }
}
