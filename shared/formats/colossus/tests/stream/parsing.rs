//! Streams in pieces, and damaged ones.

use gyre_colossus::{Damage, Event, Message, Parser};
use proptest::prelude::*;

use crate::messages::{any_message, write};
use crate::support::feed;

fn stream(messages: &[Message<'_>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    messages.iter().for_each(|sent| write(sent, &mut bytes));
    bytes
}

fn other(payload: &[u8]) -> Message<'_> {
    Message::Other { id: 41, payload }
}

/// Returns all events as texts, so that they outlive the parser.
fn events(bytes: &[u8], piece: usize) -> Vec<String> {
    let mut events = Vec::new();
    feed(&mut Parser::new(), bytes, piece, |event| {
        events.push(format!("{event:?}"));
    });
    events
}

fn texts(messages: &[Message<'_>]) -> Vec<String> {
    let message = |sent: &Message<'_>| format!("{:?}", Event::Message(*sent));
    messages.iter().map(message).collect()
}

/// Bytes that are no message: noise, beginnings of messages, messages with one byte changed.
fn garbage() -> impl Strategy<Value = Vec<u8>> {
    let written = || any_message().prop_map(|sent| stream(&[sent]));
    prop_oneof![
        prop::collection::vec(any::<u8>(), 1..100),
        (written(), any::<prop::sample::Index>()).prop_map(|(mut bytes, at)| {
            bytes.truncate(1 + at.index(bytes.len() - 1));
            bytes
        }),
        // Signature and version.
        (written(), 0_usize..17, 1_u8..).prop_map(|(mut bytes, at, change)| {
            bytes[at] ^= change;
            bytes
        }),
        // A size of more than 1 MiB.
        (written(), 0x11_u8..).prop_map(|(mut bytes, high)| {
            bytes[19] = high;
            bytes
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_pieces_give_the_same_messages(
        messages in prop::collection::vec(any_message(), 0..20),
        piece in 1_usize..2000,
    ) {
        let bytes = stream(&messages);
        prop_assert_eq!(events(&bytes, piece), texts(&messages));
        prop_assert_eq!(events(&bytes, 1), texts(&messages));
    }

    #[test]
    fn all_whole_messages_after_garbage_are_found(
        parts in prop::collection::vec((garbage(), prop::collection::vec(any_message(), 1..4)), 1..6),
        piece in 1_usize..500,
    ) {
        let parts_count = parts.len();
        let (mut bytes, mut sent, mut damaged) = (Vec::new(), Vec::new(), 0);
        for (garbage, messages) in parts {
            bytes.extend(&garbage);
            damaged += garbage.len();
            bytes.extend(stream(&messages));
            sent.extend(messages);
        }
        // A message that is cut short is recognised once as many bytes follow.
        let end = vec![other(&[0; 70_000])];
        bytes.extend(stream(&end));
        sent.extend(end);
        let (mut found, mut skipped) = (Vec::new(), 0);
        feed(&mut Parser::new(), &bytes, piece, |event| match event {
            Event::Message(_) => found.push(format!("{event:?}")),
            Event::Damaged { skipped_bytes, .. } => skipped += skipped_bytes,
        });
        // A message that is cut short may be complete with bytes of the next one.
        let extra = found.len().saturating_sub(sent.len());
        prop_assert!(extra <= parts_count);
        let mut found = found.into_iter();
        for text in texts(&sent) {
            prop_assert!(found.any(|other| other == text), "{} is missing", text);
        }
        prop_assert!(extra > 0 || (damaged..=damaged + 16 * parts_count).contains(&skipped));
        prop_assert_eq!(events(&bytes, 1), events(&bytes, piece));
    }
}

#[test]
fn damage_is_reported_once_with_its_first_fault() {
    let message = stream(&[other(&[1, 2, 3])]);
    let edited = |at: usize, byte: u8| {
        let mut bytes = message.clone();
        bytes[at] = byte;
        [bytes, message.clone()].concat()
    };
    let first = |bytes: Vec<u8>| {
        let mut events = Vec::new();
        feed(&mut Parser::new(), &bytes, 4096, |event| {
            events.push(match event {
                Event::Damaged {
                    reason,
                    skipped_bytes,
                } => Some((reason, skipped_bytes)),
                Event::Message(_) => None,
            });
        });
        assert_eq!(events.len(), 2, "{events:?}");
        assert_eq!(events[1], None);
        events[0].clone().unwrap()
    };
    assert_eq!(first(edited(3, 9)), (Damage::Signature, 25));
    assert_eq!(first(edited(16, 2)), (Damage::Version(2), 25));
    let size = 0x2000_0003;
    assert_eq!(first(edited(18, 0x20)), (Damage::PayloadSize(size), 25));
    let long = stream(&[other(&[9; 40])]);
    let cut = [&long[..46], &message].concat();
    assert_eq!(first(cut), (Damage::CutShort, 46));
    let cut = Message::Other {
        id: 30,
        payload: &[0; 3],
    };
    let malformed = stream(&[cut, Message::KeepAlive]);
    let (reason, skipped_bytes) = first(malformed);
    assert_eq!(skipped_bytes, 25);
    let expected = "the payload of an azimuth has 3 bytes, expected at least 14";
    assert_eq!(reason.to_string(), expected);
}

#[test]
fn a_message_that_takes_the_start_of_the_next_one_costs_none() {
    let [cut, next] = [7, 8].map(|byte| stream(&[other(&[byte; 30])]));
    for lost in 1..16 {
        let bytes = [&cut[..cut.len() - lost], &next, &next].concat();
        let events = events(&bytes, 1 + lost);
        assert_eq!(events.len(), 4, "{events:?}");
        assert_eq!(events[1], "Damaged { reason: CutShort, skipped_bytes: 0 }");
        let whole = texts(&[other(&[8; 30])]);
        assert_eq!(events[2..], [&whole[..], &whole].concat());
    }
}
