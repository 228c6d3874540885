//! The loop of a source that takes the place of the first stages as well: publishes recorded
//! messages of the topics that the others read, when the window admits their scan and, at a given
//! rate, when it is due.

use std::ops::Range;

use gyre_contract::{Item, Scan, StageId, flag, run::StageCounters};
use gyre_transport::{
    AnyMessage, RecordedMessage, RunError, clock, wake,
    writer::{TopicWriter, Writer, item_of},
};

use super::{Feed, Pace, hop};
use crate::{Launch, counters};

/// Plays recorded messages until SIGTERM: of each of these topics, in the order of the stream, the
/// messages with these sequence numbers. `read` returns one of them.
pub fn run_player(
    launch: &Launch,
    topics: &[&str],
    items: Range<u64>,
    mut read: impl FnMut(&str, u64) -> Result<RecordedMessage, RunError>,
) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    let mut feed = Feed::open(launch, || {
        TopicWriter::of_stream(&launch.node, &launch.manifest, topics)
    })?;
    // The supervisor takes its publisher for a sign that the source has started.
    let _scans = Writer::<Scan>::open(&launch.node, &launch.manifest)?;
    let ended = play(&mut feed, items, &mut read);
    feed.finish(ended)
}

fn play(
    feed: &mut Feed<'_, AnyMessage>,
    items: Range<u64>,
    read: &mut impl FnMut(&str, u64) -> Result<RecordedMessage, RunError>,
) -> Result<(), RunError> {
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
            .map(|topic| read(topic, seq))
            .collect::<Result<_, _>>()?;
        let mut item = item_of(&messages, seq)?;
        // The file of the commands belongs to the recorded run.
        item.commands = 0;
        let due_ns = feed.launch.manifest.rate.map(|rate| {
            let origin = (clock::now_ns(), item.stamp_ns);
            let pace = pace.get_or_insert(Pace { rate, origin });
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
