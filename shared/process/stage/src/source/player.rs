//! The loop of a source that takes the place of the first stages as well: publishes recorded
//! messages of the topics that the others read, when the window admits their scan and, at a given
//! rate, when it is due.

use std::{ops::Range, time::Duration};

use gyre_messages::{Hop, Item, Scan, StageId, flag};

use super::{Credit, Pace};
use crate::{
    Launch, StageCounters, StageError, clock,
    outlet::{Outlet, RecordedMessage, item_of},
    schedule::ScheduleWriter,
    wake,
    writer::Writer,
};

/// The recorded messages of a run.
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
    if !launch.take_place()? {
        return Ok(StageCounters::default());
    }
    let credit = Credit::open(launch)?;
    let schedule = ScheduleWriter::create(&launch.manifest)?;
    let outputs = recorded
        .topics()
        .iter()
        .map(|topic| Outlet::open(launch, topic));
    let outputs = outputs.collect::<Result<_, _>>()?;
    let mut player = Player {
        launch,
        recorded,
        credit,
        outputs,
        schedule,
        counters: StageCounters::default(),
        // The supervisor takes its publisher for a sign that the source has started.
        _scans: Writer::open(&launch.node, &launch.manifest)?,
    };
    player.play()?;
    Ok(player.counters)
}

struct Player<'a, R: Recorded> {
    launch: &'a Launch,
    recorded: &'a mut R,
    credit: Credit,
    outputs: Vec<Outlet>,
    schedule: ScheduleWriter,
    counters: StageCounters,
    _scans: Writer<Scan>,
}

impl<R: Recorded> Player<'_, R> {
    fn play(&mut self) -> Result<(), StageError> {
        let Some(mut seq) = self.wait_for_start()? else {
            return Ok(());
        };
        let (mut pace, mut last) = (None, None);
        let items = self.recorded.items();
        while items.contains(&seq) {
            let (started_ns, messages) = (clock::now_ns(), self.read(seq)?);
            let mut item = item_of(&messages, seq)?;
            let due_ns = self.launch.manifest.rate.map(|rate| {
                let pace = pace.get_or_insert_with(|| Pace::new(rate, item.stamp_ns));
                pace.due_ns(item.stamp_ns)
            });
            *item.hop_mut(StageId::RadarReplay) = Hop {
                received_ns: started_ns,
                started_ns,
                finished_ns: clock::now_ns(),
                published_ns: 0,
            };
            if !self.wait_for_admission(seq, due_ns)? {
                return Ok(());
            }
            item.due_ns = due_ns.unwrap_or_else(clock::now_ns);
            for (output, message) in self.outputs.iter().zip(&messages) {
                output.send(message, item)?;
            }
            self.schedule.has_published(item.published)?;
            crate::counters::record(&mut self.counters, 0, clock::now_ns() - started_ns);
            (seq, last) = (seq + 1, Some(item));
        }
        if self.wait_for_admission(seq, None)? {
            let last = last.unwrap_or_default();
            let end = Item {
                seq,
                published: last.published.saturating_add(1),
                ..last
            };
            self.outputs.iter().try_for_each(|output| output.end(end))?;
            self.schedule.has_published(end.published)?;
            while !self.sleep(wake::MAX_WAIT)? {}
        }
        Ok(())
    }

    /// Waits until the sink has reported the newest pose, and returns the first message to send:
    /// the message of this pose, which the others need as the previous one. `None` on a request to
    /// stop.
    fn wait_for_start(&mut self) -> Result<Option<u64>, StageError> {
        loop {
            // Sleep first, as the source of scans does.
            if self.sleep(wake::MAX_WAIT)? {
                return Ok(None);
            }
            self.credit.update()?;
            if let Some(newest) = self.credit.resume_at {
                return Ok(Some(match newest.is(flag::BASE) {
                    true => self.recorded.items().start,
                    false => newest.seq,
                }));
            }
        }
    }

    fn read(&mut self, seq: u64) -> Result<Vec<RecordedMessage>, StageError> {
        let topics = self.outputs.iter().map(|output| output.topic());
        topics.map(|topic| self.recorded.read(topic, seq)).collect()
    }

    /// Waits until the window admits an item and it is due; false on a request to stop.
    fn wait_for_admission(&mut self, seq: u64, due_ns: Option<i64>) -> Result<bool, StageError> {
        self.schedule.due_at(due_ns.unwrap_or_else(clock::now_ns))?;
        let mut has_slept = false;
        loop {
            self.credit.update()?;
            let wait = due_ns.map_or(Duration::ZERO, clock::until);
            let window = self.launch.manifest.window;
            let has_credit = window.admits(seq, self.credit.newest);
            if has_credit && wait.is_zero() && has_slept {
                return Ok(true);
            }
            let limit = match has_credit {
                true => wait.min(wake::MAX_WAIT),
                false => wake::MAX_WAIT,
            };
            // As in the source of scans, there is time for signals, new readers and a beat.
            if self.sleep(limit)? {
                return Ok(false);
            }
            has_slept = true;
        }
    }

    /// Sleeps, and answers the handshakes of new readers; true on a request to stop.
    fn sleep(&mut self, limit: Duration) -> Result<bool, StageError> {
        let handshakes: Vec<_> = self
            .outputs
            .iter()
            .map(|output| output.listener())
            .collect();
        let poses = [self.credit.poses.listener()];
        let signals = &self.launch.signals;
        let woken = signals.wait_or_readable(&poses, &handshakes, None, limit)?;
        self.counters.wakes += 1;
        if woken.may_have_new_readers() {
            let mut outputs = self.outputs.iter();
            outputs.try_for_each(|output| output.accept_readers())?;
        }
        Ok(woken.stop)
    }
}
