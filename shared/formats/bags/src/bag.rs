//! The files of a bag as one, and the description of its radar.

use std::path::{Path, PathBuf};

use gyre_datasets::DatasetOptions;

use crate::{
    BagError,
    azimuths::{Described, described},
    damaged::Span,
    radar::{ENCODER_COUNTS, Survey},
    reading::{BagFile, Channel, Message},
    topics::{Kind, Topics},
};

/// The files of a bag, and the spans of the messages in them.
pub(crate) struct Bag {
    path: PathBuf,
    pub files: Vec<BagFile>,
    /// The number of the file of each span, and the span.
    pub spans: Vec<(usize, Span)>,
}

impl Bag {
    /// Opens the files, which are in order.
    pub fn open(path: &Path, paths: &[PathBuf]) -> Result<Self, BagError> {
        let mut bag = Self {
            path: path.to_owned(),
            files: Vec::new(),
            spans: Vec::new(),
        };
        for (number, path) in paths.iter().enumerate() {
            let (file, spans) = BagFile::open(path)?;
            bag.files.push(file);
            bag.spans
                .extend(spans.into_iter().map(|span| (number, span)));
        }
        Ok(bag)
    }

    /// Returns the messages of a span that are wanted.
    pub fn read(
        &mut self,
        span: usize,
        wanted: impl Fn(&Channel) -> bool,
    ) -> Result<Vec<Message>, BagError> {
        let Some(&(file, span)) = self.spans.get(span) else {
            return Ok(Vec::new());
        };
        self.files[file].read(span, wanted)
    }

    pub fn channels(&self) -> Vec<&Channel> {
        let files = self.files.iter();
        files.flat_map(|file| file.channels.values()).collect()
    }

    /// Learns all channels. A file without a list of them is read as a whole.
    pub fn learn_channels(&mut self) {
        for span in 0..self.spans.len() {
            let (file, _) = self.spans[span];
            if !self.files[file].has_summary {
                // What is damaged has no channels.
                let _ = self.read(span, |_| false);
            }
        }
    }

    /// Describes the radar: by its first configuration, otherwise by what its azimuths and the
    /// options show. Also returns what is to be said of that.
    pub fn describe(
        &mut self,
        topics: &Topics,
        options: &DatasetOptions,
    ) -> Result<(Described, Origin), BagError> {
        let (survey, own) = self.survey(topics);
        let usual = match &own {
            Some(Ok(own)) => own.radar.encoder_size,
            _ => ENCODER_COUNTS,
        };
        let shown = survey.other_counts(usual, matches!(own, Some(Ok(_))));
        let (size, counts) = match (options.encoder_counts, shown) {
            (Some(size), _) => (size, CountsOrigin::Configured),
            (None, Some(size)) => (size, CountsOrigin::Azimuths { usual }),
            (None, None) => (usual, CountsOrigin::Usual),
        };
        if let Some(Ok(mut described)) = own {
            described.radar.encoder_size = size;
            let radar = RadarOrigin::Itself;
            return Ok((described, Origin { radar, counts }));
        }
        let refused = own.and_then(Result::err);
        if let (Some(reason), None) = (&refused, options.range_resolution_m) {
            let reason = format!(
                "has a configuration of its radar that cannot be used ({reason}): give the depth of a range bin with \
                 dataset.range_resolution_m"
            );
            return Err(BagError::unreadable(&self.path, reason));
        }
        let described = survey.describe(&self.path, options.range_resolution_m, size)?;
        let radar = RadarOrigin::Scans { refused };
        Ok((described, Origin { radar, counts }))
    }

    /// Looks at the first messages with scans, and for the first configuration that can be used, or
    /// why the first one cannot.
    fn survey(&mut self, topics: &Topics) -> (Survey, Option<Result<Described, String>>) {
        let (mut survey, mut own) = (Survey::new(topics.scans.kind), None);
        for span in 0..self.spans.len() {
            let file = self.spans[span].0;
            let messages = self.read(span, |channel| topics.has(channel));
            for message in messages.unwrap_or_default() {
                match (self.configuration(file, topics, &message), &own) {
                    (Some(Ok(described)), None | Some(Err(_))) => own = Some(Ok(described)),
                    (Some(Err(reason)), None) => own = Some(Err(reason)),
                    (None, _) if !survey.is_done() => survey.add(&message),
                    _ => {}
                }
            }
            let is_known = topics.configuration.is_none() || matches!(own, Some(Ok(_)));
            if survey.is_done() && is_known {
                break;
            }
        }
        (survey, own)
    }

    /// Returns what a message says of the radar, if it is of that topic, or why that cannot be
    /// used.
    fn configuration(
        &self,
        file: usize,
        topics: &Topics,
        message: &Message,
    ) -> Option<Result<Described, String>> {
        let topic = topics.configuration.as_ref()?;
        let channel = self.files[file].channels.get(&message.channel)?;
        match topic.kind {
            Kind::Configuration(form) if channel.topic == topic.name => {
                let described = described(form, message);
                Some(described.and_then(|described| {
                    let checked = described.radar.check();
                    checked.map(|()| described).map_err(|e| e.to_string())
                }))
            }
            _ => None,
        }
    }
}

/// The sources of the description of a radar.
pub(crate) struct Origin {
    pub radar: RadarOrigin,
    pub counts: CountsOrigin,
}

/// The source of azimuths, bins and rotation.
pub(crate) enum RadarOrigin {
    /// The radar's own description.
    Itself,
    /// Found from azimuths and options.
    Scans {
        /// Why its own cannot be used, if there is one.
        refused: Option<String>,
    },
}

/// The source of the encoder counts per turn.
pub(crate) enum CountsOrigin {
    Configured,
    /// The radar's own, or those of most radars.
    Usual,
    /// The azimuths, which are no turn with the usual ones.
    Azimuths {
        usual: u16,
    },
}
