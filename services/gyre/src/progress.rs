//! The progress of a run: a bar on a terminal, plain lines elsewhere.

use std::{
    io::IsTerminal,
    time::{Duration, Instant},
};

use gyre_messages::{Footprint, PoseHeader};
use gyre_stage::{clock, supervise::Event};
use indicatif::{ProgressBar, ProgressStyle};

use crate::print;

/// Time between two plain lines.
const EVERY: Duration = Duration::from_secs(2);

/// Shows the progress of a run.
pub struct Progress {
    bar: Option<ProgressBar>,
    scans: usize,
    done: u64,
    dropped: u64,
    last_published: Option<u64>,
    since: Option<(Instant, u64)>,
    last_line: Instant,
}

impl Progress {
    /// Starts with a run of `scans` scans, of which `resumed` are in the journal already.
    pub fn new(scans: usize, resumed: usize, footprint: &Footprint) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{bar:32} {pos}/{len} scans  {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(scans as u64).with_style(style)
        });
        let progress = Self {
            bar,
            scans,
            done: resumed as u64,
            dropped: 0,
            last_published: None,
            since: None,
            last_line: Instant::now(),
        };
        progress.say(&footprint.to_string());
        if resumed > 0 {
            progress.say(&format!("resuming after {resumed} scans"));
        }
        progress
    }

    /// Shows an event.
    pub fn show(&mut self, event: &Event<'_>) {
        match event {
            Event::Started { stage, pid } => self.say(&format!("{stage:20} pid {pid}")),
            Event::Pose(pose) => self.pose(pose),
            Event::Died { stage, death } => {
                let output = death
                    .last_output
                    .as_ref()
                    .map_or(String::new(), |line| format!(" ({line})"));
                self.say(&format!("{stage} died by {}{output}", death.cause));
            }
            Event::Restarted { all: false } => self.say("restarted it"),
            Event::Restarted { all: true } => self.say("restarted all stages from the journal"),
            Event::Stalled(stall) => self.say(&stall.to_string()),
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    fn pose(&mut self, pose: &PoseHeader) {
        let published = pose.item.published;
        let gap = self
            .last_published
            .map_or(published, |last| published.saturating_sub(last + 1));
        if self.done == 0 || self.last_published.is_some() {
            self.dropped += gap;
        }
        self.last_published = Some(published);
        self.done = pose.item.seq.saturating_add(1);
        let (since, first) = *self.since.get_or_insert((Instant::now(), self.done));
        let rate = (self.done - first) as f64 / since.elapsed().as_secs_f64().max(1e-9);
        let lag_ms = clock::now_ns().saturating_sub(pose.item.due_ns) as f64 * 1e-6;
        let message = format!(
            "{rate:.1} scans/s  lag {lag_ms:.0} ms  dropped {}",
            self.dropped
        );
        match &self.bar {
            Some(bar) => {
                bar.set_position(self.done + self.dropped);
                bar.set_message(message);
            }
            None if self.last_line.elapsed() >= EVERY => {
                self.last_line = Instant::now();
                print::note(format_args!(
                    "{}/{} scans  {message}",
                    self.done, self.scans
                ));
            }
            None => {}
        }
    }

    fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.println(line),
            None => print::note(line),
        }
    }
}
