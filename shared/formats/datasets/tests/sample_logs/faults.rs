//! Faults of logs: none of them changes a sample in silence.

use gyre_datasets::LogFaults;
use gyre_geometry::samples::SampleKind::Gyro;
use proptest::prelude::*;

use super::{MS, START_NS, read};
use crate::common::assert_refused;

const HEADER: &str = "stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps";

/// A log of 100 Hz; each sample has a rate of its own.
fn rows(count: i64) -> Vec<(i64, f64)> {
    let row = |k| (START_NS + 10 * k * MS, 1e-4 * k as f64);
    (0..count).map(row).collect()
}

fn text(rows: &[(i64, f64)]) -> String {
    let rows = rows.iter().map(|(ns, rate)| format!("{ns},0,0,{rate}\n"));
    format!("{HEADER}\n{}", rows.collect::<String>())
}

fn left_out(of: &LogFaults) -> usize {
    let by_value = of.unreadable + of.not_a_number + of.absurd;
    by_value + of.repeated + of.measured_twice + of.by_clock_steps
}

/// One fault that is put into a log.
#[derive(Clone, Debug)]
enum Fault {
    Lost(usize),
    Repeated(usize, usize),
    Late(usize, usize),
    NotANumber(usize),
    Absurd(usize),
    CutOff(usize),
}

fn fault() -> impl Strategy<Value = Fault> {
    let at = 1usize..290;
    prop_oneof![
        at.clone().prop_map(Fault::Lost),
        (at.clone(), 0usize..20).prop_map(|(k, by)| Fault::Repeated(k, by)),
        (at.clone(), 1usize..20).prop_map(|(k, by)| Fault::Late(k, by)),
        at.clone().prop_map(Fault::NotANumber),
        at.clone().prop_map(Fault::Absurd),
        at.prop_map(Fault::CutOff),
    ]
}

impl Fault {
    /// Puts the fault into the lines of a log. Returns the sample that is lost by it.
    fn put(&self, lines: &mut Vec<String>) -> Option<usize> {
        let with = |line: &str, rate: &str| {
            let stamp = line.split(',').next().unwrap().to_owned();
            format!("{stamp},0,0,{rate}")
        };
        match *self {
            Self::Repeated(k, by) => {
                let line = lines[k].clone();
                lines.insert((k + by + 1).min(lines.len()), line);
            }
            Self::Late(k, by) => {
                let line = lines.remove(k);
                lines.insert((k + by).min(lines.len()), line);
            }
            Self::Lost(k) => drop(lines.remove(k)),
            Self::NotANumber(k) => lines[k] = with(&lines[k], "nan"),
            Self::Absurd(k) => lines[k] = with(&lines[k], "-57.3"),
            Self::CutOff(k) => lines[k].truncate(22),
        }
        match *self {
            Self::Lost(k) | Self::NotANumber(k) | Self::Absurd(k) | Self::CutOff(k) => Some(k),
            _ => None,
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Samples that are left are those that were measured, in their order, each once; those that
    /// are not are counted.
    #[test]
    fn a_fault_is_counted_and_changes_no_other_sample(fault in fault()) {
        let rows = rows(300);
        let mut lines: Vec<String> = text(&rows).lines().skip(1).map(str::to_owned).collect();
        let lost = fault.put(&mut lines);
        let log = read(Gyro, "imu.csv", &format!("{HEADER}\n{}\n", lines.join("\n"))).unwrap();
        let expected: Vec<_> = (0..300).filter(|k| Some(*k) != lost).map(|k| rows[k]).collect();
        let found: Vec<_> = log.samples.iter().map(|it| (it.stamp_ns, it.values[2])).collect();
        prop_assert_eq!(found, expected);
        let faults = &log.faults;
        let counted = [faults.repeated, faults.out_of_order, faults.not_a_number, faults.absurd, faults.unreadable];
        let one = match fault {
            Fault::Lost(_) => [0, 0, 0, 0, 0],
            Fault::Repeated(..) => [1, 0, 0, 0, 0],
            Fault::Late(..) => [0, 1, 0, 0, 0],
            Fault::NotANumber(_) => [0, 0, 1, 0, 0],
            Fault::Absurd(_) => [0, 0, 0, 1, 0],
            Fault::CutOff(_) => [0, 0, 0, 0, 1],
        };
        prop_assert_eq!(counted, one);
        prop_assert_eq!(faults.bridged, usize::from(lost.is_some()));
        prop_assert!(!log.sentences().is_empty());
    }

    /// Whatever a file holds, reading it ends with samples in the order of their stamps, which are
    /// finite and differ, or with a sentence.
    #[test]
    fn no_file_makes_disorder(rows in prop::collection::vec((prop::num::i64::ANY, prop::num::f64::ANY), 0..60)) {
        let Ok(log) = read(Gyro, "imu.csv", &text(&rows)) else { return Ok(()) };
        prop_assert!(log.samples.windows(2).all(|pair| pair[0].stamp_ns < pair[1].stamp_ns));
        prop_assert!(log.samples.iter().all(|it| it.values.iter().all(|value| value.abs() <= 10.0)));
        prop_assert_eq!(log.samples.len() + left_out(&log.faults), rows.len());
    }
}

#[test]
fn gaps_are_told_with_the_longest() {
    let mut rows = rows(300);
    rows.drain(200..280);
    rows.drain(100..103);
    let log = read(Gyro, "imu.csv", &text(&rows)).unwrap();
    let [gap, _] = &log.faults.gaps[..] else {
        panic!("{:?}", log.faults);
    };
    let is_first = (gap.after_s - 0.99).abs() < 1e-9 && (gap.seconds - 0.04).abs() < 1e-9;
    assert!(is_first, "{gap:?}");
    let sentence = "Samples are missing in 2 places, for up to 0.81 s (2.0 s after the first).";
    assert_eq!(log.sentences(), [sentence]);
}

#[test]
fn single_samples_that_are_missing_are_counted_and_stamps_that_jitter_are_not_taken_for_them() {
    let bridged = |stamp_ms: &dyn Fn(i64) -> Option<i64>| {
        let rows = (0..300).filter_map(|k| Some((START_NS + stamp_ms(k)? * MS, 0.0)));
        let log = read(Gyro, "imu.csv", &text(&rows.collect::<Vec<_>>())).unwrap();
        assert!(log.faults.gaps.is_empty(), "{:?}", log.faults);
        log.faults.bridged
    };
    assert_eq!(bridged(&|k| Some(10 * k)), 0);
    assert_eq!(bridged(&|k| (k % 50 != 7).then_some(10 * k)), 6);
    assert_eq!(bridged(&|k| (k % 50 / 2 != 7).then_some(10 * k)), 12);
    // Each tenth stamp is late, or early, by most of a period.
    for off_ms in [-8, 8] {
        let jittered = |k: i64| Some(10 * k + if k % 10 == 5 { off_ms } else { 0 });
        assert_eq!(bridged(&jittered), 0, "{off_ms}");
    }
}

#[test]
fn a_clock_that_was_set_leaves_the_longer_part() {
    // After two hours ahead both parts follow one another.
    for (step_ms, kept) in [
        (-5_000, 100..300),
        (-86_400_000, 100..300),
        (7_200_000, 0..300),
    ] {
        let mut rows = rows(300);
        rows[100..].iter_mut().for_each(|row| row.0 += step_ms * MS);
        let log = read(Gyro, "imu.csv", &text(&rows)).unwrap();
        let faults = &log.faults;
        let off_s = faults.clock_steps_s[0] - (1e-3 * step_ms as f64 + 0.01);
        assert!(off_s.abs() < 1e-6, "{faults:?}");
        assert_eq!(log.samples.len(), kept.len(), "{step_ms}");
        assert_eq!(log.samples[0].values[2], rows[kept.start].1);
        let sentence = &log.sentences()[0];
        for words in ["The clock steps 1 times", "first behind sample 100"] {
            assert!(sentence.contains(words), "{sentence}");
        }
    }
}

#[test]
fn a_single_stamp_that_is_far_off_is_left_out() {
    for off_s in [-31_536_000i64, -30, 7_200, 31_536_000] {
        let mut rows = rows(300);
        rows[100].0 += off_s * 1_000_000_000;
        let log = read(Gyro, "imu.csv", &text(&rows)).unwrap();
        assert_eq!(log.samples.len(), 299, "{off_s}");
        assert_eq!(log.faults.by_clock_steps, 1, "{off_s}");
    }
}

#[test]
fn times_that_are_measured_twice_are_used_by_nobody() {
    // From the 100th sample on the clock is 0.305 s back.
    let mut rows = rows(300);
    rows[100..].iter_mut().for_each(|row| row.0 -= 305 * MS);
    let log = read(Gyro, "imu.csv", &text(&rows)).unwrap();
    let mut stamps = log.samples.iter().map(|it| (it.stamp_ns - START_NS) / MS);
    assert!(stamps.all(|ms| !(695..=990).contains(&ms)), "{log:?}");
    assert_eq!(log.faults.out_of_order, 30);
    assert_eq!(log.faults.measured_twice + log.samples.len(), 300);
    assert_eq!(log.faults.measured_twice, 60);
}

#[test]
fn a_log_in_degrees_is_refused_or_its_unit_said_to_be_assumed() {
    let mut turning = rows(300);
    turning.iter_mut().for_each(|row| row.1 *= 1e3);
    let remedy = "if they are in deg/s, name the columns so, as gyro_z_degps";
    assert_refused(read(Gyro, "imu.csv", &text(&turning)), remedy);
    let named = text(&turning).replace("_radps", "_degps");
    let log = read(Gyro, "imu.csv", &named).unwrap();
    assert!((log.samples[299].values[2] - 29.9f64.to_radians()).abs() < 1e-12);
    let unnamed = text(&rows(300)).replace("_radps", "");
    let log = read(Gyro, "imu.csv", &unnamed).unwrap();
    let sentence = &log.sentences()[0];
    assert!(sentence.contains("rad/s is assumed"), "{sentence}");
}

#[test]
fn stamps_that_are_no_clock_are_refused_with_the_steps() {
    for (step_ns, words) in [
        (10_000_000_000, "Are the stamps in another column?"),
        // A counter of ns in 32 bits.
        (1 << 32, "(-4.294967 s"),
    ] {
        let rows = (0..300).map(|k| (START_NS + (k % 2) * step_ns, 0.0));
        let rows: Vec<_> = rows.collect();
        let refused = read(Gyro, "imu.csv", &text(&rows)).unwrap_err().to_string();
        for words in [words, "first behind sample 2"] {
            assert!(refused.contains(words), "{refused}");
        }
    }
}

#[test]
fn samples_that_come_in_bursts_are_spread_back_to_the_burst_before() {
    for (size, lost) in [(20, None), (2, None), (20, Some(100..140))] {
        let mut rows = rows(300);
        let measured = rows.clone();
        for burst in rows.chunks_mut(size) {
            let received_ns = burst.last().unwrap().0;
            burst.iter_mut().for_each(|row| row.0 = received_ns);
        }
        let mut measured: Vec<_> = measured.iter().map(|row| row.0).collect();
        if let Some(lost) = lost {
            measured.drain(lost.clone());
            rows.drain(lost);
        }
        let log = read(Gyro, "imu.csv", &text(&rows)).unwrap();
        let found: Vec<i64> = log.samples.iter().map(|it| it.stamp_ns).collect();
        assert_eq!(found, measured, "{size}");
        assert_eq!((log.faults.spread, left_out(&log.faults)), (rows.len(), 0));
        let sentence = &log.sentences()[0];
        assert!(sentence.contains("in bursts of one stamp"), "{sentence}");
    }
    // Rows that were written twice are no bursts.
    let twice: Vec<_> = rows(300).iter().flat_map(|row| [*row, *row]).collect();
    let log = read(Gyro, "imu.csv", &text(&twice)).unwrap();
    assert_eq!((log.samples.len(), log.faults.repeated), (300, 300));
    assert_eq!(log.faults.spread, 0);
}
