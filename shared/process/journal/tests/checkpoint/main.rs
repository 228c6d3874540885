//! A run resumes from its published items bit for bit after the death of the process or damage to
//! the newest slots.
#![allow(clippy::unwrap_used)]

mod processes;

use std::{fs, path::Path};

use gyre_contract::{Item, MotionEstimate, PoseHeader};
use gyre_geometry::{SparsePoint, samples::SensorConfigs};
use gyre_journal::checkpoint::{self, Checkpoint};
use gyre_matching::{Keyframe, RefinementConfig, Refiner, Searched};
use gyre_storage::LogError;
use nalgebra::{Isometry2, Vector2};

const WINDOW: usize = 8;
const INTERVAL_S: f64 = 0.25;
const STEP_M: f64 = 1.0;

/// A small map: a file of a few hundred kilobytes.
fn config() -> RefinementConfig {
    RefinementConfig {
        cell_m: 1.0,
        reach_m: 40.0,
        keyframes: 4,
        ..RefinementConfig::default()
    }
}

fn refinement() -> Refiner {
    Refiner::new(&config(), &SensorConfigs::default(), 512).unwrap()
}

fn open_with(path: &Path, config: &RefinementConfig, window: usize) -> Checkpoint {
    let cells = Refiner::new(config, &SensorConfigs::default(), 512)
        .unwrap()
        .keyframe_cells();
    Checkpoint::open(path, window, config.keyframes, cells).unwrap()
}

fn open(path: &Path) -> Checkpoint {
    open_with(path, &config(), WINDOW)
}

/// A scan of a drive through a random world, at one metre per scan.
fn scan(world: u64, item: u64) -> Vec<SparsePoint> {
    let spread = |k: u64, salt: u64| {
        let mixed = (k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15 ^ salt ^ world << 40);
        (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40
    };
    let share = |k: u64, salt: u64| spread(k, salt) as f64 / f64::from(1 << 24);
    let place = |k: u64| {
        [
            300.0 * share(k, 1) - 50.0 - STEP_M * item as f64,
            60.0 * share(k, 7) - 30.0,
        ]
    };
    let visible = (0..1500).map(place).filter(|[x, y]| x.hypot(*y) < 35.0);
    visible
        .map(|[x, y]| [x as f32, y as f32, 0.0, 0.7, 0.0].into())
        .take(512)
        .collect()
}

/// Refines items and writes the state after each, as the stage does, with the motion of [`pose`] by
/// a metre.
fn process(refinement: &mut Refiner, checkpoint: &mut Checkpoint, items: std::ops::Range<u64>) {
    for item in items {
        step(refinement, 1, item);
        let motion = checkpoint::checksum(&pose(item, 1.0).motion);
        checkpoint.write(item, motion, refinement).unwrap();
    }
}

fn step(refinement: &mut Refiner, world: u64, item: u64) {
    let searched = Isometry2::new(Vector2::new(STEP_M, 0.0), 0.0);
    refinement.refine(&Searched::by_radar(
        item,
        &scan(world, item),
        &scan(world, item - 1),
        &searched,
        INTERVAL_S,
    ));
}

/// The whole state of a refiner to the bit: numbers are printed with all their digits.
fn state_of(refinement: &Refiner) -> String {
    let keyframe = |it: &Keyframe| {
        let images = it.images().map(|(corner, cells)| {
            let cells: Vec<u8> = cells.iter().copied().collect();
            (corner, cells)
        });
        format!("{} {:?} {:?} {images:?}", it.id, it.pose, it.ahead_m)
    };
    let keyframes: Vec<String> = refinement.keyframes().map(keyframe).collect();
    format!("{:?} {keyframes:?}", refinement.state())
}

/// The states after the items 0, 1, ... of one process; the state is empty after item 0, where the
/// chain starts.
fn history(items: u64) -> Vec<String> {
    let mut refinement = refinement();
    let mut history = vec![state_of(&refinement)];
    for item in 1..items {
        step(&mut refinement, 1, item);
        history.push(state_of(&refinement));
    }
    history
}

/// A process that continues from the state after an item.
fn resumed(path: &Path, item: u64) -> (Refiner, Checkpoint) {
    let (mut refinement, mut checkpoint) = (refinement(), open(path));
    checkpoint.restore(item, &mut refinement).unwrap();
    (refinement, checkpoint)
}

fn restored(path: &Path, item: u64) -> Result<String, LogError> {
    let mut refinement = refinement();
    open(path)
        .restore(item, &mut refinement)
        .map(|()| state_of(&refinement))
}

/// A folder with the checkpoint of a process of this many items.
fn checkpoint_of(items: u64) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = checkpoint::path(folder.path());
    process(&mut refinement(), &mut open(&path), 1..items);
    (folder, path)
}

#[test]
fn a_truncated_file_loses_only_the_last_write() {
    let (_folder, path) = checkpoint_of(4);
    let before = fs::read(&path).unwrap();
    // Item 4 makes a keyframe, whose slot is at the file's end.
    let (mut refinement, mut checkpoint) = resumed(&path, 3);
    process(&mut refinement, &mut checkpoint, 4..6);
    drop(checkpoint);
    let after = fs::read(&path).unwrap();
    assert!(after.len() > before.len());
    let history = history(6);
    for length in [
        after.len() - 1,
        (before.len() + after.len()) / 2,
        before.len() + 1,
        before.len(),
    ] {
        fs::write(&path, &after[..length]).unwrap();
        for item in 1..4 {
            assert_eq!(
                restored(&path, item).unwrap(),
                history[item as usize],
                "item {item}, {length} bytes"
            );
        }
        let refused = restored(&path, 5).unwrap_err().to_string();
        assert!(refused.contains("before item 6:"), "{length} bytes");
    }
}

#[test]
fn corrupt_bytes_in_the_newest_slots_lose_only_those() {
    let history = history(31);
    let (_folder, path) = checkpoint_of(30);
    let before = fs::read(&path).unwrap();
    let (mut refinement, mut checkpoint) = resumed(&path, 29);
    process(&mut refinement, &mut checkpoint, 30..31);
    drop(checkpoint);
    let after = fs::read(&path).unwrap();
    let changed: Vec<usize> = (0..after.len())
        .filter(|at| before.get(*at) != Some(&after[*at]))
        .collect();
    assert!(!changed.is_empty());
    for at in changed
        .iter()
        .step_by(changed.len() / 12 + 1)
        .chain(changed.last())
    {
        let mut corrupt = after.clone();
        corrupt[*at] ^= 0x10;
        fs::write(&path, &corrupt).unwrap();
        assert!(restored(&path, 30).is_err(), "byte {at}");
        for item in 15..30 {
            assert_eq!(
                restored(&path, item).unwrap(),
                history[item as usize],
                "item {item}, byte {at}"
            );
        }
    }
}

#[test]
fn the_file_of_another_configuration_is_overwritten() {
    let (_folder, path) = checkpoint_of(20);
    let other = RefinementConfig {
        cell_m: 2.0,
        ..config()
    };
    let mut refinement = Refiner::new(&other, &SensorConfigs::default(), 512).unwrap();
    let mut checkpoint = open_with(&path, &other, WINDOW);
    assert!(checkpoint.restore(19, &mut refinement).is_err());
    process(&mut refinement, &mut checkpoint, 1..10);
    drop(checkpoint);
    let mut again = Refiner::new(&other, &SensorConfigs::default(), 512).unwrap();
    open_with(&path, &other, WINDOW)
        .restore(9, &mut again)
        .unwrap();
    assert_eq!(state_of(&again), state_of(&refinement));
    assert!(restored(&path, 9).is_err(), "and vice versa");
}

#[test]
fn another_window_continues_with_the_same_file() {
    let history = history(30);
    let (_folder, path) = checkpoint_of(30);
    for window in [2, 20, 66] {
        let mut refinement = refinement();
        open_with(&path, &config(), window)
            .restore(25, &mut refinement)
            .unwrap();
        assert_eq!(state_of(&refinement), history[25], "window {window}");
    }
}

#[test]
fn a_missing_item_is_reported_in_one_sentence() {
    let (_folder, path) = checkpoint_of(10);
    for item in [10, 1000, u64::MAX] {
        let next = item.saturating_add(1);
        let refused = restored(&path, item).unwrap_err().to_string();
        let expected = format!("the state of the refinement before item {next}: start again");
        assert!(refused.contains(&expected), "{refused}");
    }
    fs::remove_file(&path).unwrap();
    assert!(restored(&path, 5).is_err());
}

/// The pose of an item whose motion moves by so many metres.
fn pose(item: u64, x_m: f64) -> PoseHeader {
    PoseHeader {
        item: Item {
            seq: item,
            ..Item::default()
        },
        motion: MotionEstimate {
            x_m,
            ..MotionEstimate::default()
        },
        ..PoseHeader::default()
    }
}

fn newest_known(path: &Path, poses: &[PoseHeader]) -> Option<u64> {
    let mut checkpoint = open(path);
    let newest = checkpoint.newest_known(poses.iter().rev()).unwrap();
    newest.map(|pose| pose.item.seq)
}

#[test]
fn the_newest_pose_whose_whole_state_is_there_is_found() {
    let (_folder, path) = checkpoint_of(30);
    let poses: Vec<_> = (0..35).map(|item| pose(item, 1.0)).collect();
    assert_eq!(newest_known(&path, &poses[..20]), Some(19));
    assert_eq!(newest_known(&path, &poses), Some(29));
    let others: Vec<_> = (0..35).map(|item| pose(item, 2.0)).collect();
    assert_eq!(newest_known(&path, &others), None, "of other motions");
    let mixed = [&poses[..25], &others[25..]].concat();
    assert_eq!(newest_known(&path, &mixed), Some(24));
}

#[test]
fn a_state_that_lacks_a_keyframe_is_not_known_and_is_completed_when_its_item_is_repeated() {
    let history = history(31);
    let (_folder, path) = checkpoint_of(30);
    let mut bytes = fs::read(&path).unwrap();
    let end = bytes.len();
    // The slot of the newest keyframe is the last one that was added.
    bytes[end - 100..].fill(0x55);
    fs::write(&path, bytes).unwrap();
    let poses: Vec<_> = (0..30).map(|item| pose(item, 1.0)).collect();
    let known = newest_known(&path, &poses).unwrap();
    assert!((20..29).contains(&known), "{known}");
    let (mut refinement, mut checkpoint) = resumed(&path, known);
    process(&mut refinement, &mut checkpoint, known + 1..30);
    drop(checkpoint);
    assert_eq!(newest_known(&path, &poses), Some(29));
    assert_eq!(restored(&path, 29).unwrap(), history[29]);
}

/// A map can start again with a scan that is a keyframe of the map before. Killed after the first
/// of its two writes, a process must find the earlier map whole.
#[test]
fn a_keyframe_does_not_replace_another_one_of_the_same_scan() {
    let (_folder, path) = checkpoint_of(30);
    let (mut refinement, mut checkpoint) = resumed(&path, 29);
    let keyframe = refinement
        .keyframes()
        .map(|keyframe| keyframe.id)
        .max()
        .unwrap();
    checkpoint.restore(keyframe, &mut refinement).unwrap();
    let before = state_of(&refinement);
    refinement.reset();
    step(&mut refinement, 2, keyframe + 1);
    assert!(refinement.keyframes().any(|other| other.id == keyframe));
    checkpoint.write(keyframe + 1, 0, &refinement).unwrap();
    drop(checkpoint);
    assert_eq!(
        restored(&path, keyframe + 1).unwrap(),
        state_of(&refinement)
    );
    assert_eq!(restored(&path, keyframe).unwrap(), before);
}

#[test]
fn the_file_stops_growing() {
    let folder = tempfile::tempdir().unwrap();
    let path = checkpoint::path(folder.path());
    let (mut refinement, mut checkpoint) = (refinement(), open(&path));
    let mut length = |items: std::ops::Range<u64>| {
        process(&mut refinement, &mut checkpoint, items);
        fs::metadata(&path).unwrap().len()
    };
    // A keyframe every other item.
    let first = length(1..200);
    assert_eq!(first, length(200..330));
    let slots = (config().keyframes + 2 * WINDOW + 32 + 8) as u64;
    let keyframe = self::refinement().keyframe_cells() as u64 + 80;
    // The states of the longest window, each of less than two kilobytes.
    let states = (2 * 66 + 32 + 8) * 2048;
    assert!(first < states + slots * keyframe, "{first} bytes");
}
