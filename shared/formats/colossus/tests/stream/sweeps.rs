//! Azimuths to scans.

use gyre_colossus::{Azimuth, ByteOrder, ClockFormat, Counters, Powers, SweepAssembler};
use gyre_datasets::{DatasetOptions, correct_eccentricity};
use gyre_geometry::{OwnedScan, Sense, scan::flag};
use proptest::prelude::*;

use crate::support::{Assembly, START_NS, assembled, configuration, turns};

/// Angle of an encoder count as the readers of recordings compute it.
fn angle(encoder: u16, encoder_size: u16) -> f32 {
    let step = std::f64::consts::TAU / f64::from(encoder_size);
    (f64::from(encoder % encoder_size) * step) as f32
}

proptest! {
    #[test]
    fn lost_azimuths_are_empty_rows_at_their_angles(
        fomo in any::<bool>(),
        first in 0_u16..9,
        lost in prop::collection::btree_set(0_usize..1200, 0..300),
    ) {
        let radar = configuration(if fomo { 5595 } else { 5600 }, 5);
        let rows = turns(&radar, first, START_NS, 4);
        // The first turn shows where turns begin, the last one that the third has ended.
        let lost = |k: &usize| (400..1200).contains(k) && lost.contains(k);
        let assembly = assembled(&radar, (0..1600).filter(|k| !lost(k)).map(|k| &rows[k]));
        prop_assert_eq!(assembly.sweeps.len(), 4);
        let total = (0..1600).filter(lost).count();
        prop_assert_eq!(assembly.counters(), Counters { sweeps: 4, missing_azimuths: total as u64, ..Counters::default() });
        for (turn, (sweep, scan)) in assembly.sweeps.iter().enumerate() {
            let indices = 400 * turn..400 * (turn + 1);
            prop_assert_eq!(sweep.missing, indices.clone().filter(lost).count());
            prop_assert_eq!(scan.geometry.azimuths, 400);
            for (row, k) in indices.enumerate() {
                let expected = angle(rows[k].encoder, radar.encoder_size);
                let apart_ns = scan.stamp_ns[row] - rows[k].stamp_ns;
                if lost(&k) {
                    prop_assert!((scan.azimuth_rad[row] - expected).abs() < 2e-3);
                    prop_assert!(apart_ns.abs() < 100_000, "{}", apart_ns);
                    prop_assert_eq!(scan.flags[row], 0);
                    prop_assert_eq!(scan.view().row(row), &[0; 5]);
                } else {
                    prop_assert_eq!(scan.azimuth_rad[row], expected);
                    prop_assert_eq!(apart_ns, 0);
                    prop_assert_eq!(scan.flags[row], flag::MEASURED);
                    prop_assert_eq!(scan.view().row(row), &rows[k].powers[..]);
                }
            }
        }
    }
}

#[test]
fn a_sweep_that_began_before_the_stream_is_discarded() {
    let radar = configuration(5600, 4);
    assert!(Assembly::new(&radar).assembler.is_first(0));
    assert!(!Assembly::new(&radar).assembler.is_first(14));
    // From the second azimuth of a turn on, and from its middle on.
    for (first, from) in [(0, 1), (13, 150)] {
        let rows = turns(&radar, first, START_NS, 3);
        let assembly = assembled(&radar, &rows[from..]);
        assert_eq!(assembly.sweeps.len(), 2);
        assert_eq!(assembly.sweeps[0].1.stamp_ns[0], rows[400].stamp_ns);
    }
}

#[test]
fn a_sweep_that_lost_its_end_is_returned_at_the_next_one_without_losing_its_first_azimuth() {
    let radar = configuration(5600, 4);
    let rows = turns(&radar, 0, START_NS, 2);
    let mut assembly = Assembly::new(&radar);
    assembly.add_rows(&rows[..390]);
    assert_eq!(assembly.sweeps.len(), 0);
    assembly.add_rows(&rows[402..403]);
    assert_eq!(assembly.sweeps.len(), 1);
    assembly.add_rows(&rows[403..]);
    let [(first, ended), (second, begun)] = &assembly.sweeps[..] else {
        panic!("{} sweeps", assembly.sweeps.len());
    };
    assert_eq!((first.missing, second.missing), (10, 2));
    assert_eq!(ended.azimuth_rad[399], angle(5586, 5600));
    assert_eq!(begun.azimuth_rad[..3], [0, 14, 28].map(|e| angle(e, 5600)));
    assert_eq!(begun.view().row(2), rows[402].powers);
    assert_eq!(begun.flags[..3], [0, 0, flag::MEASURED]);
}

#[test]
fn a_sweep_that_misses_more_than_half_is_counted_and_not_returned() {
    let radar = configuration(5600, 4);
    let rows = turns(&radar, 0, START_NS, 3);
    let assembly = assembled(&radar, rows[..599].iter().chain(&rows[800..]));
    assert_eq!(assembly.sweeps.len(), 2);
    assert_eq!(assembly.counters().incomplete_sweeps, 1);
    let assembly = assembled(&radar, rows.iter().step_by(2));
    assert_eq!(assembly.sweeps.len(), 2);
    assert_eq!(assembly.counters().missing_azimuths, 400);
}

#[test]
fn a_pause_between_sweeps_is_not_between_their_azimuths() {
    let radar = configuration(5600, 4);
    let mut rows = turns(&radar, 0, START_NS, 2);
    let later = rows[400..].iter_mut();
    later.for_each(|row| row.stamp_ns += 7_000_000_000);
    let assembly = assembled(&radar, rows[..390].iter().chain(&rows[405..]));
    let [(_, ended), (second, begun)] = &assembly.sweeps[..] else {
        panic!("{} sweeps", assembly.sweeps.len());
    };
    let near = |one: i64, other: i64| (one - other).abs() < 1_000;
    assert!(near(ended.stamp_ns[399], rows[399].stamp_ns));
    assert!(near(begun.stamp_ns[0], rows[400].stamp_ns));
    assert_eq!(second.missing, 5);
}

#[test]
fn a_sweep_whose_middle_is_of_another_turn_is_dropped() {
    let radar = configuration(5600, 4);
    let rows = turns(&radar, 0, START_NS, 5);
    let assembly = assembled(&radar, rows[..600].iter().chain(&rows[1000 + 5..]));
    assert_eq!(assembly.sweeps.len(), 3);
    assert_eq!(assembly.counters().broken_sweeps, 1);
    assert_eq!(assembly.sweeps[1].1.stamp_ns[0], rows[1200].stamp_ns);
}

#[test]
fn azimuths_that_are_too_many_repeated_or_invalid_are_dropped_and_counted() {
    let mut radar = configuration(5600, 4);
    let rows = turns(&radar, 0, START_NS, 2);
    radar.azimuth_samples = 200;
    let mut invalid = rows[0].clone();
    invalid.encoder = 5601;
    // Twice as many as configured: the scans are of the first half of each turn.
    let assembly = assembled(&radar, rows.iter().chain(&rows[799..]).chain([&invalid]));
    let expected = Counters {
        sweeps: 2,
        surplus_azimuths: 400,
        repeated_azimuths: 1,
        invalid_azimuths: 1,
        ..Counters::default()
    };
    assert_eq!(assembly.counters(), expected);
}

#[test]
fn rows_of_other_lengths_are_padded_and_cut() {
    let radar = configuration(5600, 6);
    let mut rows = turns(&radar, 0, START_NS, 1);
    rows[1].powers = vec![9; 4];
    rows[2].powers = vec![9; 8];
    rows[3].powers = vec![];
    let assembly = assembled(&radar, &rows);
    let scan = assembly.sweeps[0].1.view();
    assert_eq!(scan.row(1), [9, 9, 9, 9, 0, 0]);
    assert_eq!(scan.row(2), [9; 6]);
    assert_eq!(scan.row(3), [0; 6]);
    assert_eq!(scan.row(4), rows[4].powers);
    assert_eq!(assembly.counters().cut_rows, 1);
}

#[test]
fn the_order_of_16_bit_powers_is_found() {
    let radar = configuration(5600, 300);
    let rows = turns(&radar, 0, START_NS, 1);
    // A power that changes slowly, with noise in its lower byte.
    let power = |k: usize, bin: usize| 8000 + (bin * 20 + k) as u16 + (bin * 7919 % 251) as u16;
    for order in [ByteOrder::Little, ByteOrder::Big] {
        let mut assembly = Assembly::new(&radar);
        for (k, row) in rows.iter().enumerate() {
            let bytes = |bin| match order {
                ByteOrder::Little => power(k, bin).to_le_bytes(),
                ByteOrder::Big => power(k, bin).to_be_bytes(),
            };
            let bytes: Vec<u8> = (0..300).flat_map(bytes).collect();
            let azimuth = Azimuth {
                powers: Powers::Sixteen(&bytes),
                ..row.azimuth(ClockFormat::default())
            };
            assembly.add(&azimuth, row.stamp_ns);
        }
        let scan = assembly.sweeps[0].1.view();
        for k in 0..400 {
            let expected: Vec<u8> = (0..300).map(|bin| (power(k, bin) >> 8) as u8).collect();
            assert_eq!(scan.row(k), expected);
        }
    }
}

#[test]
fn a_scan_has_the_constants_given() {
    let radar = configuration(5600, 4);
    let constants = DatasetOptions {
        range_resolution_m: Some(0.0596),
        range_offset_m: Some(-0.31),
        doppler_s: Some(0.04),
        azimuth_eccentricity_rad: Some(-0.01),
        ..DatasetOptions::default()
    };
    let mut assembler = SweepAssembler::new(&radar, constants).unwrap();
    let mut scan = OwnedScan::with_limits(assembler.limits());
    let rows = turns(&radar, 0, START_NS, 1);
    let mut sweeps = rows.iter().filter_map(|row| {
        let azimuth = row.azimuth(ClockFormat::default());
        assembler.add(&azimuth, row.stamp_ns, &mut scan.slot())
    });
    let geometry = sweeps.next().unwrap().geometry;
    assert_eq!(geometry.range_resolution_m, 0.0596);
    assert_eq!([geometry.range_offset_m, geometry.doppler_s], [-0.31, 0.04]);
    assert_eq!(geometry.sense, Sense::Clockwise);
    let mut expected = [angle(5586, 5600)];
    correct_eccentricity(&mut expected, -0.01);
    assert_eq!(scan.azimuth_rad[399], expected[0]);
}

#[test]
fn a_configuration_out_of_bounds_is_refused() {
    // A resolution that is given replaces the radar's.
    let mut none = configuration(5600, 4);
    (none.range_resolution_m, none.bin_size) = (Some(0.0), 0);
    for (range_resolution_m, is_accepted) in [(None, false), (Some(0.05), true)] {
        let options = DatasetOptions {
            range_resolution_m,
            ..DatasetOptions::default()
        };
        assert_eq!(SweepAssembler::new(&none, options).is_ok(), is_accepted);
    }
}
