//! Logs of encoders and odometers, which count.

use gyre_datasets::{LogError, LogFaults, SampleLog};
use gyre_geometry::samples::{Sample, SampleKind};
use tempfile::TempDir;

use super::{MS, START_NS};
use crate::common::{assert_refused, written};

fn speeds(log: &SampleLog) -> Vec<f64> {
    log.samples.iter().map(|sample| sample.values[0]).collect()
}

/// Counts of 100 Hz, of a vehicle that drives now faster, now slower.
fn ticks(header: &str, m_per_tick: f64, row: impl Fn(usize, f64) -> String) -> String {
    let place_m = |k: usize| {
        let time_s = k as f64 * 0.01;
        8.0 * time_s + 3.0 * time_s.sin()
    };
    let stamp = |k: usize| START_NS + 10 * MS * k as i64;
    let rows = (0..1000).map(|k| {
        let count = (place_m(k) / m_per_tick).floor();
        format!("{},{}\n", stamp(k), row(k, count))
    });
    format!("{header}\n{}", rows.collect::<String>())
}

fn read_ticks(text: &str, m_per_tick: Option<f64>) -> Result<SampleLog, LogError> {
    let folder = TempDir::new().unwrap();
    let path = written(&folder, "encoder.csv", text);
    SampleLog::read(SampleKind::Wheels, &path, m_per_tick)
}

/// The distance between the first and the last sample, m.
fn path_m(log: &SampleLog) -> f64 {
    let of_pair = |pair: &[Sample]| {
        let seconds = (pair[1].stamp_ns - pair[0].stamp_ns) as f64 * 1e-9;
        0.5 * (pair[0].values[0] + pair[1].values[0]) * seconds
    };
    log.samples.windows(2).map(of_pair).sum()
}

#[test]
fn counts_become_speeds_whose_way_is_that_of_the_counts() {
    for (header, m_per_tick, both) in [
        ("stamp_ns,ticks", 0.05, false),
        ("timestamp,left_count,right_count", 0.02, true),
        ("stamp_ns,distance_m", 1.0, false),
    ] {
        let is_in_metres = m_per_tick == 1.0;
        let row = |_: usize, count: f64| match (both, is_in_metres) {
            (true, _) => format!("{},{}", count - 40.0, count + 40.0),
            (_, true) => format!("{}", count + 0.5),
            _ => format!("{count}"),
        };
        let text = ticks(header, m_per_tick, row);
        let log = read_ticks(&text, (!is_in_metres).then_some(m_per_tick)).unwrap();
        assert_eq!(log.faults, LogFaults::default(), "{header}");
        let at = |sample: &Sample| (sample.stamp_ns - START_NS) as f64 * 1e-9;
        let [first, last] = [log.samples.first(), log.samples.last()].map(|it| at(it.unwrap()));
        let driven = 8.0 * (last - first) + 3.0 * (last.sin() - first.sin());
        let off_m = path_m(&log) - driven;
        assert!(off_m.abs() < 2.0 * m_per_tick, "{header}: {off_m} m");
        for sample in &log.samples {
            let off_mps = sample.values[0] - (8.0 + 3.0 * at(sample).cos());
            let most_mps = m_per_tick / 0.09 + 0.05;
            assert!(off_mps.abs() < most_mps, "{header}: {off_mps} m/s");
        }
    }
}

#[test]
fn a_counter_that_runs_over_counts_on() {
    let speeds_of = |row: &dyn Fn(f64) -> String| {
        let header = "stamp_ns,left_ticks,right_ticks";
        let text = ticks(header, 0.01, |_, count| row(count));
        speeds(&read_ticks(&text, Some(0.01)).unwrap())
    };
    let whole = speeds_of(&|count| format!("{count},{count}"));
    // The range, the least value, and the count at the start of the log.
    for (range, least, from) in [
        (256.0, -128.0, 77.0),
        (65_536.0, 0.0, 65_000.0),
        (1000.0, 1.0, 5.0),
    ] {
        let over = |count: f64| (count + from).rem_euclid(range) + least;
        let ahead = speeds_of(&|count| format!("{},{}", over(count + 33.0), over(count)));
        let back = speeds_of(&|count| format!("{},{}", over(-count), over(33.0 - count)));
        for (k, speed) in whole.iter().enumerate() {
            let off = [ahead[k] - speed, back[k] + speed].map(f64::abs);
            assert!(off.iter().all(|off| *off < 0.2), "{range}: {off:?} at {k}");
        }
    }
}

#[test]
fn a_counter_that_starts_anew_costs_one_speed() {
    let row = |k: usize, count: f64| format!("{}", count + if k < 500 { 65_000.0 } else { 0.0 });
    let text = ticks("stamp_ns,ticks", 0.05, row);
    let log = read_ticks(&text, Some(0.05)).unwrap();
    assert_eq!(log.faults.absurd, 1);
    assert!(log.samples.len() > 95, "{}", log.samples.len());
    assert!(log.samples.iter().all(|sample| sample.values[0] < 12.0));
}

#[test]
fn ticks_need_their_length() {
    let text = ticks("stamp_ns,ticks", 0.05, |_, count| format!("{count}"));
    let short: String = text.lines().take(9).map(|row| format!("{row}\n")).collect();
    for (text, m_per_tick, words) in [
        (
            &text,
            None,
            "give the distance of one, in metres, as wheels.m_per_tick",
        ),
        (&short, Some(0.05), "it is shorter than 0.09 s"),
        (&text, Some(1.0), "is wheels.m_per_tick in metres"),
    ] {
        assert_refused(read_ticks(text, m_per_tick), words);
    }
}
