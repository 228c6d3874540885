//! The control of a running run: requests to its supervisor, their answers, and its status.
//!
//! The supervisor answers at a socket in the run's root, which is the user's alone: one request on
//! one line of JSON, one answer on another, and the connection is closed.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::{command::Command, run::StageCounters};

pub const SOCKET: &str = "control.sock";

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Request {
    Status,
    /// End the run as an interrupt does: its journal stays, and the same command continues it.
    Stop,
    Restart {
        process: String,
    },
    Swap(Swap),
    Command(Command),
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Swap {
    pub process: String,
    /// Program and arguments; `None`: those that the run was begun with.
    pub command: Option<Vec<String>>,
    pub directory: PathBuf,
    /// True if the program is started only when the one before has ended, since it cannot stand by.
    pub cold: bool,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Answer {
    Status(Box<Status>),
    Done,
    /// To [`Request::Command`]: the number that it has in the file of commands.
    Numbered(u64),
    Refused(String),
    /// To [`Request::Swap`]: the program has taken over, and nothing has shown yet that it works; a
    /// sentence.
    Untried(String),
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    pub pid: u32,
    pub out: PathBuf,
    pub started_in: PathBuf,
    pub live: bool,
    pub phase: Phase,
    pub uptime_s: f64,
    /// Scans that the source has published; `None` if a replaced source does not report them.
    pub published: Option<u64>,
    pub poses: u64,
    pub dropped: u64,
    /// Time since the newest pose was seen, s; `None` before the first one.
    pub last_pose_s: Option<f64>,
    /// The trouble of the whole run: it waits for its radar, or its disk is full.
    #[serde(default)]
    pub notice: Option<String>,
    /// True while poses are held in memory, or lost, because the disk is full.
    #[serde(default)]
    pub disk_is_full: bool,
    pub swap: Option<PendingSwap>,
    pub processes: Vec<ProcessStatus>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PendingSwap {
    pub process: String,
    pub command: Vec<String>,
    /// True if the program has taken over, but no scan has passed through it yet; false if it has
    /// not reported that it is ready to take over.
    pub has_taken_over: bool,
    pub waited_s: f64,
    pub limit_s: Option<f64>,
}

gyre_geometry::named! {
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Phase {
        /// A stage has not opened its topics.
        #[default]
        Starting = "starting",
        Running = "running",
        /// No azimuth arrives from the radar, before the processes start or while they work.
        WaitingForRadar = "waiting for radar",
        /// The stream has ended, and followers read their logs to the end.
        Following = "following",
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProcessStatus {
    pub name: String,
    pub pid: u32,
    pub command: Vec<String>,
    pub is_swapped: bool,
    pub activity: Activity,
    /// For how long it has done that, s; `None` if it does not report it.
    pub activity_s: Option<f64>,
    pub uptime_s: f64,
    pub restarts: usize,
    pub last_death: Option<String>,
    /// Messages that it should have recorded and has missed since its start; `None` if it is no
    /// recorder.
    pub missed: Option<u64>,
    /// The counts of a live radar's data; `None` if it is no source of one.
    pub received: Option<Received>,
}

gyre_geometry::named! {
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Activity {
        /// It has not opened its topics: it may be loading a model.
        Starting = "starting",
        Waiting = "waiting",
        Working = "working",
        /// It has not woken from a sleep that has ended: it is stopped, or not run by the system.
        Silent = "silent",
        /// It runs, and writes no heartbeat, as a replacement need not.
        Running = "running",
        Ended = "ended",
    }
}

/// Counts of the deliveries and losses of a live sensor since the start of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Received {
    /// Azimuths that are missing from the scans that were published.
    pub missing_azimuths: u64,
    /// Turns of the sensor without a scan.
    pub scans_left_out: u64,
    pub damaged_messages: u64,
    /// Datagrams of others, and descriptions of scans that do not fit into the run. They were
    /// passed over.
    pub foreign_messages: u64,
    pub connections: u64,
    pub is_receiving: bool,
    pub last_scan: Option<LastScan>,
    /// `None` if the sensor has no clock, or has sent no scan.
    #[serde(default)]
    pub clock: Option<SensorClock>,
}

/// The clock of a live sensor against this host's, over the last scans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SensorClock {
    /// This host's time minus the sensor's at the arrival of a scan, with the least delay of the
    /// network, ns.
    pub offset_ns: i64,
    /// The delay beyond that which nine of ten scans have at most, ns.
    pub jitter_ns: i64,
    /// The number of times that one of the clocks was set.
    pub steps: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LastScan {
    /// Time of its middle by the sensor, ns.
    pub stamp_ns: i64,
    /// When its last azimuth was read, `CLOCK_MONOTONIC`, ns.
    pub at_ns: i64,
}

/// [`Received`] as numbers.
pub const RECEIVED: usize = 13;

impl Received {
    #[must_use]
    pub fn reconnections(&self) -> u64 {
        self.connections.saturating_sub(1)
    }

    pub fn count(&self, counters: &mut StageCounters) {
        counters.missing_azimuths = self.missing_azimuths;
        counters.scans_left_out = self.scans_left_out;
        counters.damaged_messages = self.damaged_messages;
        counters.foreign_messages = self.foreign_messages;
        counters.reconnections = self.reconnections();
    }

    pub fn to_numbers(self) -> [u64; RECEIVED] {
        let scan = self.last_scan.unwrap_or_default();
        let clock = self.clock.unwrap_or_default();
        [
            self.missing_azimuths,
            self.scans_left_out,
            self.damaged_messages,
            self.foreign_messages,
            self.connections,
            self.is_receiving.into(),
            self.last_scan.is_some().into(),
            scan.stamp_ns as u64,
            scan.at_ns as u64,
            self.clock.is_some().into(),
            clock.offset_ns as u64,
            clock.jitter_ns as u64,
            clock.steps,
        ]
    }

    pub fn of_numbers(numbers: [u64; RECEIVED]) -> Self {
        let [missing_azimuths, scans_left_out, damaged_messages, ..] = numbers;
        let [_, _, _, foreign_messages, connections, receives, ..] = numbers;
        let [.., has_scan, _, _, has_clock, _, _, steps] = numbers;
        let signed = numbers.map(|number| number as i64);
        let [.., stamp_ns, at_ns, _, offset_ns, jitter_ns, _] = signed;
        Self {
            missing_azimuths,
            scans_left_out,
            damaged_messages,
            foreign_messages,
            connections,
            is_receiving: receives != 0,
            last_scan: (has_scan != 0).then_some(LastScan { stamp_ns, at_ns }),
            clock: (has_clock != 0).then_some(SensorClock {
                offset_ns,
                jitter_ns,
                steps,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_received_is_read_as_it_was_written() {
        let numbers = [1, 2, 3, 4, u64::MAX, 1, 1, 5, 6, 1, u64::MAX, 7, 8];
        for numbers in [numbers, [0; RECEIVED]] {
            assert_eq!(Received::of_numbers(numbers).to_numbers(), numbers);
        }
    }
}
