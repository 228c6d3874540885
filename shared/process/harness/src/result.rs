//! The result in a message: its bytes, and the difference of two results.

use bytemuck::{cast_slice, pod_read_unaligned};
use gyre_geometry::wrap_angle;
use gyre_messages::{
    Item, Masked, MaskedHeader, Message, Motion, MotionHeader, Pose, Refined, Rotation, Scan,
    ScanHeader, flag,
};
use gyre_stage::StageError;
use gyre_supervise::rig::Recorded;

/// Returns the bytes of a message that its inputs determine: all but the times of its processing,
/// its sender, and the unused part of its payload.
///
/// # Errors
/// A message of another topic.
pub fn result_bytes(topic: &str, message: &Recorded) -> Result<Vec<u8>, StageError> {
    let item = message.item();
    let item = Item {
        due_ns: 0,
        generation: 0,
        numbered_from: 0,
        flags: item.flags & !flag::SYNC,
        hops: Default::default(),
        ..item
    };
    if item.is(flag::END) {
        return Ok([item.seq, item.flags.into()].map(u64::to_le_bytes).concat());
    }
    let message = message.about(&item);
    match topic {
        Scan::TOPIC => scan(&message),
        Masked::TOPIC => masked(&message),
        _ => Ok(message.header_bytes().to_vec()),
    }
}

/// Returns the header without the unused rows of its tables, and the rows of the sweep.
fn scan(message: &Recorded) -> Result<Vec<u8>, StageError> {
    let mut header: ScanHeader = message.header::<Scan>()?;
    let azimuths = header.azimuths as usize;
    header.azimuth_stamp_ns[azimuths..].fill(0);
    header.azimuth_rad[azimuths..].fill(0.0);
    header.azimuth_flags[azimuths..].fill(0);
    let sweep = header.view(&message.payload);
    let rows = sweep
        .iter()
        .flat_map(|sweep| (0..azimuths).flat_map(|row| sweep.row(row).to_vec()));
    let rows: Vec<u8> = rows.collect();
    // Where in the payload the rows are is no result.
    (header.first_byte, header.stride) = (0, 0);
    Ok([message.with::<Scan>(&header).header_bytes(), &rows].concat())
}

fn masked(message: &Recorded) -> Result<Vec<u8>, StageError> {
    let header = message.header::<Masked>()?;
    let values = floats(&message.payload);
    let mut bytes = message.header_bytes().to_vec();
    for raster in rasters(&header, &values) {
        bytes.extend_from_slice(cast_slice(&raster));
    }
    bytes.extend_from_slice(cast_slice(header.points(&values).unwrap_or_default()));
    Ok(bytes)
}

/// Returns the values of a payload, which need not be aligned.
pub fn floats(payload: &[u8]) -> Vec<f32> {
    payload.chunks_exact(4).map(pod_read_unaligned).collect()
}

/// Returns the cells of the rasters, row after row.
fn rasters(header: &MaskedHeader, values: &[f32]) -> Vec<Vec<f32>> {
    let pair = header.pair(values, Some((header, values)));
    let Some(pair) = pair else {
        return Vec::new();
    };
    let earlier = pair.earlier.filter(|_| pair.earlier_changed);
    let views = std::iter::once(pair.later).chain(earlier);
    views.map(|view| view.iter().copied().collect()).collect()
}

/// The difference of two results for an item.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Difference {
    /// Of masks.
    Masks {
        /// Mean absolute difference of the cells of the rasters.
        mean_absolute: f64,
        /// Mean of the cells of the first result.
        level: f64,
        /// The numbers of points.
        points: [u32; 2],
    },
    /// Of rotations, motions and poses, from the first to the second.
    Planar {
        /// In x, m.
        x_m: f64,
        /// In y, m.
        y_m: f64,
        /// In yaw, rad, at most half a turn.
        yaw_rad: f64,
    },
}

/// Returns the difference of two results for an item; `None` for scans.
///
/// # Errors
/// Messages of another topic.
pub fn difference(
    topic: &str,
    one: &Recorded,
    other: &Recorded,
) -> Result<Option<Difference>, StageError> {
    Ok(match topic {
        Scan::TOPIC => None,
        Masked::TOPIC => Some(difference_of_masks(one, other)?),
        _ => {
            let (one, other) = (planar(topic, one)?, planar(topic, other)?);
            Some(Difference::Planar {
                x_m: other[0] - one[0],
                y_m: other[1] - one[1],
                yaw_rad: wrap_angle(other[2] - one[2]),
            })
        }
    })
}

fn difference_of_masks(one: &Recorded, other: &Recorded) -> Result<Difference, StageError> {
    let mut points = [0; 2];
    let mut cells = [Vec::new(), Vec::new()];
    for (i, message) in [one, other].into_iter().enumerate() {
        let header = message.header::<Masked>()?;
        points[i] = header.points;
        cells[i] = rasters(&header, &floats(&message.payload)).concat();
    }
    let [one, other] = cells;
    let pairs = || one.iter().zip(&other);
    let mean = |sum: f64| sum / pairs().count().max(1) as f64;
    Ok(Difference::Masks {
        mean_absolute: mean(pairs().map(|(a, b)| f64::from((a - b).abs())).sum()),
        level: mean(pairs().map(|(a, _)| f64::from(*a)).sum()),
        points,
    })
}

/// Returns the result of a search, a refinement or a composition: x, y (m), yaw (rad).
fn planar(topic: &str, message: &Recorded) -> Result<[f64; 3], StageError> {
    let motion =
        |header: MotionHeader| [header.motion.x_m, header.motion.y_m, header.motion.yaw_rad];
    Ok(match topic {
        Rotation::TOPIC => [0.0, 0.0, message.header::<Rotation>()?.rotation.angle_rad],
        Motion::TOPIC => motion(message.header::<Motion>()?),
        Refined::TOPIC => motion(message.header::<Refined>()?),
        _ => {
            let pose = message.header::<Pose>()?;
            [pose.x_m, pose.y_m, pose.yaw_rad]
        }
    })
}
