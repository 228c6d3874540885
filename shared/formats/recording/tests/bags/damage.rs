//! Bags that lack required parts, and bags of several files without a description.

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
    assert_is(&dataset.scan(0).unwrap(), 1);
}

#[test]
fn damaged_messages_are_scans_that_cannot_be_read() {
    let mut messages = b_scans(5);
    messages.0[3].4.truncate(100);
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&messages));
    assert_eq!(dataset.len(), 5);
    let error = dataset.scan(2).unwrap_err().to_string();
    assert!(error.starts_with("the message of scan 2 in "), "{error}");
    for turn in [0, 1, 3, 4] {
        assert_is(&dataset.scan(turn).unwrap(), turn);
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
            assert_is(&dataset.scan(6).unwrap(), 7);
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

/// Writes messages into files of these names, `share` messages each.
fn parts(folder: &Path, names: &[&str], mut messages: Messages, share: usize, chunks: bool) {
    fs::create_dir_all(folder).unwrap();
    for name in names {
        let rest = messages.0.split_off(messages.0.len().min(share));
        messages.write(&folder.join(name), uncompressed().use_chunks(chunks));
        messages = Messages(rest);
    }
    assert!(messages.0.is_empty());
}

#[test]
fn files_are_in_the_order_of_their_times_whatever_their_names_are() {
    let numbered: Vec<String> = (0..12).map(|part| format!("part-{part}.mcap")).collect();
    let numbered: Vec<&str> = numbered.iter().map(String::as_str).collect();
    for (names, has_chunks) in [
        (&numbered[..], true),
        (&["z.mcap", "m_10.mcap", "m_2.mcap", "a.mcap"], true),
        (&["b.mcap", "a.mcap"], false),
    ] {
        let folder = Folder::new();
        let bag = folder.path("drive");
        let messages = azimuths(12, |_, _, message| Some(message));
        let share = messages.0.len().div_ceil(names.len());
        parts(&bag, names, messages, share, has_chunks);
        let mut dataset = opened(&bag);
        assert_eq!(dataset.files().len(), names.len());
        assert_has_turns(dataset.as_mut(), 12);
        assert_eq!(dataset.file(0), bag.join(names[0]));
    }
}

#[test]
fn files_of_the_same_time_are_refused() {
    let folder = Folder::new();
    b_scans(9).write(&folder.path("one.mcap"), uncompressed());
    b_scans(8).write(&folder.path("other.mcap"), uncompressed());
    let sentence = refused(folder.0.path());
    for words in [
        "files of the same time",
        "one.mcap",
        "other.mcap",
        "name one file",
    ] {
        assert!(sentence.contains(words), "{sentence}");
    }
    assert_has_turns(opened(&folder.path("other.mcap")).as_mut(), 8);
}

#[test]
fn messages_are_read_in_the_order_of_their_times_and_turns_once() {
    let exchange = |messages: &mut Messages| {
        let pairs = messages.0.chunks_exact_mut(2).step_by(5);
        pairs.for_each(|pair| pair.swap(0, 1));
    };
    let reverse = |messages: &mut Messages| messages.0[1..].reverse();
    let repeat = |messages: &mut Messages| {
        let all = std::mem::take(&mut messages.0).into_iter();
        messages.0 = all.flat_map(|message| [message.clone(), message]).collect();
    };
    let edits: [&dyn Fn(&mut Messages); 3] = [&exchange, &reverse, &repeat];
    for (number, edit) in edits.iter().enumerate() {
        for mut messages in [b_scans(12), azimuths(12, |_, _, message| Some(message))] {
            edit(&mut messages);
            for options in [uncompressed().chunk_size(Some(4000)), uncompressed()] {
                let folder = Folder::new();
                let path = folder.path("bag.mcap");
                messages.write(&path, options);
                let mut dataset = opened(&path);
                assert_has_turns(dataset.as_mut(), 12);
                let notes = dataset.notes().join(" ");
                assert_eq!(notes.contains("left out"), number == 2, "{notes}");
            }
        }
    }
}
