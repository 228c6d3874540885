//! What a reader is given, whenever it comes and whoever dies.

use gyre_messages::{Message, Pose, flag};

use super::{Run, WINDOW, reader, send, writer};
use crate::{StageError, reader::Reader};

/// Works through all that has come, and says which items those were.
fn take_all(reader: &mut Reader<Pose>) -> Vec<u64> {
    let mut taken = Vec::new();
    while let Some(head) = reader.head().unwrap() {
        taken.push(head.item().seq);
        reader.advance();
    }
    taken
}

#[test]
fn a_late_reader_first_gets_the_history_in_order_and_each_item_once() {
    let run = Run::new();
    let poses = writer::<Pose>(&run.manifest);
    let history = Pose::sizes(&WINDOW).history as u64;
    (0..history + 3).for_each(|seq| send(&poses, seq, 0));
    let mut late = reader(&run.manifest, None);
    assert!(
        take_all(&mut late).is_empty(),
        "a newcomer is answered when the publisher next looks"
    );
    poses.accept_readers().unwrap();
    (history + 3..history + 5).for_each(|seq| send(&poses, seq, 0));
    assert_eq!(take_all(&mut late), (3..history + 5).collect::<Vec<_>>());
}

#[test]
fn items_that_were_had_are_skipped_and_counted() {
    let run = Run::new();
    let mut restarted = reader(&run.manifest, Some(3));
    let poses = writer::<Pose>(&run.manifest);
    (1..6).for_each(|seq| send(&poses, seq, 0));
    assert_eq!(take_all(&mut restarted), [3, 4, 5]);
    assert_eq!(restarted.duplicates(), 2);
}

#[test]
fn a_missing_item_is_an_error() {
    let run = Run::new();
    let mut reader = reader::<Pose>(&run.manifest, None);
    let poses = writer::<Pose>(&run.manifest);
    [4, 5, 7].into_iter().for_each(|seq| send(&poses, seq, 0));
    reader.head().unwrap();
    reader.advance();
    reader.head().unwrap();
    reader.advance();
    let error = reader.head().map(|head| head.map(|head| head.item().seq));
    assert!(matches!(
        error,
        Err(StageError::SequenceGap {
            topic: "pose",
            expected: 6,
            got: 7
        })
    ));
}

#[test]
fn a_publishers_second_life_repeats_and_goes_on_where_the_first_one_ended() {
    let run = Run::new();
    let mut reader = reader(&run.manifest, None);
    let first_life = writer::<Pose>(&run.manifest);
    (0..3).for_each(|seq| send(&first_life, seq, 0));
    assert_eq!(reader.head().unwrap().map(|head| head.item().seq), Some(0));
    drop(first_life);
    let second_life = writer::<Pose>(&run.manifest);
    (1..5).for_each(|seq| send(&second_life, seq, 0));
    assert_eq!(take_all(&mut reader), [0, 1, 2, 3, 4]);
    assert_eq!(reader.duplicates(), 2);
}

#[test]
fn the_item_before_stays_readable_however_long_the_stream() {
    let run = Run::new();
    let mut reader = reader::<Pose>(&run.manifest, None);
    let poses = writer::<Pose>(&run.manifest);
    for seq in 0..100 {
        send(&poses, seq, 0);
        assert_eq!(
            reader.head().unwrap().map(|head| head.item().seq),
            Some(seq)
        );
        assert_eq!(
            reader.before().map(|before| before.item().seq),
            seq.checked_sub(1)
        );
        reader.advance();
    }
}

#[test]
fn where_the_chain_starts_anew_there_is_no_item_before() {
    let run = Run::new();
    let mut reader = reader::<Pose>(&run.manifest, None);
    let poses = writer::<Pose>(&run.manifest);
    send(&poses, 0, flag::BREAK);
    send(&poses, 1, flag::BREAK);
    reader.head().unwrap();
    reader.advance();
    reader.head().unwrap();
    assert!(reader.current().is_some() && reader.before().is_none());
}

#[test]
fn a_stranger_that_counts_to_the_end_of_numbers_is_survived() {
    let run = Run::new();
    let mut reader = reader(&run.manifest, None);
    let poses = writer::<Pose>(&run.manifest);
    [u64::MAX, u64::MAX]
        .into_iter()
        .for_each(|seq| send(&poses, seq, u32::MAX));
    assert_eq!(take_all(&mut reader), [u64::MAX, u64::MAX]);
}
