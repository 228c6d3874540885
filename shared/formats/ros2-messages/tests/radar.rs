//! Navtech's messages and scans.

use std::f64::consts::TAU;

use gyre_colossus::Configuration;
use gyre_ros2_messages::{
    messages::{RadarConfigurationMessage, RadarFftDataMessage},
    navtech_msgs::{RadarBScanMsg, RadarConfigurationMsg},
    radar::{Encoder, ScanMessages},
    std_msgs::Header,
};

use crate::turn::{BINS, START_NS, radar, scan};

#[test]
fn numbers_of_the_older_form_have_their_bytes() {
    let refused = RadarFftDataMessage::default().azimuth().unwrap_err();
    assert!(refused.contains("has 0 bytes, expected 2"), "{refused}");
}

#[test]
fn rows_that_the_driver_has_not_written_are_missing() {
    let mut message = ScanMessages::new(radar(), "radar").b_scan(scan(0).view());
    for row in [3, 39] {
        (message.encoder_values[row], message.timestamps[row]) = (0, 0);
    }
    let rows: Vec<_> = message.rows(&radar(), 0, START_NS).unwrap().collect();
    assert_eq!(rows.len(), 38);
    assert!(rows.iter().all(|row| row.azimuth.encoder != 0));
}

/// A driver whose first azimuth has encoder count 0 publishes an empty turn before it.
#[test]
fn a_turn_of_which_the_driver_has_written_nothing_has_no_rows() {
    let messages = ScanMessages::new(radar(), "radar");
    let from_zero = || {
        let mut message = messages.b_scan(scan(0).view());
        let encoders = message.encoder_values.iter_mut();
        encoders.for_each(|encoder| *encoder -= 13);
        message
    };
    let mut empty = from_zero();
    empty.b_scan_img.data.fill(0);
    empty.encoder_values.fill(0);
    empty.timestamps.fill(0);
    for (message, rows) in [(empty, 0), (from_zero(), 40)] {
        assert_eq!(message.rows(&radar(), 0, START_NS).unwrap().count(), rows);
    }
}

#[test]
fn a_turned_image_is_turned_back() {
    let plain = ScanMessages::new(radar(), "radar").b_scan(scan(0).view());
    let mut turned = plain.clone();
    turned.b_scan_img.data.rotate_right(5 * BINS);
    let powers = |message: &RadarBScanMsg, offset| -> Vec<Vec<u8>> {
        let rows = message.rows(&radar(), offset, START_NS).unwrap();
        rows.map(|row| row.azimuth.powers.bytes().to_vec())
            .collect()
    };
    assert_eq!(powers(&turned, 5), powers(&plain, 0));
    assert_ne!(powers(&turned, 0), powers(&plain, 0));
}

#[test]
fn a_radar_without_a_clock_has_the_times_of_receipt() {
    let mut message = ScanMessages::new(radar(), "radar").b_scan(scan(0).view());
    message.timestamps.fill(0);
    let rows: Vec<_> = message.rows(&radar(), 0, START_NS).unwrap().collect();
    // The message is received when the turn has ended.
    let turn_ns = START_NS - rows[0].arrived_ns;
    assert!((turn_ns - 250_000_000).abs() < 1_000_000, "{turn_ns}");
    assert!(START_NS - rows[39].arrived_ns < 7_000_000);
    assert_eq!((rows.len(), rows[0].azimuth.seconds), (40, [0; 4]));
}

#[test]
fn an_image_alone_is_evenly_spaced() {
    let image = ScanMessages::new(radar(), "radar")
        .b_scan(scan(0).view())
        .b_scan_img;
    let rows: Vec<_> = image.rows(&radar(), 0, START_NS).unwrap().collect();
    assert_eq!(rows.len(), 40);
    assert_eq!((rows[0].azimuth.encoder, rows[1].azimuth.encoder), (0, 140));
    assert!(rows[0].arrived_ns < rows[1].arrived_ns);
}

#[test]
fn images_that_are_not_of_powers_are_refused() {
    type Edit = fn(&mut RadarBScanMsg);
    let edits: [(Edit, &str); 4] = [
        (|it| it.b_scan_img.encoding = "rgb8".to_owned(), "pixels"),
        (|it| it.b_scan_img.height = u32::MAX, "rows of 64 bytes"),
        (|it| it.b_scan_img.width = 0, "for 0 bins"),
        (
            |it| it.timestamps.truncate(39),
            "40 encoder values and 39 times",
        ),
    ];
    for (edit, expected) in edits {
        let mut message = ScanMessages::new(radar(), "radar").b_scan(scan(0).view());
        edit(&mut message);
        let refused = message.rows(&radar(), 0, 0).err().unwrap();
        assert!(refused.contains(expected), "{refused}");
    }
}

/// The configuration of a driver before 2024, with these bytes as the depth of a bin.
fn older(bin_size: [u8; 8]) -> Result<Configuration, String> {
    let message = RadarConfigurationMessage {
        azimuth_samples: 400_u16.to_be_bytes().to_vec(),
        encoder_size: 5600_u16.to_be_bytes().to_vec(),
        bin_size: bin_size.to_vec(),
        range_in_bins: 3768_u16.to_be_bytes().to_vec(),
        expected_rotation_rate: 4_u16.to_be_bytes().to_vec(),
        ..RadarConfigurationMessage::default()
    };
    let described = message.configuration();
    described.map(|it| it.radar)
}

fn newer(bin_size: f32) -> Result<Configuration, String> {
    let message = RadarConfigurationMsg {
        azimuth_samples: 400,
        encoder_size: 5600,
        bin_size,
        range_in_bins: 3768,
        expected_rotation_rate: 4000,
        ..RadarConfigurationMsg::default()
    };
    let described = message.configuration();
    described.map(|it| it.radar)
}

#[test]
fn depths_of_bins_come_back_to_the_bit() {
    let others = [100.0 / 576.0, 200.0 / 3360.0, 1.0 / 3.0];
    for resolution_m in [0.0438, 0.0596, 0.04381, 0.175].into_iter().chain(others) {
        let radar = Configuration {
            range_resolution_m: Some(resolution_m),
            ..radar()
        };
        let message = RadarConfigurationMsg::of(&radar, Header::default());
        let described = message.configuration().unwrap().radar;
        assert_eq!(described.range_resolution_m(), resolution_m);
    }
}

#[test]
fn depths_of_bins_are_in_tenths_of_millimetres_or_in_metres_and_others_are_refused() {
    for (size, depth_m) in [
        (438.0, 0.0438),
        (0.0438, 0.0438),
        (596.0, 0.0596),
        (0.6, 0.6),
    ] {
        let (old, new) = (older(f64::to_le_bytes(size)), newer(size as f32));
        for found in [old.unwrap(), new.unwrap()] {
            let apart_m = found.range_resolution_m() - depth_m as f32;
            assert!(apart_m.abs() < 1e-9, "{size}");
            assert_eq!((found.rotation_mhz, found.encoder_size), (4000, 5600));
            assert_eq!((found.azimuth_samples, found.range_in_bins), (400, 3768));
        }
    }
    for size in [0.0, -438.0, 7.0, 1e6, f64::NAN, f64::INFINITY] {
        let refused = older(size.to_le_bytes()).unwrap_err();
        assert!(refused.contains("no radar has bins"), "{refused}");
        assert!(newer(size as f32).is_err(), "{size}");
    }
    // As an integer, most significant byte first. The driver does not know this form.
    assert!(older(438_u64.to_be_bytes()).is_err());
}

#[test]
fn times_of_rows_are_in_the_unit_in_which_the_radar_turns() {
    let message = ScanMessages::new(radar(), "radar").b_scan(scan(0).view());
    let split = |message: &RadarBScanMsg| -> Vec<_> {
        let rows = message.rows(&radar(), 0, START_NS).unwrap();
        rows.map(|row| (row.azimuth.seconds, row.azimuth.split_seconds))
            .collect()
    };
    for unit in [1, 1_000, 1_000_000] {
        let (mut coarse, mut rounded) = (message.clone(), message.clone());
        for stamp in &mut coarse.timestamps {
            *stamp /= unit;
        }
        for stamp in &mut rounded.timestamps {
            *stamp = *stamp / unit * unit;
        }
        assert_eq!(split(&coarse), split(&rounded), "{unit}");
    }
}

#[test]
fn the_encoder_of_a_scan_is_found() {
    let angles = |counts: f64, step: f64, first: f64| -> Vec<f32> {
        (0..400)
            .map(|row| ((f64::from(row) * step + first) * (TAU / counts)) as f32)
            .collect()
    };
    let found = |angles: &[f32], known| Encoder::of(angles, known);
    let exact = |counts| Encoder {
        counts,
        is_exact: true,
    };
    assert_eq!(found(&angles(5600.0, 14.0, 13.0), None), exact(5600));
    assert_eq!(found(&angles(5595.0, 13.0, 3.0), None), exact(5595));
    assert_eq!(
        found(&angles(16_000.0, 40.0, 7.0), Some(16_000)),
        exact(16_000)
    );
    assert_eq!(found(&angles(400.0, 1.0, 0.0), None), exact(400));
    assert_eq!(found(&angles(400.0, 1.0, 0.5), None), exact(800));
    assert!(!found(&angles(400.0, 1.0, 0.123), None).is_exact);
}
