//! The log of the GNSS receiver that a configuration names.

use std::path::{Path, PathBuf};

use gyre_datasets::{LogError, SampleLog};
use gyre_geometry::samples::{GnssConfig, SampleKind, SensorConfig, SensorKind};

use crate::{
    bags::{self, is_bag},
    parts::first_part_in,
};

const OF: SampleKind = SampleKind::Gnss;

/// Returns the path of the log of a live receiver during the run with its results in `out`.
pub fn received_fixes(out: &Path) -> PathBuf {
    out.join("journal/gnss.csv")
}

/// Reads the log that the section `[gnss]` names for the scans at `data`; for a live receiver, its
/// log so far during the run with its results in `out`; `None` without GNSS.
pub fn gnss_log(
    config: &GnssConfig,
    data: &Path,
    out: &Path,
) -> Result<Option<SampleLog>, LogError> {
    match config.kind {
        SensorKind::None => Ok(None),
        SensorKind::Auto => of_scans(config.topic(), data).map(Some),
        SensorKind::Log => read(config.file()).map(Some),
        SensorKind::Udp | SensorKind::Ros2 => Ok(Some(SampleLog::received(&received_fixes(out)))),
    }
}

/// Returns a table of the fixes that `gnss.kind = "auto"` takes with the scans at `data`, for a
/// recording of the run.
pub fn copied_fixes(config: &GnssConfig, data: &Path) -> Result<String, LogError> {
    let in_bag = match is_bag(data) {
        true => bags::logged(data, OF, config.topic())?,
        false => None,
    };
    match in_bag {
        Some(found) => Ok(SampleLog::table_of_fixes(&found.samples, false)),
        None => {
            let first = first_part_in(data).unwrap_or_else(|| data.to_owned());
            SampleLog::copy_of_fixes(&SampleLog::find(OF, &first)?)
        }
    }
}

fn read(path: &Path) -> Result<SampleLog, LogError> {
    SampleLog::read(OF, path, None)
}

/// Reads the fixes in the bag, else the log beside the scans.
fn of_scans(topic: Option<&str>, data: &Path) -> Result<SampleLog, LogError> {
    let shown = data.display();
    let none_in_bag = |_| {
        LogError::Unusable(format!(
            "the bag {shown} has no messages of sensor_msgs/msg/NavSatFix, and no log of a GNSS receiver lies beside it: name one with gnss.kind = \"log\" and gnss.file, or set gnss.kind = \"none\""
        ))
    };
    match (is_bag(data), topic) {
        (true, _) => match bags::logged(data, OF, topic)? {
            Some(fixes) => SampleLog::of(OF, fixes, data),
            None => read(&SampleLog::find(OF, data).map_err(none_in_bag)?),
        },
        (false, None) => {
            let first = first_part_in(data).unwrap_or_else(|| data.to_owned());
            let path = SampleLog::find(OF, &first)?;
            // A live receiver may have sent nothing that can be used.
            match path == SampleLog::of_recording(&first) {
                true => Ok(SampleLog::received(&path)),
                false => read(&path),
            }
        }
        (false, Some(topic)) => Err(LogError::Unusable(format!(
            "gnss.topic is {topic}, but {shown} is no bag of ROS 2: remove it, and the log beside the scans is used"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn auto(topic: Option<&str>) -> GnssConfig {
        GnssConfig {
            kind: SensorKind::Auto,
            topic: topic.map(str::to_owned),
            ..GnssConfig::default()
        }
    }

    #[test]
    fn the_log_is_the_one_that_is_named_or_lies_beside_the_scans() {
        let folder = tempfile::tempdir().unwrap();
        let beside = folder.path().join("gnss.csv");
        let named = folder.path().join("other.csv");
        for file in [&beside, &named] {
            fs::write(file, "stamp_s,east_m,north_m\n7,1,2\n").unwrap();
        }
        let out = folder.path();
        let log = |config: &GnssConfig| gnss_log(config, folder.path(), out).unwrap();
        assert_eq!(log(&auto(None)).unwrap().path, beside);
        let config = GnssConfig {
            kind: SensorKind::Log,
            file: Some(named.clone()),
            ..GnssConfig::default()
        };
        assert_eq!(log(&config).unwrap().path, named);
        let copy = copied_fixes(&auto(None), folder.path()).unwrap();
        fs::write(&named, copy).unwrap();
        assert_eq!(
            log(&config).unwrap().samples,
            log(&auto(None)).unwrap().samples
        );
        assert!(log(&GnssConfig::default()).is_none());
    }

    #[test]
    fn a_recording_has_its_own_fixes_whatever_they_are_and_however_it_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join("drive.mcap");
        fs::write(&recording, "").unwrap();
        let own = SampleLog::of_recording(&recording);
        fs::write(&own, "stamp_ns,latitude_deg,longitude_deg,sigma_m\n7,,,0\n").unwrap();
        let beside = folder.path().join("gnss.csv");
        fs::write(beside, "stamp_s,east_m,north_m\n7,1,2\n").unwrap();
        let of = |data: &Path| of_scans(None, data).unwrap();
        for data in [recording.as_path(), folder.path()] {
            let log = of(data);
            assert_eq!((&log.path, log.faults.without_fix), (&own, 1));
            assert!(log.unusable.is_some());
        }
        fs::remove_file(&recording).unwrap();
        assert_eq!(of(&recording).path, own);
    }

    #[test]
    fn a_topic_of_scans_that_are_in_no_bag_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let refused = gnss_log(&auto(Some("/fix")), at, at).unwrap_err();
        let refused = refused.to_string();
        assert!(refused.contains("gnss.topic is /fix, but"), "{refused}");
    }
}
