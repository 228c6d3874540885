//! Tests of the messages that can be sent.

use std::{sync::Arc, time::Duration};

use gyre_contract::{Item, MotionHeader, PoseHeader, flag};
use gyre_journal::Journal;

use super::add;
use crate::replay_buffer::{
    LogBuffer, MemoryBuffer, Message, MotionBuffer, Next, Place, ReplayBuffer,
};

fn message(seq: u64) -> Message {
    Message {
        seq,
        generation: 0,
        bytes: bytemuck::bytes_of(&Item::numbered(seq)).into(),
    }
}

/// Returns the first message from `seq` on, whatever its generation.
fn next_of(buffer: &dyn ReplayBuffer, seq: u64) -> Next {
    let place = Place {
        seq,
        generation: None,
    };
    buffer.next(place, Duration::ZERO).unwrap()
}

#[test]
fn a_memory_buffer_keeps_the_newest_messages() {
    let buffer = MemoryBuffer::of(3);
    (0..5).for_each(|seq| add(&buffer, seq));
    let next = |seq| next_of(&buffer, seq);
    assert_eq!(next(0), Next::Message(message(2)));
    assert_eq!(next(4), Next::Message(message(4)));
    assert_eq!(next(5), Next::Nothing);
    buffer.end().unwrap();
    assert_eq!(next(5), Next::Ended);
    let bytes = message(0).bytes.len();
    let buffer = MemoryBuffer::bounded(100, 2 * bytes);
    (0..5).for_each(|seq| add(&buffer, seq));
    assert_eq!(next_of(&buffer, 0), Next::Message(message(3)));
}

#[test]
fn poses_and_their_motions_are_sent_from_the_journal_whenever_they_are_asked_for() {
    let out = tempfile::tempdir().unwrap();
    let mut journal = Journal::open(out.path()).unwrap();
    let pose = |seq| PoseHeader {
        item: Item::numbered(seq),
        x_m: seq as f64,
        ..PoseHeader::default()
    };
    (0..40).for_each(|seq| journal.append(&pose(seq)).unwrap());
    let poses = Arc::new(LogBuffer::of_poses(out.path()));
    let motions = MotionBuffer(poses.clone());
    let next = next_of;
    // Journalled before it is published, a pose is not sent before.
    assert_eq!(next(&*poses, 0), Next::Nothing);
    poses.set_published(30);
    let sent = |seq| {
        let bytes: Arc<[u8]> = bytemuck::bytes_of(&pose(seq)).into();
        Next::Message(Message {
            seq,
            generation: 0,
            bytes,
        })
    };
    assert_eq!((next(&*poses, 0), next(&*poses, 29)), (sent(0), sent(29)));
    assert_eq!(next(&*poses, 30), Next::Nothing);
    let Next::Message(motion) = next(&motions, 7) else {
        panic!("there is no motion");
    };
    let found = (motion.seq, motion.bytes.len());
    assert_eq!(found, (7, size_of::<MotionHeader>()));
    let end = PoseHeader {
        item: Item::numbered(40).flagged(flag::END),
        ..PoseHeader::default()
    };
    journal.append(&end).unwrap();
    poses.end().unwrap();
    assert_eq!(next(&*poses, 39), sent(39));
    let both = [next(&*poses, 40), next(&motions, 40)];
    assert_eq!(both, [Next::Ended, Next::Ended]);
}
