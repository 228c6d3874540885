//! Random events: their frequency, and that they change nothing else.

use gyre_geometry::OwnedScan;
use gyre_worlds::{profile::{METADATA_BYTES, Profile}, Effects, SimulationConfig, Simulator};

use super::scene::{Setup, changed, only, power, powers};

fn k2pi(effects: Effects) -> Setup<'static> {
    Setup {
        effects,
        ..Setup::default()
    }
    .with(Profile::K2pi)
}

#[test]
fn interference_occurs_0_6_times_a_scan_in_one_to_four_azimuths() {
    const SCANS: u64 = 500;
    let scans = k2pi(only(|e| &mut e.interference, true)).scans(SCANS);
    let mut lengths = Vec::new();
    for scan in &scans {
        let interfered: Vec<bool> = powers(scan)
            .iter()
            .map(|row| row.iter().any(|count| *count > 0))
            .collect();
        lengths.extend(
            interfered
                .chunk_by(|a, b| a == b)
                .filter(|run| run[0])
                .map(<[bool]>::len),
        );
    }
    let rate = lengths.len() as f64 / SCANS as f64;
    assert!((rate - 0.6).abs() < 0.12, "{rate} a scan");
    for length in 1..=4 {
        let share =
            lengths.iter().filter(|found| **found == length).count() as f64 / lengths.len() as f64;
        assert!((share - 0.25).abs() < 0.1, "{length} azimuths: {share}");
    }
}

#[test]
fn two_azimuths_in_a_thousand_are_lost_interpolated_and_marked() {
    const SCANS: u64 = 250;
    let scans = k2pi(Effects {
        dropped_azimuths: true,
        noise: true,
        ..Effects::NONE
    })
    .scans(SCANS);
    let mut lost = 0;
    for scan in &scans {
        let rows = powers(scan);
        for azimuth in 1..119 {
            let measured = |azimuth: usize| scan.flags[azimuth] != 0;
            let valid = scan.bytes[azimuth * scan.geometry.stride + METADATA_BYTES - 1];
            assert_eq!(valid, if measured(azimuth) { 255 } else { 0 });
            if measured(azimuth) || !measured(azimuth + 1) {
                continue;
            }
            lost += 1;
            let neighbours = rows[azimuth - 1].iter().zip(rows[azimuth + 1]);
            let mean = neighbours
                .map(|(before, behind)| ((u16::from(*before) + u16::from(*behind)) / 2) as u8);
            assert!(mean.eq(rows[azimuth].iter().copied()));
        }
    }
    let share = f64::from(lost) / (118 * SCANS) as f64;
    assert!((share - 0.002).abs() < 0.000_8, "{share}");
    let none = k2pi(only(|e| &mut e.noise, true)).scans(20);
    assert!(
        none.iter()
            .all(|scan| scan.flags.iter().all(|flags| *flags != 0))
    );
}

/// Share of azimuths that are equal from 10 m on.
fn same_beyond_10_m(a: &OwnedScan, b: &OwnedScan) -> f64 {
    let first = Setup::default().bins(0.0..10.0).end;
    let (a, b) = (powers(a), powers(b));
    let same = a
        .iter()
        .zip(&b)
        .filter(|(a, b)| a[first..] == b[first..])
        .count();
    same as f64 / a.len() as f64
}

#[test]
fn switching_one_effect_keeps_the_random_numbers_of_all_others() {
    let switches: [fn(&mut Effects) -> &mut bool; 4] = [
        |e| &mut e.ringing,
        |e| &mut e.own_vehicle,
        |e| &mut e.interference,
        |e| &mut e.dropped_azimuths,
    ];
    let without = switches.map(|switch| changed(Effects::ALL, switch, false));
    let simulator = |effects| {
        Simulator::new(&SimulationConfig {
            effects,
            ..SimulationConfig::default()
        })
        .unwrap()
    };
    let all = simulator(Effects::ALL);
    for effects in without {
        let less = simulator(effects);
        for index in 0..3 {
            let same =
                same_beyond_10_m(&all.render_scan(index).scan, &less.render_scan(index).scan);
            assert!(
                same > 0.95,
                "{same} of azimuths are the same with {effects:?}"
            );
        }
    }
}

#[test]
fn the_own_vehicle_is_the_same_with_and_without_ringing() {
    let beyond_4_m = |ringing| {
        let setup = Setup::of(
            vec![],
            Effects {
                own_vehicle: true,
                ringing,
                ..Effects::NONE
            },
        );
        let (scan, first) = (setup.scan(), setup.bins(0.0..4.0).end);
        powers(&scan)
            .iter()
            .map(|row| row[first..].to_vec())
            .collect::<Vec<_>>()
    };
    assert_eq!(beyond_4_m(true), beyond_4_m(false));
}

#[test]
fn noise_does_not_depend_on_what_else_is_measured() {
    let scan = |effects: Effects| {
        Setup {
            effects,
            ..Setup::default()
        }
        .scan()
    };
    let noise = only(|e| &mut e.noise, true);
    let alone = scan(noise);
    // Power is only added where no other echo is.
    let more = Effects {
        ground: false,
        interference: false,
        dropped_azimuths: false,
        ..Effects::ALL
    };
    let beside = scan(Effects {
        spurious_lines: false,
        ..more
    });
    assert_eq!(same_beyond_10_m(&alone, &beside), 1.0);
    assert!(power(alone.view().row(0)[1000]) < 1e3);
}

#[test]
fn a_scan_does_not_depend_on_the_thread_or_the_order() {
    let mut config = SimulationConfig::default();
    config.sensor.profile = Profile::Cts350xRadiate;
    config.weather = vec![gyre_worlds::weather::WeatherConfig {
        snow_mm_h: 3.0,
        ..Default::default()
    }];
    let simulator = Simulator::new(&config).unwrap();
    let in_order: Vec<Vec<u8>> = (0..4)
        .map(|index| simulator.render_scan(index).scan.bytes)
        .collect();
    let backwards: Vec<Vec<u8>> = std::thread::scope(|scope| {
        let simulator = &simulator;
        let measure = |first: usize| {
            move || {
                let (mut sensor, mut scan) = (
                    simulator.sensor(),
                    OwnedScan::with_limits(simulator.limits()),
                );
                [first, first - 1].map(|index| {
                    simulator.render_into(index, &mut sensor, &mut scan.slot());
                    scan.bytes.clone()
                })
            }
        };
        let threads = [scope.spawn(measure(3)), scope.spawn(measure(1))];
        threads
            .into_iter()
            .flat_map(|thread| thread.join().unwrap())
            .collect()
    });
    assert!(in_order.iter().rev().eq(&backwards));
}
