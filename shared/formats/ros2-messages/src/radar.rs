//! Navtech's messages as azimuths of [`gyre_colossus`], and scans as Navtech's messages.
//!
//! All kinds of messages become azimuths, so that one assembler makes scans of them
//! ([`SweepAssembler`](gyre_colossus::SweepAssembler)), and one clock gives them times
//! ([`RadarClock`](gyre_colossus::RadarClock)).

mod b_scan;
mod configuration;
mod scan;

pub use b_scan::TimedAzimuth;
pub use configuration::DescribedRadar;
pub use scan::{Encoder, ScanMessages};
