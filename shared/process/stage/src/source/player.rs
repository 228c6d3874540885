//! The loop of a source that takes the place of the first stages as well: publishes recorded
//! messages of the topics that the others read, when the window admits their scan and, at a given
//! rate, when it is due.

use std::ops::Range;

use gyre_messages::{Item, Scan, StageId, flag};

use super::{Feed, Pace, hop};
use crate::{
    Launch, StageCounters, StageError, clock, counters, wake,
    writer::{RecordedMessage, TopicWriter, Writer, item_of},
};

pub trait Recorded {
    /// The topics to publish, in the order of the stream.
    fn topics(&self) -> &[&'static str];

    /// The messages to play, by their sequence number: each topic has all of them.
    fn items(&self) -> Range<u64>;

    fn read(&mut self, topic: &str, seq: u64) -> Result<RecordedMessage, StageError>;
}

/// Plays recorded messages until SIGTERM.
pub fn run_player(
    launch: &Launch,
    recorded: &mut impl Recorded,
) -> Result<StageCounters, StageError> {
    launch.take_place()?;
    let mut feed = Feed::open(launch, || TopicWriter::of_stream(launch, recorded.topics()))?;
    // The supervisor takes its publisher for a sign that the source has started.
    let _scans = Writer::<Scan>::open(&launch.node, &launch.manifest)?;
    let ended = play(&mut feed, recorded);
    feed.finish(ended)
}

fn play(
    feed: &mut Feed<'_, Vec<TopicWriter>>,
    recorded: &mut impl Recorded,
) -> Result<(), StageError> {
    let items = recorded.items();
    let newest = feed.wait_for_start()?;
    // The others need the message of the newest pose as the previous one.
    let mut seq = match newest.is(flag::BASE) {
        true => items.start,
        false => newest.seq,
    };
    let (mut pace, mut last) = (None, Item::default());
    while items.contains(&seq) {
        let started_ns = clock::now_ns();
        let topics = feed.outputs.iter().map(|output| output.topic);
        let messages: Vec<_> = topics
            .map(|topic| recorded.read(topic, seq))
            .collect::<Result<_, _>>()?;
        let mut item = item_of(&messages, seq)?;
        let due_ns = feed.launch.manifest.rate.map(|rate| {
            let pace =
                pace.get_or_insert_with(|| Pace::new(rate, (clock::now_ns(), item.stamp_ns)));
            pace.due_ns(item.stamp_ns)
        });
        *item.hop_mut(StageId::RadarReplay) = hop(started_ns, clock::now_ns());
        feed.wait_for_admission(seq, due_ns, false)?;
        item.due_ns = due_ns.unwrap_or_else(clock::now_ns);
        for (output, message) in feed.outputs.iter().zip(&messages) {
            output.republish(message, item)?;
        }
        feed.schedule.has_published(item.published)?;
        counters::record(&mut feed.counters, 0, clock::now_ns() - started_ns);
        (seq, last) = (seq + 1, item);
    }
    feed.wait_for_admission(seq, None, false)?;
    let end = Item {
        seq,
        published: last.published.saturating_add(1),
        ..last
    };
    feed.end(end)?;
    loop {
        feed.sleep(wake::MAX_WAIT)?;
    }
}
