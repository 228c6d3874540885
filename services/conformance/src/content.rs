//! What of a message is a result: the bytes that must be the same again, and how far two results are apart.

use bytemuck::{cast_slice, pod_read_unaligned};
use gyre_messages::{
    Item, Masked, MaskedHeader, Message, Motion, MotionHeader, Pose, Refined, Rotation, Scan,
    ScanHeader, StageId, flag,
};
use gyre_stage::{StageError, supervise::rig::Recorded};

/// Returns the bytes of a message that its inputs determine: all but the times of its processing, its sender, and what it does not use
/// of its payload.
///
/// # Errors
/// A message of another topic.
pub(crate) fn essence(topic: &str, message: &Recorded) -> Result<Vec<u8>, StageError> {
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
    let measured = match topic {
        Scan::TOPIC => None,
        Masked::TOPIC => Some(masks(&pairs)?),
        _ => Some(motions(topic, &pairs)?),
    };
    let measured = measured.map_or_else(String::new, |measured| format!("; {measured}"));
    Ok(format!(
        "{equal} of {items} items are the same bytes{measured}"
    ))
}

type Pairs<'a> = [(&'a Recorded, &'a Recorded)];

fn masks(pairs: &Pairs<'_>) -> Result<String, StageError> {
    let (mut difference, mut level, mut cells) = (0.0, 0.0, 0.0);
    let mut points = [0, 0];
    for (own, other) in pairs {
        let mut parts = [Vec::new(), Vec::new()];
        for (i, message) in [own, other].into_iter().enumerate() {
            let header = message.header::<Masked>()?;
            points[i] += header.points;
            let values = floats(&message.payload);
            parts[i] = rasters(&header, &values).concat();
        }
        let [own, other] = parts;
        for (own, other) in own.iter().zip(&other) {
            difference += f64::from((own - other).abs());
            level += f64::from(*own);
            cells += 1.0;
        }
    }
    Ok(format!(
        "mean absolute difference of the rasters {:.4}, where the mean of our own is {:.4}; {} points to our {}",
        difference / f64::max(cells, 1.0),
        level / f64::max(cells, 1.0),
        points[1],
        points[0]
    ))
}

fn motions(topic: &str, pairs: &Pairs<'_>) -> Result<String, StageError> {
    let mut squares = [0.0; 3];
    for (own, other) in pairs {
        let (own, other) = (planar(topic, own)?, planar(topic, other)?);
        for i in 0..3 {
            squares[i] += (own[i] - other[i]).powi(2);
        }
    }
    let [x_m, y_m, yaw_rad] = squares.map(|sum| (sum / pairs.len().max(1) as f64).sqrt());
    let yaw = format!("{:.4} deg in yaw", yaw_rad.to_degrees());
    Ok(match topic {
        Rotation::TOPIC => format!("RMS difference {yaw}"),
        _ => format!("RMS difference {x_m:.4} m in x, {y_m:.4} m in y, {yaw}"),
    })
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
pub(crate) fn work_ns(stage: StageId, message: &Recorded) -> i64 {
    let hop = message.item().hops[stage as usize];
    hop.finished_ns.saturating_sub(hop.started_ns)
}
