//! Bags that lack required parts.

use gyre_recording::file::{McapFile, Span};
use mcap::records::op;

use super::*;

#[test]
fn a_recording_that_begins_within_a_turn_begins_with_the_next() {
    let messages = azimuths(4, |turn, row, message| {
        (turn > 0 || row > 20).then_some(message)
    });
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&messages));
    assert_eq!(dataset.len(), 3);
    assert_is(&read(dataset.as_mut(), 0).unwrap(), 1);
}

#[test]
fn damaged_messages_are_scans_that_cannot_be_read() {
    let mut messages = b_scans(5);
    messages.0[3].4.truncate(100);
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&messages));
    assert_eq!(dataset.len(), 5);
    let Err(error) = read(dataset.as_mut(), 2) else {
        panic!("a damaged scan was read");
    };
    let words = "the message of scan 2 in ";
    assert!(error.to_string().starts_with(words), "{error}");
    for turn in [0, 1, 3, 4] {
        assert_is(&read(dataset.as_mut(), turn).unwrap(), turn);
    }
    let notes = dataset.notes().join(" ");
    let words = "1 messages with scans cannot be decoded, and are skipped (the first: ";
    assert!(notes.contains(words), "{notes}");
}

/// Returns the place of the chunk with this number.
fn chunk(path: &Path, number: usize) -> Span {
    let mut file = McapFile::open(path).unwrap();
    let mut records = std::iter::from_fn(|| file.next_record().unwrap());
    let mut chunks = records.by_ref().filter(|(opcode, _)| *opcode == op::CHUNK);
    chunks.nth(number).unwrap().1
}

#[test]
fn whatever_is_damaged_of_a_chunk_it_alone_is_left_out_and_named() {
    let folder = Folder::new();
    let path = folder.path("bag.mcap");
    for options in [uncompressed(), WriteOptions::new()] {
        b_scans(8).write(&path, options.chunk_size(Some(2000)));
        let whole = fs::read(&path).unwrap();
        assert_eq!(opened(&path).damage(), None);
        let Span { offset, bytes } = chunk(&path, 4);
        let (at, end) = (offset as usize, (offset + bytes) as usize);
        // Its opcode, the eight bytes of its length, and its content.
        let flips = (0..72).chain([800 * 8]).map(|bit| {
            let mut edited = whole.clone();
            edited[at + bit / 8] ^= 1 << (bit % 8);
            edited
        });
        let lengthened = [at + 1, at + 5, end - 9].map(|place| {
            let (before, after) = whole.split_at(place);
            [before, &[7], after].concat()
        });
        let shortened = [at, at + 3].map(|place| [&whole[..place], &whole[place + 1..]].concat());
        for (number, edited) in flips.chain(lengthened).chain(shortened).enumerate() {
            fs::write(&path, edited).unwrap();
            let mut dataset = opened(&path);
            let damage = dataset.damage().unwrap().to_owned();
            assert!(
                damage.contains(&format!("at byte {offset}")),
                "{number}: {damage}"
            );
            assert!(dataset.notes().join(" ").contains(&damage), "{number}");
            assert_eq!(dataset.len(), 7, "{number}");
            assert_is(&read(dataset.as_mut(), 6).unwrap(), 7);
        }
        fs::write(&path, &whole[..at + 100]).unwrap();
        let mut dataset = opened(&path);
        let damage = dataset.damage().unwrap();
        assert!(
            damage.contains(&format!("no end behind byte {offset}")),
            "{damage}"
        );
        assert_has_turns(dataset.as_mut(), 4);
    }
}
