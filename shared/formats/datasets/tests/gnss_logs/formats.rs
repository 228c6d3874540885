//! Formats.

use gyre_datasets::GnssLog;
use gyre_geometry::samples::GnssConfig;
use tempfile::TempDir;

use super::{START_NS, read};
use crate::common::{assert_refused, written};

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
