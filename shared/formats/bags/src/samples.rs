//! The samples of other sensors in a bag: of a gyro messages of the type `sensor_msgs/msg/Imu`, of
//! the wheels `nav_msgs/msg/Odometry` or `geometry_msgs/msg/TwistStamped`.

use std::{collections::BTreeMap, path::Path};

use gyre_ros2_messages::{
    decode, geometry_msgs::TwistStamped, nav_msgs::Odometry, sensor_msgs::Imu,
};
use gyre_samples::{Sample, SampleKind};

use crate::{BagError, bag::Bag, reading::Message};

/// Makes a sample of a message.
type Decode = fn(&Message) -> Result<Sample, String>;

/// The types of the messages of a sensor, and how they are decoded.
fn types(of: SampleKind) -> &'static [(&'static str, Decode)] {
    match of {
        SampleKind::Gyro => &[("sensor_msgs/msg/Imu", gyro)],
        SampleKind::Wheels => &[
            ("nav_msgs/msg/Odometry", odometry),
            ("geometry_msgs/msg/TwistStamped", twist),
        ],
    }
}

/// Reads all samples of a sensor on the topic of this name, else on the only topic of its types; in
/// the sensor's own axes and on the clock of its driver, in the order of the bag. `None` without
/// such a topic. Damaged parts of the bag are skipped, as for scans.
///
/// The topic of the wheels must be named: odometry may be of anything, as the radar's own in a bag
/// that Gyre has exported.
///
/// # Errors
/// No topic of this name, several without one, messages that cannot be decoded, or a file that
/// cannot be read.
pub(crate) fn read(
    bag: &mut Bag,
    path: &Path,
    of: SampleKind,
    wished: Option<&str>,
) -> Result<Option<Vec<Sample>>, BagError> {
    let Some((topic, decode)) = choose(bag, path, of, wished)? else {
        return Ok(None);
    };
    let mut samples = Vec::new();
    for span in 0..bag.spans.len() {
        let messages = match bag.read(span, |channel| channel.topic == topic) {
            Err(BagError::Damaged { .. }) => continue,
            read => read?,
        };
        for message in &messages {
            let sample = decode(message).map_err(|reason| {
                let of = of.section();
                BagError::unreadable(
                    path,
                    format!("has messages on {topic} that are no samples of the {of}: {reason}"),
                )
            })?;
            samples.push(sample);
        }
    }
    Ok(Some(samples))
}

fn choose(
    bag: &Bag,
    path: &Path,
    of: SampleKind,
    wished: Option<&str>,
) -> Result<Option<(String, Decode)>, BagError> {
    let types = types(of);
    let decode = |type_name: &str| {
        let name = |of: &str| of.rsplit_once('/').map(|(_, name)| name.to_owned());
        let mut known = types.iter();
        let found = known.find(|(known, _)| name(known) == name(type_name));
        found.map(|(_, decode)| *decode)
    };
    let channels = bag.channels();
    let topics: BTreeMap<&str, Decode> = channels
        .iter()
        .filter_map(|channel| Some((channel.topic.as_str(), decode(&channel.type_name)?)))
        .collect();
    let listed = || topics.keys().copied().collect::<Vec<_>>().join(", ");
    let chosen = |(topic, decode): (&&str, &Decode)| Some(((*topic).to_owned(), *decode));
    let section = of.section();
    match wished {
        Some(wished) => match topics.get_key_value(wished) {
            Some(found) => Ok(chosen(found)),
            None => {
                let names: Vec<&str> = types.iter().map(|(name, _)| *name).collect();
                let (names, listed) = (names.join(" or "), listed());
                let reason = format!(
                    "has no messages of {names} on the topic {wished} ({section}.topic), but on: {listed}"
                );
                Err(BagError::unreadable(path, reason))
            }
        },
        None if of == SampleKind::Wheels && !topics.is_empty() => {
            let listed = listed();
            let reason = format!(
                "has speeds on {listed}: name the topic that is of wheels with wheels.topic, since odometry may be of anything, as the radar's own in a bag that Gyre has exported"
            );
            Err(BagError::unreadable(path, reason))
        }
        None if topics.len() > 1 => {
            let listed = listed();
            let reason = format!(
                "has samples of the {section} on several topics, {listed}: choose one with {section}.topic"
            );
            Err(BagError::unreadable(path, reason))
        }
        None => Ok(topics.first_key_value().and_then(chosen)),
    }
}

fn gyro(message: &Message) -> Result<Sample, String> {
    let imu: Imu = decode(&message.data).map_err(|error| error.to_string())?;
    let sample = imu.sample(message.log_ns);
    sample.ok_or_else(|| "they say that they have no angular velocity".to_owned())
}

fn odometry(message: &Message) -> Result<Sample, String> {
    let odometry: Odometry = decode(&message.data).map_err(|error| error.to_string())?;
    Ok(odometry.sample(message.log_ns))
}

fn twist(message: &Message) -> Result<Sample, String> {
    let twist: TwistStamped = decode(&message.data).map_err(|error| error.to_string())?;
    Ok(twist.sample(message.log_ns))
}
