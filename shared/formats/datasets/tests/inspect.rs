//! Findings of `inspect` on real and generated datasets.

use crate::common::{
    PERIOD_US, START_US, Sweep, real, write_oxford, write_png, write_radiate, written,
};
use gyre_datasets::{DatasetOptions, Report, inspect};
use serde_json::Value;

fn report(folder: &str) -> Option<Report> {
    let report = inspect(&real(folder)?, &DatasetOptions::default()).unwrap();
    println!("{report}");
    Some(report)
}

/// The figure at a path as in `/timing/stalls`.
fn at<'a>(report: &'a Report, path: &str) -> &'a Value {
    let end = path[1..].find('/').map_or(path.len(), |at| at + 1);
    report.figures[&path[1..end]].pointer(&path[end..]).unwrap()
}

fn number(report: &Report, path: &str) -> f64 {
    at(report, path).as_f64().unwrap()
}

fn count(report: &Report, path: &str) -> usize {
    at(report, path).as_array().unwrap().len()
}

fn mentions(report: &Report, words: &[&str]) -> bool {
    let has_all = |sentence: &String| words.iter().all(|word| sentence.contains(word));
    report.findings.iter().any(has_all)
}

#[track_caller]
fn assert_mentions(report: &Report, words: &[&str]) {
    let findings = &report.findings;
    assert!(mentions(report, words), "{words:?} is not in {findings:#?}");
}

#[test]
fn stalls_stamps_and_transposed_images_of_radiate_are_reported() {
    let Some(report) = report("radiate-2019-02-12") else {
        return;
    };
    assert_eq!(report.scans, 466);
    assert_eq!(at(&report, "/scans_read"), 466);
    let stalls = at(&report, "/timing/stalls").as_array().unwrap();
    assert_eq!(stalls.len(), 7, "{stalls:?}");
    let worst = stalls.iter().map(|s| s["delay_s"].as_f64().unwrap());
    let worst = worst.fold(0.0, f64::max);
    assert!((1.3..1.5).contains(&worst), "{worst}");
    assert_eq!(at(&report, "/timing/missing_scans"), 0);
    let period_s = number(&report, "/timing/period_s");
    assert!((period_s - 0.25002).abs() < 1e-5, "{period_s}");
    assert_mentions(&report, &["stalled 7 times"]);
    assert_mentions(&report, &["transposed", "576"]);
    assert_mentions(&report, &["Range bins 0 to 10", "ringing"]);
    assert_eq!(at(&report, "/transposed"), true);
    assert!((number(&report, "/max_range_m") - 99.9).abs() < 0.1);
    assert!((number(&report, "/gyro/rate_hz") - 20.0).abs() < 0.1);
    assert!((0.05..0.06).contains(&number(&report, "/gyro/missing")));
    // Gravity is taken out.
    assert!(at(&report, "/gyro/up_by_gravity").is_null());
    assert_mentions(&report, &["missing in 13 places, for up to 0.80 s"]);
}

#[test]
fn resolution_and_bursts_of_oxford_are_reported() {
    let Some(report) = report("oxford-2019-01-10-14-36-48") else {
        return;
    };
    assert_mentions(&report, &["0.0438 m", "0.0432"]);
    assert_mentions(&report, &["bursts"]);
    let rows = at(&report, "/rows");
    let [all, not_measured, lost] = ["rows", "not_measured", "lost"].map(|it| &rows[it]);
    assert_eq!([all, not_measured, lost], [4400, 0, 0]);
    assert!((number(&report, "/rows/first_azimuth_deg/0") - 0.836).abs() < 1e-3);
    let truth = &at(&report, "/ground_truths")[0];
    assert_eq!([&truth["poses"], &truth["scans_covered"]], [11, 11]);
    let nearest_s = truth["nearest_pose_s"].as_f64().unwrap();
    assert!(nearest_s < 2e-3, "{truth:?}");
}

#[test]
fn boreas_rt_and_fomo_are_reported() {
    let Some(rt) = report("samples/boreas-rt-2024-12-03") else {
        return;
    };
    assert_eq!(rt.format.name(), "boreas-rt");
    assert_eq!(at(&rt, "/rows/chirps"), "alternating");
    assert_eq!(at(&rt, "/rows/not_measured"), 0);
    assert_mentions(&rt, &["Byte 10 alternates", "chirp"]);
    assert_mentions(&rt, &["only one scan"]);
    let fomo = report("samples/fomo-2025-10-14").unwrap();
    assert_eq!(fomo.format.name(), "fomo");
    assert_eq!(at(&fomo, "/rows/chirps"), "unknown");
    assert_eq!(at(&fomo, "/rows/not_measured"), 0);
    assert_mentions(&fomo, &["only one scan"]);
    assert_mentions(&fomo, &["Byte 10 is 0"]);
    assert_mentions(&fomo, &["gt.txt", "positions only"]);
    assert!(!mentions(&fomo, &["encoder"]), "{:?}", fomo.findings);
}

#[test]
fn gaps_lost_rows_and_damaged_files_are_counted() {
    let root = tempfile::tempdir().unwrap();
    let files = write_oxford(root.path(), 12);
    std::fs::remove_file(&files[4]).unwrap();
    let whole = std::fs::read(&files[7]).unwrap();
    std::fs::write(&files[7], &whole[..whole.len() / 2]).unwrap();
    // Every tenth row interpolated, and one lost: since all images must have 40 rows, the last step
    // is double.
    let sweep = Sweep {
        byte_ten: |row| if row % 10 == 3 { 0 } else { 255 },
        ..Sweep::at(START_US + 9 * PERIOD_US)
    };
    let mut pixels = sweep.pixels();
    for row in 20..39 {
        let count = 13 + (row as u16 + 1) * 140;
        pixels[row * sweep.width() + 8..][..2].copy_from_slice(&count.to_le_bytes());
    }
    pixels[39 * sweep.width() + 8..][..2].copy_from_slice(&5_u16.to_le_bytes());
    write_png(&files[9], sweep.width(), sweep.rows, &pixels);
    let report = inspect(root.path(), &DatasetOptions::default()).unwrap();
    assert_eq!(report.scans, 11);
    assert_eq!(at(&report, "/timing/missing_scans"), 1);
    assert_eq!(at(&report, "/timing/gaps/0/scan"), 4);
    assert_eq!(count(&report, "/timing/stalls"), 0);
    assert_eq!(count(&report, "/unreadable"), 1);
    assert_eq!(at(&report, "/unreadable/0/scan"), 6);
    assert_eq!(at(&report, "/rows/not_measured"), 4);
    assert_eq!(at(&report, "/rows/lost"), 1);
    assert_mentions(&report, &["1 scan is missing, before scans 4"]);
    assert_mentions(&report, &["truncated"]);
    let json = serde_json::to_string(&report).unwrap();
    assert!(json.contains("\"missing_scans\":1") && json.contains("\"format\":\"oxford\""));
}

#[test]
fn a_dataset_without_faults_has_few_findings() {
    let root = tempfile::tempdir().unwrap();
    write_radiate(root.path(), 9);
    // What macOS stores beside a file is no ground truth.
    std::fs::write(root.path().join("._ground_truth.tum"), "Mac OS X").unwrap();
    let report = inspect(root.path(), &DatasetOptions::default()).unwrap();
    for list in [
        "/ground_truths",
        "/timing/stalls",
        "/timing/gaps",
        "/timing/backwards",
        "/unreadable",
    ] {
        assert_eq!(count(&report, list), 0, "{list}");
    }
    assert!(!mentions(&report, &["stalled"]) && !mentions(&report, &["lost"]));
    assert_mentions(&report, &["No ground truth"]);
}

#[test]
fn the_log_of_a_gyro_is_told_with_its_span_and_faults() {
    let folder = tempfile::tempdir().unwrap();
    write_oxford(folder.path(), 8);
    let plain = inspect(folder.path(), &DatasetOptions::default()).unwrap();
    assert!(at(&plain, "/gyro").is_null() && !plain.to_string().contains("gyro"));
    let first_ns = at(&plain, "/timing/first_ns").as_i64().unwrap();
    // 100 Hz for 10 s from half a second before the first scan; x points up; it turns for 4 s.
    let rows = (0..1000).filter(|k| !(700..720).contains(k)).map(|k| {
        let stamp_ns = first_ns - 500_000_000 + 10_000_000 * k;
        let turning = 0.2 * (0.01 * k as f64).sin();
        let rate = if k < 400 { turning } else { 0.01 };
        format!("{stamp_ns},{rate},0,0,9.8,0.1,0.1\n")
    });
    let header = "stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x,accel_y,accel_z\n";
    let text = header.to_owned() + &rows.collect::<String>();
    written(&folder, "imu.csv", &text);
    let report = inspect(folder.path(), &DatasetOptions::default()).unwrap();
    println!("{report}");
    assert_eq!(at(&report, "/gyro/samples"), 980);
    assert!((number(&report, "/gyro/rate_hz") - 100.0).abs() < 1e-6);
    assert!((number(&report, "/gyro/missing") - 0.02).abs() < 1e-6);
    let [before, after] = [0, 1].map(|k| number(&report, &format!("/gyro/after_scans_s/{k}")));
    let scans_s = (number(&report, "/timing/last_ns") - first_ns as f64) * 1e-9;
    assert!((before + 0.5).abs() < 1e-6 && (after - (9.49 - scans_s)).abs() < 1e-6);
    assert!(number(&report, "/gyro/quiet/after_s") >= 4.0);
    let mean_degps = number(&report, "/gyro/quiet/mean_degps/0");
    assert!((mean_degps - 0.01f64.to_degrees()).abs() < 1e-9);
    assert_mentions(&report, &["Samples are missing in 1 places"]);
    assert_mentions(&report, &["by gravity its axis x points up"]);
    assert_mentions(&report, &["gyre calibrate", "imu.csv"]);
    let line = "imu.csv: 980 samples of 100.0 Hz, 2.0 % missing";
    assert!(report.to_string().contains(line));
    written(&folder, "imu.csv", "a,b\n");
    let report = inspect(folder.path(), &DatasetOptions::default()).unwrap();
    assert_mentions(&report, &["cannot be used", "no angular rates"]);
}

#[test]
fn the_logs_of_wheels_and_gnss_are_told_with_what_they_say_and_their_faults() {
    let folder = tempfile::tempdir().unwrap();
    write_oxford(folder.path(), 8);
    let examine = || inspect(folder.path(), &DatasetOptions::default()).unwrap();
    let first_ns = at(&examine(), "/timing/first_ns").as_i64().unwrap();
    let write = |name: &str, head: &str, row: &dyn Fn(i64) -> String| {
        let rows: String = (0..100).map(row).collect();
        written(&folder, name, &format!("{head}\n{rows}"));
    };
    // 10 Hz at 36 km/h from half a second before the first scan; a fix each, one of them at 0, 0.
    let stamp_ns = |k: i64| first_ns - 500_000_000 + 100_000_000 * k;
    let speed = |k: i64| format!("{},36\n", stamp_ns(k));
    write("wheels.csv", "stamp_ns,speed_km_h", &speed);
    let fix = |k: i64| {
        let place = (51.0 + 9e-6 * k as f64, -1.0);
        let (north, east) = if k == 50 { (0.0, 0.0) } else { place };
        format!("{},{north},{east},0.5\n", stamp_ns(k))
    };
    let header = "stamp_ns,latitude_deg,longitude_deg,sigma_m";
    write("gnss.csv", header, &fix);
    let report = examine();
    println!("{report}");
    for (path, expected, within) in [
        ("/wheels/path_m", 99.0, 1e-6),
        ("/wheels/fastest_mps", 10.0, 1e-6),
        ("/wheels/rate_hz", 10.0, 1e-6),
        ("/gnss/reach_m", 99.1, 0.3),
        ("/gnss/samples", 99.0, 0.0),
        ("/gnss/sigma_m", 0.5, 0.0),
    ] {
        let found = number(&report, path);
        assert!((found - expected).abs() <= within, "{path}: {found}");
    }
    assert_eq!(at(&report, "/gnss/on_the_earth"), true);
    assert_mentions(&report, &["left out, or sorted: 1 at 0, 0"]);
    assert_mentions(&report, &["wheels.csv", "wheels.kind"]);
    assert_mentions(&report, &["gnss.csv", "gnss.kind"]);
    write("wheels.csv", "stamp_ns,colour", &|k| format!("{k},1\n"));
    write("gnss.csv", "stamp_ns,colour", &|k| format!("{k},1\n"));
    let report = examine();
    assert_mentions(
        &report,
        &["of the wheels, wheels.csv, cannot be used", "no speed"],
    );
    assert_mentions(&report, &["GNSS receiver", "cannot be used"]);
}
