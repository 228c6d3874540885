//! What a live source makes of what arrives, however it arrives.

use std::{fmt::Display, time::Duration};

use gyre_colossus::{Azimuth, BadConfiguration, Configuration, Constants};
use gyre_messages::ScanHeader;
use gyre_stage::source::Received;
use thiserror::Error;

use crate::{sweeps::Sweeps, turns::Turns};

/// Configurations and azimuths of a radar to scans, with counts of what is lost.
pub struct Intake {
    constants: Constants,
    /// `None` until the radar has sent its configuration.
    sweeps: Option<Sweeps>,
    turns: Turns,
    /// What the source before has counted, if it died.
    before: Received,
    missing: u64,
    damaged: u64,
    due_ns: Option<i64>,
}

/// Why a configuration makes no scans of this run.
#[derive(Debug, Error)]
pub enum NoScans {
    /// Of none.
    #[error(transparent)]
    Bad(#[from] BadConfiguration),
    /// They are larger than those at its start.
    #[error(
        "the scans of the radar have {bytes} bytes now, {room} at the start of the run: start the run again"
    )]
    TooLarge {
        /// Bytes of a scan.
        bytes: usize,
        /// Those that the run has for one.
        room: usize,
    },
}

impl Intake {
    /// An intake without a configuration.
    pub fn new(constants: Constants) -> Self {
        Self {
            constants,
            sweeps: None,
            turns: Turns::resume(None, 0),
            before: Received::default(),
            missing: 0,
            damaged: 0,
            due_ns: None,
        }
    }

    /// Begins the scans of a configuration; false if it is the one so far. `room` is what the run has for a scan, bytes.
    ///
    /// # Errors
    /// It makes no scans of this run.
    pub fn configure(&mut self, radar: Configuration, room: usize) -> Result<bool, NoScans> {
        let is_known = |sweeps: &Sweeps| sweeps.is_of(&radar);
        if self.sweeps.as_ref().is_some_and(is_known) {
            return Ok(false);
        }
        let new = Sweeps::new(radar, self.constants)?;
        let bytes = new.bytes();
        if bytes > room {
            return Err(NoScans::TooLarge { bytes, room });
        }
        self.turns.configure(radar.period_ns());
        self.sweeps = Some(new);
        Ok(true)
    }

    /// Returns whether there is a configuration.
    pub fn is_configured(&self) -> bool {
        self.sweeps.is_some()
    }

    /// Forgets the configuration and the scan that is not complete: what follows is of a new connection.
    pub fn restart(&mut self) {
        self.sweeps = None;
    }

    /// Adds an azimuth that arrived at `arrival_ns` (since 1970); true if a scan is complete. Without a configuration it is dropped.
    pub fn add(
        &mut self,
        azimuth: Azimuth<'_>,
        arrival_ns: i64,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> bool {
        let sweeps = self.sweeps.as_mut();
        let scan = sweeps
            .and_then(|sweeps| sweeps.add(azimuth, arrival_ns, &mut self.turns, header, bytes));
        if let Some(scan) = scan {
            self.missing += scan.missing as u64;
            self.due_ns = scan.due_ns;
        }
        scan.is_some()
    }

    /// Counts a message that cannot be used.
    pub fn damaged(&mut self, reason: impl Display, skipped_bytes: usize) {
        self.damaged += 1;
        // There may be thousands in a second.
        if self.damaged.is_power_of_two() {
            let so_far = self.damaged;
            tracing::warn!(
                skipped_bytes,
                so_far,
                "the radar's messages are damaged: {reason}"
            );
        }
    }

    /// The time for which no scan can be complete, if it is that of a few azimuths: so many are then read at once.
    pub fn pause(&self) -> Option<Duration> {
        self.sweeps.as_ref().and_then(Sweeps::pause)
    }

    /// When the last scan was complete by the radar's clock, `CLOCK_MONOTONIC`, ns; `None`: not known.
    pub fn due_ns(&self) -> Option<i64> {
        self.due_ns
    }

    /// Goes on counting after a source that has died.
    pub fn resume(&mut self, before: Received) {
        self.turns = Turns::resume(before.last_scan, before.scans_left_out);
        self.before = before;
    }

    /// Returns the counts since the start of the run; what else has arrived, and how, is that of the source before.
    pub fn received(&self) -> Received {
        let is_open = self.sweeps.as_ref().is_some_and(Sweeps::is_open);
        Received {
            missing_azimuths: self.before.missing_azimuths + self.missing,
            scans_left_out: self.turns.left_out(is_open),
            damaged_messages: self.before.damaged_messages + self.damaged,
            last_scan: self.turns.last(),
            ..self.before
        }
    }
}
