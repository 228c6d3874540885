//! The items that a reader receives when it subscribes late or the publisher restarts.

use gyre_contract::{Message, Pose, flag};

use super::{Run, WINDOW, reader, send, writer};
use crate::reader::Reader;

fn take_all(reader: &mut Reader<Pose>) -> Vec<u64> {
    let mut taken = Vec::new();
    while let Some(head) = reader.head().unwrap() {
        taken.push(head.item().seq);
        reader.advance();
    }
    taken
}

#[test]
fn a_late_reader_receives_the_history_in_order_and_each_item_once() {
    let run = Run::begin();
    let poses = writer::<Pose>(&run.manifest);
    let history = Pose::sizes(&WINDOW).history as u64;
    (0..history + 3).for_each(|seq| send(&poses, seq, 0));
    let mut late = reader(&run.manifest, None);
    assert!(
        take_all(&mut late).is_empty(),
        "a handshake is answered when the publisher reads it"
    );
    poses.accept_readers().unwrap();
    (history + 3..history + 5).for_each(|seq| send(&poses, seq, 0));
    assert_eq!(take_all(&mut late), (3..history + 5).collect::<Vec<_>>());
}

#[test]
fn a_sequence_gap_is_an_error() {
    let run = Run::begin();
    let mut reader = reader::<Pose>(&run.manifest, None);
    let poses = writer::<Pose>(&run.manifest);
    [4, 5, 7].into_iter().for_each(|seq| send(&poses, seq, 0));
    for _ in 0..2 {
        reader.head().unwrap();
        reader.advance();
    }
    let gap = reader.head().map(drop).unwrap_err().to_string();
    assert_eq!(gap, "topic `pose`: expected item 6, but got 7");
}

#[test]
fn a_restarted_publisher_repeats_items_which_are_skipped_and_counted() {
    let run = Run::begin();
    let mut reader = reader(&run.manifest, None);
    let first_process = writer::<Pose>(&run.manifest);
    (0..3).for_each(|seq| send(&first_process, seq, 0));
    assert_eq!(reader.head().unwrap().map(|head| head.item().seq), Some(0));
    drop(first_process);
    let second_process = writer::<Pose>(&run.manifest);
    (1..5).for_each(|seq| send(&second_process, seq, 0));
    assert_eq!(take_all(&mut reader), [0, 1, 2, 3, 4]);
    assert_eq!(reader.duplicates, 2);
}

#[test]
fn the_previous_item_stays_readable_unless_a_chain_starts() {
    let run = Run::begin();
    let mut reader = reader::<Pose>(&run.manifest, None);
    let poses = writer::<Pose>(&run.manifest);
    for seq in 0..100 {
        let flags = if seq % 10 == 9 { flag::BREAK } else { 0 };
        send(&poses, seq, flags);
        let head = reader.head().unwrap().map(|head| head.item().seq);
        let previous = reader.previous().map(|previous| previous.item().seq);
        let expected = seq.checked_sub(1).filter(|_| flags == 0);
        assert_eq!((head, previous), (Some(seq), expected));
        reader.advance();
    }
}

#[test]
fn the_largest_sequence_number_does_not_overflow() {
    let run = Run::begin();
    let mut reader = reader(&run.manifest, None);
    let poses = writer::<Pose>(&run.manifest);
    (0..2).for_each(|_| send(&poses, u64::MAX, flag::BREAK));
    assert_eq!(take_all(&mut reader), [u64::MAX, u64::MAX]);
}
