//! Azimuths and configurations of a live source to scans, with counts, whatever the transport.

use std::{fmt::Display, time::Duration};

use gyre_colossus::{Azimuth, BadConfiguration, Configuration};
use gyre_datasets::DatasetOptions;
use gyre_messages::ScanHeader;
use gyre_stage::source::Received;
use thiserror::Error;

use crate::live_radar::{scan_assembly::ScanAssembly, turn_counter::TurnCounter};

pub struct Intake {
    constants: DatasetOptions,
    /// `None` until the radar has sent its configuration.
    scans: Option<ScanAssembly>,
    turns: TurnCounter,
    /// The counts since the start of the run, without the counts of turns and connections.
    counts: Received,
    due_ns: Option<i64>,
}

/// A configuration whose scans do not fit into this run.
#[derive(Debug, Error)]
pub enum NoScans {
    #[error(transparent)]
    Bad(#[from] BadConfiguration),
    #[error(
        "the scans of the radar have {bytes} bytes now, {room} at the start of the run: start the run again"
    )]
    TooLarge { bytes: usize, room: usize },
}

impl Intake {
    pub fn new(constants: DatasetOptions) -> Self {
        Self {
            constants,
            scans: None,
            turns: TurnCounter::resume(None, 0),
            counts: Received::default(),
            due_ns: None,
        }
    }

    /// Begins the scans of a configuration of at most `room` bytes; false if it is not new.
    pub fn configure(&mut self, radar: Configuration, room: usize) -> Result<bool, NoScans> {
        if self.scans.as_ref().is_some_and(|scans| scans.is_of(&radar)) {
            return Ok(false);
        }
        let new = ScanAssembly::new(radar, self.constants)?;
        let bytes = new.assembler.limits().bytes;
        if bytes > room {
            return Err(NoScans::TooLarge { bytes, room });
        }
        self.turns.configure(radar.period_ns());
        self.scans = Some(new);
        Ok(true)
    }

    pub fn is_configured(&self) -> bool {
        self.scans.is_some()
    }

    pub fn restart(&mut self) {
        self.scans = None;
    }

    /// Adds an azimuth that arrived at `arrival_ns` (since 1970); true if a scan is complete.
    /// Without a configuration it is dropped.
    pub fn add(
        &mut self,
        azimuth: Azimuth<'_>,
        arrival_ns: i64,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> bool {
        let scans = self.scans.as_mut();
        let scan =
            scans.and_then(|scans| scans.add(azimuth, arrival_ns, &mut self.turns, header, bytes));
        if let Some((missing, due_ns)) = scan {
            self.counts.missing_azimuths += missing as u64;
            self.due_ns = due_ns;
        }
        scan.is_some()
    }

    pub fn damaged(&mut self, reason: impl Display, skipped_bytes: usize) {
        self.counts.damaged_messages += 1;
        let so_far = self.counts.damaged_messages;
        // There may be thousands in a second.
        if so_far.is_power_of_two() {
            tracing::warn!(
                skipped_bytes,
                so_far,
                "the radar's messages are damaged: {reason}"
            );
        }
    }

    pub fn pause(&self) -> Option<Duration> {
        self.scans.as_ref().and_then(ScanAssembly::pause)
    }

    /// Returns the time when the last scan was complete by the radar's clock, in `CLOCK_MONOTONIC`,
    /// ns; `None`: not known.
    pub fn due_ns(&self) -> Option<i64> {
        self.due_ns
    }

    pub fn resume(&mut self, before: Received) {
        self.turns = TurnCounter::resume(before.last_scan, before.scans_left_out);
        self.counts = before;
    }

    pub fn received(&self) -> Received {
        // Whether the turn of the newest azimuth can still become a scan.
        let scans = self.scans.as_ref();
        let is_open = scans.is_some_and(|scans| scans.assembler.is_open());
        Received {
            scans_left_out: self.turns.left_out(is_open),
            last_scan: self.turns.last(),
            ..self.counts
        }
    }
}
