//! A recording that is served: every scan comes back as it was.

use gyre_colossus::{
    ClockFormat, Configuration, Event, Message, Parser, RadarClock, write_azimuth,
    write_configuration, write_keep_alive,
};
use gyre_datasets::middle_ns;

use crate::support::{Assembly, START_NS, SentAzimuth, configuration, feed, turns};

/// Sends rows as a radar does, and returns the scans that a client receives.
fn served(
    radar: &Configuration,
    rows: &[SentAzimuth],
    format: ClockFormat,
    piece: usize,
) -> Assembly {
    let mut bytes = Vec::new();
    write_configuration(&mut bytes, radar);
    for (k, row) in rows.iter().enumerate() {
        write_azimuth(&mut bytes, &row.azimuth(format));
        if k % 100 == 50 {
            write_keep_alive(&mut bytes);
        }
    }
    let mut client: Option<(RadarClock, Assembly)> = None;
    feed(&mut Parser::new(), &bytes, piece, |event| match event {
        Event::Message(Message::Configuration(configuration)) => {
            assert_eq!(configuration, *radar);
            let clock = RadarClock::new(&configuration);
            client = Some((clock, Assembly::new(&configuration)));
        }
        Event::Message(Message::Azimuth(azimuth)) => {
            let (clock, assembly) = client.as_mut().unwrap();
            for (azimuth, stamp_ns) in clock.stamp(azimuth, START_NS + 1_000_000_000) {
                assembly.add(&azimuth, stamp_ns);
            }
        }
        Event::Message(Message::KeepAlive) => {}
        other => panic!("{other:?}"),
    });
    client.unwrap().1
}

#[test]
fn every_scan_of_a_recording_comes_back_identical() {
    for (encoder_size, first) in [(5600, 0), (5600, 13), (5595, 0), (5595, 8)] {
        for start_ns in [
            START_NS,
            1_547_131_046_000_000_009,
            1_547_131_046_999_900_000,
        ] {
            let radar = configuration(encoder_size, 50);
            let mut rows = turns(&radar, first, start_ns, 4);
            // The recording has a gap.
            let later = rows[800..].iter_mut();
            later.for_each(|row| row.stamp_ns += 1_997_738_586);
            let assembly = served(&radar, &rows, ClockFormat::default(), 1400);
            assert_eq!(assembly.sweeps.len(), 4);
            for ((sweep, scan), rows) in assembly.sweeps.iter().zip(rows.chunks(400)) {
                assert_eq!(sweep.missing, 0);
                let scan_ns = middle_ns(rows[0].stamp_ns, rows[399].stamp_ns);
                assert_eq!(scan.geometry.stamp_ns, scan_ns);
                for (k, row) in rows.iter().enumerate() {
                    let step = std::f64::consts::TAU / f64::from(encoder_size);
                    let angle = (f64::from(row.encoder % encoder_size) * step) as f32;
                    assert_eq!(scan.azimuth_rad[k].to_bits(), angle.to_bits());
                    assert_eq!(scan.stamp_ns[k], row.stamp_ns);
                    assert_eq!(scan.view().row(k), row.powers);
                }
            }
        }
    }
}
