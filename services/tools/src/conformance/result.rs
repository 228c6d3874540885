//! The item of a message that a stage has sent: the fields copied from its input, and its own hop.
//! The result in it: its bytes, and the differences of results.

use bytemuck::{cast_slice, pod_read_unaligned};
use gyre_client::RunError;
use gyre_contract::{
    Item, Masked, MaskedHeader, Message, Motion, MotionHeader, Pose, Refined, Rotation, Scan,
    ScanHeader, StageId, flag,
};
use gyre_geometry::wrap_angle;
use gyre_supervise::rig::Recorded;
use serde::Serialize;

/// Returns the fields of an output's item that a stage has to copy from its input and has not.
pub(crate) fn not_copied(stage: StageId, input: &Item, output: &Item) -> Vec<&'static str> {
    let mut hops = output.hops;
    hops[stage as usize] = input.hops[stage as usize];
    let places = Item::lost_azimuths;
    let passes_flags = output.flags & !flag::SYNC == input.flags & !flag::SYNC;
    let fields = [
        ("scan", output.scan == input.scan),
        ("previous_scan", output.previous_scan == input.previous_scan),
        ("published", output.published == input.published),
        ("generation", output.generation == input.generation),
        ("numbered_from", output.numbered_from == input.numbered_from),
        ("stamp_ns", output.stamp_ns == input.stamp_ns),
        ("due_ns", output.due_ns == input.due_ns),
        ("flags", passes_flags),
        (
            "lost (the places of lost azimuths)",
            stage <= StageId::Masking || places(output) == places(input),
        ),
        ("hops (the stamps of the stages before)", hops == input.hops),
    ];
    let missing = fields.into_iter().filter(|(_, copied)| !copied);
    missing.map(|(field, _)| field).collect()
}

/// Returns the fault in the time stamps of a stage's own hop; `None` if they are in order, and
/// between the time of sending the input (if known) and the time of reading the output, both
/// CLOCK_MONOTONIC, ns.
pub(crate) fn wrong_stamps(
    stage: StageId,
    output: &Item,
    sent_ns: Option<i64>,
    read_ns: i64,
) -> Option<String> {
    let (seq, hop) = (output.seq, output.hops[stage as usize]);
    let stamps = [
        ("received_ns", hop.received_ns),
        ("started_ns", hop.started_ns),
        ("finished_ns", hop.finished_ns),
        ("published_ns", hop.published_ns),
    ];
    if let Some((name, _)) = stamps.iter().find(|(_, stamp)| *stamp == 0) {
        return Some(format!("item {seq}: {name} of its own hop is 0"));
    }
    if let Some(pair) = stamps.windows(2).find(|pair| pair[0].1 > pair[1].1) {
        return Some(format!("item {seq}: {} is after {}", pair[0].0, pair[1].0));
    }
    let is_between =
        hop.published_ns <= read_ns && sent_ns.is_none_or(|sent_ns| hop.received_ns >= sent_ns);
    (!is_between).then(|| {
        format!(
            "item {seq}: its stamps are not between those of its input and of its reader; they are to be CLOCK_MONOTONIC, ns"
        )
    })
}

pub(crate) fn work_ns(stage: StageId, item: &Item) -> i64 {
    let hop = item.hops[stage as usize];
    hop.finished_ns.saturating_sub(hop.started_ns)
}

/// Returns the bytes of a message that its inputs determine: all but the times of its processing,
/// its sender, and the unused part of its payload.
pub(crate) fn result_bytes(topic: &str, message: &Recorded) -> Result<Vec<u8>, RunError> {
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
        _ => Ok(message.header),
    }
}

/// Returns the header without the unused rows of its tables, and the rows of the sweep.
fn scan(message: &Recorded) -> Result<Vec<u8>, RunError> {
    let mut header: ScanHeader = message.header::<Scan>()?;
    let azimuths = header.azimuths as usize;
    header.azimuth_stamp_ns[azimuths..].fill(0);
    header.azimuth_rad[azimuths..].fill(0.0);
    header.azimuth_flags[azimuths..].fill(0);
    let mut rows = Vec::new();
    if let Some(sweep) = header.view(&message.payload) {
        (0..azimuths).for_each(|row| rows.extend_from_slice(sweep.row(row)));
    }
    // Where in the payload the rows are is no result.
    (header.first_byte, header.stride) = (0, 0);
    Ok([message.with::<Scan>(&header).header, rows].concat())
}

fn masked(message: &Recorded) -> Result<Vec<u8>, RunError> {
    let header = message.header::<Masked>()?;
    let values = floats(&message.payload);
    let mut bytes = message.header.clone();
    for raster in rasters(&header, &values) {
        bytes.extend_from_slice(cast_slice(&raster));
    }
    bytes.extend_from_slice(cast_slice(header.points(&values).unwrap_or_default()));
    Ok(bytes)
}

pub(crate) fn floats(payload: &[u8]) -> Vec<f32> {
    payload.chunks_exact(4).map(pod_read_unaligned).collect()
}

fn rasters(header: &MaskedHeader, values: &[f32]) -> Vec<Vec<f32>> {
    let pair = header.pair(values, Some((header, values)));
    let Some(pair) = pair else {
        return Vec::new();
    };
    let earlier = pair.earlier.filter(|_| pair.earlier_changed);
    let views = std::iter::once(pair.later).chain(earlier);
    views.map(|view| view.iter().copied().collect()).collect()
}

#[derive(Debug, Default)]
pub(crate) struct Differences {
    /// Mean absolute differences of the cells of the rasters; lengths of the differences of the
    /// translations, m; absolute differences of the yaws, degrees.
    all: [Vec<f64>; 3],
    /// Sum of the means of the cells of the first rasters.
    mask_levels: f64,
}

impl Differences {
    /// Adds two results for an item; returns the differences of masks, of translation (m) and of
    /// rotation (deg).
    pub(crate) fn add(
        &mut self,
        topic: &str,
        one: &Recorded,
        other: &Recorded,
    ) -> Result<[Option<f64>; 3], RunError> {
        let differences = match topic {
            Scan::TOPIC => [None; 3],
            Masked::TOPIC => {
                let [one, other] = [cells(one)?, cells(other)?];
                let pairs = || one.iter().zip(&other);
                let mean = |sum: f64| sum / pairs().count().max(1) as f64;
                self.mask_levels += mean(pairs().map(|(a, _)| f64::from(*a)).sum());
                let difference = mean(pairs().map(|(a, b)| f64::from((a - b).abs())).sum());
                [Some(difference), None, None]
            }
            _ => {
                let (one, other) = (planar(topic, one)?, planar(topic, other)?);
                let rotation_deg = wrap_angle(other[2] - one[2]).to_degrees().abs();
                let translation_m = (other[0] - one[0]).hypot(other[1] - one[1]);
                let translation_m = (topic != Rotation::TOPIC).then_some(translation_m);
                [None, translation_m, Some(rotation_deg)]
            }
        };
        for (all, difference) in self.all.iter_mut().zip(differences) {
            all.extend(difference);
        }
        Ok(differences)
    }

    pub(crate) fn spreads(&self) -> Spreads {
        let [mask, translation_m, rotation_deg] = self.all.each_ref().map(|it| Spread::of(it));
        let count = self.all[0].len();
        Spreads {
            mask,
            mask_level: (count > 0).then(|| self.mask_levels / count as f64),
            translation_m,
            rotation_deg,
        }
    }
}

fn cells(message: &Recorded) -> Result<Vec<f32>, RunError> {
    let header = message.header::<Masked>()?;
    Ok(rasters(&header, &floats(&message.payload)).concat())
}

/// The differences of results; `None` where the stage's results have no such part, or all are
/// equal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spreads {
    /// Mean absolute difference of the cells of the rasters.
    pub mask: Option<Spread>,
    /// Mean of the cells of the first rasters, for comparison.
    pub mask_level: Option<f64>,
    pub translation_m: Option<Spread>,
    pub rotation_deg: Option<Spread>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    pub p50: f64,
    pub p99: f64,
    pub max: f64,
}

impl Spreads {
    pub(crate) fn rows(&self) -> Vec<String> {
        let rows = [
            ("mask", self.mask, ""),
            ("translation", self.translation_m, " m"),
            ("rotation", self.rotation_deg, " deg"),
        ];
        let row = |(name, spread, unit): (&str, Option<Spread>, &str)| {
            let Spread { p50, p99, max } = spread?;
            Some(format!(
                "{name:<13} p50 {p50:.4}{unit}, p99 {p99:.4}{unit}, max {max:.4}{unit}"
            ))
        };
        let level = self.mask_level;
        let level = level.map(|level| format!("where the mean of the real ones is {level:.4}"));
        rows.into_iter().filter_map(row).chain(level).collect()
    }

    pub(crate) fn are_zero(&self) -> bool {
        let all = [self.mask, self.translation_m, self.rotation_deg];
        all.into_iter().flatten().all(|spread| spread.max == 0.0)
    }
}

impl Spread {
    fn of(values: &[f64]) -> Option<Self> {
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        let at = |share: f64| values[((values.len() - 1) as f64 * share).ceil() as usize];
        let max = *values.last()?;
        Some(Self {
            p50: at(0.5),
            p99: at(0.99),
            max,
        })
    }
}

/// Returns the result of a search, a refinement or a composition: x, y (m), yaw (rad).
fn planar(topic: &str, message: &Recorded) -> Result<[f64; 3], RunError> {
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
