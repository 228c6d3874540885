//! Logs of GNSS receivers: each fault is counted under its name, and the faulty row is left out.

use gyre_datasets::{ReceivedFixes, SampleLog};
use gyre_geometry::samples::{GnssConfig, SampleKind::Gnss};

use super::{START_NS, read};
use crate::common::written;

#[test]
fn fixes_on_the_radars_clock_have_the_delay_taken_off_and_the_uncertainty_that_is_known() {
    let text = format!(
        "stamp_ns,east_m,north_m,sigma_m\n{START_NS},3.0,4.0,0.5\n{},3.0,5.0,nan\n",
        START_NS + 1_000_000_000
    );
    let config = GnssConfig {
        delay_s: 1.58,
        sigma_m: 7.0,
        ..GnssConfig::default()
    };
    let fixes = read(Gnss, "gnss.csv", &text).unwrap().on_radar(&config);
    assert_eq!(fixes[0].stamp_ns, START_NS - 1_580_000_000);
    assert_eq!([fixes[0].sigma_m, fixes[1].sigma_m], [0.5, 7.0]);
}

/// A log at 10 m/s to the east with a fix each second; `row` may return other rows.
fn drive(row: impl Fn(usize, i64, f64) -> Option<String>) -> SampleLog {
    let mut text = "stamp_ns,latitude_deg,longitude_deg\n".to_owned();
    for k in 0..60 {
        let (stamp_ns, longitude) = (stamp_ns(k), -1.2 + 1.447e-4 * k as f64);
        let other = row(k, stamp_ns, longitude);
        text += &other.unwrap_or_else(|| format!("{stamp_ns},51.7,{longitude:.8}"));
        text += "\n";
    }
    read(Gnss, "gnss.csv", &text).unwrap()
}

fn stamp_ns(k: usize) -> i64 {
    START_NS + k as i64 * 1_000_000_000
}

#[test]
fn each_fault_is_counted_under_its_name_and_left_out() {
    let log = drive(|_, _, _| None);
    let east_m = log.samples[59].values[0];
    assert!((east_m - 590.0).abs() < 1.0, "{east_m}");
    let frozen = "51.7,-1.19869770";
    for (name, rows, place) in [
        ("unreadable", 20..21, "51.7,-1.19,"),
        ("without a fix", 9..12, ","),
        ("not a number", 5..8, "nan,-1.2"),
        ("at 0, 0", 0..4, "0,0.0"),
        ("off the earth", 0..1, "517.0,-1.2"),
        ("repeated", 30..31, "51.7,-1.19"),
        // As the 9th fix.
        ("at the very place of the fix before", 10..36, frozen),
        ("jump faster than a vehicle", 10..22, "51.709,"),
        ("jump faster than a vehicle", 0..1, "40.0,"),
    ] {
        let log = drive(|k, ns, longitude| {
            let back_ns = if name == "repeated" { 1_000_000_000 } else { 0 };
            let longitude = match name.starts_with("jump") {
                true => longitude.to_string(),
                false => String::new(),
            };
            let row = format!("{},{place}{longitude}", ns - back_ns);
            rows.contains(&k).then_some(row)
        });
        let count = rows.len();
        assert_eq!(log.faults.named(Gnss), [format!("{count} {name}")]);
        assert_eq!(log.samples.len(), 60 - count, "{name}");
        // The plane touches at a fix that is used.
        let origin = log.plane.unwrap().origin();
        assert_eq!(origin.latitude_deg, 51.7, "{name}");
    }
}

#[test]
fn fixes_that_come_out_of_order_are_sorted_and_counted() {
    let log = drive(|k, _, _| {
        let k = match k {
            40 => 41,
            41 => 40,
            _ => return None,
        };
        let longitude = -1.2 + 1.447e-4 * k as f64;
        Some(format!("{},51.7,{longitude:.8}", stamp_ns(k)))
    });
    assert_eq!((log.samples.len(), log.faults.out_of_order), (60, 1));
    assert!(log.samples.is_sorted_by_key(|fix| fix.stamp_ns));
    assert!(log.samples.is_sorted_by_key(|fix| fix.values[0]));
}

#[test]
fn what_a_live_receiver_has_sent_may_be_nothing_usable_and_then_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let header = "stamp_ns,latitude_deg,longitude_deg,sigma_m\n";
    for (text, reason) in [
        ("", "it is empty"),
        (header, "none of its 0 entries"),
        (&format!("{header}17,,,0\n"), "1 without a fix"),
        (&format!("{header}unreadable\n"), "none of its 1 entries"),
    ] {
        let path = written(&folder, "gnss.csv", text);
        let log = SampleLog::received(&path);
        let unusable = log.unusable.unwrap();
        assert!(log.samples.is_empty());
        assert!(unusable.contains(reason), "{unusable}");
    }
    let text = format!("{header}{START_NS},51.7,-1.2,0\nunreadable\n17,51.8,-1.2,0.5\n");
    let log = SampleLog::received(&written(&folder, "gnss.csv", &text));
    assert_eq!((log.unusable, log.faults.unreadable), (None, 1));
    assert_eq!(log.faults.out_of_order, 1);
    assert_eq!(log.samples.len(), 2);
    let noisy = format!("{text}unreadable\nunreadable,1\nlost,5\nlost,2\n");
    let log = SampleLog::received(&written(&folder, "gnss.csv", &noisy));
    assert_eq!((log.samples.len(), log.faults.unreadable), (2, 3));
    assert_eq!(
        (log.faults.lost, &log.fault_figures()["lost"]),
        (7, &7.into())
    );
    let missing = SampleLog::received(&folder.path().join("none.csv"));
    assert!(missing.unusable.unwrap().contains("none.csv"));
}

#[test]
fn a_log_that_grows_is_read_on_to_what_it_is_as_a_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gnss.csv");
    let mut text = "stamp_ns,latitude_deg,longitude_deg,sigma_m\n".to_owned();
    std::fs::write(&path, &text).unwrap();
    let mut received = ReceivedFixes::read(&path).unwrap();
    for rows in [100, 0, 1, 1, 2] {
        let before = text.len();
        for _ in 0..rows {
            let k = text.lines().count() as i64;
            let (ns, longitude) = (START_NS + k * 10_000_000, 1e-8 * k as f64);
            text += &match k % 20 {
                0 => "unreadable,3\n".to_owned(),
                _ => format!("{ns},51.7,{longitude:.8},0.5\n"),
            };
        }
        std::fs::write(&path, &text).unwrap();
        received.add(&text[before..]);
        let (log, whole) = (received.log(), SampleLog::read(Gnss, &path, None));
        assert_eq!(received.count(), log.samples.len());
        if rows > 0 {
            let whole = whole.unwrap();
            assert_eq!((log.samples, log.faults), (whole.samples, whole.faults));
        }
    }
    assert!(received.log().faults.unreadable >= 3);
}

#[test]
fn a_recording_has_the_log_of_its_own_name_before_one_of_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let recording = written(&folder, "drive.mcap", "");
    let of_folder = written(&folder, "gnss.csv", "");
    assert_eq!(SampleLog::find(Gnss, &recording).unwrap(), of_folder);
    let own = written(&folder, "drive.gnss.csv", "");
    assert_eq!(SampleLog::of_recording(&recording), own);
    assert_eq!(SampleLog::find(Gnss, &recording).unwrap(), own);
    assert_eq!(SampleLog::find(Gnss, folder.path()).unwrap(), of_folder);
}
