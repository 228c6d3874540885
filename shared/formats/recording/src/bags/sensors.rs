//! Sensors beside the radar: the topics of a bag that are of one, by their types, and their
//! messages.

use std::{collections::BTreeMap, path::Path};

use crate::bags::{
    Message, RecordingError,
    bag::{Bag, Key},
};

pub(crate) type Decode<T> = fn(&Message) -> Result<T, String>;

/// A sensor, and how its messages become measurements.
pub(crate) struct Sensor<T: 'static> {
    /// The section of its settings, such as `gyro`.
    pub section: &'static str,
    /// The measurements in words, such as `samples of the gyro`.
    pub measurements: &'static str,
    pub types: &'static [(&'static str, Decode<T>)],
}

/// The topic of measurements, and those in the order of their log times.
pub(crate) type Measured<T> = (String, Vec<T>);

impl<T> Sensor<T> {
    /// Reads all measurements on the topic of this name, else on the only topic of the sensor's
    /// types. `None` without such a topic. Damaged parts of the bag are skipped, as for scans.
    pub fn read(
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

    pub fn listed(&self, bag: &Bag) -> String {
        listed(&self.topics(bag))
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
