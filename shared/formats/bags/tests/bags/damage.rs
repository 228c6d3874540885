//! Bags that lack a part of what they should have.

use super::*;

#[test]
fn lost_azimuths_are_empty_and_counted() {
    let messages = azimuths(4, |turn, row, message| {
        (turn != 1 || !(10..15).contains(&row)).then_some(message)
    });
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&messages));
    assert_eq!(dataset.len(), 4);
    let scan = read(dataset.as_mut(), 1).unwrap();
    assert!((10..15).all(|row| scan.flags[row] & flag::MEASURED == 0));
    assert!(
        scan.bytes[10 * BINS..15 * BINS]
            .iter()
            .all(|power| *power == 0)
    );
    let notes = dataset.notes().join(" ");
    assert!(notes.contains("5 azimuths are missing"), "{notes}");
    assert_is(&read(dataset.as_mut(), 2).unwrap(), 2);
}

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
    assert!(
        matches!(error, ReadError::Message { index: 2, .. }),
        "{error}"
    );
    for turn in [0, 1, 3, 4] {
        assert_is(&read(dataset.as_mut(), turn).unwrap(), turn);
    }
    let notes = dataset.notes().join(" ");
    assert!(
        notes.contains("1 messages with scans cannot be decoded"),
        "{notes}"
    );
}

#[test]
fn a_damaged_chunk_is_left_out_with_a_note() {
    let folder = Folder::new();
    let path = folder.path("bag.mcap");
    b_scans(8).write(&path, uncompressed().chunk_size(Some(2000)));
    let mut bytes = fs::read(&path).unwrap();
    let place = scan(4).bytes;
    let at = bytes
        .windows(place.len())
        .position(|window| window == place)
        .unwrap();
    bytes[at + 100] ^= 1;
    fs::write(&path, bytes).unwrap();
    let mut dataset = opened(&path);
    assert_eq!(dataset.len(), 7);
    let notes = dataset.notes().join(" ");
    assert!(notes.contains("1 damaged parts"), "{notes}");
    assert_is(&read(dataset.as_mut(), 4).unwrap(), 5);
}

#[test]
fn a_bag_that_was_cut_has_the_scans_before_that() {
    let folder = Folder::new();
    let path = folder.path("bag.mcap");
    b_scans(8).write(&path, uncompressed().chunk_size(Some(2000)));
    let bytes = fs::read(&path).unwrap();
    let place = scan(6).bytes;
    let at = bytes
        .windows(place.len())
        .position(|window| window == place)
        .unwrap();
    fs::write(&path, &bytes[..at]).unwrap();
    let mut dataset = opened(&path);
    assert_has_turns(dataset.as_mut(), 6);
    assert!(
        dataset
            .notes()
            .iter()
            .any(|note| note.contains("has no end"))
    );
}
