//! Logs of the wheels' speed.

use gyre_datasets::{LogError, WheelLog};
use proptest::prelude::*;
use tempfile::TempDir;

use super::{START_NS, written};

const MS: i64 = 1_000_000;

fn read(text: &str) -> Result<WheelLog, LogError> {
    let folder = TempDir::new().unwrap();
    WheelLog::read(&written(&folder, "wheels.csv", text))
}

/// Rows of 20 Hz, each with a speed.
fn rows(header: &str, speeds: &[&str]) -> String {
    let stamp = |k: i64| START_NS + 50 * MS * k;
    let rows = (0..)
        .zip(speeds)
        .map(|(k, speed)| format!("{},{speed}\n", stamp(k)));
    format!("{header}\n{}", rows.collect::<String>())
}

fn speeds(log: &WheelLog) -> Vec<f64> {
    log.samples.iter().map(|sample| sample.values[0]).collect()
}

#[test]
fn columns_are_found_by_their_names_and_units() {
    for (header, expected, assumed) in [
        ("stamp_ns,speed_m_s", 9.0, false),
        ("timestamp,wheel_speed_mps", 9.0, false),
        ("stamp_ns,speed_km_h", 2.5, false),
        ("# stamp_ns, vehicle speed [km/h]", 2.5, false),
        ("stamp_ns;velocity", 9.0, true),
    ] {
        let text = rows(header, &["9.0", "-9.0"]);
        let text = if header.contains(';') {
            text.replace(',', ";")
        } else {
            text
        };
        let log = read(&text).unwrap_or_else(|error| panic!("{header}: {error}"));
        let found = speeds(&log);
        assert!(
            (found[0] - expected).abs() < 1e-12 && found[1] == -found[0],
            "{header} {found:?}"
        );
        assert_eq!(log.faults.unit_is_assumed, assumed, "{header}");
        assert_eq!(log.samples[1].stamp_ns, START_NS + 50 * MS);
    }
}

#[test]
fn what_is_no_log_of_wheels_is_refused_with_the_remedy() {
    for (text, words) in [
        (rows("stamp_ns,gyro_z_radps", &["0.1"]), "have no speed"),
        (rows("number,speed_m_s", &["1"]), "have no stamps"),
        (rows("1,2", &["1"]), "have no speed"),
        (String::new(), "it is empty"),
    ] {
        let refused = read(&text).unwrap_err().to_string();
        assert!(
            refused.contains("is no log of the wheels") && refused.contains(words),
            "{refused}"
        );
    }
    let fast = read(&rows("stamp_ns,speed", &["120", "121"]))
        .unwrap_err()
        .to_string();
    assert!(fast.contains("if they are in km/h"), "{fast}");
    let empty = read("stamp_ns,speed_m_s\n").unwrap_err().to_string();
    assert!(empty.contains("it has no samples"), "{empty}");
}

#[test]
fn the_log_lies_beside_the_scans() {
    let folder = TempDir::new().unwrap();
    let missing = WheelLog::find(folder.path()).unwrap_err().to_string();
    assert!(
        missing.contains("no log of the wheels lies beside the scans"),
        "{missing}"
    );
    let path = written(&folder, "wheels.csv", "");
    assert_eq!(WheelLog::find(&folder.path().join("radar")).unwrap(), path);
    assert_eq!(WheelLog::find(folder.path()).unwrap(), path);
}

proptest! {
    /// Rows that are no numbers, repeated stamps and absurd speeds are left out and counted, and
    /// the others stay, in the order of their stamps.
    #[test]
    fn faults_are_counted_and_leave_the_other_samples_alone(
        faults in prop::collection::vec(0usize..40, 200..400),
    ) {
        let mut text = "stamp_ns,speed_m_s\n".to_owned();
        let (mut kept, mut left_out) = (Vec::new(), 0);
        for (k, fault) in (0..).zip(&faults) {
            let (stamp, speed) = (START_NS + 50 * MS * k, k as f64 * 0.01);
            let row = match fault {
                0 => format!("{stamp},nan"),
                1 => format!("{stamp}"),
                2 => format!("{stamp},inf"),
                3 => format!("{stamp},speed"),
                _ => {
                    kept.push(speed);
                    format!("{stamp},{speed}")
                }
            };
            left_out += usize::from(*fault < 4);
            text += &row;
            text += "\n";
            if *fault == 4 {
                left_out += 1;
                text += &row;
                text += "\n";
            }
        }
        let log = read(&text).unwrap();
        prop_assert_eq!(speeds(&log), kept);
        prop_assert_eq!(log.faults.left_out(), left_out);
    }
}
