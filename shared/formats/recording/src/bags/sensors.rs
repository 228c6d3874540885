//! Sensors beside the radar: the topics of a bag that are of one, by their types, and their
//! messages.

use std::{collections::BTreeMap, path::Path};

use gyre_datasets::OpenError;
use gyre_geometry::samples::{BagFixes, RawFix, Sample, SampleKind};
use gyre_ros2_messages::{
    geometry_msgs::TwistStamped,
    nav_msgs::Odometry,
    sensor_msgs::{Imu, NavSatFix},
};

use crate::bags::{
    Message, RecordingError,
    bag::{Bag, Key},
    files::files,
    topics::of,
};

type Decode<T> = fn(&Message) -> Result<T, String>;

/// A sensor, and how its messages become measurements.
struct Sensor<T: 'static> {
    /// The section of its settings, such as `gyro`.
    section: &'static str,
    /// The measurements in words, such as `samples of the gyro`.
    measurements: &'static str,
    types: &'static [(&'static str, Decode<T>)],
}

const GYRO: Sensor<Sample> = Sensor {
    section: SampleKind::Gyro.section(),
    measurements: "samples of the gyro",
    types: &[("sensor_msgs/msg/Imu", |it| {
        Ok(of::<Imu>(it)?.sample(it.log_ns))
    })],
};

const WHEELS: Sensor<Sample> = Sensor {
    section: SampleKind::Wheels.section(),
    measurements: "samples of the wheels",
    types: &[
        ("nav_msgs/msg/Odometry", |it| {
            Ok(of::<Odometry>(it)?.sample(it.log_ns))
        }),
        ("geometry_msgs/msg/TwistStamped", |it| {
            Ok(of::<TwistStamped>(it)?.sample(it.log_ns))
        }),
    ],
};

/// A message has a fix, or reports that there is no fix.
const RECEIVER: Sensor<Option<RawFix>> = Sensor {
    section: "gnss",
    measurements: "fixes of a GNSS receiver",
    types: &[("sensor_msgs/msg/NavSatFix", |it| {
        Ok(of::<NavSatFix>(it)?.fix(it.log_ns))
    })],
};

/// Reads all samples of a sensor on the topic of this name, else on the only topic of its types; in
/// the sensor's own axes and on the clock of its driver, in the order of the bag. `None` without
/// such a topic.
///
/// The topic of the wheels must be named: odometry may be of anything, as the radar's own in a bag
/// that Gyre has exported.
pub(crate) fn samples(
    bag: &mut Bag,
    path: &Path,
    kind: SampleKind,
    wished: Option<&str>,
) -> Result<Option<Vec<Sample>>, RecordingError> {
    let sensor = match kind {
        SampleKind::Gyro => GYRO,
        SampleKind::Wheels => WHEELS,
    };
    let speeds = listed(&WHEELS.topics(bag));
    if kind == SampleKind::Wheels && wished.is_none() && !speeds.is_empty() {
        let reason = format!(
            "has speeds on {speeds}: name the topic that is of wheels with wheels.topic, since odometry may be of anything, as the radar's own in a bag that Gyre has exported"
        );
        return Err(RecordingError::unreadable(path, reason));
    }
    let found = sensor.read(bag, path, wished)?;
    Ok(found.map(|(_, samples)| samples))
}

/// Reads the fixes of a bag without its scans, on the topic of this name, else on the only topic of
/// such messages. `None` without such a topic.
pub fn fixes(path: &Path, topic: Option<&str>) -> Result<Option<BagFixes>, OpenError> {
    let mut bag = Bag::open(path, &files(path)?)?;
    Ok(fixes_of(&mut bag, path, topic)?)
}

pub(crate) fn fixes_of(
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

/// The topic of measurements, and those in the order of their log times.
type Measured<T> = (String, Vec<T>);

impl<T> Sensor<T> {
    /// Reads all measurements on the topic of this name, else on the only topic of the sensor's
    /// types. `None` without such a topic. Damaged parts of the bag are skipped, as for scans.
    fn read(
        &self,
        bag: &mut Bag,
        path: &Path,
        wished: Option<&str>,
    ) -> Result<Option<Measured<T>>, RecordingError> {
        let Some((topic, decode)) = self.choose(bag, path, wished)? else {
            return Ok(None);
        };
        let (mut measurements, mut refused) = (Vec::new(), None);
        let each = |_: &Bag, _: Key, message: &Message| {
            match decode(message) {
                Ok(measurement) => measurements.push(measurement),
                Err(reason) => refused = Some(reason),
            }
            refused.is_none()
        };
        bag.read_in_order(|channel| channel.topic == topic, each)?;
        if let Some(reason) = refused {
            let of = self.measurements;
            let reason = format!("has messages on {topic} that are no {of}: {reason}");
            return Err(RecordingError::unreadable(path, reason));
        }
        Ok(Some((topic, measurements)))
    }

    /// Returns the topics that may be of the sensor. Of their types the package does not count.
    fn topics(&self, bag: &Bag) -> BTreeMap<String, Decode<T>> {
        let name = |of: &str| of.rsplit_once('/').map(|(_, name)| name.to_owned());
        let decode = |type_name: &str| {
            let mut known = self.types.iter();
            let found = known.find(|(known, _)| name(known) == name(type_name));
            found.map(|(_, decode)| *decode)
        };
        let channels = bag.channels().into_iter();
        channels
            .filter_map(|channel| Some((channel.topic.clone(), decode(&channel.type_name)?)))
            .collect()
    }

    fn choose(
        &self,
        bag: &Bag,
        path: &Path,
        wished: Option<&str>,
    ) -> Result<Option<(String, Decode<T>)>, RecordingError> {
        let mut topics = self.topics(bag);
        let (section, of) = (self.section, self.measurements);
        let reason = match wished {
            Some(wished) => match topics.remove_entry(wished) {
                Some(found) => return Ok(Some(found)),
                None => self.why_not(wished, &topics),
            },
            None if topics.len() > 1 => {
                let listed = listed(&topics);
                format!("has {of} on several topics, {listed}: choose one with {section}.topic")
            }
            None => return Ok(topics.pop_first()),
        };
        Err(RecordingError::unreadable(path, reason))
    }

    fn why_not(&self, wished: &str, topics: &BTreeMap<String, Decode<T>>) -> String {
        let names: Vec<&str> = self.types.iter().map(|(name, _)| *name).collect();
        let (names, section) = (names.join(" or "), self.section);
        let others = match topics.is_empty() {
            true => ", and on no other one".to_owned(),
            false => format!(", but on: {}", listed(topics)),
        };
        format!("has no messages of {names} on the topic {wished} ({section}.topic){others}")
    }
}

fn listed<T>(topics: &BTreeMap<String, T>) -> String {
    let names: Vec<&str> = topics.keys().map(String::as_str).collect();
    names.join(", ")
}
