//! Plays the recorded messages of a run in the place of the stages before a topic.

use std::ops::Range;

use gyre_contract::run::{SourceConfig, StageCounters};
use gyre_recording::Recording;
use gyre_stage::{Launch, source::run_player};
use gyre_transport::{RecordedMessage, RunError};

/// Plays the recording of the section `[source]` from its topic on, until SIGTERM.
pub fn play_recorded(launch: &Launch) -> Result<StageCounters, RunError> {
    let config: SourceConfig = launch.section("source")?;
    let manifest = &launch.manifest;
    let topics = config.from.topics(manifest.refines, manifest.window.slam);
    let mut player = Player::open(&config, topics).map_err(RunError::Input)?;
    let (topics, items) = (player.topics.clone(), player.items.clone());
    run_player(launch, &topics, items, |topic, seq| {
        let stored = player.recording.read(topic, seq);
        let stored = stored.map_err(RunError::input)?;
        Ok(RecordedMessage {
            header: stored.header,
            payload: stored.payload,
        })
    })
}

pub struct Player {
    recording: Recording,
    topics: Vec<&'static str>,
    items: Range<u64>,
}

impl Player {
    /// Opens a recording, and checks that it has each message of each topic from the first one on.
    pub fn open(config: &SourceConfig, topics: Vec<&'static str>) -> Result<Self, String> {
        let recording = gyre_recording::open_recording(&config.data).map_err(|e| e.to_string())?;
        let path = config.data.display();
        let recorded = &recording.head().topics;
        if let Some(topic) = topics
            .iter()
            .find(|it| !recorded.iter().any(|name| name == **it))
        {
            return Err(format!(
                "{path} was recorded without the topic `{topic}`, which the stages after it need: record it too, by \
                 record.topics or gyre record --topics; the scans can be played without --from"
            ));
        }
        let last = |topic: &&'static str| recording.entries(topic).last().map(|entry| entry.seq);
        let end = topics
            .iter()
            .map(last)
            .min()
            .flatten()
            .map_or(0, |last| last + 1);
        let end = end.min(config.scans.map_or(u64::MAX, |scans| scans as u64));
        for topic in &topics {
            let mut expected = 0..end;
            let lacks = |entry: &gyre_recording::Entry| Some(entry.seq) != expected.next();
            let lacking = recording.entries(topic).take(end as usize).find(lacks);
            if lacking.is_some() || end == 0 {
                let missing = expected.start.saturating_sub(1);
                return Err(format!(
                    "{path} lacks message {missing} of topic `{topic}`, which the stages after it need from the first one on: the \
                     recorder missed it; its scans can be played without --from"
                ));
            }
        }
        Ok(Self {
            recording,
            topics,
            items: 0..end,
        })
    }

    pub fn damage(&self) -> Option<String> {
        self.recording.damage()
    }

    /// Returns the times of the messages, ns since 1970.
    pub fn stamps_ns(&self) -> impl Iterator<Item = i64> + '_ {
        let entries = self.recording.entries(self.topics[0]);
        let played = entries.take_while(|entry| self.items.contains(&entry.seq));
        played.map(|entry| entry.stamp_ns)
    }
}
