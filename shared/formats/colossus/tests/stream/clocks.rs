//! Radars with clocks of all kinds.

use gyre_colossus::{
    Azimuth, ByteOrder, ClockFormat, Configuration, FoundClock, Powers, RadarClock, SplitUnit,
};
use proptest::prelude::*;

use crate::support::{START_NS, configuration, stamped, turns};

const FORMATS: [ClockFormat; 4] = [
    format(ByteOrder::Little, SplitUnit::Nanoseconds),
    format(ByteOrder::Little, SplitUnit::Microseconds),
    format(ByteOrder::Big, SplitUnit::Nanoseconds),
    format(ByteOrder::Big, SplitUnit::Microseconds),
];

const fn format(order: ByteOrder, unit: SplitUnit) -> ClockFormat {
    ClockFormat { order, unit }
}

fn radar() -> Configuration {
    configuration(5600, 8)
}

/// Rounds down to the unit.
fn rounded(stamp_ns: i64, unit: SplitUnit) -> i64 {
    match unit {
        SplitUnit::Nanoseconds => stamp_ns,
        SplitUnit::Microseconds => stamp_ns - stamp_ns.rem_euclid(1000),
    }
}

proptest! {
    #[test]
    fn every_azimuth_has_its_time_in_every_format(
        index in 0_usize..4,
        second in 978_307_200_i64..4_102_444_800,
        split in prop_oneof![0_i64..1_000_000, 0_i64..1_000_000_000, 999_000_000_i64..1_000_000_000],
        first in 0_u16..14,
        lost in prop::collection::btree_set(0_usize..40, 0..20),
    ) {
        let format = FORMATS[index];
        let mut rows = turns(&radar(), first, second * 1_000_000_000 + split, 1);
        rows.truncate(60);
        for k in lost.into_iter().rev() {
            rows.remove(k);
        }
        let mut clock = RadarClock::new(&radar());
        let found = stamped(&mut clock, &rows, format);
        prop_assert_eq!(clock.found(), Some(FoundClock::Unix(format)));
        for row in &mut rows {
            row.stamp_ns = rounded(row.stamp_ns, format.unit);
        }
        prop_assert_eq!(found, rows);
    }

    #[test]
    fn a_radar_without_the_time_counts_from_the_hosts(
        index in 0_usize..4,
        uptime_ns in 0_i64..900_000_000_000_000_000,
    ) {
        let format = FORMATS[index];
        let mut rows = turns(&radar(), 0, uptime_ns, 1);
        rows.truncate(50);
        let mut clock = RadarClock::new(&radar());
        let found = stamped(&mut clock, &rows, format);
        prop_assert_eq!(clock.found(), Some(FoundClock::Uptime(format)));
        prop_assert_eq!(found.len(), rows.len());
        for (found, row) in found.iter().zip(&rows) {
            let since_first = rounded(row.stamp_ns, format.unit) - rounded(rows[0].stamp_ns, format.unit);
            prop_assert_eq!(found.stamp_ns, START_NS + 86_400_000_000_000 + since_first);
        }
    }

    #[test]
    fn any_times_give_each_azimuth_one(
        azimuths in prop::collection::vec(any::<([u8; 4], [u8; 4], u16, i64)>(), 0..80),
        numbers in any::<[u16; 3]>(),
    ) {
        let [azimuth_samples, encoder_size, rotation_mhz] = numbers;
        let mut clock = RadarClock::new(&Configuration { azimuth_samples, encoder_size, rotation_mhz, ..radar() });
        let mut count = 0;
        for (seconds, split_seconds, encoder, arrived_ns) in &azimuths {
            let azimuth = Azimuth {
                sweep_counter: 0,
                encoder: *encoder,
                seconds: *seconds,
                split_seconds: *split_seconds,
                powers: Powers::Eight(&[]),
            };
            count += clock.stamp(azimuth, *arrived_ns).count();
        }
        prop_assert_eq!(count, if clock.found().is_some() { azimuths.len() } else { 0 });
        prop_assert!(clock.found().is_some() || azimuths.len() <= 32);
    }
}

#[test]
fn a_clock_that_stands_still_gives_times_of_arrival() {
    let rows = turns(&radar(), 0, START_NS, 1);
    for still_ns in [0, 123_456_789, START_NS] {
        let mut clock = RadarClock::new(&radar());
        let mut stamps = Vec::new();
        for row in &rows {
            let mut still = row.clone();
            still.stamp_ns = still_ns;
            let azimuth = still.azimuth(ClockFormat::default());
            stamps.extend(clock.stamp(azimuth, row.stamp_ns).map(|(_, ns)| ns));
        }
        assert_eq!(clock.found(), Some(FoundClock::Arrival));
        assert!(stamps.into_iter().eq(rows.iter().map(|row| row.stamp_ns)));
    }
}

#[test]
fn stamps_that_come_in_bursts_are_understood() {
    let rows = turns(&radar(), 0, START_NS, 1);
    for (burst, format) in [2, 8, 16].into_iter().flat_map(|b| FORMATS.map(|f| (b, f))) {
        let mut bursts = rows.clone();
        for (k, row) in bursts.iter_mut().enumerate() {
            let of_burst = (k + 3) / burst * burst;
            row.stamp_ns = START_NS + of_burst as i64 * 625_000;
        }
        let mut clock = RadarClock::new(&radar());
        let found = stamped(&mut clock, &bursts, format);
        assert_eq!(clock.found(), Some(FoundClock::Unix(format)), "{burst}");
        assert_eq!(found.len(), rows.len());
    }
}

#[test]
fn a_radar_that_learns_the_time_is_offset_no_more() {
    let mut rows = turns(&radar(), 0, 5_000_000_000, 1);
    let later = rows[200..].iter_mut();
    later.for_each(|row| row.stamp_ns += START_NS);
    let mut clock = RadarClock::new(&radar());
    let found = stamped(&mut clock, &rows, ClockFormat::default());
    assert_eq!(found[200..], rows[200..]);
    let unix = FoundClock::Unix(ClockFormat::default());
    assert_eq!(clock.found(), Some(unix));
    let expected = "The radar sends its time as little-endian seconds and nanoseconds.";
    assert_eq!(unix.to_string(), expected);
}
