//! A radar as the source of a run.

use std::{os::fd::BorrowedFd, time::Duration};

use gyre_colossus::{Configuration, Event, Health, HealthStatus, Message};
use gyre_contract::{ScanHeader, StageId, control::Received as Counts};
use gyre_stage::source::{Arrival, Sensor};
use gyre_transport::{RunError, clock};

use crate::live_radar::{
    Intake, NoScans, Settings,
    connection::{Connection, RadarParser, ReadResult},
};

/// The most reads between two checks for signals and new readers.
const MAX_READS: usize = 64;
/// Bytes without a message after which the other end does not count as a radar.
const MAX_SKIPPED_BYTES: usize = 1 << 22;

pub struct Radar {
    settings: Settings,
    connection: Connection,
    messages: RadarParser,
    intake: Intake,
    /// Descriptions of scans that do not fit into the run.
    refused: u64,
    health: HealthLog,
}

impl Radar {
    pub fn new(settings: Settings) -> Self {
        Self {
            connection: Connection::new(&settings),
            messages: settings.parser(),
            intake: Intake::new(settings.constants),
            settings,
            refused: 0,
            health: HealthLog::default(),
        }
    }

    /// Begins the scans of a new configuration. One whose scans do not fit into this run is ignored
    /// if it came in a datagram, which anybody can send.
    fn configure(&mut self, radar: Configuration, room: usize) -> Result<(), RunError> {
        match self.intake.configure(radar, room) {
            Ok(true) => self.connection.lock_sender(),
            Ok(false) => {}
            Err(error @ NoScans::TooLarge { .. }) if !self.settings.address.is_udp() => {
                return Err(RunError::Input(error.to_string()));
            }
            Err(error) => self.refuse(&error.to_string()),
        }
        Ok(())
    }

    /// Ignores the radar's description, and the rest of its datagram.
    fn refuse(&mut self, reason: &str) {
        self.messages.refuse_description();
        self.refused += 1;
        if self.refused.is_power_of_two() {
            let so_far = self.refused;
            tracing::warn!(so_far, "the radar's configuration is passed over: {reason}");
        }
    }

    /// Returns how to wait for more: the pause ends before the scan does.
    fn wait(&self, limit: Duration, has_received: bool) -> Arrival {
        match self.intake.pause().filter(|_| has_received) {
            Some(pause) if pause < limit => Arrival::Later(pause),
            _ => Arrival::Nothing(limit),
        }
    }

    fn reset(&mut self) {
        self.messages = self.settings.parser();
        self.intake.restart();
    }

    fn parse(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<bool, RunError> {
        while let Some(event) = self.messages.next() {
            match event {
                Event::Message(Message::Azimuth(azimuth)) => {
                    self.connection.note_azimuth();
                    if self
                        .intake
                        .add(azimuth, clock::since_1970_ns(), header, bytes)
                    {
                        self.connection.note_scan();
                        return Ok(true);
                    }
                }
                Event::Message(Message::Configuration(radar)) => {
                    self.configure(radar, bytes.len())?
                }
                Event::Message(Message::Health(health)) => self.health.update(&health),
                Event::Message(_) => {}
                Event::Damaged {
                    reason,
                    skipped_bytes,
                } => self.intake.damaged(reason, skipped_bytes),
            }
        }
        if self.messages.take_part() {
            self.connection.note_azimuth();
        }
        Ok(false)
    }
}

impl Sensor for Radar {
    const HOP: StageId = StageId::RadarReplay;

    fn connection(&self) -> Option<BorrowedFd<'_>> {
        self.connection.socket()
    }

    fn take(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<Arrival, RunError> {
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
                ReadResult::Bytes => has_received = true,
                ReadResult::Opened => {}
                ReadResult::Nothing(limit) => return Ok(self.wait(limit, has_received)),
                ReadResult::Closed(limit) => {
                    self.reset();
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
    }

    fn received(&self) -> Counts {
        let mut counts = self.intake.received();
        counts.foreign_messages += self.connection.foreign + self.refused;
        counts.connections += self.connection.opened;
        counts.is_receiving = self.connection.receives_azimuths;
        counts
    }
}

/// The radar's health in the log: each change is logged once.
#[derive(Clone, Debug, Default)]
struct HealthLog {
    unhealthy: Vec<&'static str>,
    is_silent: bool,
}

impl HealthLog {
    fn update(&mut self, health: &Health) {
        for (name, reading) in health.readings() {
            let (value, status) = (reading.value, reading.status);
            let is_unhealthy = matches!(status, HealthStatus::Unhealthy | HealthStatus::Warning);
            let logged = self.unhealthy.iter().position(|it| *it == name);
            match (is_unhealthy, logged) {
                (true, None) => {
                    tracing::warn!("the radar reports that its {name}, {value}, is {status}");
                    self.unhealthy.push(name);
                }
                (false, Some(index)) => {
                    tracing::info!("the radar reports that its {name}, {value}, is {status} again");
                    self.unhealthy.swap_remove(index);
                }
                _ => {}
            }
        }
        let is_silent = health.transmitting == Some(false);
        if is_silent && !self.is_silent {
            tracing::warn!("the radar reports that it does not transmit: its scans have no echoes");
        }
        self.is_silent = is_silent;
    }
}
