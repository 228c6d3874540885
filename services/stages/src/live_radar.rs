//! The source stage of a live radar: receives azimuths by Navtech's protocol Colossus (TCP), or as
//! ASTERIX CAT-240 by UDP, and publishes each sweep on `scan`, written directly into shared memory.
//! [`Intake`] makes scans of azimuths, whatever the transport.

mod ask;
mod connection;
mod intake;
mod radar;
mod read_delay;
mod scan_assembly;
mod settings;
mod turn_counter;

use gyre_stage::{Launch, StageCounters, StageError, source};

pub use ask::{AskError, Sizes, ask};
pub use connection::{RadarParser, RadarSocket};
pub use gyre_colossus::PORT;
pub use intake::{Intake, NoScans};
pub use settings::{Settings, encoder_counts, silence};

/// Receives the scans of a radar until SIGTERM, or until there are enough.
pub fn run(launch: &Launch, settings: Settings) -> Result<StageCounters, StageError> {
    let scans = settings.scans;
    source::run_sensor(launch, &mut radar::Radar::new(settings), scans)
}
