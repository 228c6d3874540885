//! Messages as bytes; streams of them in pieces, and damaged ones.

use gyre_colossus::{
    Azimuth, Configuration, Damage, Event, HealthStatus, Message, Parser, Powers, Reading, Request,
    decode, write_azimuth, write_configuration, write_keep_alive, write_other, write_request,
};
use proptest::prelude::*;

use crate::support::{configuration, feed};

fn write(message: &Message<'_>, out: &mut Vec<u8>) {
    match message {
        Message::KeepAlive => write_keep_alive(out),
        Message::Configuration(configuration) => write_configuration(out, configuration),
        Message::Azimuth(azimuth) => write_azimuth(out, azimuth),
        Message::Request(request) => write_request(out, *request),
        Message::Other { id, payload } => write_other(out, *id, payload),
        other => panic!("{other:?} is no radar's that is played"),
    }
}

fn any_configuration() -> impl Strategy<Value = Configuration> {
    let float = || prop::num::f32::NORMAL | prop::num::f32::ZERO;
    let metres = prop::option::of(float());
    (any::<[u16; 6]>(), float(), float(), metres).prop_map(|(numbers, gain, offset, metres)| {
        Configuration {
            azimuth_samples: numbers[0],
            bin_size: numbers[1],
            range_in_bins: numbers[2],
            encoder_size: numbers[3],
            rotation_mhz: numbers[4],
            packet_rate: numbers[5],
            range_gain: gain,
            range_offset: offset,
            range_resolution_m: metres,
        }
    })
}

/// Messages with bytes that are never freed.
fn any_message() -> impl Strategy<Value = Message<'static>> {
    let bytes = || {
        let bytes = prop::collection::vec(any::<u8>(), 0..300);
        bytes.prop_map(|bytes| -> &'static [u8] { bytes.leak() })
    };
    let azimuth = (
        any::<[u16; 2]>(),
        any::<[[u8; 4]; 2]>(),
        any::<bool>(),
        bytes(),
    );
    prop_oneof![
        Just(Message::KeepAlive),
        any_configuration().prop_map(Message::Configuration),
        prop::sample::select(Request::ALL.to_vec()).prop_map(Message::Request),
        (prop::sample::select(vec![0, 50, 128, 255]), bytes())
            .prop_map(|(id, payload)| Message::Other { id, payload }),
        azimuth.prop_map(
            |([sweep_counter, encoder], [seconds, split_seconds], wide, powers)| {
                Message::Azimuth(Azimuth {
                    sweep_counter,
                    encoder,
                    seconds,
                    split_seconds,
                    powers: match wide {
                        true => Powers::Sixteen(&powers[..powers.len() / 2 * 2]),
                        false => Powers::Eight(powers),
                    },
                })
            }
        ),
    ]
}

#[test]
fn the_layout_is_that_of_the_protocol() {
    let mut bytes = Vec::new();
    let azimuth = Azimuth {
        sweep_counter: 0x0102,
        encoder: 0x0304,
        seconds: [5, 6, 7, 8],
        split_seconds: [9, 10, 11, 12],
        powers: Powers::Eight(&[13, 14]),
    };
    write_azimuth(&mut bytes, &azimuth);
    let signature = [0, 1, 3, 3, 7, 7, 15, 15, 31, 31, 63, 63, 127, 127, 254, 254];
    assert_eq!(bytes[..16], signature);
    assert_eq!(bytes[16..22], [1, 30, 0, 0, 0, 16]);
    let payload = [0, 14, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14];
    assert_eq!(bytes[22..], payload);
}

#[test]
fn powers_begin_where_the_message_says() {
    let payload = |offset: u8| [&[0, offset][..], &[1; 12], &[2, 3, 4, 5, 6]].concat();
    for (offset, id, powers) in [
        (14, 30, &[2_u8, 3, 4, 5, 6][..]),
        (17, 30, &[5, 6]),
        (17, 31, &[5, 6]),
        (19, 30, &[]),
    ] {
        match decode(id, &payload(offset)) {
            Ok(Message::Azimuth(azimuth)) => assert_eq!(azimuth.powers.bytes(), powers),
            other => panic!("{other:?}"),
        }
    }
    for (offset, id, words) in [
        (0, 30, "at byte 0 of a payload of 19 bytes, expected 14"),
        (13, 30, "begin at byte 13"),
        (20, 30, "begin at byte 20"),
        (255, 30, "begin at byte 255"),
        (14, 31, "has 5 bytes of powers, an odd number"),
    ] {
        let refused = decode(id, &payload(offset)).unwrap_err().to_string();
        assert!(refused.contains(words), "{refused}");
    }
}

#[test]
fn a_configuration_is_checked_in_one_sentence_and_prefers_the_resolution_of_its_protobuf() {
    let good = configuration(5600, 3768);
    assert_eq!(good.check(), Ok(()));
    assert_eq!(good.period_ns(), 250_000_000);
    assert_eq!(good.range_resolution_m(), 0.04381);
    for absent in [None, Some(0.0)] {
        let rounded = Configuration {
            range_resolution_m: absent,
            ..good
        };
        assert_eq!(rounded.range_resolution_m(), 0.0438);
    }
    type Edit = fn(&mut Configuration);
    let bad: [(Edit, &str); 8] = [
        (|c| c.azimuth_samples = 0, "as 0, expected 2 to 1024"),
        (|c| c.azimuth_samples = 1025, "1025, expected 2 to 1024"),
        (|c| c.range_in_bins = 0, "bins as 0, expected 1 to 65535"),
        (|c| c.encoder_size = 399, "399, expected 400 to 65535"),
        (|c| c.rotation_mhz = 0, "in mHz as 0, expected 100 to 65535"),
        (
            |c| c.range_resolution_m = Some(f32::NAN),
            "as NaN, expected 0.001 to 10",
        ),
        (
            |c| c.range_resolution_m = Some(11.0),
            "as 11, expected 0.001 to 10",
        ),
        (
            |c| (c.range_resolution_m, c.bin_size) = (None, 0),
            "as 0, expected 0.001 to 10",
        ),
    ];
    for (edit, sentence) in bad {
        let mut configuration = good;
        edit(&mut configuration);
        let error = configuration.check().unwrap_err().to_string();
        assert!(error.ends_with(sentence), "{error}");
    }
}

#[test]
fn health_has_readings_that_the_radar_judges() {
    let reading = |value: f32, status: u8| {
        let mut bytes = vec![3 << 3 | 5];
        bytes.extend(value.to_le_bytes());
        bytes.extend([5 << 3, status, 6 << 3, 12]);
        bytes
    };
    let mut payload = Vec::new();
    for (field, value, status) in [(1_u8, 41.5, 2), (14, 3.0, 0)] {
        let reading = reading(value, status);
        payload.extend([field << 3 | 2, reading.len() as u8]);
        payload.extend(reading);
    }
    payload.extend([8 << 3, 1]);
    // Minus one, in ten bytes.
    payload.push(12 << 3);
    payload.extend([0xff; 9]);
    payload.push(1);
    // Text of a field of two bytes.
    payload.extend([0x9a, 0x01, 2, b'i', b'p']);
    let Ok(Message::Health(health)) = decode(40, &payload) else {
        panic!("{:?}", decode(40, &payload));
    };
    let expected = [
        ("die temperature", 41.5, HealthStatus::Healthy),
        ("motor current", 3.0, HealthStatus::Unhealthy),
    ];
    let expected = expected.map(|(name, value, status)| (name, Reading { value, status }));
    assert_eq!(health.readings().collect::<Vec<_>>(), expected);
    assert_eq!(health.transmitting, Some(true));
    assert_eq!(health.encoder_errors, Some(-1));
    let cut = decode(40, &payload[..5]).unwrap_err().to_string();
    assert_eq!(cut, "the protobuf of health is malformed at byte 0");
}

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
