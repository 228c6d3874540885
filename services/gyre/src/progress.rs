//! The progress of a run: a bar on a terminal, plain lines elsewhere.

mod silence;

use std::{fmt::Display, time::Instant};

use gyre_contract::{Item, PoseHeader};
use gyre_supervise::Event;
use gyre_tools::bar::Bar;
use gyre_transport::{Manifest, clock, received};

use silence::Silence;

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

    pub fn show(&mut self, event: &Event<'_>) {
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
            Event::Watched => self.silence(),
            Event::Stopping => self.radar = None,
            Event::Ready => {}
        }
    }

    pub fn finish(&self) {
        self.bar.finish();
    }

    fn pose(&mut self, pose: &PoseHeader) {
        let message = self.message(&pose.item);
        let passed = self.done.saturating_add(pose.item.dropped());
        self.bar.scans(self.done, passed, message);
    }

    fn silence(&mut self) {
        let Some((silence, manifest)) = &mut self.radar else {
            return;
        };
        // The source has not begun yet.
        let Some(received) = received::read(manifest) else {
            return;
        };
        if let Some(sentence) = silence.update(&received, clock::now_ns()) {
            self.bar.say(&sentence);
        }
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

#[cfg(test)]
mod tests {
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
}
