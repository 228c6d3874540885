//! Sensors beside the radar: the topics of a bag that are of one, by their types, and their
//! messages.

use std::{collections::BTreeMap, path::Path};

use gyre_datasets::OpenError;
use gyre_geometry::samples::{Logged, Sample, SampleKind};
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

/// Reads a message; `None` of one that states that nothing was measured.
type Decode = fn(&Message) -> Result<Option<Sample>, String>;

/// A kind of sensor that ROS 2 has messages of, and how these become samples.
struct Sensor {
    of: SampleKind,
    /// The measurements in words, such as `samples of the gyro`.
    measurements: &'static str,
    types: &'static [(&'static str, Decode)],
    /// Why a topic of these types is used only if it is named.
    to_be_named: Option<&'static str>,
}

const SENSORS: [Sensor; 3] = [
    Sensor {
        of: SampleKind::Gyro,
        measurements: "samples of the gyro",
        types: &[("sensor_msgs/msg/Imu", |it| {
            Ok(Some(of::<Imu>(it)?.sample(it.log_ns)))
        })],
        to_be_named: None,
    },
    Sensor {
        of: SampleKind::Wheels,
        measurements: "samples of the wheels",
        types: &[
            ("nav_msgs/msg/Odometry", |it| {
                Ok(Some(of::<Odometry>(it)?.sample(it.log_ns)))
            }),
            ("geometry_msgs/msg/TwistStamped", |it| {
                Ok(Some(of::<TwistStamped>(it)?.sample(it.log_ns)))
            }),
        ],
        to_be_named: Some(
            "name the topic that is of wheels with wheels.topic, since odometry may be of anything, as the radar's own in a bag that Gyre has exported",
        ),
    },
    Sensor {
        of: SampleKind::Gnss,
        measurements: "fixes of a GNSS receiver",
        types: &[("sensor_msgs/msg/NavSatFix", |it| {
            Ok(of::<NavSatFix>(it)?.fix(it.log_ns))
        })],
        to_be_named: None,
    },
];

/// Reads the samples of a sensor in a bag without its scans, on the topic of this name, else on the
/// only topic of such messages. `None` without such a topic.
pub fn logged(
    path: &Path,
    of: SampleKind,
    topic: Option<&str>,
) -> Result<Option<Logged>, OpenError> {
    let mut bag = Bag::open(path, &files(path)?)?;
    Ok(samples(&mut bag, path, of, topic)?)
}

/// Reads all samples of a sensor on the topic of this name, else on the only topic of its types; in
/// the sensor's own axes and on the clock of its driver, in the order of the bag. `None` without
/// such a topic. Damaged parts of the bag are skipped, as for scans.
pub(crate) fn samples(
    bag: &mut Bag,
    path: &Path,
    of: SampleKind,
    wished: Option<&str>,
) -> Result<Option<Logged>, RecordingError> {
    let Some(sensor) = SENSORS.iter().find(|sensor| sensor.of == of) else {
        return Ok(None);
    };
    let refuse = |reason: String| Err(RecordingError::unreadable(path, reason));
    let (topic, decode) = match sensor.choose(bag, wished) {
        Ok(Some(chosen)) => chosen,
        Ok(None) => return Ok(None),
        Err(reason) => return refuse(reason),
    };
    let (mut logged, mut refused) = (Logged::default(), None);
    let each = |_: &Bag, _: Key, message: &Message| {
        match decode(message) {
            Ok(Some(sample)) => logged.samples.push(sample),
            Ok(None) => logged.unmeasured += 1,
            Err(reason) => refused = Some(reason),
        }
        refused.is_none()
    };
    bag.read_in_order(|channel| channel.topic == topic, each)?;
    if let Some(reason) = refused {
        let of = sensor.measurements;
        return refuse(format!(
            "has messages on {topic} that are no {of}: {reason}"
        ));
    }
    logged.topic = Some(topic);
    Ok(Some(logged))
}

impl Sensor {
    /// Returns the topics that may be of the sensor. Of their types the package does not count.
    fn topics(&self, bag: &Bag) -> BTreeMap<String, Decode> {
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

    /// Returns the topic to read and how, or why there are several.
    fn choose(&self, bag: &Bag, wished: Option<&str>) -> Result<Option<(String, Decode)>, String> {
        let mut topics = self.topics(bag);
        let (section, of) = (self.of.section(), self.measurements);
        match (wished, self.to_be_named) {
            (Some(wished), _) => match topics.remove_entry(wished) {
                Some(found) => Ok(Some(found)),
                None => Err(self.why_not(wished, &topics)),
            },
            (None, Some(remedy)) if !topics.is_empty() => {
                Err(format!("has speeds on {}: {remedy}", listed(&topics)))
            }
            (None, _) if topics.len() > 1 => {
                let listed = listed(&topics);
                Err(format!(
                    "has {of} on several topics, {listed}: choose one with {section}.topic"
                ))
            }
            (None, _) => Ok(topics.pop_first()),
        }
    }

    fn why_not(&self, wished: &str, topics: &BTreeMap<String, Decode>) -> String {
        let names: Vec<&str> = self.types.iter().map(|(name, _)| *name).collect();
        let (names, section) = (names.join(" or "), self.of.section());
        let others = match topics.is_empty() {
            true => ", and on no other one".to_owned(),
            false => format!(", but on: {}", listed(topics)),
        };
        format!("has no messages of {names} on the topic {wished} ({section}.topic){others}")
    }
}

fn listed(topics: &BTreeMap<String, Decode>) -> String {
    let names: Vec<&str> = topics.keys().map(String::as_str).collect();
    names.join(", ")
}
