//! The progress of a run: a bar on a terminal, plain lines elsewhere.

use std::{fmt::Display, time::Instant};

use gyre_contract::{Item, PoseHeader, control::Received};
use gyre_supervise::Event;
use gyre_tools::bar::Bar;
use gyre_transport::{Manifest, clock, received};

pub struct Progress {
    bar: Bar,
    done: u64,
    since: Option<(Instant, u64)>,
    /// Of a live run, until it ends.
    radar: Option<(Silence, Manifest)>,
}

impl Progress {
    /// Starts with a run of `scans` scans, `resumed` of them already in the journal.
    pub fn new(scans: Option<usize>, resumed: usize, footprint: &impl Display) -> Self {
        let progress = Self {
            bar: Bar::new(scans),
            done: resumed as u64,
            since: None,
            radar: None,
        };
        progress.bar.say(&footprint.to_string());
        if resumed > 0 {
            progress.bar.say(&format!("resuming after {resumed} scans"));
        }
        progress
    }

    /// Reports from now on when the radar of a live run is silent; `radar` is its name.
    pub fn watch_radar(&mut self, radar: String, manifest: Manifest) {
        self.radar = Some((Silence::new(radar, clock::now_ns()), manifest));
    }

    /// Shows an event; returns the sentence about a radar that is silent, or sends again.
    pub fn show(&mut self, event: &Event<'_>) -> Option<String> {
        match event {
            Event::Pose(pose) => self.pose(pose),
            Event::Note(sentence) => self.bar.say(sentence),
            Event::Stalled(stall) => self.bar.say(&stall.to_string()),
            Event::Following { follower, progress } => {
                self.radar = None;
                let (done, total) = (progress.done, progress.total);
                self.bar
                    .show(format!("waiting for {follower}: {done} of {total} records"));
            }
            Event::Watched => return self.silence(),
            Event::Stopping => self.radar = None,
            Event::Ready => {}
        }
        None
    }

    pub fn finish(&self) {
        self.bar.finish();
    }

    fn pose(&mut self, pose: &PoseHeader) {
        let message = self.message(&pose.item);
        let passed = self.done.saturating_add(pose.item.dropped());
        self.bar.scans(self.done, passed, message);
    }

    fn silence(&mut self) -> Option<String> {
        let (silence, manifest) = self.radar.as_mut()?;
        // Without a file the source has not begun yet.
        let received = received::read(manifest)?;
        let sentence = silence.update(&received, clock::now_ns())?;
        self.bar.say(&sentence);
        Some(sentence)
    }

    /// Counts by the numbers of this pose alone: when poses come fast, not all of them are seen
    /// here.
    fn message(&mut self, pose: &Item) -> String {
        self.done = pose.seq.saturating_add(1);
        let (since, first) = *self.since.get_or_insert((Instant::now(), self.done));
        let done = self.done.saturating_sub(first) as f64;
        let rate = done / since.elapsed().as_secs_f64().max(1e-9);
        let lag_ms = clock::now_ns().saturating_sub(pose.due_ns) as f64 * 1e-6;
        let dropped = pose.dropped();
        format!("{rate:.1} scans/s  lag {lag_ms:.0} ms  dropped {dropped}")
    }
}

/// The silence that is reported first, ns. The next lines come when it has doubled, later each
/// minute.
const FIRST_NS: i64 = 3_000_000_000;
const LATER_NS: i64 = 60_000_000_000;

/// The silence of a live radar, which a run reports while there are no poses to count.
struct Silence {
    /// As "the radar at 192.168.0.1:6317".
    radar: String,
    /// When the run began, `CLOCK_MONOTONIC`, ns.
    began_ns: i64,
    /// The silence after which the next line is due, ns.
    next_ns: i64,
    /// When the last scan arrived before a silence that was reported, `CLOCK_MONOTONIC`, ns.
    reported: Option<i64>,
}

impl Silence {
    fn new(radar: String, now_ns: i64) -> Self {
        Self {
            radar,
            began_ns: now_ns,
            next_ns: FIRST_NS,
            reported: None,
        }
    }

    /// Returns a sentence when the radar has been silent for twice as long, or sends again.
    fn update(&mut self, received: &Received, now_ns: i64) -> Option<String> {
        if received.is_receiving {
            let silent_s = seconds(now_ns - self.reported.take()?);
            self.next_ns = FIRST_NS;
            let radar = &self.radar;
            return Some(format!("{radar} sends, after {silent_s} s of silence"));
        }
        let last_scan_ns = received.last_scan.map(|scan| scan.at_ns);
        let heard_ns = last_scan_ns.unwrap_or(i64::MIN).max(self.began_ns);
        let silent_ns = now_ns - heard_ns;
        if silent_ns < self.next_ns {
            return None;
        }
        self.next_ns += self.next_ns.min(LATER_NS);
        self.reported = Some(heard_ns);
        let (radar, silent_s) = (&self.radar, seconds(silent_ns));
        Some(format!("waiting for {radar}: no scan for {silent_s} s"))
    }
}

fn seconds(ns: i64) -> i64 {
    ns / 1_000_000_000
}

#[cfg(test)]
mod tests {
    use gyre_contract::control::LastScan;

    use super::*;

    #[test]
    fn poses_that_were_not_seen_are_no_dropped_scans() {
        let mut progress = Progress::new(Some(100), 0, &"");
        let pose = |seq, published| Item {
            published,
            ..Item::numbered(seq)
        };
        assert!(progress.message(&pose(0, 0)).ends_with("dropped 0"));
        assert!(progress.message(&pose(7, 7)).ends_with("dropped 0"));
        assert!(progress.message(&pose(9, 12)).ends_with("dropped 3"));
    }

    const SECOND: i64 = 1_000_000_000;

    fn heard(at_s: Option<i64>, is_receiving: bool) -> Received {
        let last_scan = at_s.map(|at_s| LastScan {
            stamp_ns: 0,
            at_ns: at_s * SECOND,
        });
        Received {
            last_scan,
            is_receiving,
            ..Received::default()
        }
    }

    /// The sentences of a radar in 40 s, a look a second, whose last scan and receipt these return.
    fn said(received: impl Fn(i64) -> Received) -> Vec<(i64, String)> {
        let mut silence = Silence::new("the radar".to_owned(), 0);
        let update = |at_s| Some((at_s, silence.update(&received(at_s), at_s * SECOND)?));
        (1..=40).filter_map(update).collect()
    }

    #[test]
    fn one_that_is_silent_is_waited_for_until_it_sends_again() {
        // The last scan came at 10 s, the next azimuth 20 s later.
        let received = |at_s: i64| heard(Some(at_s.min(10)), !(12..30).contains(&at_s));
        let expected = [
            (13, "waiting for the radar: no scan for 3 s"),
            (16, "waiting for the radar: no scan for 6 s"),
            (22, "waiting for the radar: no scan for 12 s"),
            (30, "the radar sends, after 20 s of silence"),
        ];
        assert_eq!(
            said(received),
            expected.map(|(at_s, it)| (at_s, it.to_owned()))
        );
        // One that sends, or that comes within a moment, is not mentioned.
        assert!(said(|at_s| heard(Some(at_s), true)).is_empty());
        assert!(said(|at_s| heard(None, at_s > 2)).is_empty());
        // One that was never there is silent since the run began.
        assert_eq!(said(|_| heard(None, false))[0].0, 3);
    }
}
