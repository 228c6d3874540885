//! Messages as viewers draw them, in Foxglove's schemas: see [`CHANNELS`].
//!
//! Motions are in the frame of the scan before, poses and objects in the frame of the first scan,
//! loops in the frame of the earlier keyframe, fixes in the map of the earlier drive. `/points` is
//! not recorded: the wire message has them. `/correction` is later than the poses, so it is on a
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
    Correction, Drawing, Fix, FixHeader, Item, Loop, Masked, MaskedHeader, Message, Motion,
    Objects, ObjectsHeader, PoseHeader, Refined, Rotation, Scan, topic, wire::Number,
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
const ARROW_HEAD_M: f64 = 1.0;
const POSES: &str = gyre_contract::Pose::TOPIC;
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
    shown: Shown,
}

/// The part of a message that a channel shows.
enum Shown {
    Image,
    /// The points, a trajectory, or a line of the log: see [`View`].
    Apart,
    /// A place in a frame, by the fields of its x, y and yaw. A field without a name is zero.
    Place(&'static str, [&'static str; 3]),
    /// The second frame, whose pose a message has, in the first.
    Frame([&'static str; 2]),
    Objects,
}
use Shown::{Apart, Frame, Image, Place};

const POSE: [&str; 3] = ["x_m", "y_m", "yaw_rad"];
const MOTION: [&str; 3] = ["motion.x_m", "motion.y_m", "motion.yaw_rad"];
const TURN: [&str; 3] = ["", "", "rotation.angle_rad"];

/// All channels, in the order of the stream.
pub const CHANNELS: [Channel; 14] = [
    channel::<RawImage>(Some(Scan::TOPIC), "/scan", Image),
    channel::<RawImage>(Some(Masked::TOPIC), "/masked", Image),
    channel::<PointCloud>(Some(Masked::TOPIC), POINTS, Apart),
    channel::<PoseInFrame>(Some(Rotation::TOPIC), "/rotation", Place(PREVIOUS, TURN)),
    channel::<PoseInFrame>(Some(Motion::TOPIC), "/motion", Place(PREVIOUS, MOTION)),
    channel::<PoseInFrame>(Some(Refined::TOPIC), "/refined", Place(PREVIOUS, MOTION)),
    channel::<PoseInFrame>(Some(POSES), "/pose", Place(ODOMETRY, POSE)),
    channel::<FrameTransform>(Some(POSES), "/tf", Frame([ODOMETRY, RADAR])),
    channel::<PosesInFrame>(Some(POSES), TRAJECTORY, Apart),
    channel::<PoseInFrame>(Some(Loop::TOPIC), "/loop", Place("earlier_keyframe", POSE)),
    channel::<FrameTransform>(
        Some(Correction::TOPIC),
        "/correction",
        Frame(["map", ODOMETRY]),
    ),
    channel::<PoseInFrame>(Some(Fix::TOPIC), "/fix", Place("earlier_map", POSE)),
    channel::<SceneUpdate>(Some(Objects::TOPIC), "/objects", Shown::Objects),
    channel::<Log>(None, LOG, Apart),
];

const fn channel<M: Encode>(
    topic: Option<&'static str>,
    name: &'static str,
    shown: Shown,
) -> Channel {
    Channel {
        topic,
        name,
        schema: M::get_schema,
        shown,
    }
}

impl Channel {
    fn view(&self, header: &[u8]) -> Option<View> {
        let structure = topic(self.topic?)?.structure;
        if header.len() != structure.bytes {
            return None;
        }
        if self.topic == Some(Fix::TOPIC) {
            // A lost one has no place.
            read::<FixHeader>(header)?.pose()?;
        }
        let item: Item = read(header.get(..size_of::<Item>())?)?;
        let place = |fields: [&str; 3]| {
            fields.map(|field| {
                let value = structure.value(field, header);
                let number = value.and_then(|it| it.number());
                number.map_or(0.0, Number::as_f64)
            })
        };
        match self.shown {
            Image | Apart => None,
            Place(frame, fields) => Some(in_frame(self.name, frame, &item, place(fields))),
            Frame(frames) => Some(transform(self.name, frames, &item, place(POSE))),
            Shown::Objects => Some(objects(self.name, &read(header)?)),
        }
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
    let channels = CHANNELS.iter().filter(|it| it.topic == Some(topic));
    channels.filter_map(|it| it.view(header)).collect()
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
        let header: PoseHeader = (topic == POSES).then(|| read(header))??;
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

/// Returns the objects as one entity, which replaces the entity of the scan before.
fn objects(channel: &'static str, header: &ObjectsHeader) -> View {
    let mut entity = SceneEntity {
        timestamp: Some(timestamp(header.item.stamp_ns)),
        frame_id: ODOMETRY.to_owned(),
        id: Objects::TOPIC.to_owned(),
        ..SceneEntity::default()
    };
    for object in header.list() {
        let Drawing {
            sides_m: [x, y, z],
            colour: [r, g, b],
            label,
            arrow_m,
        } = object.drawing();
        let colour = |a: f64| Some(Color { r, g, b, a });
        let lifted = |yaw_rad: f64, height_m: f64| {
            let mut pose = pose([object.x_m, object.y_m, yaw_rad]);
            pose.position.as_mut()?.z = height_m;
            Some(pose)
        };
        entity.cubes.push(CubePrimitive {
            pose: lifted(object.yaw_rad, 0.5 * z),
            size: Some(Vector3 { x, y, z }),
            color: colour(Drawing::OPACITY),
        });
        entity.arrows.extend(arrow_m.map(|way_m| ArrowPrimitive {
            pose: lifted(object.vy_mps.atan2(object.vx_mps), z),
            shaft_length: (way_m - ARROW_HEAD_M).max(0.0),
            shaft_diameter: 0.3,
            head_length: ARROW_HEAD_M.min(way_m),
            head_diameter: Drawing::ARROW_M,
            color: colour(1.0),
        }));
        entity.texts.push(TextPrimitive {
            pose: lifted(0.0, z + 1.0),
            billboard: true,
            font_size: Drawing::LETTER_M,
            scale_invariant: false,
            color: colour(1.0),
            text: label,
        });
    }
    let message = SceneUpdate {
        deletions: Vec::new(),
        entities: vec![entity],
    };
    View::of(channel, &message)
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

pub fn image_channel(topic: &str) -> Option<&'static str> {
    let is_it = |it: &&Channel| it.topic == Some(topic) && matches!(it.shown, Image);
    CHANNELS.iter().find(is_it).map(|it| it.name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_made_of_fields_that_its_message_has() {
        for channel in &CHANNELS {
            let fields = match channel.shown {
                Place(_, fields) => fields,
                Frame(_) => POSE,
                _ => continue,
            };
            let structure = channel.topic.and_then(topic).unwrap().structure;
            let header = vec![0; structure.bytes];
            for field in fields.iter().filter(|it| !it.is_empty()) {
                assert!(structure.value(field, &header).is_some(), "{field}");
            }
        }
    }
}
