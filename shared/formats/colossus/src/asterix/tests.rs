use super::*;
use crate::{
    asterix::{MAX_DATAGRAM_BYTES, write_azimuth, write_description},
    clock::{ByteOrder, ClockFormat},
};

const ENCODER: u16 = 5600;
const BINS: u16 = 3000;

fn radar() -> Configuration {
    Configuration::usual(400, BINS)
}

/// The datagrams of an azimuth whose powers begin with its row.
fn datagrams(row: u16, number: &mut u32, bins: u16) -> Vec<Vec<u8>> {
    let power = |bin: u16| (bin.wrapping_mul(31) ^ row) as u8;
    let powers: Vec<u8> = (0..bins).map(power).collect();
    let format = ClockFormat {
        order: ByteOrder::Big,
        ..ClockFormat::default()
    };
    let stamp_ns = 1_700_000_000_000_000_000 + i64::from(row) * 625_000;
    let azimuth = Azimuth::at(row * 14, stamp_ns, format, &powers);
    let mut sent = Vec::new();
    let mut send = |bytes: &[u8]| sent.push(bytes.to_vec());
    write_azimuth(&radar(), &azimuth, number, &mut send);
    sent
}

/// The datagrams of the first azimuths of a turn.
fn turn(azimuths: u16, mut number: u32, bins: u16) -> Vec<Vec<u8>> {
    let rows = (0..azimuths).map(|row| datagrams(row, &mut number, bins));
    rows.flatten().collect()
}

/// The encoder counts and first powers of the azimuths that a parser finds.
fn received(parser: &mut Datagrams, sent: &[Vec<u8>]) -> Vec<u16> {
    let mut azimuths = Vec::new();
    for datagram in sent {
        parser.space()[..datagram.len()].copy_from_slice(datagram);
        parser.filled(datagram.len());
        while let Some(event) = parser.next() {
            match event {
                Event::Message(Message::Azimuth(azimuth)) => {
                    let row = azimuth.encoder / 14;
                    assert_eq!(azimuth.powers.bytes()[0], row as u8);
                    azimuths.push(row);
                }
                Event::Message(Message::Configuration(found)) => assert_eq!(found, radar()),
                other => panic!("{other:?}"),
            }
        }
    }
    azimuths
}

#[test]
fn azimuths_are_put_together_from_their_datagrams() {
    let sent = turn(400, u32::MAX - 2, BINS);
    // 3000 bins do not fit into two datagrams.
    assert_eq!(sent.len(), 400 * 3);
    assert!(sent.iter().all(|sent| sent.len() <= MAX_DATAGRAM_BYTES));
    let mut parser = Datagrams::new(ENCODER);
    assert!(received(&mut parser, &sent).into_iter().eq(0..400));
}

#[test]
fn order_and_doubles_within_an_azimuth_do_not_matter_and_a_missing_part_loses_it() {
    let mut sent = turn(4, 7, BINS);
    sent.swap(0, 2);
    sent.insert(4, sent[3].clone());
    let late = sent.remove(8);
    assert_eq!(sent.len(), 12);
    sent.push(late);
    let mut parser = Datagrams::new(ENCODER);
    assert_eq!(received(&mut parser, &sent), [0, 1, 3]);
}

#[test]
fn an_azimuth_of_fewer_bins_than_the_radar_says_ends_with_the_next_one() {
    let mut sent = turn(3, 0, 2000);
    let mut parser = Datagrams::new(ENCODER);
    assert_eq!(received(&mut parser, &sent), [0, 1]);
    sent.remove(1);
    assert_eq!(received(&mut Datagrams::new(ENCODER), &sent), [1]);
}

#[test]
fn a_radar_that_is_started_anew_is_received() {
    let mut parser = Datagrams::new(ENCODER);
    for (row, mut number) in [(0, 1_000_000), (1, 0)] {
        let sent = datagrams(row, &mut number, BINS);
        assert_eq!(received(&mut parser, &sent), [row]);
    }
}

#[test]
fn a_description_comes_without_powers() {
    let mut sent = Vec::new();
    write_description(&mut sent, &radar(), 5);
    assert!(received(&mut Datagrams::new(ENCODER), &[sent]).is_empty());
}

#[test]
fn what_is_no_azimuth_is_named() {
    let mut number = 0;
    let whole = datagrams(1, &mut number, BINS).remove(0);
    let edited = |at: usize, byte: u8| {
        let mut datagram = whole.clone();
        datagram[at] = byte;
        datagram
    };
    let cases = [
        (
            vec![2, 40, 0, 0, 0, 0, 0, 0],
            "message 40 by UDP carries no powers",
        ),
        (vec![240], "ends within its item length"),
        (edited(0, 48), "begins with 48"),
        (whole[..100].to_vec(), "in a datagram of 100"),
        (edited(4, 0b1010_1000), "lacks the item SP"),
        (edited(25, 1), "resolution 1"),
        (edited(24, 0x80), "compressed: true"),
        (edited(16, 0xff), "of 3000 bins"),
    ];
    for (datagram, expected) in cases {
        let mut parser = Datagrams::new(ENCODER);
        parser.space()[..datagram.len()].copy_from_slice(&datagram);
        parser.filled(datagram.len());
        match parser.next() {
            Some(Event::Damaged { reason, .. }) => {
                let said = reason.to_string();
                assert!(said.contains(expected), "{said}, not {expected}");
            }
            other => panic!("{other:?}, not {expected}"),
        }
    }
}

#[test]
fn every_encoder_count_survives_the_angle() {
    for size in [400, 5595, 5600, 32_768] {
        for count in 0..size {
            let angle = (f64::from(count) / f64::from(size) * super::super::ANGLES) as u16;
            assert_eq!(super::super::encoder(angle, size), count);
        }
    }
}
