//! Faults: each is counted under its name, and what it is of is left out.

use gyre_datasets::{GnssFaults, GnssLog};

use super::{START_NS, read};

/// A log at 10 m/s to the east, a fix a second, with changes to some rows.
fn drive(change: impl Fn(usize, &mut [String; 3])) -> GnssLog {
    let mut text = "stamp_ns,latitude_deg,longitude_deg\n".to_owned();
    for k in 0..60 {
        let stamp_ns = START_NS + k as i64 * 1_000_000_000;
        let mut row = [
            stamp_ns.to_string(),
            "51.7".to_owned(),
            format!("{:.8}", -1.2 + 1.447e-4 * k as f64),
        ];
        change(k, &mut row);
        text += &(row.join(",") + "\n");
    }
    read("gnss.csv", &text).unwrap()
}

#[test]
fn a_log_without_faults_keeps_all() {
    let log = drive(|_, _| {});
    assert_eq!((log.fixes.len(), &log.faults), (60, &GnssFaults::default()));
    let east_m = log.fixes[59].east_north_m[0];
    assert!((east_m - 590.0).abs() < 1.0, "{east_m}");
}

/// A change of rows with its name, the count that must report it, and that count.
type Fault = (
    &'static str,
    fn(usize, &mut [String; 3]),
    fn(&GnssFaults) -> usize,
    usize,
);

#[test]
fn each_fault_is_counted_under_its_name_and_left_out() {
    let faults: [Fault; 8] = [
        (
            "a row that is cut off",
            |k, row| {
                if k == 20 {
                    row[2] = "-1.19,".to_owned();
                }
            },
            |faults| faults.unreadable,
            1,
        ),
        (
            "a stamp alone",
            |k, row| {
                if k % 20 == 9 {
                    (row[1], row[2]) = (String::new(), String::new());
                }
            },
            |faults| faults.without_fix,
            3,
        ),
        (
            "not a number",
            |k, row| {
                if k % 20 == 5 {
                    row[1] = "nan".to_owned();
                }
            },
            |faults| faults.not_a_number,
            3,
        ),
        (
            "no fix",
            |k, row| {
                if k < 4 {
                    (row[1], row[2]) = ("0".to_owned(), "0.0".to_owned());
                }
            },
            |faults| faults.zero,
            4,
        ),
        (
            "off the earth",
            |k, row| {
                if k == 0 {
                    row[1] = "517.0".to_owned();
                }
            },
            |faults| faults.off_the_earth,
            1,
        ),
        (
            "repeated",
            |k, row| {
                if k == 30 {
                    row[0] = (START_NS + 29_000_000_000).to_string();
                }
            },
            |faults| faults.repeated,
            1,
        ),
        (
            "a stretch 1 km aside",
            |k, row| {
                if (10..22).contains(&k) {
                    row[1] = "51.709".to_owned();
                }
            },
            |faults| faults.jumps,
            12,
        ),
        (
            "the first is elsewhere",
            |k, row| {
                if k == 0 {
                    row[1] = "40.0".to_owned();
                }
            },
            |faults| faults.jumps,
            1,
        ),
    ];
    for (name, change, count, expected) in faults {
        let log = drive(change);
        assert_eq!(count(&log.faults), expected, "{name}: {:?}", log.faults);
        assert_eq!(log.faults.left_out(), expected, "{name}: {:?}", log.faults);
        assert_eq!(log.fixes.len(), 60 - expected, "{name}");
        assert_eq!(log.faults.named().len(), 1, "{name}");
        // The plane touches at a fix that is used.
        let origin = log.plane.unwrap().origin();
        assert_eq!(origin.latitude_deg, 51.7, "{name}");
    }
}

#[test]
fn fixes_that_come_out_of_order_are_sorted_and_counted() {
    let log = drive(|k, row| {
        let swapped = match k {
            40 => 41,
            41 => 40,
            _ => k,
        };
        *row = [
            (START_NS + swapped as i64 * 1_000_000_000).to_string(),
            "51.7".to_owned(),
            format!("{:.8}", -1.2 + 1.447e-4 * swapped as f64),
        ];
    });
    assert_eq!((log.fixes.len(), log.faults.out_of_order), (60, 1));
    assert!(log.fixes.is_sorted_by_key(|fix| fix.stamp_ns));
    assert!(
        log.fixes
            .is_sorted_by(|a, b| a.east_north_m[0] < b.east_north_m[0])
    );
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
        let path = super::written(&folder, "gnss.csv", text);
        let log = GnssLog::received(&path);
        let unusable = log.unusable.unwrap();
        assert!(
            log.fixes.is_empty() && unusable.contains(reason),
            "{unusable}"
        );
    }
    let text = format!("{header}{START_NS},51.7,-1.2,0\nunreadable\n17,51.7,-1.2,0.5\n");
    let log = GnssLog::received(&super::written(&folder, "gnss.csv", &text));
    assert_eq!((log.unusable, log.faults.unreadable), (None, 1));
    assert_eq!(log.faults.out_of_order, 1);
    assert_eq!(log.fixes.len(), 2);
    let noisy = format!("{text}unreadable\nunreadable\n");
    let log = GnssLog::received(&super::written(&folder, "gnss.csv", &noisy));
    assert_eq!((log.fixes.len(), log.faults.unreadable), (2, 3));
    let missing = GnssLog::received(&folder.path().join("none.csv"));
    assert!(missing.unusable.unwrap().contains("none.csv"));
}

#[test]
fn a_recording_has_the_log_of_its_own_name_before_one_of_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let recording = super::written(&folder, "drive.mcap", "");
    let of_folder = super::written(&folder, "gnss.csv", "");
    assert_eq!(GnssLog::find(&recording).unwrap(), of_folder);
    let own = super::written(&folder, "drive.gnss.csv", "");
    assert_eq!(GnssLog::of_recording(&recording), own);
    assert_eq!(GnssLog::find(&recording).unwrap(), own);
    assert_eq!(GnssLog::find(folder.path()).unwrap(), of_folder);
}
