//! The source stage of a live radar: receives azimuths by Navtech's protocol Colossus (TCP), or as
//! ASTERIX CAT-240 by UDP, and publishes each sweep on `scan`, written directly into shared memory.
//!
//! Reading order: `radar` (the sensor), `connection` and `parser` (bytes to messages), [`Intake`]
//! and `scan_assembly` (azimuths to scans), `turn_counter` (turns without a scan), `read_delay`
//! (the time at which a scan was complete).

mod ask;
mod connection;
mod health_log;
mod intake;
mod parser;
mod radar;
mod read_delay;
mod scan_assembly;
mod turn_counter;

use std::time::Duration;

use gyre_colossus::{Address, Constants};
use gyre_stage::{Launch, StageCounters, StageError, source};

pub use ask::{AskError, Sizes, ask};
pub use connection::RadarSocket;
pub use gyre_colossus::PORT;
pub use intake::{Intake, NoScans};
pub use parser::RadarParser;

/// The address of a radar, and the properties that it does not send.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The address at which it is received.
    pub address: Address,
    /// Encoder counts per turn, to which the angles of a radar are rounded that sends by UDP.
    pub encoder_counts: u16,
    /// Time without an azimuth after which the run reconnects.
    pub silence: Duration,
    /// Scans to receive; `None`: without end.
    pub scans: Option<u64>,
    /// Constants of its ranges and angles.
    pub constants: Constants,
}

impl Settings {
    fn parser(&self) -> RadarParser {
        RadarParser::new(self.address.is_udp(), self.encoder_counts)
    }
}

/// Receives the scans of a radar until SIGTERM, or until there are enough.
///
/// # Errors
/// A radar that is connected to by TCP and whose scans are larger than at the start of the run, or
/// a failure of the transport.
pub fn run(launch: &Launch, settings: Settings) -> Result<StageCounters, StageError> {
    let scans = settings.scans;
    source::run_sensor(launch, &mut radar::Radar::new(settings), scans)
}
