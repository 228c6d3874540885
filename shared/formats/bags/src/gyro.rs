//! The samples of a gyro in a bag: messages of the type `sensor_msgs/msg/Imu`.

use std::{collections::BTreeSet, path::Path};

use gyre_ros2_messages::{decode, sensor_msgs::Imu};
use gyre_samples::Sample;

use crate::{BagError, bag::Bag, reading::Message};

/// Reads all samples on the topic of this name, else on the only topic of the type; in the gyro's
/// own axes and on the clock of its driver, in the order of the bag. `None` without such a topic.
/// Damaged parts of the bag are skipped, as for scans.
///
/// # Errors
/// No topic of this name, several without one, messages that cannot be decoded, or a file that
/// cannot be read.
pub(crate) fn read(
    bag: &mut Bag,
    path: &Path,
    wished: Option<&str>,
) -> Result<Option<Vec<Sample>>, BagError> {
    let Some(topic) = choose(bag, path, wished)? else {
        return Ok(None);
    };
    let mut samples = Vec::new();
    for span in 0..bag.spans.len() {
        let messages = match bag.read(span, |channel| channel.topic == topic) {
            Err(BagError::Damaged { .. }) => continue,
            read => read?,
        };
        for message in &messages {
            let sample = sample(message).map_err(|reason| {
                BagError::unreadable(
                    path,
                    format!("has messages on {topic} that are no samples of a gyro: {reason}"),
                )
            })?;
            samples.push(sample);
        }
    }
    Ok(Some(samples))
}

fn choose(bag: &Bag, path: &Path, wished: Option<&str>) -> Result<Option<String>, BagError> {
    let channels = bag.channels();
    let of_type = channels.iter().filter(|channel| {
        channel
            .type_name
            .rsplit_once('/')
            .is_some_and(|(_, name)| name == "Imu")
    });
    let topics: BTreeSet<&str> = of_type.map(|channel| channel.topic.as_str()).collect();
    let listed = || topics.iter().copied().collect::<Vec<_>>().join(", ");
    match (wished, topics.len()) {
        (Some(wished), _) if topics.contains(wished) => Ok(Some(wished.to_owned())),
        (Some(wished), _) => Err(BagError::unreadable(
            path,
            format!(
                "has no messages of sensor_msgs/msg/Imu on the topic {wished} (gyro.topic), but on: {}",
                listed()
            ),
        )),
        (None, 0) => Ok(None),
        (None, 1) => Ok(topics.first().map(|topic| (*topic).to_owned())),
        (None, _) => Err(BagError::unreadable(
            path,
            format!(
                "has gyros on several topics, {}: choose one with gyro.topic",
                listed()
            ),
        )),
    }
}

fn sample(message: &Message) -> Result<Sample, String> {
    let imu: Imu = decode(&message.data).map_err(|error| error.to_string())?;
    let sample = imu.sample(message.log_ns);
    sample.ok_or_else(|| "they say that they have no angular velocity".to_owned())
}
