//! The binary layout of the slots of a checkpoint: little-endian words of 8 bytes, the first one a
//! checksum of the rest.

use gyre_geometry::Twist;
use gyre_matching::{Anchor, Heading, Keyframe, Standstill, TrackerState, Verdict, WheelState};
use gyre_storage::Checksum;
use nalgebra::{Complex, Isometry2, Translation2, UnitComplex};

/// Words of a state's slot before the names of its keyframes: the checksum; the item, the checksum
/// of its motion, the number of keyframes; the tracker state.
const STATE_WORDS: usize = 1 + 3 + TRACKER_WORDS;
const NAME_WORDS: usize = 2;
/// The pose, two anchors, means and counts, the standstill, the heading; the wheels and the
/// velocity by Doppler.
const TRACKER_WORDS: usize = 4 + 2 * 9 + 8 + 12 + 21 + 2 * 21;
/// Words of a keyframe's slot before its cells: checksum, id, pose, displacement by the search,
/// corners of both levels.
pub(super) const KEYFRAME_WORDS: usize = CORNERS + 4;
const CORNERS: usize = 2 + 4 + 2;
const CONTIGUOUS: &str = "the rows of an image follow each other";
/// The checksum of an empty slot. No content has it.
pub(super) const EMPTY: [u8; 8] = [0; 8];

/// Bytes of the slot of a state with at most so many keyframes.
pub(super) const fn state_bytes(max_keyframes: usize) -> usize {
    8 * (STATE_WORDS + NAME_WORDS * max_keyframes)
}

/// The name of a keyframe's content: two keyframes of one scan can differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Name {
    pub id: u64,
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

fn pose_values(pose: &Isometry2<f64>) -> [f64; 4] {
    [
        pose.translation.x,
        pose.translation.y,
        pose.rotation.re,
        pose.rotation.im,
    ]
}

/// Restores a pose bit for bit, without normalizing its rotation.
fn pose_from([x, y, re, im]: [f64; 4]) -> Isometry2<f64> {
    Isometry2::from_parts(
        Translation2::new(x, y),
        UnitComplex::new_unchecked(Complex::new(re, im)),
    )
}

/// Takes the words of a state in their order: one that writes them is given each, and one that
/// reads them replaces it.
struct Words<F>(F);

impl<F: FnMut(&mut u64)> Words<F> {
    fn real(&mut self, value: &mut f64) {
        let mut word = value.to_bits();
        (self.0)(&mut word);
        *value = f64::from_bits(word);
    }

    fn reals<'a>(&mut self, values: impl IntoIterator<Item = &'a mut f64>) {
        values.into_iter().for_each(|value| self.real(value));
    }

    fn count(&mut self, value: &mut u32) {
        let mut word = u64::from(*value);
        (self.0)(&mut word);
        *value = word as u32;
    }

    fn flag(&mut self, value: &mut bool) {
        let mut count = u32::from(*value);
        self.count(&mut count);
        *value = count == 1;
    }

    fn pose(&mut self, pose: &mut Isometry2<f64>) {
        let mut values = pose_values(pose);
        self.reals(&mut values);
        *pose = pose_from(values);
    }

    /// A word for its presence, and the words of its fields, which are zero without it.
    fn optional<T: Copy>(
        &mut self,
        value: &mut Option<T>,
        zero: T,
        fields: impl FnOnce(&mut Self, &mut T),
    ) {
        let (mut is_there, mut content) = (value.is_some(), value.unwrap_or(zero));
        self.flag(&mut is_there);
        fields(self, &mut content);
        *value = is_there.then_some(content);
    }

    fn anchor(&mut self, anchor: &mut Option<Anchor>) {
        let zero = Anchor {
            pose: pose_from([0.0; 4]),
            twist: Twist::default(),
            age_s: 0.0,
        };
        self.optional(anchor, zero, |words, it| {
            words.pose(&mut it.pose);
            words.reals([&mut it.twist.vx_mps, &mut it.twist.vy_mps]);
            words.reals([&mut it.twist.yaw_rate_radps, &mut it.age_s]);
        });
    }

    fn heading(&mut self, heading: &mut Option<Heading>) {
        self.optional(heading, Heading::default(), |words, it| {
            words.reals([&mut it.bias_radps, &mut it.yaw_bias_rad, &mut it.scale]);
            words.reals(it.covariance.iter_mut());
            let mut verdict = it.verdict as u32;
            words.count(&mut verdict);
            it.verdict = match verdict {
                2 => Verdict::Refused,
                1 => Verdict::Doubted,
                _ => Verdict::Agrees,
            };
        });
    }

    fn wheels(&mut self, wheels: &mut Option<WheelState>) {
        self.optional(wheels, WheelState::default(), |words, it| {
            words.reals([&mut it.scale, &mut it.offset_m, &mut it.since_match_m]);
            words.reals([&mut it.since_match_s, &mut it.since_match_rad]);
            words.real(&mut it.since_place_s);
            words.reals(it.covariance.iter_mut());
            words.reals(it.unmatched.iter_mut());
            words.flag(&mut it.slips);
        });
    }

    /// Names all fields, so that the compiler finds a forgotten one.
    fn tracker(&mut self, state: &mut TrackerState) {
        let TrackerState {
            pose,
            anchors,
            mean_overlap,
            mean_weight,
            doubtful,
            unmatched,
            along_walls,
            sliding,
            ahead_m,
            standstill,
            heading,
            wheels,
            doppler,
        } = state;
        let Standstill {
            reported,
            anchor,
            scans,
            time_s,
            jitter,
            jitter_scans,
        } = standstill;
        self.pose(pose);
        anchors.iter_mut().for_each(|it| self.anchor(it));
        self.reals([mean_overlap, mean_weight]);
        for count in [doubtful, unmatched, along_walls, sliding] {
            self.count(count);
        }
        self.reals(ahead_m.iter_mut());
        self.pose(reported);
        self.pose(anchor);
        self.count(scans);
        self.reals([time_s, jitter]);
        self.count(jitter_scans);
        self.heading(heading);
        self.wheels(wheels);
        self.wheels(doppler);
    }
}

/// Fills the slot of the state after an item, whose motion has this checksum, with these keyframes,
/// oldest first.
pub(super) fn encode_state(
    (item, motion): (u64, u64),
    keyframes: &[Name],
    state: &TrackerState,
    slot: &mut [u8],
) {
    slot.fill(0);
    let (mut state, mut at) = (*state, 0);
    let mut put = |word: u64| {
        at += 1;
        set_word(slot, at, word);
    };
    let head = [item, motion, keyframes.len() as u64];
    head.into_iter().for_each(&mut put);
    Words(|word: &mut u64| put(*word)).tracker(&mut state);
    let names = keyframes.iter().flat_map(|name| [name.id, name.check]);
    names.for_each(put);
    Checksum::First.seal(slot);
}

/// Decodes a state, with the item and the checksum of its motion; `None` if its checksum is wrong.
/// Puts the keyframes into `keyframes`, oldest first.
pub(super) fn decode_state(
    slot: &[u8],
    keyframes: &mut Vec<Name>,
) -> Option<((u64, u64), TrackerState)> {
    if !Checksum::First.is_right(slot) {
        return None;
    }
    let [item, motion, count] = [1, 2, 3].map(|k| word(slot, k));
    if count > ((slot.len() / 8 - STATE_WORDS) / NAME_WORDS) as u64 {
        return None;
    }
    let (mut state, mut at) = (TrackerState::default(), 3);
    let take = |value: &mut u64| {
        at += 1;
        *value = word(slot, at);
    };
    Words(take).tracker(&mut state);
    keyframes.clear();
    keyframes.extend((0..count as usize).map(|k| Name {
        id: word(slot, STATE_WORDS + NAME_WORDS * k),
        check: word(slot, STATE_WORDS + NAME_WORDS * k + 1),
    }));
    Some(((item, motion), state))
}

/// Fills the slot of a keyframe, and returns the name of its content.
pub(super) fn encode_keyframe(keyframe: &Keyframe, slot: &mut [u8]) -> Name {
    set_word(slot, 1, keyframe.id);
    let ahead = [keyframe.ahead_m.x, keyframe.ahead_m.y];
    let values = pose_values(&keyframe.pose).into_iter().chain(ahead);
    for (k, value) in values.enumerate() {
        set_word(slot, k + 2, value.to_bits());
    }
    let mut at = KEYFRAME_WORDS * 8;
    for (level, (corner, cells)) in keyframe.images().into_iter().enumerate() {
        for (k, value) in corner.iter().enumerate() {
            set_word(slot, CORNERS + 2 * level + k, *value as u64);
        }
        let cells = cells.to_slice().expect(CONTIGUOUS);
        slot[at..at + cells.len()].copy_from_slice(cells);
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
    let value = |k: usize| f64::from_bits(word(slot, k));
    keyframe.pose = pose_from([2, 3, 4, 5].map(value));
    keyframe.ahead_m = [6, 7].map(value).into();
    let mut at = KEYFRAME_WORDS * 8;
    for (level, (corner, cells)) in keyframe.images_mut().into_iter().enumerate() {
        *corner = [0, 1].map(|k| word(slot, CORNERS + 2 * level + k) as i64);
        let cells = cells.into_slice().expect(CONTIGUOUS);
        cells.copy_from_slice(&slot[at..at + cells.len()]);
        at += cells.len();
    }
    keyframe_name(slot) == Some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each word of a state is of a field that comes back.
    #[test]
    fn no_field_of_a_state_is_lost() {
        let mut words: Vec<u64> = (2..).take(TRACKER_WORDS).collect();
        let (anchors, heading, wheels, doppler) = ([4, 13], 42, 63, 84);
        for flag in anchors.into_iter().chain([heading, wheels, doppler]) {
            words[flag] = 1;
        }
        words[wheels - 1] = Verdict::Refused as u64;
        // Whether they slip.
        (words[doppler - 1], words[TRACKER_WORDS - 1]) = (1, 1);
        let (mut state, mut given) = (TrackerState::default(), words.iter());
        let found = |state: &mut TrackerState| {
            let mut found = Vec::new();
            Words(|word: &mut u64| found.push(*word)).tracker(state);
            found
        };
        assert_eq!(found(&mut state)[heading..], [0; 63], "they are not there");
        Words(|word: &mut u64| *word = given.next().copied().unwrap_or_default())
            .tracker(&mut state);
        assert_eq!(found(&mut state), words);
    }
}
