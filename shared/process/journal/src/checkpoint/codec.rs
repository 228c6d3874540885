//! The binary layout of the slots of a checkpoint: little-endian words of 8 bytes, the first one a
//! checksum of the rest.

use gyre_geometry::Twist;
use gyre_scan_matching::{
    Anchor, Heading, Keyframe, Standstill, TrackerState, Verdict, WheelState,
};
use gyre_storage::Checksum;
use nalgebra::{Complex, Isometry2, Matrix2, Matrix3, Matrix4, Translation2, UnitComplex};

/// Words of a state's slot before the names of its keyframes: the checksum; the item, the checksum
/// of its motion, the number of keyframes; the tracker state.
const STATE_WORDS: usize = 1 + 3 + TRACKER_WORDS;
const NAME_WORDS: usize = 2;
const TRACKER_WORDS: usize = DOPPLER + WHEEL_WORDS;
const STANDSTILL_WORDS: usize = 4 + 4 + 4;
/// A word for its presence; bias, yaw bias, scale, covariance; the last verdict.
const HEADING_WORDS: usize = 1 + 3 + 16 + 1;
/// A word for their presence; scale, offset, three dead reckonings and the time of the last; both
/// covariances; whether they slip.
const WHEEL_WORDS: usize = 1 + 6 + 4 + 9 + 1;
const ANCHOR_WORDS: usize = 9;
/// Where the means and counts of a tracker state begin, its standstill, its heading, its wheels and
/// its velocity by Doppler.
const REST: usize = 4 + 2 * ANCHOR_WORDS;
const STANDSTILL: usize = REST + 8;
const HEADING: usize = STANDSTILL + STANDSTILL_WORDS;
const WHEELS: usize = HEADING + HEADING_WORDS;
const DOPPLER: usize = WHEELS + WHEEL_WORDS;
/// Words of a keyframe's slot before its cells: checksum, id, pose, displacement by the search,
/// corners of both levels.
pub(super) const KEYFRAME_WORDS: usize = CORNERS + 4;
const CORNERS: usize = 2 + 4 + 2;
/// The checksum of an empty slot. No content has it.
pub(super) const EMPTY: [u8; 8] = [0; 8];

/// Bytes of the slot of a state with at most so many keyframes.
pub(super) const fn state_bytes(max_keyframes: usize) -> usize {
    8 * (STATE_WORDS + NAME_WORDS * max_keyframes)
}

/// The header of a state's slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct StateHeader {
    /// The item after which the state was written.
    pub item: u64,
    /// The checksum of the item's motion.
    pub motion: u64,
}

/// The name of a keyframe's content: two keyframes of one scan can differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Name {
    pub id: u64,
    /// The checksum of the slot.
    pub check: u64,
}

fn word(bytes: &[u8], k: usize) -> u64 {
    bytes[8 * k..]
        .first_chunk()
        .map_or(0, |word| u64::from_le_bytes(*word))
}

fn set_word(bytes: &mut [u8], k: usize, word: u64) {
    bytes[8 * k..8 * k + 8].copy_from_slice(&word.to_le_bytes());
}

fn pose_words(pose: &Isometry2<f64>) -> [u64; 4] {
    [
        pose.translation.x,
        pose.translation.y,
        pose.rotation.re,
        pose.rotation.im,
    ]
    .map(f64::to_bits)
}

/// Restores a pose bit for bit, without normalizing its rotation.
fn pose_from(words: &[u64]) -> Isometry2<f64> {
    let [x, y, re, im] = [0, 1, 2, 3].map(|k| f64::from_bits(words[k]));
    Isometry2::from_parts(
        Translation2::new(x, y),
        UnitComplex::new_unchecked(Complex::new(re, im)),
    )
}

fn tracker_words(state: &TrackerState) -> [u64; TRACKER_WORDS] {
    let mut words = [0; TRACKER_WORDS];
    words[..4].copy_from_slice(&pose_words(&state.pose));
    for (k, anchor) in state.anchors.iter().enumerate() {
        let words = &mut words[4 + k * ANCHOR_WORDS..][..ANCHOR_WORDS];
        if let Some(anchor) = anchor {
            words[0] = 1;
            words[1..5].copy_from_slice(&pose_words(&anchor.pose));
            let twist = anchor.twist;
            words[5..].copy_from_slice(
                &[
                    twist.vx_mps,
                    twist.vy_mps,
                    twist.yaw_rate_radps,
                    anchor.age_s,
                ]
                .map(f64::to_bits),
            );
        }
    }
    let rest = [
        state.mean_overlap.to_bits(),
        state.mean_weight.to_bits(),
        state.doubtful.into(),
        state.unmatched.into(),
        state.along_walls.into(),
        state.sliding.into(),
        state.ahead_m.x.to_bits(),
        state.ahead_m.y.to_bits(),
    ];
    words[REST..STANDSTILL].copy_from_slice(&rest);
    words[STANDSTILL..HEADING].copy_from_slice(&standstill_words(&state.standstill));
    if let Some(heading) = &state.heading {
        words[HEADING..WHEELS].copy_from_slice(&heading_words(heading));
    }
    if let Some(wheels) = &state.wheels {
        words[WHEELS..DOPPLER].copy_from_slice(&wheel_words(wheels));
    }
    if let Some(doppler) = &state.doppler {
        words[DOPPLER..].copy_from_slice(&wheel_words(doppler));
    }
    words
}

fn heading_words(heading: &Heading) -> [u64; HEADING_WORDS] {
    let mut words = [1; HEADING_WORDS];
    words[1] = heading.bias_radps.to_bits();
    words[2] = heading.yaw_bias_rad.to_bits();
    words[3] = heading.scale.to_bits();
    let covariance = words[4..].iter_mut().zip(&heading.covariance);
    covariance.for_each(|(word, value)| *word = value.to_bits());
    words[20] = heading.verdict as u64;
    words
}

fn heading_from(words: &[u64]) -> Option<Heading> {
    let value = |k: usize| f64::from_bits(words[k]);
    (words[0] == 1).then(|| Heading {
        bias_radps: value(1),
        yaw_bias_rad: value(2),
        scale: value(3),
        covariance: Matrix4::from_fn(|row, column| value(4 + row + 4 * column)),
        verdict: match words[20] {
            2 => Verdict::Refused,
            1 => Verdict::Doubted,
            _ => Verdict::Agrees,
        },
    })
}

fn wheel_words(wheels: &WheelState) -> [u64; WHEEL_WORDS] {
    let mut words = [1; WHEEL_WORDS];
    let state = [
        wheels.scale,
        wheels.offset_m,
        wheels.since_match_m,
        wheels.since_match_s,
        wheels.since_match_rad,
        wheels.since_place_s,
    ];
    let covariances = wheels.covariance.iter().chain(&wheels.unmatched);
    let values = state.iter().chain(covariances).map(|it| it.to_bits());
    let values = values.chain([wheels.slips.into()]);
    words[1..]
        .iter_mut()
        .zip(values)
        .for_each(|(word, value)| *word = value);
    words
}

fn wheels_from(words: &[u64]) -> Option<WheelState> {
    let value = |k: usize| f64::from_bits(words[k]);
    (words[0] == 1).then(|| WheelState {
        scale: value(1),
        offset_m: value(2),
        since_match_m: value(3),
        since_match_s: value(4),
        since_match_rad: value(5),
        since_place_s: value(6),
        covariance: Matrix2::from_fn(|row, column| value(7 + row + 2 * column)),
        unmatched: Matrix3::from_fn(|row, column| value(11 + row + 3 * column)),
        slips: words[20] == 1,
    })
}

fn standstill_words(standstill: &Standstill) -> [u64; STANDSTILL_WORDS] {
    let mut words = [0; STANDSTILL_WORDS];
    words[..4].copy_from_slice(&pose_words(&standstill.reported));
    words[4..8].copy_from_slice(&pose_words(&standstill.anchor));
    words[8..].copy_from_slice(&[
        standstill.scans.into(),
        standstill.time_s.to_bits(),
        standstill.jitter.to_bits(),
        standstill.jitter_scans.into(),
    ]);
    words
}

fn standstill_from(words: &[u64]) -> Standstill {
    Standstill {
        reported: pose_from(words),
        anchor: pose_from(&words[4..]),
        scans: words[8] as u32,
        time_s: f64::from_bits(words[9]),
        jitter: f64::from_bits(words[10]),
        jitter_scans: words[11] as u32,
    }
}

fn tracker_from(words: &[u64; TRACKER_WORDS]) -> TrackerState {
    let anchor = |k: usize| {
        let words = &words[4 + k * ANCHOR_WORDS..][..ANCHOR_WORDS];
        let [vx_mps, vy_mps, yaw_rate_radps, age_s] =
            [5, 6, 7, 8].map(|k| f64::from_bits(words[k]));
        (words[0] == 1).then(|| Anchor {
            pose: pose_from(&words[1..5]),
            twist: Twist {
                vx_mps,
                vy_mps,
                yaw_rate_radps,
            },
            age_s,
        })
    };
    let rest = &words[REST..];
    TrackerState {
        pose: pose_from(words),
        anchors: [anchor(0), anchor(1)],
        mean_overlap: f64::from_bits(rest[0]),
        mean_weight: f64::from_bits(rest[1]),
        doubtful: rest[2] as u32,
        unmatched: rest[3] as u32,
        along_walls: rest[4] as u32,
        sliding: rest[5] as u32,
        ahead_m: [6, 7].map(|k| f64::from_bits(rest[k])).into(),
        standstill: standstill_from(&words[STANDSTILL..]),
        heading: heading_from(&words[HEADING..]),
        wheels: wheels_from(&words[WHEELS..]),
        doppler: wheels_from(&words[DOPPLER..]),
    }
}

/// Fills the slot of a state with these keyframes, oldest first.
pub(super) fn encode_state(
    header: StateHeader,
    keyframes: &[Name],
    state: &TrackerState,
    slot: &mut [u8],
) {
    slot.fill(0);
    let names = keyframes.iter().flat_map(|name| [name.id, name.check]);
    [header.item, header.motion, keyframes.len() as u64]
        .into_iter()
        .chain(tracker_words(state))
        .chain(names)
        .enumerate()
        .for_each(|(k, value)| set_word(slot, k + 1, value));
    Checksum::First.seal(slot);
}

/// Decodes a state; `None` if its checksum is wrong. Its keyframes are put into `keyframes`, oldest
/// first.
pub(super) fn decode_state(
    slot: &[u8],
    keyframes: &mut Vec<Name>,
) -> Option<(StateHeader, TrackerState)> {
    if !Checksum::First.is_right(slot) {
        return None;
    }
    let [item, motion, count] = [1, 2, 3].map(|k| word(slot, k));
    if count > ((slot.len() / 8 - STATE_WORDS) / NAME_WORDS) as u64 {
        return None;
    }
    let words = std::array::from_fn(|k| word(slot, k + 4));
    keyframes.clear();
    keyframes.extend((0..count as usize).map(|k| Name {
        id: word(slot, STATE_WORDS + NAME_WORDS * k),
        check: word(slot, STATE_WORDS + NAME_WORDS * k + 1),
    }));
    Some((StateHeader { item, motion }, tracker_from(&words)))
}

/// Fills the slot of a keyframe, and returns the name of its content.
pub(super) fn encode_keyframe(keyframe: &Keyframe, slot: &mut [u8]) -> Name {
    set_word(slot, 1, keyframe.id);
    let ahead = [keyframe.ahead_m.x, keyframe.ahead_m.y].map(f64::to_bits);
    pose_words(&keyframe.pose)
        .into_iter()
        .chain(ahead)
        .enumerate()
        .for_each(|(k, value)| set_word(slot, k + 2, value));
    let mut at = KEYFRAME_WORDS * 8;
    for (level, (corner, cells)) in keyframe.images().into_iter().enumerate() {
        corner
            .iter()
            .enumerate()
            .for_each(|(k, value)| set_word(slot, CORNERS + 2 * level + k, *value as u64));
        slot[at..]
            .iter_mut()
            .zip(cells)
            .for_each(|(to, cell)| *to = *cell);
        at += cells.len();
    }
    Checksum::First.seal(slot);
    Name {
        id: keyframe.id,
        check: word(slot, 0),
    }
}

/// Returns the name of the keyframe in a slot; `None` if its checksum is wrong.
pub(super) fn keyframe_name(slot: &[u8]) -> Option<Name> {
    Checksum::First.is_right(slot).then(|| Name {
        id: word(slot, 1),
        check: word(slot, 0),
    })
}

/// Decodes the keyframe of this name; false if the slot has a different one.
pub(super) fn decode_keyframe(slot: &[u8], name: Name, keyframe: &mut Keyframe) -> bool {
    keyframe.id = word(slot, 1);
    keyframe.pose = pose_from(&std::array::from_fn::<u64, 4, _>(|k| word(slot, k + 2)));
    keyframe.ahead_m = [6, 7].map(|k| f64::from_bits(word(slot, k))).into();
    let mut at = KEYFRAME_WORDS * 8;
    for (level, (corner, cells)) in keyframe.images_mut().into_iter().enumerate() {
        *corner = [0, 1].map(|k| word(slot, CORNERS + 2 * level + k) as i64);
        let count = cells.len();
        cells
            .into_iter()
            .zip(&slot[at..])
            .for_each(|(cell, from)| *cell = *from);
        at += count;
    }
    keyframe_name(slot) == Some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each word of a state is of a field that comes back.
    #[test]
    fn no_field_of_a_state_is_lost() {
        let mut words = std::array::from_fn(|k| k as u64 + 2);
        let flags = [4, 4 + ANCHOR_WORDS, HEADING, WHEELS, DOPPLER];
        let slips = [WHEELS + WHEEL_WORDS - 1, DOPPLER + WHEEL_WORDS - 1];
        flags.into_iter().chain(slips).for_each(|k| words[k] = 1);
        words[HEADING + HEADING_WORDS - 1] = Verdict::Refused as u64;
        assert_eq!(tracker_words(&tracker_from(&words)), words);
    }
}
