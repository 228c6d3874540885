//! Logs of GNSS receivers of every format, as written here after the public development kits, and
//! their faults: each is counted under its name, and the faulty row is left out.

use gyre_datasets::{GnssLog, LogError, ReceivedFixes};
use gyre_geometry::samples::GnssConfig;
use tempfile::TempDir;

use crate::common::{assert_refused, written};

/// 2025-10-14, ns.
const START_NS: i64 = 1_760_456_485_551_626_000;

/// Reads a text as a file of this name.
fn read(name: &str, text: &str) -> Result<GnssLog, LogError> {
    let folder = TempDir::new().unwrap();
    let path = written(&folder, name, text);
    GnssLog::read(&path)
}

/// Two fixes a second apart, the second 11.13 m north of the first, with these deviations.
fn assert_two(log: &GnssLog, sigma_m: Option<f64>, what: &str) {
    let [first, second] = &log.fixes[..] else {
        panic!("{what}: {log:?}");
    };
    let stamps = [first.stamp_ns, second.stamp_ns];
    assert_eq!(stamps, [START_NS, START_NS + 1_000_000_000], "{what}");
    assert_eq!(first.east_north_m, [0.0, 0.0], "{what}");
    let [east, north] = second.east_north_m;
    let is_north = east.abs() < 1e-6 && (north - 11.134).abs() < 0.001;
    assert!(is_north, "{what}: {east} {north}");
    for fix in [first, second] {
        let off_m = fix.sigma_m.unwrap_or(-1.0) - sigma_m.unwrap_or(-1.0);
        assert!(off_m.abs() < 1e-9, "{what}: {off_m}");
    }
    let origin = log.plane.unwrap().origin();
    assert_eq!([origin.latitude_deg, origin.longitude_deg], [55.9, -3.2]);
    let faults = &log.faults;
    let named = faults.named().into_iter();
    let mut left_out = named.filter(|(_, name)| !name.contains("used"));
    assert!(left_out.all(|(_, name)| name == "without a fix"), "{what}");
    let stated = usize::from(what.contains("status"));
    let counted = [
        faults.without_fix,
        faults.of_unknown_status,
        faults.too_certain,
    ];
    assert_eq!(counted, [stated; 3], "{what}");
}

#[test]
fn tables_are_read_by_their_headers_or_by_their_number_of_columns() {
    // The file, the deviation, the text.
    for case in [
        "gnss.csv||stamp_ns,latitude_deg,longitude_deg\n1760456485551626000,55.9,-3.2\n1760456486551626000,55.9001,-3.2\n",
        "gnss.csv|0.3|lon;lat;timestamp;sigma_m\n-3.2;55.9;1760456485551626;0.3\n-3.2;55.9001;1760456486551626;0.3\n",
        "gps/gps.csv|3.5355339059|timestamp,num_satellites,latitude,longitude,altitude,latitude_sigma,longitude_sigma,altitude_sigma,northing,easting,down,utm_zone\n\
         1760456485551626,8,55.9,-3.2,110.0,3.0,4.0,9.0,5.0,6.0,-110.0,30U\n1760456486551626,8,55.9001,-3.2,110.0,3.0,4.0,9.0,5.0,6.0,-110.0,30U\n",
        // Hemispheres, a stamp in two parts; an altitude and an accuracy that are not known.
        "gnss.csv||header.stamp.sec,header.stamp.nanosec,lat,N/S,lon,E/W,alt,sigma_m\n\
         1760456485,551626000,55.9,N,3.2,W,,\n1760456486,551626000,55.9001,n,3.2,West,20.0,-1\n",
        // As stated by a simulation, and as of no receiver.
        "gnss.csv|0.01|stamp_ns,latitude_deg,longitude_deg,sigma_m,status.status\n1760456485551626000,55.9,-3.2,0.0000127,-2\n1760456486551626000,55.9001,-3.2,0.01,2\n1,0,0,0,-1\n",
        "sensor_data/gps.csv|3.1622776602|1760456485551626000,55.9,-3.2,60.0,4.0,0,0,0,16.0,0,0,0,9.0\n1760456486551626000,55.9001,-3.2,60.0,4.0,0,0,0,16.0,0,0,0,9.0\n",
        "sensor_data/gps.csv||1760456485551626000,55.9,-3.2,60.0,0,0,0,0,0,0,0,0,0\n1760456486551626000,55.9001,-3.2,60.0,0,0,0,0,0,0,0,0,0\n",
    ] {
        let parts: Vec<&str> = case.split('|').collect();
        let log = read(parts[0], parts[2]).unwrap();
        assert_two(&log, parts[1].parse().ok(), case);
    }
}

#[test]
fn a_folder_of_radiate_is_read_with_its_list_of_times() {
    let folder = TempDir::new().unwrap();
    let line = |frame, s| format!("Frame: {frame:06} Time: {s}.551626000\n");
    let list = line(1, 1_760_456_485) + &line(2, 1_760_456_486);
    written(&folder, "GPS_IMU_Twist.txt", &list);
    let rest = "0,0,0,1\n".to_owned() + &" 0,0,0\n".repeat(12);
    for (number, latitude) in [(1, "55.9"), (2, "55.9001")] {
        let text = format!("{latitude},-3.2,80.0\n 0.04,0,0\n 0,0.14,0\n 0,0,1\n{rest}");
        written(&folder, &format!("GPS_IMU_Twist/{number:06}.txt"), &text);
    }
    let path = GnssLog::find(&folder.path().join("Navtech_Polar")).unwrap();
    let log = GnssLog::read(&path).unwrap();
    assert_two(&log, Some(0.3), "RADIATE");
}

#[test]
fn coordinates_in_a_plane_have_no_place_on_the_earth() {
    let table = format!("stamp_ns,east_m,north_m\n{START_NS},3.0,4.0\n");
    for (name, text) in [
        ("gnss.csv", table.as_str()),
        (
            "gnss_as_logged.tum",
            "1760456485.551626000 3.0 4.0 1.0 0 0 0 1\n",
        ),
    ] {
        let log = read(name, text).unwrap();
        assert_eq!(log.fixes[0].stamp_ns, START_NS, "{name}");
        assert_eq!(log.fixes[0].east_north_m, [3.0, 4.0], "{name}");
        assert!(log.plane.is_none(), "{name}");
    }
}

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
    let fixes = read("gnss.csv", &text).unwrap().on_radar(&config);
    assert_eq!(fixes[0].stamp_ns, START_NS - 1_580_000_000);
    assert_eq!([fixes[0].sigma_m, fixes[1].sigma_m], [0.5, 7.0]);
}

#[test]
fn what_is_no_log_is_refused_with_what_to_do() {
    for case in [
        "1,2,3\n|3 columns have no names",
        "stamp_ns,x,y\n|have no positions",
        "latitude,longitude\n|have no stamps",
        "stamp_ns,latitude,longitude\n|none of its 0 entries is a usable fix",
        "stamp_ns,latitude,longitude\na,b,c\n1,2\n5,1,1\n|2 of its 3 rows cannot be read, the first in line 2",
        "stamp_ns,latitude,longitude\n5,50.0S,1.0E\n|in \"5; 50.0S; 1.0E\", write stamps as seconds or nanoseconds since 1970, numbers with decimal points, and degrees to the south and to the west with a minus",
        // A contradiction, and a word that is of no hemisphere.
        "stamp_ns,lat,n_s,lon\n5,-50.0,N,1.0\n6,50.0,?,1.0\n|2 of its 2 rows",
    ] {
        let (text, expected) = case.split_once('|').unwrap();
        assert_refused(read("gnss.csv", text), expected);
    }
    let folder = TempDir::new().unwrap();
    assert_refused(GnssLog::find(folder.path()), "gnss.kind = \"none\"");
}

/// A log at 10 m/s to the east with a fix each second; `row` may return other rows.
fn drive(row: impl Fn(usize, i64, f64) -> Option<String>) -> GnssLog {
    let mut text = "stamp_ns,latitude_deg,longitude_deg\n".to_owned();
    for k in 0..60 {
        let (stamp_ns, longitude) = (stamp_ns(k), -1.2 + 1.447e-4 * k as f64);
        let other = row(k, stamp_ns, longitude);
        text += &other.unwrap_or_else(|| format!("{stamp_ns},51.7,{longitude:.8}"));
        text += "\n";
    }
    read("gnss.csv", &text).unwrap()
}

fn stamp_ns(k: usize) -> i64 {
    START_NS + k as i64 * 1_000_000_000
}

#[test]
fn each_fault_is_counted_under_its_name_and_left_out() {
    let log = drive(|_, _, _| None);
    let east_m = log.fixes[59].east_north_m[0];
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
        assert_eq!(log.faults.named(), [(count, name)]);
        assert_eq!(log.fixes.len(), 60 - count, "{name}");
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
    assert_eq!((log.fixes.len(), log.faults.out_of_order), (60, 1));
    assert!(log.fixes.is_sorted_by_key(|fix| fix.stamp_ns));
    assert!(log.fixes.is_sorted_by_key(|fix| fix.east_north_m[0]));
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
        let log = GnssLog::received(&path);
        let unusable = log.unusable.unwrap();
        assert!(log.fixes.is_empty());
        assert!(unusable.contains(reason), "{unusable}");
    }
    let text = format!("{header}{START_NS},51.7,-1.2,0\nunreadable\n17,51.8,-1.2,0.5\n");
    let log = GnssLog::received(&written(&folder, "gnss.csv", &text));
    assert_eq!((log.unusable, log.faults.unreadable), (None, 1));
    assert_eq!(log.faults.out_of_order, 1);
    assert_eq!(log.fixes.len(), 2);
    let noisy = format!("{text}unreadable\nunreadable,1\n");
    let log = GnssLog::received(&written(&folder, "gnss.csv", &noisy));
    assert_eq!((log.fixes.len(), log.faults.unreadable), (2, 3));
    let missing = GnssLog::received(&folder.path().join("none.csv"));
    assert!(missing.unusable.unwrap().contains("none.csv"));
}

#[test]
fn a_log_that_grows_is_read_on_to_what_it_is_as_a_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gnss.csv");
    let mut received = ReceivedFixes::new(&path);
    let mut text = "stamp_ns,latitude_deg,longitude_deg,sigma_m\n".to_owned();
    for rows in [100, 0, 1, 1, 2] {
        for _ in 0..rows {
            let k = text.lines().count() as i64;
            let (ns, longitude) = (START_NS + k * 10_000_000, 1e-8 * k as f64);
            text += &match k % 20 {
                0 => "unreadable,3\n".to_owned(),
                _ => format!("{ns},51.7,{longitude:.8},0.5\n"),
            };
        }
        std::fs::write(&path, &text).unwrap();
        received.read_on().unwrap();
        let (log, whole) = (received.log(), GnssLog::read(&path));
        assert_eq!(received.count(), log.fixes.len());
        if rows > 0 {
            let whole = whole.unwrap();
            assert_eq!((log.fixes, log.faults), (whole.fixes, whole.faults));
        }
    }
    assert!(received.log().faults.unreadable >= 3);
}

#[test]
fn a_recording_has_the_log_of_its_own_name_before_one_of_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let recording = written(&folder, "drive.mcap", "");
    let of_folder = written(&folder, "gnss.csv", "");
    assert_eq!(GnssLog::find(&recording).unwrap(), of_folder);
    let own = written(&folder, "drive.gnss.csv", "");
    assert_eq!(GnssLog::of_recording(&recording), own);
    assert_eq!(GnssLog::find(&recording).unwrap(), own);
    assert_eq!(GnssLog::find(folder.path()).unwrap(), of_folder);
}
