//! A radar as the source of a run.

use std::{
    os::fd::BorrowedFd,
    time::{Duration, SystemTime},
};

use gyre_colossus::{Configuration, Event, Message};
use gyre_messages::{ScanHeader, StageId};
use gyre_stage::{
    StageError,
    source::{Arrival, Received as Counts, Sensor},
};

use crate::{
    Address, Intake, NoScans, Settings,
    connection::{Connection, Received},
    ills::Ills,
    messages::Messages,
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
    intake: Intake,
    /// What the source before has counted, if it died.
    before: Counts,
    /// Descriptions of scans that do not fit into the run.
    refused: u64,
    ills: Ills,
}

impl Radar {
    /// A radar that is connected to when it is first asked.
    pub fn new(settings: Settings) -> Self {
        Self {
            connection: Connection::new(&settings),
            messages: Messages::new(&settings),
            intake: Intake::new(settings.constants),
            settings,
            before: Counts::default(),
            refused: 0,
            ills: Ills::default(),
        }
    }

    /// Begins the scans of a configuration, unless it is the one so far. One that makes no scans of this run is passed over, if it came
    /// in a datagram, which anybody can send.
    fn configure(&mut self, radar: Configuration, room: usize) -> Result<(), StageError> {
        let is_tcp = matches!(self.settings.address, Address::Tcp(_));
        match self.intake.configure(radar, room) {
            Ok(true) => self.connection.take_sender(),
            Ok(false) => {}
            Err(error @ NoScans::TooLarge { .. }) if is_tcp => {
                return Err(StageError::Input(error.to_string()));
            }
            Err(error) => self.refuse(&error.to_string()),
        }
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
        match self.intake.pause().filter(|_| has_received) {
            Some(pause) if pause < limit => Arrival::Later(pause),
            _ => Arrival::Nothing(limit),
        }
    }

    /// Forgets what a connection that is closed has sent: no later one goes on with it.
    fn forget(&mut self) {
        self.messages = Messages::new(&self.settings);
        self.intake.restart();
    }

    /// Handles what is in the parser up to the next complete scan; true if there is one.
    fn parse(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<bool, StageError> {
        while let Some(event) = self.messages.next() {
            match event {
                Event::Message(Message::Azimuth(azimuth)) => {
                    self.connection.has_heard();
                    if self.intake.add(azimuth, now_ns(), header, bytes) {
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
                } => self.intake.damaged(reason, skipped_bytes),
            }
        }
        if self.messages.take_part() {
            self.connection.has_heard();
        }
        Ok(false)
    }
}

/// The host's clock, ns since 1970.
fn now_ns() -> i64 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.unwrap_or(Duration::ZERO).as_nanos() as i64
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
        self.intake.due_ns()
    }

    fn resume(&mut self, before: Counts) {
        self.intake.resume(before);
        self.before = before;
    }

    fn received(&self) -> Counts {
        let (before, connection) = (&self.before, &self.connection);
        Counts {
            foreign_messages: before.foreign_messages + connection.foreign + self.refused,
            connections: before.connections + connection.opened,
            is_receiving: connection.is_heard(),
            ..self.intake.received()
        }
    }
}
