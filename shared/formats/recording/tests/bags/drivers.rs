//! Bags of drivers and converters that write otherwise than Gyre.

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
    let options = DatasetOptions {
        range_resolution_m: Some(0.0438),
        ..DatasetOptions::default()
    };
    let mut dataset = open(&path, &options).unwrap();
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
    let mut scan = OwnedScan::with_limits(dataset.limits());
    assert_eq!(dataset.len(), turns);
    for index in (0..turns).rev() {
        let geometry = dataset.read(index, scan.slot()).unwrap();
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
