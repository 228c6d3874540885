//! The content of the slots of a checkpoint: a checksum, then a structure in the format of
//! postcard, then zeros; in the slot of a keyframe the cells of its images follow.

use gyre_geometry::{Pose, samples::Witness};
use gyre_matching::{Keyframe, TrackerState};
use gyre_storage::{is_sealed, seal};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// Bytes of a checksum, of the filter of a kind of sensor, of a state without the names of its
/// keyframes, of a name, and of a keyframe without its cells: at most.
const CHECK: usize = 8;
const FILTER: usize = 264;
const STATE: usize = 440 + FILTER * Witness::ALL.len();
const NAME: usize = 20;
const HEAD: usize = 104;
const FITS: &str = "a slot has room for the longest content";
const CONTIGUOUS: &str = "the rows of an image follow each other";
/// The checksum of an empty slot. No content has it.
pub(super) const EMPTY: [u8; CHECK] = [0; CHECK];

/// The name of a keyframe's content: two keyframes of one scan can differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) struct Name {
    pub id: u64,
    pub check: u64,
}

#[derive(Serialize, Deserialize)]
pub(super) struct State<Names> {
    pub item: u64,
    /// The checksum of the motion that it led to.
    pub motion: u64,
    pub tracker: TrackerState,
    /// Oldest first.
    pub keyframes: Names,
}

#[derive(Serialize, Deserialize)]
struct Head {
    id: u64,
    pose: Pose,
    ahead_m: Vector2<f64>,
    corners: [[i64; 2]; 2],
}

/// Returns the bytes of the slot of a state with at most so many keyframes.
pub(super) const fn state_bytes(max_keyframes: usize) -> usize {
    CHECK + STATE + NAME * max_keyframes
}

/// Returns the bytes of the slot of a keyframe whose images have so many cells.
pub(super) const fn keyframe_bytes(cells: usize) -> usize {
    CHECK + HEAD + cells
}

fn put(content: &impl Serialize, bytes: &mut [u8]) {
    let used = postcard::to_slice(content, bytes).expect(FITS).len();
    bytes[used..].fill(0);
}

/// Decodes the content of a slot; `None` if its checksum is wrong.
fn take<'a, T: Deserialize<'a>>(slot: &'a [u8]) -> Option<T> {
    let (_, content) = slot.split_at_checked(CHECK)?;
    let whole = is_sealed(slot);
    whole.then(|| postcard::from_bytes(content).ok()).flatten()
}

pub(super) fn encode_state(state: &State<&[Name]>, slot: &mut [u8]) {
    put(state, &mut slot[CHECK..]);
    seal(slot);
}

pub(super) fn decode_state(slot: &[u8]) -> Option<State<Vec<Name>>> {
    take(slot)
}

/// Fills the slot of a keyframe, and returns the name of its content.
pub(super) fn encode_keyframe(keyframe: &Keyframe, slot: &mut [u8]) -> Name {
    let images = keyframe.images();
    let head = Head {
        id: keyframe.id,
        pose: keyframe.pose,
        ahead_m: keyframe.ahead_m,
        corners: images.each_ref().map(|(corner, _)| *corner),
    };
    let (start, mut rest) = slot.split_at_mut(CHECK + HEAD);
    put(&head, &mut start[CHECK..]);
    for (_, cells) in images {
        let cells = cells.to_slice().expect(CONTIGUOUS);
        let (place, behind) = rest.split_at_mut(cells.len());
        place.copy_from_slice(cells);
        rest = behind;
    }
    seal(slot);
    name(keyframe.id, slot)
}

fn name(id: u64, slot: &[u8]) -> Name {
    let check = slot
        .first_chunk()
        .map_or(0, |check| u64::from_le_bytes(*check));
    Name { id, check }
}

/// Returns the name of the keyframe in a slot; `None` if its checksum is wrong.
pub(super) fn keyframe_name(slot: &[u8]) -> Option<Name> {
    let head: Head = take(slot)?;
    Some(name(head.id, slot))
}

/// Decodes the keyframe of this name; false if the slot has a different one.
pub(super) fn decode_keyframe(slot: &[u8], expected: Name, keyframe: &mut Keyframe) -> bool {
    let head: Option<Head> = take(slot);
    let Some(head) = head.filter(|head| name(head.id, slot) == expected) else {
        return false;
    };
    (keyframe.id, keyframe.pose, keyframe.ahead_m) = (head.id, head.pose, head.ahead_m);
    let mut rest = &slot[CHECK + HEAD..];
    for ((corner, cells), found) in keyframe.images_mut().into_iter().zip(head.corners) {
        *corner = found;
        let cells = cells.into_slice().expect(CONTIGUOUS);
        let (content, behind) = rest.split_at(cells.len());
        cells.copy_from_slice(content);
        rest = behind;
    }
    true
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_geometry::Twist;
    use gyre_matching::{Anchor, Filter, Verdict};
    use nalgebra::{Complex, Matrix3, Matrix5, UnitComplex};

    use super::*;

    /// A pose whose rotation would change if it were normalized.
    fn pose() -> Pose {
        let rotation = UnitComplex::new_unchecked(Complex::new(0.6, 0.8 + 1e-15));
        Pose::from_parts([0.1, -0.2].into(), rotation)
    }

    /// The longest state: all numbers are large, and all that is optional is there.
    fn state() -> TrackerState {
        let anchor = Anchor {
            pose: pose(),
            twist: Twist {
                vx_mps: 3.0,
                vy_mps: 0.1 + 0.2,
                yaw_rate_radps: f64::MIN_POSITIVE,
            },
            age_s: 0.25,
        };
        let filter = Filter {
            covariance: Matrix5::from_element(-0.3),
            verdict: Verdict::Refused,
            refusals: u32::MAX,
            ..Filter::default()
        };
        let mut state = TrackerState {
            pose: pose(),
            anchors: [Some(anchor); 2],
            doubtful: u32::MAX,
            unmatched: u32::MAX,
            along_walls: u32::MAX,
            sliding: u32::MAX,
            filters: [Some(filter); Witness::ALL.len()],
            ..TrackerState::default()
        };
        state.since_match.covariance = Matrix3::from_element(-0.3);
        (state.standstill.scans, state.standstill.jitter_scans) = (u32::MAX, u32::MAX);
        state
    }

    #[test]
    fn the_longest_state_comes_back_bit_for_bit() {
        let last = Name {
            id: u64::MAX,
            check: u64::MAX,
        };
        let mut slot = vec![7; state_bytes(3)];
        let (item, motion) = (u64::MAX, u64::MAX);
        for (tracker, names) in [(state(), 3), (TrackerState::default(), 0)] {
            let keyframes = &[last; 3][..names];
            let state = State {
                item,
                motion,
                tracker,
                keyframes,
            };
            encode_state(&state, &mut slot);
            let found = decode_state(&slot).unwrap();
            assert_eq!((found.item, found.motion), (item, motion));
            assert_eq!(found.keyframes, keyframes);
            // All digits are printed.
            assert_eq!(format!("{:?}", found.tracker), format!("{tracker:?}"));
            slot[9] ^= 1;
            assert!(decode_state(&slot).is_none());
        }
    }

    #[test]
    fn the_longest_head_of_a_keyframe_fits() {
        let head = Head {
            id: u64::MAX,
            pose: pose(),
            ahead_m: Vector2::new(1.0, 2.0),
            corners: [[i64::MIN; 2]; 2],
        };
        put(&head, &mut [0; HEAD]);
    }
}
