//! Real recordings that are served: every scan comes back as its reader reads it.

use std::path::PathBuf;

use gyre_colossus::{Azimuth, ClockFormat, Configuration, Powers, RadarClock};
use gyre_datasets::{Dataset, DatasetOptions};
use gyre_radar::{OwnedScan, PolarScan};

use crate::support::Assembly;

/// Navtech's images have the encoder count three bytes before the powers.
fn encoder(scan: &PolarScan<'_>, row: usize) -> u16 {
    let powers = scan.geometry.first_byte + row * scan.geometry.stride;
    u16::from_le_bytes([scan.bytes[powers - 3], scan.bytes[powers - 2]])
}

fn scans(dataset: &mut dyn Dataset) -> Vec<OwnedScan> {
    let count = dataset.len().min(20);
    let read = |index| {
        let mut scan = OwnedScan::with_limits(dataset.limits());
        scan.geometry = dataset.read(index, scan.slot()).unwrap();
        scan
    };
    (0..count).map(read).collect()
}

fn served(scans: &[OwnedScan], encoder_size: u16, period_ns: i64) -> Assembly {
    let geometry = scans[0].geometry;
    let radar = Configuration {
        azimuth_samples: geometry.azimuths as u16,
        range_in_bins: geometry.bins as u16,
        encoder_size,
        rotation_mhz: (1_000_000_000_000 / period_ns) as u16,
        range_resolution_m: Some(geometry.range_resolution_m),
        ..Configuration::default()
    };
    let (mut assembly, mut clock) = (Assembly::new(&radar), RadarClock::new(&radar));
    for scan in scans.iter().map(OwnedScan::view) {
        for row in 0..geometry.azimuths {
            let (seconds, split_seconds) = ClockFormat::default().fields(scan.stamp_ns[row]);
            let azimuth = Azimuth {
                sweep_counter: row as u16,
                encoder: encoder(&scan, row),
                seconds,
                split_seconds,
                powers: Powers::Eight(scan.row(row)),
            };
            for (azimuth, stamp_ns) in clock.stamp(azimuth, 0) {
                assembly.add(&azimuth, stamp_ns);
            }
        }
    }
    println!("{:?}, {:?}", clock.found(), assembly.counters());
    assembly
}

#[test]
fn real_scans_come_back_identical() {
    let Some(data) = std::env::var_os("GYRE_DATA").map(PathBuf::from) else {
        println!("skipped: GYRE_DATA is not set");
        return;
    };
    for name in [
        "oxford-2019-01-10-14-36-48",
        "samples/fomo-2025-10-14",
        "samples/boreas-rt-2024-12-03",
    ] {
        let Ok(mut dataset) = gyre_datasets::open(&data.join(name), &DatasetOptions::default())
        else {
            println!("skipped: {name} is missing");
            continue;
        };
        let encoder_size = dataset.encoder_counts().unwrap();
        let (scans, period_ns) = (scans(&mut *dataset), dataset.period_ns());
        let ends = |scan: &OwnedScan| [0, 1, 398, 399].map(|row| encoder(&scan.view(), row));
        println!("{name}: {encoder_size} counts, {:?}", ends(&scans[0]));
        let assembly = served(&scans, encoder_size, period_ns);
        assert_eq!(assembly.sweeps.len(), scans.len(), "{name}");
        for ((sweep, received), scan) in assembly.sweeps.iter().zip(&scans) {
            let (received, scan) = (received.view(), scan.view());
            assert_eq!(sweep.missing, 0);
            assert_eq!(received.geometry.azimuths, scan.geometry.azimuths);
            assert_eq!(received.azimuth_rad, scan.azimuth_rad);
            assert_eq!(received.stamp_ns, scan.stamp_ns);
            for row in 0..scan.geometry.azimuths {
                assert_eq!(received.row(row), scan.row(row));
            }
        }
    }
}
