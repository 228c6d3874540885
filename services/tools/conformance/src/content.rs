//! What of a message is a result: the bytes that must be the same again, and how far two results are apart.

use bytemuck::{cast_slice, pod_read_unaligned};
use gyre_geometry::wrap_angle;
use gyre_messages::{
    Item, Masked, MaskedHeader, Message, Motion, MotionHeader, Pose, Refined, Rotation, Scan,
    ScanHeader, StageId, flag,
};
use gyre_stage::StageError;
use gyre_supervise::rig::Recorded;

/// Returns the bytes of a message that its inputs determine: all but the times of its processing, its sender, and what it does not use
/// of its payload.
///
/// # Errors
/// A message of another topic.
pub fn essence(topic: &str, message: &Recorded) -> Result<Vec<u8>, StageError> {
    let item = message.item();
    let item = Item {
        due_ns: 0,
        pid: 0,
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

/// The header without the unused rows of its tables, and the rows of the sweep.
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
pub(crate) fn floats(payload: &[u8]) -> Vec<f32> {
    payload.chunks_exact(4).map(pod_read_unaligned).collect()
}

/// The cells of the rasters, row after row.
fn rasters(header: &MaskedHeader, values: &[f32]) -> Vec<Vec<f32>> {
    let pair = header.pair(values, Some((header, values)));
    let Some(pair) = pair else {
        return Vec::new();
    };
    let earlier = pair.earlier.filter(|_| pair.earlier_changed);
    let views = std::iter::once(pair.later).chain(earlier);
    views.map(|view| view.iter().copied().collect()).collect()
}

/// Says how far results are from those of Gyre's own stage, item by item. Items that only one of them has are left out.
///
/// # Errors
/// Messages of another topic.
pub(crate) fn deviation(
    topic: &str,
    own: &[Recorded],
    other: &[Recorded],
) -> Result<String, StageError> {
    let pairs: Vec<_> = own
        .iter()
        .filter(|own| !own.item().is(flag::END))
        .filter_map(|own| {
            let same = |other: &&Recorded| {
                let item = other.item();
                item.seq == own.item().seq && !item.is(flag::BASE)
            };
            Some((own, other.iter().find(same)?))
        })
        .collect();
    let mut equal = 0;
    for (own, other) in &pairs {
        equal += usize::from(essence(topic, own)? == essence(topic, other)?);
    }
    let items = pairs.len();
    let mut differences = Vec::new();
    for (own, other) in &pairs {
        differences.extend(difference(topic, own, other)?);
    }
    let measured = summary(topic, &differences);
    let measured = measured.map_or_else(String::new, |measured| format!("; {measured}"));
    Ok(format!(
        "{equal} of {items} items are the same bytes{measured}"
    ))
}

/// How far apart two results for an item are.
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

/// Returns how far apart two results for an item are; `None` for scans.
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

/// Says how far apart results are on the whole.
fn summary(topic: &str, differences: &[Difference]) -> Option<String> {
    let items = differences.len().max(1) as f64;
    let mut sums = [0.0; 3];
    let mut all_points = [0; 2];
    for difference in differences {
        let values = match difference {
            Difference::Masks {
                mean_absolute,
                level,
                points,
            } => {
                (0..2).for_each(|i| all_points[i] += u64::from(points[i]));
                [*mean_absolute, *level, 0.0]
            }
            Difference::Planar { x_m, y_m, yaw_rad } => [x_m.powi(2), y_m.powi(2), yaw_rad.powi(2)],
        };
        (0..3).for_each(|i| sums[i] += values[i]);
    }
    let means = sums.map(|sum| sum / items);
    let [x_m, y_m, yaw_rad] = means.map(f64::sqrt);
    let yaw = format!("{:.4} deg in yaw", yaw_rad.to_degrees());
    match topic {
        Scan::TOPIC => None,
        Masked::TOPIC => Some(format!(
            "mean absolute difference of the rasters {:.4}, where the mean of our own is {:.4}; {} points to our {}",
            means[0], means[1], all_points[1], all_points[0]
        )),
        Rotation::TOPIC => Some(format!("RMS difference {yaw}")),
        _ => Some(format!(
            "RMS difference {x_m:.4} m in x, {y_m:.4} m in y, {yaw}"
        )),
    }
}

/// The result of a search, a refinement or a composition: x, y (m), yaw (rad).
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

/// Returns the time of a stage's work on an item, ns.
pub fn work_ns(stage: StageId, message: &Recorded) -> i64 {
    let hop = message.item().hops[stage as usize];
    hop.finished_ns.saturating_sub(hop.started_ns)
}
