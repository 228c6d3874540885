//! A radar as the source of a run.

use std::{os::fd::BorrowedFd, time::Duration};

use gyre_colossus::{Configuration, Damage, Event, Message};
use gyre_messages::{ScanHeader, StageId};
use gyre_stage::{
    StageError,
    source::{Arrival, Received as Counts, Sensor},
};

use crate::{
    Address, Settings,
    connection::{Connection, Received},
    ills::Ills,
    messages::Messages,
    sweeps::Sweeps,
    turns::Turns,
};

/// Reads after which the process looks for signals and new readers, however much there is to read.
const MAX_READS: usize = 64;
/// Bytes without a message after which what is connected to is no radar.
const MAX_SKIPPED_BYTES: usize = 1 << 22;

/// A radar on the network.
pub struct Radar {
    settings: Settings,
    connection: Connection,
    messages: Messages,
    /// `None` until the radar has sent its configuration.
    sweeps: Option<Sweeps>,
    turns: Turns,
    /// What the source before has counted, if it died.
    before: Counts,
    missing: u64,
    damaged: u64,
    /// Descriptions of scans that do not fit into the run.
    refused: u64,
    due_ns: Option<i64>,
    ills: Ills,
}

impl Radar {
    /// A radar that is connected to when it is first asked.
    pub fn new(settings: Settings) -> Self {
        Self {
            connection: Connection::new(&settings),
            messages: Messages::new(&settings),
            settings,
            sweeps: None,
            turns: Turns::resume(None, 0),
            before: Counts::default(),
            missing: 0,
            damaged: 0,
            refused: 0,
            due_ns: None,
            ills: Ills::default(),
        }
    }

    /// Begins the scans of a configuration, unless it is the one so far. One that makes no scans of this run is passed over, if it came
    /// in a datagram, which anybody can send.
    fn configure(&mut self, radar: Configuration, room: usize) -> Result<(), StageError> {
        let is_known = |sweeps: &Sweeps| sweeps.is_of(&radar);
        if self.sweeps.as_ref().is_some_and(is_known) {
            return Ok(());
        }
        let new = match Sweeps::new(radar, &self.settings) {
            Ok(new) => new,
            Err(error) => {
                self.refuse(&error.to_string());
                return Ok(());
            }
        };
        let bytes = new.bytes();
        if bytes > room {
            let reason = format!(
                "the scans of the radar have {bytes} bytes now, {room} at the start of the run: start the run again"
            );
            if let Address::Tcp(_) = self.settings.address {
                return Err(StageError::Input(reason));
            }
            self.refuse(&reason);
            return Ok(());
        }
        self.connection.take_sender();
        self.turns.configure(radar.period_ns());
        self.sweeps = Some(new);
        Ok(())
    }

    /// Passes over the radar's description, and what a datagram has beside it.
    fn refuse(&mut self, reason: &str) {
        self.messages.refuse_description();
        self.refused += 1;
        if self.refused.is_power_of_two() {
            let so_far = self.refused;
            tracing::warn!(so_far, "the radar's configuration is passed over: {reason}");
        }
    }

    /// How to wait for more: after a pause that is shorter than the time to the end of the scan, if the radar sends at all.
    fn wait(&self, limit: Duration, has_received: bool) -> Arrival {
        let pause = self.sweeps.as_ref().filter(|_| has_received);
        match pause.and_then(Sweeps::pause) {
            Some(pause) if pause < limit => Arrival::Later(pause),
            _ => Arrival::Nothing(limit),
        }
    }

    /// Forgets what a connection that is closed has sent: no later one goes on with it.
    fn forget(&mut self) {
        self.messages = Messages::new(&self.settings);
        self.sweeps = None;
    }

    /// Handles what is in the parser up to the next complete scan; true if there is one.
    fn parse(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<bool, StageError> {
        while let Some(event) = self.messages.next() {
            match event {
                Event::Message(Message::Azimuth(azimuth)) => {
                    self.connection.has_heard();
                    let sweeps = self.sweeps.as_mut();
                    let scan = sweeps
                        .and_then(|sweeps| sweeps.add(azimuth, &mut self.turns, header, bytes));
                    if let Some(scan) = scan {
                        self.missing += scan.missing as u64;
                        self.due_ns = scan.due_ns;
                        self.connection.has_scan();
                        return Ok(true);
                    }
                }
                Event::Message(Message::Configuration(radar)) => {
                    self.configure(radar, bytes.len())?
                }
                Event::Message(Message::Health(health)) => self.ills.note(&health),
                Event::Message(_) => {}
                Event::Damaged {
                    reason,
                    skipped_bytes,
                } => count_damage(&mut self.damaged, &reason, skipped_bytes),
            }
        }
        if self.messages.take_part() {
            self.connection.has_heard();
        }
        Ok(false)
    }
}

fn count_damage(so_far: &mut u64, reason: &Damage, skipped_bytes: usize) {
    *so_far += 1;
    // There may be thousands in a second.
    if so_far.is_power_of_two() {
        tracing::warn!(
            skipped_bytes,
            so_far,
            "the radar's messages are damaged: {reason}"
        );
    }
}

impl Sensor for Radar {
    const HOP: StageId = StageId::RadarReplay;

    fn connection(&self) -> Option<BorrowedFd<'_>> {
        self.connection.socket()
    }

    fn take(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<Arrival, StageError> {
        let mut has_received = false;
        for _ in 0..MAX_READS {
            if self.parse(header, bytes)? {
                return Ok(Arrival::Scan);
            }
            let received = match self.messages.skipped_bytes() > MAX_SKIPPED_BYTES {
                true => self.connection.close("it does not speak Colossus"),
                false => self.connection.receive(&mut self.messages),
            };
            match received {
                Received::Bytes => has_received = true,
                Received::Opened => {}
                Received::Nothing(limit) => return Ok(self.wait(limit, has_received)),
                Received::Closed(limit) => {
                    self.forget();
                    return Ok(Arrival::Nothing(limit));
                }
            }
        }
        Ok(Arrival::Nothing(Duration::ZERO))
    }

    fn due_ns(&self) -> Option<i64> {
        self.due_ns
    }

    fn resume(&mut self, before: Counts) {
        self.turns = Turns::resume(before.last_scan, before.scans_left_out);
        self.before = before;
    }

    fn received(&self) -> Counts {
        let is_open = self.sweeps.as_ref().is_some_and(Sweeps::is_open);
        let (before, connection) = (&self.before, &self.connection);
        Counts {
            missing_azimuths: before.missing_azimuths + self.missing,
            scans_left_out: self.turns.left_out(is_open),
            damaged_messages: before.damaged_messages + self.damaged,
            foreign_messages: before.foreign_messages + connection.foreign + self.refused,
            connections: before.connections + connection.opened,
            is_receiving: connection.is_heard(),
            last_scan: self.turns.last(),
        }
    }
}
