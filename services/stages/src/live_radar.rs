//! The source stage of a live radar: receives azimuths by Navtech's protocol Colossus (TCP), or as
//! ASTERIX CAT-240 by UDP, and publishes each sweep on `scan`, written directly into shared memory.
//! [`Intake`] makes scans of azimuths, whatever the transport.

mod ask;
mod clock_watch;
mod connection;
mod intake;
mod radar;
mod read_delay;
mod scan_assembly;
mod turn_counter;

use std::time::Duration;

use gyre_colossus::{Address, BadAddress};
use gyre_contract::run::{SourceConfig, StageCounters};
use gyre_datasets::DatasetOptions;
use gyre_stage::{Launch, source};
use gyre_transport::RunError;

pub use ask::{AskError, Sizes, ask};
pub use gyre_colossus::PORT;
pub use intake::{Intake, NoScans};

use connection::RadarParser;

pub fn run(launch: &Launch, settings: Settings) -> Result<StageCounters, RunError> {
    let scans = settings.scans;
    source::run_sensor(launch, &mut radar::Radar::new(settings), scans)
}

/// Encoder counts per turn of a radar that does not report them, unless `dataset.encoder_counts` is
/// set.
const ENCODER_COUNTS: u16 = 5600;

/// The address of a radar, and the properties that it does not send.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub address: Address,
    /// Encoder counts per turn, for rounding the angles of a radar that sends by UDP.
    pub encoder_counts: u16,
    /// Time without an azimuth after which the run reconnects.
    pub silence: Duration,
    pub scans: Option<u64>,
    pub constants: DatasetOptions,
}

impl Settings {
    /// Returns the settings of the section `[source]`, with the constants of the section
    /// `[dataset]`.
    pub fn of(source: &SourceConfig, options: &DatasetOptions) -> Result<Self, BadAddress> {
        Ok(Self {
            address: Address::parse(&source.address, &source.interface)?,
            encoder_counts: encoder_counts(options),
            silence: silence(source),
            scans: source.scans.map(|scans| scans as u64),
            constants: *options,
        })
    }

    pub(crate) fn parser(&self) -> RadarParser {
        RadarParser::new(self.address.is_udp(), self.encoder_counts)
    }
}

pub fn encoder_counts(options: &DatasetOptions) -> u16 {
    options.encoder_counts.unwrap_or(ENCODER_COUNTS)
}

/// Returns the time without a byte or a message after which something is done about it.
pub fn silence(source: &SourceConfig) -> Duration {
    match Duration::try_from_secs_f64(source.silence_s) {
        Ok(silence) if !silence.is_zero() => silence,
        _ => Duration::MAX,
    }
}
