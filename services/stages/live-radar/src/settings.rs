//! The settings of a source.

use std::time::Duration;

use gyre_colossus::{Address, Constants};

use crate::parser::RadarParser;

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
    pub(crate) fn parser(&self) -> RadarParser {
        RadarParser::new(self.address.is_udp(), self.encoder_counts)
    }
}
