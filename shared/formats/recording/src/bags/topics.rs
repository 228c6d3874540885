//! The topics of a radar in a bag, recognised by their types, and their messages as azimuths.

use std::{collections::BTreeSet, path::Path};

use gyre_colossus::Azimuth;
use gyre_ros2_messages::{
    Ros2Message, decode,
    messages::{RadarConfigurationMessage, RadarFftDataMessage},
    navtech_msgs::{RadarBScanMsg, RadarConfigurationMsg, RadarFftDataMsg},
    radar::DescribedRadar,
    sensor_msgs::Image,
};
use gyre_storage::quoted;

use crate::bags::{Channel, Message, RecordingError};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Azimuths(Form),
    /// Whole turns, with encoder values and times.
    BScans,
    /// Whole turns as images alone.
    Images,
    Configuration(Form),
}

/// The number format of Navtech's driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Form {
    Numbers,
    /// As arrays of their bytes: the older form, which some have kept under the newer name.
    Bytes,
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Topic {
    pub name: String,
    pub kind: Kind,
}

impl Topic {
    /// Returns the topic of a channel, if it is a radar's. Packages of messages have had several
    /// names.
    pub fn of(channel: &Channel) -> Option<Self> {
        let (_, name) = channel.type_name.rsplit_once('/')?;
        // Where the definition is missing, the type's name decides.
        let form = |older: bool| match older || channel.schema.contains("uint8[] azimuth") {
            true => Form::Bytes,
            false => Form::Numbers,
        };
        let kind = match name {
            "RadarFftDataMsg" => Kind::Azimuths(form(false)),
            "RadarFftDataMessage" => Kind::Azimuths(form(true)),
            "RadarBScanMsg" => Kind::BScans,
            "RadarConfigurationMsg" => Kind::Configuration(form(false)),
            "RadarConfigurationMessage" => Kind::Configuration(form(true)),
            "Image" => Kind::Images,
            _ => return None,
        };
        Some(Self {
            name: channel.topic.clone(),
            kind,
        })
    }

    fn has_scans(&self) -> bool {
        !matches!(self.kind, Kind::Configuration(_))
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Topics {
    pub scans: Topic,
    pub configuration: Option<Topic>,
}

impl Topics {
    /// Chooses the topic of scans, `wished` if it is named, and the nearest topic of the radar's
    /// configuration.
    pub fn choose(
        path: &Path,
        channels: &[&Channel],
        wished: Option<&str>,
    ) -> Result<Self, RecordingError> {
        let topics: BTreeSet<Topic> = channels.iter().filter_map(|c| Topic::of(c)).collect();
        let candidates = candidates(&topics, wished);
        let refuse = |reason: String| Err(RecordingError::unreadable(path, reason));
        let scans = match (&candidates[..], wished) {
            ([one], _) => (*one).clone(),
            ([], Some(wished)) => {
                let all = topics.iter().filter(|topic| topic.has_scans());
                return refuse(format!(
                    "has no scans on the topic {wished} (dataset.topic), but on: {}",
                    names(all.map(|topic| topic.name.as_str()))
                ));
            }
            ([], None) if channels.is_empty() => {
                return refuse(
                    "has no topics: it is empty, or damaged from its beginning".to_owned(),
                );
            }
            ([], None) => {
                return refuse(format!(
                    "has no scans of a radar: none of its topics ({}) is of a type of Navtech's driver (RadarFftDataMsg, RadarBScanMsg)",
                    names(channels.iter().map(|channel| channel.topic.as_str()))
                ));
            }
            ([first, ..], _) => {
                return refuse(format!(
                    "has scans on several topics, {}: choose one with dataset.topic, as in --set dataset.topic={}",
                    names(candidates.iter().map(|topic| topic.name.as_str())),
                    first.name
                ));
            }
        };
        let mut used = channels.iter().filter(|it| it.topic == scans.name);
        if let Some(channel) = used.find(|channel| channel.encoding != "cdr") {
            let (name, encoding) = (&scans.name, quoted(&channel.encoding));
            let reason = format!("has the messages of {name} as {encoding}, expected `cdr`");
            return refuse(reason);
        }
        let near = |topic: &&Topic| common_prefix(&topic.name, &scans.name);
        let configurations = topics.iter().filter(|topic| !topic.has_scans());
        Ok(Self {
            configuration: configurations.max_by_key(near).cloned(),
            scans,
        })
    }

    pub fn has(&self, channel: &Channel) -> bool {
        let configuration = self.configuration.as_ref();
        channel.topic == self.scans.name
            || configuration.is_some_and(|topic| topic.name == channel.topic)
    }
}

/// Returns the candidate topics. Images are of many sensors: only those that the driver names so
/// are a radar's, unless one is named.
fn candidates<'a>(topics: &'a BTreeSet<Topic>, wished: Option<&str>) -> Vec<&'a Topic> {
    let scans = || topics.iter().filter(|topic| topic.has_scans());
    if let Some(wished) = wished {
        return scans().filter(|topic| topic.name == wished).collect();
    }
    let radar: Vec<_> = scans().filter(|topic| topic.kind != Kind::Images).collect();
    match radar.is_empty() {
        true => scans()
            .filter(|topic| topic.name.ends_with("b_scan_image"))
            .collect(),
        false => radar,
    }
}

fn common_prefix(a: &str, b: &str) -> usize {
    a.bytes().zip(b.bytes()).take_while(|(a, b)| a == b).count()
}

/// Names that a sentence has room for.
const NAMED: usize = 6;

fn names<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let mut names: BTreeSet<&str> = names.collect();
    let more = names.len() > NAMED;
    while names.len() > NAMED {
        names.pop_last();
    }
    let listed: Vec<&str> = names.into_iter().collect();
    listed.join(", ") + if more { ", ..." } else { "" }
}

pub(crate) fn described(form: Form, message: &Message) -> Result<DescribedRadar, String> {
    match form {
        Form::Numbers => of::<RadarConfigurationMsg>(message)?.configuration(),
        Form::Bytes => of::<RadarConfigurationMessage>(message)?.configuration(),
    }
}

/// Calls `each` with the azimuths in a message of a scan topic and their receive times, ns.
pub(crate) fn azimuths(
    kind: Kind,
    message: &Message,
    described: &DescribedRadar,
    mut each: impl FnMut(Azimuth<'_>, i64),
) -> Result<(), String> {
    let DescribedRadar {
        radar,
        azimuth_offset,
    } = described;
    match kind {
        Kind::Azimuths(Form::Numbers) => {
            let azimuth: RadarFftDataMsg = of(message)?;
            each(azimuth.azimuth(), azimuth.header.stamp_or(message.log_ns));
        }
        Kind::Azimuths(Form::Bytes) => {
            let azimuth: RadarFftDataMessage = of(message)?;
            let received_ns = azimuth.header.stamp_or(message.log_ns);
            each(azimuth.azimuth()?, received_ns);
        }
        Kind::BScans => {
            // The stamp in its header is the radar's.
            let scan: RadarBScanMsg = of(message)?;
            let rows = scan.rows(radar, *azimuth_offset, message.log_ns)?;
            rows.for_each(|row| each(row.azimuth, row.arrived_ns));
        }
        Kind::Images => {
            let image: Image = of(message)?;
            let received_ns = image.header.stamp_or(message.log_ns);
            let rows = image.rows(radar, *azimuth_offset, received_ns)?;
            rows.for_each(|row| each(row.azimuth, row.arrived_ns));
        }
        Kind::Configuration(_) => {}
    }
    Ok(())
}

pub(crate) fn of<T: Ros2Message>(message: &Message) -> Result<T, String> {
    decode(&message.data)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(topic: &str, type_name: &str) -> Channel {
        Channel {
            topic: topic.to_owned(),
            type_name: type_name.to_owned(),
            encoding: "cdr".to_owned(),
            ..Channel::default()
        }
    }

    fn choose(topics: &[(&str, &str)]) -> Result<Topics, RecordingError> {
        let channels = topics.iter().map(|(topic, of)| channel(topic, of));
        let channels: Vec<Channel> = channels.collect();
        let channels: Vec<&Channel> = channels.iter().collect();
        Topics::choose(Path::new("b"), &channels, None)
    }

    #[test]
    fn topics_are_found_by_type_whatever_their_package_is() {
        let configuration = "navtech_msgs/msg/RadarConfigurationMsg";
        let topics = choose(&[
            ("/camera", "sensor_msgs/msg/Image"),
            ("/odom", "nav_msgs/msg/Odometry"),
            ("/left/configuration_data", configuration),
            ("/right/configuration_data", configuration),
            ("/right/b_scan_msg", "vtr_radar_msgs/msg/RadarBScanMsg"),
        ]);
        let topics = topics.unwrap();
        assert_eq!(topics.scans.kind, Kind::BScans);
        let nearest = topics.configuration.unwrap().name;
        assert_eq!(nearest, "/right/configuration_data");
    }

    #[test]
    fn images_are_a_radars_if_the_driver_names_them_so() {
        assert!(choose(&[("/camera", "sensor_msgs/msg/Image")]).is_err());
        let image = [("/radar_data/b_scan_image", "sensor_msgs/msg/Image")];
        assert_eq!(choose(&image).unwrap().scans.kind, Kind::Images);
    }
}
