//! Messages as bytes.

use gyre_colossus::{
    Azimuth, Configuration, HealthStatus, Message, Powers, Reading, Request, decode, write_azimuth,
    write_configuration, write_keep_alive, write_other, write_request,
};
use proptest::prelude::*;

use crate::support::configuration;

pub fn write(message: &Message<'_>, out: &mut Vec<u8>) {
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
pub fn any_message() -> impl Strategy<Value = Message<'static>> {
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

proptest! {
    #[test]
    fn what_is_written_is_decoded(message in any_message()) {
        let mut bytes = Vec::new();
        write(&message, &mut bytes);
        prop_assert_eq!(decode(bytes[17], &bytes[22..]), Ok(message));
    }
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
