//! The fixes of a GNSS receiver in a bag: messages of the type `sensor_msgs/msg/NavSatFix`.

use std::path::Path;

use gyre_datasets::OpenError;
use gyre_geometry::samples::{BagFixes, RawFix};
use gyre_ros2_messages::sensor_msgs::NavSatFix;

use crate::bags::{RecordingError, azimuths::of, bag::Bag, files::files, sensors::Sensor};

/// A message has a fix, or reports that there is no fix.
const RECEIVER: Sensor<Option<RawFix>> = Sensor {
    section: "gnss",
    measurements: "fixes of a GNSS receiver",
    types: &[("sensor_msgs/msg/NavSatFix", |it| {
        Ok(of::<NavSatFix>(it)?.fix(it.log_ns))
    })],
};

/// Reads the fixes of a bag without its scans, on the topic of this name, else on the only topic of
/// such messages. `None` without such a topic.
pub fn fixes(path: &Path, topic: Option<&str>) -> Result<Option<BagFixes>, OpenError> {
    let mut bag = Bag::open(path, &files(path)?)?;
    Ok(read(&mut bag, path, topic)?)
}

pub(crate) fn read(
    bag: &mut Bag,
    path: &Path,
    wished: Option<&str>,
) -> Result<Option<BagFixes>, RecordingError> {
    let Some((topic, messages)) = RECEIVER.read(bag, path, wished)? else {
        return Ok(None);
    };
    let count = messages.len();
    let fixes: Vec<RawFix> = messages.into_iter().flatten().collect();
    Ok(Some(BagFixes {
        topic,
        without_fix: count - fixes.len(),
        fixes,
    }))
}
