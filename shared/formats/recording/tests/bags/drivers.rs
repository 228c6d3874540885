//! Bags of drivers and converters that write otherwise than Gyre, and of encoders of other sizes.

use gyre_ros2_messages::messages::RadarConfigurationMessage;

use super::*;

/// Replaces the configuration of a bag by the configuration of a driver before 2024.
fn with_older_configuration(mut messages: Messages, bin_size: f64) -> Messages {
    let older = RadarConfigurationMessage {
        azimuth_samples: (AZIMUTHS as u16).to_be_bytes().to_vec(),
        encoder_size: 5600_u16.to_be_bytes().to_vec(),
        bin_size: bin_size.to_le_bytes().to_vec(),
        range_in_bins: (BINS as u16).to_be_bytes().to_vec(),
        expected_rotation_rate: 4_u16.to_be_bytes().to_vec(),
        ..RadarConfigurationMessage::default()
    };
    let mut all = Messages::default();
    all.add(CONFIGURATION, START_NS, &older);
    all.0.extend(messages.0.drain(1..));
    all
}

#[test]
fn a_configuration_that_no_radar_has_is_refused_with_its_reason() {
    let folder = Folder::new();
    let path = folder.bag(&with_older_configuration(b_scans(4), 1e7));
    let sentence = refused(&path);
    for words in ["`bin_size` is 1e7", "dataset.range_resolution_m"] {
        assert!(sentence.contains(words), "{sentence}");
    }
    let mut dataset = open(&path, &with(None)).unwrap();
    assert_has_turns(dataset.as_mut(), 4);
    let notes = dataset.notes().join(" ");
    assert!(notes.contains("cannot be used"), "{notes}");
}

#[test]
fn azimuths_whose_times_stand_against_the_rotation_are_named_so() {
    // The first azimuths determine the clock; each later azimuth is a second later.
    let messages = azimuths(4, |turn, row, mut message| {
        let number = (turn * AZIMUTHS + row) as i64;
        let step_ns = if number < 2 { 6_250_000 } else { 1_000_000_000 };
        let ns = START_NS + number * step_ns;
        message.ntp_seconds = (ns / 1_000_000_000) as u32;
        message.ntp_split_seconds = (ns % 1_000_000_000) as u32;
        Some(message)
    });
    let folder = Folder::new();
    let sentence = refused(&folder.bag(&messages));
    assert!(
        sentence.contains("do not advance as the radar turns"),
        "{sentence}"
    );
}

/// Asserts that the scans that are read have the times that the bag lists.
fn assert_times(dataset: &mut dyn Dataset, turns: usize) {
    assert_eq!(dataset.len(), turns);
    for index in (0..turns).rev() {
        let geometry = dataset.scan(index).unwrap().geometry;
        assert_eq!(dataset.nominal_stamp_ns(index), Some(geometry.stamp_ns));
    }
}

#[test]
fn a_radar_that_learns_the_time_in_its_first_turn_has_one_time_however_it_is_read() {
    let boot_s = START_NS.div_euclid(1_000_000_000) as u32 - 5;
    for learned_at in [2, 20, 60] {
        let messages = azimuths(4, |turn, row, message| {
            let since_boot = AZIMUTHS * turn + row < learned_at;
            let ntp_seconds = message.ntp_seconds - if since_boot { boot_s } else { 0 };
            Some(RadarFftDataMsg {
                ntp_seconds,
                ..message
            })
        });
        let folder = Folder::new();
        let mut dataset = opened(&folder.bag(&messages));
        assert_times(dataset.as_mut(), 4);
        assert_has_turns(dataset.as_mut(), 4);
    }
}

#[test]
fn a_turn_behind_an_azimuth_beyond_the_encoder_is_the_one_that_was_listed() {
    let messages = azimuths(5, |turn, row, message| {
        // The last one of a turn is nowhere, and the first ones of the next turn are lost.
        let azimuth = match (turn, row + 1) {
            (1, AZIMUTHS) => 60_000,
            _ => message.azimuth,
        };
        let is_lost = turn == 2 && row < 5;
        (!is_lost).then_some(RadarFftDataMsg { azimuth, ..message })
    });
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&messages));
    assert_times(dataset.as_mut(), 5);
}

const SHOWN: &str = "with these the step from the last azimuth to the first is as the others";

/// Turns with these encoder values in rows, as a turn a message and as an azimuth a message, of a
/// radar that states a size of its encoder. A row without one is not there.
fn both(turns: usize, said: u16, count: impl Fn(usize) -> Option<u16>) -> [Messages; 2] {
    let said = Configuration {
        encoder_size: said,
        ..radar()
    };
    let (mut writer, mut b_scans) = (ScanMessages::new(said, "radar"), Messages::default());
    b_scans.add(CONFIGURATION, START_NS, &writer.configuration(START_NS));
    let mut azimuths = Messages(b_scans.0.clone());
    for turn in 0..turns {
        let mut message = writer.b_scan(scan(turn).view());
        for row in 0..AZIMUTHS {
            message.encoder_values[row] = count(row).unwrap_or_default();
            message.timestamps[row] *= u64::from(count(row).is_some());
        }
        b_scans.add(B_SCANS, START_NS + TURN_NS * (turn as i64 + 1), &message);
        let scan = scan(turn);
        for (row, mut message) in writer.azimuths(scan.view()).enumerate() {
            if let Some(count) = count(row) {
                message.azimuth = count;
                azimuths.add(AZIMUTH_DATA, message.header.stamp.ns(), &message);
            }
        }
    }
    [b_scans, azimuths]
}

fn assert_angles(dataset: &mut dyn Dataset, size: u16, count: impl Fn(usize) -> Option<u16>) {
    assert_eq!(dataset.encoder_counts(), Some(size));
    let found = dataset.scan(2).unwrap();
    for row in [0, 1, AZIMUTHS / 2] {
        let expected = count(row).map(|count| f64::from(count) / f64::from(size));
        let expected = expected.unwrap() * std::f64::consts::TAU;
        let apart = f64::from(found.azimuth_rad[row]) - expected;
        assert!(apart.abs() < 1e-5, "{size} {row} {apart}");
        assert_eq!(found.view().row(row), scan(2).view().row(row));
    }
}

#[test]
fn an_encoder_has_the_counts_with_which_its_azimuths_are_a_turn() {
    for (size, said) in [(2800, 5600), (16_000, 5600), (5600, 16_000), (5600, 5600)] {
        let count = |row: usize| Some((row * usize::from(size) / AZIMUTHS + 5) as u16);
        for messages in both(6, said, count) {
            let without = Messages(messages.0.iter().skip(1).cloned().collect());
            for (messages, usual) in [(&messages, said), (&without, 5600)] {
                let folder = Folder::new();
                let path = folder.bag(messages);
                let mut dataset = open(&path, &with(None)).unwrap();
                assert_angles(dataset.as_mut(), size, count);
                assert_eq!(dataset.len(), 6, "{size}");
                let notes = dataset.notes().join(" ");
                let other = format!("{size} encoder counts per turn, not {usual}");
                let is_other = size != usual;
                assert_eq!(notes.contains(&other), is_other, "{notes}");
                assert_eq!(notes.contains(SHOWN), is_other, "{notes}");
            }
            if size == 2800 {
                // The configured size decides.
                let folder = Folder::new();
                let mut dataset = open(&folder.bag(&messages), &with(Some(3000))).unwrap();
                assert_angles(dataset.as_mut(), 3000, count);
                let notes = dataset.notes().join(" ");
                let configured = "3000 encoder counts per turn as configured";
                assert!(notes.contains(configured), "{notes}");
            }
        }
    }
}

#[test]
fn a_blanked_sector_over_zero_makes_no_smaller_encoder() {
    let count = |row: usize| (row < 36).then_some((140 * row + 13) as u16);
    for mut messages in both(6, 5600, count) {
        // With the radar's own statements, and without.
        for _ in 0..2 {
            let folder = Folder::new();
            let path = folder.bag(&messages);
            let mut dataset = open(&path, &with(None)).unwrap();
            assert_angles(dataset.as_mut(), 5600, count);
            let notes = dataset.notes().join(" ");
            assert!(notes.contains("azimuths are missing"), "{notes}");
            assert!(!notes.contains(SHOWN), "{notes}");
            messages.0.remove(0);
        }
    }
}

#[test]
fn without_times_of_turns_the_radar_is_believed() {
    let writer = ScanMessages::new(radar(), "radar");
    let mut messages = Messages::default();
    messages.add(CONFIGURATION, START_NS, &writer.configuration(START_NS));
    for turn in 0..3 {
        let mut message = writer.b_scan(scan(turn).view());
        message.timestamps.fill(0);
        for (row, value) in message.encoder_values.iter_mut().enumerate() {
            *value = if row < 36 { (140 * row + 13) as u16 } else { 0 };
        }
        messages.add(B_SCANS, START_NS + TURN_NS * (turn as i64 + 1), &message);
    }
    let folder = Folder::new();
    let dataset = open(&folder.bag(&messages), &with(None)).unwrap();
    assert_eq!(dataset.encoder_counts(), Some(5600));
}
